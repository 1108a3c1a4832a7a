// The guided calibration: what dtact-calibrate says, asks and sees, which the gateway runs and relays
// (clients/common/guided.proto), and what has been pressed so far.
import { fromJsonString } from "@bufbuild/protobuf";
import { GuidedLineSchema } from "../../gen/guided_pb";
import type { GuidedAnswer, GuidedPress, GuidedScene } from "../../gen/guided_pb";
import { button, el, say, svg } from "../dom";
import type { Sensor } from "../session/sensor";
import { fixed } from "../labels";

/** Length of the picture's scale bar, mm. */
const BAR_MM = 5;
/** Lines that stay; a session says some fifty. */
const MAX_SAID = 200;
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
  private readonly picture = el("canvas", { width: "1", height: "1" });
  private readonly words = el("figcaption", { "data-fact": "words" });
  private readonly said = el("ol", { class: "said", "aria-label": "Said", "aria-live": "polite" });
  private readonly prompt = el("p", { class: "prompt", role: "status" });
  private readonly answers = el("div", {
    class: "row wrap",
    role: "group",
    "aria-label": "Answer",
  });
  private readonly depths = svg("svg", {
    viewBox: `0 0 ${DEPTH_WIDTH} ${DEPTH_HEIGHT}`,
    class: "depths",
    role: "img",
    "aria-label": "Depths of the presses, and how deep the LUT reaches",
  });
  private readonly session = el(
    "div",
    { class: "session", hidden: "" },
    el("figure", {}, this.picture, this.words),
    el("div", { class: "talk" }, this.said, this.depths, this.prompt, this.answers),
  );
  private readonly trouble = el("p", { class: "answer", role: "alert" });
  private readonly closing = button("Close", () => this.element.close());
  readonly element: HTMLDialogElement;
  private socket: WebSocket | undefined;
  private bitmap: ImageBitmap | undefined;
  private scene: GuidedScene | undefined;
  private ended = false;

  /** `now`: of the calibration in use; `changed`: the daemon's calibrations may be others. */
  constructor(
    private readonly sensor: Sensor,
    now: MapShape | undefined,
    private readonly changed: () => void,
  ) {
    if (now) {
      this.scale.value = String(Number(now.mmPerPx.toPrecision(6)));
      this.width.value = String(now.width);
      this.height.value = String(now.height);
    }
    this.form = this.makeForm();
    this.element = el(
      "dialog",
      { class: "guide", "aria-label": "Guided calibration" },
      el("h3", {}, `Calibrate ${sensor.name}`),
      this.form,
      this.session,
      this.trouble,
      el("div", { class: "row" }, this.closing),
    );
    this.element.addEventListener("close", () => this.leave());
    // Escape would end a session of minutes; what was taken stays, but the button says so.
    this.element.addEventListener("cancel", (event) => {
      if (this.socket && !this.ended) event.preventDefault();
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

  private begin(): void {
    const crop = [this.width, this.height].map((input) => input.valueAsNumber);
    const start = JSON.stringify({
      radius_mm: this.radius.valueAsNumber,
      mm_per_px: this.scale.valueAsNumber,
      presses: this.presses.valueAsNumber,
      resume: this.resume.checked,
      ...(crop.every((size) => size > 0) ? { crop } : {}),
    });
    this.form.hidden = true;
    this.session.hidden = false;
    say(this.closing, "End");
    say(this.trouble, "");
    const socket = new WebSocket(this.sensor.calibrateAddress);
    this.socket = socket;
    socket.onopen = () => socket.send(start);
    socket.onmessage = (message) => this.take(message.data as string);
    socket.onclose = () => this.end("The connection was lost. Begin again with the last session to continue.");
  }

  private take(text: string): void {
    const { line } = fromJsonString(GuidedLineSchema, text);
    if (line.case === "text") this.tell(line.value);
    else if (line.case === "started") this.tell("Every image is saved as soon as it is taken.");
    else if (line.case === "scene") void this.show(line.value);
    else if (line.case === "ended") this.end(line.value.error);
  }

  private tell(text: string): void {
    for (const sentence of text.split("\n").filter((part) => part !== ""))
      this.said.append(el("li", {}, sentence));
    while (this.said.childElementCount > MAX_SAID) this.said.firstElementChild?.remove();
    this.said.scrollTop = this.said.scrollHeight;
  }

  /** What is asked stays until it changes, so that a button is not replaced while it is pressed. */
  private async show(scene: GuidedScene): Promise<void> {
    const before = this.scene;
    this.scene = scene;
    say(this.words, scene.words);
    say(this.prompt, scene.prompt);
    const asked = ({ answers }: { answers: GuidedAnswer[] }): string =>
      answers.map(({ key, words }) => `${key} ${words}`).join();
    if (!before || asked(before) !== asked(scene)) this.ask(scene.answers);
    this.drawDepths(scene);
    if (scene.picturePng.length > 0) {
      const png = new Blob([scene.picturePng as BlobPart], { type: "image/png" });
      const bitmap = await createImageBitmap(png);
      this.bitmap?.close();
      this.bitmap = bitmap;
    }
    this.draw();
  }

  private ask(answers: GuidedAnswer[]): void {
    const made = answers.map(({ key, words }) =>
      button(words, () => this.socket?.send(key), { "data-key": key }),
    );
    this.answers.replaceChildren(...made);
    made[0]?.focus();
  }

  private draw(): void {
    if (!this.bitmap || !this.scene) return;
    const { width, height } = this.bitmap;
    Object.assign(this.picture, { width, height });
    const context = this.picture.getContext("2d");
    if (!context) return;
    context.drawImage(this.bitmap, 0, 0);
    context.strokeStyle = context.fillStyle = getComputedStyle(this.picture).color;
    context.lineWidth = Math.max(1, width / 290);
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.font = `${Math.round(width / 28)}px sans-serif`;
    this.scene.presses.forEach(({ col, row, radiusPx }, index) => {
      context.beginPath();
      context.arc(col, row, radiusPx, 0, 2 * Math.PI);
      context.stroke();
      context.fillText(String(index + 1), col, row);
    });
    const bar = BAR_MM / this.scene.mmPerPx;
    context.textAlign = "left";
    context.fillRect(12, height - 16, bar, 4);
    context.fillText(`${BAR_MM} mm`, 12, height - 30);
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

  private end(error: string): void {
    if (this.ended) return;
    this.ended = true;
    this.answers.replaceChildren();
    say(this.prompt, "");
    say(this.trouble, error);
    say(this.closing, "Close");
    this.changed();
  }

  private leave(): void {
    this.ended = true;
    this.socket?.close();
    this.bitmap?.close();
    this.element.remove();
  }
}
