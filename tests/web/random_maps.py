#!/usr/bin/env python3
"""random_maps.py GOLDEN FOLDER: random maps as files like those of the folder GOLDEN, with its make.py."""
import importlib.util
import pathlib
import random
import sys

import zstandard

SIZES = [(1, 1), (1, 9), (9, 1), (7, 5), (64, 3), (31, 33)]


def load(file):
    spec = importlib.util.spec_from_file_location("make", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def kinds(some):
    """Kinds of pixel values: anything, extremes, small steps, a few among zeros."""
    yield "any", lambda: some.randint(-32768, 32767)
    yield "extreme", lambda: some.choice((-32768, 32767, 0))
    yield "small", lambda: some.randint(-2, 2)
    yield "sparse", lambda: some.randint(0, 1) * some.randint(-400, 400)


def main():
    golden, folder = map(pathlib.Path, sys.argv[1:])
    make, some = load(golden / "make.py"), random.Random(1)
    folder.mkdir(parents=True, exist_ok=True)
    for width, height in SIZES:
        for kind, pixel in kinds(some):
            lines = make.lines(width, [pixel() for _ in range(width * height)])
            text = {key: value if isinstance(value, str) else zstandard.compress(value).hex()
                    for key, value in lines}
            (folder / f"{kind}_{width}x{height}.txt").write_text(
                "".join(f"{key} {value}\n" for key, value in text.items()))


main()
