"""Depth maps byte for byte."""
import importlib.util
import os
import pathlib
import subprocess
import sys
import unittest

import numpy as np
import zstandard

import dtact
from dtact import encodings
from dtact.messages import message_class

GOLDEN = pathlib.Path(__file__).resolve().parents[3] / "tests/golden/depth"


def depth(encoding, width, height, data):
    return message_class("DepthMap")(encoding=encoding, width=width, height=height, data=data)


def decode(encoding, width, height, data):
    return encodings.depth_values(depth(encoding, width, height, data)).tolist()


def zst(data):
    return zstandard.ZstdCompressor().compress(bytes(data))


def golden_maker():
    """tests/golden/depth/make.py, which has the encoders, written from the specification alone."""
    spec = importlib.util.spec_from_file_location("golden_maker", GOLDEN / "make.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MAKER = golden_maker()


class Golden(unittest.TestCase):
    def test_vectors(self):
        files = sorted(GOLDEN.glob("*.txt"))
        self.assertGreater(len(files), 5)
        for file in files:
            lines = dict(line.split(" ") for line in file.read_text().splitlines())
            width, height = int(lines["width"]), int(lines["height"])
            wanted = decode(1, width, height, bytes.fromhex(lines["int16"]))
            for encoding, name in [(2, "delta_zstd"), (3, "rvl"), (4, "predict_zstd")]:
                found = decode(encoding, width, height, bytes.fromhex(lines[name]))
                self.assertEqual(found, wanted, f"{file.name}: {name}")

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

    def test_predict_zstd(self):
        # Residuals 0 1 2 / 1 0 36, zigzag 0 2 4 / 2 0 72; 72 is 15 and then 57.
        wanted = bytes.fromhex("20 24 f0 39")
        self.assertEqual(decode(4, 3, 2, zst(wanted)), [[0, 1, 3], [1, 2, 40]])
        # 200 is zigzag 400: 15, then 255 and 16 bits.
        self.assertEqual(decode(4, 1, 1, zst(bytes.fromhex("0f ff 90 01"))), [[200]])


class AnyMap(unittest.TestCase):
    """Against the encoders of the golden vectors."""

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

    def test_every_encoding(self):
        for width, height, values in self.maps():
            wanted = np.reshape(values, (height, width)).tolist()
            for encoding, data in [
                (1, MAKER.int16(width, values)), (2, zst(MAKER.delta(width, values))),
                (3, MAKER.rvl(width, values)), (4, zst(MAKER.predict(width, values))),
            ]:
                self.assertEqual(decode(encoding, width, height, data), wanted, encoding)


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
        whole = MAKER.rvl(3, [0, 0, 1, -8, 0, 4])
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
assert dtact.Subscription().message({"rvl"}, False).depth == 1, "int16 is asked for"
try:
    dtact.Subscription(depth="rvl").message({"rvl"}, False)
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
        self.assertEqual(dtact.Subscription().message({"rvl"}, False).depth, 3)
        self.assertEqual(dtact.Subscription().message({"rvl"}, True).depth, 1)
        self.assertEqual(dtact.Subscription().message(set(), False).depth, 1)


if __name__ == "__main__":
    unittest.main()
