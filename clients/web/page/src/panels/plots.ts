// The last 30 seconds as small plots, and depth along the drawn line.
import uPlot from "uplot";
import { el } from "../dom";
import type { Frame } from "../session/messages";
import type { Profile } from "../view/reading";

const SECONDS = 30;
const REDRAW_MS = 250;
const PROFILE_MS = 60;
/** More frames a second than this are thinned: no screen shows them. */
const MAX_POINTS = 1800;

type Value = number | null;

/** What is plotted of a frame; null: not measured. */
const SERIES: Record<
  string,
  {
    title: string;
    /** The axis reaches at least this. */ top: number;
    of: (frame: Frame, latencyMs: Value) => Value;
  }
> = {
  deepest: { title: "Deepest, mm", top: 0.1, of: (frame) => frame.contact?.deepestMm ?? null },
  area: { title: "Area, mm²", top: 1, of: (frame) => frame.contact?.areaMm2 ?? null },
  volume: { title: "Volume, mm³", top: 1, of: (frame) => frame.contact?.volumeMm3 ?? null },
  force: { title: "Force, N", top: 0.1, of: (frame) => frame.contact?.forceN ?? null },
  light: {
    title: "Brightness of the light",
    top: 255,
    of: (frame) => frame.light?.brightness ?? null,
  },
  latency: { title: "Latency, ms", top: 10, of: (_, latencyMs) => latencyMs },
};

function theme(): { ink: string; grid: string; line: string } {
  const style = getComputedStyle(document.documentElement);
  const of = (name: string): string => style.getPropertyValue(name).trim();
  return { ink: of("--quiet"), grid: of("--rule"), line: of("--accent") };
}

function axes(xValues: (value: number) => string): uPlot.Axis[] {
  const font = "10px system-ui, sans-serif";
  const common = {
    font,
    stroke: () => theme().ink,
    grid: { stroke: () => theme().grid, width: 1 },
    ticks: { show: false },
    gap: 2,
  };
  return [
    { ...common, size: 20, gap: 6, space: 50, values: (_, splits) => splits.map(xValues) },
    { ...common, size: 34, space: 22 },
  ];
}

/** Follows the width of its place. */
function plotIn(place: HTMLElement, height: number, make: (width: number) => uPlot): uPlot {
  const plot = make(Math.max(100, place.clientWidth));
  new ResizeObserver(() => {
    if (place.clientWidth > 0) plot.setSize({ width: place.clientWidth, height });
  }).observe(place);
  return plot;
}

export class Plots {
  readonly element = el("section", {
    class: "plots",
    role: "group",
    "aria-label": "The last 30 seconds",
  });
  private readonly plots: {
    of: (typeof SERIES)[string]["of"];
    plot: uPlot;
    values: Value[];
    place: HTMLElement;
  }[] = [];
  private readonly times: number[] = [];
  private drawnAt = 0;

  /** Call once the element is in the page. */
  start(): void {
    for (const [name, { title, top, of }] of Object.entries(SERIES)) {
      const canvas = el("div", { class: "plot" });
      const place = el("figure", { "data-plot": name }, el("figcaption", {}, title), canvas);
      this.element.append(place);
      const plot = plotIn(
        canvas,
        96,
        (width) =>
          new uPlot(
            {
              width,
              height: 96,
              legend: { show: false },
              cursor: { show: false },
              padding: [6, 12, 0, 0],
              scales: {
                x: { time: false, range: () => [-SECONDS, 0] },
                y: {
                  range: (_, least, most) =>
                    least === null ? [0, top] : [Math.min(0, least), Math.max(most * 1.05, top)],
                },
              },
              axes: axes((value) => `${value} s`.replace("-", "−")),
              series: [{}, { stroke: () => theme().line, width: 1.5, points: { show: false } }],
            },
            [[], []],
            canvas,
          ),
      );
      this.plots.push({ of, plot, values: [], place });
    }
  }

  add(frame: Frame, latencyMs: number | undefined): void {
    const now = frame.wallMs;
    // The clock was set, or it is another daemon's.
    if (this.times.length > 0 && now < (this.times.at(-1) as number)) this.clear();
    this.times.push(now);
    for (const entry of this.plots) entry.values.push(entry.of(frame, latencyMs ?? null));
    while (this.times.length > MAX_POINTS || now - (this.times[0] as number) > 1000 * SECONDS) {
      this.times.shift();
      for (const entry of this.plots) entry.values.shift();
    }
    if (performance.now() - this.drawnAt > REDRAW_MS) this.draw();
  }

  draw(): void {
    this.drawnAt = performance.now();
    const newest = this.times.at(-1);
    if (newest === undefined || this.element.clientWidth === 0) return;
    const before = this.times.map((time) => (time - newest) / 1000);
    for (const { plot, values, place } of this.plots) {
      const empty = values.every((value) => value === null);
      place.classList.toggle("empty", empty);
      plot.setData([before, values]);
    }
  }

  close(): void {
    for (const { plot } of this.plots.splice(0)) plot.destroy();
  }

  private clear(): void {
    this.times.length = 0;
    for (const entry of this.plots) entry.values.length = 0;
  }
}

export class ProfilePlot {
  private readonly canvas = el("div", { class: "plot" });
  readonly element = el(
    "figure",
    { class: "profile", hidden: "" },
    el("figcaption", {}, "Depth along A–B, mm"),
    this.canvas,
  );
  private plot: uPlot | undefined;
  private drawnAt = 0;
  private later: ReturnType<typeof setTimeout> | undefined;

  show(profile: Profile | undefined, range: { fromMm: number; toMm: number }): void {
    this.element.hidden = profile === undefined;
    clearTimeout(this.later);
    if (!profile) return;
    // The last one is drawn, too, though none may follow it.
    const wait = this.drawnAt + PROFILE_MS - performance.now();
    if (wait > 0) {
      this.later = setTimeout(() => this.show(profile, range), wait);
      return;
    }
    this.drawnAt = performance.now();
    this.plot ??= plotIn(
      this.canvas,
      130,
      (width) =>
        new uPlot(
          {
            width,
            height: 130,
            legend: { show: false },
            cursor: { show: false },
            padding: [6, 16, 0, 0],
            scales: {
              x: { time: false },
              y: {
                range: (_, least, most) => [
                  Math.min(range.fromMm, least ?? 0),
                  Math.max(most ?? 0, 0.2),
                ],
              },
            },
            axes: axes((value) => `${value} mm`),
            series: [{}, { stroke: () => theme().line, width: 1.5, points: { show: false } }],
          },
          [[], []],
          this.canvas,
        ),
    );
    this.plot.setData([profile.alongMm, profile.depthMm]);
  }

  /** Nothing is shown afterwards. */
  close(): void {
    clearTimeout(this.later);
    this.plot?.destroy();
  }
}
