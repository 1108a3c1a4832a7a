"""LeRobot's camera shape: the names, arguments and exceptions that its robots and recorder use."""
import abc
import importlib
import importlib.metadata
import inspect
import os
import pathlib
import re
import sys
import tempfile
import threading
import time
import types
import unittest
from dataclasses import dataclass, fields
from unittest import mock

import numpy as np

import dtact
from dtact.camera import colour
from fake_daemon import FakeDaemon, frame

# Facts of huggingface/lerobot: src/lerobot/cameras/camera.py (commit 0cd71c3) and, for the depth and
# for the age of the newest frame, its cameras as of pull request 3644 (release 0.6).
ATTRIBUTES = ["fps", "width", "height", "use_rgb", "use_depth"]
LEROBOT = pathlib.Path(__file__).parents[3] / "clients/python/lerobot"
METHODS = {
    "find_cameras": [],
    "connect": [("warmup", True)],
    "read": [],
    "async_read": [("timeout_ms", 200)],
    "read_latest": [("max_age_ms", 500)],
    "disconnect": [],
    "read_depth": [],
    "async_read_depth": [("timeout_ms", 200)],
    "read_latest_depth": [("max_age_ms", 500)],
}


class Shape(unittest.TestCase):
    def test_methods_and_arguments(self):
        for name, wanted in METHODS.items():
            parameters = inspect.signature(getattr(dtact.Camera, name)).parameters
            found = [(p.name, p.default) for p in parameters.values() if p.name != "self"]
            self.assertEqual(found, wanted, name)

    def test_find_cameras_is_static_and_is_connected_a_property(self):
        self.assertIsInstance(inspect.getattr_static(dtact.Camera, "find_cameras"), staticmethod)
        self.assertIsInstance(inspect.getattr_static(dtact.Camera, "is_connected"), property)

    def test_attributes(self):
        camera = dtact.Camera("nowhere", fps=30)
        self.assertEqual([getattr(camera, name) for name in ATTRIBUTES], [30, None, None, True, True])
        self.assertFalse(camera.is_connected)

    def test_lerobot_is_not_imported(self):
        self.assertEqual([name for name in sys.modules if name.startswith("lerobot.")], [])


class Reading(unittest.TestCase):
    def setUp(self):
        self.daemon = self.enterContext(FakeDaemon())
        self.daemon.pushed = [frame(1)]

    def camera(self, **settings):
        return self.enterContext(dtact.Camera(self.daemon.address, **settings))

    def wait_for(self, camera, sequence):
        until = time.monotonic() + 10
        while camera._newest.sequence != sequence and time.monotonic() < until:
            time.sleep(0.01)

    def test_depth_is_metres_and_has_no_nan(self):
        camera = self.camera()
        for depth in (camera.read_latest_depth(10_000), camera.async_read_depth(10_000)):
            self.assertEqual((depth.shape, depth.dtype), ((2, 2, 1), np.float32))
            np.testing.assert_array_equal(
                depth[:, :, 0], np.array([[0, 1], [0, 0.025]], np.float32) * np.float32(1e-3))

    def test_picture(self):
        camera = self.camera()
        picture = camera.read_latest(10_000)
        self.assertEqual((picture.shape, picture.dtype), ((2, 2, 3), np.uint8))
        # No contact, 1 mm of 2, not to be trusted, hardly pressed.
        self.assertEqual(picture.tolist(), [[[0, 0, 0], [182, 55, 121]], [[0, 0, 0], [4, 1, 6]]])

    def test_connect_completes_what_was_left_out(self):
        camera = self.camera()
        self.assertTrue(camera.is_connected)
        self.assertEqual((camera.width, camera.height, camera.fps), (2, 2, 60))
        camera.disconnect()
        self.assertFalse(camera.is_connected)
        camera.connect()
        self.assertEqual(camera.read_latest_depth(10_000).shape, (2, 2, 1))

    def test_connect_completes_anew_what_was_left_out(self):
        def status(request, reply):
            reply.status.state, reply.status.camera.fps = 3, 30
            reply.status.calibration.width = reply.status.calibration.height = 16
        cameras = [self.camera(), self.camera(width=2, height=2)]
        self.daemon.answers["get_status"] = status
        for camera in cameras:
            camera.disconnect()
        cameras[0].connect()
        self.assertEqual((cameras[0].width, cameras[0].height, cameras[0].fps), (16, 16, 30))
        with self.assertRaisesRegex(ValueError, "2 × 2 is no size of this daemon's depth"):
            cameras[1].connect()
        cameras[1].width = cameras[1].height = 4
        cameras[1].connect()
        self.assertEqual((cameras[1].width, cameras[1].fps), (4, 30))

    def test_sizes_and_rates(self):
        self.camera(width=1, height=1, fps=20)
        sent = self.daemon.requests[-1].subscribe
        self.assertEqual((sent.decimation, sent.depth_hz), (2, 20))
        with self.assertRaisesRegex(ValueError, "it gives 2 × 2, 1 × 1"):
            dtact.Camera(self.daemon.address, width=3, height=2).connect()

    def test_of_auto_it_takes_what_always_comes(self):
        # Before: the full size was promised, and arrays of a quarter of it came.
        def status(request, reply):
            reply.status.state, reply.status.camera.fps = 3, 60
            reply.status.calibration.width, reply.status.calibration.height = 16, 8
            reply.status.reconstruction.resolution = "auto"
        self.daemon.answers["get_status"] = status
        camera = self.camera()
        self.assertEqual((camera.width, camera.height), (4, 2))
        self.assertEqual(self.daemon.requests[-1].subscribe.decimation, 4)
        with self.assertRaisesRegex(ValueError, "16 × 8 is no size of this daemon's depth: it gives 4 × 2"):
            dtact.Camera(self.daemon.address, width=16, height=8).connect()

    def test_a_rate_that_the_daemon_does_not_give(self):
        with self.assertRaisesRegex(ValueError, "100 frames a second were asked for, and the daemon's "
                                    "camera delivers 60"):
            dtact.Camera(self.daemon.address, fps=100).connect()
        self.assertEqual(self.camera(fps=62).fps, 62)  # As good as the measured rate.
        for fps in (0, -3):
            with self.assertRaisesRegex(ValueError, f"fps is {fps}: it has to be above 0"):
                dtact.Camera(self.daemon.address, fps=fps)

    def test_no_stream_at_all(self):
        with self.assertRaisesRegex(ValueError, "nothing would be read"):
            dtact.Camera(use_rgb=False, use_depth=False)

    def test_the_cameras_own_picture(self):
        message = frame(1)
        message.frame.ClearField("depth")
        luma = message.frame.luma
        luma.encoding, luma.width, luma.height, luma.data = 1, 3, 2, bytes(range(6))
        self.daemon.pushed = [message]
        camera = self.camera(picture="camera", use_depth=False, fps=20)
        sent = self.daemon.requests[-1].subscribe
        self.assertEqual((sent.depth, sent.luma, sent.luma_hz), (0, 1, 20))
        self.assertEqual((camera.width, camera.height), (3, 2))
        self.assertEqual(camera.read_latest(10_000).tolist(),
                         [[[v] * 3 for v in row] for row in ((0, 1, 2), (3, 4, 5))])
        with self.assertRaisesRegex(ValueError, "2 × 2 is no size of this daemon's camera's image: it "
                                    "gives 3 × 2"):
            dtact.Camera(self.daemon.address, picture="camera", use_depth=False, width=2,
                         height=2).connect()

    def test_pictures_that_cannot_be(self):
        with self.assertRaisesRegex(ValueError, "set use_depth to False"):
            dtact.Camera(picture="camera")
        with self.assertRaisesRegex(ValueError, '"depth" or "camera"'):
            dtact.Camera(picture="jpeg", use_depth=False)

    def test_after_a_fork(self):
        camera = self.camera()
        child = os.fork()
        if child == 0:
            try:
                camera.read_latest()
            except ConnectionError as e:
                os._exit(0 if "connect() after the fork" in str(e) else 2)
            os._exit(1)
        self.assertEqual(os.waitpid(child, 0)[1], 0)
        camera.read_latest(60_000)

    def test_async_read_gives_each_frame_once(self):
        camera = self.camera()
        camera.async_read(10_000)
        camera.async_read_depth(10_000)  # It has its own position.
        with self.assertRaises(TimeoutError):
            camera.async_read(timeout_ms=50)
        self.daemon.push(frame(2))
        camera.async_read(10_000)

    def test_read_waits_for_the_next(self):
        camera = self.camera()
        self.daemon.push(frame(2, values=(5, 5, 5, 5)))
        self.wait_for(camera, 2)
        threading.Timer(0.1, lambda: self.daemon.push(frame(3, values=(7,) * 4))).start()
        self.assertEqual(camera.read_depth()[0, 0, 0], np.float32(7e-3) * np.float32(1e-3))

    def test_an_old_frame_is_not_the_latest(self):
        camera = self.camera()
        time.sleep(0.05)
        with self.assertRaisesRegex(TimeoutError, "ms ago, at most 10 were asked for"):
            camera.read_latest(max_age_ms=10)
        camera.read_latest(max_age_ms=60_000)

    def test_no_frame_yet(self):
        self.daemon.pushed = []
        camera = dtact.Camera(self.daemon.address)
        camera.connect(warmup=False)
        with self.assertRaisesRegex(RuntimeError, "no frame has come yet"):
            camera.read_latest_depth()
        camera.disconnect()

    def test_what_was_not_asked_for(self):
        camera = self.camera(use_depth=False)
        camera.read_latest(10_000)
        with self.assertRaisesRegex(RuntimeError, "use_depth=False"):
            camera.read_latest_depth()
        with self.assertRaisesRegex(RuntimeError, "use_depth=False"):
            camera.async_read_depth()

    def test_not_connected(self):
        camera = dtact.Camera(self.daemon.address)
        for call in (camera.read, camera.async_read, camera.read_latest, camera.read_depth,
                     camera.async_read_depth, camera.read_latest_depth, camera.disconnect):
            self.assertRaises(ConnectionError, call)
        camera.connect()
        with self.assertRaisesRegex(ConnectionError, "already connected"):
            camera.connect()
        camera.disconnect()

    def test_a_connection_that_breaks(self):
        camera = self.camera()
        camera.async_read(10_000)
        self.daemon.drop()
        with self.assertRaisesRegex(ConnectionError, "ended the connection"):
            camera.async_read(10_000)
        self.assertFalse(camera.is_connected)

    def test_connects_again_after_a_connection_that_broke(self):
        camera = self.camera()
        self.daemon.drop()
        with self.assertRaisesRegex(ConnectionError, "ended the connection"):
            camera.read()
        with self.assertRaisesRegex(ConnectionError, "ended the connection"):
            camera.read_latest(max_age_ms=0)
        camera.read_latest(max_age_ms=60_000)
        self.daemon.pushed = [frame(9)]
        camera.connect()
        self.assertTrue(camera.is_connected)
        self.assertEqual(camera._newest.sequence, 9)
        camera.read_latest(max_age_ms=60_000)

    def test_the_reason_where_no_frame_came(self):
        self.daemon.pushed = []
        camera = dtact.Camera(self.daemon.address)
        camera.connect(warmup=False)
        self.daemon.drop()
        with self.assertRaisesRegex(ConnectionError, "ended the connection"):
            camera.read()
        with self.assertRaisesRegex(ConnectionError, "ended the connection"):
            camera.read_latest()
        camera.disconnect()

    def test_find_cameras(self):
        here = {"name": "dtact", "type": "dtact", "id": "127.0.0.1", "serial": "",
                "default_stream_profile": {"width": 2, "height": 2, "fps": 0.0}}
        folder = self.enterContext(tempfile.TemporaryDirectory())
        self.enterContext(mock.patch.dict(os.environ, {"PATH": f"{folder}:/usr/bin:/bin"}))
        with mock.patch("dtact.camera.Client", lambda **_: dtact.Client(self.daemon.address)):
            self.assertEqual(dtact.Camera.find_cameras(), [here])
        # The output format of dtactctl find.
        program = pathlib.Path(folder, "dtactctl")
        program.write_text("""#!/bin/sh
[ "$*" = "find --json --seconds 1" ] || exit 2
echo '{"name":"a","address":"192.0.2.7","port":7377,"serial":"S1","tls":true}'
echo '{"name":"b","address":"fe80::1","port":7378}'
""")
        program.chmod(0o755)
        with mock.patch("dtact.camera.Client", side_effect=dtact.ConnectionError("nobody")):
            self.assertEqual(dtact.Camera.find_cameras(), [
                {"name": "a", "type": "dtact", "id": "192.0.2.7:7377", "serial": "S1"},
                {"name": "b", "type": "dtact", "id": "[fe80::1]:7378", "serial": ""}])
        program.write_text("#!/bin/sh\necho dtactctl: none >&2; exit 4\n")
        with mock.patch("dtact.camera.Client", side_effect=dtact.ConnectionError("none")):
            self.assertEqual(dtact.Camera.find_cameras(), [])


class Colours(unittest.TestCase):
    def test_scale(self):
        depth = np.array([[-1, 0, 2, 3, np.nan]], np.float32)
        self.assertEqual(colour(depth).tolist(),
                         [[[0, 0, 0], [0, 0, 0], [252, 253, 191], [252, 253, 191], [0, 0, 0]]])


class LeRobotErrors:
    """Of src/lerobot/utils/errors.py."""

    class DeviceNotConnectedError(ConnectionError):
        pass

    class DeviceAlreadyConnectedError(ConnectionError):
        pass


class Plugin(unittest.TestCase):
    """lerobot_camera_dtact on a stand-in of the parts of LeRobot that it uses."""

    def setUp(self):
        @dataclass(kw_only=True)
        class CameraConfig:
            fps: int | None = None
            width: int | None = None
            height: int | None = None
            choices = {}

            @classmethod
            def register_subclass(cls, name):
                def register(subclass):
                    cls.choices[name] = subclass
                    return subclass
                return register

        class Camera(abc.ABC):
            def __init__(self, config):
                self.fps, self.width, self.height = config.fps, config.width, config.height

        Camera.__abstractmethods__ = frozenset(
            ["is_connected", "find_cameras", "connect", "read", "async_read", "disconnect"])
        self.base = Camera

        modules = {name: types.ModuleType(name) for name in
                   ["lerobot", "lerobot.cameras", "lerobot.cameras.camera", "lerobot.cameras.configs",
                    "lerobot.utils", "lerobot.utils.errors"]}
        modules["lerobot.cameras.camera"].Camera = Camera
        modules["lerobot.cameras.configs"].CameraConfig = CameraConfig
        vars(modules["lerobot.utils.errors"]).update(vars(LeRobotErrors))
        with mock.patch.dict(sys.modules, modules):
            self.plugin = importlib.import_module("lerobot_camera_dtact")
            # LeRobot looks for the device's class under the name of the configuration's, without
            # "Config", in the package of its module.
            self.config_class = CameraConfig.choices["dtact"]
            package = sys.modules[self.config_class.__module__.rpartition(".")[0]]
            self.camera_class = getattr(package, self.config_class.__name__.removesuffix("Config"))

    def test_type_and_class(self):
        self.assertIs(self.config_class, self.plugin.DtactCameraConfig)
        self.assertIs(self.camera_class, self.plugin.DtactCamera)
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(1)]
            camera = self.camera_class(self.config_class(address=daemon.address, fps=30))
            self.assertIsInstance(camera, self.base)
            camera.connect()
            self.assertEqual(camera.read_latest_depth(10_000).shape, (2, 2, 1))
            self.assertEqual((camera.fps, camera.width), (30, 2))
            camera.disconnect()

    def test_the_configuration_can_be_written_and_read(self):
        # draccus takes the types as the fields have them, and knows no names of types.
        self.assertEqual({f.name: f.type for f in fields(self.config_class)}, {
            "fps": int | None, "width": int | None, "height": int | None, "address": str,
            "use_rgb": bool, "use_depth": bool, "picture": str, "token_file": str | None,
            "fingerprint": str | None})

    def test_errors_are_lerobots(self):
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(1)]
            camera = self.camera_class(self.config_class(address=daemon.address))
            for call in (camera.read, camera.read_latest_depth, camera.disconnect):
                self.assertRaises(LeRobotErrors.DeviceNotConnectedError, call)
            camera.connect()
            self.assertRaises(LeRobotErrors.DeviceAlreadyConnectedError, camera.connect)
            camera.read_latest(10_000)
            daemon.drop()
            with self.assertRaisesRegex(LeRobotErrors.DeviceNotConnectedError, "ended the connection"):
                camera.read()
            camera.disconnect()

    def test_a_size_that_videos_cannot_have_is_said(self):
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(1)]
            camera = self.camera_class(self.config_class(address=daemon.address, width=1, height=1))
            with self.assertLogs("lerobot_camera_dtact.camera", "WARNING") as logged:
                camera.connect()
            camera.disconnect()
            self.assertIn("1 × 1 pixels, and LeRobot's default video encoder takes even sizes only",
                          logged.output[0])

    def test_the_name_that_lerobot_looks_for(self):
        from setuptools import __version__
        requires = (LEROBOT / "pyproject.toml").read_text()
        self.assertIn('requires = ["setuptools>=69.0.3"]', requires)
        if tuple(map(int, __version__.split(".")[:2])) < (69, 1):
            self.skipTest(f"setuptools {__version__} takes the underscores out of names")
        names = [d.metadata["Name"] for d in importlib.metadata.distributions()]
        self.assertIn("lerobot_camera_dtact", names)


class PluginReadme(unittest.TestCase):
    """What its lines do, computed."""

    def setUp(self):
        self.text = (LEROBOT / "README.md").read_text()

    def test_the_robot_has_what_lerobot_requires(self):
        line = re.search(r'--robot\.cameras="\{ finger: \{(.*)\} \}"', self.text)[1]
        options = dict(part.split(": ") for part in line.split(", "))
        for required in ("width", "height", "fps"):
            self.assertEqual(int(options[required]) % 2, 0, required)
        self.assertEqual(options["type"], "dtact")

    def test_depth_that_is_recorded_and_read_back(self):
        settings = dict(re.findall(r"--dataset\.(?:depth_encoder\.)?(\w+)=(\S+)", self.text))
        self.assertEqual(settings["use_log"], "false")
        least, most = float(settings["depth_min"]), float(settings["depth_max"])
        depth_m = np.linspace(0.000_123, 0.003_9, 1000, dtype=np.float32)
        # LeRobot's 12-bit codes, and what they are read back as: float32 metres, or uint16 millimetres.
        codes = np.rint((depth_m - least) / (most - least) * 4095).clip(0, 4095).astype(np.uint16)
        metres = least + codes.astype(np.float32) * (most - least) / 4095
        read_back = {"m": metres, "mm": np.rint(metres * 1e3).astype(np.uint16) * 1e-3}

        def error_um(unit):
            return 1e6 * np.abs(read_back[unit] - depth_m).max()

        self.assertLess(error_um(settings["depth_output_unit"]), 0.5)
        self.assertGreater(error_um("mm"), 490)  # Its default.


if __name__ == "__main__":
    unittest.main()
