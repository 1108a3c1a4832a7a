#!/usr/bin/env python3
"""Measures the daemon's work on a frame (find active tiles, reconstruct, contact,
uncertainty) beside OpenCV in C++ and the paper's pipeline in Python, which make the depth alone.

Two servers (bench_server, paper_pipeline.py) run on one core and time one case at a time; this
driver, on another core, alternates between all cases in an order that changes with every round, so
that what disturbs the machine disturbs them alike. Ratios are taken within a round. Every case's
result is checked before and after. Times are CPU time of the one thread, with warm caches: two
unmeasured runs come first.

Prints the table and one line a goal; writes samples.csv, summary.csv and plots to --out.
Exit code: 0 measured (whether the goals are met or not), 1 a result was wrong or nothing ran.
"""
import argparse
import csv
import os
import platform
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from goals import report  # noqa: E402

REPEAT = {"scalar": 1, "python": 2, "python+decode": 2, "python-float32": 2}
LABEL = {
    "full": "full field",
    "full-bare": "the same, no contact, no uncertainty",
    "decode+full": "MJPEG frame to depth",
    "decode": "MJPEG decode alone",
    "decode+half": "MJPEG frame to depth at half",
    "decode/2+half": "the same, decoded at half",
    "decode+quarter": "MJPEG frame to depth at a quarter",
    "decode/4+quarter": "the same, decoded at a quarter",
    "press:0": "no contact",
    "half": "half resolution, 290x290",
    "quarter": "quarter resolution, 145x145",
    "scalar": "scalar kernels (specification)",
    "opencv": "OpenCV C++",
    "python": "Python + OpenCV",
    "python+decode": "Python + OpenCV, with decode",
    "python-float32": "Python + OpenCV, single precision",
}


class Server:
    """A process that times cases on request."""

    def __init__(self, command, core):
        pinned = (["taskset", "-c", str(core)] if shutil.which("taskset") else []) + command
        self.process = subprocess.Popen(pinned, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True, bufsize=1)

    def ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"bench: {self.process.args} ended at '{line}'")
        return answer.strip()

    def close(self):
        self.process.stdin.close()
        self.process.wait(timeout=30)


def quartiles(values):
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return low, middle, high


def spread(values):
    """Half the interquartile range, in per cent of the median."""
    low, middle, high = quartiles(values)
    return 100 * (high - low) / 2 / middle


def machine():
    model = platform.processor()
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as info:
            for line in info:
                if line.startswith(("model name", "Model")):
                    model = line.split(":", 1)[1].strip()
                    break
    except OSError:
        pass
    return f"one core of {model} ({platform.machine()}, Linux {platform.release().split('-')[0]})"


def count_instructions(server, case, quick):
    """User instructions of one run: by perf, or by callgrind where perf may not count (a tenth of a
    minute a case: not when it must be quick; it has no AVX-512). None: by neither."""
    def with_tool(tool, few, many, read):
        counts = []
        for count in (few, many):
            done = subprocess.run(tool + [server], input=f"once {case} {count}\n",
                                  capture_output=True, text=True, check=False)
            counts.append(read(done.stderr))
        return (counts[1] - counts[0]) / (many - few)

    def perf(text):
        return next(int(line.split(",")[0]) for line in text.splitlines() if "instructions" in line)

    def callgrind(text):
        return next(int(line.split(":")[-1]) for line in text.splitlines() if "Collected" in line)

    tools = [(["perf", "stat", "-x,", "-e", "instructions:u"], 10, 210, perf),
             (["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"], 1, 3, callgrind)]
    for tool, few, many, read in tools[:1] if quick else tools:
        if not shutil.which(tool[0]):
            continue
        try:
            return with_tool(tool, few, many, read), tool[0]
        except (StopIteration, ValueError):
            continue
    return None, None


def build():
    """The server in its own release build."""
    top = os.path.dirname(os.path.dirname(HERE))
    folder = os.path.join(top, "build", "bench", "cmake")
    for step in (["cmake", "-S", top, "-B", folder, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                  "-DDTACT_TESTS=ON"],
                 ["cmake", "--build", folder, "--target", "bench_server"]):
        done = subprocess.run(step, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(f"bench: {' '.join(step)} failed\n{done.stdout}{done.stderr}\n"
                     "bench: libopencv-imgproc-dev may be missing")
    return os.path.join(folder, "tests", "bench", "bench_server")


def measure(servers, cases, seconds, samples):
    """Rounds over all cases until the time is up, at least one; samples[case] is a list of rounds'
    lists."""
    end = time.monotonic() + seconds
    order = list(cases)
    rng = random.Random(1)
    while time.monotonic() < end or not samples[order[0]]:
        rng.shuffle(order)
        for case in order:
            answer = servers[cases[case]].ask(f"run {case} {REPEAT.get(case, 5)}")
            samples[case].append([float(ns) for ns in answer.split()])


def verify(servers, cases):
    wrong = []
    for case, owner in cases.items():
        answer = servers[owner].ask(f"verify {case}")
        if answer != "ok":
            wrong.append(f"{case}: {answer}")
    return wrong


def line_fit(points):
    """Least-squares line and the greatest distance from it."""
    n = len(points)
    mx = sum(x for x, _ in points) / n
    my = sum(y for _, y in points) / n
    slope = sum((x - mx) * (y - my) for x, y in points) / sum((x - mx) ** 2 for x, _ in points)
    offset = my - slope * mx
    return slope, offset, max(abs(y - offset - slope * x) for x, y in points)


def goals(medians, rounds, shares):
    """(goal, measured, met) of each line of the goal table."""
    def ratio(slow, fast):
        values = [s / f for s, f in zip(rounds[slow], rounds[fast])]
        return statistics.median(values), spread(values)

    full = medians["full"]
    lines = []
    for name, slow, fast, least in (
            ("full field against Python", "python", "full", 20),
            ("full field against OpenCV C++", "opencv", "full", 4),
            ("MJPEG frame to depth against Python with decode", "python+decode", "decode+full",
             10)):
        value, s = ratio(slow, fast)
        met = value >= least
        lines.append((f"{name}: at least {least}x", f"{value:.1f}x ±{s:.0f} %",
                      met, "" if met else f"short by {100 * (1 - value / least):.0f} %"))
    for name, case, most in (("half resolution", "half", 0.55),
                             ("quarter resolution", "quarter", 0.35)):
        value, s = ratio(case, "full")
        met = value <= most
        lines.append((f"{name}: at most {most:.2f} of the full field", f"{value:.2f} ±{s:.0f} %",
                      met, "" if met else f"short by {100 * (value / most - 1):.0f} %"))
    # 0.37 of 0.588 ms and 0.29 of it: what a processor took for all of a full-field frame.
    for name, case, most in (("half", "decode/2+half", 0.63), ("a quarter", "decode/4+quarter", 0.49)):
        value, s = ratio(case, "decode+full")
        met = value <= most
        lines.append((f"MJPEG decoded at {name}: at most {most:.2f} of MJPEG at full resolution",
                      f"{value:.2f} ±{s:.0f} %", met,
                      "" if met else f"short by {100 * (value / most - 1):.0f} %"))
    reported = 100 * (1 - ratio("full-bare", "full")[0])
    lines.append(("contact and uncertainty: at most 10 % of the full field", f"{reported:.1f} %",
                  reported <= 10, "" if reported <= 10 else f"short by {reported - 10:.1f} % of the full field"))
    idle = 100 * medians["press:0"] / full
    lines.append(("no contact: at most 3 % of the full field", f"{idle:.1f} %", idle <= 3,
                  "" if idle <= 3 else f"short by {idle - 3:.1f} % of the full field"))
    excess = {c: medians[c] / full - 1.2 * shares[c] - 0.03 for c in shares}
    worst = max(excess, key=excess.get)
    met = excess[worst] <= 0
    lines.append(("any scene: at most 1.2 x active share + 3 %",
                  f"closest at {100 * shares[worst]:.0f} % active: "
                  f"{100 * medians[worst] / full:.1f} % of "
                  f"{120 * shares[worst] + 3:.1f} % allowed", met,
                  "" if met else f"short by {100 * excess[worst]:.1f} % of the full field"))
    _, _, off = line_fit([(shares[c], medians[c]) for c in shares])
    met = off <= 0.1 * full
    lines.append(("cost against contact area: linear (within 10 % of the full field)",
                  f"within {100 * off / full:.1f} %", met, "" if met else "not linear"))
    return lines


def plot(out, medians, samples, shares, label):
    import matplotlib
    matplotlib.use("svg")
    from matplotlib import pyplot as plt

    figure, axis = plt.subplots(figsize=(8, 4))
    names = [c for c in LABEL if c in medians]
    axis.barh([LABEL[c] for c in names], [medians[c] / 1e6 for c in names], color="#4878a8")
    axis.set_xscale("log")
    axis.set_xlabel("median, milliseconds")
    axis.invert_yaxis()
    for i, c in enumerate(names):
        axis.text(medians[c] / 1e6, i, f" {medians[c] / 1e6:.3g}", va="center")
    axis.set_title(f"800x600 to 580x580, synthetic frames\n{label}", fontsize=9)
    figure.tight_layout()
    figure.savefig(os.path.join(out, "pipelines.svg"))

    figure, axis = plt.subplots(figsize=(7, 4.5))
    full = medians["full"] / 1e6
    x = [100 * shares[c] for c in shares]
    low = [quartiles([t for r in samples[c] for t in r]) for c in shares]
    axis.errorbar(x, [m / 1e6 for _, m, _ in low],
                  yerr=[[(m - a) / 1e6 for a, m, _ in low], [(b - m) / 1e6 for _, m, b in low]],
                  fmt="o", ms=4, color="#4878a8", label="measured, median and quartiles")
    axis.plot([0, 100], [0.03 * full, 1.23 * full], "k:", label="1.2 x share + 3 %")
    axis.axhline(full, color="#a84848", lw=1, label="full field")
    axis.set_xlabel("active share of the depth map, %")
    axis.set_ylabel("milliseconds a frame")
    axis.set_ylim(bottom=0)
    axis.legend()
    axis.set_title(f"cost against contact area, synthetic ball presses\n{label}", fontsize=9)
    figure.tight_layout()
    figure.savefig(os.path.join(out, "cost_against_area.svg"))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--server", help="the bench_server program; built when not named")
    parser.add_argument("--out", default="build/bench/results", help="folder for CSV and plots")
    parser.add_argument("--quick", action="store_true", help="within 50 seconds")
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)))
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    if not options.server:
        options.server = build()
    began = time.monotonic()
    label = machine()

    with tempfile.TemporaryDirectory() as inputs:
        ours = Server([options.server], options.core)
        ours.ask(f"export {inputs}")
        paper = Server([sys.executable, os.path.join(HERE, "paper_pipeline.py"), inputs],
                       options.core)
        servers = {"ours": ours, "paper": paper}
        cases = {}
        shares = {}
        for word in ours.ask("list").split():
            name, share = word.split("=")
            cases[name] = "ours"
            if name.startswith("press:"):
                shares[name] = float(share)
        cases.update({name: "paper" for name in paper.ask("list").split()})
        target = ours.ask("target")

        # The start of a slow machine is subtracted from the time to measure.
        before = time.monotonic()
        measure(servers, cases, 0, {case: [] for case in cases})
        wrong = verify(servers, cases)
        verified = time.monotonic()
        seconds = 34 - (verified - began) - (verified - before) if options.quick else 120
        samples = {case: [] for case in cases}
        measure(servers, cases, seconds, samples)
        wrong += verify(servers, cases)
        for server in servers.values():
            server.close()

    instructions = {}
    tool = None
    for case in ("full", "full-bare", "half", "quarter", "press:0", "press:190", "decode",
                 "decode+full", "opencv"):
        if options.quick and time.monotonic() - began > 42:
            break
        value, used = count_instructions(options.server, case, options.quick)
        if value is not None:
            instructions[case], tool = value, used

    flat = {c: [t for r in samples[c] for t in r] for c in samples}
    rounds = {c: [statistics.median(r) for r in samples[c]] for c in samples}
    medians = {c: statistics.median(flat[c]) for c in samples}

    with open(os.path.join(options.out, "samples.csv"), "w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(["case", "round", "ns"])
        for case, measured in samples.items():
            writer.writerows([case, i, t] for i, r in enumerate(measured) for t in r)
    with open(os.path.join(options.out, "summary.csv"), "w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(["case", "share", "median_ns", "lower_quartile_ns", "upper_quartile_ns",
                         "samples", "instructions"])
        for case in samples:
            low, middle, high = quartiles(flat[case])
            writer.writerow([case, shares.get(case, ""), middle, low, high, len(flat[case]),
                             round(instructions[case]) if case in instructions else ""])

    print(f"\n800x600 -> 580x580, synthetic frames, {label}, kernels for {target}, warm caches, "
          f"{len(rounds['full'])} interleaved rounds\n")
    print(f"{'':36} {'median ms':>10} {'spread':>7} {'x faster than':>14} {'':>8} {'million':>13}")
    print(f"{'':36} {'':>10} {'':>7} {'Python':>14} {'OpenCV':>8} {'instructions':>13}")
    for case in list(LABEL) + [c for c in samples if c not in LABEL]:
        if case not in samples:
            continue
        name = LABEL.get(case, f"press, {100 * shares.get(case, 0):.0f} % active")
        slow = "python+decode" if "decode" in case else "python"
        faster = medians[slow] / medians[case]
        count = f"{instructions[case] / 1e6:.2f}" if case in instructions else ""
        print(f"{name:36} {medians[case] / 1e6:10.4f} {spread(flat[case]):6.1f}% {faster:13.1f}x "
              f"{medians['opencv'] / medians[case]:7.1f}x {count:>13}")
    if tool:
        print(f"instructions counted by {tool}")
    print()

    lines = goals(medians, rounds, shares)
    exact = not wrong
    lines.append(("every result right, ours equal to the scalar kernels bit for bit",
                  "exact" if exact else "; ".join(wrong), exact, "" if exact else "wrong"))
    report(options.out, "kernels", lines)
    try:
        plot(options.out, medians, samples, shares, label)
        print(f"\nsamples.csv, summary.csv, pipelines.svg, cost_against_area.svg in {options.out}")
    except ImportError:
        print(f"\nno matplotlib: no plots; samples.csv and summary.csv in {options.out}")
    print(f"took {time.monotonic() - began:.0f} s")
    return 0 if exact else 1


if __name__ == "__main__":
    sys.exit(main())
