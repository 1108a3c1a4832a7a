"""A Debian guest on User Mode Linux, or in an emulated arm64 machine: a disc, a folder that both sides see,
and a power switch."""

import os
import signal
import subprocess
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
KERNEL = Path(os.environ.get('KERNEL_CACHE', Path.home() / '.cache/dtactd-kernel'))


class GuestError(Exception):
    """A failure of the guest; the message has its last output."""


class Guest:
    """A running guest on User Mode Linux. It ends at the latest with its `with` block.

    disc: an ext4 image. What the guest writes goes into the file `changes` (copy on write), made where it
    is not there yet.
    check_disc: e2fsck has a look before the disc is mounted for writing.
    job: the folder that the guest sees as /job; its `run` is executed there, as root, by bash.
    """

    def __init__(self, disc: Path, job: Path, changes: Path, check_disc: bool = False):
        self.job = job
        for name in ('rc', 'log', 'journal'):
            (job / name).unlink(missing_ok=True)
        console = open(job / 'console', 'wb')
        # It ends with this process in every case: the namespace's first process takes all with it.
        tied = ['setpriv', '--pdeathsig', 'KILL', 'unshare', '--pid', '--fork', '--kill-child=KILL']
        self._process = subprocess.Popen(
            [*tied, *self._command(disc, changes, check_disc)],
            stdin=subprocess.DEVNULL, stdout=console, stderr=console, start_new_session=True)
        console.close()

    def _command(self, disc: Path, changes: Path, check_disc: bool) -> list[str | Path]:
        # Every write reaches the host's file before the guest sees it done: a kill is a power cut of a
        # disc without a volatile cache.
        return [KERNEL / 'linux', 'mem=768M', f'ubd0={changes},{disc}', 'root=/dev/ubda',
                *(('ro', 'fsck.mode=force') if check_disc else ('rw',)), 'init=/sbin/init',
                f'hostfs={self.job}', f'uml_dir={self.job}/uml/', 'ssl=null', 'con=null', 'con0=fd:0,fd:1', 'quiet',
                'systemd.show_status=false']

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.cut()

    def cut(self):
        """Cuts the power. The guest's kernel and its processes are one process group on the host."""
        try:
            os.killpg(self._process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        self._process.wait()

    def wait_for_file(self, name: str, limit_s: float):
        """Returns once the guest's commands have made /job/name."""
        end = time.monotonic() + limit_s
        while not (self.job / name).exists():
            if self._process.poll() is not None:
                raise GuestError(f'it ended before it made /job/{name}{self.last_words()}')
            if time.monotonic() > end:
                raise GuestError(f'it made no /job/{name} within {limit_s:.0f} s{self.last_words()}')
            time.sleep(0.02)

    def finish(self, limit_s: float, off: bool) -> int:
        """The exit code of /job/run. With `off` the guest shuts down and its disc is clean."""
        self.wait_for_file('rc', limit_s)
        if off:
            try:
                self._process.wait(60)
            except subprocess.TimeoutExpired as timeout:
                raise GuestError(f'it does not power off{self.last_words()}') from timeout
        return int((self.job / 'rc').read_text())

    def last_words(self) -> str:
        words = ''
        for name in ('log', 'console'):
            file = self.job / name
            if file.exists():
                lines = file.read_text(errors='replace').splitlines()[-40:]
                words += f'\n--- {file}\n' + '\n'.join(lines)
        return words


class EmulatedGuest(Guest):
    """A running guest in QEMU's software emulation, with the kernel beside its disc.

    Its disc has a cache that forgets, so that there is nothing to check after a power cut.
    """

    def _command(self, disc: Path, changes: Path, check_disc: bool) -> list[str | Path]:
        assert not check_disc
        if not changes.exists():
            subprocess.run(['qemu-img', 'create', '-q', '-f', 'qcow2', '-b', disc, '-F', 'raw', changes], check=True)
        return [HERE / 'qemu.sh', disc.parent, changes, 'qcow2', self.job, 'systemd.show_status=false']
