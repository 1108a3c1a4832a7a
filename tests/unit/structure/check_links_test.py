#!/usr/bin/env python3
"""The check of the links finds forbidden libraries."""
import unittest

from check_links import complaints


class Links(unittest.TestCase):
    def found(self, name, libraries, symbols=""):
        return len(list(complaints(name, libraries, symbols)))

    def test_what_each_may_link_passes(self):
        self.assertEqual(self.found("dtactd", ["libopencv_core.so.406", "libjpeg.so.62"]), 0)
        self.assertEqual(self.found("dtactctl", ["libpng16.so.16", "libprotobuf.so.32"]), 0)
        self.assertEqual(self.found("dtact-calibrate", ["libopencv_calib3d.so.406"]), 0)

    def test_other_modules_of_opencv_are_reported(self):
        self.assertEqual(self.found("dtactd", ["libopencv_imgproc.so.406"]), 1)
        self.assertEqual(self.found("dtactctl", ["libopencv_core.so.406"]), 1)
        self.assertEqual(self.found("dtact-calibrate", ["libopencv_imgcodecs.so.406"]), 1)

    def test_libraries_of_the_other_programs_are_reported(self):
        self.assertEqual(self.found("dtactctl", ["libgpiod.so.2"]), 1)
        self.assertEqual(self.found("dtact-calibrate", ["libcamera.so.0.0.3"]), 1)

    def test_a_fit_is_reported(self):
        fit = "0000000000012340 T dtact::calibration::fit_chain(std::vector<int> const&)\n"
        self.assertEqual(self.found("dtactd", [], fit), 1)
        self.assertEqual(self.found("dtactctl", [], fit), 1)
        self.assertEqual(self.found("dtact-calibrate", [], fit), 0)


if __name__ == "__main__":
    unittest.main()
