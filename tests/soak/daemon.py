"""dtactd as a soak starts it, and the kernel's figures about it."""
from __future__ import annotations

import atexit
import os
import pathlib
import re
import shutil
import socket
import subprocess
import time
import urllib.request
from dataclasses import dataclass

SCENES = pathlib.Path(__file__).resolve().parents[2] / "config/scenes"
# [time] [dtactd] [level] text
_LINE = re.compile(r"^(?:\[[^\]]*\] )*?\[(?P<level>trace|debug|info|warning|error|critical)\] ")


class Programs:
    """The programs of one build folder with tests."""

    def __init__(self, build: pathlib.Path):
        self.dtactd = build / "daemon/dtactd"
        self.calibrate = build / "clients/dtact-calibrate"
        self.render = build / "hal/sim/dtact-sim-render"
        self.truth = build / "tests/soak/soak_truth"


def run(*command) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"soak: {command[0]} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def calibrate(programs: Programs, folder: pathlib.Path, name: str, seed: int) -> pathlib.Path:
    """Calibrates as a user does, from pictures with the noise of `seed`: without contact, then a ball held."""
    scene = ["--scene", SCENES / "calibrate_ball.toml", "--seed", seed]
    pictures = folder / "pictures" / name
    run(programs.render, *scene, "--frames", "0:32", "-o", pictures / "reference")
    run(programs.render, *scene, "--frames", "200:232", "-o", pictures / "ball")
    run(programs.calibrate, "depth", "--reference", pictures / "reference", "--ball",
        pictures / "ball", "--radius-mm", "4.0", "--mm-per-px", "0.0413793", "--centre", "400,300",
        "--crop", "580,580", "-o", folder / name)
    shutil.rmtree(pictures)
    return folder / name


@dataclass(frozen=True)
class Held:
    """Resources of the process."""

    descriptors: int
    threads: int
    resident_kib: int
    anonymous_kib: int  #: part of resident_kib; the rest are pages of files, which come and go as the kernel likes
    heap_kib: int  #: blocks of the allocator that are in use
    kept_kib: int  #: free blocks that the allocator keeps
    cpu_s: float  #: used since its start
    state_files: int
    state_kib: int
    log_kib: float

    @property
    def taken_kib(self) -> int:
        """Resident memory without the allocator's free blocks."""
        return self.resident_kib - self.kept_kib


class Daemon:
    """Runs from here until end()."""

    def __init__(self, programs: Programs, folder: pathlib.Path, calibration: pathlib.Path,
                 scene: pathlib.Path):
        self.log_file = folder / "dtactd.log"
        self.state = folder / "state"
        with socket.create_server(("127.0.0.1", 0)) as free:
            self._metrics = free.getsockname()[1]
        settings = ["net.port=0", f"metrics.port={self._metrics}", f"calibration={calibration}",
                    f"state_dir={self.state}", f"camera.sim.scene={scene}"]
        with open(self.log_file, "w", encoding="utf-8") as out:
            self._process = subprocess.Popen(
                [str(programs.dtactd), *(word for s in settings for word in ("--set", s))],
                stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
        atexit.register(self._process.kill)  # also after an exception
        self.pid = self._process.pid
        until = time.monotonic() + 120
        while not (found := re.search(r"listening on 127\.0\.0\.1:(\d+)", self.log())):
            if not self.alive() or time.monotonic() > until:
                self._process.kill()
                raise SystemExit(f"soak: dtactd did not start:\n{self.log()}")
            time.sleep(0.05)
        self.address = f"127.0.0.1:{found[1]}"

    def alive(self) -> bool:
        return self._process.poll() is None

    def log(self) -> str:
        return self.log_file.read_text(encoding="utf-8", errors="replace")

    def descriptors(self) -> list[str]:
        """Targets of the open descriptors, sorted; without the numbers of sockets and pipes."""
        names = []
        folder = pathlib.Path(f"/proc/{self.pid}/fd")
        for number in os.listdir(folder):
            try:
                names.append(re.sub(r"\[\d+\]", "", os.readlink(folder / number)))
            except OSError:  # closed since
                pass
        return sorted(names)

    def held(self) -> Held:
        status = pathlib.Path(f"/proc/{self.pid}/status").read_text()
        fields = dict(line.split(":", 1) for line in status.splitlines())
        times = pathlib.Path(f"/proc/{self.pid}/stat").read_text().rsplit(")", 1)[1].split()
        files = [f for f in self.state.rglob("*") if f.is_file()]
        descriptors = len(self.descriptors())
        heap = self._heap()  # last: the daemon closes this connection a moment later
        return Held(descriptors, int(fields["Threads"]),
                    int(fields["VmRSS"].split()[0]), int(fields["RssAnon"].split()[0]),
                    heap["used"] + heap["mapped"], heap["kept"],
                    (int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK"), len(files),
                    sum(f.stat().st_size for f in files) // 1024,
                    self.log_file.stat().st_size / 1024)

    def _heap(self) -> dict[str, int]:
        """Heap sizes from the daemon's metrics: kind → kB."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self._metrics}/metrics", timeout=120) as answer:
            text = answer.read().decode()
        return {kind: int(float(value)) // 1024 for kind, value in
                re.findall(r'^dtactd_heap_bytes{kind="(\w+)"} (\S+)$', text, re.MULTILINE)}

    def end(self) -> int:
        """SIGTERM. Its exit status; 128 + 9 when it did not end within a minute."""
        self._process.terminate()
        try:
            status = self._process.wait(60)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return 128 + 9
        return status if status >= 0 else 128 - status


def log_lines(text: str, level: str) -> list[str]:
    """The texts of the log's lines of one level, without their time."""
    return [line[found.end():] for line in text.splitlines()
            if (found := _LINE.match(line)) and found["level"] == level]
