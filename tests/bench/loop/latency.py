"""Latency from a frame's being ready to the client's socket, idle and under full load."""
import collections
import csv
import os
import subprocess

from daemon import FPS, Daemon

FIFO_CAPTURE = 40
FIFO_NETWORK = 20
FIFO_CLIENT = 10
STEP_US = 10  # width of a bin of the histogram
IDLE_MS = 3.0
LOADED_MS = 6.0

Case = collections.namedtuple("Case", "name clients loaded fifo")
CASES = [Case(f"{clients} client{'s' * (clients > 1)}, {'every core busy' if loaded else 'idle'}, "
              f"{'FIFO' if fifo else 'normal'}", clients, loaded, fifo)
         # Idle cases first: only they need an otherwise idle machine.
         for loaded in (False, True) for clients in (1, 8) for fifo in (True, False)]


def percentile(ordered, share):
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def stress(seconds):
    """Every core busy with ordinary programs."""
    return subprocess.Popen(["stress-ng", "--cpu", "0", "--timeout", f"{seconds}s"],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def stolen_s():
    """CPU seconds that the host of a virtual machine has kept from it."""
    with open("/proc/stat", encoding="ascii") as file:
        return int(file.readline().split()[8]) / os.sysconf("SC_CLK_TCK")


def missed(before, after):
    """Frames that the capture loop did not process, and faults of its thread, between two statuses."""
    frames = sum(after["camera"][k] - before["camera"][k] for k in ("lost", "skipped", "damaged"))
    usage = {k: after["capture_thread"][k] - before["capture_thread"][k]
             for k in after["capture_thread"]}
    return frames, usage


def run_case(programs, folder, recordings, case, seconds):
    settings = {"camera.replay.folder": recordings["mjpeg"]}
    settings["capture.fifo_priority"] = FIFO_CAPTURE if case.fifo else 0
    settings["net.fifo_priority"] = FIFO_NETWORK if case.fifo else 0
    samples = os.path.join(folder, "samples.csv")
    with Daemon(programs, folder, settings) as daemon:
        daemon.wait_serving()
        load = stress(int(seconds) + 20) if case.loaded else None
        try:
            client = subprocess.Popen(
                [programs.client, "--port", str(daemon.port), "--clients", str(case.clients),
                 "--seconds", str(seconds), "--skip", "5", "--cpu", "0", "--fifo",
                 str(FIFO_CLIENT), "-o", samples], stdout=subprocess.PIPE, text=True)
            try:
                client.wait(timeout=4)
                raise SystemExit("bench: the client ended at once")
            except subprocess.TimeoutExpired:
                before, stolen = daemon.status(), stolen_s()
            refused = client.communicate(timeout=seconds + 60)[0]
            after, stolen = daemon.status(), stolen_s() - stolen
            threads = daemon.threads()
        finally:
            if load:
                load.terminate()
                load.wait()
    with open(samples, newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    frames, usage = missed(before, after)
    return {"case": case, "rows": rows, "missed": frames, "usage": usage, "threads": threads,
            "refused": refused.strip().splitlines(), "stages": after["stages"],
            "stolen": stolen / seconds / os.cpu_count()}


def figures(result):
    """Latencies in milliseconds, and frames that clients missed."""
    rows = result["rows"]
    latency = sorted((int(r["received_ns"]) - int(r["ready_ns"])) / 1e6 for r in rows)
    # A recording's time is a frame's arrival; its exposure began a period earlier, as the daemon
    # itself assumes of such cameras.
    period = 1e9 / FPS
    start = 1
    exposure = sorted((int(r["received_ns"]) - int(r["stamp_ns"]) +
                       (0 if int(r["meaning"]) == start else period)) / 1e6 for r in rows)
    dropped = 0
    for client in {r["client"] for r in rows}:
        counts = [int(r["dropped"]) for r in rows if r["client"] == client]
        dropped += counts[-1] - counts[0]
    return {
        "frames": len(rows), "p50_ms": percentile(latency, 0.5),
        "p99_ms": percentile(latency, 0.99),
        "p99.9_ms": percentile(latency, 0.999), "max_ms": latency[-1],
        "exposure_p50_ms": percentile(exposure, 0.5), "exposure_p99_ms": percentile(exposure, 0.99),
        "missed_by_capture": result["missed"], "dropped_to_clients": dropped,
        "contact_share": sum(r["in_contact"] == "1" for r in rows) / len(rows),
        "stolen_share": result["stolen"], **result["usage"]}


def print_table(results, tables):
    print(f"\nLatency, ms from ready at the HAL to the client's socket at {FPS} fps, JPEG decoding "
          "included\n")
    print(f"{'':36} {'p50':>6} {'p99':>6} {'p99.9':>6} {'max':>6} {'missed':>7} {'dropped':>8}  "
          f"{'from exposure':>14}  {'switches a frame':>16}  {'faults':>6}  {'stolen':>6}")
    for result, t in zip(results, tables):
        per_frame = max(1, t["frames"] / result["case"].clients)
        print(f"{result['case'].name:36} {t['p50_ms']:6.2f} {t['p99_ms']:6.2f} {t['p99.9_ms']:6.2f} "
              f"{t['max_ms']:6.2f} {t['missed_by_capture']:7} {t['dropped_to_clients']:8}  "
              f"{t['exposure_p50_ms']:6.2f} {t['exposure_p99_ms']:7.2f}  "
              f"{(t['waits'] + t['preemptions']) / per_frame:16.2f}  "
              f"{t['minor_faults']:>4}+{t['major_faults']}  {100 * t['stolen_share']:5.2f}%")
    print("missed: frames the capture loop did not take; dropped: frames a client did not get;\n"
          "from exposure: p50 and p99 from the start of exposure, one period before ready; switches\n"
          "and page faults (minor+major): of the capture thread; stolen: CPU time the host took")
    print(f"there was contact in {100 * tables[0]['contact_share']:.0f} % of the frames")
    for fifo in (True, False):
        result = next(r for r in results if r["case"].fifo == fifo)
        print(f"\nthreads, {'FIFO' if fifo else 'normal'}: " + "; ".join(result["threads"]))
        print(f"  client: FIFO {FIFO_CLIENT}, pinned to CPU 0"
              if not result["refused"] else "  client " + "; ".join(result["refused"]))
    print("\nstages with one client, idle, FIFO, us:")
    for stage in results[0]["stages"]:
        print(f"  {stage['stage']:9} p50 {stage['p50_us']:7.1f}  p99 {stage['p99_us']:7.1f}  "
              f"max {stage['max_us']:7.1f}")


def histogram(result):
    counts = collections.Counter()
    for r in result["rows"]:
        counts[(int(r["received_ns"]) - int(r["ready_ns"])) // (1000 * STEP_US)] += 1
    return sorted(counts.items())


def write(out, results, tables):
    with open(os.path.join(out, "latency.csv"), "w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(["clients", "loaded", "fifo", *tables[0]])
        for result, table in zip(results, tables):
            case = result["case"]
            writer.writerow([case.clients, int(case.loaded), int(case.fifo), *table.values()])
    with open(os.path.join(out, "latency_histogram.csv"), "w", newline="",
              encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(["clients", "loaded", "fifo", "from_us", "frames"])
        for result in results:
            case = result["case"]
            writer.writerows([case.clients, int(case.loaded), int(case.fifo), step * STEP_US, count]
                             for step, count in histogram(result))


def goal_lines(results, tables):
    lines = []

    def at_most(goal, value, limit, unit):
        lines.append((f"{goal}: at most {limit:g} {unit}", f"{value:.2f} {unit}", value <= limit,
                      f"short by {value - limit:.2f} {unit}"))

    for result, table in zip(results, tables):
        case = result["case"]
        if case.fifo:
            at_most(f"p99 to the socket, {case.name}", table["p99_ms"],
                    LOADED_MS if case.loaded else IDLE_MS, "ms")
        if case.fifo and case.loaded:
            count = table["missed_by_capture"]
            lines.append((f"no frame missed by the capture loop, {case.name}", f"{count} missed",
                          count == 0, f"short by {count} frames"))
    faults = sum(t["minor_faults"] + t["major_faults"]
                 for r, t in zip(results, tables) if r["case"].fifo)
    lines.append(("no page fault of the capture thread after warm-up, FIFO cases",
                  f"{faults} page faults", faults == 0, f"short by {faults}"))
    return lines


def plot(out, results, tables, label):
    import matplotlib
    matplotlib.use("svg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 1, figsize=(8, 6.5), sharex=True)
    for axis, clients in zip(axes, (1, 8)):
        for result, table in zip(results, tables):
            case = result["case"]
            if case.clients != clients:
                continue
            bins = collections.Counter()
            for step, count in histogram(result):
                bins[min(step * STEP_US // 100, 250)] += count
            x = range(0, max(bins) + 2)
            axis.step([b / 10 for b in x], [bins[b] or 0.5 for b in x], where="post",
                      color="#a84848" if case.loaded else "#4878a8",
                      ls="-" if case.fifo else ":",
                      label=f"{'every core busy' if case.loaded else 'idle'}, "
                            f"{'FIFO' if case.fifo else 'normal'}: p99 {table['p99_ms']:.2f}, "
                            f"max {table['max_ms']:.1f} ms")
        axis.set_yscale("log")
        axis.set_ylim(bottom=0.7)
        axis.axvline(IDLE_MS, color="#4878a8", lw=0.7)
        axis.axvline(LOADED_MS, color="#a84848", lw=0.7)
        axis.set_ylabel("frames in 0.1 ms")
        axis.set_title(f"{clients} client{'s' * (clients > 1)}", fontsize=9)
        axis.legend(fontsize=8)
    axes[1].set_xlabel("ms from ready at the HAL to the client's socket (25: that and more); thin "
                       "lines: the goals for p99")
    figure.suptitle(f"Latency at {FPS} fps, JPEG decoding included\n{label}", fontsize=9)
    figure.tight_layout()
    figure.savefig(os.path.join(out, "latency.svg"))


def measure(programs, folder, recordings, out, label, seconds):
    """Runs every case, prints and writes the results, returns the goals' lines."""
    results = []
    for case in CASES:
        print(f"bench: {case.name}, {seconds:.0f} s", flush=True)
        results.append(run_case(programs, folder, recordings, case, seconds))
    tables = [figures(r) for r in results]
    print_table(results, tables)
    write(out, results, tables)
    plot(out, results, tables, label)
    return goal_lines(results, tables)
