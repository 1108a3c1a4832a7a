// The last seconds of frames as they came, still encoded, for stepping through them.
import type { Frame } from "../../gen/dtact_pb";

const MAX_BYTES = 48 * 1024 * 1024;
const MAX_FRAMES = 600;

/** Bounded by bytes and by frames; the oldest go first. */
export class History {
  private readonly kept: { frame: Frame; bytes: number }[] = [];
  private bytes = 0;

  add(frame: Frame, bytes: number): void {
    this.kept.push({ frame, bytes });
    this.bytes += bytes;
    while (this.bytes > MAX_BYTES || this.kept.length > MAX_FRAMES) {
      this.bytes -= this.kept.shift()?.bytes ?? 0;
    }
  }

  /** The frame this many before the newest; the oldest if there are fewer. */
  behind(count: number): { frame: Frame; behind: number } | undefined {
    const behind = Math.max(0, Math.min(count, this.kept.length - 1));
    const kept = this.kept[this.kept.length - 1 - behind];
    return kept && { frame: kept.frame, behind };
  }

  clear(): void {
    this.kept.length = 0;
    this.bytes = 0;
  }
}
