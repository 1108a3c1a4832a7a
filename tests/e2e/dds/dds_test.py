#!/usr/bin/env python3
"""dds_test.py: dtact-dds in front of daemons on the simulated sensor, received by another DDS, Fast DDS.

Payloads are decoded here by the messages' definitions (CDR, OMG DDSI-RTPS 10)."""
import collections
import json
import math
import os
import pathlib
import queue
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[3]
sys.path += [str(SOURCE / "clients/dds"), str(SOURCE / "tests/e2e/web")]
import make_types  # noqa: E402
from messages import E, M  # noqa: E402
import network as lossy  # noqa: E402
from programs import Daemon, Perceive, Program, calibrate, install_npm_packages  # noqa: E402
from viewer import Client  # noqa: E402

MESSAGES = make_types.read_all()
FORMATS = {"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q",
           "uint64": "Q", "float32": "f", "float64": "d", "bool": "?", "byte": "B", "char": "B"}
PATIENCE = 30.0
# Below 102, where the ports are not those that systems give to others.
DOMAIN = 20 + os.getpid() % 80
FOLDER = tempfile.TemporaryDirectory(prefix="dtact_dds_")
HERE = pathlib.Path(FOLDER.name)
NODE = pathlib.Path(sys.argv.pop(1) if len(sys.argv) > 1 and "/" in sys.argv[1] else HERE / "node")


class Reader:
    """A payload."""

    def __init__(self, payload: bytes) -> None:
        assert payload[:2] == b"\0\1", "plain CDR, little-endian; two bytes of options follow"
        self.data, self.at = payload[4:], 0

    def number(self, kind: str):
        size = struct.calcsize(FORMATS[kind])
        self.at += -self.at % size
        self.at += size
        return struct.unpack_from("<" + FORMATS[kind], self.data, self.at - size)[0]

    def one(self, base: str):
        if base in MESSAGES:
            return self.message(base)
        if base != "string":
            return self.number(base)
        length = self.number("uint32")
        self.at += length
        assert self.data[self.at - 1] == 0, "a string ends with a zero"
        return self.data[self.at - length:self.at - 1].decode()

    def message(self, name: str):
        fields = {}
        for field, base, _, array, size in MESSAGES[name][1]:
            if array is None:
                fields[field] = self.one(base)
                continue
            count = size if array == make_types.ARRAY else self.number("uint32")
            if base == "uint8":
                fields[field] = self.data[self.at:self.at + count]
                self.at += count
            else:
                fields[field] = [self.one(base) for _ in range(count)]
        return type(name.split("/")[1], (), fields)


def encode(name: str, **fields) -> str:
    """The payload of a flat message in hexadecimal."""
    data = b""
    for field, base, _, array, _ in MESSAGES[name][1]:
        value = fields[field]
        if array is not None:
            data += b"\0" * (-len(data) % 4) + struct.pack("<I", len(value)) + b"".join(
                struct.pack("<4f", *one) for one in value)
        elif base == "string":
            text = value.encode() + b"\0"
            data += b"\0" * (-len(data) % 4) + struct.pack("<I", len(text)) + text
        else:
            data += b"\0" * (-len(data) % struct.calcsize(FORMATS[base])) + struct.pack("<" + FORMATS[base], value)
    return (b"\0\1\0\0" + data).hex()


class Peer:
    """A Fast DDS participant."""

    def __init__(self, domain: int = DOMAIN, within: tuple[str, ...] = ()) -> None:
        """`within`: the command that runs it."""
        # Debian 12's library deletes its readers' listeners as objects of another size.
        environment = {**os.environ, "ASAN_OPTIONS": "new_delete_type_mismatch=0"}
        self.process = subprocess.Popen([*within, os.environ["FASTDDS_PEER"], str(domain)], text=True,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
        self.samples = collections.defaultdict(queue.Queue)
        self.found = []  # writers, readers, participants: as words
        threading.Thread(target=self.read, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        self.process.stdin.close()
        self.process.wait(timeout=20)
        self.process.stdout.close()

    def read(self) -> None:
        for line in self.process.stdout:
            words = line.split()
            if words[0] == "sample":
                self.samples[words[1]].put((int(words[2]), bytes.fromhex(words[3])))
            else:
                self.found.append(words)

    def say(self, *words: str) -> None:
        print(*words, file=self.process.stdin, flush=True)

    def subscribe(self, topic: str, name: str, qos: str = "sensor") -> None:
        self.say("subscribe", topic, make_types.dds_name(name), qos)

    def next(self, topic: str, name: str, where=lambda message: True):
        end = time.monotonic() + PATIENCE
        while True:
            _, payload = self.samples[topic].get(timeout=max(0.01, end - time.monotonic()))
            reader = Reader(payload)
            message = reader.message(name)
            assert len(reader.data) - reader.at < 4, f"{topic} has {len(reader.data) - reader.at} bytes too many"
            if where(message):
                return message

    def together(self, topics: dict, where) -> list:
        """One message of each topic, all of one stamp; the first topic's is `where`. Any of them may be lost."""
        came = collections.defaultdict(list)
        while True:
            for topic, name in topics.items():
                message = self.next(topic, name)
                of_frame = came[ns(message.header.stamp)]
                of_frame.append((topic, message))
                messages = dict(of_frame)
                if len(messages) == len(topics) and where(messages[next(iter(topics))]):
                    return [messages[topic] for topic in topics]

    def writers(self) -> dict:
        return {words[1]: words for words in list(self.found) if words[0] == "writer" and len(words) > 4}

    def until(self, done, what: str):
        end = time.monotonic() + PATIENCE
        while not (value := done()):
            assert time.monotonic() < end, f"no {what} within {PATIENCE} s: {self.found}"
            time.sleep(0.05)
        return value


class Dds(Program):
    def __init__(self, name: str, *arguments: str, within: tuple[str, ...] = ()) -> None:
        super().__init__([*within, os.environ["DTACT_DDS"], "--domain", str(DOMAIN), *arguments],
                         HERE / f"{name}.log", r"on DDS domain (\d+)")


def ns(stamp) -> int:
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def board_at(celsius: float) -> tuple[str, ...]:
    """A command for a program on a board of this temperature; an empty one where no namespace can be made."""
    zone = HERE / "thermal" / "thermal_zone0"
    zone.mkdir(parents=True)
    (zone / "temp").write_text(f"{celsius * 1000:.0f}\n")
    within = ("unshare", "--mount", "--map-root-user", "sh", "-c",
              f'mount --bind {zone.parent} /sys/class/thermal && exec "$@"', "sh")
    return within if subprocess.run([*within, "true"], capture_output=True, check=False).returncode == 0 else ()


def setUpModule() -> None:
    global left, right, perceive, dds
    left = Daemon(HERE, "left", f"calibration={calibrate(HERE)}")
    right = Daemon(HERE, "right", f"calibration={SOURCE}/config/simulated", "camera.sim.output=mjpeg",
                   within=board_at(48.3))
    perceive = Perceive(HERE, left)
    dds = Dds("dds", "--daemon", f"left=127.0.0.1:{left.port}", "--daemon", f"right=127.0.0.1:{right.port}",
              "--perceive", f"left=127.0.0.1:{perceive.port}")
    for daemon in (left, right):
        with Client(daemon.port) as client:
            client.call(subscribe=M.Subscribe(summary=True))
            client.frame(lambda frame: frame.contact.in_contact)


def tearDownModule() -> None:
    ended = [program.stop() for program in (dds, perceive, left, right)]
    FOLDER.cleanup()
    assert ended == [0] * 4, ended


class Topics(unittest.TestCase):
    def test_image_and_contact_are_those_of_the_daemon(self) -> None:
        with Peer() as peer, Client(left.port) as client:
            topics = {"rt/left/contact": "dtact_msgs/Contact", "rt/left/indentation/image": "sensor_msgs/Image",
                      "rt/left/indentation/camera_info": "sensor_msgs/CameraInfo"}
            for topic, name in topics.items():
                peer.subscribe(topic, name)
            client.call(subscribe=M.Subscribe(depth=E.DEPTH_INT16, decimation=4, summary=True))
            peer.next("rt/left/indentation/image", "sensor_msgs/Image")
            theirs = {frame.sequence: frame for frame in
                      (client.frame(lambda frame: frame.contact.in_contact) for _ in range(30))}
            contact, image, info = peer.together(topics, lambda one: one.frame_number in theirs)
            frame = theirs[contact.frame_number]
            stamp = ns(contact.header.stamp)
            self.assertLess(abs(stamp - frame.wall_ns), 5_000_000)
            self.assertEqual(contact.header.frame_id, "left_surface_optical")
            self.assertTrue(contact.measured and contact.in_contact)
            self.assertAlmostEqual(contact.area, 1e-6 * frame.contact.area_mm2)
            self.assertAlmostEqual(contact.centroid.x, 1e-3 * frame.contact.x_mm)
            self.assertAlmostEqual(contact.centroid.y, 1e-3 * frame.contact.y_mm)
            self.assertAlmostEqual(contact.indentation, 1e-3 * frame.contact.deepest_mm)
            self.assertAlmostEqual(contact.uncertainty, 1e-6 * frame.depth.uncertainty_um)
            self.assertTrue(math.isnan(contact.force))
            self.assertEqual(contact.force_absence, "uncalibrated")
            self.assertEqual((image.width, image.height, image.encoding, image.step), (142, 145, "32FC1", 568))
            self.assertLess(len(image.data), 200_000)
            depth = frame.depth
            for metres, value in zip(struct.unpack(f"<{142 * 145}f", image.data),
                                     struct.unpack(f"<{142 * 145}h", depth.data), strict=True):
                if value == depth.untrusted_value:
                    self.assertTrue(math.isnan(metres))
                else:
                    self.assertAlmostEqual(metres, 1e-6 * value, delta=1e-9)
            self.assertEqual((info.width, info.height, info.p[3], info.p[7]), (142, 145, 70.5, 72))
            self.assertAlmostEqual(info.k[0], 1000 / (4 * 0.0413793), places=6)

    def test_points_of_the_contact(self) -> None:
        with Peer() as peer:
            peer.subscribe("rt/left/points", "sensor_msgs/PointCloud2")
            cloud = peer.next("rt/left/points", "sensor_msgs/PointCloud2", lambda one: one.width > 100)
            self.assertEqual([field.name for field in cloud.fields],
                             ["x", "y", "z", "normal_x", "normal_y", "normal_z", "indentation"])
            self.assertEqual(len(cloud.data), 28 * cloud.width)
            points = list(struct.iter_unpack("<7f", cloud.data))
            for x, y, z, *normal, indentation in points:
                self.assertAlmostEqual(math.hypot(*normal), 1, places=4)
                self.assertAlmostEqual(z, -indentation, places=7)
                self.assertGreater(indentation, 0)
            # The ball presses at x = 3.1 mm, y = -1.7 mm of the image's centre.
            self.assertAlmostEqual(sum(p[0] for p in points) / len(points), 3.1e-3, delta=0.4e-3)
            self.assertAlmostEqual(sum(p[1] for p in points) / len(points), -1.7e-3, delta=0.4e-3)
            # Those of a contact that has ended do not stay.
            peer.next("rt/left/points", "sensor_msgs/PointCloud2", lambda one: one.width == 0)

    def test_force_as_a_wrench_and_the_cameras_picture(self) -> None:
        with Peer() as peer:
            peer.subscribe("rt/right/wrench", "geometry_msgs/WrenchStamped")
            peer.subscribe("rt/right/contact", "dtact_msgs/Contact")
            peer.subscribe("rt/right/image_raw/compressed", "sensor_msgs/CompressedImage")
            contact = peer.next("rt/right/contact", "dtact_msgs/Contact", lambda one: one.force > 0.1)
            wrench = peer.next("rt/right/wrench", "geometry_msgs/WrenchStamped",
                               lambda one: ns(one.header.stamp) == ns(contact.header.stamp)).wrench
            self.assertAlmostEqual(wrench.force.z, -contact.force)
            self.assertAlmostEqual(wrench.torque.x, contact.centroid.y * -contact.force)
            self.assertAlmostEqual(wrench.torque.y, -contact.centroid.x * -contact.force)
            picture = peer.next("rt/right/image_raw/compressed", "sensor_msgs/CompressedImage")
            self.assertEqual((picture.format, picture.data[:2], picture.header.frame_id),
                             ("jpeg", b"\xff\xd8", "right_camera_optical"))

    def test_object_of_dtact_perceive(self) -> None:
        with Peer() as peer:
            peer.subscribe("rt/left/object_pose", "geometry_msgs/PoseStamped")
            peer.subscribe("rt/left/object_pose/tracking", "dtact_msgs/ObjectTracking")
            peer.subscribe("rt/left/recognition", "dtact_msgs/Recognition")
            pose = peer.next("rt/left/object_pose", "geometry_msgs/PoseStamped")
            turn = pose.pose.orientation
            self.assertAlmostEqual(math.hypot(turn.x, turn.y, turn.z, turn.w), 1)
            tracking = peer.next("rt/left/object_pose/tracking", "dtact_msgs/ObjectTracking",
                                 lambda one: one.header.stamp.sec >= pose.header.stamp.sec and one.valid)
            self.assertIn(tracking.tracking, ("started", "tracked", "recovered"))
            recognition = peer.next("rt/left/recognition", "dtact_msgs/Recognition", lambda one: one.presses > 0)
            self.assertIn(recognition.verdict, ("known", "unknown", "unsure", "too_shallow", "cut_off"))
            self.assertEqual(len(recognition.candidates), len(recognition.probabilities))
            self.assertEqual(list(recognition.probabilities), sorted(recognition.probabilities, reverse=True))
            self.assertIn("ball", recognition.candidates)
            self.assertEqual(recognition.header.frame_id, "left_surface_optical")

    def test_frames_clocks_and_diagnostics(self) -> None:
        with Peer() as peer:
            peer.subscribe("rt/tf_static", "tf2_msgs/TFMessage", "latched")
            peer.subscribe("rt/left/clock_mapping", "dtact_msgs/ClockMapping", "latched")
            peer.subscribe("rt/diagnostics", "diagnostic_msgs/DiagnosticArray", "reliable")
            transforms = peer.next("rt/tf_static", "tf2_msgs/TFMessage").transforms
            self.assertEqual([(one.header.frame_id, one.child_frame_id) for one in transforms],
                             [("left_link", "left_surface_optical"), ("right_link", "right_surface_optical")])
            mapping = peer.next("rt/left/clock_mapping", "dtact_msgs/ClockMapping")
            here = time.clock_gettime_ns(time.CLOCK_REALTIME) - time.clock_gettime_ns(time.CLOCK_MONOTONIC)
            self.assertLess(abs(mapping.offset_ns - here), mapping.error_ns + 1_000_000)
            self.assertLess(mapping.error_ns, 20_000_000)
            first = peer.next("rt/diagnostics", "diagnostic_msgs/DiagnosticArray").status
            self.assertLess(max(one.level for one in first), 2, "nothing is wrong before a status has come")
            states = peer.next("rt/diagnostics", "diagnostic_msgs/DiagnosticArray",
                               lambda one: all(len(status.values) > 0 for status in one.status)).status
            self.assertEqual([one.name for one in states], ["left: dtactd", "right: dtactd"])
            values = {one.key: one.value for one in states[0].values}
            self.assertEqual(values["state"], "serving")

    def test_health_flags_with_their_fixes(self) -> None:
        with Peer() as peer, Client(right.port) as client:
            peer.subscribe("rt/diagnostics", "diagnostic_msgs/DiagnosticArray", "reliable")
            client.call(set_light=M.SetLight(brightness=0))
            state = peer.next("rt/diagnostics", "diagnostic_msgs/DiagnosticArray", lambda one: any(
                value.key == "health: image_dark" for value in one.status[1].values)).status[1]
            flags = {value.key: value.value for value in state.values}
            client.call(set_light=M.SetLight(brightness=255))
            self.assertEqual(state.level, 1)
            self.assertIn("dtactctl led --brightness 255", flags["health: image_dark"])
            self.assertIn(flags["health: image_dark"], state.message)

    def test_temperature_of_the_board(self) -> None:
        with Peer() as peer:
            peer.subscribe("rt/right/temperature", "sensor_msgs/Temperature")
            if "unshare" not in right.command:
                self.skipTest("no namespace can be made here")
            came = peer.next("rt/right/temperature", "sensor_msgs/Temperature")
            self.assertEqual((came.header.frame_id, came.temperature, came.variance), ("right_board", 48.3, 0))

    def test_nothing_is_asked_of_the_daemon_that_nobody_subscribes_to(self) -> None:
        def sent() -> int:
            with Client(left.port) as client:
                time.sleep(1)
                return next(one.sent for one in client.call(get_status=M.GetStatus()).status.clients
                            if one.program.startswith("dtact-dds"))
        with Peer() as peer:
            peer.subscribe("rt/left/contact", "dtact_msgs/Contact")
            peer.next("rt/left/contact", "dtact_msgs/Contact")
            before = sent()
            self.assertGreater(sent(), before)
            peer.say("unsubscribe", "rt/left/contact")
            # On a busy machine it takes a while until the bridge hears of it.
            deadline = time.monotonic() + 60
            while sent() != sent():
                self.assertLess(time.monotonic(), deadline, "frames are sent still")


class Graph(unittest.TestCase):
    def test_nodes_own_their_topics(self) -> None:
        with Peer() as peer:
            peer.subscribe("ros_discovery_info", "rmw_dds_common/ParticipantEntitiesInfo", "latched")
            info = peer.next("ros_discovery_info", "rmw_dds_common/ParticipantEntitiesInfo")
            nodes = {(node.node_namespace, node.node_name): node for node in info.node_entities_info_seq}
            self.assertEqual(set(nodes), {("/", "dtact_dds"), ("/left", "dtact"), ("/right", "dtact")})
            self.assertEqual(peer.until(
                lambda: [words[2] for words in peer.found
                         if words[0] == "participant" and words[1] == bytes(info.gid.data).hex()], "participant"),
                ["enclave=/;"])
            for topic, owner in (("rt/left/contact", "/left"), ("rt/right/contact", "/right"), ("rt/tf_static", "/")):
                words = peer.until(lambda: peer.writers().get(topic), topic)
                node = nodes[owner, "dtact" if owner != "/" else "dtact_dds"]
                self.assertIn(words[3], [bytes(gid.data).hex() for gid in node.writer_gid_seq])
            hashes = {words[2]: words[4] for words in peer.writers().values()}
            self.assertEqual(hashes["sensor_msgs::msg::dds_::Image_"],
                             f"typehash={make_types.type_hash('sensor_msgs/Image', MESSAGES)};")

    def test_humble(self) -> None:
        other = Dds("humble", "--humble", "--daemon", f"old=127.0.0.1:{left.port}")
        with Peer() as peer:
            peer.subscribe("ros_discovery_info", "rmw_dds_common/ParticipantEntitiesInfo", "latched")
            end = time.monotonic() + PATIENCE
            while True:
                _, payload = peer.samples["ros_discovery_info"].get(timeout=max(0.01, end - time.monotonic()))
                if b"/old" in payload:
                    break
            info = Reader(payload).message("rmw_dds_common_humble/ParticipantEntitiesInfo")
            self.assertEqual([node.node_name for node in info.node_entities_info_seq], ["dtact_dds", "dtact"])
            self.assertEqual(bytes(info.gid.data[16:]), bytes(8))
        self.assertEqual(other.stop(), 0)

    def test_names_that_ros_refuses(self) -> None:
        for name in ("2nd", "a-b", "a__b", "a_"):
            done = subprocess.run([os.environ["DTACT_DDS"], "--daemon", f"{name}=127.0.0.1"], capture_output=True,
                                  text=True)
            self.assertEqual(done.returncode, 1)
            self.assertIn("ROS 2 allows letters", done.stderr)


class Recording(unittest.TestCase):
    def test_foxglove_reads_it(self) -> None:
        if why := install_npm_packages(NODE):
            self.skipTest(why)
        bag = HERE / "bag.mcap"
        arguments = ["--daemon", f"one=127.0.0.1:{left.port}", "--daemon", f"two=127.0.0.1:{right.port}", "--record", str(bag)]
        program = Dds("record", *arguments)
        time.sleep(4)
        self.assertEqual(program.stop(), 0)
        self.assertRegex(program.text(), r"\d+ messages recorded")
        by_dtactctl = HERE / "by_dtactctl.mcap"
        subprocess.run([os.environ["DTACTCTL"], "--port", str(left.port), "record", "--ros2", "--seconds", "1.5", "-o",
                        by_dtactctl], env={**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)}, check=True, capture_output=True)
        self.assertIn(b"sensor_msgs/msg/Image", by_dtactctl.read_bytes())
        again = subprocess.run([os.environ["DTACT_DDS"], "--domain", str(DOMAIN), *arguments], capture_output=True, text=True)
        self.assertEqual(again.returncode, 1)
        self.assertIn("bag.mcap", again.stderr)
        read = subprocess.run(["node", SOURCE / "tests/e2e/dds/read_bag.mjs", bag], cwd=NODE, capture_output=True,
                              text=True, check=True)
        messages = [json.loads(line) for line in read.stdout.splitlines()]
        by_topic = collections.defaultdict(list)
        for message in messages:
            self.assertEqual((message["profile"], message["encoding"]), ("ros2", "cdr"))
            # Then the profiles are in rmw's numbers: 1 is transient local.
            self.assertEqual(message["rosbag2"], {"name": "rosbag2", "serialized_metadata": ""})
            latched = message["topic"] == "/tf_static" or message["topic"].endswith("/clock_mapping")
            self.assertIn(f"  durability: {1 if latched else 2}\n", message["qos"])
            kept = 10 if message["topic"] == "/diagnostics" else 1
            self.assertIn(f"- history: 1\n  depth: {kept}\n  reliability: 1\n", message["qos"])
            by_topic[message["topic"]].append(message)
        self.assertEqual(len(by_topic["/tf_static"]), 1, "of this program alone")
        for name in ("one", "two"):
            contacts = by_topic[f"/{name}/contact"]
            self.assertEqual(contacts[0]["type"], "dtact_msgs/msg/Contact")
            images = by_topic[f"/{name}/indentation/image"]
            stamps = [[tuple(one["content"]["header"]["stamp"].values()) for one in all] for all in (contacts, images)]
            first, last = stamps[1][0], stamps[1][-1]
            self.assertEqual([one for one in stamps[0] if first <= one <= last], stamps[1], "none is left out")
            self.assertGreater(len(images), 60)
            image = images[-1]
            self.assertEqual(image["bytes"], image["content"]["step"] * image["content"]["height"])
            self.assertEqual(image["content"]["header"]["frame_id"], f"{name}_surface_optical")
        self.assertEqual([one["child_frame_id"] for one in by_topic["/tf_static"][0]["content"]["transforms"]],
                         ["one_surface_optical", "two_surface_optical"])
        self.assertEqual(by_topic["/two/image_raw/compressed"][0]["content"]["format"], "jpeg")
        self.assertGreater(len(by_topic["/diagnostics"]), 0)


class Commands(unittest.TestCase):
    def setUp(self) -> None:
        self.answered: set[str] = set()

    def ask(self, peer: Peer, topic: str, name: str, **fields):
        if topic not in self.answered:
            self.answered.add(topic)
            peer.subscribe(f"rt/right/{topic}/result", "dtact_msgs/Result", "reliable")
            time.sleep(2)  # Until they know of each other: answers are not kept for those that come later.
        peer.say("publish", f"rt/right/{topic}", make_types.dds_name(name), encode(name, **fields))
        return peer.next(f"rt/right/{topic}/result", "dtact_msgs/Result", lambda one: one.id == fields["id"])

    def test_they_are_answered_with_their_ids(self) -> None:
        with Peer() as peer, Client(right.port) as client:
            done = self.ask(peer, "resolution", "dtact_msgs/Resolution", id=4711, resolution="half")
            self.assertEqual((done.ok, done.message), (True, ""))
            self.assertEqual(client.call(get_status=M.GetStatus()).status.reconstruction.resolution, "half")
            refused = self.ask(peer, "led", "dtact_msgs/Led", id=7, brightness=256, scheme="", leds=[])
            self.assertFalse(refused.ok)
            self.assertIn("256", refused.message)
            self.assertTrue(self.ask(peer, "led", "dtact_msgs/Led", id=8, brightness=200, scheme="",
                                     leds=[(1.0, 0.5, 0.0, 1.0)] * 8).ok)
            light = client.call(get_status=M.GetStatus()).status.light
            self.assertEqual((light.brightness, light.leds[7].r, light.leds[7].g, light.leds[7].b),
                             (200, 255, 128, 0))
            self.assertTrue(self.ask(peer, "led", "dtact_msgs/Led", id=9, brightness=255, scheme="all", leds=[]).ok)
            self.assertTrue(self.ask(peer, "rezero", "dtact_msgs/Rezero", id=10, force=True).ok)

    def test_read_only_has_no_commands(self) -> None:
        other = Dds("read_only", "--read-only", "--daemon", f"only=127.0.0.1:{left.port}")
        with Peer() as peer:
            peer.until(lambda: "rt/only/contact" in peer.writers(), "writer")
            time.sleep(1)
            self.assertEqual([words for words in peer.found if words[0] == "reader" and "/only/" in words[1]], [])
        self.assertEqual(other.stop(), 0)


class Network(unittest.TestCase):
    def test_no_packet_of_another_machine_comes_in(self) -> None:
        sockets = [line.split() for line in subprocess.run(["ss", "-Hulpn"], capture_output=True, text=True,
                                                           check=True).stdout.splitlines()
                   if f"pid={dds.process.pid}," in line]
        self.assertGreater(len(sockets), 2)
        # Those that are bound to an address only send.
        self.assertGreater(sum(words[3].startswith("0.0.0.0%lo:") for words in sockets), 1)
        self.assertEqual([words for words in sockets if words[3].startswith(("0.0.0.0:", "*:", "[::]:"))], [])

    def test_without_privileges_as_the_service_runs(self) -> None:
        drop = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--bounding-set=-all", "--inh-caps=-all"]
        if subprocess.run([*drop, "true"], capture_output=True).returncode != 0:
            self.skipTest("giving up privileges needs root")
        program = HERE / "dtact-dds"
        shutil.copy(os.environ["DTACT_DDS"], program)
        HERE.chmod(0o755)
        with Peer() as peer:
            other = Program([*drop, str(program), "--domain", str(DOMAIN), "--daemon", f"plain=127.0.0.1:{left.port}"],
                            HERE / "plain.log", r"on DDS domain (\d+)")
            peer.until(lambda: "rt/plain/contact" in peer.writers(), "writer")
            self.assertEqual(other.stop(), 0)

    def test_an_address_that_comes_later(self) -> None:
        alone = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
        if subprocess.run([*alone, "true"], capture_output=True).returncode != 0:
            self.skipTest("a network namespace needs root")
        program = Program([*alone, os.environ["DTACT_DDS"], "--daemon", "left=127.0.0.1:1"], HERE / "alone.log",
                          r"on DDS domain (\d+)")
        inside = ["nsenter", f"--net=/proc/{program.process.pid}/ns/net", "ip"]
        for words in ("link add v0 type veth peer name v1", "addr add 192.0.2.77/24 dev v0", "link set v0 up"):
            subprocess.run([*inside, *words.split()], check=True)
        end = time.monotonic() + PATIENCE
        while program.text().count("on DDS domain") < 2 and time.monotonic() < end:
            time.sleep(0.1)
        self.assertIn("addresses have changed", program.text())
        self.assertEqual(program.text().count("on DDS domain"), 2)
        self.assertEqual(program.stop(), 0)

    def test_maps_pass_a_network_that_loses_and_delays_packets(self) -> None:
        # Before: datagrams in parts, which Linux gives up when others overtake them, and of which the rest of those
        # that lost one filled its memory, so that no map arrived from four sensors.
        if not lossy.usable():
            self.skipTest("a network namespace and a TAP device need root")
        with lossy.Network(2) as network:
            network.set(loss=0.005, delay_ms=2)
            there = network.hosts[1]
            daemon = Daemon(HERE, "far", f"calibration={SOURCE}/config/simulated", within=there)
            program = Dds("far-dds", "--daemon", f"far=127.0.0.1:{daemon.port}", "--interface", lossy.DEVICE,
                          within=there)
            with Peer(within=network.hosts[0]) as peer:
                peer.subscribe("rt/far/indentation/image", "sensor_msgs/Image")
                for _ in range(20):
                    peer.next("rt/far/indentation/image", "sensor_msgs/Image")
            passed, lost, _, parts = network.counts()
            self.assertEqual((program.stop(), daemon.stop()), (0, 0))
        self.assertGreater(passed, 20 * 60)
        self.assertGreater(lost, 0)
        self.assertEqual(parts, 0)

    def test_an_interface_whose_address_goes(self) -> None:
        # Before: nothing was sent any more once it had another one, and SIGTERM did not end the program.
        alone = ["unshare", "--net", "sh", "-c", "ip link set lo up && ip link add v0 type veth peer name v1 && "
                 "ip addr add 192.0.2.77/24 dev v0 && ip link set v0 up && ip link set v1 up && exec \"$@\"", "sh"]
        if subprocess.run([*alone, "true"], capture_output=True).returncode != 0:
            self.skipTest("a network namespace needs root")
        program = Program([*alone, os.environ["DTACT_DDS"], "--daemon", "left=127.0.0.1:1", "--interface", "v0"],
                          HERE / "interface.log", r"on DDS domain (\d+)")
        inside = ["nsenter", f"--net=/proc/{program.process.pid}/ns/net", "ip", "addr"]
        subprocess.run([*inside, "del", "192.0.2.77/24", "dev", "v0"], check=True)
        time.sleep(2.5)
        self.assertEqual(program.text().count("on DDS domain"), 1, "there is no address to join with")
        subprocess.run([*inside, "add", "192.0.2.78/24", "dev", "v0"], check=True)
        end = time.monotonic() + PATIENCE
        while program.text().count("on DDS domain") < 2 and time.monotonic() < end:
            time.sleep(0.1)
        self.assertEqual(program.text().count("on DDS domain"), 2, program.text()[-2000:])
        subprocess.run([*inside, "del", "192.0.2.78/24", "dev", "v0"], check=True)
        time.sleep(1.5)
        self.assertEqual(program.stop(), 0)


class Hostile(unittest.TestCase):
    def test_other_types_and_damaged_payloads_and_a_flood_of_participants(self) -> None:
        with Peer() as peer, Peer() as other, Client(right.port) as client:
            peer.say("publish", "rt/right/contact", "dtact_msgs::msg::dds_::Contact_", "00010000ffffffff")
            peer.say("publish", "rt/right/rezero", "std_msgs::msg::dds_::String_", "00010000ffffffff")
            rezero = make_types.dds_name("dtact_msgs/Rezero")
            for payload in ("00010000", "0001000001", "00030000" + "ff" * 64):
                other.say("publish", "rt/right/rezero", rezero, payload)
            led = make_types.dds_name("dtact_msgs/Led")
            other.say("publish", "rt/right/led", led, "00010000" + "00" * 12 + "ffffffff" + "41" * 40)
            other.say("participants", "12")
            other.subscribe("rt/right/points", "std_msgs/Header")
            for number in range(300):
                other.say("publish", "rt/right/resolution", make_types.dds_name("dtact_msgs/Resolution"),
                          encode("dtact_msgs/Resolution", id=number, resolution="x" * 5000))
            peer.subscribe("rt/right/indentation/image", "sensor_msgs/Image")
            for _ in range(30):
                peer.next("rt/right/indentation/image", "sensor_msgs/Image")
            status = client.call(get_status=M.GetStatus()).status
            self.assertEqual(status.state, E.STATE_SERVING)
            self.assertEqual(dds.text().count("right is away"), 0, dds.text())

    def test_one_who_does_not_read_holds_nobody(self) -> None:
        with Peer() as peer, Peer() as stalled:
            for one, qos in ((peer, "sensor"), (stalled, "reliable")):
                one.subscribe("rt/right/indentation/image", "sensor_msgs/Image", qos)
                one.subscribe("rt/right/contact", "dtact_msgs/Contact", qos)
                one.next("rt/right/indentation/image", "sensor_msgs/Image")
            stalled.process.send_signal(signal.SIGSTOP)
            try:
                time.sleep(1)
                for _ in range(5):  # a busy machine loses more for a while
                    first = peer.next("rt/right/contact", "dtact_msgs/Contact",
                                      lambda _: peer.samples["rt/right/contact"].empty())
                    time.sleep(4)
                    last = first
                    received = 0
                    while not peer.samples["rt/right/contact"].empty():
                        last = peer.next("rt/right/contact", "dtact_msgs/Contact")
                        received += 1
                    if received > 0.8 * (last.frame_number - first.frame_number):
                        break
            finally:
                stalled.process.send_signal(signal.SIGCONT)
            self.assertGreater(received, 0.8 * (last.frame_number - first.frame_number))
            self.assertGreater(ns(last.header.stamp) - ns(first.header.stamp), 3_000_000_000)

    def test_two_domains_are_apart(self) -> None:
        with Peer(DOMAIN + 1) as peer:
            time.sleep(3)
            self.assertEqual([words for words in peer.found if words[0] == "participant"], [])


class Restart(unittest.TestCase):
    def test_a_daemon_that_comes_back(self) -> None:
        with Peer() as peer:
            peer.subscribe("rt/left/contact", "dtact_msgs/Contact")
            peer.subscribe("rt/diagnostics", "diagnostic_msgs/DiagnosticArray", "reliable")
            peer.next("rt/left/contact", "dtact_msgs/Contact")
            left.stop()
            away = peer.next("rt/diagnostics", "diagnostic_msgs/DiagnosticArray", lambda one: one.status[0].level == 2)
            self.assertIn(str(left.port), away.status[0].message)
            left.restart()
            came = time.clock_gettime_ns(time.CLOCK_REALTIME)
            peer.next("rt/left/contact", "dtact_msgs/Contact", lambda one: ns(one.header.stamp) > came)


if __name__ == "__main__":
    unittest.main()
