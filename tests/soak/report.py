"""report.md with its plots, and figures.csv."""
from __future__ import annotations

import csv
import pathlib
import statistics

import plan
from checks import MAX_ERROR_MM, Verdict
from record import Record


def _quantile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


def write(folder: pathlib.Path, record: Record, verdicts: list[Verdict], words: dict[str, str],
          about: list[str]):
    _csv(folder / "figures.csv", record)
    plots = _plots(folder, record)
    faults = [fault for verdict in verdicts for fault in verdict.faults]
    lines = ["# Soak", "", *about, f"A: {words['A']}; B: {words['B']}.", "",
             f"**{f'Found: {len(faults)}' if faults else 'Nothing was found.'}**", ""]
    lines += [f"- {fault.strip()}" for fault in faults]
    lines += ["", "| check | measured | limit | |", "| --- | --- | --- | --- |"]
    lines += [f"| {v.check} | {v.measured} | {v.limit} | {v.word} |" for v in verdicts]
    if plots:
        lines += ["", f"![Memory, descriptors, threads, latency, frames, depth]({plots})"]
    lines += ["", "| episode | times | frames a second | health flags |", "| --- | --- | --- | --- |"]
    for kind in plan.KINDS:
        of = [s for s in record.seen if s.episode.kind == kind]
        if of:
            reported = sorted(set().union(*(s.flags for s in of)))
            rate = statistics.mean(s.frames for s in of) / plan.EPISODE_S
            lines.append(f"| {kind} | {len(of)} | {rate:.1f} | {', '.join(reported)} |")
    (folder / "report.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _csv(file, record):
    rests = {rest.episode: rest for rest in record.rests}
    with open(file, "w", newline="", encoding="utf-8") as out:
        table = csv.writer(out)
        table.writerow(["episode", "kind", "frames", "client_p50_ms", "client_p99_ms", "daemon_p50_ms",
                        "daemon_p99_ms", "error_A_mm", "error_B_mm", "error_no_contact_mm",
                        "descriptors", "threads", "resident_kib", "anonymous_kib", "heap_kib",
                        "kept_kib", "cpu_s", "state_kib", "log_kib", "load", "rest_late_s",
                        "answer_s", "late", "flags"])
        for s in record.seen:
            rest = rests.get(s.episode.index)
            held = rest.held if rest else None
            errors = [[d[2 if place == "no_contact" else 1] for d in s.depths if d[0] == place]
                      for place in MAX_ERROR_MM]
            worst = [f"{max(of):.4f}" if of else "" for of in errors]
            table.writerow([s.episode.index, s.episode.kind, s.frames,
                            *(f"{_quantile(values, share):.3f}"
                              for values in (s.client_ms, s.daemon_ms) for share in (0.5, 0.99)),
                            *worst, *([held.descriptors, held.threads, held.resident_kib,
                                       held.anonymous_kib, held.heap_kib, held.kept_kib, held.cpu_s,
                                       held.state_kib, held.log_kib, rest.load,
                                       f"{rest.late_s:.2f}"] if held else [""] * 11),
                            f"{s.answer_s:.3f}", int(s.late), " ".join(sorted(s.flags))])


def _plots(folder, record):
    """The file's name, or nothing where matplotlib is missing."""
    try:
        import matplotlib
    except ImportError:
        return ""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(5, 1, figsize=(11, 14), sharex=True, constrained_layout=True)
    memory, counts, latency, frames, depth = axes
    at = [_minutes(rest.episode, plan.REST) for rest in record.rests]
    for name, label in (("resident", "resident"), ("anonymous", "of it anonymous"),
                        ("heap", "blocks in use")):
        memory.plot(at, [getattr(rest.held, f"{name}_kib") / 1024 for rest in record.rests], "o-",
                    ms=3, label=label)
    memory.set_ylabel("memory, MiB")
    for name, mark in (("descriptors", "o-"), ("threads", "s-")):
        counts.plot(at, [getattr(rest.held, name) for rest in record.rests], mark, ms=3, label=name)
    counts.plot(at, [rest.load for rest in record.rests], ":", label="machine's load")
    counts.set_ylabel("at rest")

    seen = [s for s in record.seen if s.frames]
    minutes = [_minutes(s.episode.index, plan.EPISODE_S / 2) for s in seen]
    for key, label in (("client_ms", "ready to received"), ("daemon_ms", "ready to published")):
        values = [getattr(s, key) for s in seen]
        line, = latency.plot(minutes, [_quantile(v, 0.5) for v in values], "o-", ms=3,
                             label=f"{label}, median")
        latency.plot(minutes, [_quantile(v, 0.99) for v in values], "--", color=line.get_color(),
                     label="99th percentile")
    latency.set_ylabel("latency, ms")
    frames.plot(minutes, [s.frames / plan.EPISODE_S for s in seen], "o-", ms=3)
    frames.set_ylabel("frames a second")
    for place, most in MAX_ERROR_MM.items():
        which = 2 if place == "no_contact" else 1
        points = [(m, d[which]) for m, s in zip(minutes, seen) for d in s.depths if d[0] == place]
        line, = depth.plot([p[0] for p in points], [p[1] for p in points], ".", ms=4, label=place)
        depth.axhline(most, color=line.get_color(), lw=0.7, ls=":")
    depth.set_ylabel("mean absolute error, mm\n(dotted: limits)")
    depth.set_xlabel("minutes of the camera")
    for axis in axes[1:]:
        axis.set_ylim(bottom=0)
    for axis in axes:
        _mark(axis, record.seen, axis is memory)
        axis.grid(alpha=0.3)
        axis.margins(x=0.01)
    for axis in (memory, counts, latency, depth):
        axis.legend(fontsize=8, ncols=4)
    fig.savefig(folder / "soak.png", dpi=80)
    return "soak.png"


def _minutes(episode, seconds):
    return (episode * plan.EPISODE_S + seconds) / 60


def _mark(axis, seen, named):
    """Ticks along the top, where the soak acted on the daemon."""
    groups = {"camera's fault": ("C3", [f[1] for s in seen for f in s.episode.faults]),
              "command": ("C4", [t.sequence for s in seen for t in s.episode.steps])}
    for label, (color, at) in groups.items():
        axis.vlines([n / plan.FPS / 60 for n in at], 0.94, 1.0, color=color, lw=1,
                    transform=axis.get_xaxis_transform(), label=label if named else None)
    if named and len(seen) <= 60:
        for s in seen:
            axis.text(_minutes(s.episode.index, plan.EPISODE_S / 2), 1.02, s.episode.kind, ha="left",
                      transform=axis.get_xaxis_transform(), rotation=60, fontsize=7)
