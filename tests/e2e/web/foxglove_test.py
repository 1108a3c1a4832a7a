#!/usr/bin/env python3
"""foxglove_test.py FOLDER: dtact-web's Foxglove protocol against Foxglove's own client for npm, which is
installed in FOLDER, and the daemon's frames. Skipped (77) where npm cannot have it."""
import base64
import hashlib
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from socket import create_server
from typing import Any

from programs import Daemon, Gateway, Perceive, calibrate, install_npm_packages, write_tokens
from viewer import Client, E, M
from web_socket import Closed, Refused, WebSocket, request

import numpy
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

HERE = pathlib.Path(__file__).resolve().parent
NODE = pathlib.Path(sys.argv.pop(1) if len(sys.argv) > 1 else tempfile.mkdtemp())
FOLDER = tempfile.TemporaryDirectory(prefix="dtact_foxglove_")
V1, SDK = "foxglove.websocket.v1", "foxglove.sdk.v1"
TOPICS = {"/dtact/frame": "dtact.v1.Frame", "/dtact/summary": "dtact.v1.Frame",
          "/dtact/contact": "dtact.v1.Contact", "/dtact/light": "dtact.v1.LightState",
          "/dtact/event": "dtact.v1.Event", "/dtact/depth": "foxglove.RawImage",
          "/camera/luma": "foxglove.RawImage", "/camera/jpeg": "foxglove.CompressedImage"}
POINTS = {"/dtact/summary": "dtact.v1.Frame", "/dtact/contact": "dtact.v1.Contact",
          "/dtact/points": "foxglove.PointCloud", "/dtact/pose": "foxglove.PoseInFrame",
          "/dtact/recognition": "dtact.v1.Recognition", "/tf": "foxglove.FrameTransforms"}
daemon: Daemon
perceive: Perceive
gateway: Gateway


def setUpModule() -> None:
    global daemon, perceive, gateway
    folder = pathlib.Path(FOLDER.name)
    daemon = Daemon(folder, "left", f"calibration={calibrate(folder)}")
    perceive = Perceive(folder, daemon)
    gateway = Gateway(folder, "--daemon", f"left=127.0.0.1:{daemon.port}", "--daemon", "gone=127.0.0.1:1",
                      "--daemon", f"touch=127.0.0.1:{perceive.port}")
    # The channels are known once both are connected to their daemons.
    while not all(one["connected"] for one in json.loads(request(gateway.port, "/sensors")[2])
                  if one["name"] != "gone"):
        time.sleep(0.05)


def tearDownModule() -> None:
    ended = [program.stop() for program in (gateway, perceive, daemon)]
    FOLDER.cleanup()
    assert ended == [0, 0, 0], ended


def reported(path: str, subprotocol: str, count: int) -> dict[str, list[Any]]:
    """Messages to the client, by kind."""
    url = f"ws://127.0.0.1:{gateway.port}{path}"
    # A file, because node may not have written all to a pipe when it ends.
    with open(pathlib.Path(FOLDER.name, "told"), "w+", encoding="utf-8") as out:
        subprocess.run(["node", HERE / "foxglove.mjs", url, subprotocol, str(count)], cwd=NODE, stdout=out,
                       timeout=120, check=True)
        out.seek(0)
        found: dict[str, list[Any]] = {}
        for line in out:
            entry = json.loads(line)
            found.setdefault(entry["kind"], []).append(entry)
    return found


class DirectFrames(threading.Thread):
    """Frames of the daemon's own clients meanwhile: a digest of the depth of each frame by its time,
    micrometres, 0 where less or untrusted."""

    def __init__(self) -> None:
        super().__init__()
        self.client = Client(daemon.port)
        self.client.call(subscribe=M.Subscribe(depth=E.DEPTH_INT16, depth_hz=60))
        self.digests: dict[int, bytes] = {}
        self.sizes: set[tuple[int, int]] = set()
        self.enough = False

    def run(self) -> None:
        with self.client:
            while not self.enough:
                frame = self.client.frame(lambda frame: frame.HasField("depth"))
                pixels = numpy.maximum(numpy.frombuffer(frame.depth.data, "<i2"), 0).astype("<u2")
                self.digests[frame.wall_ns] = hashlib.sha256(pixels.tobytes()).digest()
                self.sizes.add((frame.depth.width, frame.depth.height))

    def __enter__(self) -> "DirectFrames":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.enough = True
        self.join()


def classes(channels: list[Any]) -> dict[str, Any]:
    """Message classes by topic, from the announced schemas only."""
    made = {}
    for channel in channels:
        files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"], validate=True))
        pool = descriptor_pool.DescriptorPool()
        for file in files.file:
            pool.AddSerializedFile(file.SerializeToString())
        type_ = pool.FindMessageTypeByName(channel["schemaName"])
        make = getattr(message_factory, "GetMessageClass", None)
        made[channel["topic"]] = make(type_) if make else message_factory.MessageFactory(pool).GetPrototype(type_)
    return made


class FoxglovesClient(unittest.TestCase):
    def test_channels_messages_and_services(self) -> None:
        with DirectFrames() as direct:
            node = reported("/sensors/left/foxglove", V1, 15)
        self.assertEqual(node["end"][0]["why"], "all came")
        channels = [entry["channel"] for entry in node["channel"]]
        self.assertEqual({one["topic"]: one["schemaName"] for one in channels}, TOPICS)
        self.assertEqual({(one["encoding"], one["schemaEncoding"]) for one in channels},
                         {("protobuf", "protobuf")})
        self.assertEqual(node["info"][0]["info"]["capabilities"], ["services"])
        types = classes(channels)
        came: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in TOPICS}
        for entry in node["message"]:
            message = types[entry["topic"]].FromString(base64.b64decode(entry["data"]))
            came[entry["topic"]].append((int(entry["time"]), message))
        self.frames(came["/dtact/frame"])
        self.pictures(came["/dtact/depth"], direct)
        for _, message in came["/dtact/summary"]:
            self.assertFalse(message.HasField("depth"))
            self.assertTrue(message.HasField("light"))
        for _, message in came["/camera/luma"]:
            self.assertEqual((message.width, message.height, message.encoding, message.step),
                             (800, 600, "mono8", 800))
            self.assertEqual(len(message.data), 800 * 600)
        self.assertGreater(len(came["/dtact/light"]), 0, "it is sent at first")
        self.services(node)

    def frames(self, frames: list[tuple[int, Any]]) -> None:
        self.assertEqual(len(frames), 15)
        for time_ns, message in frames:
            self.assertEqual(time_ns, message.wall_ns)
            # No depth comes while the new light settles.
            if message.HasField("depth"):
                self.assertEqual(message.depth.encoding, E.DEPTH_PREDICT_ZSTD)
            self.assertFalse(message.HasField("luma"))

    def pictures(self, pictures: list[tuple[int, Any]], direct: DirectFrames) -> None:
        """A picture equals the depth that the daemon sends to all clients."""
        compared = 0
        for time_ns, picture in pictures:
            self.assertEqual(picture.timestamp.seconds * 10**9 + picture.timestamp.nanos, time_ns)
            self.assertEqual((picture.encoding, picture.step), ("16UC1", 2 * picture.width))
            self.assertEqual(direct.sizes, {(picture.width, picture.height)})
            if time_ns in direct.digests:
                self.assertEqual(hashlib.sha256(picture.data).digest(), direct.digests[time_ns])
                compared += 1
        self.assertGreater(compared, 0)

    def services(self, node: dict[str, list[Any]]) -> None:
        self.assertEqual([(entry["service"]["name"], entry["service"]["type"]) for entry in node["service"]],
                         [("/dtact/set_light", "dtact.v1.SetLight"), ("/dtact/rezero", "dtact.v1.Rezero")])
        for entry in node["service"]:
            for side in ("request", "response"):
                json.loads(entry["service"][side]["schema"])
                self.assertEqual(entry["service"][side]["schemaName"],
                                 f"{entry['service']['type']}_{side.capitalize()}")
        (answer,) = node["answer"]
        self.assertEqual((answer["encoding"], json.loads(answer["text"])["brightness"]), ("json", 200))
        failures = sorted(entry["message"] for entry in node["failure"])
        self.assertEqual(len(failures), 2)
        self.assertIn("brightness: 300", failures[0] + failures[1])
        self.assertIn("brightnes", failures[0] + failures[1])

    def test_points_are_as_deep_as_the_contact(self) -> None:
        # The newest of each topic is sent: on a busy machine two seldom belong to one frame.
        for _ in range(10):
            if self.points_and_contacts_of_one_frame() > 0:
                return
        self.fail("no points and contact came of one frame")

    def points_and_contacts_of_one_frame(self) -> int:
        node = reported("/sensors/touch/foxglove", V1, 160)
        channels = [entry["channel"] for entry in node["channel"]]
        self.assertEqual({one["topic"]: one["schemaName"] for one in channels}, POINTS)
        types = classes(channels)
        came: dict[str, dict[int, Any]] = {topic: {} for topic in POINTS}
        for entry in node["message"]:
            message = types[entry["topic"]].FromString(base64.b64decode(entry["data"]))
            came[entry["topic"]][int(entry["time"])] = message
        compared = 0
        for time_ns, cloud in came["/dtact/points"].items():
            self.assertEqual(cloud.point_stride, 24)
            self.assertEqual([field.name for field in cloud.fields][:3], ["x", "y", "z"])
            points = numpy.frombuffer(cloud.data, "<f4").reshape(-1, 6)
            if len(points) == 0:
                continue  # The contact has ended.
            self.assertTrue(numpy.isfinite(points).all())
            if time_ns in came["/dtact/contact"]:
                deepest_mm = came["/dtact/contact"][time_ns].deepest_mm
                # Every other pixel of the map, z towards the object.
                self.assertAlmostEqual(-1000 * points[:, 2].min(), deepest_mm, delta=0.02)
                compared += 1
        return compared

    def test_all_sensors_under_the_sdks_name(self) -> None:
        node = reported("/foxglove", SDK, 0)
        topics = [entry["channel"]["topic"] for entry in node["channel"]]
        self.assertEqual(topics[:8], ["/left" + topic for topic in TOPICS])
        self.assertEqual(topics[8:16], ["/gone" + topic for topic in TOPICS])
        self.assertEqual(topics[16:], ["/touch" + topic for topic in POINTS])
        self.assertIn("the daemon of gone is away", node["status"][0]["status"]["message"])


class Protocol(unittest.TestCase):
    """Messages that Foxglove's client never sends."""

    def open(self) -> WebSocket:
        socket = WebSocket(gateway.port, "/sensors/left/foxglove", Sec_WebSocket_Protocol=f"x, {V1}")
        self.assertEqual(socket.fields["sec-websocket-protocol"], V1)
        for op in ("serverInfo", "advertise", "advertiseServices"):
            self.assertEqual(json.loads(socket.receive()[1])["op"], op)
        return socket

    def test_other_subprotocols_and_pages(self) -> None:
        for fields, status in (({}, 400), ({"Sec_WebSocket_Protocol": "mqtt"}, 400),
                               ({"Sec_WebSocket_Protocol": V1, "Origin": "http://evil.example"}, 403)):
            with self.assertRaises(Refused) as refused:
                WebSocket(gateway.port, "/foxglove", **fields)
            self.assertEqual(refused.exception.status, status)
        with WebSocket(gateway.port, "/foxglove", Sec_WebSocket_Protocol=V1, Origin="file://"):
            pass

    def test_nonsense_is_answered_and_harms_nobody(self) -> None:
        with self.open() as socket:
            for text in ("", "{", "[]", '{"op":3}', '{"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]}',
                         '{"op":"subscribe","subscriptions":[{"id":1,"channelId":0}]}', '{"op":"advertise"}',
                         "[" * 5000):
                socket.send(text.encode(), 1)
                self.assertEqual(json.loads(socket.receive()[1])["op"], "status", text)
            for payload in (b"", b"\x01", b"\x02\x01\x00\x00\x00", b"\x02" + b"\xff" * 12):
                socket.send(payload)
                self.assertEqual(json.loads(socket.receive()[1])["op"], "status", payload)
            socket.send(b"\x02" + struct.pack("<III", 7, 1, 4) + b"json{}")
            self.assertEqual(json.loads(socket.receive()[1])["op"], "serviceCallFailure")

    def test_channels_are_reported_when_the_daemon_comes(self) -> None:
        folder = pathlib.Path(FOLDER.name)
        with create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        gate = Gateway(folder, "--host", f"127.0.0.1:{port}")
        reported: dict[str, set[str]] = {"advertise": set(), "unadvertise": set()}
        topics: dict[int, str] = {}
        with WebSocket(gate.port, "/foxglove", Sec_WebSocket_Protocol=V1) as client:
            # The channels come before the daemon is known; this client subscribes to nothing.
            while not reported["advertise"]:
                self.collect(json.loads(client.receive()[1]), reported, topics)
            self.assertEqual(reported["advertise"], set(TOPICS))
            late = Perceive(folder, daemon, port)
            while "/dtact/points" not in reported["advertise"]:
                self.collect(json.loads(client.receive()[1]), reported, topics)
            self.assertEqual(reported["unadvertise"], set(TOPICS) - set(POINTS))
        self.assertEqual((gate.stop(), late.stop()), (0, 0))

    @staticmethod
    def collect(message: Any, reported: dict[str, set[str]], topics: dict[int, str]) -> None:
        for channel in message.get("channels", []):
            topics[channel["id"]] = channel["topic"]
            reported["advertise"].add(channel["topic"])
        for number in message.get("channelIds", []):
            reported["unadvertise"].add(topics[number])

    def test_tokens(self) -> None:
        tokens = pathlib.Path(FOLDER.name, "tokens")
        write_tokens(tokens, "view a-token-to-look-on", "control a-token-to-command")
        gate = Gateway(pathlib.Path(FOLDER.name), "--host", f"127.0.0.1:{daemon.port}", "--tokens", str(tokens))
        while not json.loads(request(gate.port, "/sensors")[2])[0]["connected"]:
            time.sleep(0.1)
        for target, word in (("/foxglove", "asks for a token"), ("/foxglove?token=x", "does not know the token")):
            with self.assertRaises(Refused) as refused:
                WebSocket(gate.port, target, Sec_WebSocket_Protocol=V1)
            self.assertEqual(refused.exception.status, 401)
            self.assertIn(word, str(refused.exception))
            self.assertIn("?token=\u2026", str(refused.exception))
        call = b"\x02" + struct.pack("<III", 1, 1, 4) + b'json{"brightness":255}'
        for token, opcode in (("a-token-to-look-on", 1), ("a-token-to-comman%64", 2)):
            with WebSocket(gate.port, f"/foxglove?token={token}", Sec_WebSocket_Protocol=V1) as socket:
                for _ in range(3):
                    socket.receive()
                socket.send(call)
                answer = socket.receive()
                self.assertEqual(answer[0], opcode, answer)
        self.assertEqual(gate.stop(), 0)

    def test_messages_are_bounded(self) -> None:
        with self.open() as socket:
            socket.send(b" " * 70000, 1)
            with self.assertRaises(Closed):
                socket.receive()

    def test_one_who_does_not_read_gets_the_newest(self) -> None:
        with WebSocket(gateway.port, "/sensors/left/foxglove", receive_buffer=65536,
                       Sec_WebSocket_Protocol=V1) as slow, Client(daemon.port) as direct:
            slow.send(b'{"op":"subscribe","subscriptions":[{"id":5,"channelId":7}]}', 1)
            direct.call(subscribe=M.Subscribe(summary=True))
            for _ in range(100):
                frame = direct.frame()
            times = []
            while not times or times[-1] < frame.wall_ns:
                opcode, payload = slow.receive()
                if opcode == 2:
                    self.assertEqual(payload[:5], b"\x01\x05\0\0\0")
                    times.append(struct.unpack("<Q", payload[5:13])[0])
            self.assertEqual(times, sorted(times))
            self.assertLess(len(times), 60, "frames that were not read are dropped")


if __name__ == "__main__":
    if why := install_npm_packages(NODE):
        print("skipped:", why)
        sys.exit(77)
    unittest.main(verbosity=2)
