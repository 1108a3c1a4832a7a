#!/usr/bin/python3
"""Reads the daemon's metrics with Prometheus' own client, and checks what is drawn against them.

check_metrics.py DASHBOARD PROGRAM-THAT-PRINTS-THEM...
"""
import json
import re
import subprocess
import sys

try:
    from prometheus_client.parser import text_string_to_metric_families
except ImportError:
    print("skipped: install python3-prometheus-client")
    sys.exit(77)

# prometheus.io/docs/practices/naming: base units only.
NOT_BASE = re.compile(r"_(ms|us|ns|milliseconds|microseconds|nanoseconds|percent|mm|kb|mb)(_|$)")
QUERIED = re.compile(r"\bdtactd_[a-z0-9_]+\b")
SELECTED = re.compile(r"\b(dtactd_[a-z0-9_]+)\{([^}]*)\}")


def complaints_of_family(family):
    if not family.documentation:
        yield f"{family.name} has no help"
    if not family.name.startswith("dtactd_"):
        yield f"{family.name} does not say whose it is"
    if NOT_BASE.search(family.name):
        yield f"{family.name} is not in a base unit"
    names = [(sample.name, tuple(sorted(sample.labels.items()))) for sample in family.samples]
    if len(set(names)) != len(names):
        yield f"{family.name} has a sample twice"
    if not family.samples:
        yield f"{family.name} has no sample"
    # The reader takes _total away from a counter's name and gives it back to the samples.
    if family.type == "counter" and not all(s.name.endswith("_total") for s in family.samples):
        yield f"{family.name} is a counter without _total"
    if family.type == "unknown":
        yield f"{family.name} has no type"
    if family.type == "histogram":
        yield from complaints_of_histogram(family)


def complaints_of_histogram(family):
    buckets = {}
    for sample in family.samples:
        if sample.name.endswith("_bucket"):
            labels = tuple(sorted((k, v) for k, v in sample.labels.items() if k != "le"))
            buckets.setdefault(labels, []).append((float(sample.labels["le"]), sample.value))
    counts = {tuple(sorted(s.labels.items())): s.value
              for s in family.samples if s.name.endswith("_count")}
    for labels, pairs in buckets.items():
        if pairs != sorted(pairs) or [v for _, v in pairs] != sorted(v for _, v in pairs):
            yield f"{family.name}{labels}: buckets do not ascend"
        if pairs[-1] != (float("inf"), counts[labels]):
            yield f"{family.name}{labels}: the last bucket is not that of all"


def expressions(node):
    """Every `expr` in a dashboard."""
    if isinstance(node, dict):
        if isinstance(node.get("expr"), str):
            yield node["expr"]
        node = list(node.values())
    if isinstance(node, list):
        for child in node:
            yield from expressions(child)


def complaints_of_dashboard(path, samples):
    known = {sample.name for sample in samples}
    with open(path, encoding="utf-8") as file:
        queries = list(expressions(json.load(file)))
    if not queries:
        yield f"{path} queries nothing"
    for query in queries:
        if not QUERIED.search(query):
            yield f"{path}: '{query}' names no metric of the daemon"
        for name in QUERIED.findall(query):
            if name not in known:
                yield f"{path}: the daemon has no {name}"
        for name, selectors in SELECTED.findall(query):
            for label, value in re.findall(r'(\w+)="([^"]*)"', selectors):
                if not any(s.name == name and s.labels.get(label) == value for s in samples):
                    yield f"{path}: no {name} has {label}=\"{value}\""


def main():
    text = subprocess.run(sys.argv[2:], check=True, capture_output=True, text=True).stdout
    families = list(text_string_to_metric_families(text))
    found = [complaint for family in families for complaint in complaints_of_family(family)]
    identities = [s.labels["identity"] for f in families for s in f.samples
                  if f.name == "dtactd_camera_info"]
    if identities != ['a "quoted"\\name\nof two lines']:
        found.append(f"an odd label came back as {identities}")
    samples = [sample for family in families for sample in family.samples]
    found += complaints_of_dashboard(sys.argv[1], samples)
    print("\n".join(found + [f"{len(families)} metrics, {len(found)} complaints"]))
    return 1 if found or not families else 0


if __name__ == "__main__":
    sys.exit(main())
