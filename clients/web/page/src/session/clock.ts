// The daemon's clock beside the page's (proto/README.md, Clocks).

interface Sample {
  wayMs: number;
  offsetMs: number;
}

/** Milliseconds since 1970 of a clock that does not jump while the page lives. */
export function nowMs(): number {
  return performance.timeOrigin + performance.now();
}

/** The fastest of the last ten pings gives the best estimate of the daemon's clock. */
export class ClockOffset {
  private readonly samples: Sample[] = [];

  /** Adds a Ping: the page's times when it was sent and answered, and the daemon's from the Pong. */
  add(sentMs: number, receivedMs: number, monotonicNs: bigint): void {
    const middle = (sentMs + receivedMs) / 2;
    this.samples.push({ wayMs: receivedMs - sentMs, offsetMs: middle - Number(monotonicNs) / 1e6 });
    if (this.samples.length > 10) this.samples.shift();
  }

  /** The page's time of a moment of the daemon's CLOCK_MONOTONIC; undefined before the first Pong. */
  here(monotonicNs: bigint): number | undefined {
    const best = this.samples.reduce<Sample | undefined>(
      (least, sample) => (least && least.wayMs <= sample.wayMs ? least : sample),
      undefined,
    );
    return best && Number(monotonicNs) / 1e6 + best.offsetMs;
  }

  clear(): void {
    this.samples.length = 0;
  }
}
