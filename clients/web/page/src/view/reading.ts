// Values of a depth map in words: at a pixel, and along the drawn line.
import type { DepthMap } from "../session/messages";
import { mm, um } from "../labels";
import { pixelOf, truePlace } from "./overlay";
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

/** Where the point lies that the map shows at a place; an untrusted one as if it were not pressed. */
export function pointAt(depth: DepthMap, place: Place): Place {
  return truePlace(depth.viewpoint, place, (valueAt(depth, place) ?? 0) / 1000);
}

function distance(from: Place, to: Place): number {
  return Math.hypot(to.xMm - from.xMm, to.yMm - from.yMm);
}

/** Millimetres as they appear, or pixels on the camera's picture. */
export function lengthOf({ from, to }: Line): number {
  return distance(from, to);
}

/** Its length, and how much deeper B is than A. */
export function lineText(depth: DepthMap | undefined, line: Line): string {
  const a = depth ? valueAt(depth, line.from) : null;
  const b = depth ? valueAt(depth, line.to) : null;
  const step = a === null || b === null ? "" : `, B − A ${um(b - a)}`;
  const long = depth
    ? distance(pointAt(depth, line.from), pointAt(depth, line.to))
    : distance(line.from, line.to);
  return `A–B ${mm(long)}${step}`;
}

/** The nearest pixels' own values at their true distances from A, about one for each pixel that the line
 * crosses. */
export function profileOf(depth: DepthMap, line: Line): Profile {
  const start = pointAt(depth, line.from);
  const count = Math.max(2, Math.round(distance(line.from, line.to) / depth.mmPerPx) + 1);
  const profile: Profile = { alongMm: [], depthMm: [] };
  for (let i = 0; i < count; ++i) {
    const share = i / (count - 1);
    const place = {
      xMm: line.from.xMm + share * (line.to.xMm - line.from.xMm),
      yMm: line.from.yMm + share * (line.to.yMm - line.from.yMm),
    };
    const value = valueAt(depth, place);
    profile.alongMm.push(distance(start, pointAt(depth, place)));
    profile.depthMm.push(value === null ? null : value / 1000);
  }
  return profile;
}
