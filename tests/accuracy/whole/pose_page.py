#!/usr/bin/python3
"""pose_page.py RESULTS OUT: the tables of pose_tables.md from pose_judge's output.

RESULTS holds one_press.csv, six_presses.csv, lens.csv, and as far as they were made sphere.csv,
cylinder.csv, minute.csv, drag.csv and known.csv.
"""

import argparse
import csv
import pathlib

import numpy as np

NAMES = {"dtact-perceive": "dtact-perceive", "open3d_plane": "Open3D, point-to-plane",
         "open3d_generalised": "Open3D, generalised", "cloud": "by a cloud", "mesh": "by a mesh"}
CALIBRATIONS = {"one_press": "one press", "six_presses": "six presses", "lens": "one press through a lens"}
MOTIONS = ["turn", "slide", "roll", "deeper", "all"]


def read(folder, name):
    file = folder / f"{name}.csv"
    if not file.exists():
        return []
    with open(file, encoding="utf-8") as lines:
        return [{key: value if key in ("sequence", "tracker") else float(value) for key, value in row.items()}
                for row in csv.DictReader(lines)]


def error(rows, when, way, part):
    """As "0.012 mm, 0.05°"; a share `part` of the sequences is at most that."""
    if not rows:
        return "–"
    def at(unit):
        values = sorted(row[f"{when}_{way}_{unit}"] for row in rows)
        return values[round(part * (len(values) - 1))]
    mm, deg = at("mm"), at("deg")
    return "none" if not np.isfinite(mm) else f"{mm:.3f} mm, {deg:.2f}°"


def trackers_of(rows):
    return [name for name in NAMES if any(row["tracker"] == name for row in rows)]


def own(rows, tracker):
    return [row for row in rows if row["tracker"] == tracker]


def summary(rows, first):
    """A line for each tracker."""
    lines = []
    for tracker in trackers_of(rows):
        mine = own(rows, tracker)
        frames = sum(row["frames"] for row in mine)
        lines.append(
            f"| {first} | {NAMES[tracker]} | {sum(row['followed_reported'] for row in mine):.0f} of {len(mine)} "
            f"| {100 * sum(row['lost'] for row in mine) / frames:.1f} % | {error(mine, 'end', 'reported', 0.5)} "
            f"| {error(mine, 'end', 'reported', 0.95)} | {error(mine, 'end', 'shape', 0.5)} "
            f"| {error(mine, 'end', 'shape', 0.95)} "
            f"| {np.median([row['frame_us'] for row in mine]) / 1e3:.2f} ms |")
    return lines


HEAD = ["| {} | | followed | frames lost | end, reported: median | 95 % | end, shape: median | 95 % | a frame |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]


def head(first):
    return [HEAD[0].format(first), HEAD[1]]


def by(rows, key, keys):
    """Followed and median error at the end, a line for each key and a column for each tracker."""
    trackers = trackers_of(rows)
    lines = ["| | " + " | ".join(NAMES[tracker] for tracker in trackers) + " |",
             "| --- |" + " --- |" * len(trackers)]
    for one in keys:
        cells = []
        for tracker in trackers:
            mine = [row for row in own(rows, tracker) if key(row) == one]
            cells.append(f"{sum(row['followed_shape'] for row in mine):.0f} of {len(mine)}, "
                         + error(mine, "end", "shape", 0.5))
        lines.append(f"| {one} | " + " | ".join(cells) + " |")
    return lines


def worst(rows, count):
    """Sequences that dtact-perceive did not follow, or that ended with the largest error."""
    mine = sorted(own(rows, "dtact-perceive"),
                  key=lambda row: (row["followed_reported"], -row["lost"] / row["frames"],
                                   -row["end_reported_mm"] - row["end_reported_deg"] / 20))
    lines = ["| sequence | calibration | lost | worst | at the end | reported directions |",
             "| --- | --- | --- | --- | --- | --- |"]
    for row in mine[:count]:
        lines.append(f"| {row['sequence']} | {row['calibration']} | {row['lost']:.0f} of {row['frames']:.0f} "
                     f"| {error([row], 'worst', 'reported', 0)} | {error([row], 'end', 'reported', 0)} "
                     f"| {row['reported']:.0f} |")
    return lines


def known(rows):
    lines = ["| | usable frames | placed: median | 95 % of the sequences | at the end | a frame |",
             "| --- | --- | --- | --- | --- | --- |"]
    for tracker in trackers_of(rows):
        mine = own(rows, tracker)
        placed = [row for row in mine if np.isfinite(row["median_reported_mm"])]
        frames = sum(row["frames"] for row in mine)
        lines.append(f"| {NAMES[tracker]}, {len(mine)} sequences, {len(placed)} found "
                     f"| {100 * (1 - sum(row['lost'] for row in mine) / frames):.0f} % "
                     f"| {error(placed, 'median', 'reported', 0.5)} | {error(placed, 'median', 'reported', 0.95)} "
                     f"| {error(placed, 'end', 'reported', 0.5)} "
                     f"| {np.median([row['frame_us'] for row in mine]) / 1e3:.2f} ms |")
    return lines


def page(folder):
    all_rows = []
    lines = head("calibration")
    for name, words in CALIBRATIONS.items():
        rows = read(folder, name)
        for row in rows:
            row["calibration"] = words
        all_rows += rows
        lines += summary(rows, words)
    lines += summary(all_rows, "all")
    lines += ["", "By motion, all calibrations, without the directions that the shape does not determine:", "",
              *by(all_rows, lambda row: row["sequence"].split(".")[1], MOTIONS)]
    objects = sorted({row["sequence"].split(".")[0] for row in all_rows})
    lines += ["", "By object:", "", *by(all_rows, lambda row: row["sequence"].split(".")[0], objects)]
    lines += ["", "dtact-perceive's ten worst:", "", *worst(all_rows, 10)]
    others = {"sphere": "on a sphere", "cylinder": "on a cylinder", "minute": "a minute", "drag": "sticks and slips"}
    lines += ["", *head("")]
    for name, words in others.items():
        lines += summary(read(folder, name), words)
    lines += ["", "Known objects, one press:", "", *known(read(folder, "known"))]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    arguments = parser.parse_args()
    arguments.out.write_text(page(arguments.results), encoding="utf-8")
    print(page(arguments.results))


if __name__ == "__main__":
    main()
