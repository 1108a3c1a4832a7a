#!/usr/bin/python3
"""stream.py ADDRESS FPS FRAMES: a client gets FRAMES frames of the daemon at ADDRESS, however long they
take, and says what is wrong with them:

- by their own timestamps they are 1 / FPS seconds apart, as the camera's mode promises;
- their sequence goes up, and what is missing in it are frames that camera or daemon count as lost or
  passed over, or tell this client that it missed.

Exit code: 0 nothing; 1 it is printed.
"""
import statistics
import sys

import dtact

TIMEOUT_S = 120.0  # the host may be busy
TOLERANCE = 0.01


def lost(status) -> int:
    """Frames that reached no client, from the daemon's counters."""
    camera = status.message.camera
    return camera.lost + camera.skipped + camera.damaged + status.message.skipped


def main(address: str, fps: float, count: int) -> str:
    frames: list[tuple[int, int]] = []  # sequence, nanoseconds
    dropped: list[int] = []
    with dtact.connect(address, timeout=TIMEOUT_S, kept_frames=count) as client:
        before = lost(client.status())
        client.subscribe(dtact.Subscription(depth=None, summary=True, events=False))
        for frame in client.frames():
            frames.append((frame.sequence, frame.message.monotonic_ns))
            dropped.append(frame.dropped)
            if len(frames) == count:
                break
        known = lost(client.status()) - before + dropped[-1] - dropped[0]
    if any(later[0] <= earlier[0] for earlier, later in zip(frames, frames[1:])):
        return "the sequence does not go up"
    missing = frames[-1][0] - frames[0][0] + 1 - count
    if missing > known:
        return f"{missing} frames are missing, of which {known} are accounted for"
    # Over half of the frames each, so that single late stamps do not count.
    half = count // 2
    period_ns = statistics.median((later[1] - earlier[1]) / (later[0] - earlier[0])
                                  for earlier, later in zip(frames, frames[half:]))
    print(f"{count} frames at {1e9 / period_ns:.2f} fps of the camera's clock, {missing} missing, "
          f"{known} accounted for")
    if abs(period_ns * fps / 1e9 - 1) > TOLERANCE:
        return f"they are {period_ns / 1e6:.3f} ms apart, {1000 / fps:.3f} were promised"
    return ""


if __name__ == "__main__":
    problem = main(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]))
    if problem:
        sys.exit(f"stream.py: {problem}")
