#!/usr/bin/env python3
"""Checks that names and text use the project's vocabulary: words.txt lists what is refused and what to write instead."""
import pathlib
import re
import shutil
import subprocess
import sys

TEXT = {".cpp", ".hpp", ".h", ".c", ".in", ".py", ".pyi", ".ts", ".mjs", ".css", ".html", ".proto", ".md", ".toml", ".txt",
        ".cmake", ".sh", ".1", ".5", ".8", ".service", ".conf", ".json", ".bash-completion", ".zsh-completion", ".yml"}
NO_SUFFIX = {"dev"}
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+")
# Written by others or by a tool, or about earlier versions.
LEFT_OUT = ("clients/web/page/package-lock.json", "clients/web/page/gen/", "debian/changelog", "debian/copyright",
            "CHANGELOG.md", "tests/unit/structure/words.txt", "tests/unit/structure/check_words_test.py")


def words_of(identifier):
    """"kPinDarkening" and "pin_darkening" → "pin darkening"."""
    parts = [part.lower() for part in PART.findall(identifier)]
    return " ".join(parts[1:] if len(parts) > 1 and parts[0] == "k" else parts)


class Rules:
    def __init__(self, text):
        self.names, self.texts, self.allowed = [], [], []
        for number, line in enumerate(text.splitlines(), 1):
            if not line.strip() or line.startswith("#"):
                continue
            fields = [field.strip() for field in line.split("\t") if field.strip()]
            kind = fields[0]
            if kind == "allow" and len(fields) == 4:
                self.allowed.append((fields[1], re.compile(fields[2], re.I), fields[3]))
            elif kind in ("name", "text", "both") and len(fields) == 3:
                pattern = re.compile(rf"(?<![\w-])(?:{fields[1]})(?![\w-])", re.I)
                self.names += [(pattern, fields[2])] if kind != "text" else []
                self.texts += [(pattern, fields[2])] if kind != "name" else []
            else:
                raise ValueError(f"words.txt:{number}: not `kind, pattern, instead` with tabs between")

    def is_allowed(self, path, found):
        return any(path.startswith(prefix) and pattern.fullmatch(found) for prefix, pattern, _ in self.allowed)


def complaints(path, text, rules):
    """One line for each refused word: path, line number, and the word to use instead."""
    for pattern, instead in rules.names:
        found = pattern.search(" / ".join(words_of(part) for part in path.split("/")))
        if found and not rules.is_allowed(path, found.group()):
            yield f'{path}: the name has "{found.group()}": {instead}'
    names = {}  # of the whole file, each checked once
    for name in set(IDENTIFIER.findall(text)):
        if "_" in name.strip("_") or re.search(r"[a-z][A-Z]", name):
            words = words_of(name)
            for pattern, instead in rules.names:
                found = pattern.search(words)
                if found and not rules.is_allowed(path, name):
                    names[name] = (found.group(), instead)
                    break
    for number, line in enumerate(text.splitlines(), 1):
        for name in sorted(set(IDENTIFIER.findall(line)) & names.keys()):
            yield f'{path}:{number}: {name} has "{names[name][0]}": {names[name][1]}'
        for pattern, instead in rules.texts:
            for found in pattern.finditer(line):
                if not rules.is_allowed(path, found.group()):
                    yield f'{path}:{number}: "{found.group()}": {instead}'


def tracked(top):
    if shutil.which("git"):
        listed = subprocess.run(["git", "-C", str(top), "ls-files", "-z"], capture_output=True, text=True, check=False)
        if listed.returncode == 0:
            return [name for name in listed.stdout.split("\0") if name]
    return [str(path.relative_to(top)) for path in sorted(top.rglob("*"))  # a source archive
            if path.is_file() and not str(path.relative_to(top)).startswith(("build/", "."))]


def main():
    top = pathlib.Path(sys.argv[1]).resolve()
    rules = Rules((pathlib.Path(__file__).parent / "words.txt").read_text(encoding="utf-8"))
    count = 0
    for name in tracked(top):
        path = top / name
        if name.startswith(LEFT_OUT) or not path.is_file() or path.suffix not in TEXT and path.name not in NO_SUFFIX:
            continue
        for line in complaints(name, path.read_text(encoding="utf-8"), rules):
            print(line)
            count += 1
    print(f"{count} words that the project does not use")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
