"""Greatest frame rate on one core, many clients, memory."""
import csv
import os
import subprocess
import time

from daemon import FPS, Daemon

MIN_FPS = 600
MAX_RSS_MIB = 60
# Growth allowed in a process without a leak: the allocator's arenas of rare commands.
FLAT_KIB = 512
CLIENTS = (1, 2, 4, 8, 16, 32, 64)
RATES = (FPS, 4 * FPS)  # the second shows what happens when not every client can have every frame


def connect(programs, daemon, clients, seconds, output):
    return subprocess.Popen([programs.client, "--port", str(daemon.port), "--clients", str(clients),
                             "--seconds", str(seconds), "--skip", "2", "-o", output])


def greatest_rate(programs, folder, recordings, seconds):
    """Contact in every frame, nothing to decode, the whole daemon on the last CPU, one client on
    the others. Frames a second, resident KiB once a second, encodings a second, status."""
    core = max(os.sched_getaffinity(0))
    settings = {"camera.replay.folder": recordings["grey"], "camera.replay.paced": False,
                # A thread that never waits would block the network thread on a shared core.
                "capture.fifo_priority": 0}
    with Daemon(programs, folder, settings, ["taskset", "-c", str(core)]) as daemon:
        daemon.wait_serving()
        client = connect(programs, daemon, 1, seconds, os.path.join(folder, "rate.csv"))
        time.sleep(2)
        before = daemon.status()
        began = time.monotonic()
        rss = []
        while time.monotonic() < began + seconds - 1:
            rss.append(daemon.rss_kib())
            time.sleep(1)
        after = daemon.status()
        passed = time.monotonic() - began
        client.wait(timeout=60)
    delivered = after["camera"]["delivered"] - before["camera"]["delivered"]
    encoded = after["encoded"] - before["encoded"]
    with open(os.path.join(folder, "rate.csv"), newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    in_contact = sum(r["in_contact"] == "1" for r in rows) / max(1, len(rows))
    return delivered / passed, rss, encoded / passed, in_contact, after


def many_clients(programs, folder, recordings, rate, count, seconds):
    """One point of the curve."""
    output = os.path.join(folder, "clients.csv")
    settings = {"camera.replay.folder": recordings["mjpeg"], "camera.fps": float(rate)}
    with Daemon(programs, folder, settings) as daemon:
        daemon.wait_serving()
        client = connect(programs, daemon, count, seconds, output)
        time.sleep(3)
        before, cpu, began = daemon.status(), daemon.cpu_s(), time.monotonic()
        time.sleep(max(1, seconds - 4))  # while all are connected
        rss = daemon.rss_kib()
        after, cpu = daemon.status(), daemon.cpu_s() - cpu
        passed = time.monotonic() - began
        client.wait(timeout=60)

    def change(key):
        return after[key] - before[key]

    with open(output, newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    dropped = {r["client"]: [] for r in rows}
    for r in rows:
        dropped[r["client"]].append(int(r["dropped"]))
    return {"camera_fps": rate, "clients": count, "cpu_percent": 100 * cpu / passed,
            "delivered_fps": len(rows) / seconds / count, "published_fps": change("frames") / passed,
            "encoded": change("encoded"), "fetched": change("frames") - change("skipped"),
            "dropped_fps": sum(d[-1] - d[0] for d in dropped.values()) / seconds / count,
            "rss_mib": rss / 1024}


def plot(out, points, label):
    import matplotlib
    matplotlib.use("svg")
    from matplotlib import pyplot as plt

    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 5.5), sharex=True)
    for rate, style in zip(RATES, ("o-", "s--")):
        chosen = [p for p in points if p["camera_fps"] == rate]
        x = [p["clients"] for p in chosen]
        upper.plot(x, [p["delivered_fps"] for p in chosen], style, color="#4878a8",
                   label=f"camera at {rate} fps")
        lower.plot(x, [p["cpu_percent"] for p in chosen], style, color="#a84848",
                   label=f"camera at {rate} fps")
    lower.set_xscale("log", base=2)
    lower.set_xticks(CLIENTS, [str(n) for n in CLIENTS])
    lower.set_xlabel("clients, each asking for every frame, 673 kB a frame")
    upper.set_ylabel("frames a second at each")
    lower.set_ylabel("daemon, % of one core")
    for axis in (upper, lower):
        axis.set_ylim(bottom=0)
        axis.legend(fontsize=8)
    upper.set_title(f"Clients with drops allowed; each frame is encoded once\n{label}", fontsize=8)
    figure.tight_layout()
    figure.savefig(os.path.join(out, "clients.svg"))


def measure(programs, folder, recordings, out, label, seconds):
    """Prints and writes the results, returns the goals' lines."""
    print(f"bench: greatest frame rate on one core, {seconds:.0f} s", flush=True)
    fps, rss, encoded, in_contact, status = greatest_rate(programs, folder, recordings, seconds)
    growth = rss[-1] - rss[0]
    print(f"\nGreatest frame rate, the whole daemon on one core, no decoding, contact in "
          f"{100 * in_contact:.0f} % of the frames: {fps:.0f} fps\n"
          f"  (a client got {encoded:.0f} of them a second: the newest wins); resident "
          f"{rss[-1] / 1024:.1f} MiB, grown {growth} KiB over {len(rss)} s")
    for stage in status["stages"]:
        print(f"  {stage['stage']:9} p50 {stage['p50_us']:7.1f}  p99 {stage['p99_us']:7.1f} us")

    points = []
    for rate in RATES:
        for count in CLIENTS:
            print(f"bench: {count} clients at {rate} fps", flush=True)
            points.append(many_clients(programs, folder, recordings, rate, count,
                                       min(8, seconds)))
    print(f"\n{'camera':>8} {'clients':>8} {'CPU %':>7} {'fps at each':>12} {'dropped fps':>12} "
          f"{'encoded':>8} {'of fetched':>11} {'resident MiB':>13}")
    for p in points:
        print(f"{p['camera_fps']:4} fps {p['clients']:8} {p['cpu_percent']:7.0f} "
              f"{p['delivered_fps']:12.1f} {p['dropped_fps']:12.1f} {p['encoded']:8} "
              f"{p['fetched']:11} {p['rss_mib']:13.1f}")
    with open(os.path.join(out, "clients.csv"), "w", newline="", encoding="ascii") as file:
        writer = csv.DictWriter(file, points[0].keys())
        writer.writeheader()
        writer.writerows(points)
    with open(os.path.join(out, "memory.csv"), "w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(["second", "rss_kib"])
        writer.writerows(enumerate(rss))
    plot(out, points, label)

    # A frame may be between the two counters when the status is taken.
    once = all(abs(p["encoded"] - p["fetched"]) <= 2 for p in points)
    eight = max(p["rss_mib"] for p in points if p["clients"] == 8)
    return [
        (f"greatest frame rate, one core, ball contact, no decoding: at least {MIN_FPS} fps",
         f"{fps:.0f} fps", fps >= MIN_FPS, f"short by {MIN_FPS - fps:.0f} fps"),
        (f"memory flat meanwhile: within {FLAT_KIB} KiB", f"grown {growth} KiB",
         growth <= FLAT_KIB, f"short by {growth - FLAT_KIB} KiB"),
        ("each frame encoded once, 1 to 64 clients", "once" if once else "not once", once,
         "the counters differ"),
        (f"resident memory with 8 clients: at most {MAX_RSS_MIB} MiB", f"{eight:.1f} MiB",
         eight <= MAX_RSS_MIB, f"short by {eight - MAX_RSS_MIB:.1f} MiB"),
    ]
