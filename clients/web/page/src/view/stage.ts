// The picture: map or camera, what is drawn over it, and the value under the cursor.
import { el, say } from "../dom";
import type { DepthMap, Frame, LumaMap } from "../session/messages";
import { fixed, mm, um } from "../labels";
import { drawColourBar } from "./colour_bar";
import { MapCanvas } from "./map_canvas";
import type { Range } from "./map_canvas";
import { drawMarks, pixelOf, placeOf } from "./overlay";
import type { Grid, Line, Marks, Place } from "./overlay";
import { lengthOf, lineText, pointAt, profileOf, valueUm } from "./reading";
import type { Profile } from "./reading";
import { Zoom } from "./zoom";

export type View = "depth" | "camera" | "difference" | "surface";
/** Of the camera's pixels, not of the map's. */
export const isPicture = (view: View): boolean => view === "camera" || view === "difference";
/** Grey levels drawn for one of difference. */
const CONTRAST = 4;
export type Tool = "point" | "line";

/** Draws a 2D canvas at the screen's own resolution. */
function sharp(canvas: HTMLCanvasElement): {
  context: CanvasRenderingContext2D;
  width: number;
  height: number;
} {
  const ratio = devicePixelRatio;
  const { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const context = canvas.getContext("2d") as CanvasRenderingContext2D;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

function greyAt(picture: LumaMap, row: number, column: number): number {
  return picture.values[Math.floor(row) * picture.width + Math.floor(column)] as number;
}

export class Stage {
  private readonly canvas = el("canvas", { class: "map", width: "580", height: "580" });
  private readonly marksCanvas = el("canvas", {
    class: "marks",
    tabindex: "0",
    role: "img",
    "aria-label": "Depth map. Arrow keys move the cursor, Shift moves it by ten pixels; plus, minus and 0 zoom.",
  });
  private readonly bar = el("canvas", { class: "bar", role: "img" });
  private readonly readout = el("output", { class: "readout" }, "Point at the map for its values.");
  private readonly sentence = el("p", { role: "status" });
  private readonly veil = el("div", { class: "veil" }, this.sentence);
  private readonly picture = el(
    "div",
    { class: "picture" },
    this.canvas,
    this.marksCanvas,
    this.veil,
  );
  private readonly host = el("div", { class: "surface" });
  readonly element = el(
    "div",
    { class: "stage" },
    el(
      "div",
      { class: "viewport" },
      this.picture,
      this.host,
      el("div", { class: "beside" }, this.bar),
    ),
    this.readout,
  );
  private readonly map: MapCanvas;
  private view: View = "depth";
  private tool: Tool = "point";
  private cursor: Place | undefined;
  private line: Line | undefined;
  private drawing = false;
  private readonly zoom = new Zoom();
  /** Pointers that are down, by id: where each was last, as shares of the window. */
  private readonly held = new Map<number, [number, number]>();
  private frame: Frame | undefined;
  depth: DepthMap | undefined;
  luma: LumaMap | undefined;
  /** The frames that these two came with. */
  private depthFrame: Frame | undefined;
  private lumaFrame: Frame | undefined;
  /** What the difference is taken from, as large as the camera's picture. */
  reference: LumaMap | undefined;
  private difference: LumaMap | undefined;
  /** Called when the drawn line or its values may have changed. */
  profiled: (profile: Profile | undefined) => void = () => {};

  /** Throws where the browser has no WebGL 2. */
  constructor() {
    this.map = new MapCanvas(this.canvas);
    const target = this.marksCanvas;
    target.addEventListener("pointermove", (event) => {
      this.drag(event);
      this.point(event);
    });
    // A finger leaves when it lifts, and the value that it tapped stays.
    target.addEventListener("pointerleave", (event) => {
      if (!this.drawing && event.pointerType === "mouse") this.moveTo(undefined);
    });
    target.addEventListener("pointerdown", (event) => {
      this.held.set(event.pointerId, this.shares(event));
      this.point(event);
      if (this.tool !== "line" || this.view === "surface" || !this.cursor) return;
      target.setPointerCapture(event.pointerId);
      this.drawing = true;
      this.line = { from: this.cursor, to: this.cursor };
    });
    for (const type of ["pointerup", "pointercancel", "pointerleave"] as const)
      target.addEventListener(type, (event) => {
        this.held.delete(event.pointerId);
        if (type !== "pointerleave") this.drawing = false;
      });
    target.addEventListener("wheel", (event) => {
      event.preventDefault();
      const [x, y] = this.shares(event);
      this.zoom.about(x, y, Math.exp(-event.deltaY / 400));
      this.zoomed();
    });
    target.addEventListener("dblclick", () => {
      this.zoom.reset();
      this.zoomed();
    });
    target.addEventListener("keydown", (event) => this.steer(event));
    new ResizeObserver(() => {
      this.drawOver();
      this.drawBar();
    }).observe(this.element);
  }

  get range(): Range {
    return this.map.range;
  }

  set range(range: Range) {
    this.map.range = range;
    this.map.redraw();
    this.drawBar();
  }

  get outlineMm(): number {
    return this.map.outlineMm;
  }

  set outlineMm(depth: number) {
    this.map.outlineMm = depth;
    this.map.redraw();
  }

  /** Where the surface is drawn when it is looked at. */
  get surfaceHost(): HTMLElement {
    return this.host;
  }

  look(view: View): void {
    // A place is in millimetres on the map, in pixels on the camera's picture.
    if (isPicture(view) !== isPicture(this.view)) {
      this.cursor = this.line = undefined;
      this.zoom.reset();
      this.zoomed();
    }
    this.drawing = false;
    this.view = view;
    this.element.dataset["view"] = view;
    if (view === "depth" && this.depth) this.map.drawDepth(this.depth);
    this.drawPicture();
    this.shape();
    this.drawOver();
    this.drawBar();
    this.showValue();
    this.showProfile();
  }

  use(tool: Tool): void {
    this.tool = tool;
    if (tool === "point") this.line = undefined;
    this.showProfile();
    this.drawOver();
  }

  private drawPicture(): void {
    if (!this.luma || !isPicture(this.view)) return;
    const { values, width, height } = this.luma;
    if (this.view === "camera") this.map.drawLuma(this.luma);
    const { reference } = this;
    const scale = this.referenceScale();
    if (this.view === "camera" || !reference || !scale) return;
    if (this.difference?.values.length !== values.length)
      this.difference = { width, height, values: new Uint8Array(values.length) };
    const grey = this.difference.values;
    for (let i = 0, row = 0; row < height; ++row) {
      for (let column = 0; column < width; ++column, ++i) {
        const before = greyAt(reference, row / scale, column / scale);
        const level = 128 + CONTRAST * ((values[i] as number) - before);
        grey[i] = Math.min(Math.max(level, 0), 255);
      }
    }
    this.map.drawLuma(this.difference);
  }

  /** Pixels of the picture for one of the reference; undefined where they do not fit each other. A
   * recording's pictures are whole, and its reference is of the size that the daemon decoded them at. */
  private referenceScale(): number | undefined {
    const { luma, reference } = this;
    if (!luma || !reference) return undefined;
    const scale = luma.width / reference.width;
    return [1, 2, 4].includes(scale) && reference.height * scale === luma.height ? scale : undefined;
  }

  /** A sentence over the picture, empty for none, and a button below it. */
  cover(sentence: string, action?: HTMLButtonElement): void {
    say(this.sentence, sentence);
    if (action && action.parentElement !== this.veil) this.veil.append(action);
    if (!action) this.sentence.nextElementSibling?.remove();
    this.picture.classList.toggle("covered", sentence !== "");
  }

  /** In the light and dark themes the bar's text differs. */
  drawBar(): void {
    const { context, height } = sharp(this.bar);
    if (height === 0) return;
    const ink = getComputedStyle(this.bar).color;
    drawColourBar(context, 10, 0, height, this.range, ink);
    const { fromMm, toMm } = this.range;
    this.bar.setAttribute("aria-label", `Colours from ${fromMm} to ${toMm} mm, locked`);
  }

  show(frame: Frame): void {
    this.frame = frame;
    if (frame.depth) [this.depth, this.depthFrame] = [frame.depth, frame];
    if (frame.luma) [this.luma, this.lumaFrame] = [frame.luma, frame];
    if (this.view === "depth" && frame.depth) this.map.drawDepth(frame.depth);
    if (frame.luma) this.drawPicture();
    this.shape();
    this.drawOver();
    this.showValue();
    if (this.line) this.showProfile();
  }

  /**
   * The map, or the camera's picture where that is shown, with its marks, bar and these lines of text
   * below, as a PNG. Of a surface it is the newest map: the canvas still has what was shown before.
   */
  picturePng(lines: string[], ink: string, paper: string): Promise<Blob> {
    const depth = isPicture(this.view) ? undefined : this.depth;
    if (depth) this.map.drawDepth(depth);
    const [width, height] = [this.canvas.width, this.canvas.height];
    const scale = Math.max(1, Math.round(580 / width));
    const [mapWidth, mapHeight] = [width * scale, height * scale];
    const bar = depth ? 96 : 12;
    const made = el("canvas", {
      width: String(mapWidth + bar + 12),
      height: String(mapHeight + 24 + 18 * lines.length),
    });
    const context = made.getContext("2d") as CanvasRenderingContext2D;
    context.fillStyle = paper;
    context.fillRect(0, 0, made.width, made.height);
    context.imageSmoothingEnabled = false;
    context.save();
    context.translate(12, 12);
    context.drawImage(this.canvas, 0, 0, mapWidth, mapHeight);
    if (depth) {
      drawMarks(context, mapWidth, mapHeight, { ...this.marks(depth), zoom: new Zoom() });
      drawColourBar(context, mapWidth + 10, 0, mapHeight, this.range, ink);
    }
    context.restore();
    context.fillStyle = ink;
    context.font = "12px system-ui, sans-serif";
    context.textBaseline = "top";
    lines.forEach((text, i) => context.fillText(text, 12, mapHeight + 20 + 18 * i));
    return new Promise((done, failed) =>
      made.toBlob(
        (blob) => (blob ? done(blob) : failed(new Error("no picture was made"))),
        "image/png",
      ),
    );
  }

  /** The frame of what is shown, which newer ones without a map or a picture leave. */
  get frameOfPicture(): Frame | undefined {
    return isPicture(this.view) ? this.lumaFrame : this.depthFrame;
  }

  private shown(): DepthMap | LumaMap | undefined {
    return isPicture(this.view) ? this.luma : this.depth;
  }

  private shape(): void {
    const map = this.shown();
    if (map) this.picture.style.setProperty("--shape", String(map.width / map.height));
  }

  private marks(map: DepthMap | LumaMap): Marks {
    const { cursor, line, zoom } = this;
    const contact = "mmPerPx" in map ? this.frame?.contact : undefined;
    return { grid: this.grid(map), contact, cursor, line, zoom, hasScale: "mmPerPx" in map };
  }

  /** The line drawn on the camera's picture: x and y of both ends, pixels. */
  get cameraLine(): number[] | undefined {
    const { line, luma } = this;
    if (!line || !luma || !isPicture(this.view)) return undefined;
    return [line.from, line.to].flatMap((end) => {
      const pixel = pixelOf(this.grid(luma), end);
      return pixel ? [pixel.column, pixel.row] : [];
    });
  }

  private drawOver(): void {
    const { context, width, height } = sharp(this.marksCanvas);
    const map = this.view === "surface" ? undefined : this.shown();
    if (map && width > 0) drawMarks(context, width, height, this.marks(map));
  }

  private point(event: PointerEvent): void {
    const map = this.shown();
    if (!map) return;
    const [x, y] = this.zoom.toPicture(...this.shares(event));
    const column = Math.floor(x * map.width);
    const row = Math.floor(y * map.height);
    const inside = column >= 0 && row >= 0 && column < map.width && row < map.height;
    if (inside) this.moveTo(placeOf(this.grid(map), column, row));
  }

  /** Where the pointer is in the window: shares of its width and height. */
  private shares(event: MouseEvent): [number, number] {
    const box = this.marksCanvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  /** One pointer moves the picture, two zoom it; a line is drawn by one. */
  private drag(event: PointerEvent): void {
    const before = this.held.get(event.pointerId);
    if (!before || this.drawing) return;
    const now = this.shares(event);
    this.held.set(event.pointerId, now);
    const other = [...this.held].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const distance = ([x, y]: [number, number]): number => Math.hypot(x - other[0], y - other[1]);
      const factor = distance(before) > 0 ? distance(now) / distance(before) : 1;
      this.zoom.about((now[0] + other[0]) / 2, (now[1] + other[1]) / 2, factor);
    } else {
      this.zoom.pan(now[0] - before[0], now[1] - before[1]);
    }
    this.zoomed();
  }

  private zoomed(): void {
    const { factor, left, top } = this.zoom;
    this.picture.style.setProperty("--zoom", String(factor));
    this.picture.style.setProperty("--shift-x", `${-100 * left * factor}%`);
    this.picture.style.setProperty("--shift-y", `${-100 * top * factor}%`);
    this.drawOver();
  }

  private steer(event: KeyboardEvent): void {
    // The browser's own zoom and the like.
    if (event.ctrlKey || event.metaKey) return;
    const factor = { "+": 1.5, "-": 1 / 1.5, "0": 0 }[event.key];
    if (factor !== undefined) {
      event.stopPropagation();
      if (factor === 0) this.zoom.reset();
      else this.zoom.about(0.5, 0.5, factor);
      this.zoomed();
      return;
    }
    const ways: Record<string, [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, -1],
      ArrowDown: [0, 1],
    };
    const way = ways[event.key];
    const map = this.shown();
    if (!way || !map) return;
    event.preventDefault();
    event.stopPropagation();
    const grid = this.grid(map);
    const from = (this.cursor && pixelOf(grid, this.cursor)) ?? {
      column: map.width >> 1,
      row: map.height >> 1,
    };
    const by = event.shiftKey ? 10 : 1;
    const column = Math.min(Math.max(from.column + by * way[0], 0), map.width - 1);
    const row = Math.min(Math.max(from.row + by * way[1], 0), map.height - 1);
    this.moveTo(placeOf(grid, column, row));
  }

  /** The camera's picture has no millimetres of its own: its pixels stand for them. */
  private grid(map: DepthMap | LumaMap): Grid {
    if ("mmPerPx" in map) return map;
    const viewpoint = { footXMm: 0, footYMm: 0, perMm: 0 };
    return { width: map.width, height: map.height, mmPerPx: 1, viewpoint };
  }

  private moveTo(place: Place | undefined): void {
    this.cursor = place;
    if (this.drawing && this.line && place) {
      this.line = { from: this.line.from, to: place };
      this.showProfile();
    }
    this.drawOver();
    this.showValue();
  }

  private showValue(): void {
    const map = this.shown();
    const pixel = map && this.cursor && pixelOf(this.grid(map), this.cursor);
    if (!map || !pixel || !this.cursor) {
      say(
        this.readout,
        this.lineWords() || "Point at the map for its values.",
      );
      return;
    }
    const where = `row ${pixel.row}, column ${pixel.column}`;
    const words = this.lineWords();
    const line = words && ` · ${words}`;
    if ("mmPerPx" in map) {
      const value = valueUm(map, pixel.column, pixel.row);
      const { xMm, yMm } = pointAt(map, this.cursor);
      const place = `x ${mm(xMm)}, y ${mm(yMm)}`;
      const reported = value === null ? "untrusted" : um(value);
      say(this.readout, `${reported} · ${where} · ${place}${line}`);
    } else {
      const at = pixel.row * map.width + pixel.column;
      const grey = map.values[at] as number;
      const scale = this.view === "difference" ? this.referenceScale() : undefined;
      const change =
        this.reference && scale
          ? ` · reference ${greyAt(this.reference, pixel.row / scale, pixel.column / scale)}`
          : "";
      say(this.readout, `grey ${grey} of 255${change} · ${where}${line}`);
    }
  }

  private lineWords(): string {
    if (!this.line || this.view === "surface") return "";
    if (this.view === "depth") return lineText(this.depth, this.line);
    return `A–B ${fixed(lengthOf(this.line), 1)} pixels`;
  }

  private showProfile(): void {
    const { depth, line } = this;
    this.profiled(depth && line && this.view === "depth" ? profileOf(depth, line) : undefined);
  }
}
