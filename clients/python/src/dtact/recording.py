"""Recordings are made by `dtactctl record`, as a program of its own: it keeps up with the sensor
whatever this one does, and writes the MCAP that all other tools read."""
from __future__ import annotations

import atexit
import os
import selectors
import shutil
import signal
import subprocess
import time
from pathlib import Path
from types import TracebackType

from .address import Address
from .errors import Error

#: Time for dtactctl to start.
_START_S = 5.0
#: Time for dtactctl to finish the file after it was asked to end.
_FINISH_S = 30.0


class Recording:
    """One that runs until the end of its `with` block, or stop(). Its first frame is written when this
    is made, or Error is raised."""

    def __init__(self, path: str | Path, address: Address, options: list[str], timeout: float) -> None:
        program = shutil.which("dtactctl")
        if program is None:
            raise Error("dtactctl, which records, is not in PATH: install dtactd's programs here")
        self.path = Path(path)
        command = [program, *_target(address), *options, "record", "-o", str(path)]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        self._said = b""  # On standard error so far.
        self._maker = os.getpid()
        # Without stop() it would record until the disk is full.
        atexit.register(self._end)
        try:
            started = self._await_start(_START_S + timeout)
        except BaseException:
            self._end()
            raise
        if not started:
            self._end()
            raise Error(self._reason() or f"{path} is not recorded: no frame came within {timeout:g} s; "
                        "dtactctl status says why")

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.stop()

    def stop(self) -> None:
        """Finishes the file. Error when it could not be written to the end."""
        if not self._end():
            raise Error(f"dtactctl did not finish {self.path} within {_FINISH_S:g} s")
        if self._process.returncode != 0:
            raise Error(self._reason() or f"dtactctl record ended with {self._process.returncode}")

    def _await_start(self, limit: float) -> bool:
        """Reads what dtactctl says until it records. False: it has ended, or has not begun within
        `limit` seconds."""
        assert self._process.stderr is not None
        deadline = time.monotonic() + limit
        with selectors.DefaultSelector() as waiting:
            waiting.register(self._process.stderr, selectors.EVENT_READ)
            while b"recording to " not in self._said:
                if not waiting.select(max(0.0, deadline - time.monotonic())):
                    return False
                part = os.read(self._process.stderr.fileno(), 4096)
                if not part:
                    return False
                self._said += part
        return True

    def _end(self) -> bool:
        """Lets dtactctl finish, unless it has. False: it did not, and was killed."""
        assert self._process.stderr is not None
        if self._process.stderr.closed or os.getpid() != self._maker:
            return True
        atexit.unregister(self._end)
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
        try:
            self._said += self._process.communicate(timeout=_FINISH_S)[1]
            return True
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            return False

    def _reason(self) -> str:
        lines = self._said.decode(errors="replace").splitlines()
        said = "\n".join(line for line in lines if not line.startswith("recording to "))
        return said.strip()


def _target(address: Address) -> list[str]:
    if address.path:
        return ["--host", f"unix:{address.path}"]
    return ["--host", address.host, "--port", str(address.port)]
