"""Recordings, with a program in place of dtactctl."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

#: Records until it is asked to end, and notes in its file that it was.
STAND_IN = """#!/bin/sh
for file; do :; done
trap 'echo ended > "$file"; exit 0' TERM
echo "recording to $file" >&2
while :; do sleep 0.1; done
"""
SCRIPT = """
import os, sys
from dtact import address
from dtact.recording import Recording
recording = Recording(sys.argv[1], address.parse("127.0.0.1:7377"), [], 10)
if os.fork() == 0:
    sys.exit(0)  # A child's end is not the recording's.
os.wait()
assert not os.path.exists(sys.argv[1])
raise RuntimeError("before stop()")
"""


class Recordings(unittest.TestCase):
    def test_one_that_is_not_stopped_ends_with_the_program(self):
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder, "dtactctl")
            program.write_text(STAND_IN)
            program.chmod(0o755)
            file = pathlib.Path(folder, "press.mcap")
            environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}",
                           "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
            done = subprocess.run([sys.executable, "-c", SCRIPT, file], env=environment, capture_output=True, text=True,
                                  timeout=60)
            self.assertIn("before stop()", done.stderr)
            # Before: it went on until the disk was full.
            self.assertEqual(file.read_text(), "ended\n")


if __name__ == "__main__":
    unittest.main()
