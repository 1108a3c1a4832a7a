// Frames shown in the last second, and how late the last one was.
import { nowMs } from "./session/clock";
import type { Frame } from "./session/messages";

export class Meter {
  private readonly shown: number[] = [];
  /** From the frame's timestamp until now, milliseconds; undefined while the clocks are not known. */
  latencyMs: number | undefined;

  count(frame: Frame): void {
    const now = nowMs();
    this.shown.push(now);
    while (now - (this.shown[0] as number) > 1000) this.shown.shift();
    this.latencyMs = frame.capturedMs === undefined ? undefined : now - frame.capturedMs;
  }

  get fps(): number {
    const spanMs = (this.shown.at(-1) ?? 0) - (this.shown[0] ?? 0);
    return spanMs > 0 ? (1000 * (this.shown.length - 1)) / spanMs : 0;
  }
}
