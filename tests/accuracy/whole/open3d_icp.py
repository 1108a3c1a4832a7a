#!/usr/bin/python3
"""open3d_icp.py FOLDER: Open3D's ICP on the sequences that pose_sequences wrote into a folder.

Point-to-plane and generalised ICP follow each object from the last frame before it moves, on one
thread and on the depth maps that the daemon sends. Of each the points are every second row and column
of what is deeper than 0.06 mm and of 0.25 mm around it. Writes SEQUENCE.TRACKER.track.csv beside each
SEQUENCE.frames, which pose_judge reads. The time is the registration's alone: points and normals are
made here before it begins.
"""

import argparse
import os
import pathlib
import struct
import sys
import time

os.environ["OMP_NUM_THREADS"] = "1"
import numpy as np  # noqa: E402  (the number of threads is read at import)
import open3d  # noqa: E402  (Debian's python3-open3d)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "clients/python/src"))
from dtact.messages import message_class  # noqa: E402

Frame = message_class("Frame")
registration = open3d.pipelines.registration

MIN_DEEP_MM = 0.06
AROUND_MM = 0.25
STRIDE = 2
SMOOTH_PX = 2  # normals are of the map averaged over 2 · SMOOTH_PX + 1 pixels, both ways
PAIRED_MM = 0.3  # points further apart are not paired
MIN_FITNESS = 0.4  # with a smaller share of paired points the frame is lost


def read_frames(file):
    data = file.read_bytes()
    frames = []
    at = 0
    while at < len(data):
        (size,) = struct.unpack_from(">I", data, at)
        frames.append(Frame.FromString(data[at + 4:at + 4 + size]))
        at += 4 + size
    return frames


def box_mean(values, radius):
    """The mean over a square, smaller at the borders."""
    def along(array, axis):
        sums = np.cumsum(np.insert(array, 0, 0, axis), axis)
        size = array.shape[axis]
        ends = np.minimum(np.arange(size) + radius + 1, size)
        begins = np.maximum(np.arange(size) - radius, 0)
        shape = [1, 1]
        shape[axis] = size
        return (np.take(sums, ends, axis) - np.take(sums, begins, axis)) / (ends - begins).reshape(shape)
    return along(along(values, 0), 1)


def near(mask, radius):
    """Pixels within `radius` of the mask."""
    return box_mean(mask.astype(float), radius) > 1e-9


def places(map_, surface, depth):
    """The points of a map, (H, W, 3) mm in the surface frame."""
    columns = np.arange(map_.x, map_.x + map_.width) - 0.5 * (map_.full_width - 1)
    rows = np.arange(map_.y, map_.y + map_.height) - 0.5 * (map_.full_height - 1)
    x, y = np.meshgrid(columns * map_.mm_per_px, rows * map_.mm_per_px)
    flat = np.stack([x, y, np.zeros_like(x)], -1)
    if surface.shape == surface.PLANE:
        return flat - depth[..., None] * np.array([0, 0, 1.0])
    assert surface.refraction == 1 and surface.shape in (surface.SPHERE, surface.CYLINDER)
    # The ray from the pinhole through the plane z = 0, up to where it leaves the gel.
    pinhole = np.array([0, 0, -(surface.air_mm + surface.gel_mm)])
    centre = np.array([0, 0, -surface.radius_mm])
    ray = flat - pinhole
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    across = np.ones(3)
    if surface.shape == surface.CYLINDER:
        angle = np.radians(surface.axis_deg)
        axis = np.array([np.cos(angle), np.sin(angle), 0])
        project = np.eye(3) - np.outer(axis, axis)
    else:
        project = np.diag(across)
    a = ray @ project
    b = (pinhole - centre) @ project
    aa, ab, bb = (a * a).sum(-1), a @ b, b @ b - surface.radius_mm ** 2
    along = (-ab + np.sqrt(ab * ab - aa * bb)) / aa
    undeformed = pinhole + along[..., None] * ray
    normal = (undeformed - centre) @ project
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return undeformed - depth[..., None] * normal


def cloud_of(frame):
    map_ = frame.depth
    values = np.frombuffer(map_.data, "<i2").reshape(map_.height, map_.width)
    trusted = values != map_.untrusted_value
    depth = np.where(trusted, values * map_.um_per_unit * 1e-3, 0)
    chosen = near(trusted & (depth > MIN_DEEP_MM), round(AROUND_MM / map_.mm_per_px)) & trusted
    kept = np.zeros_like(chosen)
    kept[::STRIDE, ::STRIDE] = chosen[::STRIDE, ::STRIDE]
    points = places(map_, frame.surface, depth)
    smooth = places(map_, frame.surface, box_mean(depth, SMOOTH_PX))
    normals = np.cross(np.gradient(smooth, axis=1), np.gradient(smooth, axis=0))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(points[kept])
    cloud.normals = open3d.utility.Vector3dVector(normals[kept])
    return cloud


class Icp:
    """Follows clouds against a keyframe, which is replaced when too little of it is visible."""

    def __init__(self, kind, first, rekey, velocity, tukey_mm):
        self.kind = kind
        self.key = first
        self.key_motion = np.eye(4)  # from the first frame to the keyframe
        self.motion = np.eye(4)  # from the first frame to the one before
        self.step = np.eye(4)  # of the previous frame
        self.rekey = rekey
        self.velocity = velocity
        self.tukey_mm = tukey_mm
        self.best = None  # the keyframe's own fitness

    def register(self, cloud, start):
        if self.kind == "plane":
            kernel = [registration.TukeyLoss(self.tukey_mm)] if self.tukey_mm else []
            return registration.registration_icp(
                self.key, cloud, PAIRED_MM, start, registration.TransformationEstimationPointToPlane(*kernel))
        return registration.registration_generalized_icp(
            self.key, cloud, PAIRED_MM, start, registration.TransformationEstimationForGeneralizedICP())

    def follow(self, cloud):
        """Returns whether the cloud was found; `motion` is the newest one found."""
        guess = self.step @ self.motion if self.velocity else self.motion
        result = self.register(cloud, guess @ np.linalg.inv(self.key_motion))
        if result.fitness < MIN_FITNESS:
            self.step = np.eye(4)
            return False
        found = result.transformation @ self.key_motion
        self.step = found @ np.linalg.inv(self.motion)
        self.motion = found
        if result.fitness < self.rekey:
            self.key, self.key_motion = cloud, found
        return True


TRACKERS = {
    "open3d_plane": {"kind": "plane", "rekey": 0.8, "velocity": True, "tukey_mm": 0.1},
    "open3d_generalised": {"kind": "generalised", "rekey": 0.8, "velocity": True, "tukey_mm": 0},
}


def track(frames, begin, every, options):
    """Rows of every `every`-th frame, including the last."""
    since = frames[begin].sequence
    rows = []
    icp = Icp(first=cloud_of(frames[begin]), **options)
    for frame in [*frames[begin:-1:every], frames[-1]]:
        found, spent = False, 0.0
        if frame.HasField("depth"):
            cloud = cloud_of(frame)
            began = time.thread_time()
            found = len(cloud.points) > 10 and icp.follow(cloud)
            spent = time.thread_time() - began
        rows.append((frame.sequence, int(found), since, icp.motion, 1e6 * spent))
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", action="append", default=[], help="sequences whose name holds this")
    parser.add_argument("--every", type=int, default=1, help="judge one of this many frames")
    parser.add_argument("--set", action="append", default=[], metavar="TRACKER:KEY=VALUE",
                        help="try another setting; KEY is rekey, velocity or tukey_mm")
    parser.add_argument("--trackers", default=",".join(TRACKERS))
    arguments = parser.parse_args()
    trackers = {name: dict(TRACKERS[name]) for name in arguments.trackers.split(",")}
    for setting in arguments.set:
        tracker, rest = setting.split(":")
        key, value = rest.split("=")
        trackers[tracker][key] = float(value)
    for file in sorted(arguments.folder.glob("*.frames")):
        name = file.name.removesuffix(".frames")
        truth = file.with_name(name + ".truth.csv")
        if arguments.only and not any(part in name for part in arguments.only) or not truth.exists():
            continue
        phases = [line.rsplit(",", 1)[1] for line in truth.read_text(encoding="utf-8").splitlines()[1:]]
        begin = len(phases) - 1 - phases[::-1].index("press")
        frames = read_frames(file)
        for tracker, options in trackers.items():
            out_file = file.with_name(f"{name}.{tracker}.track.csv")
            if out_file.exists() and out_file.stat().st_mtime > file.stat().st_mtime and not arguments.set:
                continue
            rows = track(frames, begin, arguments.every, options)
            lines = ["sequence,usable,since," + ",".join(f"r{i}{k}" for i in "123" for k in "123")
                     + ",x_mm,y_mm,z_mm,frame_us"]
            for sequence, usable, since, motion, spent in rows:
                numbers = [*motion[:3, :3].ravel(), *motion[:3, 3]]
                lines.append(f"{sequence},{usable},{since}," + ",".join(f"{n:.10g}" for n in numbers)
                             + f",{spent:.0f}")
            part = out_file.with_suffix(".part")
            part.write_text("\n".join(lines) + "\n", encoding="utf-8")
            part.replace(out_file)
        print(name, flush=True)


if __name__ == "__main__":
    main()
