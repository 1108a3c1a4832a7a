#!/usr/bin/python3
"""comparison.py SEQUENCES OUT: judges those who follow objects on the simulated layer.

SEQUENCES is what pose_sequences wrote. Open3D's ICP, point-to-plane and generalised, follows the same
frames on one core: the first frame's points against each frame's, begun where the frame before ended.
Errors are of the contact's centre and of the rotation, those of the one screw that leads from the truth to
what was found, without the directions that the shape does not show, which are the same for all. Writes
pose.csv, pose.md and pose.svg into OUT.
"""

import argparse
import collections
import csv
import os
import pathlib
import time

os.environ["OMP_NUM_THREADS"] = "1"
import matplotlib  # noqa: E402  (the number of threads is read at import)
import numpy as np  # noqa: E402

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "dtact"  # the same picture from the same numbers
import matplotlib.pyplot as plt  # noqa: E402

FILES = {"dtact-perceive": "tracker", "NormalFlow": "normal_flow"}
ICPS = {"ICP, point-to-plane": "plane", "ICP, generalised": "generalised"}
WAYS = ["slide", "twist", "roll", "deeper"]
PAIRED_MM = 0.3  # points further apart are no pair
LEAST_PAIRED = 0.4  # with fewer of the reference's points in a pair the track is lost
GOOD = 100, 2  # micrometres, degrees: a sequence succeeds that is never lost nor further off


def icp(folder, kind):
    """As rows of 12 numbers of the motion (metres), lost, microseconds."""
    import open3d  # Debian's python3-open3d

    registration = open3d.pipelines.registration
    estimate = (registration.TransformationEstimationPointToPlane() if kind == "plane"
                else registration.TransformationEstimationForGeneralizedICP())
    align = registration.registration_icp if kind == "plane" else registration.registration_generalized_icp
    clouds = []
    for file in sorted(folder.glob("points_*.npy")):
        rows = np.load(file).astype(float)
        cloud = open3d.geometry.PointCloud()
        cloud.points = open3d.utility.Vector3dVector(1e3 * rows[:, :3])  # its equations want no tiny numbers
        cloud.normals = open3d.utility.Vector3dVector(rows[:, 3:])
        clouds.append(cloud)
    motion = np.eye(4)
    rows = []
    for cloud in clouds:
        began = time.thread_time()
        result = align(clouds[0], cloud, PAIRED_MM, motion, estimate)
        spent = time.thread_time() - began
        lost = result.fitness < LEAST_PAIRED
        if not lost:
            motion = result.transformation
        rows.append([*motion[:3, :3].ravel(), *(motion[:3, 3] * 1e-3), lost, 1e6 * spent])
    return np.array(rows)


def rotation_vector(matrix):
    angle = np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))
    axis = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return axis * (0.5 if angle < 1e-6 else angle / (2 * np.sin(angle)))


def screw(rotation, shift):
    """The rotation vector, and the shift of the origin along it: the logarithm of the motion."""
    turn = rotation_vector(rotation)
    angle = np.linalg.norm(turn)
    if angle < 1e-6:
        return turn, shift
    # The inverse of the left Jacobian of SO(3): Barfoot, State Estimation for Robotics, 7.1.3.
    axis, half = turn / angle, angle / 2
    cotangent = half / np.tan(half)
    along = cotangent * shift + (1 - cotangent) * axis * axis.dot(shift) - half * np.cross(axis, shift)
    return turn, along


def error(found, true, seen):
    """Micrometres of the contact's centre and degrees, in what is seen."""
    turned, moved = found[:9].reshape(3, 3), found[9:12]
    centre, arm, hidden = seen[:3], seen[3], seen[4:].reshape(6, 6)
    off = turned @ true[:9].reshape(3, 3).T
    turn, shift = screw(off, off @ (centre - true[9:12]) + moved - centre)
    twist = np.concatenate([arm * turn, shift])
    for one in hidden[np.isfinite(hidden[:, 0])]:
        twist -= one * one.dot(twist)
    return np.linalg.norm(twist[3:]) * 1e6, np.degrees(np.linalg.norm(twist[:3]) / arm)


def judge(folder, method):
    truth = np.load(folder / "truth.npy")
    rows = icp(folder, ICPS[method]) if method in ICPS else np.load(folder / f"{FILES[method]}.npy")
    errors = np.array([error(row, true[:12], true[12:]) for row, true in zip(rows, truth)])
    lost = rows[:, 12] > 0
    known = errors[~lost]
    return {
        "surface": folder.parent.parent.name, "object": folder.parent.name, "way": folder.name,
        "method": method, "frames": len(rows),
        "lost": int(lost.sum()),
        "success": int(not lost.any() and (known.max(axis=0) <= GOOD).all()),
        "median_um": np.median(known[:, 0]), "median_deg": np.median(known[:, 1]),
        "worst_um": known[:, 0].max(), "worst_deg": known[:, 1].max(),
        "end_um": errors[-1, 0], "end_deg": errors[-1, 1],
        "frame_us": np.median(rows[:, 13]),
    }


def summary(rows, methods):
    """A line for each method."""
    lines = ["| | median error | 95th percentile of the worst | succeeded | a frame, one core |",
             "| --- | --- | --- | --- | --- |"]
    for method in methods:
        own = [row for row in rows if row["method"] == method]
        column = lambda name: np.array([row[name] for row in own])  # noqa: E731
        lines.append(
            f"| {method} | {np.median(column('median_um')):.1f} µm, {np.median(column('median_deg')):.2f}° "
            f"| {np.percentile(column('worst_um'), 95):.0f} µm, {np.percentile(column('worst_deg'), 95):.2f}° "
            f"| {sum(column('success'))} of {len(own)} | {np.median(column('frame_us')) / 1e3:.2f} ms |")
    lines += ["", "Who did not succeed:", ""]
    for method in methods:
        failed = [f"{row['object']} ({row['way']}"
                  + (f", {row['lost']} of {row['frames']} frames lost)" if row["lost"]
                     else f", {row['worst_um']:.0f} µm, {row['worst_deg']:.1f}°)")
                  for row in rows if row["method"] == method and not row["success"]]
        lines.append(f"- {method}: {', '.join(failed) or 'none'}.")
    return lines


def page(rows):
    methods = [*FILES, *ICPS]
    moves = [row for row in rows if row["way"] != "minute" and row["surface"] == "plane"]
    lines = [f"{len(moves) // len(methods)} sequences of two seconds on a plane, 30 frames a second:", "",
             *summary(moves, methods)]
    lines += ["", "By way, median error of the contact's centre and of the rotation:", "",
              "| | " + " | ".join(WAYS) + " |", "| --- |" + " --- |" * len(WAYS)]
    for method in methods:
        cells = []
        for way in WAYS:
            own = [row for row in moves if row["method"] == method and row["way"] == way]
            cells.append(f"{np.median([r['median_um'] for r in own]):.1f} µm, "
                         f"{np.median([r['median_deg'] for r in own]):.2f}°")
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    lines += ["", "After a minute of sliding and twisting to and fro, 15 frames a second:", "",
              "| | " + " | ".join(methods) + " |", "| --- |" + " --- |" * len(methods)]
    minutes = collections.defaultdict(dict)
    for row in rows:
        if row["way"] == "minute":
            minutes[row["object"]][row["method"]] = row
    for thing, by in minutes.items():
        lines.append(f"| {thing} | " + " | ".join(
            f"{by[m]['end_um']:.1f} µm, {by[m]['end_deg']:.2f}° (worst {by[m]['worst_um']:.0f} µm, "
            f"{by[m]['worst_deg']:.2f}°; lost {by[m]['lost']})" for m in methods) + " |")
    for surface in ("sphere", "cylinder"):
        own = [row for row in rows if row["surface"] == surface]
        with_it = [method for method in methods if any(row["method"] == method for row in own)]
        lines += ["", f"{len(own) // len(with_it)} sequences on a {surface} of 30 mm of radius:", "",
                  *summary(own, with_it)]
    return "\n".join(lines) + "\n"


def plot(rows, file):
    figure, axes = plt.subplots(1, 2, figsize=(11, 4), sharey=True)
    for method, colour in zip([*FILES, *ICPS], plt.get_cmap("viridis")(np.linspace(0, 0.9, 4))):
        own = [row for row in rows if row["method"] == method]
        for axis, name in zip(axes, ("median_um", "median_deg")):
            axis.plot([row[name] for row in own], [row["frame_us"] / 1e3 for row in own], "o", ms=3,
                      alpha=0.6, color=colour, label=method)
            axis.plot(np.median([row[name] for row in own]), np.median([row["frame_us"] for row in own]) / 1e3,
                      "D", ms=9, mec="black", color=colour)
    for axis, label in zip(axes, ("error of the contact's centre, µm", "error of the rotation, degrees")):
        axis.set(xscale="log", yscale="log", xlabel=f"{label} (median of a sequence)")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("a frame on one core, ms")
    axes[0].legend(fontsize=8)
    figure.suptitle("Following what touches, simulated layer (diamonds: medians)")
    figure.tight_layout()
    figure.savefig(file, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    arguments = parser.parse_args()
    folders = sorted(file.parent for file in arguments.sequences.glob("*/*/*/truth.npy"))
    rows = [judge(folder, method) for folder in folders for method in [*FILES, *ICPS]
            if method in ICPS or (folder / f"{FILES[method]}.npy").exists()]
    with open(arguments.out / "pose.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows({key: f"{value:.4g}" if isinstance(value, float) else value
                          for key, value in row.items()} for row in rows)
    (arguments.out / "pose.md").write_text(page(rows), encoding="utf-8")
    plot([row for row in rows if row["surface"] == "plane"], arguments.out / "pose.svg")
    print(page(rows))


if __name__ == "__main__":
    main()
