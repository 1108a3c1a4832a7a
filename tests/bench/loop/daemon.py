"""dtactd as the loop's benchmarks start it, and the kernel's figures about it."""
import json
import os
import re
import shutil
import subprocess
import time

HERE = os.path.dirname(os.path.abspath(__file__))
FPS = 60
POLICY = {os.SCHED_OTHER: "normal", os.SCHED_FIFO: "FIFO", os.SCHED_RR: "RR"}


class Programs:
    """The programs of one build folder."""

    def __init__(self, build):
        self.dtactd = os.path.join(build, "daemon", "dtactd")
        self.dtactctl = os.path.join(build, "clients", "dtactctl")
        self.calibrate = os.path.join(build, "clients", "dtact-calibrate")
        self.render = os.path.join(build, "hal", "sim", "dtact-sim-render")
        self.client = os.path.join(build, "tests", "bench", "loop", "loop_client")
        self.jitter = os.path.join(build, "tests", "bench", "loop", "loop_jitter")
        self.frames = os.path.join(build, "tests", "bench", "loop", "loop_frames")


def prepare(programs, folder):
    """Calibration, recordings and the last good reference, in `folder`. Made each time, since
    the simulated sensor may have changed."""
    def run(*command):
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    scene = os.path.join(HERE, "..", "..", "..", "config", "scenes", "calibrate_ball.toml")
    at = {name: os.path.join(folder, name) for name in
          ("reference", "press", "calibration", "mjpeg", "grey")}
    run(programs.render, "--scene", scene, "--frames", "0:32", "-o", at["reference"])
    run(programs.render, "--scene", scene, "--frames", "300:316", "-o", at["press"])
    run(programs.calibrate, "depth", "--reference", at["reference"], "--ball",
        at["press"], "--radius-mm", "4.0", "--mm-per-px", "0.0413793", "--centre", "400,300",
        "--crop", "580,580", "-o", at["calibration"])
    ball = os.path.join(HERE, "ball.toml")
    # Four seconds, a quarter of them without contact.
    run(programs.frames, ball, "0", str(4 * FPS), at["mjpeg"])
    # Contact only, as pixels, so that the replay decodes nothing.
    run(programs.render, "--scene", ball, "--frames", "90:138", "-o", at["grey"])
    # A daemon that has taken the reference image keeps it for the next one, which plays contact only.
    with Daemon(programs, folder, {"camera.replay.folder": at["reference"]}) as daemon:
        daemon.wait_serving()
    return at


class Daemon:
    """A running dtactd on the replay backend. `settings` override the configuration; `log` is a name
    in `folder`."""

    def __init__(self, programs, folder, settings, prefix=(), log="dtactd.log"):
        self.programs = programs
        self.folder = folder
        self.prefix = list(prefix)
        self.log_name = os.path.join(folder, log)
        self.settings = {
            "camera.backend": "replay", "ring.backend": "null", "camera.fps": float(FPS),
            "net.port": 0, "net.max_clients": 128, "net.max_clients_per_address": 128,
            "state_dir": os.path.join(folder, "state"),
            "calibration": os.path.join(folder, "calibration"), **settings}

    def __enter__(self):
        command = self.prefix + [self.programs.dtactd]
        for key, value in self.settings.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            command += ["--set", f"{key}={text}"]
        with open(self.log_name, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log)
        self.port = self._wait_port()
        return self

    def __exit__(self, *_):
        self.process.terminate()
        try:
            self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def _log(self):
        with open(self.log_name, encoding="utf-8") as log:
            return log.read()

    def _wait_port(self):
        for _ in range(200):
            found = re.search(r"listening on 127\.0\.0\.1:(\d+)", self._log())
            if found:
                return int(found.group(1))
            if self.process.poll() is not None:
                break
            time.sleep(0.1)
        self.process.kill()
        raise SystemExit(f"bench: dtactd did not start:\n{self._log()}")

    def status(self):
        done = subprocess.run([self.programs.dtactctl, "--port", str(self.port), "status", "--json"],
                              check=True, capture_output=True, text=True)
        return json.loads(done.stdout)

    def wait_serving(self):
        for _ in range(300):
            if self.status()["state"] == "STATE_SERVING":
                return
            time.sleep(0.1)
        raise SystemExit("bench: the daemon does not serve depth: " + str(self.status()["health"]))

    def rss_kib(self):
        with open(f"/proc/{self.process.pid}/status", encoding="ascii") as file:
            return int(re.search(r"VmRSS:\s+(\d+)", file.read()).group(1))

    def cpu_s(self):
        """CPU seconds of all its threads so far."""
        with open(f"/proc/{self.process.pid}/stat", encoding="ascii") as file:
            fields = file.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def threads(self):
        """"name: policy priority, CPUs" of each thread, from the kernel."""
        lines = []
        for tid in sorted(map(int, os.listdir(f"/proc/{self.process.pid}/task"))):
            with open(f"/proc/{self.process.pid}/task/{tid}/comm", encoding="ascii") as file:
                name = file.read().strip()
            policy = POLICY.get(os.sched_getscheduler(tid) & 0xff, "other")
            priority = os.sched_getparam(tid).sched_priority
            cpus = sorted(os.sched_getaffinity(tid))
            pinned = f"pinned to CPU {cpus[0]}" if len(cpus) == 1 else "not pinned"
            lines.append(f"{name}: {policy}{f' {priority}' if priority else ''}, {pinned}")
        return lines
