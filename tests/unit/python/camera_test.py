"""LeRobot's camera shape: the names, arguments and exceptions that its robots and recorder use."""
import abc
import importlib
import inspect
import os
import pathlib
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
        # Untouched, 1 mm of 2, not to be believed, hardly pressed.
        self.assertEqual(picture.tolist(), [[[0, 0, 0], [182, 55, 121]], [[0, 0, 0], [4, 1, 6]]])

    def test_connect_completes_what_was_left_out(self):
        camera = self.camera()
        self.assertTrue(camera.is_connected)
        self.assertEqual((camera.width, camera.height, camera.fps), (2, 2, 60))
        camera.disconnect()
        self.assertFalse(camera.is_connected)
        camera.connect()
        self.assertEqual(camera.read_latest_depth(10_000).shape, (2, 2, 1))

    def test_sizes_and_rates(self):
        self.camera(width=1, height=1, fps=20)
        sent = self.daemon.requests[-1].subscribe
        self.assertEqual((sent.decimation, sent.depth_hz), (2, 20))
        with self.assertRaisesRegex(ValueError, "it gives 2 × 2, 1 × 1"):
            dtact.Camera(self.daemon.address, width=3, height=2).connect()

    def test_async_read_gives_each_frame_once(self):
        camera = self.camera()
        camera.async_read(10_000)
        camera.async_read_depth(10_000)  # It counts for itself.
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
        with self.assertRaisesRegex(RuntimeError, "no depth has come yet"):
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
        # As dtactctl find prints it.
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
        program.write_text("#!/bin/sh\necho dtactctl: nobody >&2; exit 4\n")
        with mock.patch("dtact.camera.Client", side_effect=dtact.ConnectionError("nobody")):
            self.assertEqual(dtact.Camera.find_cameras(), [])


class Colours(unittest.TestCase):
    def test_scale(self):
        depth = np.array([[-1, 0, 2, 3, np.nan]], np.float32)
        self.assertEqual(colour(depth).tolist(),
                         [[[0, 0, 0], [0, 0, 0], [252, 253, 191], [252, 253, 191], [0, 0, 0]]])


class Plugin(unittest.TestCase):
    """lerobot_camera_dtact on a stand-in of the parts of LeRobot that it touches."""

    def test_type_and_class(self):
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

        modules = {name: types.ModuleType(name) for name in
                   ["lerobot", "lerobot.cameras", "lerobot.cameras.camera", "lerobot.cameras.configs"]}
        modules["lerobot.cameras.camera"].Camera = Camera
        modules["lerobot.cameras.configs"].CameraConfig = CameraConfig
        with mock.patch.dict(sys.modules, modules):
            plugin = importlib.import_module("lerobot_camera_dtact")
        config_class = CameraConfig.choices["dtact"]
        self.assertIs(config_class, plugin.DtactCameraConfig)
        # LeRobot looks for the device's class under the name of the configuration's, without
        # "Config", in the package of its module.
        package = sys.modules[config_class.__module__.rpartition(".")[0]] \
            if config_class.__module__ in sys.modules else plugin
        camera_class = getattr(package, config_class.__name__.removesuffix("Config"))
        self.assertIs(camera_class, plugin.DtactCamera)
        self.assertEqual([f.name for f in fields(config_class)],
                         ["fps", "width", "height", "address", "use_rgb", "use_depth", "token_file",
                          "fingerprint"])
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(1)]
            camera = camera_class(config_class(address=daemon.address, fps=30))
            self.assertIsInstance(camera, Camera)
            camera.connect()
            self.assertEqual(camera.read_latest_depth(10_000).shape, (2, 2, 1))
            self.assertEqual((camera.fps, camera.width), (30, 2))
            camera.disconnect()

    def test_readme_says_how_micrometres_are_kept(self):
        readme = pathlib.Path(__file__).parents[3] / "clients/python/lerobot/README.md"
        text = readme.read_text()
        for setting in ("depth_min=0 ", "depth_max=0.004 ", "use_log=false"):
            self.assertIn(f"--dataset.depth_encoder.{setting}", text)


if __name__ == "__main__":
    unittest.main()
