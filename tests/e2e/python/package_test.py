"""The Python package on dtactd and the simulated sensor."""
import asyncio
import contextlib
import io
import itertools
import json
import os
import pathlib
import re
import runpy
import subprocess
import sys
import threading
import time
import unittest
from unittest import mock

import numpy as np

import dtact
from daemon import SOURCE, Daemon


def setUpModule():
    global daemon
    daemon = Daemon()
    daemon.start()


def tearDownModule():
    daemon.remove()


def path_to_dtactctl():
    folder = pathlib.Path(os.environ["DTACTCTL"]).parent
    return mock.patch.dict(os.environ, {"PATH": f"{folder}:{os.environ['PATH']}"})


def pressed(client):
    """A frame of the scene's press, some tenths of a millimetre deep."""
    until = time.monotonic() + 60
    for f in client.frames():
        if f.contact and f.contact.deepest_mm > 0.3 and f.has_depth:
            return f
        if time.monotonic() > until:
            raise AssertionError("nothing was pressed within a minute")


class Depth(unittest.TestCase):
    def test_is_what_dtactctl_saves(self):
        """The C++ library's decoder, on the same frame, for every encoding."""
        file = daemon.folder / "depth.npy"
        with dtact.connect(daemon.address, kept_frames=100) as s:
            for number, encoding in enumerate(["int16", "predict_zstd"], 1):
                for _ in range(20):
                    s.subscribe(dtact.Subscription(depth=encoding))
                    pressed(s)
                    frames, stop = {}, threading.Event()

                    def collect():
                        for f in s.frames():
                            frames[f.sequence] = f
                            if stop.is_set():
                                return

                    thread = threading.Thread(target=collect)
                    thread.start()
                    report = json.loads(daemon.dtactctl("snapshot", "--json", "-o", str(file)))
                    time.sleep(0.1)
                    stop.set()
                    thread.join()
                    f = frames.get(report["frame"]["sequence"])
                    if f is not None and f.has_depth and np.nanmax(f.depth_mm) > 0.3:
                        break
                else:
                    self.fail(f"{encoding}: no frame was seen by both")
                saved = np.load(file)
                np.testing.assert_array_equal(f.depth_mm, saved)
                self.assertEqual((f.depth_mm.dtype, f.depth_mm.shape), (np.float32, (400, 500)))
                self.assertEqual(f.message.depth.encoding, number)

    def test_what_comes_with_it(self):
        with dtact.connect(daemon.address) as s:
            f = pressed(s)
            self.assertTrue(s.same_machine)
            self.assertLess(abs(time.monotonic() - f.monotonic_s), 2)
            self.assertLess(abs(time.time() - f.time.timestamp()), 2)
            # The ball's deepest point, from the daemon's summary and from the map.
            self.assertAlmostEqual(float(np.nanmax(f.depth_mm)), f.contact.deepest_mm, delta=0.1)
            self.assertGreater(f.contact.area_mm2, 0.5)
            # At full resolution the mask is what the daemon summed over, and looks larger than it is.
            nearer = 1 - f.surface.per_mm * f.contact.threshold_mm
            self.assertAlmostEqual(float(f.contact_mask.sum()) * (nearer * f.mm_per_px)**2,
                                   f.contact.area_mm2, delta=1e-6)
            self.assertTrue(0 < f.uncertainty_mm < 0.2, f.uncertainty_mm)
            self.assertAlmostEqual(f.mm_per_px, 0.0413793, places=6)
            self.assertEqual(f.light.brightness, 255)
            s.subscribe(dtact.Subscription(depth=None, luma=True))
            f = next(f for f in s.frames() if f.has_luma)
            self.assertEqual((f.luma.shape, f.luma.dtype, f.has_depth), ((600, 800), np.uint8, False))

    def test_parts_and_steps(self):
        with dtact.connect(daemon.address) as s:
            s.subscribe(dtact.Subscription(decimation=4, um_per_unit=5))
            f = pressed(s)
            self.assertEqual((f.depth_mm.shape, f.decimation, f.um_per_unit), ((100, 125), 4, 5.0))
            self.assertAlmostEqual(float(np.nanmax(f.depth_mm)), f.contact.deepest_mm, delta=0.2)
            s.subscribe(dtact.Subscription(region=(100, 200, 60, 40)))
            f = next(f for f in s.frames() if f.has_depth)
            self.assertEqual((f.depth_mm.shape, f.origin_px, f.full_shape),
                             ((40, 60), (100, 200), (400, 500)))
            s.subscribe(dtact.Subscription(region="contact"))
            f = pressed(s)
            self.assertLess(f.depth_mm.size, 500 * 400 / 2)
            self.assertGreater(float(np.nanmax(f.depth_mm)), 0.3)
            s.subscribe(dtact.Subscription(depth=None, jpeg=True))
            f = next(f for f in s.frames() if f.has_jpeg)
            self.assertEqual((f.jpeg[:2], f.jpeg[-2:]), (b"\xff\xd8", b"\xff\xd9"))


class Commands(unittest.TestCase):
    def test_light_is_reported_and_set(self):
        with dtact.connect(daemon.address) as s:
            self.assertEqual(s.set_light(brightness=200).brightness, 200)
            lights = [e.light.brightness for e in s.events(timeout=1) if isinstance(e, dtact.LightEvent)]
            self.assertIn(200, lights)
            self.assertEqual(s.set_light(scheme="all", brightness=255).leds, ((255, 255, 255),) * 8)
            with self.assertRaisesRegex(dtact.Invalid, "set_light"):
                s.set_light(brightness=256)

    def test_rezero_is_refused_in_contact(self):
        with dtact.connect(daemon.address) as s:
            for _ in range(10):
                pressed(s)
                try:
                    s.rezero()
                except dtact.InContact as e:
                    self.assertIn("there is contact", str(e))
                    return
            self.fail("it was never refused")

    def test_calibrations(self):
        with dtact.connect(daemon.address, timeout=20) as s:
            files = s.calibration()
            folder = daemon.folder / "again"
            files.write(folder)
            number = s.upload_calibration(dtact.CalibrationFiles.read(folder))
            self.assertEqual(number, 1)
            stored = {c.number: c for c in s.calibrations()}
            self.assertEqual((stored[1].name, stored[1].in_use, stored[0].in_use),
                             ("again", True, False))
            self.assertEqual(s.calibration(1).calibration_toml, files.calibration_toml)
            s.activate_calibration(0)
            events = [e for e in s.events(timeout=1) if isinstance(e, dtact.CalibrationEvent)]
            self.assertEqual([e.name for e in events], ["again", "calibration"])

    def test_how_depth_is_made_is_changed(self):
        with dtact.connect(daemon.address) as s:
            before = s.status().reconstruction
            s.subscribe()
            try:
                how = s.set_reconstruction(resolution="quarter")
                self.assertEqual((how.resolution, how.sharpen), ("quarter", before.sharpen))
                f = next(f for f in s.frames() if f.has_depth and f.message.depth.decimation == 4)
                self.assertEqual(f.depth_mm.shape, (100, 125))
                with self.assertRaisesRegex(dtact.Invalid, "max_error_um: 0; allowed are 1 to 10000"):
                    s.set_reconstruction(max_error_um=0)
            finally:
                s.set_reconstruction(resolution=before.resolution)
            events = [e for e in s.events(timeout=1) if isinstance(e, dtact.ReconstructionEvent)]
            self.assertEqual([e.reconstruction.resolution for e in events], ["quarter", before.resolution])

    def test_the_camera_is_changed(self):
        with dtact.connect(daemon.address) as s:
            before = s.set_camera()
            self.assertEqual((before.exposure_us.value, before.gain.maximum), (10000, 2))
            s.subscribe()
            try:
                self.assertEqual(s.set_camera(exposure_us=9170, gain=1.25).exposure_us.value, 9170)
                with self.assertRaisesRegex(dtact.Invalid, "gain: 3; this camera has 1 to 2"):
                    s.set_camera(gain=3)
            finally:
                s.set_camera(exposure_us=10000, gain=1)
            next(f for f in s.frames() if f.has_depth)

    def test_clocks_and_reference(self):
        with dtact.connect(daemon.address) as s:
            before = time.monotonic()
            pong = s.ping()
            self.assertTrue(before <= pong.monotonic_s <= time.monotonic())
            self.assertTrue(s.reference().png.startswith(b"\x89PNG"))

    def test_a_recording_is_read_back(self):
        file = daemon.folder / "press.mcap"
        with path_to_dtactctl(), dtact.connect(daemon.address, kept_frames=100) as s:
            with s.record(file):
                # On a busy machine both clients miss frames.
                seen = list(itertools.islice((f for f in s.frames() if f.has_depth), 200))
        recorded = {f.sequence: f for f in dtact.read(file) if isinstance(f, dtact.Frame)}
        common = [f for f in seen if f.sequence in recorded]
        self.assertGreater(len(common), 0)
        for f in common:
            np.testing.assert_array_equal(recorded[f.sequence].depth_mm, f.depth_mm)
            self.assertEqual(recorded[f.sequence].contact, f.contact)

    def test_a_recording_fails_before_its_block(self):
        taken = daemon.folder / "taken.mcap"
        taken.write_text("mine")
        with path_to_dtactctl(), dtact.connect(daemon.address) as s:
            for file, said in ((taken, "exists: name another file"),
                               (daemon.folder / "missing" / "a.mcap", "No such file or directory")):
                with self.assertRaisesRegex(dtact.Error, said):
                    with s.record(file):
                        self.fail("the block ran")
        self.assertEqual(taken.read_text(), "mine")

    def test_a_block_that_ends_at_once_is_a_recording(self):
        file = daemon.folder / "short.mcap"
        with path_to_dtactctl(), dtact.connect(daemon.address) as s:
            with s.record(file):
                pass
        self.assertTrue(any(isinstance(item, dtact.Frame) for item in dtact.read(file)))


class Connections(unittest.TestCase):
    def test_goes_on_after_the_daemon_was_started_again(self):
        with dtact.connect(daemon.address, reconnect=True) as s:
            next(s.frames())
            daemon.stop()
            daemon.start()
            self.assertTrue(next(s.frames(timeout=60)))
            self.assertEqual(s.status().state in ("settling", "referencing", "serving"), True)

    def test_asyncio(self):
        async def main():
            async with dtact.aio.connect(daemon.address) as s:
                async for f in s.frames():
                    if f.contact and f.contact.in_contact:
                        return f.depth_mm.shape, (await s.status()).state
        self.assertEqual(asyncio.run(main()), ((400, 500), "serving"))

    def test_camera(self):
        with dtact.Camera(daemon.address, fps=30) as camera:
            self.assertEqual((camera.width, camera.height), (500, 400))
            until = time.monotonic() + 60
            while (deepest := float(camera.read_depth().max())) < 0.0003:
                self.assertLess(time.monotonic(), until)
            self.assertLess(deepest, 0.002)
            self.assertEqual(camera.read_latest(5000).shape, (400, 500, 3))
            self.assertGreater(int(camera.async_read(5000).max()), 20)


class Documents(unittest.TestCase):
    """The README's examples run unchanged."""

    def run_code(self, blocks):
        names, out = {}, io.StringIO()
        with contextlib.redirect_stdout(out):
            for block in blocks:
                here = re.sub('"(gripper|localhost)"', repr(daemon.address), block)
                exec(compile(here, "shown", "exec"), names)
        return out.getvalue()

    def test_readmes(self):
        blocks = []
        for page, least in (("README.md", 1), ("clients/python/README.md", 5)):
            shown = re.findall(r"```python\n(.*?)```", (SOURCE / page).read_text(), re.DOTALL)
            self.assertGreaterEqual(len(shown), least, page)
            blocks += shown
        for block in blocks:
            out = self.run_code([block])
            if "deepest_mm" in block:
                self.assertRegex(out, r"^\(400, 500\), \d\.\d\d mm deep, ±0\.\d{3} mm\n$")

    def test_notebook(self):
        notebook = json.loads((SOURCE / "clients/python/docs/press.ipynb").read_text())
        cells = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
        drawing = mock.MagicMock()  # matplotlib is not needed to see that the code runs.
        with mock.patch.dict(sys.modules, {"matplotlib": drawing, "matplotlib.pyplot": drawing}):
            self.assertRegex(self.run_code(cells), r"mm deep on [\d.]+ mm²")


    def test_drawing(self):
        drawing = mock.MagicMock()
        program = SOURCE / "clients/python/docs/draw_contact.py"
        with mock.patch.dict(sys.modules, {"matplotlib": drawing, "matplotlib.pyplot": drawing.pyplot}), \
                mock.patch.object(sys, "argv", [str(program), daemon.address, "--frames", "3"]), \
                contextlib.redirect_stdout(io.StringIO()) as out:
            runpy.run_path(str(program), run_name="__main__")
        self.assertRegex(out.getvalue(), r"^drew 3 frames, the last \d\.\d\d mm deep\n$")
        pictures = [call.args[0].shape for call in
                    drawing.pyplot.figure.return_value.add_subplot.return_value.imshow.mock_calls]
        self.assertEqual(pictures, [(400, 500)] * 6)

    def test_9dtacts_mixed_image(self):
        page = (SOURCE / "clients/python/docs/9dtact.md").read_text()
        made = re.search(r"`d = (f\.luma - r)`, then `(np\.stack.*?)`", page)
        with dtact.connect(daemon.address) as s:
            s.subscribe(dtact.Subscription(depth=None, luma=True))
            f = next(f for f in s.frames() if f.has_luma)
            self.assertTrue(s.reference().png.startswith(b"\x89PNG"))
        r = np.full(f.luma.shape, 100.0)  # Decoding the PNG is OpenCV's part.
        names = {"np": np, "f": f, "r": r, "d": eval(made[1], {"f": f, "r": r})}
        mixed = eval(made[2], names)
        self.assertEqual(mixed.shape, (600, 800, 3))
        self.assertTrue(((mixed[..., 1] > 0) == (f.luma > 100)).all())


class Bench(unittest.TestCase):
    def test_runs(self):
        ran = subprocess.run([sys.executable, SOURCE / "clients/python/bench/decode.py", "--repeat", "1"],
                             capture_output=True, text=True, check=True)
        for name in ("int16", "predict_zstd"):
            self.assertIn(name, ran.stdout)


if __name__ == "__main__":
    unittest.main()
