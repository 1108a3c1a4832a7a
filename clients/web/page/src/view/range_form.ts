// The locked range and the outline's depth, as they are typed.
import { el } from "../dom";
import { keep, kept } from "../kept";
import type { Range } from "./map_canvas";

function field(label: string, value: string, step: string): HTMLInputElement {
  return el("input", { type: "number", step, value, "aria-label": label });
}

export class RangeForm {
  private readonly lower = field("Range from, mm", "0", "0.1");
  private readonly upper = field("Range to, mm", "1.5", "0.1");
  private readonly outline = field("Outline at, mm; 0 for none", "0.1", "0.05");
  readonly elements: HTMLElement[];

  /**
   * `changed` is called with what makes sense; a range of less than 0.01 mm is marked instead. The
   * fields start with what was typed last for this sensor.
   */
  constructor(
    sensor: string,
    changed: (range: Range | undefined, outlineMm: number | undefined) => void,
  ) {
    const name = `range ${sensor}`;
    const before = kept(name);
    if (Array.isArray(before))
      this.inputs().forEach((input, i) => (input.value = String(before[i] ?? input.value)));
    const tell = (): void => {
      const outlineMm = this.outline.valueAsNumber;
      changed(this.range(), outlineMm >= 0 ? outlineMm : undefined);
    };
    const quiet = (text: string): HTMLElement => el("span", { class: "quiet" }, text);
    const hint = "The range never follows the depth: a colour always means the same depth";
    this.elements = [
      el("span", { class: "row", title: hint }, quiet("Range"), this.lower, "to", this.upper, "mm"),
      el("label", { class: "row" }, quiet("Outline"), this.outline, "mm"),
    ];
    for (const input of this.inputs()) {
      input.addEventListener("change", () => {
        keep(
          name,
          this.inputs().map(({ value }) => value),
        );
        tell();
      });
    }
    tell();
  }

  private inputs(): HTMLInputElement[] {
    return [this.lower, this.upper, this.outline];
  }

  private range(): Range | undefined {
    const range = { fromMm: this.lower.valueAsNumber, toMm: this.upper.valueAsNumber };
    const good = range.toMm - range.fromMm >= 0.01;
    for (const input of [this.lower, this.upper]) input.setAttribute("aria-invalid", String(!good));
    return good ? range : undefined;
  }
}
