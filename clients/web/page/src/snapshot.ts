// The picture that is shown as a file, with its time and what it was made with.
import type { Status } from "../gen/dtact_pb";
import { el } from "./dom";
import type { Frame } from "./session/messages";
import { isPicture } from "./view/stage";
import type { Stage, View } from "./view/stage";
import { fixed } from "./labels";

export async function saveSnapshot(
  sensor: string,
  view: View,
  stage: Stage,
  /** The one of the map or picture. */
  frame: Frame,
  status: Status | undefined,
): Promise<void> {
  const time = new Date(frame.wallMs).toISOString();
  const light = frame.light ? `brightness ${frame.light.brightness}` : "light unknown";
  const lines = [`${sensor} · ${time} · frame ${frame.sequence}`];
  if (!isPicture(view) && stage.depth) {
    const { fromMm, toMm } = stage.range;
    const worth = `± ${fixed(stage.depth.uncertaintyUm, 0)} µm`;
    lines.push(`range ${fromMm} to ${toMm} mm · ${worth} · ${fixed(stage.depth.mmPerPx, 4)} mm/px`);
  }
  lines.push(`calibration ${status?.calibration?.name ?? "none"} · ${light}`);
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string): string => style.getPropertyValue(name).trim();
  const blob = await stage.picturePng(lines, colour("--ink"), colour("--panel"));
  const url = URL.createObjectURL(blob);
  el("a", { href: url, download: `${sensor}-${time.replaceAll(":", "")}.png` }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
