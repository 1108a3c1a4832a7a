#!/usr/bin/env python3
"""Processor time of decoding a depth map, a frame, for each encoding.

Without an address: a ball pressed into 580 × 580 pixels, encoded here. With one: frames
of that daemon, under what it shows at the time.

    decode.py [--repeat N] [ADDRESS]
"""
import argparse
import importlib.util
import pathlib
import time

import numpy as np
import zstandard

import dtact
from dtact.messages import message_class

ENCODINGS = {"int16": 1, "predict_zstd": 2}
SIDE = 580
GOLDEN_MAKER = pathlib.Path(__file__).resolve().parents[3] / "tests/golden/depth/make.py"


def ball() -> np.ndarray:
    """int16 (580, 580), µm: a ball of 5 mm pressed 1 mm deep, noise of 2 µm around it."""
    y, x = (np.mgrid[:SIDE, :SIDE] - SIDE / 2) * 0.0413793
    cap = np.sqrt(np.maximum(0, 25 - x * x - y * y)) - 4
    noise = np.random.default_rng(1).normal(0, 2, cap.shape)
    return np.where(cap > 0, 1000 * cap + noise, 0).round().astype(np.int16)


def made() -> dict[str, dtact.Frame]:
    """By the encoders of the golden vectors."""
    spec = importlib.util.spec_from_file_location("make", GOLDEN_MAKER)
    assert spec is not None and spec.loader is not None
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    depth = ball()
    values = depth.ravel().tolist()
    frames = {}
    for name, number in ENCODINGS.items():
        content = getattr(maker, name.removesuffix("_zstd"))(SIDE, values)
        if name.endswith("_zstd"):
            content = zstandard.compress(content, 1)
        message = message_class("Frame")()
        m = message.depth
        m.encoding, m.width, m.height, m.data = number, SIDE, SIDE, content
        m.um_per_unit, m.untrusted_value = 1, -32768
        frames[name] = dtact.Frame(message)
        np.testing.assert_array_equal(frames[name].depth_values, depth)
    return frames


def received(address: str) -> dict[str, dtact.Frame]:
    frames = {}
    with dtact.connect(address) as s:
        for name in ENCODINGS:
            s.subscribe(dtact.Subscription(depth=name))
            frames[name] = next(f for f in s.frames() if f.contact and f.contact.in_contact)
    return frames


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", nargs="?")
    parser.add_argument("--repeat", type=int, default=200)
    options = parser.parse_args()
    frames = received(options.address) if options.address else made()
    print(f"{'encoding':14}{'bytes':>10}{'ms to int16':>14}{'ms to mm':>12}   (median of "
          f"{options.repeat})")
    for name, frame in frames.items():
        times = []
        for _ in range(options.repeat):
            f = dtact.Frame(frame.message)
            began = time.process_time()
            f.depth_values
            between = time.process_time()
            f.depth_mm
            times.append((between - began, time.process_time() - began))
        values, mm = np.median(times, axis=0) * 1e3
        print(f"{name:14}{len(frame.message.depth.data):10}{values:14.2f}{mm:12.2f}")


if __name__ == "__main__":
    main()
