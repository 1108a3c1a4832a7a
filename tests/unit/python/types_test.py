"""The type hints hold."""
import os
import pathlib
import shutil
import subprocess
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[3] / "clients/python"


class Types(unittest.TestCase):
    @unittest.skipIf(shutil.which("mypy") is None, "apt-get install mypy")
    def test_mypy_strict(self):
        ran = subprocess.run(["mypy", "--cache-dir", os.environ["MYPY_CACHE"]], cwd=SOURCE,
                             capture_output=True, text=True)
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)


if __name__ == "__main__":
    unittest.main()
