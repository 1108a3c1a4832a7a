#!/usr/bin/env python3
"""tidy.py BUILD: clang-tidy over every source file of ours that BUILD compiles.

BUILD is up to date. A file that passed is not looked at again until something that it was compiled
with changes: its own text, the files' that BUILD put together with it, every header's, the compiler's
command line, the rules or the tool's version. What passed is kept by a digest of all that in $TIDY_CACHE
(default ~/.cache/dtactd-tidy).

The tool spends most of its time in the system's headers. So files of one folder that are compiled
alike are looked at together, as one that includes them, which takes a tenth of the time; where their
names get in each other's way, one by one.

Prints what clang-tidy says of each file that does not pass; status 1 when there is one.
"""

import collections
import concurrent.futures
import functools
import hashlib
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

TOOL = "clang-tidy-19"
OURS = re.compile(r"/(hal|daemon|proto|clients|tests)/.*\.cpp$")
OURS_TOGETHER = r"/(hal|daemon|proto|clients|tests)/.*\.[ch]pp$"
TOGETHER = 10  # files; more take a gigabyte of memory


@functools.cache
def digest_of(path):
    try:
        return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
    except OSError:
        return "missing"


def headers(build):
    """Object file -> its sources, from ninja's dependencies."""
    reported = subprocess.run(["ninja", "-C", build, "-t", "deps"], check=True, capture_output=True, text=True)
    read, current = {}, None
    for line in reported.stdout.splitlines():
        if line.startswith("    "):
            current.append(line.strip())
        elif ": #deps" in line:
            current = read.setdefault(line.split(": #deps")[0], [])
    return read


def apart(entry):
    """An entry for each file in one of CMake's unity sources (CMAKE_UNITY_BUILD), or the entry itself."""
    if not re.search(r"/Unity/unity_\d+_cxx\.cxx$", entry["file"]):
        return [entry]
    text = pathlib.Path(entry["file"]).read_text()
    return [{**entry, "file": file} for file in re.findall(r'^#include "(.+)"$', text, re.MULTILINE)]


def key(entry, read, common):
    made = re.search(r" -o (\S+)", entry["command"]).group(1)
    if made not in read:
        sys.exit(f"tidy: {made} is not built: bring {entry['directory']} up to date first")
    texts = (digest_of(os.path.join(entry["directory"], path)) for path in read[made])
    return hashlib.sha256("\n".join([common, entry["command"], entry["file"], *texts]).encode()).hexdigest()


def flags(entry):
    """The command line without input and output."""
    words = shlex.split(entry["command"])[1:]
    return words[: words.index("-o")]


def groups(entries):
    """Groups of at most TOGETHER files of one folder with the same options."""
    alike = collections.defaultdict(list)
    for entry in entries:
        alike[os.path.dirname(entry["file"]), *flags(entry)].append(entry)
    return [same[i : i + TOGETHER] for same in alike.values() for i in range(0, len(same), TOGETHER)]


def run(arguments):
    return subprocess.run([TOOL, "-quiet", *arguments], capture_output=True, text=True)


def run_together(entries):
    first = entries[0]
    # The rules are those of the files' folder, not of the folder of the file that includes them.
    rules = subprocess.run(
        [TOOL, "--dump-config", first["file"], "--"], check=True, capture_output=True, text=True
    ).stdout
    with tempfile.NamedTemporaryFile("w", suffix=".cpp") as file:
        file.writelines(f'#include "{entry["file"]}"\n' for entry in entries)
        file.flush()
        seen = ["--checks=-bugprone-suspicious-include", f"--header-filter={OURS_TOGETHER}"]
        return run([f"--config={rules}", *seen, file.name, "--", *flags(first)])


def main():
    build = sys.argv[1]
    cache = pathlib.Path(os.environ.get("TIDY_CACHE") or pathlib.Path.home() / ".cache/dtactd-tidy")
    cache.mkdir(parents=True, exist_ok=True)
    version = subprocess.run([TOOL, "--version"], check=True, capture_output=True, text=True).stdout
    rules = pathlib.Path(".clang-tidy").read_text()
    rules_of_tests = rules + pathlib.Path("tests/.clang-tidy").read_text()
    compiled = json.loads(pathlib.Path(build, "compile_commands.json").read_text())
    source = os.getcwd() + "/"
    entries = [file for entry in compiled for file in apart(entry)]
    ours = [e for e in entries if e["file"].startswith(source) and OURS.match(e["file"][len(source) - 1 :])]
    read = headers(build)

    def passed(entry):
        in_tests = entry["file"].startswith(source + "tests/")
        return cache / key(entry, read, version + (rules_of_tests if in_tests else rules))

    def verdict(entries, reported):
        if reported.returncode == 0:
            for entry in entries:
                passed(entry).touch()
            return collections.Counter(passed=len(entries))
        print(reported.stdout + reported.stderr, flush=True)
        return collections.Counter(failed=len(entries))

    def check(entries):
        if len(entries) > 1:
            reported = run_together(entries)
            # Files that do not compile together, or only with warnings, are checked one by one.
            if reported.returncode == 0 or "[clang-diagnostic-" not in reported.stdout:
                return verdict(entries, reported)
        verdicts = collections.Counter()
        for entry in entries:
            verdicts.update(verdict([entry], run([entry["file"], "--", *flags(entry)])))
        return verdicts

    unknown = [entry for entry in ours if not passed(entry).exists()]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        count = sum(pool.map(check, groups(unknown)), collections.Counter())
    print(
        f"tidy: {len(ours)} files: {len(ours) - len(unknown)} known, {count['passed']} passed, "
        f"{count['failed']} failed or together with one that failed"
    )
    sys.exit(1 if count["failed"] else 0)


if __name__ == "__main__":
    main()
