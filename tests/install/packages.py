"""Packages of a next version, without building anything."""

import subprocess
import tempfile
from pathlib import Path


def installable(folder: Path) -> list[Path]:
    """The packages in a folder to install: without debugging symbols."""
    return sorted(deb for deb in folder.glob('*.deb') if '-dbgsym_' not in deb.name)


def make_newer(debs: Path, out: Path):
    """Copies of the packages whose version ends in .newer and whose conffile differs."""
    out.mkdir()
    for deb in installable(debs):
        with tempfile.TemporaryDirectory() as folder:
            tree = Path(folder) / 'tree'
            subprocess.run(['dpkg-deb', '--raw-extract', deb, tree], check=True)
            version = subprocess.run(['dpkg-deb', '-f', deb, 'Version'], check=True, capture_output=True,
                                     text=True).stdout.strip()
            control = tree / 'DEBIAN' / 'control'
            # The version itself, and where one package depends on the same version of another.
            control.write_text(control.read_text().replace(version, f'{version}.newer'))
            configuration = tree / 'etc' / 'dtactd' / 'dtactd.toml'
            if configuration.exists():
                configuration.write_text(configuration.read_text() + '# A line of the newer version.\n')
            subprocess.run(['dpkg-deb', '--root-owner-group', '-Zgzip', '-z1', '--build', tree, out], check=True,
                           stdout=subprocess.DEVNULL)
