// Where a recording is being played, and any other moment of it.
import { el, say } from "./dom";
import type { Played } from "./recording/player";

const clock = (seconds: number): string => {
  const tenths = Math.round(10 * seconds);
  const rest = (tenths % 600) / 10;
  return `${Math.floor(tenths / 600)}:${rest.toFixed(1).padStart(4, "0")}`;
};

export class Timeline {
  private readonly slider = el("input", {
    type: "range",
    min: "0",
    max: "0",
    step: "any",
    value: "0",
    "aria-label": "Time in the recording",
  });
  private readonly time = el("output", { "data-fact": "played" }, "–");
  private readonly trouble = el("span", { class: "trouble", role: "status" });
  readonly element: HTMLElement;

  /** `play` is the button that plays and pauses. */
  constructor(play: HTMLElement, sought: (seconds: number) => void) {
    this.slider.addEventListener("input", () => sought(this.slider.valueAsNumber));
    this.element = el("div", { class: "timeline" }, play, this.slider, this.time, this.trouble);
  }

  show({ seconds, length, trouble }: Played): void {
    this.slider.max = String(length);
    this.slider.value = String(seconds);
    const text = `${clock(seconds)} of ${clock(length)}`;
    this.slider.setAttribute("aria-valuetext", text);
    say(this.time, text);
    say(this.trouble, trouble);
  }
}
