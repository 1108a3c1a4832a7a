#!/usr/bin/python3
"""Installs the Debian packages in a guest that boots Debian with systemd, and tests the service there.

The cases, scripts in cases/, run one after another in one guest, as root; the first is install. The
power cuts (--cuts) end guests of their own at random moments. For arm64 (--architecture) the guest is an
emulated machine with Debian's kernel: some ten times slower, so its sensor is asked for fewer frames.

Exit code: 0 all passed; 77 the guest cannot be had on this machine, which says why; else failed.
"""

import argparse
import fcntl
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path

import packages
from guest import KERNEL, EmulatedGuest, Guest, GuestError
from power_cut import cut_uploads, cut_upgrades

HERE = Path(__file__).resolve().parent
SHORT = ('install', 'purge')
ALL = ('install', 'restart', 'hung_camera', 'broken_configuration', 'reload', 'state_disc', 'clock',
       'two_sensors', 'outside', 'credentials', 'devices', 'upgrade', 'purge')
# Cases that differ on another processor's programs or kernel; the others would only repeat.
EMULATED = ('install', 'restart', 'purge')


def job_folder(folder: Path, debs: Path, emulated: bool) -> Path:
    """The folder that the guest sees as /job, with everything that a case needs except calibrations."""
    for name in ('packages', 'newer', 'modules'):
        shutil.rmtree(folder / name, ignore_errors=True)
    (folder / 'packages').mkdir(parents=True)
    for deb in packages.installable(debs):
        shutil.copy(deb, folder / 'packages')
    if emulated:
        return folder
    packages.make_newer(debs, folder / 'newer')
    shutil.copytree(KERNEL / 'modules', folder / 'modules', ignore=lambda _, names: [
        name for name in names if not name.endswith('.ko')])
    return folder


def run_cases(disc: Path, folder: Path, job: Path, names: list[str], emulated: bool) -> bool:
    """True when all passed. The others run after a failed case, too."""
    lines = ['echo "booted in $(cut -d " " -f 1 /proc/uptime) s: $(uname -srm)"',
             f'export emulated={"1" if emulated else ""}', 'failed=0']
    for name in names:
        shutil.copy(HERE / 'cases' / f'{name}.sh', job)
        lines.append(f"echo '== {name}'; began=$SECONDS")
        begin = '' if name in SHORT else 'begin_case; '
        lines.append(f"bash -c '. /job/lib.sh; {begin}. /job/{name}.sh' || {{ failed=1; echo 'FAILED: {name}'; "
                     "journalctl --no-pager -b -o cat -u 'dtactd*' | tail -n 12; }")
        lines.append(f'echo "{name} took $((SECONDS - began)) s"')
    lines.append('exit $failed')
    for name in ('lib.sh', 'stream.py'):
        shutil.copy(HERE / 'guest' / name, job)
    (job / 'run').write_text('\n'.join(lines) + '\n')
    changes = folder / 'cases.cow'
    changes.unlink(missing_ok=True)
    try:
        with (EmulatedGuest if emulated else Guest)(disc, job, changes) as guest:
            code = guest.finish(300 + (1200 if emulated else 300) * len(names), off=False)
    except GuestError as error:
        print(f'run.py: the guest: {error}')
        return False
    finally:
        changes.unlink(missing_ok=True)
    print((job / 'log').read_text(errors='replace'), end='')
    if code:
        print(f"run.py: the guest's journal is {job}/journal")
    return code == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--suite', default='bookworm', choices=('bookworm', 'trixie'))
    parser.add_argument('--build', type=Path, default=HERE.parents[1] / 'build' / 'dev',
                        help='the build folder; the discs and logs are below it (build/dev)')
    parser.add_argument('--architecture', default='amd64', choices=('amd64', 'arm64'))
    parser.add_argument('--packages', type=Path, help='the folder of .deb files of that Debian (BUILD/packages, or '
                        'what the platform tests have built for arm64)')
    parser.add_argument('--all', action='store_true', help='every case that makes sense for the '
                        'architecture, instead of installing and purging')
    parser.add_argument('--cuts', type=int, default=0, help='number of power cuts of an upload, and of an upgrade')
    parser.add_argument('--seed', type=int, default=14, help='of the moments of the power cuts')
    parser.add_argument('case', nargs='*', help='these cases alone, after install')
    arguments = parser.parse_args()
    emulated = arguments.architecture != 'amd64'
    if emulated and (arguments.cuts or set(arguments.case) - set(EMULATED)):
        parser.error(f'for {arguments.architecture} there are no power cuts, and the cases {" ".join(EMULATED)}')
    if not emulated and not (KERNEL / 'linux').exists():
        print(f'run.py: skipped: no guest kernel in {KERNEL}; run tests/kernel/setup.sh')
        return 77
    folder = arguments.build.resolve() / 'install' / arguments.suite
    debs = arguments.packages or arguments.build / 'packages'
    if emulated:
        folder = folder.with_name(f'{arguments.suite}-{arguments.architecture}')
        release = {'bookworm': 12, 'trixie': 13}[arguments.suite]
        debs = arguments.packages or arguments.build / f'packages-debian{release}-{arguments.architecture}'
    folder.mkdir(parents=True, exist_ok=True)
    alone = (folder / 'lock').open('w', encoding='utf-8')
    try:
        fcntl.flock(alone, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until the process ends
    except BlockingIOError:
        print(f'run.py: another run uses the discs in {folder}: wait for it, or name another --build folder')
        return 1
    disc = folder / 'disc.ext4'
    made = subprocess.run([HERE / 'root.sh', arguments.suite, arguments.architecture, debs, disc], check=False)
    if made.returncode:
        return made.returncode
    began = time.monotonic()
    job = job_folder(folder / 'job', debs, emulated)
    names = list((EMULATED if emulated else ALL) if arguments.all else SHORT)
    if arguments.case:
        names = ['install'] + [name for name in arguments.case if name != 'install']
    if not emulated and (arguments.cuts or set(names) - set(SHORT)):
        subprocess.run([HERE / 'calibrations.sh', arguments.build, job / 'calibrations'], check=True)
    passed = run_cases(disc, folder, job, names, emulated)
    if arguments.cuts:
        moments = random.Random(arguments.seed)
        installed = folder / 'installed.cow'
        installed.unlink(missing_ok=True)
        for cut in (cut_uploads, cut_upgrades):
            try:
                cut(disc, installed, job, moments, arguments.cuts)
            except GuestError as error:
                print(f'run.py: {cut.__name__}: {error}')
                passed = False
    print(f'run.py: {"passed" if passed else "FAILED"} in {time.monotonic() - began:.0f} s')
    return 0 if passed else 1


if __name__ == '__main__':
    sys.exit(main())
