// The guided calibration: the session with dtact-calibrate, and what has been pressed so far.
import type { GuidedPress, GuidedScene } from "../../gen/guided_pb";
import { button, el, say, svg } from "../dom";
import type { Sensor } from "../session/sensor";
import { fixed } from "../labels";
import { Talk } from "./talk";

const [DEPTH_WIDTH, DEPTH_HEIGHT] = [280, 46];

/** What the map of a calibration is like. */
export interface MapShape {
  mmPerPx: number;
  width: number;
  height: number;
}

function number(label: string, attributes: Record<string, string>): HTMLInputElement {
  return el("input", { type: "number", "aria-label": label, ...attributes });
}

const SIZE = { min: "64", max: "8192", step: "1" };

export class Guide {
  private readonly radius = number("Ball's radius, mm", {
    min: "0.5",
    max: "50",
    step: "any",
    required: "",
    value: "4",
  });
  private readonly scale = number("Millimetres per pixel", {
    min: "0.001",
    max: "1",
    step: "any",
    required: "",
  });
  private readonly ruler = number("Length of the drawn line, mm", {
    min: "0.1",
    max: "1000",
    step: "any",
  });
  private readonly width = number("Map's width, pixels", SIZE);
  private readonly height = number("Map's height, pixels", SIZE);
  private readonly presses = number("Presses", {
    min: "2",
    max: "99",
    step: "1",
    required: "",
    value: "6",
  });
  private readonly resume = el("input", { type: "checkbox" });
  private readonly form: HTMLFormElement;
  private readonly depths = svg("svg", {
    viewBox: `0 0 ${DEPTH_WIDTH} ${DEPTH_HEIGHT}`,
    class: "depths",
    role: "img",
    "aria-label": "Depths of the presses, and how deep the LUT reaches",
  });
  private readonly talk: Talk;
  private readonly closing = button("Close", () => this.element.close());
  readonly element: HTMLDialogElement;

  /**
   * `now`: of the calibration in use; `line`: drawn on the camera's picture, x and y of both ends;
   * `changed`: the daemon's calibrations may be others.
   */
  constructor(
    sensor: Sensor,
    now: MapShape | undefined,
    private readonly line: number[] | undefined,
    private readonly changed: () => void,
  ) {
    if (now) {
      this.scale.value = String(Number(now.mmPerPx.toPrecision(6)));
      this.width.value = String(now.width);
      this.height.value = String(now.height);
    }
    this.ruler.addEventListener("input", () => this.measure());
    this.form = this.makeForm();
    this.talk = new Talk(sensor, this.depths, {
      scene: (scene) => this.drawDepths(scene),
      ended: () => this.end(),
    });
    this.element = el(
      "dialog",
      { class: "guide", "aria-label": "Guided calibration" },
      el("h3", {}, `Calibrate ${sensor.name}`),
      this.form,
      this.talk.element,
      el("div", { class: "row" }, this.closing),
    );
    this.element.addEventListener("close", () => this.leave());
    // Escape would end a session of minutes; what was taken stays, but the button says so.
    this.element.addEventListener("cancel", (event) => {
      if (this.talk.running) event.preventDefault();
    });
    // The page's own keys mean nothing here.
    this.element.addEventListener("keydown", (event) => event.stopPropagation());
  }

  open(): void {
    this.element.showModal();
  }

  private makeForm(): HTMLFormElement {
    const field = (label: string, ...inputs: HTMLElement[]): HTMLElement =>
      el("label", {}, el("span", {}, label), ...inputs);
    const form = el(
      "form",
      { class: "start" },
      el(
        "p",
        { class: "quiet" },
        "First the undeformed surface is taken, then presses of a ball of known radius at different " +
          "places and depths.",
      ),
      field("Ball's radius, mm", this.radius),
      field("Scale of the picture, mm per pixel", this.scale),
      this.line
        ? field("or the length of the drawn line, mm", this.ruler)
        : el(
            "p",
            { class: "quiet" },
            "If you do not know the scale: press a ruler or a coin in, choose Camera and Line, draw " +
              "along a known length, and open this again. dtact-calibrate lens finds it from a " +
              "board of pins.",
          ),
      field("Map, pixels: the whole picture, or", this.width, this.height),
      field("Presses", this.presses),
      field("Continue the last session", this.resume),
      el("button", { type: "submit" }, "Begin"),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.begin();
    });
    return form;
  }

  /** The scale that the drawn line gives. */
  private measure(): void {
    const [x0 = 0, y0 = 0, x1 = 0, y1 = 0] = this.line ?? [];
    const scale = this.ruler.valueAsNumber / Math.hypot(x1 - x0, y1 - y0);
    this.scale.readOnly = scale > 0;
    if (scale > 0) this.scale.value = String(Number(scale.toPrecision(6)));
  }

  private begin(): void {
    const crop = [this.width, this.height].map((input) => input.valueAsNumber);
    this.form.hidden = true;
    say(this.closing, "End");
    this.talk.begin(
      {
        radius_mm: this.radius.valueAsNumber,
        mm_per_px: this.scale.valueAsNumber,
        presses: this.presses.valueAsNumber,
        resume: this.resume.checked,
        ...(crop.every((size) => size > 0) ? { crop } : {}),
        ...(this.line && this.scale.readOnly
          ? { ruler: [...this.line, this.ruler.valueAsNumber] }
          : {}),
      },
      "Begin again with the last session to continue.",
    );
  }

  /** Depth from left to right: what the list covers, and each press. */
  private drawDepths({ presses, coveredMm, pressesRequired }: GuidedScene): void {
    const most = 1.1 * Math.max(0.5, coveredMm, ...presses.map(({ depthMm }) => depthMm));
    const x = (mm: number): string => String(8 + (mm / most) * (DEPTH_WIDTH - 16));
    const mark = ({ name, depthMm }: GuidedPress, index: number): SVGElement =>
      svg(
        "g",
        {},
        svg("title", {}, `${name}: ${fixed(depthMm, 2)} mm`),
        svg("circle", { cx: x(depthMm), cy: "12", r: "4", class: "seen" }),
        svg("text", { x: x(depthMm), y: "30", "text-anchor": "middle" }, String(index + 1)),
      );
    const reported =
      `${presses.length} of ${pressesRequired} presses` +
      (coveredMm > 0 ? `; the LUT reaches ${fixed(coveredMm, 2)} mm` : "; not yet a LUT");
    this.depths.replaceChildren(
      svg("line", { x1: x(0), x2: x(most), y1: "12", y2: "12", class: "axis" }),
      svg("line", { x1: x(0), x2: x(coveredMm), y1: "12", y2: "12", class: "covered" }),
      ...presses.map(mark),
      svg("text", { x: x(0), y: "44", class: "quiet" }, reported),
    );
  }

  private end(): void {
    say(this.closing, "Close");
    this.changed();
  }

  private leave(): void {
    this.talk.close();
    this.element.remove();
  }
}
