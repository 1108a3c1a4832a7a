"""The one part of the package that is compiled, and that it can do without; see pyproject.toml."""
from setuptools import Extension, setup

setup(
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
    ext_modules=[
        Extension(
            "dtact._rvl",
            ["src/dtact/_rvl.c"],
            # One build for every Python from 3.11 on, whose limited interface has buffers.
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            py_limited_api=True,
            extra_compile_args=["-O2", "-Wall", "-Wextra"],
            optional=True,  # Without a compiler, dtact asks the daemon for int16 instead.
        )
    ]
)
