"""Power cuts: a guest is killed while it uploads calibrations, or upgrades the packages."""

import random
import shutil
import time
from pathlib import Path

from guest import Guest, GuestError

HERE = Path(__file__).resolve().parent
BOOT_S = 600  # A guest on a busy machine is slow.


def run_once(disc: Path, changes: Path, job: Path, script: str, arguments: str = '') -> str:
    """Boots, runs guest/`script` and powers off; returns its output."""
    _prepare(job, script, arguments)
    with Guest(disc, job, changes, check_disc=True) as guest:
        if guest.finish(BOOT_S, off=True) != 0:
            raise GuestError(f'{script} {arguments} failed{guest.last_words()}')
    return (job / 'log').read_text(errors='replace')


def cut_uploads(disc: Path, installed: Path, job: Path, moments: random.Random, cuts: int):
    """After a power cut at any moment the next boot has the old or the new calibration, complete."""
    _install(disc, installed, job)
    changes = installed.with_name('uploads.cow')
    shutil.copyfile(installed, changes)
    for number in range(1, cuts + 1):
        _prepare(job, 'upload.sh', '')
        with Guest(disc, job, changes, check_disc=True) as guest:
            guest.wait_for_file('begun', BOOT_S)
            seconds = moments.uniform(0, 4)
            time.sleep(seconds)
            guest.cut()
        uploads = (job / 'uploads').read_text().count('sent') if (job / 'uploads').exists() else 0
        print(f'upload: power cut {number} after {seconds:.2f} s, {uploads} uploads')
    print(run_once(disc, changes, job, 'upload.sh', 'only_look'), end='')
    changes.unlink()


def cut_upgrades(disc: Path, installed: Path, job: Path, moments: random.Random, cuts: int):
    """After a power cut at any moment the daemon runs again, and dpkg finishes the upgrade. The moments are
    steps of dpkg's, so that they lie in the upgrade however long it takes."""
    _install(disc, installed, job)
    changes = installed.with_name('upgrade.cow')
    shutil.copyfile(installed, changes)
    _prepare(job, 'upgrade.sh', '')
    with Guest(disc, job, changes, check_disc=True) as guest:
        guest.wait_for_file('done', BOOT_S)
        guest.cut()
    steps = len(list((job / 'steps').iterdir()))
    for number in range(1, cuts + 1):
        shutil.copyfile(installed, changes)
        _prepare(job, 'upgrade.sh', '')
        step, seconds = moments.randint(1, steps), moments.uniform(0, 0.5)
        with Guest(disc, job, changes, check_disc=True) as guest:
            guest.wait_for_file(f'steps/{step}', BOOT_S)
            time.sleep(seconds)
            guest.cut()
        print(f'upgrade: power cut {number} {seconds:.2f} s after step {step} of {steps}')
        print(run_once(disc, changes, job, 'upgrade.sh', 'repair'), end='')
    changes.unlink()


def _install(disc: Path, installed: Path, job: Path):
    if not installed.exists():
        run_once(disc, installed, job, 'installed.sh')


def _prepare(job: Path, script: str, arguments: str):
    for name in ('begun', 'done', 'uploads'):
        (job / name).unlink(missing_ok=True)
    shutil.rmtree(job / 'steps', ignore_errors=True)
    (job / 'steps').mkdir()
    text = (HERE / 'guest' / 'lib.sh').read_text() + (HERE / 'guest' / script).read_text()
    (job / 'run').write_text(f'set -- {arguments}\n{text}')
