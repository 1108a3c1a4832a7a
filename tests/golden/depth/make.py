#!/usr/bin/env python3
"""Golden vectors of the wire's depth encodings: small maps, and the bytes that each encoding makes.

    make.py           writes the files anew (needs Debian's zstd, the command line)
    make.py --check   says what in them is not as this program makes it; zstd frames are left out

Each file NAME.txt is one map: a line for each of the following, a name, a blank, and a decimal
number or lower-case hexadecimal digits.

    width, height   pixels
    int16           the map: DEPTH_INT16
    predict         DEPTH_PREDICT_ZSTD before zstd
    predict_zstd    the same as a zstd frame

Every decoder must give the map for its bytes. An encoder must give these bytes; of the one with
zstd, whose frames differ from one version to the next, those before it.

Nothing of the project's is used: it is written from proto/README.md.
"""
import math
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

FOLDER = pathlib.Path(__file__).resolve().parent
UNTRUSTED = -32768


def signed(value):
    """Modulo 65536, as int16."""
    return (value + 32768) % 65536 - 32768


def zigzag(value):
    return 2 * value if value >= 0 else -2 * value - 1


def int16(width, values):
    return struct.pack(f"<{len(values)}h", *values)


def predict(width, values):
    def at(x, y):
        return values[y * width + x] if x >= 0 and y >= 0 else 0

    residuals = []
    for i in range(len(values)):
        x, y = i % width, i // width
        guess = at(x - 1, y) + at(x, y - 1) - at(x - 1, y - 1)
        residuals.append(zigzag(signed(at(x, y) - guess)))
    nibbles = [min(r, 15) for r in residuals] + [0] * (len(residuals) % 2)
    first = bytes(low | high << 4 for low, high in zip(nibbles[::2], nibbles[1::2]))
    second = b"".join(bytes([r - 15]) if r < 270 else struct.pack("<BH", 255, r)
                      for r in residuals if r >= 15)
    return first + second


def zstd(content):
    # From a file, so that the frame states its content's size.
    with tempfile.NamedTemporaryFile() as file:
        file.write(content)
        file.flush()
        return subprocess.run(["zstd", "-1", "--no-check", "-c", "-q", file.name],
                              check=True, stdout=subprocess.PIPE).stdout


def ball(width, height):
    """A ball held in contact, with noise, marks that are not trusted and a contact-free margin."""
    noise = random.Random(9)
    values = []
    for y in range(height):
        for x in range(width):
            r = math.hypot(x - width / 2, y - height / 2) / (width / 2)
            depth = 1200 * max(0, 1 - 2.2 * r * r) - 90 * math.exp(-((r - 0.8) / 0.15) ** 2)
            value = round(depth + noise.gauss(0, 3)) if r < 0.95 else 0
            values.append(UNTRUSTED if math.hypot(x - 19, y - 6) < 2.5 else value)
    return values


def maps():
    """Name, width, values."""
    some = random.Random(1)
    yield "one_pixel", 1, [-1]
    yield "zeros", 5, [0] * 15
    yield "worked_example", 4, [0, 1, 3, -2, 1000, 1000, UNTRUSTED, 7]
    # Runs at the lengths where their numbers need another nibble, and one that ends the map.
    runs = []
    for length in (1, 7, 8, 63, 64, 511, 512):
        runs += [0] * length + [length % 5 - 9] * length
    yield "runs", 10, runs + [0] * (-len(runs) % 10 + 20)
    # Differences and residuals on both sides of every change of form.
    steps = [0, 3, 4, 7, 8, 31, 32, 134, 135, 255, 256, 2047, 2048, 16383, 16384, 32767]
    edges = [v for step in steps for v in (step, 0, -step, 0)]
    yield "edges", 2, edges + edges[1:] + [1]
    yield "extremes", 3, [32767, UNTRUSTED, 32767, -32767, 32767, UNTRUSTED, 1, -1, UNTRUSTED,
                          UNTRUSTED, UNTRUSTED, 0, 0, UNTRUSTED, 32767]
    yield "random", 13, [some.randint(-32768, 32767) for _ in range(13 * 11)]
    yield "column", 1, [some.randint(-20, 20) for _ in range(33)]
    yield "row", 33, [some.choice((0, 0, 0, 5, UNTRUSTED)) for _ in range(33)]
    yield "ball", 31, ball(31, 27)


def lines(width, values):
    yield "width", str(width)
    yield "height", str(len(values) // width)
    content = predict(width, values)
    yield "int16", int16(width, values).hex()
    yield "predict", content.hex()
    yield "predict_zstd", content


def main():
    check = sys.argv[1:] == ["--check"]
    wrong = []
    for name, width, values in maps():
        assert len(values) % width == 0, name
        file = FOLDER / f"{name}.txt"
        if check:
            is_now = dict(line.split(" ") for line in file.read_text().splitlines())
            wrong += [f"{file}: {key} is not as {sys.argv[0]} makes it"
                      for key, value in lines(width, values)
                      if isinstance(value, str) and is_now[key] != value]
        else:
            file.write_text("".join(f"{key} {value if isinstance(value, str) else zstd(value).hex()}\n"
                                    for key, value in lines(width, values)))
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
