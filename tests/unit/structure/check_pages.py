#!/usr/bin/env python3
"""Checks that links of the pages (*.md) within the repository lead to existing files and headings."""
import pathlib
import re
import sys

LINK = re.compile(r"\]\(([^()\s]+)\)")
CODE = re.compile(r"^(```.*?^```| {4}[^\n]*)", re.M | re.S)
ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:")


def anchors(page):
    """The anchors of a page's headings: small letters, hyphens for blanks, no punctuation."""
    headings = re.findall(r"^#+ +(.+)$", CODE.sub("", page), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


def pages(top):
    for path in sorted(top.rglob("*.md")):
        parts = path.relative_to(top).parts
        if parts[0] not in ("build", "debian") and not any(part.startswith(".") for part in parts):
            yield path


def complaints(top):
    for path in pages(top):
        text = path.read_text(encoding="utf-8")
        for link in LINK.findall(CODE.sub("", text)):
            if ELSEWHERE.match(link):
                continue
            name, _, anchor = link.partition("#")
            target = path.parent / name if name else path
            if not target.exists():
                yield f"{path.relative_to(top)}: links to {name}, which is not there"
            elif anchor and anchor not in anchors(target.read_text(encoding="utf-8")):
                yield f"{path.relative_to(top)}: links to {link}, a heading that is not there"


def main():
    found = list(complaints(pathlib.Path(sys.argv[1]).resolve()))
    for line in found:
        print(line)
    print(f"{len(found)} links to nothing")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
