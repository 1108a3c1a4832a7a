// Speed against accuracy: how depth is made, what it takes here and its uncertainty, on a chart.
import { create } from "@bufbuild/protobuf";
import { SetReconstructionSchema } from "../../gen/dtact_pb";
import type { Reconstruction } from "../../gen/dtact_pb";
import { Choice, el, say, svg } from "../dom";
import type { Frame } from "../session/messages";
import type { Sensor } from "../session/sensor";
import { keep, kept } from "../kept";
import { fixed, um } from "../labels";

const RESOLUTIONS = { full: "Full", half: "Half", quarter: "Quarter", auto: "Auto" };
const SHARPEN = { off: "Off", once: "1", twice: "2", auto: "Auto" };
/** The protocol's values. They are not the keys, because numeric keys of an object come first. */
const STEPS = { off: "off", once: "1", twice: "2", auto: "auto" };
type Resolution = keyof typeof RESOLUTIONS;
type Sharpen = keyof typeof SHARPEN;

const [WIDTH, HEIGHT, LEFT, BOTTOM] = [280, 150, 34, 26];
const OPEN = "speed and accuracy";
/** Weight of a new frame in the moving average of a setting's times. */
const WEIGHT = 0.05;
const REDRAW_MS = 250;
/** What was seen of ways of making depth, at most. */
const MAX_SEEN = 12;

interface Change {
  resolution?: Resolution;
  sharpen?: string;
  maxErrorUm?: number;
}

interface Seen {
  ms: number;
  errorUm: number;
}

/** The map's share of the calibration's resolution, and how often it was sharpened. */
function wayOf(frame: Frame): string | undefined {
  if (!frame.depth) return undefined;
  const share = { 1: "full", 2: "half", 4: "quarter" }[frame.madeDecimation] ?? "?";
  return frame.depth.sharpenSteps > 0 ? `${share}, sharpened ${frame.depth.sharpenSteps}×` : share;
}

export class ReconstructionPanel {
  private readonly bound = el("input", {
    type: "number",
    min: "1",
    max: "10000",
    step: "5",
    "aria-label": "Error bound, µm",
  });
  private readonly resolutions = new Choice<Resolution>("Resolution", RESOLUTIONS, "full", (resolution) =>
    this.set({ resolution }),
  );
  private readonly sharpening = new Choice<Sharpen>("Sharpen", SHARPEN, "off", (sharpen) =>
    this.set({ sharpen: STEPS[sharpen] }),
  );
  private readonly answer = el("p", { class: "answer", role: "alert" });
  private readonly now = el("output", { "data-fact": "worth" }, "–");
  private readonly chart = svg("svg", {
    viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
    class: "tradeoff",
    role: "img",
    "aria-label": "Time a frame takes against the error to expect",
  });
  private readonly controls = el(
    "div",
    { class: "controls" },
    el("div", { class: "row wrap" }, el("span", { class: "quiet" }, "Map"), this.resolutions.element),
    el(
      "div",
      { class: "row wrap" },
      el("span", { class: "quiet" }, "Sharpen"),
      this.sharpening.element,
      el("label", { class: "row" }, "within", this.bound, "µm"),
    ),
  );
  /** Closed at first: one line shows the time and the uncertainty of depth. */
  readonly element = el(
    "details",
    { class: "panel", "aria-label": "Speed and accuracy" },
    el("summary", {}, el("h3", {}, "Speed and accuracy"), this.now),
    this.controls,
    this.chart,
    this.answer,
  );
  private how: Reconstruction | undefined;
  private readonly seen = new Map<string, Seen>();
  private way = "";
  private drawnAt = 0;
  private changing = Promise.resolve();

  constructor(private readonly sensor: Sensor) {
    this.element.hidden = true;
    if (kept(OPEN) === true) this.element.setAttribute("open", "");
    this.element.addEventListener("toggle", () => {
      keep(OPEN, this.element.hasAttribute("open"));
      this.draw();
    });
    this.bound.addEventListener("change", () => {
      const maxErrorUm = this.bound.valueAsNumber;
      if (maxErrorUm >= 1 && maxErrorUm <= 10000) void this.set({ maxErrorUm });
    });
  }

  /** A daemon that does not know of it has no panel for it. */
  allow(control: boolean): void {
    this.element.hidden = !this.sensor.features.includes("reconstruction");
    for (const input of this.controls.querySelectorAll<HTMLInputElement>("input, button"))
      input.disabled = !control;
    // What the daemon before took says nothing of this one.
    this.seen.clear();
    say(this.now, "–");
    this.draw();
  }

  show(how: Reconstruction): void {
    this.how = how;
    this.resolutions.mark(how.resolution as Resolution);
    const steps = (Object.keys(STEPS) as Sharpen[]).find((key) => STEPS[key] === how.sharpen);
    if (steps) this.sharpening.mark(steps);
    if (document.activeElement !== this.bound) this.bound.value = String(how.maxErrorUm);
    this.draw();
  }

  /** Only for frames in contact: others need little computation. */
  frame(frame: Frame): void {
    const way = wayOf(frame);
    if (!way || !frame.depth || frame.contact?.inContact !== true) return;
    this.way = way;
    const { uncertaintyUm } = frame.depth;
    const seen = this.seen.get(way) ?? { ms: frame.madeMs, errorUm: uncertaintyUm };
    seen.ms += WEIGHT * (frame.madeMs - seen.ms);
    seen.errorUm += WEIGHT * (uncertaintyUm - seen.errorUm);
    if (this.seen.size < MAX_SEEN || this.seen.has(way)) this.seen.set(way, seen);
    if (this.element.hidden || performance.now() - this.drawnAt < REDRAW_MS) return;
    this.drawnAt = performance.now();
    say(this.now, `${way}: ${fixed(seen.ms, 2)} ms, ± ${um(seen.errorUm)}`);
    this.draw();
  }

  /** One after the other: the daemon makes its calibration ready anew for each, and refuses another meanwhile. */
  private set(change: Change): Promise<void> {
    this.changing = this.changing.then(() => this.ask(change));
    return this.changing;
  }

  private async ask(change: Change): Promise<void> {
    try {
      const value = create(SetReconstructionSchema, change);
      const result = await this.sensor.request({ case: "setReconstruction", value });
      if (result.case === "reconstruction") this.show(result.value);
      say(this.answer, "");
    } catch (error) {
      say(this.answer, (error as Error).message);
      if (this.how) this.show(this.how);
    }
  }

  private draw(): void {
    if (!this.element.open) return;
    const all = [...this.seen.values()];
    const automatic = this.how?.resolution === "auto" || this.how?.sharpen === "auto";
    const bound = automatic ? this.how?.maxErrorUm : undefined;
    const topMs = 1.15 * Math.max(0.3, ...all.map(({ ms }) => ms));
    const topUm = 1.15 * Math.max(60, bound ?? 0, ...all.map(({ errorUm }) => errorUm));
    const x = (ms: number): number => LEFT + (ms / topMs) * (WIDTH - LEFT - 8);
    const y = (errorUm: number): number =>
      HEIGHT - BOTTOM - (Math.min(errorUm, topUm) / topUm) * (HEIGHT - BOTTOM - 8);
    const parts: SVGElement[] = [];
    const text = (at: [number, number], words: string, anchor: string, kind = "quiet"): void => {
      const place = { x: String(at[0]), y: String(at[1]), "text-anchor": anchor, class: kind };
      parts.push(svg("text", place, words));
    };
    const line = (from: [number, number], to: [number, number], kind: string): void => {
      const [x1, y1, x2, y2] = [...from, ...to].map(String) as [string, string, string, string];
      parts.push(svg("line", { x1, y1, x2, y2, class: kind }));
    };
    const dot = ({ ms, errorUm }: Seen, name: string, kind: string): void => {
      const reported = svg("title", {}, `${name}: ${fixed(ms, 2)} ms, ${fixed(errorUm, 0)} µm`);
      parts.push(
        svg("circle", { cx: String(x(ms)), cy: String(y(errorUm)), r: "4.5", class: kind }, reported),
      );
    };
    line([LEFT, HEIGHT - BOTTOM], [WIDTH - 8, HEIGHT - BOTTOM], "axis");
    line([LEFT, 8], [LEFT, HEIGHT - BOTTOM], "axis");
    text([(LEFT + WIDTH) / 2, HEIGHT - 2], "ms a frame, on the daemon's machine", "middle");
    text([LEFT + 4, 12], "µm expected inside the contact", "start");
    for (const share of [0.5, 1]) {
      text([LEFT - 4, y(share * topUm) + 4], fixed(share * topUm, 0), "end");
      const anchor = share === 1 ? "end" : "middle";
      text([x(share * topMs), HEIGHT - BOTTOM + 12], fixed(share * topMs, 2), anchor);
    }
    if (bound) line([LEFT, y(bound)], [WIDTH - 8, y(bound)], "bound");
    for (const [way, seen] of this.seen) {
      dot(seen, way, way === this.way ? "seen current" : "seen");
      const { ms, errorUm } = seen;
      text(
        [x(ms) + (x(ms) > WIDTH / 2 ? -8 : 8), y(errorUm) + 4],
        way,
        x(ms) > WIDTH / 2 ? "end" : "start",
        "way",
      );
    }
    this.chart.replaceChildren(...parts);
  }
}
