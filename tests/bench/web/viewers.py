#!/usr/bin/env python3
"""viewers.py --build FOLDER [--viewers 16] [--seconds 20]: processor time of dtact-web for this many viewers
of one simulated sensor at 60 frames a second, by depth encoding.

Counted are the processor seconds that the kernel charges to the gateway (user and system), and the messages that
viewers have taken whole. A busy machine delivers fewer frames; the cost of one viewer's frame says what 60 a second
would take. Viewers throw away what they read: only the gateway is measured."""
import argparse
import os
import pathlib
import selectors
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests/e2e/web"))
PROGRAMS = {"DTACTD": "dtactd", "DTACT_WEB": "dtact-web", "CALIBRATE": "dtact-calibrate",
            "SIM_RENDER": "dtact-sim-render"}
TICKS = os.sysconf("SC_CLK_TCK")
CAMERA_HZ = 60


class Drain:
    """Parses a WebSocket's bytes and counts whole messages of the server, which masks none."""

    def __init__(self, viewer):
        self.socket = viewer.socket.stream
        self.socket.setblocking(False)
        self.pending, self.skip, self.messages, self.bytes = bytearray(viewer.socket.buffer), 0, 0, 0
        self.in_message = False
        self.walk()

    def walk(self):
        while True:
            taken = min(self.skip, len(self.pending))
            del self.pending[:taken]
            self.skip -= taken
            if self.skip > 0:
                return
            if self.in_message:
                self.messages += 1
                self.in_message = False
            if len(self.pending) < 2:
                return
            length, head = self.pending[1], {126: 4, 127: 10}.get(self.pending[1], 2)
            if len(self.pending) < head:
                return
            self.skip = int.from_bytes(self.pending[2:head], "big") if head > 2 else length
            del self.pending[:head]
            self.in_message = True

    def read(self, buffer):
        count = self.socket.recv_into(buffer)
        if count == 0:
            raise SystemExit("the gateway let a viewer go")
        self.bytes += count
        if self.skip >= count:
            self.skip -= count  # the middle of a message is not parsed
            if self.skip == 0:
                self.walk()
        else:
            self.pending += buffer[:count]
            self.walk()


def processor_seconds(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def measure(gateway, viewers, seconds, request):
    from viewer import M, Viewer
    opened = [Viewer(gateway.port) for _ in range(viewers)]
    for viewer in opened:
        viewer.call(subscribe=M.Subscribe(events=False, **request))
    drains = [Drain(viewer) for viewer in opened]
    selector = selectors.DefaultSelector()
    for drain in drains:
        selector.register(drain.socket, selectors.EVENT_READ, drain)
    buffer = memoryview(bytearray(1 << 20))

    def run(until):
        while (left := until - time.monotonic()) > 0:
            for key, _ in selector.select(left):
                key.data.read(buffer)

    run(time.monotonic() + 2)
    before = processor_seconds(gateway.process.pid), sum(d.messages for d in drains), sum(d.bytes for d in drains)
    began = time.monotonic()
    run(began + seconds)
    wall = time.monotonic() - began
    used = processor_seconds(gateway.process.pid) - before[0]
    messages = sum(d.messages for d in drains) - before[1]
    size = (sum(d.bytes for d in drains) - before[2]) / max(1, messages)
    for viewer in opened:
        viewer.link.close()
    return used / wall, messages / wall / viewers, used / max(1, messages), size


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    parser.add_argument("--viewers", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=20)
    options = parser.parse_args()
    for variable, program in PROGRAMS.items():
        found = sorted((path for path in options.build.resolve().rglob(program)
                        if path.is_file() and os.access(path, os.X_OK)), key=lambda path: len(path.parts))
        if not found:
            sys.exit(f"{program} is not in {options.build}: build it first")
        os.environ[variable] = str(found[0])
    from programs import Daemon, Gateway, calibrate
    from viewer import E
    requests = {"none, summaries": dict(summary=True),
                "predict_zstd": dict(depth=E.DEPTH_PREDICT_ZSTD),
                "int16": dict(depth=E.DEPTH_INT16)}
    with tempfile.TemporaryDirectory(prefix="dtact_viewers_") as name:
        folder = pathlib.Path(name)
        daemon = Daemon(folder, "left", f"calibration={calibrate(folder)}")
        gateway = Gateway(folder, "--daemon", f"left=127.0.0.1:{daemon.port}")
        print(f"{options.viewers} viewers, {options.seconds:g} s each")
        print("depth             bytes a frame   frames/s a viewer   cores   µs a viewer's frame   cores at 60 Hz")
        try:
            for what, request in requests.items():
                cores, rate, cost, size = measure(gateway, options.viewers, options.seconds, request)
                print(f"{what:<18}{size:13.0f}{rate:20.1f}{cores:8.3f}{cost * 1e6:22.1f}"
                      f"{cost * options.viewers * CAMERA_HZ:17.3f}", flush=True)
        finally:
            gateway.stop()
            daemon.stop()


if __name__ == "__main__":
    main()
