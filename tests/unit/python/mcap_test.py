"""Recordings that the test writes after https://mcap.dev/spec."""
import os
import pathlib
import struct
import tempfile
import tracemalloc
import unittest
from unittest import mock

import zstandard

import dtact
from fake_daemon import event, frame

MAGIC = bytes.fromhex("89 4d 43 41 50 30 0d 0a")


def record(opcode, body):
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value):
    return struct.pack("<I", len(value)) + value.encode()


def channel(number, topic):
    return record(4, struct.pack("<HH", number, 1) + text(topic) + text("protobuf") + text(""))


def message(number, content, log_time=1):
    data = content if isinstance(content, bytes) else content.SerializeToString()
    return record(5, struct.pack("<HIQQ", number, 0, log_time, log_time) + data)


def chunk(records, compression="zstd", size=None):
    packed = zstandard.ZstdCompressor().compress(records) if compression else records
    return record(6, struct.pack("<QQQI", 0, 0, len(records) if size is None else size, 0)
                  + text(compression) + struct.pack("<Q", len(packed)) + packed)


CHANNELS = channel(3, "/dtact/frame") + channel(4, "/dtact/event") + channel(5, "/dtact/depth")


class Read(unittest.TestCase):
    def read(self, *parts):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "press.mcap")
            file.write_bytes(b"".join(parts))
            return [item.sequence if isinstance(item, dtact.Frame) else -item.light.brightness
                    for item in dtact.read(file)]

    def test_frames_and_events(self):
        inside = (message(3, frame(1).frame) + message(5, frame(9).frame) + message(4, event(7).event)
                  + message(3, frame(2).frame))
        for packed in (chunk(CHANNELS + inside), chunk(CHANNELS + inside, ""),
                       CHANNELS + chunk(inside), CHANNELS + inside):
            self.assertEqual(self.read(MAGIC, record(1, b"any"), packed, record(2, b""), MAGIC),
                             [1, -7, 2])

    def test_a_frame_gets_the_jpeg_that_stands_before_it(self):
        def jpeg(data):  # a CompressedImage: timestamp, data, format, frame_id
            return (b"\x0a\x02\x08\x05" + b"\x12" + bytes([len(data)]) + data + b"\x1a\x04jpeg"
                    + b"\x22\x01f")

        inside = (message(6, jpeg(b"first"), 10) + message(3, frame(1).frame, 10)
                  + message(3, frame(2).frame, 20) + message(6, jpeg(b"lone"), 30)
                  + message(3, frame(3).frame, 31)
                  + message(6, jpeg(b"last"), 40) + message(3, frame(4).frame, 40))
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "press.mcap")
            file.write_bytes(MAGIC + CHANNELS + channel(6, "/camera/jpeg") + chunk(inside) + MAGIC)
            frames = list(dtact.read(file))
        self.assertEqual([f.jpeg if f.has_jpeg else None for f in frames],
                         [b"first", None, None, b"last"])

    def test_one_that_was_cut_off(self):
        first, second = chunk(message(3, frame(1).frame)), chunk(message(3, frame(2).frame))
        for cut in (0, 1, 8, 9, len(second) - 1):
            with self.assertWarnsRegex(RuntimeWarning, "was killed"):
                self.assertEqual(self.read(MAGIC, CHANNELS, first, second[:cut]), [1])

    def test_what_cannot_be_read_among_what_can(self):
        def of(number):
            return message(3, frame(number).frame)

        undecodable = record(5, struct.pack("<HIQQ", 3, 0, 1, 1) + b"\xff\xff")
        unknown = message(9, frame(7).frame)
        damaged = chunk(of(4))[:-8] + bytes(8)
        inside_out = of(5) + record(5, b"x" * 30)[:20]
        with self.assertWarnsRegex(
                RuntimeWarning, r"2 chunk\(s\) cannot be read; 2 message\(s\) cannot be read"):
            read = self.read(MAGIC, CHANNELS, chunk(of(1) + undecodable + of(2)), of(3), damaged,
                             chunk(inside_out), unknown, chunk(of(6)), MAGIC)
        self.assertEqual(read, [1, 2, 3, 5, 6])

    def test_frames_out_of_order_get_their_own_jpegs(self):
        def jpeg(data):
            return b"\x12" + bytes([len(data)]) + data + b"\x1a\x04jpeg"

        inside = (message(6, jpeg(b"late"), 20) + message(6, jpeg(b"early"), 10)
                  + message(3, frame(2).frame, 20) + message(3, frame(1).frame, 10))
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "press.mcap")
            file.write_bytes(MAGIC + CHANNELS + channel(6, "/camera/jpeg") + chunk(inside) + MAGIC)
            frames = list(dtact.read(file))
        self.assertEqual([(f.sequence, f.jpeg) for f in frames], [(2, b"late"), (1, b"early")])

    # Before: what the packed bytes said was allocated, and all records of a chunk stood in memory at once.
    def test_a_small_file_takes_little_memory(self):
        large = chunk(bytes(100_000_000), size=1000)
        empty = chunk(message(3, frame(1).frame) + record(1, b"") * 300_000)
        tracemalloc.start()
        self.addCleanup(tracemalloc.stop)
        with self.assertWarnsRegex(RuntimeWarning, "a chunk has another size than it says"):
            self.assertEqual(self.read(MAGIC, CHANNELS, large, empty, MAGIC), [1])
        self.assertLess(tracemalloc.get_traced_memory()[1], 30_000_000)

    def test_damage(self):
        good = message(3, frame(1).frame)
        for part in (chunk(good, size=len(good) - 1), chunk(good, size=1 << 40),
                     chunk(good, size=len(good) + 1), record(6, b"short"),
                     chunk(good).replace(b"zstd", b"lz4_"), struct.pack("<BQ", 5, 1 << 60),
                     chunk(good)[:-8] + bytes(8), record(5, b"\3"),
                     record(5, struct.pack("<HIQQ", 3, 0, 1, 1) + b"\xff\xff")):
            with self.assertRaisesRegex(dtact.Error, "damaged"):
                self.read(MAGIC, CHANNELS, part, MAGIC)
        with self.assertRaisesRegex(dtact.Error, "no MCAP"):
            self.read(b"PK")


class Record(unittest.TestCase):
    """On a stand-in of dtactctl."""

    def setUp(self):
        folder = self.enterContext(tempfile.TemporaryDirectory())
        self.program = pathlib.Path(folder, "dtactctl")
        self.enterContext(mock.patch.dict(os.environ, {"PATH": f"{folder}:/usr/bin:/bin"}))
        self.said = pathlib.Path(folder, "said")

    def dtactctl(self, script):
        self.program.write_text(f"#!/bin/sh\n{script}\n")
        self.program.chmod(0o755)

    def session(self, address, **options):
        # The sessions of both clients, without a connection.
        return dtact.aio.Client(address, **options)

    def test_is_started_and_reported_to_finish(self):
        self.dtactctl(f'trap "echo finished >> {self.said}; exit 0" TERM; echo "$@" > {self.said}\n'
                      "echo recording to press.mcap >&2; while true; do sleep 0.01; done")
        with self.session("gripper:7", fingerprint="AB" * 32).record("press.mcap"):
            pass
        self.assertEqual(self.said.read_text(), "--host gripper --port 7 --fingerprint "
                         + "AB" * 32 + " record -o press.mcap\nfinished\n")

    def test_over_a_socket_file(self):
        self.dtactctl(f'trap "" TERM; echo "$@" > {self.said}; echo recording to p.mcap >&2')
        with self.session("unix:/run/s").record("p.mcap"):
            pass
        self.assertEqual(self.said.read_text(), "--host unix:/run/s record -o p.mcap\n")

    def test_what_went_wrong_is_said_on_entry(self):
        self.dtactctl("echo dtactctl: press.mcap exists >&2; exit 1")
        with self.assertRaisesRegex(dtact.Error, "^dtactctl: press.mcap exists$"):
            self.session("gripper").record("press.mcap")

    def test_no_frame_is_said_on_entry(self):
        self.dtactctl(f'trap "echo finished >> {self.said}; exit 1" TERM\nwhile true; do sleep 0.01; done')
        with mock.patch("dtact.recording._START_S", 0.5):
            with self.assertRaisesRegex(dtact.Error, "no frame came within 0.1 s"):
                self.session("gripper", timeout=0.1).record("press.mcap")
        self.assertEqual(self.said.read_text(), "finished\n")

    def test_what_went_wrong_later_is_said_at_the_end(self):
        self.dtactctl('trap "" TERM; echo recording to press.mcap >&2\n'
                      "echo dtactctl: the disk is full >&2; exit 1")
        recording = self.session("gripper").record("press.mcap")
        for _ in range(2):
            with self.assertRaisesRegex(dtact.Error, "^dtactctl: the disk is full$"):
                recording.stop()

    def test_without_dtactctl(self):
        with self.assertRaisesRegex(dtact.Error, "not in PATH"):
            self.session("gripper").record("press.mcap")

    def test_a_token_is_not_shown_to_others(self):
        self.dtactctl("exit 0")
        with self.assertRaisesRegex(dtact.Error, "token_file"):
            self.session("gripper", token="secret").record("press.mcap")


if __name__ == "__main__":
    unittest.main()
