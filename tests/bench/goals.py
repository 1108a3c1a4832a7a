#!/usr/bin/env python3
"""Goals of the benchmarks: one line each, and a file a part, so that the parts can be summed up.

As a program: goals.py FOLDER PART...  sums the parts up: every goal when there are several, and "all
goals met" only when all are.
"""
import csv
import os
import sys


def path(folder, part):
    return os.path.join(folder, f"goals_{part}.csv")


def line(goal, measured, met, shortfall):
    return f"{'met  ' if met else 'SHORT'}  {goal}: {measured}{'' if met else ' - ' + shortfall}"


def report(folder, part, goals):
    """Prints (goal, measured, met, missing amount) and keeps them for the summary."""
    with open(path(folder, part), "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["goal", "measured", "met", "shortfall"])
        for goal, measured, met, shortfall in goals:
            writer.writerow([goal, measured, int(met), shortfall])
            print(line(goal, measured, met, shortfall))


def summary(folder, parts):
    goals = []
    for part in parts:
        try:
            with open(path(folder, part), newline="", encoding="utf-8") as file:
                goals += [(part, r["goal"], r["measured"], r["met"] == "1", r["shortfall"])
                          for r in csv.DictReader(file)]
        except FileNotFoundError:
            print(f"not measured: {part}")
            return
    if len(parts) > 1:
        print()
        for part, goal, measured, met, shortfall in goals:
            print(f"{part:7} {line(goal, measured, met, shortfall)}")
    short = sum(not met for _, _, _, met, _ in goals)
    print(("all goals met" if short == 0 else f"{short} of {len(goals)} goals are short") +
          ("" if len(parts) > 1 else f" (of the {parts[0]} only)"))


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    summary(sys.argv[1], sys.argv[2:])
