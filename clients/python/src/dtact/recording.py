"""Recordings are made by `dtactctl record`, as a program of its own: it keeps up with the sensor
whatever this one does, and writes the MCAP that all other tools read."""
from __future__ import annotations

import shutil
import signal
import subprocess
from pathlib import Path
from types import TracebackType

from .address import Address
from .errors import Error

#: Time for dtactctl to finish the file after it was asked to end.
_FINISH_S = 30.0


class Recording:
    """One that runs until the end of its `with` block, or stop(). Frames begin to be written as soon
    as dtactctl has connected, some hundredths of a second after."""

    def __init__(self, path: str | Path, address: Address, options: list[str]) -> None:
        program = shutil.which("dtactctl")
        if program is None:
            raise Error("dtactctl, which records, is not in PATH: install dtactd's programs here")
        self.path = Path(path)
        command = [program, *_target(address), *options, "record", "-o", str(path)]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                         text=True)

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.stop()

    def stop(self) -> None:
        """Finishes the file. Error when it could not be written to the end."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
        try:
            _, said = self._process.communicate(timeout=_FINISH_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            raise Error(f"dtactctl did not finish {self.path} within {_FINISH_S:g} s") from None
        if self._process.returncode != 0:
            raise Error(said.strip() or f"dtactctl record ended with {self._process.returncode}")


def _target(address: Address) -> list[str]:
    if address.path:
        return ["--host", f"unix:{address.path}"]
    return ["--host", address.host, "--port", str(address.port)]
