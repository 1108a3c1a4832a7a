"""Everything is in pyproject.toml; Debian's pybuild takes a folder for setuptools' by this file."""
from setuptools import setup

setup()
