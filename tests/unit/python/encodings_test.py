"""Depth maps byte for byte."""
import importlib.util
import pathlib
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
            found = decode(2, width, height, bytes.fromhex(lines["predict_zstd"]))
            self.assertEqual(found, wanted, file.name)

    def test_int16(self):
        self.assertEqual(decode(1, 2, 2, bytes.fromhex("0100 ffff 0080 ff7f")),
                         [[1, -1], [-32768, 32767]])

    def test_predict_zstd(self):
        # Residuals 0 1 2 / 1 0 36, zigzag 0 2 4 / 2 0 72; 72 is 15 and then 57.
        wanted = bytes.fromhex("20 24 f0 39")
        self.assertEqual(decode(2, 3, 2, zst(wanted)), [[0, 1, 3], [1, 2, 40]])
        # 200 is zigzag 400: 15, then 255 and 16 bits.
        self.assertEqual(decode(2, 1, 1, zst(bytes.fromhex("0f ff 90 01"))), [[200]])


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
                (1, MAKER.int16(width, values)), (2, zst(MAKER.predict(width, values))),
            ]:
                self.assertEqual(decode(encoding, width, height, data), wanted, encoding)


class Damaged(unittest.TestCase):
    """Foreign bytes end in ProtocolError and nothing else."""

    def refuse(self, encoding, width, height, data):
        with self.assertRaises(dtact.ProtocolError):
            decode(encoding, width, height, data)

    def test_sizes(self):
        for encoding in (1, 2):
            self.refuse(encoding, 0, 5, b"")
            self.refuse(encoding, 1 << 20, 9, b"")
            self.refuse(encoding, 3, 2, b"")
        self.refuse(1, 2, 2, bytes(7))
        self.refuse(2, 2, 2, zst(bytes(7)))
        self.refuse(3, 2, 2, bytes(8))

    def test_zstd_that_claims_much_is_not_unpacked(self):
        self.refuse(2, 2, 2, zst(bytes(1 << 24)))

    def test_predict_zstd(self):
        self.refuse(2, 1, 1, zst([0x0f]))  # no second part
        self.refuse(2, 1, 1, zst([0x0f, 255, 0]))  # a residual that ends early
        self.refuse(2, 1, 1, zst([0x0f, 255, 0, 0]))  # longer than it needs to be
        self.refuse(2, 1, 1, zst([0x00, 9]))  # a second part that nothing asks for
        self.refuse(2, 1, 1, zst([0x10]))  # a nibble beyond the map

    def test_random_bytes(self):
        random = np.random.default_rng(2)
        for _ in range(2000):
            data = random.bytes(int(random.integers(0, 40)))
            for encoding, sent in [(2, zst(data)), (2, data)]:
                try:
                    decode(encoding, 5, 3, sent)
                except dtact.ProtocolError:
                    pass


if __name__ == "__main__":
    unittest.main()
