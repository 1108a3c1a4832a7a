#!/usr/bin/python3
"""Makes the stability atlas's page: README.md and a picture for each group of rows, from atlas.csv."""

import argparse
import csv
import math
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the back end is chosen first)
from PIL import Image  # noqa: E402

PNG_COLOURS = 128  # keeps the pictures small
GROUPS = ["light", "image", "scene", "reference"]
COLOURS = ["#9a6324", "#1f77b4", "#2ca02c", "#7b3fa0", "#d1495b", "#444444", "#17becf"]


def number(text):
    return float(text) if text else math.nan


class Run:
    """One value of one row with one method."""

    def __init__(self, line):
        self.value = float(line["value"])
        inside, outside = number(line["inside_mm"]), number(line["outside_mm"])
        errors = [e for e in (inside, outside) if not math.isnan(e)]
        self.error = max(errors) if errors else math.nan
        self.along = number(line["along_mm"])  # with the truth moved along with the picture
        self.reported = number(line["flagged"]) >= 0.5 or number(line["withheld"]) >= 0.5
        self.stated = number(line["stated_mm"])
        self.health_flags = line["health_flags"].replace("_", " ")


def read(path):
    rows, methods = {}, []
    with open(path, encoding="utf-8") as file:
        for line in csv.DictReader(file):
            row = rows.setdefault(line["row"], {"line": line, "runs": {}})
            row["runs"].setdefault(line["method"], []).append(Run(line))
            if line["method"] and line["method"] not in methods:
                methods.append(line["method"])
    return rows, methods


def wrong(runs, nominal):
    """Points with more than twice the nominal error, or without depth."""
    return [r for r in runs if r.error > 2 * nominal or math.isnan(r.error)]


def unreported(runs, nominal):
    return [r for r in wrong(runs, nominal) if not r.reported]


def silent(runs, nominal):
    """Points that neither a flag nor the stated uncertainty covers."""
    return [r for r in unreported(runs, nominal) if r.error > 2 * r.stated]


def verdict(runs, nominal):
    """The value where the error leaves twice the nominal one, and the report there."""
    bad = wrong(runs, nominal)
    if not bad:
        return "stays within", "–"
    first = bad[0]
    said = first.health_flags or ("no depth given" if first.reported else "no flag")
    if not first.reported:
        said += f", stated uncertainty {first.stated:.3f} mm"
    if quiet := silent(runs, nominal):
        said += f"; **silent at {', '.join(f'{r.value:g}' for r in quiet)}**"
    size = "no depth" if math.isnan(first.error) else f"{first.error:.3f} mm"
    if not math.isnan(first.along):
        size += f"; truth moved along {first.along:.3f} mm"
    return f"{first.value:g} ({size})", said


def table_without_gain(rows, methods, nominal):
    """The worst point of each row without a flag, our methods only."""
    lines = ["| disturbance | method | worst without a flag | error / stated | truth moved along |",
             "| --- | --- | --- | --- | --- |"]
    for row in rows.values():
        for method in methods:
            points = unreported(row["runs"][method], nominal[method])
            if not points:
                continue
            worst = max(points, key=lambda r: r.error / r.stated)
            along = "" if math.isnan(worst.along) else f"{worst.along:.3f} mm"
            lines.append(f"| {row['line']['title']} | {method} | at {worst.value:g}: {worst.error:.3f} mm "
                         f"| {worst.error / worst.stated:.1f} | {along} |")
    return "\n".join(lines)


def draw(group, rows, methods, nominal, folder):
    chosen = [(name, row) for name, row in rows.items() if row["line"]["group"] == group]
    columns = 4
    lines = math.ceil(len(chosen) / columns)
    figure, axes = plt.subplots(lines, columns, figsize=(13, 2.9 * lines), squeeze=False)
    for axis in axes.flat[len(chosen):]:
        axis.axis("off")
    for axis, (_, row) in zip(axes.flat, chosen):
        for method, colour in zip(methods, COLOURS):
            runs = row["runs"][method]
            at = range(len(runs))
            axis.plot(at, [r.error for r in runs], color=colour, lw=1.2, label=method)
            for i, run in zip(at, runs):
                axis.plot(i, run.error, "o", ms=5, mec=colour, mfc=colour if run.reported else "white")
                if math.isnan(run.error):
                    axis.plot(i, 2, "x", ms=5, color=colour)
            axis.axhline(2 * nominal[method], color=colour, lw=0.7, ls=":")
        axis.set_yscale("log")
        axis.set_ylim(0.005, 2.5)
        values = [f"{r.value:g}" for r in row["runs"][methods[0]]]
        axis.set_xticks(range(len(values)), values, fontsize=7)
        axis.tick_params(axis="y", labelsize=7)
        title = row["line"]["title"]
        axis.set_title(title if len(title) < 48 else title[:46] + " …", fontsize=8)
        axis.set_xlabel(row["line"]["unit"], fontsize=7)
    for axis in axes[:, 0]:
        axis.set_ylabel("error, mm", fontsize=8)
    axes.flat[0].legend(fontsize=6, loc="upper left")
    figure.tight_layout()
    file = folder / f"{group}.png"
    figure.savefig(file, dpi=90)
    Image.open(file).convert("RGB").quantize(PNG_COLOURS).save(file, optimize=True)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("csv", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    rows, methods = read(arguments.csv)
    clean = rows.pop("clean")["runs"][""][0] if "clean" in rows else None
    nominal = {m: rows["noise"]["runs"][m][0].error for m in methods}
    text = (pathlib.Path(__file__).parent / "page.in.md").read_text(encoding="utf-8")
    parts = []
    ours = [m for m in methods if not m.startswith("published")]
    for group in GROUPS:
        draw(group, rows, methods, nominal, arguments.folder)
        parts.append(f"## {group.capitalize()}\n\n![{group}]({group}.png)\n")
        parts.append("| disturbance | method | leaves 2 × nominal at | reported then |")
        parts.append("| --- | --- | --- | --- |")
        for row in rows.values():
            if row["line"]["group"] != group:
                continue
            for method in methods:
                where, said = verdict(row["runs"][method], nominal[method])
                parts.append(f"| {row['line']['title']} ({row['line']['unit']}) | {method} | {where} | {said} |")
        for row in rows.values():
            if row["line"]["group"] == group and row["line"]["undecidable"]:
                parts.append(f"\n*{row['line']['title']}* cannot be recognised in one luma image: "
                             f"{row['line']['undecidable']}.")
        parts.append("")
    text = text.replace("@NOMINAL@", ", ".join(f"{nominal[m]:.3f} mm ({m})" for m in methods))
    for place, which in (("@SILENT@", silent), ("@UNREPORTED@", unreported)):
        counts = {m: sum(bool(which(row["runs"][m], nominal[m])) for row in rows.values()) for m in ours}
        text = text.replace(place, ", ".join(f"{counts[m]} of {len(rows)} rows ({m})" for m in ours))
    text = text.replace("@TABLE@", table_without_gain(rows, ours, nominal))
    if clean is not None:
        text = text.replace("@CLEAN@", f"{100 * clean.error:.2f} % of {clean.value:.0f}")
    (arguments.folder / "README.md").write_text(text.replace("@ROWS@", "\n".join(parts)), encoding="utf-8")


if __name__ == "__main__":
    main()
