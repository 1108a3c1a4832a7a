#!/usr/bin/env python3
"""page_client_test.py: starts the daemon on the simulated sensor, where a ball is pressed in again
and again, and runs page_client against it. The programs are named by the environment: DTACTD,
SIM_RENDER, CALIBRATE.

The depth map's sides are no multiples of four and not equal: what is left over and what is mistaken
for the other side shows.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
SCENES = HERE.parents[1] / "config/scenes"
SCENE = """
[loop]
from_s = 2.0
to_s = 8.0

[[press]]
object = "ball"
radius_mm = 4.0
keys = [
  { t = 2.0, x = 3.1, y = -1.7, depth = -0.3 },
  { t = 2.3, depth = 1.2 },
  { t = 4.1 },
  { t = 4.4, depth = -0.3 },
]
"""


def calibrate(folder):
    scene = ["--scene", SCENES / "calibrate_ball.toml"]
    for name, frames in (("reference", "0:32"), ("ball", "200:232")):
        subprocess.run([os.environ["SIM_RENDER"], *scene, "--frames", frames, "-o", folder / name],
                       check=True)
    subprocess.run([os.environ["CALIBRATE"], "depth", "--reference", folder / "reference", "--ball",
                    folder / "ball", "--radius-mm", "4.0", "--mm-per-px", "0.0413793", "--centre",
                    "400,300", "--crop", "570,582", "-o", folder / "calibration"], check=True,
                   stdout=subprocess.DEVNULL)
    return folder / "calibration"


def listening(daemon, log):
    until = time.monotonic() + 60
    while not (found := re.search(r"listening on 127\.0\.0\.1:(\d+)", log.read_text())):
        if daemon.poll() is not None or time.monotonic() > until:
            raise SystemExit(f"dtactd did not start:\n{log.read_text()}")
        time.sleep(0.05)
    return found[1]


def main():
    try:
        import google.protobuf  # noqa: F401
    except ImportError:
        print("skipped: apt-get install python3-protobuf")
        return 77
    with tempfile.TemporaryDirectory(prefix="dtact_page_") as name:
        folder = pathlib.Path(name)
        scene, log = folder / "scene.toml", folder / "log"
        scene.write_text(SCENE)
        settings = ["net.port=0", f"calibration={calibrate(folder)}", f"state_dir={folder}/state",
                    f"camera.sim.scene={scene}"]
        with open(log, "w", encoding="utf-8") as out:
            command = [os.environ["DTACTD"], *(word for s in settings for word in ("--set", s))]
            with subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT) as daemon:
                try:
                    port = listening(daemon, log)
                    result = subprocess.run([sys.executable, "-B", HERE / "page_client",
                                             "127.0.0.1", port], check=False).returncode
                finally:
                    daemon.terminate()
        if result == 1:
            print(log.read_text())
        if daemon.returncode != 0:
            print("dtactd ended badly:\n" + log.read_text())
            return 1
        return result


if __name__ == "__main__":
    sys.exit(main())
