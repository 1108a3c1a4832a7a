"""Draws the contact of one sensor live: depth, the contact's outline, slope, and points. It needs
matplotlib (apt-get install python3-matplotlib).

    python3 draw_contact.py [HOST] [--frames N]
"""
import argparse

import dtact
import matplotlib.pyplot as plt
import numpy as np


def draw(f, axes):
    """One frame: what 9DTact shows as height map, gradients and point cloud."""
    depth, slope, space = axes
    for one in axes:
        one.clear()
    depth.set_title(f"{f.contact.deepest_mm:.2f} mm deep on {f.contact.area_mm2:.1f} mm²")
    depth.imshow(f.depth_mm, vmin=0, vmax=1, cmap="magma")
    if f.contact_mask.any():
        depth.contour(f.contact_mask, levels=[0.5], colors="cyan")
    steepness = np.linalg.norm(f.gradients, axis=2)
    slope.set_title("slope, mm per mm")
    slope.imshow(steepness, vmin=0, vmax=1, cmap="viridis")
    cloud = f.points()
    mm = 1e3 * cloud.points[f.contact_mask & cloud.valid][::7]
    space.set_title("points of the contact, mm")
    space.scatter(mm[:, 0], mm[:, 1], mm[:, 2], s=1)


def main():
    options = argparse.ArgumentParser(description="Draws the contact of one sensor live.")
    options.add_argument("host", nargs="?", default="localhost", help="the daemon's machine")
    options.add_argument("--frames", type=int, default=0, help="end after this number; 0: never")
    options = options.parse_args()
    figure = plt.figure(figsize=(13, 4))
    axes = [figure.add_subplot(1, 3, 1), figure.add_subplot(1, 3, 2),
            figure.add_subplot(1, 3, 3, projection="3d")]
    drawn = 0
    with dtact.connect(options.host) as s:
        for f in s.frames():
            if not (f.has_depth and f.contact and f.contact.in_contact):
                continue
            draw(f, axes)
            plt.pause(0.01)
            drawn += 1
            if drawn == options.frames:
                print(f"drew {drawn} frames, the last {f.contact.deepest_mm:.2f} mm deep")
                return


if __name__ == "__main__":
    main()
