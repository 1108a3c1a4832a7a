#!/usr/bin/python3
"""Judges the recognition through the whole program: whole.py SEED PRESSES [--plain FOLDER].

Objects of the simulated sensor are pressed in one after the other, each drawn at random with its size, place,
turn and depth, and what a Python client receives of dtact-perceive is counted: 2.6 s a press. --plain: beside
it, on the daemon's depth maps of the same presses, a small classifier on descriptors, trained on a folder of
recognition_presses.
"""
import argparse
import collections
import csv
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np
import torch
from torch import nn

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients/python/src"))
import dtact  # noqa: E402
from judge import NAMES  # noqa: E402

# Object of the scene → the class that is right; None: none of the twelve. A disc is a cylinder's end.
OBJECTS = {"ball": "ball", "cylinder": "cylinder", "disc": "cylinder", "m4_nut": "nut", "m3_long_nut": "nut",
           "m5_hexagon_screw": "bolt", "usb_c_plug": "USB-C plug", "key": "key", "star": None, "cube": None,
           "ball_array": None, "screw_cap": None, "grating": None, "pin_board": None, "two_pillars": None,
           "three_set_screws": None}
SIZES = {"ball": {"radius_mm": (2, 6)}, "cylinder": {"radius_mm": (1.5, 5), "length_mm": (8, 20)},
         "disc": {"radius_mm": (2, 6)}, "cube": {"side_mm": (4, 9)}, "star": {"radius_mm": (3, 6)},
         "ball_array": {"radius_mm": (1, 2), "pitch_mm": (3, 5)},
         "grating": {"pitch_mm": (1, 3), "groove_mm": (0.4, 1), "side_mm": (6, 14)},
         "two_pillars": {"radius_mm": (1, 2), "spacing_mm": (4, 7)}}
BEGIN_S, EACH_S = 2, 2.6


def draw_scene(draw, presses):
    """The scene, and the objects in their order. The first press, a ball, begins the count of time."""
    pressed = [draw.choice(list(OBJECTS)) for _ in range(presses)]
    scene = ""
    for i, name in enumerate(["ball", *pressed]):
        sizes = {key: round(draw.uniform(*limits), 2) for key, limits in SIZES.get(name, {}).items()}
        if name == "ball_array":
            sizes |= {"rows": draw.randint(2, 3), "columns": draw.randint(2, 4)}
        x, y, depth = (round(draw.uniform(*limits), 2) for limits in ((-4, 4), (-4, 4), (0.5, 1.2)))
        t = BEGIN_S + EACH_S * i
        scene += f'[[press]]\nobject = "{name}"\n' + "".join(f"{key} = {value}\n" for key, value in sizes.items())
        scene += (f"keys = [{{ t = {t:.2f}, x = {x}, y = {y}, rotation = {draw.randrange(360)}, depth = -0.3 }}, "
                  f"{{ t = {t + 0.3:.2f}, depth = {depth} }}, {{ t = {t + 1.7:.2f} }}, "
                  f"{{ t = {t + 2:.2f}, depth = -0.3 }}]\n")
    return scene, pressed


def start(command, log):
    """The process, and the port that it names."""
    with open(log, "w", encoding="utf-8") as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)
    for _ in range(1800):
        if found := re.search(r"listening on 127\.0\.0\.1:(\d+)", log.read_text()):
            return process, found[1]
        if process.poll() is not None:
            break
        time.sleep(0.1)
    process.kill()
    raise SystemExit(f"{command[0]} did not start:\n{log.read_text()}")


def follow(perceive, daemon, presses):
    """What was received of each press: the last recognition, and the deepest depth map with its scale."""
    answers, maps, deepest, began, now = [None] * presses, [None] * presses, [0] * presses, None, None
    with dtact.connect(f"127.0.0.1:{perceive}") as s, dtact.connect(f"127.0.0.1:{daemon}") as depths:
        s.subscribe(dtact.Subscription(depth=None, recognition=True, recognition_hz=10, summary=True))
        depths.subscribe(dtact.Subscription(depth_hz=5, decimation=4))
        until = time.monotonic() + BEGIN_S + EACH_S * (presses + 4)
        for f in s.frames():
            at = 1e-9 * f.message.monotonic_ns
            in_contact = bool(f.contact and f.contact.in_contact)
            if in_contact and now is None:
                began = began or at
                now = round((at - began) / EACH_S) - 1  # The first press does not count.
            elif not in_contact:
                now = None
            if now is not None and 0 <= now < presses:
                answers[now] = f.recognition or answers[now]
                other = depths.next(0)
                if isinstance(other, dtact.Frame) and other.has_depth and other.contact.deepest_mm > deepest[now]:
                    deepest[now] = other.contact.deepest_mm
                    maps[now] = np.nan_to_num(other.depth_mm), other.mm_per_px
            if time.monotonic() > until or (began and at > began + EACH_S * (presses + 0.9)):
                return answers, maps


def run(scene, presses, programs):
    """What follow() returns, of the daemon on this scene and dtact-perceive beside it."""
    with tempfile.TemporaryDirectory(prefix="dtact_whole_") as folder:
        folder = pathlib.Path(folder)
        (folder / "scene.toml").write_text(scene, encoding="utf-8")
        settings = {"net.port": 0, "camera.sim.calibration": ROOT / "config/simulated", "state_dir": folder / "state",
                    "camera.sim.scene": folder / "scene.toml"}
        daemon, port = start([programs / "dtactd", "--config", ROOT / "config/dtactd.toml",
                              *(word for key, value in settings.items() for word in ("--set", f"{key}={value}"))],
                             folder / "dtactd.log")
        try:
            perceive, its_port = start([programs / "dtact-perceive", "--port", port, "serve", "--listen-port", "0"],
                                       folder / "perceive.log")
            try:
                return follow(its_port, port, presses)
            finally:
                perceive.terminate()
                perceive.wait()
        finally:
            daemon.terminate()
            daemon.wait()


def touch_map(depth, mm_per_px):
    """96 × 96 cells of 0.25 mm around the contact, as recognition_presses writes them."""
    weights = np.where(depth > 0.1, depth, 0)
    if not weights.any():
        return np.zeros((96, 96), np.float32)
    rows, columns = np.indices(depth.shape)
    y, x = (weights * rows).sum() / weights.sum(), (weights * columns).sum() / weights.sum()
    cells = 0.25 / mm_per_px
    return cv2.warpAffine(depth, np.float32([[cells, 0, x - 47.5 * cells], [0, cells, y - 47.5 * cells]]), (96, 96),
                          flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)


RING = (np.hypot(*(np.indices((96, 96)) - 47.5)) / 3).astype(int)  # of 0.75 mm


def descriptors(depth):
    """None of them changes when the object is turned."""
    depth = np.clip(depth, -1, 3)
    most, mask = max(depth.max(), 1e-3), (depth > 0.1).astype(np.uint8)
    upper = (depth > most / 2).astype(np.uint8)
    shape = cv2.moments(np.where(mask, depth, 0).astype(np.float32))
    spread = np.sqrt(np.linalg.eigvalsh([[shape["nu20"], shape["nu11"]], [shape["nu11"], shape["nu02"]]]).clip(0))
    hu = np.concatenate([cv2.HuMoments(m).ravel() for m in (shape, cv2.moments(upper, True))])
    outline = [sum(cv2.arcLength(c, True) for c in cv2.findContours(m, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)[0])
               for m in (mask, upper)]
    rings = np.bincount(RING.ravel(), depth.ravel()) / np.bincount(RING.ravel())
    return np.concatenate([
        [most, np.sqrt(mask.sum()), np.sqrt(upper.sum()), np.cbrt(depth[mask > 0].sum()), *spread, *outline,
         cv2.connectedComponents(upper)[0]],
        -np.sign(hu) * np.log10(np.abs(hu) + 1e-12),
        np.histogram(depth[mask > 0] / most, 8, (0, 1))[0] / max(1, mask.sum()), rings[:16]]).astype(np.float32)


class Plain:
    """A small perceptron on the descriptors; the same limits of "known" and "unknown" as the network's."""

    def __init__(self, folder):
        with open(folder / "truth.csv", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        maps = np.fromfile(folder / "maps.i16", "<i2").reshape(-1, 96, 96)
        used = [i for i, row in enumerate(rows) if float(row["deepest_mm"]) >= 0.3 and float(row["cut"]) <= 1]
        features = np.array([descriptors(maps[i] * np.float32(1e-3)) for i in used])
        self.mean, self.scale = features.mean(0), features.std(0) + 1e-6
        inputs = torch.tensor((features - self.mean) / self.scale)
        kinds = torch.tensor(np.minimum([int(rows[i]["kind"]) for i in used], len(NAMES)))
        torch.manual_seed(1)
        torch.set_num_threads(1)
        self.perceptron = nn.Sequential(nn.Linear(inputs.shape[1], 128), nn.ReLU(), nn.Dropout(0.2),
                                        nn.Linear(128, len(NAMES) + 1))
        optimiser = torch.optim.Adam(self.perceptron.parameters(), 1e-3, weight_decay=1e-4)
        for _ in range(150):
            for batch in torch.randperm(len(kinds)).split(64):
                optimiser.zero_grad()
                nn.functional.cross_entropy(self.perceptron(inputs[batch]), kinds[batch]).backward()
                optimiser.step()
        self.perceptron.eval()

    def name(self, depth):
        with torch.no_grad():
            scaled = torch.tensor((descriptors(depth) - self.mean) / self.scale)
            votes = self.perceptron(scaled).softmax(0).numpy()
        if votes[:-1].max() >= 0.6:
            return NAMES[votes[:-1].argmax()]
        return "unknown" if votes[-1] >= 0.5 else "unsure"


def table(pressed, columns):
    """Markdown: of each object, and of all, the presses and how they were named."""
    counts, wrong = collections.defaultdict(collections.Counter), collections.Counter()
    for i, name in enumerate(pressed):
        groups = (f"`{name}` ({OBJECTS[name] or 'unknown'})",
                  "**all of the twelve classes**" if OBJECTS[name] else "**all others**")
        for group in groups:
            counts[group]["presses"] += 1
            for column, answers in columns.items():
                said = answers[i] or "unsure"
                result = ("right" if said == (OBJECTS[name] or "unknown") else
                          said if said in ("unknown", "unsure") else "wrong")
                counts[group][column, result] += 1
                if result == "wrong" and not group.startswith("**"):
                    wrong[f"{column}: {name} → {said}"] += 1
    lines = ["| pressed (right answer) | presses | " + " | ".join(
        f"{column}: right / wrong name / unsure / unknown" for column in columns) + " |",
        "| --- " * (2 + len(columns)) + "|"]
    for group in sorted(counts, key=lambda g: (g.startswith("**"), g.startswith("**all o"), g)):
        cells = [" / ".join(str(counts[group][column, result]) for result in ("right", "wrong", "unsure", "unknown"))
                 for column in columns]
        lines.append(f"| {group} | {counts[group]['presses']} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", *(f"- {names}: {count}" for names, count in sorted(wrong.items()))])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", type=int)
    parser.add_argument("presses", type=int)
    parser.add_argument("--plain", type=pathlib.Path, help="folder of recognition_presses")
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/bin", help="folder of the programs")
    arguments = parser.parse_args()
    draw, pressed, answers, maps = random.Random(arguments.seed), [], [], []
    while len(pressed) < arguments.presses:
        # The simulator computes all contacts of a scene before it begins.
        scene, objects = draw_scene(draw, min(20, arguments.presses - len(pressed)))
        for whole, part in zip((pressed, answers, maps), (objects, *run(scene, len(objects), arguments.bin))):
            whole += part
    columns = {"network": [a and (a.name or ("unknown" if a.verdict == "unknown" else "unsure")) for a in answers]}
    if arguments.plain:
        plain = Plain(arguments.plain)
        columns["descriptors"] = [m and plain.name(touch_map(*m)) for m in maps]
    print(f"Simulated sensor (config/simulated), seed {arguments.seed}, {len(pressed)} presses, "
          f"{answers.count(None)} without an answer; a recognition takes "
          f"{1e3 * np.median([a.computed_in_s for a in answers if a]):.1f} ms (median).\n")
    print(table(pressed, columns))


if __name__ == "__main__":
    main()
