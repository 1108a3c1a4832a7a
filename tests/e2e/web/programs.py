"""The programs under test, named by the environment: DTACTD, DTACT_WEB, DTACT_PERCEIVE, DTACTCTL,
CALIBRATE, SIM_RENDER."""
import atexit
import hashlib
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time
from typing import Optional

SCENES = pathlib.Path(__file__).resolve().parents[3] / "config/scenes"
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


def install_npm_packages(folder: pathlib.Path) -> str:
    """Installs those of package.json in this folder into another one. Returns why it cannot; '' when it could."""
    for tool in ("node", "npm"):
        if shutil.which(tool) is None:
            return f"{tool} is not installed"
    folder.mkdir(parents=True, exist_ok=True)
    package, there = pathlib.Path(__file__).parent / "package.json", folder / "package.json"
    if (folder / "installed").exists() and there.read_text() == package.read_text():
        return ""
    shutil.copy(package, there)
    done = subprocess.run(["npm", "install", "--no-audit", "--no-fund", "--no-package-lock", "--ignore-scripts",
                           "--fetch-retries=0", "--fetch-timeout=30000"],
                          cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return f"npm cannot install: {done.stderr.strip()[-200:]}"
    (folder / "installed").touch()
    return ""


def calibrate(folder: pathlib.Path) -> pathlib.Path:
    """The map's sides are no multiples of four and not equal, so that remainders and swapped axes
    show."""
    scene = ["--scene", SCENES / "calibrate_ball.toml"]
    for name, frames in (("reference", "0:32"), ("ball", "200:232")):
        subprocess.run([os.environ["SIM_RENDER"], *scene, "--frames", frames, "-o", folder / name],
                       check=True)
    subprocess.run([os.environ["CALIBRATE"], "depth", "--reference", folder / "reference", "--ball",
                    folder / "ball", "--radius-mm", "4.0", "--mm-per-px", "0.0413793", "--centre",
                    "400,300", "--crop", "570,582", "-o", folder / "calibration"], check=True,
                   stdout=subprocess.DEVNULL)
    return folder / "calibration"


def write_tokens(file: pathlib.Path, *lines: str) -> None:
    """Lines as "view TOKEN NAME"; the file has the tokens' hashes."""
    words = [line.split() for line in lines]
    file.write_text("".join(f"{rights} sha256:{hashlib.sha256(token.encode()).hexdigest()} {' '.join(name)}\n"
                            for rights, token, *name in words))
    file.chmod(0o600)


class Program:
    """Runs until stop(); its output goes to `log`."""

    def __init__(self, command: list[str], log: pathlib.Path, listening: str) -> None:
        self.command, self.log, self.listening = command, log, listening
        self.process: Optional[subprocess.Popen[bytes]] = None
        self.port = 0
        self.start()

    def start(self) -> None:
        with open(self.log, "wb") as out:
            self.process = subprocess.Popen(self.command, stdout=out, stderr=subprocess.STDOUT)
        atexit.register(self.process.kill)  # nothing is torn down where a set-up has failed
        until = time.monotonic() + 60
        while not (found := re.search(self.listening, self.text())):
            if self.process.poll() is not None or time.monotonic() > until:
                raise SystemExit(f"{self.command[0]} did not start:\n{self.text()}")
            time.sleep(0.05)
        self.port = int(found[1])

    def text(self) -> str:
        return self.log.read_text(errors="replace")

    def stop(self, by: int = signal.SIGTERM) -> int:
        assert self.process is not None
        self.process.send_signal(by)
        return self.process.wait(timeout=20)


class Daemon(Program):
    """A dtactd on the simulated sensor, in which a ball is pressed repeatedly."""

    def __init__(self, folder: pathlib.Path, name: str, *settings: str, port: int = 0,
                 within: tuple[str, ...] = ()) -> None:
        """`within`: the command that runs it."""
        scene = folder / "scene.toml"
        scene.write_text(SCENE)
        # At normal priority, so that other programs on this machine keep their share.
        every = [f"net.port={port}", f"net.name={name}", f"state_dir={folder}/{name}-state",
                 f"camera.sim.scene={scene}", "capture.fifo_priority=0", "net.fifo_priority=0",
                 # A slow machine sees few pictures between two presses.
                 "reference.frames=8",
                 *settings]
        super().__init__([*within, os.environ["DTACTD"], *(word for one in every for word in ("--set", one))],
                         folder / f"{name}.log", r"listening on 127\.0\.0\.1:(\d+)")

    def restart(self) -> None:
        """Starts again on the same port."""
        if "net.port=0" in self.command:
            self.command[self.command.index("net.port=0")] = f"net.port={self.port}"
        self.start()


class Perceive(Program):
    """dtact-perceive beside a daemon."""

    def __init__(self, folder: pathlib.Path, daemon: Daemon, port: int = 0) -> None:
        number = len(list(folder.glob("perceive-*.log")))
        super().__init__([os.environ["DTACT_PERCEIVE"], "--port", str(daemon.port), "serve", "--listen-port",
                          str(port)],
                         folder / f"perceive-{number}.log", r"listening on 127\.0\.0\.1:(\d+)")


class Gateway(Program):
    def __init__(self, folder: pathlib.Path, *arguments: str) -> None:
        number = len(list(folder.glob("web-*.log")))
        super().__init__([os.environ["DTACT_WEB"], "--listen-port", "0", *arguments],
                         folder / f"web-{number}.log", r"listening on https?://[\d.]+:(\d+)/")
        # Its memory when nobody has connected yet; sanitizers keep what is freed.
        self.rest_kib = None if "san.so" in self.of_kernel("maps") else self.kib("VmRSS")

    def of_kernel(self, what: str) -> str:
        assert self.process is not None
        return pathlib.Path(f"/proc/{self.process.pid}/{what}").read_text()

    def kib(self, what: str) -> int:
        found = re.search(rf"{what}:\s+(\d+)", self.of_kernel("status"))
        assert found is not None
        return int(found[1])

    def descriptors(self) -> int:
        assert self.process is not None
        return len(list(pathlib.Path(f"/proc/{self.process.pid}/fd").iterdir()))

    def stop(self, by: int = signal.SIGTERM) -> int:
        """Checks before that it has given back what viewers took, whatever they did."""
        if self.rest_kib is not None:
            until = time.monotonic() + 20
            while self.kib("VmRSS") > self.rest_kib + 8 * 1024 and time.monotonic() < until:
                time.sleep(0.1)
            now, peak = self.kib("VmRSS"), self.kib("VmHWM")
            print(f"dtact-web: {self.rest_kib} KiB at rest, at most {peak}, {now} at the end")
            assert now <= self.rest_kib + 8 * 1024 and peak <= 150 * 1024, self.text()
        return super().stop(by)
