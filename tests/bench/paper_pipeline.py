#!/usr/bin/env python3
"""The paper's reconstruction in Python with OpenCV, written from its text: rectify the colour
frame, crop, grey, difference, list, two 7x7 Gaussian filters. What the daemon is compared with. The
authors' program does more for every frame, which is left out here: it computes the rectification's
maps anew (cv2.undistort), mirrors the image, smooths the difference before the LUT as well, and
draws.

Depth is in double precision, which is what a numpy array of millimetres is: in the times that the
paper reports (8 ms rectify, 3 ms map, 14 ms smooth) the smoothing costs 1.75 times the
rectification; here that is 1.3 in double and 0.3 in single precision. "python-float32" is the same
with that one type changed.

Serves a driver on stdin/stdout, like the C++ side: "run NAME COUNT" answers with COUNT times in
nanoseconds, "verify NAME" with "ok" or what is wrong, "list" with the names.
"""
import os
import sys
import time

import cv2
import numpy as np

WIDTH, HEIGHT, SIDE = 800, 600, 580
# Position of the crop in the rectified frame.
TOP, LEFT = (HEIGHT - SIDE) // 2, (WIDTH - SIDE) // 2


class PaperPipeline:
    """`map_x`, `map_y`: position in the frame of each pixel of the crop, SIDE x SIDE float32;
    `reference_image`: the reference image, HEIGHT x WIDTH x 3 bytes."""

    def __init__(self, map_x, map_y, reference_image):
        # The published method rectifies the whole frame before it is cropped; outside the crop the
        # map's content does not matter.
        self.maps = [np.ascontiguousarray(np.pad(m, ((TOP, TOP), (LEFT, LEFT)), mode="edge"))
                     for m in (map_x, map_y)]
        self.reference = self.rectified_grey(reference_image)

    def rectified_grey(self, frame):
        rectified = cv2.remap(frame, self.maps[0], self.maps[1], cv2.INTER_LINEAR)
        return cv2.cvtColor(rectified[TOP:TOP + SIDE, LEFT:LEFT + SIDE], cv2.COLOR_BGR2GRAY)

    def depth(self, frame, mm):
        difference = cv2.subtract(self.reference, self.rectified_grey(frame))
        depth = mm[difference]
        depth = cv2.GaussianBlur(depth, (7, 7), 0)
        return cv2.GaussianBlur(depth, (7, 7), 0)


class Cases(PaperPipeline):
    """The part that ./dev bench times, on the inputs in `folder`."""

    def __init__(self, folder):
        def read(name, kind):
            return np.fromfile(os.path.join(folder, name), dtype=kind)

        self.jpeg = read("frame.jpg", np.uint8)
        grey = read("frame.raw", np.uint8).reshape(HEIGHT, WIDTH)
        self.frame = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
        self.list32 = read("list.f32", np.float32)
        self.list = self.list32.astype(np.float64)
        self.expected = read("depth.i16", np.int16).reshape(SIDE, SIDE)
        crop = [read(f"map_{axis}.f32", np.float32).reshape(SIDE, SIDE) for axis in "xy"]
        reference_image = read("reference.raw", np.uint8).reshape(HEIGHT, WIDTH)
        super().__init__(*crop, cv2.cvtColor(reference_image, cv2.COLOR_GRAY2BGR))

    def python(self):
        return self.depth(self.frame, self.list)

    def python_float32(self):
        return self.depth(self.frame, self.list32)

    def python_decode(self):
        return self.depth(cv2.imdecode(self.jpeg, cv2.IMREAD_COLOR), self.list)


def wrong(depth_mm, expected_um):
    """The signed pipeline has a bulge and keeps more bits: compared where the press is deeper than
    0.3 mm."""
    pressed = expected_um >= 300
    apart = float(np.abs(depth_mm - expected_um / 1000.0)[pressed].mean())
    return "ok" if apart < 0.02 else f"{apart:.4f} mm apart on average"


def main():
    cv2.setNumThreads(1)
    pipeline = Cases(sys.argv[1])
    cases = {"python": pipeline.python, "python-float32": pipeline.python_float32,
             "python+decode": pipeline.python_decode}
    for line in sys.stdin:
        verb, *rest = line.split()
        if verb == "list":
            print(*cases, flush=True)
        elif verb == "verify":
            print(wrong(cases[rest[0]](), pipeline.expected), flush=True)
        elif verb == "run":
            once = cases[rest[0]]
            once()
            once()
            spent = []
            for _ in range(int(rest[1])):
                begin = time.thread_time_ns()
                once()
                spent.append(time.thread_time_ns() - begin)
            print(*spent, flush=True)


if __name__ == "__main__":
    main()
