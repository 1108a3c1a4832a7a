#!/usr/bin/env python3
"""tidy.py BUILD: clang-tidy over every source file of ours that BUILD compiles.

BUILD is up to date. A file that passed is not looked at again until something that it is made of
changes: its own text, every header's, the compiler's command line, the rules or the tool's version.
What passed is kept by a digest of all that in $TIDY_CACHE (default ~/.cache/dtactd-tidy).

Prints what clang-tidy says of each file that does not pass; status 1 when there is one.
"""

import concurrent.futures
import functools
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys

TOOL = "clang-tidy-19"
OURS = re.compile(r"/(hal|daemon|proto|clients|tests)/.*\.cpp$")


@functools.cache
def digest_of(path):
    try:
        return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
    except OSError:
        return "missing"


def headers(build):
    """Object file -> what ninja knows that it was compiled from."""
    told = subprocess.run(["ninja", "-C", build, "-t", "deps"], check=True, capture_output=True, text=True)
    read, current = {}, None
    for line in told.stdout.splitlines():
        if line.startswith("    "):
            current.append(line.strip())
        elif ": #deps" in line:
            current = read.setdefault(line.split(": #deps")[0], [])
    return read


def key(entry, read, common):
    made = re.search(r" -o (\S+)", entry["command"]).group(1)
    if made not in read:
        sys.exit(f"tidy: {made} is not built: bring {entry['directory']} up to date first")
    texts = (digest_of(os.path.join(entry["directory"], path)) for path in read[made])
    return hashlib.sha256("\n".join([common, entry["command"], *texts]).encode()).hexdigest()


def main():
    build = sys.argv[1]
    cache = pathlib.Path(os.environ.get("TIDY_CACHE") or pathlib.Path.home() / ".cache/dtactd-tidy")
    cache.mkdir(parents=True, exist_ok=True)
    version = subprocess.run([TOOL, "--version"], check=True, capture_output=True, text=True).stdout
    rules = pathlib.Path(".clang-tidy").read_text()
    rules_of_tests = rules + pathlib.Path("tests/.clang-tidy").read_text()
    entries = json.loads(pathlib.Path(build, "compile_commands.json").read_text())
    source = os.getcwd() + "/"
    ours = [e for e in entries if e["file"].startswith(source) and OURS.match(e["file"][len(source) - 1 :])]
    read = headers(build)

    def check(entry):
        in_tests = entry["file"].startswith(source + "tests/")
        passed = cache / key(entry, read, version + (rules_of_tests if in_tests else rules))
        if passed.exists():
            return "known"
        told = subprocess.run([TOOL, "-quiet", "-p", build, entry["file"]], capture_output=True, text=True)
        if told.returncode == 0:
            passed.touch()
            return "passed"
        print(told.stdout + told.stderr, flush=True)
        return "failed"

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        verdicts = list(pool.map(check, ours))
    count = verdicts.count
    print(f"tidy: {len(ours)} files: {count('known')} known, {count('passed')} passed, {count('failed')} failed")
    sys.exit(1 if count("failed") else 0)


if __name__ == "__main__":
    main()
