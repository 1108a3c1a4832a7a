"""Contents of a frame, and the errors for parts that it lacks."""
import datetime
import unittest

import numpy as np

import dtact
from dtact.messages import ServerMessage
from fake_daemon import frame


class Depth(unittest.TestCase):
    def test_millimetres_and_nan(self):
        f = dtact.Frame(frame(1).frame)
        self.assertEqual(f.depth_mm.dtype, np.float32)
        np.testing.assert_array_equal(f.depth_mm, np.array([[0, 1], [np.nan, 0.025]], np.float32))
        np.testing.assert_array_equal(f.depth_values, [[0, 1000], [-32768, 25]])
        self.assertEqual(f.uncertainty_mm, 0.014)
        self.assertEqual((f.mm_per_px, f.decimation, f.origin_px, f.full_shape),
                         (0.5, 1, (0, 0), (2, 2)))

    def test_units_and_signs(self):
        f = dtact.Frame(frame(1, values=(3, -3, 32767, -32767), um_per_unit=5.0).frame)
        np.testing.assert_array_equal(
            f.depth_mm, np.array([[0.015, -0.015], [163.835, -163.835]], np.float32))

    def test_rows_and_columns(self):
        f = dtact.Frame(frame(1, values=(1, 2, 3, 4, 5, 6), width=3).frame)
        self.assertEqual(f.depth_values.tolist(), [[1, 2, 3], [4, 5, 6]])
        self.assertEqual(f.depth_mm.shape, (2, 3))

    def test_a_part(self):
        message = frame(1).frame
        message.depth.x, message.depth.y = 10, 20
        message.depth.full_width, message.depth.full_height = 145, 144
        message.depth.decimation = 4
        message.depth.sharpen_steps = 2
        f = dtact.Frame(message)
        self.assertEqual((f.origin_px, f.full_shape, f.decimation), ((10, 20), (144, 145), 4))
        self.assertEqual(f.sharpen_steps, 2)

    def test_none(self):
        message = ServerMessage().frame
        message.sequence = 5
        message.health.append(1)
        f = dtact.Frame(message)
        self.assertFalse(f.has_depth)
        for name in ("depth_mm", "depth_values", "uncertainty_mm", "um_per_unit", "mm_per_px"):
            with self.assertRaisesRegex(dtact.NotInFrame, r"frame 5 has no depth map \(uncalibrated\)"):
                getattr(f, name)
        self.assertFalse(f.has_luma or f.has_jpeg)
        self.assertRaises(dtact.NotInFrame, getattr, f, "luma")
        self.assertRaises(dtact.NotInFrame, getattr, f, "jpeg")


class MadeOfTheDepth(unittest.TestCase):
    """On a map of 4 × 3 pixels of 0.0417 mm, one of them untrusted."""

    VALUES = (0, 100, 101, 300,
              0, -20, 200, -32768,
              10, 0, 0, 500)

    def frame(self, in_contact=True, mm_per_px=0.0417):
        message = frame(1, values=self.VALUES, width=4).frame
        message.depth.mm_per_px = mm_per_px
        message.contact.in_contact, message.contact.threshold_mm = in_contact, 0.1
        return dtact.Frame(message)

    def test_contact_mask(self):
        f = self.frame()
        self.assertEqual(f.contact_mask.astype(int).tolist(),
                         [[0, 0, 1, 1], [0, 0, 1, 0], [0, 0, 0, 1]])
        self.assertEqual((f.contact_mask.dtype, f.contact.threshold_mm), (bool, 0.1))
        self.assertFalse(self.frame(in_contact=False).contact_mask.any())
        unmeasured = frame(1).frame
        unmeasured.contact_absence = 2
        with self.assertRaisesRegex(dtact.NotInFrame, "frame 1 was not measured: referencing"):
            dtact.Frame(unmeasured).contact_mask

    def test_gradients(self):
        g = self.frame().gradients
        self.assertEqual((g.shape, g.dtype), ((3, 4, 2), np.float32))
        # Between the neighbours on both sides: 101 − 0 and 200 − 100 µm on two pixels of 41.7 µm.
        np.testing.assert_allclose(g[0, 1, 0], 101 / (2 * 41.7), rtol=1e-5)
        np.testing.assert_allclose(g[1, 2, 1], -101 / (2 * 41.7), rtol=1e-5)
        np.testing.assert_allclose(g[0, 0], [100 / 41.7, 0], rtol=1e-5)  # One-sided at the edge.
        self.assertTrue(np.isnan(g[1, 3]).any() and np.isnan(g[1, 2, 0]))
        line = dtact.Frame(frame(1, values=(0, 5, 10), width=3).frame).gradients
        self.assertEqual(line[:, :, 0].tolist(), [[np.float32(0.01)] * 3])
        self.assertTrue(np.isnan(line[:, :, 1]).all())

    def test_points_are_a_plane_pressed_in(self):
        f = self.frame(mm_per_px=0.2)  # A reach of one pixel.
        cloud = f.points()
        self.assertEqual((cloud.points.shape, cloud.points.dtype), ((3, 4, 3), np.float32))
        np.testing.assert_allclose(cloud.points[0, 2], [0.5 * 2e-4, -2e-4, -101e-6], rtol=1e-5)
        self.assertFalse(cloud.valid[1, 3])
        expected = np.array([100 / 400, -20 / 400, 1])  # Rise to the right, fall downwards, of 0.4 mm.
        f = dtact.Frame(frame(1, values=(0, 50, 100, 0, 40, 0, 0, 30, 0), width=3).frame)
        f.message.depth.mm_per_px = 0.2
        np.testing.assert_allclose(f.points().normals[1, 1],
                                   [0, -20 / 400, 1] / np.linalg.norm([0, -20 / 400, 1]), rtol=1e-5)
        np.testing.assert_allclose(f.points().normals[0, 1][0] / f.points().normals[0, 1][2],
                                   expected[0], rtol=1e-5)

    def test_points_without_two_neighbours_are_left_out(self):
        values = [-32768] * 9
        values[4] = 7
        self.assertFalse(dtact.Frame(frame(1, values=values, width=3).frame).points().valid.any())

    def test_points_lie_where_they_are_under_a_camera_that_is_near(self):
        # A ball of 5 mm, 1 mm deep at (5, −3), seen from 25 mm above (−0.5, 0.3).
        surface = dtact.Surface("plane", foot_mm=(-0.5, 0.3), per_mm=1 / 25)
        x, y = np.meshgrid((np.arange(500) - 249.5) * 0.0417, (np.arange(400) - 199.5) * 0.0417)
        depth = np.zeros_like(x)
        for _ in range(30):
            u, v = surface.place(x, y, depth)
            depth = np.maximum(0, np.sqrt(np.maximum(0, 25 - (u - 5)**2 - (v + 3)**2)) - 4)
        um = np.round(1e3 * depth).astype(int)
        f = dtact.Frame(frame(1, values=um.ravel().tolist(), width=500).frame)
        f.message.depth.mm_per_px = 0.0417
        f.message.surface.foot_x_mm, f.message.surface.foot_y_mm = surface.foot_mm
        f.message.surface.per_mm = surface.per_mm
        cloud = f.points()
        pressed = um > 200
        inwards = np.array([5e-3, -3e-3, 4e-3]) - cloud.points[pressed]
        np.testing.assert_allclose(np.linalg.norm(inwards, axis=1), 5e-3, atol=2e-6)
        self.assertGreater((cloud.normals[pressed] * inwards).sum(axis=1).min() / 5e-3, 0.9998)

    def test_points_of_a_curved_gel(self):
        f = self.frame()
        f.message.surface.shape = 1
        with self.assertRaisesRegex(dtact.NotInFrame, "is a sphere: connect to dtact-perceive"):
            f.points()


class Else(unittest.TestCase):
    def test_times(self):
        f = dtact.Frame(frame(7).frame)
        self.assertEqual(f.time, datetime.datetime(2023, 11, 14, 22, 13, 20, 123456,
                                                   tzinfo=datetime.timezone.utc))
        self.assertAlmostEqual(f.monotonic_s, 5.000000007, places=12)

    def test_contact_that_is_not_measured_is_none(self):
        message = frame(1).frame
        message.contact_absence = 2
        f = dtact.Frame(message)
        self.assertIsNone(f.contact)
        self.assertEqual(f.contact_absence, "referencing")

    def test_contact(self):
        message = frame(1).frame
        message.contact.in_contact = True
        message.contact.area_mm2 = 2.5
        message.contact.deepest_mm = 0.75
        contact = dtact.Frame(message).contact
        self.assertTrue(contact.in_contact)
        self.assertEqual((contact.area_mm2, contact.deepest_mm, contact.x_mm), (2.5, 0.75, 0.0))

    def test_force_is_none_where_there_is_none(self):
        message = frame(1).frame
        message.contact.in_contact = True
        contact = dtact.Frame(message).contact
        self.assertEqual((contact.force_n, contact.force_uncertainty_n), (None, None))
        self.assertFalse(contact.force_valid)
        message.contact.force_absence = 3
        self.assertEqual(dtact.Frame(message).contact.force_absence, "cut_off")
        message.contact.force_n = 0
        message.contact.force_uncertainty_n = 0.03
        contact = dtact.Frame(message).contact
        self.assertEqual((contact.force_n, contact.force_uncertainty_n), (0.0, 0.03))
        self.assertTrue(contact.force_valid)

    def test_health_light_calibration_and_pictures(self):
        message = frame(1).frame
        message.health.extend([3, 9, 200])
        message.light.brightness = 80
        message.light.leds.add(r=1, g=2, b=3)
        message.calibration = 4
        message.luma.encoding = 1
        message.luma.width, message.luma.height, message.luma.data = 3, 2, b"abcdef"
        message.jpeg.data = b"\xff\xd8"
        f = dtact.Frame(message)
        self.assertEqual(f.health, ("light_unsettled", "frames_lost", "200"))
        self.assertEqual((f.light.brightness, f.light.leds, f.light.since_s), (80, ((1, 2, 3),), None))
        self.assertEqual(f.calibration, 4)
        self.assertEqual(f.luma.tolist(), [[97, 98, 99], [100, 101, 102]])
        self.assertEqual(f.jpeg, b"\xff\xd8")
        message.luma.data = b"abcde"
        self.assertRaises(dtact.ProtocolError, getattr, dtact.Frame(message), "luma")


class Events(unittest.TestCase):
    def test_every_kind(self):
        from dtact.event import event_of
        event = ServerMessage().event
        event.sequence, event.monotonic_ns, event.wall_ns = 8, 2_000_000_000, 1_000_000
        event.calibration.name, event.calibration.number = "new", 3
        made = event_of(event)
        self.assertIsInstance(made, dtact.CalibrationEvent)
        self.assertEqual((made.name, made.number, made.sequence, made.monotonic_s), ("new", 3, 8, 2.0))
        self.assertEqual(made.time.isoformat(), "1970-01-01T00:00:00.001000+00:00")
        event.state.state = 5
        event.state.health.append(10)
        self.assertEqual((event_of(event).state, event_of(event).health),
                         ("camera_lost", ("camera_fault",)))
        event.reference.restored = True
        self.assertTrue(event_of(event).restored)
        event.contact.contact.in_contact = True
        self.assertTrue(event_of(event).contact.in_contact)


if __name__ == "__main__":
    unittest.main()
