// Values of a depth map in words: at a pixel, and along the drawn line.
import type { DepthMap } from "../session/messages";
import { mm, um } from "../labels";
import { pixelOf } from "./overlay";
import type { Line, Place } from "./overlay";

/** Depth along a line: millimetres from its start, and depth in millimetres or null where untrusted. */
export interface Profile {
  alongMm: number[];
  depthMm: (number | null)[];
}

/** Depth at a pixel, micrometres; null: untrusted. */
export function valueUm(depth: DepthMap, column: number, row: number): number | null {
  const value = depth.values[row * depth.width + column] as number;
  return value === depth.untrusted ? null : value * depth.umPerUnit;
}

function valueAt(depth: DepthMap, place: Place): number | null {
  const pixel = pixelOf(depth, place);
  return pixel ? valueUm(depth, pixel.column, pixel.row) : null;
}

function lengthOf({ from, to }: Line): number {
  return Math.hypot(to.xMm - from.xMm, to.yMm - from.yMm);
}

/** Its length, and how much deeper B is than A. */
export function lineText(depth: DepthMap | undefined, line: Line): string {
  const a = depth ? valueAt(depth, line.from) : null;
  const b = depth ? valueAt(depth, line.to) : null;
  const step = a === null || b === null ? "" : `, B − A ${um(b - a)}`;
  return `A–B ${mm(lengthOf(line))}${step}`;
}

/** The nearest pixels' own values, about one for each pixel that the line crosses. */
export function profileOf(depth: DepthMap, line: Line): Profile {
  const long = lengthOf(line);
  const count = Math.max(2, Math.round(long / depth.mmPerPx) + 1);
  const profile: Profile = { alongMm: [], depthMm: [] };
  for (let i = 0; i < count; ++i) {
    const share = i / (count - 1);
    const value = valueAt(depth, {
      xMm: line.from.xMm + share * (line.to.xMm - line.from.xMm),
      yMm: line.from.yMm + share * (line.to.yMm - line.from.yMm),
    });
    profile.alongMm.push(share * long);
    profile.depthMm.push(value === null ? null : value / 1000);
  }
  return profile;
}
