"""Points and motion of an object, in dtact-perceive's messages."""
import struct
import unittest

import numpy as np

import dtact
from dtact.messages import ServerMessage


def message():
    m = ServerMessage().frame
    m.sequence = 9
    return m


class Cloud(unittest.TestCase):
    def test_float32(self):
        m = message()
        hole = float("nan")
        m.cloud.encoding, m.cloud.width, m.cloud.height, m.cloud.decimation = 1, 2, 1, 4
        m.cloud.data = struct.pack("<12f", 0.5, hole, 0.25, hole, -1, hole, 0, hole, 0, hole, 1, hole)
        cloud = dtact.Frame(m).cloud
        np.testing.assert_array_equal(cloud.points, np.array([[[0.5, 0.25, -1], [hole] * 3]], np.float32))
        np.testing.assert_array_equal(cloud.normals[0, 0], [0, 0, 1])
        self.assertEqual(cloud.valid.tolist(), [[True, False]])
        self.assertEqual(cloud.decimation, 4)

    def test_int16(self):
        m = message()
        m.cloud.encoding, m.cloud.width, m.cloud.height, m.cloud.metres_per_unit = 2, 1, 2, 1e-6
        m.cloud.data = struct.pack("<12h", 1000, -32768, -2000, -32768, 3, -32768, 0, -32768, 0, -32768,
                                   32767, -32768)
        cloud = dtact.Frame(m).cloud
        np.testing.assert_allclose(cloud.points[0, 0], [1e-3, -2e-3, 3e-6], rtol=1e-6)
        np.testing.assert_allclose(cloud.normals[0, 0], [0, 0, 1], rtol=1e-6)
        self.assertTrue(np.isnan(cloud.points[1, 0]).all() and np.isnan(cloud.normals[1, 0]).all())

    def test_mesh_leaves_holes_open(self):
        points = np.zeros((3, 3, 3), np.float32)
        cloud = dtact.PointCloud(points, points, 1)
        self.assertEqual(cloud.triangles().tolist()[0], [0, 1, 3])
        self.assertEqual(len(cloud.triangles()), 8)
        points[0, 0] = np.nan
        self.assertEqual(len(cloud.triangles()), 7)

    def test_damaged_and_missing(self):
        m = message()
        with self.assertRaises(dtact.NotInFrame):
            _ = dtact.Frame(m).cloud
        m.cloud.encoding, m.cloud.width, m.cloud.height, m.cloud.data = 1, 2, 1, b"x"
        with self.assertRaises(dtact.ProtocolError):
            _ = dtact.Frame(m).cloud


class Surface(unittest.TestCase):
    def test_plane_unless_said(self):
        self.assertEqual(dtact.Frame(message()).surface, dtact.Surface("plane"))

    def test_cylinder(self):
        m = message()
        m.surface.shape, m.surface.radius_mm, m.surface.axis_deg = 2, 12.5, 90
        m.surface.air_mm, m.surface.gel_mm, m.surface.refraction = 20, 8, 1.41
        self.assertEqual(dtact.Frame(m).surface, dtact.Surface("cylinder", 12.5, 90, 20, 8, 1.41))


class Pose(unittest.TestCase):
    def test_matrix_and_names(self):
        m = message()
        self.assertIsNone(dtact.Frame(m).pose)
        m.pose.tracking, m.pose.since_sequence = 2, 7
        m.pose.rotation_deg.z = 90
        m.pose.translation_mm.x = 2
        hidden = m.pose.unobservable.add()
        hidden.translation.y = 1
        m.pose.track_ns = 500_000
        pose = dtact.Frame(m).pose
        self.assertAlmostEqual(pose.followed_in_s, 5e-4)
        self.assertEqual((pose.tracking, pose.since_sequence), ("tracked", 7))
        self.assertEqual((pose.object, pose.alternatives), ("", 0))
        m.pose.tracking, m.pose.object, m.pose.alternatives = 5, "nut", 11
        known = dtact.Frame(m).pose
        self.assertEqual((known.tracking, known.object, known.alternatives), ("searching", "nut", 11))
        np.testing.assert_allclose(pose.matrix() @ [1, 0, 0, 1], [2, 1, 0, 1], atol=1e-12)
        self.assertEqual(pose.unobservable.tolist(), [[0, 0, 0, 0, 1, 0]])


class Recognition(unittest.TestCase):
    def test_name_and_candidates(self):
        m = message()
        self.assertIsNone(dtact.Frame(m).recognition)
        m.recognition.verdict, m.recognition.score, m.recognition.presses = 1, 0.9, 2
        for name, probability in (("nut", 0.75), ("bolt", 0.125)):
            candidate = m.recognition.candidates.add()
            candidate.name, candidate.probability = name, probability
        found = dtact.Frame(m).recognition
        self.assertEqual((found.name, found.verdict, found.presses), ("nut", "known", 2))
        self.assertEqual((found.candidates[1].name, found.candidates[1].probability), ("bolt", 0.125))
        m.recognition.verdict = 2
        unknown = dtact.Frame(m).recognition
        self.assertEqual((unknown.verdict, unknown.name), ("unknown", None))


class Asking(unittest.TestCase):
    def test_of_points_and_pose(self):
        wanted = dtact.Subscription(depth=None, cloud="int16", pose=True, cloud_hz=10)
        request = wanted.message(True)
        self.assertEqual((request.depth, request.cloud, request.pose, request.cloud_hz), (0, 2, True, 10))
        with self.assertRaises(ValueError):
            dtact.Subscription(cloud="int8").message(True)  # type: ignore[arg-type]


if __name__ == "__main__":
    unittest.main()
