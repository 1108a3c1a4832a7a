#!/usr/bin/env python3
"""Measures the daemon's loop in real time: latency, frame rate, clients, memory.

The release dtactd plays recordings of the simulated sensor (replay backend); clients are connected
over loopback. Latency counts from the frame being ready at the HAL (for a recording: when it is
due) until its last byte has come out of the client's socket, decoding the JPEG included. The
client is pinned to the first CPU and FIFO where the system permits it, so that its own waiting is
no part of the figure; what was permitted is printed.

Prints tables and one line a goal; writes CSV and plots to --out. Exit code 0: measured, whether the
goals are met or not.
"""
import argparse
import os
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.dirname(HERE)]
import goals  # noqa: E402
import latency  # noqa: E402
import throughput  # noqa: E402
from daemon import Programs, prepare  # noqa: E402


def machine():
    model = "unknown CPU"
    with open("/proc/cpuinfo", encoding="ascii", errors="replace") as info:
        for text in info:
            if text.startswith(("model name", "Model")):
                model = text.split(":", 1)[1].strip()
                break
    return f"{os.cpu_count()} CPUs, {model}, Linux {os.uname().release.split('-')[0]}"


def surroundings(programs, seconds):
    """State of the machine before the start: load of other programs, and how late it wakes a FIFO
    thread that only sleeps on the capture thread's CPU."""
    def read():
        with open("/proc/stat", encoding="ascii") as file:
            values = [int(v) for v in file.readline().split()[1:9]]
        return sum(values), values[3] + values[4], values[7]

    before = read()
    jitter = subprocess.run([programs.jitter, str(max(os.sched_getaffinity(0))), "50", str(seconds)],
                            check=True, capture_output=True, text=True).stdout
    total, idle, stolen = (then - now for now, then in zip(before, read()))
    return (f"before: other programs kept the CPUs {100 * (total - idle) / total:.0f} % busy, the "
            f"host took {100 * stolen / total:.1f} %;\na FIFO thread that only sleeps was woken late "
            f"by {jitter.strip()}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", required=True, help="folder of the release build with tests")
    parser.add_argument("--out", default="build/bench/results", help="folder for CSV and plots")
    parser.add_argument("--seconds", type=float, default=300, help="of each case of latency")
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    began = time.monotonic()
    programs = Programs(options.build)
    label = f"replay of the simulated sensor, 800x600 to 580x580, {machine()}"
    print(f"\nThe loop: {label}")
    print(surroundings(programs, 10))

    with tempfile.TemporaryDirectory() as folder:
        work = os.path.join(folder, "loop")
        recordings = prepare(programs, work)
        lines = throughput.measure(programs, work, recordings, options.out, label,
                                   min(20, options.seconds))
        lines = latency.measure(programs, work, recordings, options.out, label,
                                options.seconds) + lines
    print()
    goals.report(options.out, "loop", lines)
    print(f"CSV and plots in {options.out}; took {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
