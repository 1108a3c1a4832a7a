#!/usr/bin/env python3
"""Puts one plausible bug after another into the code and asks whether a test notices.

Each *.toml beside this file is an area and lists its bugs: a file, a text that stands in it exactly
once, what stands there instead, what a user would suffer, and the tests that are built and run. All
of it happens in a copy of the tree under --work with a build folder of its own, so that neither an
interrupt nor a killed run leaves a bug behind.

Prints one line a bug and the share of each area. Exit code: 0 every bug was caught, 1 some were not,
or the list or the tree is not in order.
"""
import argparse
import collections
import itertools
import os
import pathlib
import re
import signal
import subprocess
import sys
import time
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
KEYS = {"name", "file", "line", "instead", "harm", "tests"}
CAUGHT, SURVIVED, UNBUILT = "caught", "SURVIVED", "does not build"

Mutant = collections.namedtuple("Mutant", "area name file line instead harm tests")


class Trouble(Exception):
    """The list or the tree is not in order; the text says where and what to do."""


def load():
    """All mutants, by area and file, so that neighbours share most of what is built."""
    mutants = []
    for path in sorted(HERE.glob("*.toml")):
        document = tomllib.loads(path.read_text())
        for entry in document["mutant"]:
            entry = {"tests": document.get("tests"), **entry}
            if set(entry) != KEYS or not entry["tests"]:
                raise Trouble(f"{path.name}: {entry.get('name', '?')}: needs the keys "
                              f"{', '.join(sorted(KEYS))} and no other")
            mutants.append(Mutant(path.stem, **entry))
    names = collections.Counter(m.name for m in mutants)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        raise Trouble(f"names must differ: {', '.join(twice)}")
    return sorted(mutants, key=lambda m: (m.area, m.file))


def chosen(mutants, names):
    unknown = set(names) - {m.name for m in mutants} - {m.area for m in mutants}
    if unknown:
        raise Trouble(f"no mutant or area is named {', '.join(sorted(unknown))}; --list names them")
    return [m for m in mutants if not names or m.name in names or m.area in names]


def check(mutants):
    """Every text stands where it is looked for."""
    wrong = []
    for m in mutants:
        path = ROOT / m.file
        found = path.read_text().count(m.line) if path.is_file() else 0
        if found != 1 or m.line == m.instead:
            wrong.append(f"  {m.area}.toml: {m.name}: its line stands {found} times in {m.file}")
    if wrong:
        raise Trouble("the code has changed; bring these up to date:\n" + "\n".join(wrong))


def end(process):
    """Politely at first: ninja gives its compilers groups of their own and ends them itself."""
    os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)


class Tree:
    """A copy of the sources with a build folder, kept from run to run."""

    def __init__(self, work):
        self.source = work / "tree"
        self.build = work / "build"
        self.copy()
        self.configure()

    def copy(self):
        """Writes what differs, with the present time: only so does the build see a reverted bug."""
        listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT,
                                check=True, capture_output=True).stdout.decode().split("\0")
        wanted = {name for name in listed if name and (ROOT / name).is_file()}
        for name in sorted(wanted):
            here, there = ROOT / name, self.source / name
            content = here.read_bytes()
            if there.is_file() and there.read_bytes() == content:
                continue
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_bytes(content)
            there.chmod(here.stat().st_mode)
        for path in self.source.rglob("*"):
            if path.is_file() and str(path.relative_to(self.source)) not in wanted:
                path.unlink()

    def configure(self):
        done = self.run(["cmake", "--preset", "mutants", "-B", self.build], 600)
        if done.returncode != 0:
            raise Trouble(f"cmake failed:\n{done.stdout}")

    def run(self, command, seconds, **environment):
        """A process group of its own, so that nothing of a hanging test outlives its time."""
        with subprocess.Popen(command, cwd=self.source, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, errors="replace",
                              start_new_session=True,
                              env={**os.environ, **environment}) as process:
            try:
                output, _ = process.communicate(timeout=seconds)
            except subprocess.TimeoutExpired:
                end(process)
                output, _ = process.communicate()
            except BaseException:
                end(process)
                raise
        return subprocess.CompletedProcess(command, process.returncode, output)

    def make(self, targets):
        return self.run(["cmake", "--build", self.build, "--target", *targets], 3600)

    def test(self, targets):
        """The first failure ends it. A test may hang with a bug: 120 s are its limit."""
        return self.run(["ctest", "--test-dir", self.build, "--output-on-failure",
                         "--stop-on-failure", "--timeout", "120",
                         "-R", f"^({'|'.join(targets)})$"], 900,
                        GTEST_BRIEF="1", GTEST_FAIL_FAST="1")


def verdict(tree, mutant):
    """What becomes of the bug, and by which test."""
    path = tree.source / mutant.file
    whole = path.read_text()
    try:
        path.write_text(whole.replace(mutant.line, mutant.instead))
        made = tree.make(mutant.tests)
        if made.returncode != 0:
            error = re.search(r"error: (.*)", made.stdout)
            return UNBUILT, error.group(1) if error else ""
        tested = tree.test(mutant.tests)
        if tested.returncode == 0:
            return SURVIVED, mutant.harm
        failed = re.search(r"\[  FAILED  \] (\S+?)[ ,]", tested.stdout)
        how = re.search(r"\*\*\*(\w+)", tested.stdout)
        return CAUGHT, failed.group(1) if failed else (how.group(1) if how else "")
    finally:
        path.write_text(whole)


def expect_well(tree, mutants):
    """Without a bug all of the tests pass; else nothing that follows would mean anything."""
    targets = sorted({test for m in mutants for test in m.tests})
    made = tree.make(targets)
    if made.returncode != 0:
        raise Trouble(f"the tree does not build:\n{made.stdout}")
    tested = tree.test(targets)
    if tested.returncode != 0:
        raise Trouble(f"the tests fail without any bug:\n{tested.stdout}")


def print_share(name, verdicts):
    built = len(verdicts) - verdicts.count(UNBUILT)
    caught = verdicts.count(CAUGHT)
    rest = f", {verdicts.count(UNBUILT)} do not build" if built < len(verdicts) else ""
    print(f"{name:12} {caught} of {built} caught ({100 * caught / max(1, built):.0f} %){rest}")


def summary(results):
    for area in sorted({m.area for m, _ in results}):
        of_area = [what for m, what in results if m.area == area]
        print_share(area, of_area)
    print_share("all", [what for _, what in results])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("names", nargs="*", help="areas or mutants; all when left out")
    parser.add_argument("--list", action="store_true", help="name them and run nothing")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "build" / "mutants")
    options = parser.parse_args()
    mutants = chosen(load(), options.names)
    check(mutants)
    if options.list:
        for m in mutants:
            print(f"{m.area:12} {m.name:34} {m.file}: {m.harm}")
        return 0
    tree = Tree(options.work.resolve())
    results = []
    for _, of_area in itertools.groupby(mutants, key=lambda m: m.area):
        of_area = list(of_area)
        expect_well(tree, of_area)
        for mutant in of_area:
            begin = time.monotonic()
            what, by = verdict(tree, mutant)
            results.append((mutant, what))
            seconds = time.monotonic() - begin
            print(f"{mutant.area:12} {mutant.name:34} {what} ({seconds:.0f} s)  {by}", flush=True)
    summary(results)
    return 0 if all(what == CAUGHT for _, what in results) else 1


if __name__ == "__main__":
    # Ended from outside, it takes its build or test with it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        sys.exit(main())
    except Trouble as trouble:
        sys.exit(f"mutants: {trouble}")
    except KeyboardInterrupt:
        sys.exit(130)
