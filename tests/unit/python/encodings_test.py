"""Depth maps byte for byte."""
import os
import subprocess
import sys
import unittest

import numpy as np
import zstandard

import dtact
from dtact import encodings
from dtact.messages import message_class


def depth(encoding, width, height, data):
    return message_class("DepthMap")(encoding=encoding, width=width, height=height, data=data)


def decode(encoding, width, height, data):
    return encodings.depth_values(depth(encoding, width, height, data)).tolist()


def zst(data):
    return zstandard.ZstdCompressor().compress(bytes(data))


def rvl(values):
    """Wilson's listing, in Python."""
    nibbles = []

    def put(number):
        while True:
            nibbles.append((number & 7) | (8 if number > 7 else 0))
            number >>= 3
            if number == 0:
                return

    previous = at = 0
    while at < len(values):
        zeros = at
        while at < len(values) and values[at] == 0:
            at += 1
        put(at - zeros)
        run = at
        while at < len(values) and values[at] != 0:
            at += 1
        put(at - run)
        for value in values[run:at]:
            difference = value - previous
            put(2 * difference if difference >= 0 else -2 * difference - 1)
            previous = value
    nibbles += [0] * (-len(nibbles) % 8)
    words = [nibbles[i : i + 8] for i in range(0, len(nibbles), 8)]
    return b"".join(int("".join(f"{n:x}" for n in w), 16).to_bytes(4, "little") for w in words)


def predict(values, width):
    """DEPTH_PREDICT_ZSTD, in Python, before zstd."""
    height = len(values) // width
    v = np.zeros((height + 1, width + 1), np.int64)
    v[1:, 1:] = np.reshape(values, (height, width))
    residuals = (v[1:, 1:] - v[1:, :-1] - v[:-1, 1:] + v[:-1, :-1]).reshape(-1)
    residuals = (residuals + 32768) % 65536 - 32768
    zigzag = [int(2 * r if r >= 0 else -2 * r - 1) for r in residuals]
    nibbles = [min(z, 15) for z in zigzag] + [0] * (len(zigzag) % 2)
    content = [low | high << 4 for low, high in zip(nibbles[::2], nibbles[1::2])]
    for z in zigzag:
        if z >= 15:
            content += [z - 15] if z - 15 < 255 else [255, z & 255, z >> 8]
    return content


class Golden(unittest.TestCase):
    def test_int16(self):
        self.assertEqual(decode(1, 2, 2, bytes.fromhex("0100 ffff 0080 ff7f")),
                         [[1, -1], [-32768, 32767]])

    def test_delta_zstd(self):
        # 5, 7, 6 and −3, 32767, −32768: differences of left neighbours, the first of a row to 0.
        differences = bytes.fromhex("0500 0200 ffff fdff 0280 0100")
        self.assertEqual(decode(2, 3, 2, zst(differences)), [[5, 7, 6], [-3, 32767, -32768]])

    def test_rvl(self):
        # 2 zeros, 2 others: +1 → 2 and −9 → 17 = nibbles 8|1, 2; 1 zero, 1 other: +12 → 24 = 8|0, 3.
        # So nibbles 2 2 2 9 2 1 1 8 and 3, filled up, in little-endian words.
        wanted = bytes.fromhex("18212922 00000030")
        self.assertEqual(decode(3, 3, 2, wanted), [[0, 0, 1], [-8, 0, 4]])
        self.assertEqual(rvl([0, 0, 1, -8, 0, 4]), wanted)

    def test_predict_zstd(self):
        # Residuals 0 1 2 / 1 0 36, zigzag 0 2 4 / 2 0 72; 72 is 15 and then 57.
        wanted = bytes.fromhex("20 24 f0 39")
        self.assertEqual(decode(4, 3, 2, zst(wanted)), [[0, 1, 3], [1, 2, 40]])
        self.assertEqual(bytes(predict([0, 1, 3, 1, 2, 40], 3)), wanted)
        # 200 is zigzag 400: 15, then 255 and 16 bits.
        self.assertEqual(decode(4, 1, 1, zst(bytes.fromhex("0f ff 90 01"))), [[200]])


class AnyMap(unittest.TestCase):
    """Against the encoders above, which are written from the specification alone."""

    def maps(self):
        random = np.random.default_rng(1)
        for width, height in [(1, 1), (1, 9), (9, 1), (7, 5), (64, 3)]:
            size = width * height
            for values in [
                np.zeros(size), np.ones(size), random.integers(-2, 3, size),
                random.integers(-32768, 32768, size), random.choice([-32768, 32767, 0], size),
                random.integers(0, 2, size) * random.integers(-400, 400, size),
            ]:
                yield width, height, [int(v) for v in values]

    def test_rvl(self):
        for width, height, values in self.maps():
            wanted = np.reshape(values, (height, width)).tolist()
            self.assertEqual(decode(3, width, height, rvl(values)), wanted)

    def test_predict_zstd(self):
        for width, height, values in self.maps():
            wanted = np.reshape(values, (height, width)).tolist()
            self.assertEqual(decode(4, width, height, zst(predict(values, width))), wanted)


class Damaged(unittest.TestCase):
    """Foreign bytes end in ProtocolError and nothing else."""

    def refuse(self, encoding, width, height, data):
        with self.assertRaises(dtact.ProtocolError):
            decode(encoding, width, height, data)

    def test_sizes(self):
        for encoding in (1, 2, 3, 4):
            self.refuse(encoding, 0, 5, b"")
            self.refuse(encoding, 1 << 20, 9, b"")
            self.refuse(encoding, 3, 2, b"")
        self.refuse(1, 2, 2, bytes(7))
        self.refuse(2, 2, 2, zst(bytes(7)))
        self.refuse(5, 2, 2, bytes(8))

    def test_zstd_that_claims_much_is_not_unpacked(self):
        self.refuse(2, 2, 2, zst(bytes(1 << 24)))
        self.refuse(4, 2, 2, zst(bytes(1 << 24)))

    def test_rvl(self):
        whole = rvl([0, 0, 1, -8, 0, 4])
        self.refuse(3, 3, 2, whole[:4])
        self.refuse(3, 3, 2, whole + bytes(4))
        self.refuse(3, 2, 2, whole)  # a run beyond the map
        self.refuse(3, 3, 3, whole)  # a map beyond the runs
        self.refuse(3, 3, 2, bytes(64))  # empty runs without end
        self.refuse(3, 3, 2, b"\xff" * 64)  # a number without end
        self.refuse(3, 3, 2, bytes.fromhex("18212922 01000030"))  # not filled up with 0
        self.refuse(3, 1, 1, bytes.fromhex("00000009"))  # a number longer than it needs to be
        # 0 zeros, 2 others: 32767 and one more.
        self.refuse(3, 2, 1, bytes.fromhex("faffff02 00000021"))

    def test_predict_zstd(self):
        self.refuse(4, 1, 1, zst([0x0f]))  # no second part
        self.refuse(4, 1, 1, zst([0x0f, 255, 0]))  # a residual that ends early
        self.refuse(4, 1, 1, zst([0x0f, 255, 0, 0]))  # longer than it needs to be
        self.refuse(4, 1, 1, zst([0x00, 9]))  # a second part that nothing asks for
        self.refuse(4, 1, 1, zst([0x10]))  # a nibble beyond the map

    def test_random_bytes(self):
        random = np.random.default_rng(2)
        for _ in range(2000):
            data = random.bytes(int(random.integers(0, 40)))
            for encoding, sent in [(3, data), (4, zst(data)), (2, data), (4, data)]:
                try:
                    decode(encoding, 5, 3, sent)
                except dtact.ProtocolError:
                    pass


WITHOUT_RVL = """
import dtact
from dtact import encodings
assert not encodings.has_rvl()
assert dtact.Subscription().message({"rvl"}).depth == 1, "int16 is asked for"
try:
    dtact.Subscription(depth="rvl").message({"rvl"})
except ValueError as e:
    print(e)
"""


class WithoutTheExtension(unittest.TestCase):
    def test_int16_is_asked_for(self):
        """The build had no compiler: run.sh."""
        ran = subprocess.run([sys.executable, "-c", WITHOUT_RVL], capture_output=True, text=True,
                             env={**os.environ, "PYTHONPATH": os.environ["WITHOUT_RVL"]})
        self.assertEqual(ran.stdout, "this installation of dtact was built without RVL: install a C "
                         "compiler and python3-dev, then dtact again, or choose another encoding\n",
                         ran.stderr)

    def test_otherwise_rvl_is(self):
        self.assertTrue(encodings.has_rvl())
        self.assertEqual(dtact.Subscription().message({"rvl"}).depth, 3)
        self.assertEqual(dtact.Subscription().message(set()).depth, 1)


if __name__ == "__main__":
    unittest.main()
