// The range's colours with their millimetres beside the map.
import { BEYOND, colourMap, COLOURS } from "./colour_map";
import type { Range } from "./map_canvas";

const STEPS_MM = [0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1, 2, 5, 10];

/** Draws it upright, in CSS pixels; `ink` is the text's colour. */
export function drawColourBar(
  context: CanvasRenderingContext2D,
  left: number,
  top: number,
  height: number,
  range: Range,
  ink: string,
): void {
  const width = 14;
  const cap = 10;
  const low = top + height - 24;
  const high = top + cap + 14;
  context.fillStyle = `rgb(${BEYOND.join(" ")})`;
  context.fillRect(left, top + 6, width, cap - 2);
  for (let y = high; y < low; ++y) {
    const step = Math.min(COLOURS - 1, Math.floor(((low - y - 0.5) / (low - high)) * COLOURS));
    const [r, g, b] = colourMap.subarray(4 * step, 4 * step + 3);
    context.fillStyle = `rgb(${r} ${g} ${b})`;
    context.fillRect(left, y, width, 1);
  }
  const span = range.toMm - range.fromMm;
  const every = STEPS_MM.find((step) => span / step <= 6.01) ?? span;
  context.font = "11px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.fillStyle = ink;
  context.strokeStyle = ink;
  context.lineWidth = 1;
  // Striped like untrusted pixels in the map.
  for (let x = 0; x < width; ++x) {
    for (let y = 0; y < cap - 2; ++y) {
      context.fillStyle =
        Math.floor((x + y) / 4) % 2 === 0 ? "rgb(107 107 107)" : "rgb(143 143 143)";
      context.fillRect(left + x, low + 14 + y, 1, 1);
    }
  }
  context.fillStyle = ink;
  context.fillText("untrusted", left + width + 8, low + 14 + (cap - 2) / 2);
  context.fillText("above", left + width + 8, top + 6 + (cap - 2) / 2);
  for (let i = Math.ceil(range.fromMm / every - 1e-9); i * every <= range.toMm + 1e-9; ++i) {
    const value = i * every;
    const y = low - ((value - range.fromMm) / span) * (low - high);
    context.beginPath();
    context.moveTo(left + width, y);
    context.lineTo(left + width + 4, y);
    context.stroke();
    const text = value.toFixed(every < 0.1 ? 2 : every === 0.25 ? 2 : 1);
    // What is below has the lowest colour, too.
    const below = Math.abs(value - range.fromMm) < 1e-9 ? "≤ " : "";
    context.fillText(
      `${below}${text}${Math.abs(value - range.toMm) < 1e-9 ? " mm" : ""}`,
      left + width + 8,
      y,
    );
  }
}
