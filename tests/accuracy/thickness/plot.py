#!/usr/bin/python3
"""Plots the finest groove against the greatest depth, and the curves behind them, from thickness.csv."""

import argparse
import collections
import csv
import pathlib

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "dtact"  # the same picture from the same numbers
import matplotlib.pyplot as plt  # noqa: E402  (the back end is chosen first)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("csv", type=pathlib.Path)
    parser.add_argument("svg", type=pathlib.Path)
    arguments = parser.parse_args()
    gels = collections.defaultdict(lambda: collections.defaultdict(list))
    with open(arguments.csv, encoding="utf-8") as file:
        for line in csv.DictReader(file):
            gels[float(line["thickness_mm"])][line["kind"]].append(line)
    figure, (trade, grooves, presses) = plt.subplots(1, 3, figsize=(12, 3.6))
    colours = plt.get_cmap("viridis")
    points = []
    for i, (thickness, kinds) in enumerate(sorted(gels.items())):
        colour = colours(i / 5)
        point = float(kinds["finest"][0]["value_mm"]), float(kinds["deepest"][0]["value_mm"])
        points.append(point)
        trade.plot(*point, "o", color=colour)
        trade.annotate(f"{thickness:g} mm", point, textcoords="offset points", xytext=(6, -9), fontsize=8)
        shown = [(float(g["value_mm"]), float(g["shown_mm"]) / float(g["true_mm"]))
                 for g in kinds["groove"] if float(g["true_mm"]) > 0.01]
        grooves.plot(*zip(*shown), ".-", color=colour, label=f"{thickness:g} mm")
        presses.plot([float(p["value_mm"]) for p in kinds["press"]],
                     [float(p["error_mm"]) for p in kinds["press"] if p["error_mm"] != "nan"],
                     color=colour)
        measured = [p for p in kinds["press"] if p["ok"] == "1"]
        presses.plot([float(p["value_mm"]) for p in measured],
                     [float(p["error_mm"]) for p in measured], "o", ms=3, color=colour)
    trade.plot(*zip(*points), color="grey", lw=0.7, zorder=0)
    trade.margins(0.15)
    trade.set(xlabel="finest pitch resolved, mm", ylabel="greatest depth measured, mm",
              title="gel thickness, simulated sensor")
    grooves.axhline(0.5, color="grey", lw=0.7, ls=":")
    grooves.set(xlabel="pitch of the grooves, mm", ylabel="relief shown, share of the true one",
                title="relief of grooves", xlim=(0, 4.2), ylim=(0, 1.4))
    grooves.legend(fontsize=7)
    presses.set(xlabel="depth of a 5 mm ball, mm", ylabel="mean absolute error, mm",
                title="error of presses (points: measured)", ylim=(0, 0.15))
    figure.tight_layout()
    figure.savefig(arguments.svg, metadata={"Date": None})


if __name__ == "__main__":
    main()
