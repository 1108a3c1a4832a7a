#!/usr/bin/env python3
"""The check of the arrows finds forbidden includes."""
import pathlib
import tempfile
import unittest

from check_arrows import complaints


class Arrows(unittest.TestCase):
    def found(self, files):
        with tempfile.TemporaryDirectory() as folder:
            top = pathlib.Path(folder)
            for name, text in files.items():
                (top / name).parent.mkdir(parents=True, exist_ok=True)
                (top / name).write_text(text)
            return list(complaints(top))

    def test_allowed_includes_pass(self):
        self.assertEqual(self.found({
            "daemon/recon/depth_lut.cpp": '#include "daemon/recon/depth_lut.hpp"\n#include <vector>\n',
            "daemon/pipeline/slot.hpp": '#include "hal/frame.hpp"\n#include <sys/eventfd.h>\n',
        }), [])

    def test_hal_must_not_know_the_daemon(self):
        self.assertEqual(len(self.found({"hal/sim/a.cpp": '#include "daemon/recon/depth_lut.hpp"\n'})), 1)

    def test_recon_knows_the_standard_library_only(self):
        self.assertEqual(len(self.found({"daemon/recon/a.cpp": "#include <opencv2/core.hpp>\n"})), 1)
        self.assertEqual(len(self.found({"daemon/recon/a.cpp": "#include <sys/mman.h>\n"})), 1)

    def test_only_the_core_of_opencv(self):
        self.assertEqual(len(self.found({"hal/sim/a.cpp": "#include <opencv2/imgproc.hpp>\n"})), 1)

    def test_a_backend_includes_no_other_backend(self):
        self.assertEqual(len(self.found({"hal/replay/a.cpp": '#include "hal/sim/scene.hpp"\n'})), 1)

    def test_a_file_outside_the_map_is_named(self):
        self.assertEqual(len(self.found({"proto2/x.hpp": "", "hal/x.hpp": ""})), 0)
        self.assertEqual(len(self.found({"clients/odd.hpp": ""})), 1)


if __name__ == "__main__":
    unittest.main()
