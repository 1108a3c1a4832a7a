#!/usr/bin/env python3
"""Speed against accuracy: every method and setting on the same frames of the simulated sensor.

The chart server and the paper's pipeline in Python (tests/bench/paper_pipeline.py) run on one core;
this driver lets them work one setting at a time, in an order that changes with every round. Time is
CPU time of the one thread, the median over all rounds; instructions are counted by the processor
where the system allows it; the error is the mean absolute difference from the simulator's
indentation inside the true contact (everywhere, outside the contact), no offset removed.

Writes chart.csv and chart.png to --out. Exit code: 0, or 1 when something could not be measured.
"""
import argparse
import csv
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time

import cv2
import matplotlib
import matplotlib.ticker
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "..", "bench"))
from paper_pipeline import HEIGHT, LEFT, SIDE, TOP, WIDTH, PaperPipeline  # noqa: E402
from run import machine  # noqa: E402

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

TITLES = {"ball": "5 mm ball, 1.2 mm deep", "screws": "three set screws, 0.8 mm deep",
          "flat": "flat disc of 20 mm, 0.25 mm deep", "nothing": "no contact"}
PAPER = "paper's pipeline, Python"
COLUMNS = ["shot", "setting", "method", "resolution", "tiles", "smoothing_mm", "median_us",
           "quartile_low_us", "quartile_high_us", "instructions_per_pixel", "error_um",
           "untrusted_percent", "pareto"]


class Server:
    def __init__(self, program, core):
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True, bufsize=1,
                                        preexec_fn=lambda: os.sched_setaffinity(0, {core}))

    def ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"chart: the server ended at '{line}'")
        return answer.rstrip("\n")

    def close(self):
        self.process.stdin.close()
        self.process.wait(timeout=30)


class Paper:
    """The paper's pipeline on the exported shots, with the LUT of the published method."""

    def __init__(self, folder):
        def read(name, kind):
            return np.fromfile(os.path.join(folder, name), dtype=kind)

        self.read = read
        y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.float32)
        reference = (read("reference.u16", np.uint16) / 256.0).round().astype(np.uint8)
        self.pipeline = PaperPipeline(x + LEFT, y + TOP, self.colour(reference)[0])
        self.list = read("list.f32", np.float32).astype(np.float64)
        self.frames, self.next = [], 0

    @staticmethod
    def colour(grey):
        return [cv2.cvtColor(g, cv2.COLOR_GRAY2BGR) for g in grey.reshape(-1, HEIGHT, WIDTH)]

    def use(self, shot):
        self.frames = self.colour(self.read(f"{shot}.u8", np.uint8))

    def once(self):
        self.next = (self.next + 1) % len(self.frames)
        return self.pipeline.depth(self.frames[self.next], self.list)

    def error_um(self, shot):
        truth = self.read(f"{shot}.truth.f32", np.float32).reshape(SIDE, SIDE)
        judged = self.read(f"{shot}.judged.u8", np.uint8).reshape(SIDE, SIDE) > 0
        return 1000 * float(np.mean([np.abs(self.once() - truth)[judged].mean()
                                     for _ in self.frames]))

    def run(self, count):
        self.once()
        spent = []
        for _ in range(count):
            begin = time.thread_time_ns()
            self.once()
            spent.append(time.thread_time_ns() - begin)
        return spent


def measure(server, paper, shots, settings, rounds):
    """One row a shot and setting."""
    rows = {}
    for shot in shots:
        for setting in settings:
            if setting["name"] == PAPER:
                paper.use(shot)
                error, untrusted, instructions = paper.error_um(shot), 0.0, None
            else:
                server.ask(f"use {shot}|{setting['name']}")
                mm, share = map(float, server.ask("error").split())
                error, untrusted = 1000 * mm, 100 * share
                count = server.ask("instructions")
                instructions = None if count == "none" else int(count) / SIDE**2
            rows[shot, setting["name"]] = {
                "shot": shot, "setting": setting["name"], "method": setting["method"],
                "resolution": f"1/{setting['decimation']}", "tiles": setting["tiles"],
                "smoothing_mm": setting["smoothing_mm"], "error_um": error,
                "untrusted_percent": untrusted, "instructions_per_pixel": instructions,
                "samples": []}
    random.seed(1)
    for _ in range(rounds):
        order = list(rows)
        random.shuffle(order)
        for shot, name in order:
            if name == PAPER:
                paper.use(shot)
                rows[shot, name]["samples"] += paper.run(2)
            else:
                server.ask(f"use {shot}|{name}")
                rows[shot, name]["samples"] += map(int, server.ask("run 8").split())
    for row in rows.values():
        low, middle, high = statistics.quantiles(row.pop("samples"), n=4, method="inclusive")
        row.update(median_us=middle / 1000, quartile_low_us=low / 1000,
                   quartile_high_us=high / 1000, pareto=0)
    return list(rows.values())


def mark_pareto(rows):
    """A setting is on the front when no other is both faster and more accurate on its shot."""
    for row in rows:
        row["pareto"] = int(not any(
            other["shot"] == row["shot"] and other is not row and
            other["median_us"] <= row["median_us"] and other["error_um"] <= row["error_um"]
            for other in rows))


COLOURS = {"published": "#b2182b", "regression": "#d98200", "list": "#2166ac", "several": "#1b7837",
           "ours": "#d6409f", "virtual balls": "#8e44ad", "MJPEG": "#0b8a8a", "paper": "#222222"}
# The wider the smoothing, the paler.
SHADES = {0.05: 1.0, 0.1: 0.8, 0.2: 0.5, 0.4: 0.28}
MARKS = {"1/1": "o", "1/2": "s", "1/4": "D"}


def shade(colour, strength):
    return tuple(1 - strength * (1 - c) for c in matplotlib.colors.to_rgb(colour))


def plain_ticks(axis, subs):
    axis.set_major_locator(matplotlib.ticker.LogLocator(subs=subs))
    axis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
    axis.set_minor_locator(matplotlib.ticker.NullLocator())


def draw_points(axes, rows, value, front):
    for row in rows:
        if row[value] is None:
            continue
        colour = shade(COLOURS[row["method"]], SHADES.get(row["smoothing_mm"], 1.0) if row["method"] == "list" else 1.0)
        axes.plot(row[value], max(row["error_um"], 0.1), MARKS[row["resolution"]], color=colour,
                  markerfacecolor=colour if row["tiles"] else "white", markersize=5.5,
                  markeredgewidth=1.1)
    line = sorted((r for r in rows if r["pareto"] and r[value] is not None),
                  key=lambda r: r[value])
    if front and line:
        axes.step([r[value] for r in line], [max(r["error_um"], 0.1) for r in line],
                  where="post", color="black", linewidth=0.8, zorder=0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = axes.get_xlim()
    # More than two labels for each power of ten overlap beside the paper's pipeline.
    plain_ticks(axes.xaxis, (1, 2, 5) if high < 100 * low else (1, 3))
    plain_ticks(axes.yaxis, (1, 1.5, 2, 3, 4, 6, 8))
    axes.grid(True, which="major", linewidth=0.3, color="#bbbbbb")
    axes.tick_params(labelsize=7)


def plot(rows, shots, file, label):
    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 8})
    # A shared processor may not allow counting instructions: the row is left out then.
    views = [("time per frame, µs", "median_us", False, True),
             ("instructions per pixel of the full map", "instructions_per_pixel", False, False),
             ("time per frame, µs: beside the paper's", "median_us", True, False)]
    views = [view for view in views if any(r[view[1]] is not None for r in rows)]
    figure, axes = plt.subplots(len(views), len(shots), figsize=(11, 0.8 + 2.6 * len(views)),
                                squeeze=False)
    for column, shot in enumerate(shots):
        mine = [r for r in rows if r["shot"] == shot]
        ours = [r for r in mine if r["method"] != "paper"]
        axes[0][column].set_title(TITLES.get(shot, shot), fontsize=9)
        for row, (label_x, value, with_paper, front) in zip(axes, views):
            draw_points(row[column], mine if with_paper else ours, value, front)
            row[column].set_xlabel(label_x, fontsize=8)
        errors = [max(r["error_um"], 0.1) for r in mine]
        for row in axes:
            row[column].set_ylim(min(errors) / 1.3, max(errors) * 1.3)
    for row in axes:
        row[0].set_ylabel("mean absolute error, µm", fontsize=8)
    from matplotlib.lines import Line2D
    have = {r["method"] for r in rows}
    names = {"published": "published list", "regression": "published regression",
             "list": "sphere alone, one press", "several": "sphere alone, several presses",
             "ours": "ours, one press, sharpened 0 to 2x",
             "virtual balls": "virtual balls (a bound), sharpened 0 to 2x",
             "MJPEG": "ours from MJPEG, decoding counted",
             "paper": "paper's pipeline, Python + OpenCV"}
    legend = [Line2D([], [], marker="o", linestyle="", color=COLOURS[m], label=names[m])
              for m in names if m in have]
    legend += [Line2D([], [], marker="o", linestyle="", color=shade(COLOURS["list"], strength),
                      label=f"smoothed by {mm:g} mm") for mm, strength in SHADES.items()]
    legend += [Line2D([], [], marker=m, linestyle="", color="#666666", markerfacecolor="white",
                      label=f"{n} resolution")
               for n, m in (("full", "o"), ("half", "s"), ("quarter", "D"))]
    legend += [Line2D([], [], marker="o", linestyle="", color="#666666",
                      label="filled: only tiles that changed"),
               Line2D([], [], color="black", linewidth=0.8, label="Pareto front")]
    figure.legend(handles=legend, loc="lower center", ncol=5, fontsize=8, frameon=False)
    figure.suptitle("Speed against accuracy, simulated sensor, 800×600 → 580×580 "
                    f"(no error is drawn as 0.1 µm)\n{label}", fontsize=9)
    figure.tight_layout(rect=(0, 0.255 / len(views), 1, 0.985))
    figure.savefig(file, dpi=90)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--server", required=True, help="the chart_server program")
    parser.add_argument("--out", required=True, help="folder for chart.csv and chart.png")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)))
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    cv2.setNumThreads(1)
    os.sched_setaffinity(0, {options.core})  # the two take turns, so one core does

    server = Server(options.server, options.core)
    with tempfile.TemporaryDirectory() as folder:
        server.ask(f"export {folder}")
        paper = Paper(folder)
        shots = server.ask("shots").split("\t")[:-1]
        keys = ["name", "method", "decimation", "tiles", "smoothing_mm"]
        settings = [dict(zip(keys, s.split("|"))) for s in server.ask("list").split("\t")[:-1]]
        for setting in settings:
            setting.update(tiles=int(setting["tiles"]), smoothing_mm=float(setting["smoothing_mm"]))
        settings.append({"name": PAPER, "method": "paper", "decimation": 1, "tiles": 0,
                         "smoothing_mm": 0.0})
        rows = measure(server, paper, shots, settings, options.rounds)
    server.close()
    mark_pareto(rows)
    with open(os.path.join(options.out, "chart.csv"), "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})
    plot(rows, shots, os.path.join(options.out, "chart.png"), machine())
    for shot in shots:
        print(f"\n{TITLES.get(shot, shot)}: the Pareto front, and the paper's pipeline")
        for row in sorted((r for r in rows if r["shot"] == shot), key=lambda r: r["median_us"]):
            if row["pareto"] or row["method"] == "paper":
                print(f"  {row['setting']:28} {row['median_us']:9.1f} µs {row['error_um']:8.2f} µm")


if __name__ == "__main__":
    main()
