// Exposure and gain, where the camera has them.
import { create } from "@bufbuild/protobuf";
import { SetCameraSchema } from "../../gen/dtact_pb";
import type { CameraSettings } from "../../gen/dtact_pb";
import { el, say } from "../dom";
import type { Sensor } from "../session/sensor";

/** Six digits, without zeros at the end. */
const plain = (value: number): string => String(Number(value.toPrecision(6)));

type Name = "exposureUs" | "gain";

export class CameraPanel {
  private readonly fields = {
    exposureUs: this.makeField("exposureUs", "Exposure", "µs"),
    gain: this.makeField("gain", "Gain", ""),
  };
  private readonly answer = el("p", { class: "answer", role: "alert" });
  readonly element = el(
    "details",
    { class: "panel", role: "group", "aria-label": "Camera" },
    el("summary", {}, el("h3", {}, "Camera")),
    ...Object.values(this.fields).map(({ row }) => row),
    this.answer,
  );

  constructor(private readonly sensor: Sensor) {
    this.element.hidden = true;
  }

  allow(control: boolean): void {
    for (const { input } of Object.values(this.fields)) input.disabled = !control;
    say(this.answer, "");
  }

  show(settings: CameraSettings | undefined): void {
    this.element.hidden = !settings?.exposureUs && !settings?.gain;
    for (const name of Object.keys(this.fields) as Name[]) {
      const { row, input, range } = this.fields[name];
      const setting = settings?.[name];
      row.hidden = !setting;
      if (!setting) continue;
      input.min = String(setting.minimum);
      input.max = String(setting.maximum);
      say(range, `${plain(setting.minimum)} to ${plain(setting.maximum)}`);
      // Not under a hand that is typing.
      if (document.activeElement !== input) input.value = plain(setting.value);
    }
  }

  private makeField(name: Name, label: string, unit: string) {
    const input = el("input", { type: "number", step: "any", "aria-label": label });
    const range = el("span", { class: "quiet" });
    input.addEventListener("change", () => {
      if (Number.isFinite(input.valueAsNumber)) void this.set({ [name]: input.valueAsNumber });
    });
    return { input, range, row: el("label", { class: "row" }, label, input, unit, range) };
  }

  private async set(change: { exposureUs?: number; gain?: number }): Promise<void> {
    say(this.answer, "");
    try {
      const value = create(SetCameraSchema, change);
      const result = await this.sensor.request({ case: "setCamera", value });
      if (result.case === "camera") this.show(result.value);
      say(this.answer, "Set until the daemon ends; a new reference is being taken.");
    } catch (error) {
      say(this.answer, (error as Error).message);
    }
  }
}
