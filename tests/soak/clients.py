"""The clients of a soak, in processes of their own: what they see comes back through a queue, as
tuples that begin with a word.

    ("frames", [(sequence, taken_ns, ready_ns, published_ns, received_ns, health), ...])
    ("depth", sequence, health, place, inside_mm, outside_mm, untrusted, stated_mm)
    ("visit", requests answered)
    ("fault", text)                    what must not happen
"""
from __future__ import annotations

import pathlib
import random
import socket
import struct
import threading
import time
import traceback

import numpy as np

import dtact
import plan

#: No wait of a client takes this long, however busy the machine.
TIMEOUT_S = 120.0
CROP = (slice(10, 590), slice(110, 690))  # of the picture, in the depth map: calibrate()'s --crop
VISITORS = 10


def truth_maps(folder: pathlib.Path, width: int, height: int):
    """soak_truth's files: place → (millimetres, contact), laid out like the depth map."""
    maps = {}
    pixels = width * height
    for name in ("A", "B", "no_contact"):
        data = (folder / f"{name}.truth").read_bytes()
        mm = np.frombuffer(data, np.float32, pixels).reshape(height, width)[CROP]
        contact = np.frombuffer(data, np.uint8, pixels, 4 * pixels).reshape(height, width)[CROP]
        maps[name] = (mm, contact > 0)
    return maps


def guarded(queue, name, stop, work):
    try:
        work()
    except Exception:  # any error goes into the report
        if not stop.is_set():
            queue.put(("fault", f"{name}: {traceback.format_exc(limit=4)}"))


def honest(address, queue, stop):
    """Takes every frame and notes its times."""
    def work():
        seen = []
        with dtact.connect(address, program="soak honest", timeout=TIMEOUT_S,
                           kept_frames=1000) as s:
            s.subscribe(dtact.Subscription(depth="int16", decimation=4, summary=True))
            for f in s.frames():
                now = time.monotonic_ns()
                m = f.message
                seen.append((m.sequence, m.monotonic_ns, m.ready_ns, m.published_ns, now, f.health))
                if len(seen) >= 60:
                    queue.put(("frames", seen))
                    seen = []
                if stop.is_set():
                    break
        queue.put(("frames", seen))
    guarded(queue, "the honest client", stop, work)


def judge(address, queue, stop, episodes, truths, per_second):
    """Compares whole depth maps with the truth wherever that is known."""
    def work():
        with dtact.connect(address, program="soak judge", timeout=TIMEOUT_S) as s:
            s.subscribe(dtact.Subscription(depth="int16", depth_hz=per_second, events=False))
            for f in s.frames():
                if stop.is_set():
                    return
                index = f.sequence // plan.EPISODE
                if not f.has_depth or index >= len(episodes):
                    continue
                place = episodes[index].place(f.sequence)
                if place is not None:
                    queue.put(("depth", f.sequence, f.health, place,
                               *depth_error(f.depth_mm, *truths[place]), f.uncertainty_mm))
    guarded(queue, "the judge", stop, work)


def depth_error(depth_mm, truth_mm, contact):
    """Mean absolute error in millimetres inside the true contact and outside, and the share of pixels
    inside that are untrusted. Without contact the first is 0."""
    error = np.abs(depth_mm - truth_mm)
    inside, believed = error[contact], ~np.isnan(error)
    untrusted = float(np.isnan(inside).mean()) if inside.size else 0.0
    within = inside[~np.isnan(inside)]
    outside = error[~contact & believed]
    return (float(within.mean()) if within.size else 0.0,
            float(outside.mean()) if outside.size else 0.0, untrusted)


# ------------------------------------------------------------ clients that come and go

def visitors(address, queue, stop, opened, inside, seed):
    """VISITORS threads. They come while `opened` is set; `inside` counts those that are connected."""
    def visitor(index):
        rng = random.Random(f"visitor {seed} {index}")
        while not stop.is_set():
            if not opened.wait(0.2):
                continue
            with inside.get_lock():
                inside.value += 1
            try:
                if opened.is_set():
                    guarded(queue, f"visitor {index}", stop,
                            lambda: queue.put(("visit", visit(address, rng, index, opened))))
            finally:
                with inside.get_lock():
                    inside.value -= 1
            stop.wait(rng.uniform(0.1, 2.0))

    threads = [threading.Thread(target=visitor, args=(i,)) for i in range(VISITORS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def visit(address, rng, index, opened):
    """Connects, subscribes, makes requests, and disconnects in one of the ways in which clients do."""
    answered = 0
    s = dtact.connect(address, program=f"soak visitor {index}", timeout=TIMEOUT_S)
    try:
        for _ in range(rng.randint(1, 3)):
            s.subscribe(subscription(rng))
            answered += 1 + ask(s, rng)
            until = time.monotonic() + rng.uniform(0.2, 2.5)
            while opened.is_set() and time.monotonic() < until:
                item = s.next(timeout=0.1)
                if isinstance(item, dtact.Frame) and item.has_depth:
                    _ = item.depth_values  # decoded: a broken one raises
        end = rng.choice(["close", "reset", "stop reading", "in the middle of a request"])
        link = s._link._socket
        if end == "stop reading":
            until = time.monotonic() + rng.uniform(0.5, 3)
            while opened.is_set() and time.monotonic() < until:
                time.sleep(0.05)
        elif end == "in the middle of a request":
            link.send(b"\0\0\1\0half")
        if end != "close":  # the kernel sends a reset instead of an orderly end
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    finally:
        s.close()
    return answered


def subscription(rng):
    box = (rng.randint(0, 400), rng.randint(0, 400), rng.randint(20, 180), rng.randint(20, 180))
    return dtact.Subscription(
        depth=rng.choice([None, "int16", "predict_zstd"]), luma=rng.random() < 0.3,
        jpeg=rng.random() < 0.3, summary=rng.random() < 0.7, every=rng.choice([0, 1, 2, 7]),
        depth_hz=rng.choice([1, 2.5, 5]), luma_hz=rng.choice([1, 2]), jpeg_hz=rng.choice([1, 5]),
        summary_hz=rng.choice([0, 10, 30]), decimation=rng.choice([1, 2, 4]),
        um_per_unit=rng.choice([1, 2, 5, 10]), region=rng.choice([None, None, "contact", box]),
        events=rng.random() < 0.8)


def ask(s, rng):
    """Makes some requests, one of which the daemon has to refuse. Returns how many were answered."""
    count = rng.randint(0, 3)
    for _ in range(count):
        try:
            rng.choice([s.status, s.ping, s.reference, s.calibrations, s.calibration])()
        except dtact.Busy:  # there is no reference while one is taken
            pass
    if rng.random() < 0.3:
        try:
            s.set_light(brightness=256)
        except dtact.Invalid:
            return count + 1
        raise AssertionError("brightness 256 was not refused")
    return count
