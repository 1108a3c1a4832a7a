#!/usr/bin/env python3
"""journal_test.py DTACTD DTACTCTL: in a mount namespace of its own the test is journald. What the
daemon sends there has priorities and fields, and nothing of it goes to standard error but what a process
ends with.
"""
import json
import os
import pathlib
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile

JOURNAL = pathlib.Path("/run/systemd/journal/socket")


def parse(entry):
    """The fields of an entry in the journal's native protocol, https://systemd.io/JOURNAL_NATIVE_PROTOCOL."""
    fields = {}
    while entry:
        line, _, entry = entry.partition(b"\n")
        name, equals, value = line.partition(b"=")
        if not equals:
            size = struct.unpack("<Q", entry[:8])[0]
            value, entry = entry[8:8 + size], entry[9 + size:]
        fields[name.decode()] = value.decode()
    return fields


class Journal:
    def __init__(self):
        JOURNAL.parent.mkdir(parents=True)
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(JOURNAL))
        self.entries = []

    def until(self, wanted):
        """The first entry, past or future, for which `wanted` returns true."""
        for entry in self.entries:
            if wanted(entry):
                return entry
        self.socket.settimeout(60)
        while True:
            entry = parse(self.socket.recv(1 << 16))
            self.entries.append(entry)
            if wanted(entry):
                return entry


def expect(entry, **fields):
    for name, value in fields.items():
        assert entry.get(name) == value, f"{name} is not {value!r} in {entry}"


def test(daemon, ctl, folder):
    journal = Journal()
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.settimeout(60)
    manager.bind(str(folder / "notify"))
    log = folder / "stderr"
    config = folder / "dtactd.toml"
    # The configured camera does not exist.
    config.write_text("camera.backend = 'v4l2'\ncamera.v4l2.device = 'serial:none'\nring.backend = 'null'\nstate_dir = 'state'\n"
                      "net.port = 0\nnet.name = 'left'\n")
    with open(log, "wb") as stderr:
        about = os.fstat(stderr.fileno())
        process = subprocess.Popen(
            [daemon, "--config", config], stderr=stderr,
            env={**os.environ, "JOURNAL_STREAM": f"{about.st_dev}:{about.st_ino}",
                 "NOTIFY_SOCKET": str(folder / "notify")})
    try:
        listening = journal.until(lambda entry: "listening on" in entry["MESSAGE"])
        expect(listening, PRIORITY="6", SYSLOG_IDENTIFIER="dtactd", DTACT_SENSOR="left")
        assert "CODE_FILE" not in listening, listening
        port = listening["MESSAGE"].rpartition(":")[2]
        while not manager.recv(4096).startswith(b"READY=1"):
            pass

        # The health flag, by its name.
        trouble = journal.until(lambda entry: "DTACT_HEALTH" in entry)
        expect(trouble, PRIORITY="4", DTACT_HEALTH="camera_fault", DTACT_SENSOR="left")
        assert trouble["MESSAGE"].startswith("camera_fault: The camera gives no usable frames."), trouble

        # The client, by its address.
        subprocess.run([ctl, "--port", port, "status"], check=True, stdout=subprocess.DEVNULL)
        left = journal.until(lambda entry: "disconnected" in entry["MESSAGE"])
        expect(left, PRIORITY="6", DTACT_SENSOR="left")
        assert left["DTACT_CLIENT"].startswith("127.0.0.1:"), left
        assert f"client {left['DTACT_CLIENT']} " in left["MESSAGE"], left

        # The same mistake twenty times is logged once, with a count before the next line, which may be one
        # about the camera in between.
        config.write_text("camera.width = 1\n")
        for _ in range(20):
            process.send_signal(signal.SIGHUP)
            while not manager.recv(4096).startswith(b"READY=1"):
                pass
        mistake = journal.until(lambda entry: "stays as it was" in entry["MESSAGE"])
        expect(mistake, PRIORITY="3")
        assert f"{config}:1: camera.width" in mistake["MESSAGE"], mistake
    finally:
        process.terminate()
        assert process.wait(60) == 0
    journal.until(lambda entry: entry["MESSAGE"] == "SIGTERM: stopping")
    lines = [entry["MESSAGE"] for entry in journal.entries]
    written = sum("stays as it was" in line for line in lines)
    skipped = sum(int(line.split()[1]) for line in lines if line.startswith("Skipped "))
    assert written + skipped == 20 and written < 10, lines
    assert not log.read_bytes(), log.read_text()

    # The last words of a process, on the stream that is known as the unit's.
    with open(log, "wb") as stderr:
        check = subprocess.run([daemon, "--config", config, "--check-config"], stderr=stderr, check=False,
                               env={**os.environ, "JOURNAL_STREAM": f"{about.st_dev}:{about.st_ino}"})
    assert check.returncode == 1
    assert log.read_text().startswith(f"<2>{config}:1: camera.width"), log.read_text()
    print(json.dumps(journal.entries, indent=1))


def main():
    if sys.argv[3:] != ["inside"]:
        unshare = ["unshare", "--mount", "--map-root-user"]
        if not shutil.which("unshare") or subprocess.run([*unshare, "true"], check=False,
                                                         stderr=subprocess.DEVNULL).returncode:
            print("skipped: no namespaces can be made here")
            return 77
        os.execvp("unshare", [*unshare, sys.executable, "-B", *sys.argv, "inside"])
    subprocess.run(["mount", "-t", "tmpfs", "none", "/run"], check=True)
    with tempfile.TemporaryDirectory() as folder:
        test(sys.argv[1], sys.argv[2], pathlib.Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
