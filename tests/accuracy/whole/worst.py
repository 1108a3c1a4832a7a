"""Draws the ten worst scenes of whole_random_scenes: true depth, measured depth and their difference.

worst.py MAPS OUT.png. MAPS: the folder maps of its --work."""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

WORST = 10
COLOURS = 96  # keep the picture small
UNTRUSTED = -32768


def maps_of(file):
    ratio, name, width = file.stem.split(" ")
    values = np.fromfile(file, dtype="<i2").reshape(2, -1, int(width)).astype(float)
    values[values == UNTRUSTED] = np.nan
    return float(ratio), name, values[0] / 1000, values[1] / 1000


def draw(axes, true, measured, title):
    deepest = max(0.2, float(np.nanmax(true)))
    difference = measured - true
    most = max(0.05, float(np.nanquantile(np.abs(difference), 0.995)))
    axes[0].imshow(true, cmap="viridis", vmin=-0.2 * deepest, vmax=deepest)
    axes[1].imshow(measured, cmap="viridis", vmin=-0.2 * deepest, vmax=deepest)
    axes[2].imshow(difference, cmap="RdBu_r", vmin=-most, vmax=most)
    axes[0].set_title(title, fontsize=7, loc="left")
    axes[1].set_title(f"to {deepest:.2f} mm", fontsize=7)
    axes[2].set_title(f"± {most:.3f} mm", fontsize=7)
    for axis in axes:
        axis.set_axis_on()
        axis.set_facecolor("black")
        axis.set_xticks([])
        axis.set_yticks([])


def main():
    folder, out = sys.argv[1:]
    worst = sorted(pathlib.Path(folder).glob("*.i16"), reverse=True)[:WORST]
    figure, axes = plt.subplots(WORST // 2, 6, figsize=(7.6, 7.2))
    for axis in axes.flat:
        axis.set_axis_off()
    for index, file in enumerate(worst):
        ratio, name, true, measured = maps_of(file)
        column = 3 * (index % 2)
        row = axes[index // 2, column : column + 3]
        draw(row, true, measured, f"{name}: {ratio:.1f} × stated")
    figure.tight_layout(pad=0.3)
    figure.savefig(out, dpi=80)
    Image.open(out).quantize(COLOURS).save(out, optimize=True)


main()
