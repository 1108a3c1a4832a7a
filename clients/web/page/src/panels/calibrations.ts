// The daemon's calibrations: which is in use, another one instead, one of this machine's.
import { create } from "@bufbuild/protobuf";
import {
  ActivateCalibrationSchema,
  ListCalibrationsSchema,
  PinCalibrationSchema,
  UploadCalibrationSchema,
} from "../../gen/dtact_pb";
import type { StoredCalibration } from "../../gen/dtact_pb";
import { button, el, panel, say } from "../dom";
import type { Sensor } from "../session/sensor";
import { MAX_MESSAGE_BYTES } from "../wire/framing";
import { Guide } from "./guide";
import type { MapShape } from "./guide";

const FILES = ["calibration.toml", "reference.png"];
/** Both files travel in one message, beside the calibration's name. */
const MAX_FILES_BYTES = MAX_MESSAGE_BYTES - 1024;

const read = async (file: File): Promise<Uint8Array> => new Uint8Array(await file.arrayBuffer());

export class CalibrationsPanel {
  private readonly list = el("ul", { class: "calibrations" });
  private readonly answer = el("p", { class: "answer", role: "alert" });
  private readonly picker = el("input", {
    type: "file",
    multiple: "",
    accept: ".toml,.png",
    hidden: "",
  });
  private readonly upload = el(
    "div",
    { class: "row" },
    button("Upload…", () => this.picker.click(), {
      title: `Choose ${FILES.join(" and ")} of a calibration's folder`,
    }),
    this.picker,
    button("Calibrate…", () => void this.guide(), {
      title: "Makes a calibration by presses of a ball of known radius",
    }),
  );
  readonly element = panel("Calibrations", this.list, this.upload, this.answer);

  /** The message shown is that the list did not arrive. */
  private lacking = false;
  private inUse: MapShape | undefined;

  /** `line`: see Guide. */
  constructor(
    private readonly sensor: Sensor,
    private readonly line: () => number[] | undefined,
  ) {
    this.picker.addEventListener("change", () => void this.send());
  }

  async refresh(): Promise<void> {
    this.upload.hidden = !this.sensor.mayCalibrate;
    try {
      const result = await this.sensor.request({
        case: "listCalibrations",
        value: create(ListCalibrationsSchema),
      });
      if (result.case !== "calibrations") return;
      const used = result.value.calibrations.find((stored) => stored.inUse)?.content;
      this.inUse = used?.case === "summary" ? used.value : undefined;
      this.list.replaceChildren(...result.value.calibrations.map((stored) => this.item(stored)));
      if (this.lacking) this.tell("");
    } catch (error) {
      this.tell((error as Error).message);
      this.lacking = true;
    }
  }

  /** Opens the guided calibration. */
  async guide(): Promise<void> {
    // The list may not have come yet, and the map's shape is in it.
    await this.refresh();
    const guide = new Guide(this.sensor, this.inUse, this.line(), () => void this.refresh());
    this.element.append(guide.element);
    guide.open();
  }

  private tell(sentence: string): void {
    say(this.answer, sentence);
    this.lacking = false;
  }

  private item(stored: StoredCalibration): HTMLElement {
    const configured = stored.number === 0n;
    const title = configured ? `${stored.name} (configured)` : `${stored.number} ${stored.name}`;
    const item = el("li", {}, el("span", { class: "name", title: stored.uploaded }, title));
    if (stored.content.case === "damage")
      item.append(el("span", { class: "trouble" }, stored.content.value));
    if (stored.inUse) item.append(el("span", { class: "tag" }, "in use"));
    else if (this.sensor.mayCalibrate && stored.content.case === "summary") {
      item.append(
        button("Use", () => void this.activate(stored.number), {
          "aria-label": `Use calibration ${title}`,
        }),
      );
    }
    if (stored.pinned) item.append(el("span", { class: "tag" }, "pinned"));
    if (this.sensor.mayCalibrate && !configured) {
      item.append(
        button(stored.pinned ? "Unpin" : "Pin", () => void this.pin(stored), {
          title: "A pinned calibration stays, whatever is uploaded later",
          "aria-label": `${stored.pinned ? "Unpin" : "Pin"} calibration ${title}`,
        }),
      );
    }
    return item;
  }

  private async activate(number: bigint): Promise<void> {
    await this.change("Changing the calibration.", () =>
      this.sensor.request({
        case: "activateCalibration",
        value: create(ActivateCalibrationSchema, { number }),
      }),
    );
  }

  private async pin(stored: StoredCalibration): Promise<void> {
    await this.change("Writing.", () =>
      this.sensor.request({
        case: "pinCalibration",
        value: create(PinCalibrationSchema, { number: stored.number, pinned: !stored.pinned }),
      }),
    );
  }

  private async send(): Promise<void> {
    const files = [...(this.picker.files ?? [])];
    const [toml, png] = FILES.map((name) => files.find((file) => file.name === name));
    this.picker.value = "";
    if (!toml || !png) return this.tell(`Choose both ${FILES.join(" and ")} of the folder.`);
    if (toml.size + png.size > MAX_FILES_BYTES)
      return this.tell("These files are too large for a calibration: 16 MiB together at most.");
    // The browser does not reveal the folder's name, so the time becomes the name.
    const name = `web-${new Date().toISOString().slice(0, 19).replaceAll(":", "")}`;
    let removed = "";
    await this.change("Uploading.", async () => {
      const [calibrationToml, referencePng] = await Promise.all([read(toml), read(png)]);
      const result = await this.sensor.request({
        case: "uploadCalibration",
        value: create(UploadCalibrationSchema, { name, calibrationToml, referencePng }),
      });
      if (result.case !== "done") return;
      removed = result.value.removed.map((old) => `${old.number} ${old.name}`).join(", ");
    });
    if (removed) this.tell(`The daemon removed ${removed}: it keeps the ten used last and pinned ones.`);
  }

  private async change(doing: string, ask: () => Promise<unknown>): Promise<void> {
    this.tell(doing);
    try {
      await ask();
      this.tell("");
    } catch (error) {
      this.tell((error as Error).message);
    }
    await this.refresh();
  }
}
