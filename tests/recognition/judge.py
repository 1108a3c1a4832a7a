#!/usr/bin/python3
"""Judges the recognition on simulated presses: judge.py NAMED UNKNOWN [--picture confusion.png].

Both are folders of recognition_presses with the outputs that recognition_outputs wrote beside them:
presses of the twelve classes, and of shapes that training had no family of. Presses shallower than
0.3 mm or mostly outside the map do not count: dtact-perceive names none there.
"""
import argparse
import csv
import pathlib
import re

import numpy as np

CLASSES = 12
SOURCE = pathlib.Path(__file__).parents[2] / "clients/perceive/recognition/recogniser.hpp"
NAMES = re.findall(r'"(.+?)"', SOURCE.read_text().split("kClassNames = {")[1].split("}")[0])


def load(folder):
    folder = pathlib.Path(folder)
    with open(folder / "truth.csv") as file:
        rows = list(csv.DictReader(file))
    truth = {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}
    outputs = np.fromfile(folder / "outputs.f32", "<f4").reshape(len(rows), -1)[:, :CLASSES + 1].astype(float)
    counts = (truth["deepest_mm"] >= 0.3) & (truth["cut"] <= 1)
    return {key: values[counts] for key, values in truth.items()}, outputs[counts]


def joined(truth, outputs, presses):
    """Probabilities of as many presses of one object on one sensor, and their kinds."""
    groups = {}
    for i, key in enumerate(zip(truth["sensor"], truth["kind"], truth["variant"])):
        groups.setdefault(key, []).append(i)
    found, kinds = [], []
    for (_, kind, _), members in groups.items():
        for begin in range(0, len(members) - presses + 1, presses):
            sums = np.log(np.maximum(outputs[members[begin:begin + presses]], 1e-6)).sum(0)
            found.append(np.exp(sums - sums.max()) / np.exp(sums - sums.max()).sum())
            kinds.append(int(kind))
    return np.array(found), np.array(kinds)


def auroc(known, unknown):
    order = np.argsort(np.concatenate([known, unknown]))
    ranks = np.empty(len(order))
    ranks[order] = np.arange(1, len(order) + 1)
    return (ranks[:len(known)].sum() - len(known) * (len(known) + 1) / 2) / (len(known) * len(unknown))


def calibration_error(outputs, kinds):
    best, right = outputs[:, :CLASSES].max(1), outputs[:, :CLASSES].argmax(1) == kinds
    bins = np.minimum((best * 10).astype(int), 9)
    return sum(abs(best[bins == b].mean() - right[bins == b].mean()) * (bins == b).mean()
               for b in range(10) if (bins == b).any())


def draw(table, file):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, axes = pyplot.subplots(figsize=(8, 7.2))
    axes.imshow(table, cmap="Blues", vmin=0, vmax=100)
    for (row, column), value in np.ndenumerate(table):
        if value >= 0.5:
            axes.text(column, row, f"{value:.0f}", ha="center", va="center", color="white" if value > 50 else "black")
    axes.set_xticks(range(CLASSES + 1), [*NAMES, "unknown"], rotation=45, ha="right")
    axes.set_yticks(range(table.shape[0]), [*NAMES, "other shapes"])
    axes.set_xlabel("most probable"), axes.set_ylabel("pressed")
    axes.set_title("Simulated presses, % of each row")
    figure.tight_layout()
    figure.savefig(file, dpi=80)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("named")
    parser.add_argument("unknown")
    parser.add_argument("--picture")
    arguments = parser.parse_args()
    truth, outputs = load(arguments.named)
    other_truth, other_outputs = load(arguments.unknown)
    kinds = truth["kind"].astype(int)
    for presses in (1, 3):
        found, pressed = joined(truth, outputs, presses)
        others, _ = joined(other_truth, other_outputs, presses)
        right = found[:, :CLASSES].argmax(1) == pressed
        limit = np.quantile(others[:, CLASSES], 0.05)  # 5 % of the unknown pass as known
        kept = found[:, CLASSES] <= limit
        print(f"{presses} press(es): {right.mean():.3f} of {len(right)} named rightly; unknown: AUROC "
              f"{auroc(-found[:, CLASSES], -others[:, CLASSES]):.3f}, {kept.mean():.2f} of the known kept when 5 % "
              f"of {len(others)} unknown pass, probability {limit:.2f}")
        print("  kept of each: " + ", ".join(f"{NAMES[k]} {kept[pressed == k].mean():.2f}"
                                              for k in range(CLASSES) if (pressed == k).any()))
    right = outputs[:, :CLASSES].argmax(1) == kinds
    for low, high in ((0, 1.5), (1.5, 2.5), (2.5, 9)):
        of = (truth["thickness_mm"] >= low) & (truth["thickness_mm"] < high)
        if of.any():
            print(f"gel of {low} to {high} mm: {right[of].mean():.3f} of {of.sum()}")
    print(f"calibration error of the probabilities {calibration_error(outputs, kinds):.3f}")
    table = np.zeros((CLASSES + 1, CLASSES + 1))
    for row, (answers, pressed) in enumerate([(outputs[kinds == k], k) for k in range(CLASSES)]
                                             + [(other_outputs, CLASSES)]):
        for best in answers.argmax(1):
            table[row, best] += 100 / len(answers)
    print("named rightly, %: " + ", ".join(f"{NAMES[k]} {table[k, k]:.0f}" for k in range(CLASSES)))
    if arguments.picture:
        draw(table, arguments.picture)


if __name__ == "__main__":
    main()
