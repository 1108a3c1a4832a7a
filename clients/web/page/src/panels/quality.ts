// The uncertainty of the depth, and what to do where that is less than it could be.
import { create } from "@bufbuild/protobuf";
import { GetReferenceSchema } from "../../gen/dtact_pb";
import type { Event, Status } from "../../gen/dtact_pb";
import { el, Facts, panel, say } from "../dom";
import type { Frame } from "../session/messages";
import type { Sensor } from "../session/sensor";
import { healthName, fixed, signedPercent, span, stateName, um } from "../labels";

export class QualityPanel {
  private readonly facts = new Facts({
    state: { label: "State" },
    uncertainty: {
      label: "Uncertainty",
      hint: "Mean absolute error to expect inside the contact",
    },
    noContact: {
      label: "RMS without contact",
      hint: "In the last frame in which there was no contact; 0 where nothing differs from the reference",
    },
    reference: {
      label: "Reference's age",
      hint: "The reference image that depth is measured against",
    },
    drift: {
      label: "Light followed",
      hint: "How far the light has drifted since the reference was taken",
    },
    map: { label: "Map" },
    camera: { label: "Camera" },
    calibration: { label: "Calibration" },
  });
  private readonly healthFlags = el("ul", { class: "health" });
  private readonly advice = el("p", { class: "advice", role: "status" });
  readonly element = panel("Quality", this.healthFlags, this.advice, this.facts.element);
  private reference: { sequence: number; restored: boolean } | undefined;
  private fps = 0;
  private sequence = 0;

  show(frame: Frame): void {
    this.sequence = frame.sequence;
    const depth = frame.depth;
    if (depth) {
      this.facts.set("uncertainty", `± ${um(depth.uncertaintyUm)}`);
      const sharpened = depth.sharpenSteps > 0 ? `, sharpened ${depth.sharpenSteps}×` : "";
      const share =
        ["", "full", "half", "", "quarter"][depth.decimation] ?? `1/${depth.decimation}`;
      this.facts.set("map", `${depth.width} × ${depth.height}, ${share}${sharpened}`);
    }
    if (frame.noContactRmsUm !== undefined)
      this.facts.set("noContact", `${fixed(frame.noContactRmsUm, 1)} µm`);
    const reference = this.reference;
    if (reference && this.fps > 0) {
      const age = span(Math.max(0, this.sequence - reference.sequence) / this.fps);
      this.facts.set("reference", `${age}${reference.restored ? ", restored" : ""}`);
    }
  }

  event(event: Event): void {
    if (event.what.case !== "reference") return;
    const { sequence, restored } = event.what.value;
    this.measuredFrom(sequence, restored);
  }

  /** The last frame of the reference; 0 in a recording, which does not say it. */
  private measuredFrom(sequence: bigint, restored: boolean): void {
    this.reference = sequence > 0n ? { sequence: Number(sequence), restored } : undefined;
    if (!this.reference) this.facts.set("reference", "–");
  }

  /** After connecting: events report only later changes. */
  async ask(sensor: Sensor): Promise<void> {
    this.reference = undefined;
    this.facts.set("reference", "–");
    if (!sensor.features.includes("reference")) return;
    try {
      const result = await sensor.request({
        case: "getReference",
        value: create(GetReferenceSchema),
      });
      if (result.case === "reference" && !this.reference)
        this.measuredFrom(result.value.sequence, false);
    } catch {
      // There is none yet; an event reports when one is taken.
    }
  }

  status(status: Status): void {
    this.fps = status.camera?.fps ?? 0;
    this.facts.set("state", stateName(status.state));
    this.facts.set("drift", signedPercent(status.lightFollowed));
    const camera = status.camera;
    if (camera) {
      const trouble = [
        [camera.lost, "lost"],
        [camera.damaged, "damaged"],
        [camera.disconnects, "unplugged"],
      ] as const;
      const reported = trouble
        .filter(([count]) => count > 0n)
        .map(([count, name]) => `, ${count} ${name}`);
      const simulated = camera.backend === "sim" ? "simulated, " : "";
      const state = camera.state === "streaming" ? "" : `${camera.state}, `;
      this.facts.set(
        "camera",
        `${simulated}${state}${fixed(status.fps, 1)} of ${fixed(camera.fps, 0)} fps${reported.join("")}`,
      );
    }
    const made = status.calibration;
    this.facts.set(
      "calibration",
      made
        ? `${made.name}, ${fixed(made.coveredFromMm, 2)} to ${fixed(made.coveredToMm, 2)} mm`
        : "none",
    );
    const names = status.health.map(healthName);
    if ([...this.healthFlags.children].map((item) => item.textContent).join() !== names.join()) {
      this.healthFlags.replaceChildren(...names.map((name) => el("li", {}, name)));
    }
    const fix = camera?.fix || status.ring?.message || "";
    const advice = status.advice || fix;
    say(this.advice, advice || "All is well.");
    this.advice.classList.toggle("well", advice === "");
  }
}
