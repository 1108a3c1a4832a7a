"""dtactd on the simulated sensor, for the Python package's tests end to end. The programs are named
by the environment: DTACTD, DTACTCTL, SIM_RENDER, CALIBRATE, DTACT_PERCEIVE."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import time

SOURCE = pathlib.Path(__file__).resolve().parents[3]
SCENES = SOURCE / "config/scenes"


def calibrate(folder):
    """Calibrates as a user does, from images of the scene: no contact, then a ball pressed and still."""
    scene = ["--scene", SCENES / "calibrate_ball.toml"]
    for name, frames in (("reference", "0:32"), ("ball", "200:232")):
        subprocess.run([os.environ["SIM_RENDER"], *scene, "--frames", frames, "-o", folder / name],
                       check=True, capture_output=True)
    subprocess.run([os.environ["CALIBRATE"], "depth", "--reference", folder / "reference", "--ball",
                    folder / "ball", "--radius-mm", "4.0", "--mm-per-px", "0.0413793", "--centre",
                    "400,300", "--crop", "500,400", "-o", folder / "calibration"],
                   check=True, capture_output=True)
    return folder / "calibration"


class Daemon:
    """Runs between start() and stop(), repeatedly, on the same folder and port."""

    def __init__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="dtact_python_"))
        self.calibration = calibrate(self.folder)
        self.port = 0
        self._process = None

    def start(self):
        log = self.folder / "log"
        with open(log, "w", encoding="utf-8") as out:
            self._process = subprocess.Popen(
                [os.environ["DTACTD"], "--set", f"net.port={self.port}", "--set",
                 f"calibration={self.calibration}", "--set", f"state_dir={self.folder}/state"],
                stdout=out, stderr=subprocess.STDOUT)
        until = time.monotonic() + 60
        while not (found := re.search(r"listening on 127\.0\.0\.1:(\d+)", log.read_text())):
            if self._process.poll() is not None or time.monotonic() > until:
                raise RuntimeError(f"dtactd did not start:\n{log.read_text()}")
            time.sleep(0.05)
        self.port = int(found[1])
        self.address = f"127.0.0.1:{self.port}"

    def stop(self):
        self._process.terminate()
        if self._process.wait(20) != 0:
            raise RuntimeError("dtactd ended badly:\n" + (self.folder / "log").read_text())

    def remove(self):
        self.stop()
        shutil.rmtree(self.folder)

    def dtactctl(self, *arguments):
        """Output of dtactctl."""
        return subprocess.run([os.environ["DTACTCTL"], "--port", str(self.port), *arguments],
                              check=True, capture_output=True, text=True).stdout
