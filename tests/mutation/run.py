#!/usr/bin/env python3
"""Draws small bugs at random, puts one after another into the code and asks whether a test fails.

A mutant is one edit of one line of the C++ sources in daemon, hal and clients: a flipped comparison, a
number or an offset off by one, a dropped negation, a dropped statement, or a constant swapped for its
counterpart. The seed and the sources determine the draw. All of it happens in a copy of the tree under
--work, so that neither an interrupt nor a killed run leaves a bug behind.

Prints one line a mutant and the share caught. Exit code: 0 every mutant was caught, 1 some were not, or
the tree does not build or pass without a mutant, or the command line is wrong.
"""
import argparse
import collections
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
AREAS = ("daemon", "hal", "clients")
CAUGHT, SURVIVED, UNBUILT = "caught", "SURVIVED", "does not build"

FLIPPED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
COUNTERPARTS = [("true", "false"), ("min", "max"), ("width", "height"), ("row", "col"), ("rows", "cols"),
                ("&&", "||"), ("first", "last"), ("begin", "end"), ("front", "back"), ("floor", "ceil")]
SWAPPED = {**dict(COUNTERPARTS), **{b: a for a, b in COUNTERPARTS}}

Mutant = collections.namedtuple("Mutant", "kind file number before after")


class Trouble(Exception):
    """An error in the tree or the command line; the text says what to do."""


def blanked(text):
    """The text with comments, literals of text and preprocessor lines blanked, at the same offsets."""
    pattern = re.compile(r"""//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)'(?:\\.|[^'\\\n])*'"""
                         r"""|^[ \t]*\#(?:\\\n|[^\n])*|static_assert[^;]*;""", re.DOTALL | re.MULTILINE)
    return pattern.sub(lambda found: re.sub(r"[^\n]", "\0", found.group()), text)


def line_edits(code):
    """(kind, begin, end, replacement) of each edit that a line of code without comments allows."""
    for found in re.finditer(r"(?<= )(<=|>=|==|!=|<|>)(?= )", code):
        yield "comparison", *found.span(), FLIPPED[found.group()]
    for found in re.finditer(r"(?<![\w.'])\d{1,6}(?=U?L?L?(?![\w.']))", code):
        for step in (1, -1):
            if int(found.group()) + step >= 0:
                yield "off by one", *found.span(), str(int(found.group()) + step)
    for found in re.finditer(r"(?<=[\w)\]] )[+-](?= )", code):
        yield "off by one", *found.span(), "-" if found.group() == "+" else "+"
    for found in re.finditer(r"!(?=[\w(:*])", code):
        yield "negation", *found.span(), ""
    # A call, an assignment or a step, whole on its line; no declaration and nothing that ends the block.
    found = re.fullmatch(r"(\s+)((?:\+\+|--)?[A-Za-z_*][\w.:>\[\]-]*"
                         r"(?:\(.*\)| (?:[-+*/|&^]|<<|>>)?= .*)?(?:\+\+|--)?;)\s*", code)
    if found and not re.match(r"(return|break|continue|goto|using|public|throw|else|default|co_)\b", found.group(2)):
        yield "statement", *found.span(2), "{}"
    for found in re.finditer(r"\w+|&&|\|\|", code):
        if found.group() in SWAPPED:
            yield "constant", *found.span(), SWAPPED[found.group()]


def all_mutants(folders):
    """Every possible mutant of the folders, by kind."""
    listed = subprocess.run(["git", "ls-files", "--", *folders], cwd=ROOT, check=True, capture_output=True,
                            text=True).stdout.split()
    mutants = collections.defaultdict(list)
    for name in sorted(listed):
        if not name.endswith((".cpp", ".hpp")) or not name.startswith(AREAS):
            continue
        text = (ROOT / name).read_text()
        lines = zip(text.split("\n"), blanked(text).split("\n"), strict=True)
        for number, (line, code) in enumerate(lines):
            for kind, begin, end, instead in line_edits(code):
                mutants[kind].append(Mutant(kind, name, number, line, line[:begin] + instead + line[end:]))
    return mutants


def drawn(folders, seed):
    """An endless sequence of mutants, all kinds equally often."""
    mutants = all_mutants(folders)
    if not mutants:
        raise Trouble(f"no C++ source to change is under {' '.join(folders)}; name folders of {', '.join(AREAS)}")
    generator = random.Random(seed)
    kinds = sorted(mutants)
    seen = set()
    while len(seen) < sum(map(len, mutants.values())):
        mutant = generator.choice(mutants[generator.choice(kinds)])
        if mutant not in seen:
            seen.add(mutant)
            yield mutant


def end(process):
    """SIGTERM first: ninja gives its compilers process groups of their own and ends them itself."""
    os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)


class Tree:
    """A copy of the sources, built with the dev preset; kept from run to run."""

    def __init__(self, work):
        self.source = work / "tree"
        self.build = self.source / "build" / "dev"
        self.copy()
        self.configure()
        self.read_targets()

    def copy(self):
        """Writes files that differ, with the present time, so that the build notices a reverted bug."""
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
        for folder in self.source.iterdir():
            for path in [folder] if folder.is_file() else folder.rglob("*"):
                name = str(path.relative_to(self.source))
                if path.is_file() and not name.startswith("build/") and name not in wanted:
                    path.unlink()

    def configure(self):
        query = self.build / ".cmake/api/v1/query"
        query.mkdir(parents=True, exist_ok=True)
        (query / "codemodel-v2").touch()
        done = self.run(["cmake", "--preset", "dev"], 600)
        if done.returncode != 0:
            raise Trouble(f"cmake failed:\n{done.stdout}")

    def read_targets(self):
        """Reads the targets of each source, dependencies between targets, and the test targets."""
        reply = self.build / ".cmake/api/v1/reply"
        model = json.loads(next(reply.glob("codemodel-v2-*.json")).read_text())
        targets = {t["id"]: json.loads((reply / t["jsonFile"]).read_text())
                   for t in model["configurations"][0]["targets"]}
        self.names = {t: targets[t]["name"] for t in targets}
        self.owners = collections.defaultdict(set)
        self.below = {}
        for t, target in targets.items():
            self.below[t] = {d["id"] for d in target.get("dependencies", [])}
            for source in target.get("sources", []):
                self.owners[source["path"]].add(t)
                if target["type"] != "EXECUTABLE" or not source["path"].startswith("tests/"):
                    self.owners[str(pathlib.PurePath(source["path"]).parent)].add(t)
        shown = self.run(["ctest", "--test-dir", self.build, "--show-only=json-v1"], 60).stdout
        labels = {}
        for test in json.loads(shown[shown.index("{"):])["tests"]:
            for entry in test["properties"]:
                if entry["name"] == "LABELS":
                    labels[test["name"]] = set(entry["value"])
        self.labels = {t: labels[name] for t, name in self.names.items() if name in labels}

    def all_below(self, target):
        reached, todo = set(), [target]
        while todo:
            for dependency in self.below[todo.pop()] - reached:
                reached.add(dependency)
                todo.append(dependency)
        return reached

    def tests_of(self, file, label):
        """The test programs with the label that contain the file, those of the fewest parts first. A header
        belongs to the targets of its folder."""
        owners = self.owners.get(file) or self.owners.get(str(pathlib.PurePath(file).parent), set())
        below = {t: self.all_below(t) for t, labels in self.labels.items() if label in labels}
        return [self.names[t] for t in sorted(below, key=lambda t: (len(below[t]), self.names[t]))
                if owners & (below[t] | {t})]

    def run(self, command, seconds, **environment):
        """A process group of its own, so that nothing of a hanging test outlives its time."""
        # With its own tree as base, a compiler cache finds results of other copies.
        environment = {"CCACHE_BASEDIR": str(self.source), "CCACHE_NOHASHDIR": "1", **os.environ, **environment}
        with subprocess.Popen(command, cwd=self.source, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              text=True, errors="replace", start_new_session=True, env=environment) as process:
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
        """The first failure ends it. A test may hang with a bug: 300 s are its limit."""
        return self.run(["ctest", "--test-dir", self.build, "--output-on-failure", "--stop-on-failure",
                         "--timeout", "300", "-R", f"^({'|'.join(targets)})$"], 3600,
                        GTEST_BRIEF="1", GTEST_FAIL_FAST="1")


def stages(tree, mutant, labels):
    """Tests to build and run, one stage after another until one fails."""
    for label in labels:
        tests = tree.tests_of(mutant.file, label)
        yield from (stage for stage in (tests[:3], tests[3:]) if stage)


def require_clean(tree, tests, clean):
    """Checks that the tests pass without a mutant; otherwise later failures would mean nothing."""
    tests = [test for test in tests if test not in clean]
    if not tests:
        return
    made = tree.make(tests)
    if made.returncode != 0:
        raise Trouble(f"the tree does not build:\n{made.stdout}")
    tested = tree.test(tests)
    if tested.returncode != 0:
        raise Trouble(f"tests fail without a mutant:\n{tested.stdout}")
    clean.update(tests)


def outcome(tree, tests):
    """The first failure with the mutant in the tree; None when all tests pass."""
    made = tree.make(tests)
    if made.returncode != 0:
        error = re.search(r"error: (.*)", made.stdout)
        return UNBUILT, error.group(1) if error else ""
    tested = tree.test(tests)
    if tested.returncode == 0:
        return None
    failed = re.search(r"\[  FAILED  \] (\S+?)[ ,]", tested.stdout)
    how = re.search(r"\d+ - (\S+ \(\w+\))", tested.stdout)
    return CAUGHT, failed.group(1) if failed else (how.group(1) if how else "")


def verdict(tree, mutant, labels, clean):
    """The mutant's fate, and the test that caught it."""
    path = tree.source / mutant.file
    whole = path.read_text()
    lines = whole.split("\n")
    lines[mutant.number] = mutant.after
    for tests in stages(tree, mutant, labels):
        require_clean(tree, tests, clean)
        try:
            path.write_text("\n".join(lines))
            found = outcome(tree, tests)
        finally:
            path.write_text(whole)
        if found:
            return found
    return SURVIVED, ""


def show(mutant):
    print(f"{mutant.file}:{mutant.number + 1}: {mutant.kind}\n  - {mutant.before.strip()}\n"
          f"  + {mutant.after.strip()}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folders", nargs="*", help="folders or files to draw from; all of daemon, hal and clients when "
                                                   "left out")
    parser.add_argument("--count", type=int, default=60, help="mutants that build (60)")
    parser.add_argument("--seed", type=int, default=1, help="another seed draws others (1)")
    parser.add_argument("--unit", action="store_true", help="ask the unit tests alone, not those end to end")
    parser.add_argument("--list", action="store_true", help="show the first of the draw and run nothing")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "build" / "mutants")
    options = parser.parse_args()
    if options.count < 1:
        parser.error("--count needs a number above 0")
    draw = drawn(options.folders or AREAS, options.seed)
    if options.list:
        for mutant, _ in zip(draw, range(options.count)):
            show(mutant)
        return 0
    tree = Tree(options.work.resolve())
    labels = ["unit"] if options.unit else ["unit", "e2e"]
    verdicts = collections.Counter()
    clean = set()
    for mutant in draw:
        show(mutant)
        began = time.monotonic()
        what, by = verdict(tree, mutant, labels, clean)
        verdicts[what] += 1
        print(f"  {what} ({time.monotonic() - began:.0f} s)  {by}", flush=True)
        if verdicts[CAUGHT] + verdicts[SURVIVED] == options.count:
            break
    built = verdicts[CAUGHT] + verdicts[SURVIVED]
    print(f"seed {options.seed}: {verdicts[CAUGHT]} of {built} caught "
          f"({100 * verdicts[CAUGHT] / max(1, built):.0f} %), {verdicts[UNBUILT]} more do not build")
    return 0 if verdicts[SURVIVED] == 0 else 1


if __name__ == "__main__":
    # When it is ended from outside, it ends its build or test first.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        sys.exit(main())
    except Trouble as trouble:
        sys.exit(f"mutants: {trouble}")
    except KeyboardInterrupt:
        sys.exit(130)
