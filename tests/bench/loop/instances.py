#!/usr/bin/env python3
"""Measures many daemons on one machine: one a sensor, as the unit's instances dtactd@NAME run.

Each plays a recording of the simulated sensor (800x600, MJPEG, 60 fps) and has one client that asks
for every full map. Prints for each number of instances the processor's share, memory, frame rate
of the slowest and of the fastest, latency from the frame's arrival to the client's socket, and
frames that were missed; before that how long one takes from its start until it serves depth, with a
stored reference (median of five), and what it holds in memory. Writes instances.csv to --out.
"""
import argparse
import contextlib
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.dirname(HERE)]
import goals  # noqa: E402
from daemon import FPS, Daemon, Programs, prepare  # noqa: E402
from latency import percentile  # noqa: E402

COUNTS = (1, 2, 4, 6, 8, 10, 13, 16)
MAX_START_S = 1.0
MAX_RSS_MIB = 45


def memory_mib(pid):
    """Resident, its share of what processes share, and locked."""
    with open(f"/proc/{pid}/smaps_rollup", encoding="ascii") as file:
        text = file.read()
    return tuple(int(re.search(rf"^{key}:\s+(\d+)", text, re.MULTILINE).group(1)) / 1024
                 for key in ("Rss", "Pss", "Locked"))


def settings(recordings, folder, index):
    state = os.path.join(folder, f"state{index}")
    shutil.copytree(os.path.join(folder, "state"), state, dirs_exist_ok=True)
    return {"camera.replay.folder": recordings["mjpeg"], "state_dir": state}


def client(programs, port, seconds, skip, output):
    return subprocess.Popen([programs.client, "--port", str(port), "--seconds", str(seconds),
                             "--skip", str(skip), "-o", output], stdout=subprocess.DEVNULL)


def first_depth(programs, folder, recordings):
    """Seconds from the program's start until its status says that depth is served."""
    began = time.monotonic()
    with Daemon(programs, folder, settings(recordings, folder, "first")) as daemon:
        while daemon.status()["state"] != "STATE_SERVING":
            time.sleep(0.01)
        return time.monotonic() - began


def measure(programs, folder, recordings, count, seconds):
    """One row of the table."""
    with contextlib.ExitStack() as stack:
        daemons = [stack.enter_context(Daemon(programs, folder, settings(recordings, folder, f"{count}_{i}"),
                                              log=f"dtactd{i}.log")) for i in range(count)]
        for daemon in daemons:
            daemon.wait_serving()
        tables = [os.path.join(folder, f"frames{i}.csv") for i in range(count)]
        running = [client(programs, d.port, seconds, 1, name) for d, name in zip(daemons, tables)]
        time.sleep(1)
        before, cpu, began = [d.status() for d in daemons], [d.cpu_s() for d in daemons], time.monotonic()
        time.sleep(max(1, seconds - 2))
        used = [d.cpu_s() - c for d, c in zip(daemons, cpu)]
        passed = time.monotonic() - began
        memory = [memory_mib(d.process.pid) for d in daemons]
        after = [d.status() for d in daemons]
        cores = {status.get("capture_cpu") for status in after}
        for process in running:
            if process.wait(timeout=60) != 0:
                raise SystemExit("bench: a client ended badly")
    latency, rates = [], []
    for name in tables:
        with open(name, newline="", encoding="ascii") as file:
            rows = list(csv.DictReader(file))
        rates.append(len(rows) / seconds)
        latency += [(int(r["received_ns"]) - int(r["ready_ns"])) / 1e6 for r in rows]
    latency.sort()
    missed = sum(a["camera"][k] - b["camera"][k] for a, b in zip(after, before)
                 for k in ("lost", "skipped", "damaged"))
    return {"instances": count, "cpu_percent_each": 100 * sum(used) / passed / count,
            "slowest_fps": min(rates), "fastest_fps": max(rates), "p50_ms": percentile(latency, 0.5),
            "p99_ms": percentile(latency, 0.99), "missed": missed,
            "rss_mib": max(m[0] for m in memory), "pss_mib_each": sum(m[1] for m in memory) / count,
            "locked_mib": max(m[2] for m in memory), "cores": len(cores)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", required=True, help="folder of the release build with tests")
    parser.add_argument("--out", default="build/bench/results", help="folder for the CSV file")
    parser.add_argument("--seconds", type=float, default=10, help="of each number of instances")
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    programs = Programs(options.build)
    with tempfile.TemporaryDirectory() as temporary:
        folder = os.path.join(temporary, "loop")
        recordings = prepare(programs, folder)
        start = sorted(first_depth(programs, folder, recordings) for _ in range(5))[2]
        rows = [measure(programs, folder, recordings, count, options.seconds) for count in COUNTS]
    keys = list(rows[0])
    with open(os.path.join(options.out, "instances.csv"), "w", newline="", encoding="ascii") as file:
        writer = csv.DictWriter(file, keys)
        writer.writeheader()
        writer.writerows(rows)
    print(f"\nInstances of dtactd, each with a recording at {FPS} fps and one client, {os.cpu_count()} CPUs\n")
    print("".join(f"{key:>18}" for key in keys))
    for row in rows:
        print("".join(f"{row[key]:18.1f}" if isinstance(row[key], float) else f"{row[key]:>18}" for key in keys))
    goals.report(options.out, "instances", [
        (f"first depth at most {MAX_START_S:.1f} s after the start, with a stored reference", f"{start:.2f} s",
         start <= MAX_START_S, f"{start - MAX_START_S:.2f} s too late"),
        (f"at most {MAX_RSS_MIB} MiB resident with one client", f"{rows[0]['rss_mib']:.1f} MiB",
         rows[0]["rss_mib"] <= MAX_RSS_MIB, f"short by {rows[0]['rss_mib'] - MAX_RSS_MIB:.1f} MiB")])


if __name__ == "__main__":
    main()
