"""The schema in the package is the tree's, and both implementations of protobuf read it."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
from importlib import resources

from google.protobuf import descriptor_pb2

from dtact import messages, requests

PROTO = pathlib.Path(__file__).resolve().parents[3] / "proto"

# protobuf 4.22 brought GetMessageClass; 5.26 took GetPrototype away.
NEWER_PROTOBUF = """
from google.protobuf import message_factory, symbol_database
if not hasattr(message_factory, "GetMessageClass"):
    message_factory.GetMessageClass = message_factory.MessageFactory().GetPrototype
    del message_factory.MessageFactory
from dtact.messages import ClientMessage
m = ClientMessage(id=1)
m.hello.program = "x"
print(m.SerializeToString().hex())
"""


class Schema(unittest.TestCase):
    def test_is_the_one_of_the_tree(self):
        with tempfile.TemporaryDirectory() as folder:
            out = f"{folder}/set"
            subprocess.run([os.environ.get("PROTOC", "protoc"), "-I", PROTO,
                            f"--descriptor_set_out={out}", PROTO / "dtact.proto"], check=True)
            made = descriptor_pb2.FileDescriptorSet.FromString(pathlib.Path(out).read_bytes())
        inside = descriptor_pb2.FileDescriptorSet.FromString(
            resources.files("dtact").joinpath("dtact.binpb").read_bytes())
        self.assertEqual(inside, made, f"run what {messages.__file__} says at its top")

    def test_serves_newer_protobuf_too(self):
        ran = subprocess.run([sys.executable, "-c", NEWER_PROTOBUF], capture_output=True, text=True)
        self.assertEqual(ran.stdout.strip(), "080112031a0178", ran.stderr)

    def test_does_not_touch_the_default_pool(self):
        from google.protobuf import descriptor_pool
        with self.assertRaises(KeyError):
            descriptor_pool.Default().FindMessageTypeByName("dtact.v1.Frame")


class Golden(unittest.TestCase):
    """Byte for byte, as in tests/unit/wire/golden_test.cpp."""

    def check(self, request, number, wanted):
        request.message.id = number
        self.assertEqual(request.message.SerializeToString(), bytes.fromhex(wanted))

    def test_requests(self):
        self.check(requests.hello("x", None), 1, "08 01 12 07 08 01 10 01 1a 01 78")
        self.check(requests.set_light(0, "all", None), 3, "08 03 22 07 08 00 12 03 61 6c 6c")
        self.check(requests.rezero(True), 4, "08 04 2a 02 08 01")
        self.check(requests.rezero(False), 4, "08 04 2a 00")
        self.check(requests.status(), 4, "08 04 32 00")
        self.check(requests.calibration(None), 4, "08 04 3a 00")
        self.check(requests.calibration(0), 4, "08 04 3a 02 08 00")
        self.check(requests.calibrations(), 4, "08 04 4a 00")
        self.check(requests.activate_calibration(3), 4, "08 04 52 02 08 03")
        self.check(requests.unsubscribe(), 4, "08 04 1a 00")

    def test_a_long_program_is_cut_between_characters(self):
        message = requests.hello("a" + "é" * 40, None).message
        self.assertEqual(message.hello.program, "a" + "é" * 31)


class Names(unittest.TestCase):
    def test_of_known_and_unknown_values(self):
        self.assertEqual(messages.name_of("Health", 3), "light_unsettled")
        self.assertEqual(messages.name_of("State", 3), "serving")
        self.assertEqual(messages.name_of("TimestampMeaning", 4, "TIMESTAMP_"), "first_packet")
        self.assertEqual(messages.name_of("Health", 103), "103")
        self.assertEqual(messages.value_of("DEPTH_PREDICT_ZSTD"), 2)
        self.assertRaises(KeyError, messages.value_of, "DEPTH_OF_DESPAIR")


if __name__ == "__main__":
    unittest.main()
