// A session with dtact-calibrate, which the gateway runs and relays (clients/common/guided.proto): what it
// says, asks and sees.
import { fromJsonString } from "@bufbuild/protobuf";
import { GuidedLineSchema } from "../../gen/guided_pb";
import type { GuidedAnswer, GuidedLine, GuidedScene } from "../../gen/guided_pb";
import { button, el, say } from "../dom";
import type { Sensor } from "../session/sensor";

/** Length of the picture's scale bar, mm. */
const BAR_MM = 5;
/** Least width of the picture, pixels. */
const MIN_WIDTH = 400;
/** Lines that stay; a session says some fifty. */
const MAX_SAID = 200;

/** Opens a session with its first message, a GuidedStart; `lost`: the connection closed before its end. */
export function converse(
  sensor: Sensor,
  start: object,
  take: (line: GuidedLine["line"]) => void,
  lost: () => void,
): WebSocket {
  const socket = new WebSocket(sensor.calibrateAddress);
  socket.onopen = () => socket.send(JSON.stringify(start));
  socket.onmessage = ({ data }) => take(fromJsonString(GuidedLineSchema, data as string).line);
  socket.onclose = lost;
  return socket;
}

export class Talk {
  private readonly picture = el("canvas", { width: "1", height: "1" });
  private readonly words = el("figcaption", { "data-fact": "words" });
  private readonly said = el("ol", { class: "said", "aria-label": "Said", "aria-live": "polite" });
  private readonly prompt = el("p", { class: "prompt", role: "status" });
  private readonly answers = el("div", { class: "row wrap", role: "group", "aria-label": "Answer" });
  private readonly session: HTMLElement;
  private readonly trouble = el("p", { class: "answer", role: "alert" });
  readonly element: HTMLElement;
  private socket: WebSocket | undefined;
  private bitmap: ImageBitmap | undefined;
  private scene: GuidedScene | undefined;

  /** `between`: stands below what was said. */
  constructor(
    private readonly sensor: Sensor,
    between: Element,
    private readonly handlers: { scene: (scene: GuidedScene) => void; ended: (error: string) => void },
  ) {
    this.session = el(
      "div",
      { class: "session", hidden: "" },
      el("figure", {}, this.picture, this.words),
      el("div", { class: "talk" }, this.said, between, this.prompt, this.answers),
    );
    this.element = el("div", {}, this.session, this.trouble);
  }

  get running(): boolean {
    return this.socket !== undefined;
  }

  /** `resume`: what to do when the connection is lost. */
  begin(start: object, resume: string): void {
    this.session.hidden = false;
    this.said.replaceChildren();
    say(this.trouble, "");
    // A slow network reports the end of an earlier session while this one runs.
    const socket = converse(
      this.sensor,
      start,
      (line) => {
        if (socket !== this.socket) return;
        if (line.case === "text") this.tell(line.value);
        else if (line.case === "started") this.tell("Every image is saved as soon as it is taken.");
        else if (line.case === "scene") void this.show(line.value);
        else if (line.case === "ended") this.end(line.value.error);
      },
      () => {
        if (socket === this.socket) this.end(`The connection was lost. ${resume}`);
      },
    );
    this.socket = socket;
  }

  /** Ends the session, if it still runs. */
  close(): void {
    const socket = this.socket;
    this.socket = undefined;
    socket?.close();
    this.bitmap?.close();
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
    this.handlers.scene(scene);
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
    // Enter must not end the session.
    if (answers[0]?.key === "") made[0]?.focus();
  }

  private draw(): void {
    if (!this.bitmap || !this.scene) return;
    // A coarse map is enlarged, so that what is drawn on it is readable.
    const zoom = Math.ceil(MIN_WIDTH / this.bitmap.width);
    const [width, height] = [zoom * this.bitmap.width, zoom * this.bitmap.height];
    Object.assign(this.picture, { width, height });
    const context = this.picture.getContext("2d");
    if (!context) return;
    context.drawImage(this.bitmap, 0, 0, width, height);
    context.strokeStyle = context.fillStyle = getComputedStyle(this.picture).color;
    context.lineWidth = Math.max(1, width / 290);
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.font = `${Math.round(width / 28)}px sans-serif`;
    this.scene.presses.forEach(({ col, row, radiusPx }, index) => {
      if (radiusPx === 0) return;
      context.beginPath();
      context.arc(zoom * col, zoom * row, zoom * radiusPx, 0, 2 * Math.PI);
      context.stroke();
      context.fillText(String(index + 1), zoom * col, zoom * row);
    });
    const bar = (zoom * BAR_MM) / this.scene.mmPerPx;
    context.textAlign = "left";
    context.fillRect(12, height - 16, bar, 4);
    context.fillText(`${BAR_MM} mm`, 12, height - 30);
  }

  private end(error: string): void {
    if (!this.socket) return;
    this.socket.close();
    this.socket = undefined;
    this.scene = undefined;
    this.answers.replaceChildren();
    say(this.prompt, "");
    say(this.trouble, error);
    this.handlers.ended(error);
  }
}
