"""The Python package on dtact-perceive beside dtactd and the simulated sensor."""
import os
import re
import subprocess
import time
import unittest

import numpy as np

import dtact
from daemon import Daemon


class Perceive(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = Daemon()
        cls.daemon.start()
        cls.addClassCleanup(cls.daemon.remove)
        log = cls.daemon.folder / "perceive.log"
        with open(log, "w", encoding="utf-8") as out:
            perceive = subprocess.Popen(
                [os.environ["DTACT_PERCEIVE"], "--port", str(cls.daemon.port), "serve", "--listen-port", "0"],
                stdout=out, stderr=subprocess.STDOUT)
        cls.addClassCleanup(perceive.wait)
        cls.addClassCleanup(perceive.terminate)
        until = time.monotonic() + 60
        while not (found := re.search(r"listening on (127\.0\.0\.1:\d+)", log.read_text())):
            if perceive.poll() is not None or time.monotonic() > until:
                raise RuntimeError(f"dtact-perceive did not start:\n{log.read_text()}")
            time.sleep(0.05)
        cls.address = found[1]

    def test_points_and_pose_of_the_contact(self):
        with dtact.connect(self.address) as s:
            s.subscribe(dtact.Subscription(depth=None, cloud="int16", region="contact", pose=True))
            until = time.monotonic() + 60
            for f in s.frames():
                self.assertLess(time.monotonic(), until, "nothing was pressed within a minute")
                if f.has_cloud and f.pose and f.pose.tracking == "tracked" and f.contact.deepest_mm > 0.3:
                    break
        self.assertFalse(f.has_depth)
        self.assertEqual(f.surface, dtact.Surface("plane", per_mm=1 / 30))  # what is assumed without a board
        cloud = f.cloud
        points = cloud.points[cloud.valid]
        # Pressed in is below the undeformed surface, metres; the deepest is at the summary's position.
        deepest = points[np.argmin(points[:, 2])]
        self.assertAlmostEqual(-1e3 * deepest[2], f.contact.deepest_mm, delta=0.01)
        lengths = np.linalg.norm(cloud.normals[cloud.valid], axis=1)
        np.testing.assert_allclose(lengths, 1, atol=1e-3)
        self.assertGreater(len(cloud.triangles()), len(points))
        self.assertGreater(cloud.made_in_s, 0)
        self.assertGreater(f.pose.followed_in_s, 0)
        self.assertGreater(f.pose.points, 100)
        np.testing.assert_allclose(np.linalg.det(f.pose.matrix()), 1, atol=1e-9)

    def test_points_without_it_are_the_same(self):
        """The Python package's own points of a flat gel, of the same frame."""
        with dtact.connect(self.address) as s, \
                dtact.connect(self.daemon.address, kept_frames=200) as whole:
            whole.subscribe()
            s.subscribe(dtact.Subscription(depth=None, cloud="float32"))
            until = time.monotonic() + 60
            depths, clouds = {}, {}  # either may come first
            for f in s.frames():
                if f.has_cloud and f.contact.deepest_mm > 0.3:
                    clouds[f.sequence] = f.cloud
                while isinstance(one := whole.next(0), dtact.Frame):
                    depths[one.sequence] = one
                if both := clouds.keys() & depths.keys():
                    break
                self.assertLess(time.monotonic(), until, "no frame came from both within a minute")
        sequence = both.pop()
        made, cloud = depths[sequence].points(), clouds[sequence]
        self.assertEqual((made.points.shape, made.decimation), (cloud.points.shape, cloud.decimation))
        np.testing.assert_array_equal(made.valid, cloud.valid)
        np.testing.assert_allclose(made.points, cloud.points, atol=1e-8)
        np.testing.assert_allclose(made.normals, cloud.normals, atol=1e-5)

    def test_what_the_object_is(self):
        with dtact.connect(self.address) as s:
            s.subscribe(dtact.Subscription(depth=None, recognition=True))
            until = time.monotonic() + 60
            for f in s.frames():
                self.assertLess(time.monotonic(), until, "nothing was recognised within a minute")
                if f.recognition and f.recognition.presses == 1:
                    break
        self.assertEqual(len(f.recognition.candidates), 5)
        self.assertFalse(f.recognition.candidates[0].taught)
        self.assertEqual(len(f.recognition.model), 64)

    def test_teaching_an_object(self):
        folder = self.daemon.folder / "taught"

        def objects(*arguments):
            return subprocess.run([os.environ["CALIBRATE"], "--host", self.daemon.address, "objects",
                                   *arguments, "--taught", folder],
                                  check=True, capture_output=True, text=True, timeout=120).stdout

        folder.mkdir()
        (folder / "torn.png").write_bytes(b"")
        said = objects("teach", "thing", "--presses", "3")
        self.assertIn("warning: ", said)
        self.assertIn("torn.png: not a readable PNG", said)
        self.assertIn("press 3 of 3 taken", said)
        objects("forget", "torn")
        self.assertEqual(objects("list"), "thing: 3 presses\n")
        objects("rename", "thing", "other")
        self.assertEqual(objects("list"), "other: 3 presses\n")
        with self.assertRaises(subprocess.CalledProcessError):
            objects("forget", "thing")
        objects("forget", "other")
        self.assertEqual(objects("list"), "")

    def test_a_recording_holds_points_and_poses(self):
        file = self.daemon.folder / "points.mcap"
        subprocess.run([os.environ["DTACTCTL"], "--host", self.address, "record", "-o", file, "--seconds",
                        "8"], check=True, capture_output=True)
        frames = [item for item in dtact.read(file) if isinstance(item, dtact.Frame)]
        self.assertTrue(any(f.has_cloud for f in frames))
        self.assertTrue(any(f.pose and f.pose.valid for f in frames))
        self.assertFalse(any(f.has_depth for f in frames))

    def test_whole_maps_are_not_to_be_had(self):
        with dtact.connect(self.address) as s:
            with self.assertRaises(dtact.Refused):
                s.subscribe(dtact.Subscription())


if __name__ == "__main__":
    unittest.main()
