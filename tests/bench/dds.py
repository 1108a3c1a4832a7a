#!/usr/bin/env python3
"""dds.py SENSORS FPS SECONDS: dtact-dds in front of daemons on the simulated sensor and one Fast DDS subscriber to
all quarter maps and contacts: latency from exposure beside a direct client of a daemon, loss, processor time,
discovery from cold. Programs are named by the environment, as for tests/e2e/dds/dds_test.py."""
import os
import pathlib
import queue
import statistics
import sys
import threading
import time

SOURCE = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tests/e2e/dds"))
from dds_test import DOMAIN, HERE, Client, Daemon, Dds, E, M, Peer, Reader, ns  # noqa: E402


def cpu_s(pid: int) -> float:
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def percentiles(values: list[float]) -> str:
    cuts = statistics.quantiles(values, n=100)
    return f"median {cuts[49]:.2f} ms, 99 % within {cuts[98]:.2f} ms"


def direct(port: int, seconds: float, into: list[float]) -> None:
    """Latency of a client of the daemon itself that asks for the same."""
    with Client(port) as client:
        client.call(subscribe=M.Subscribe(depth=E.DEPTH_INT16, decimation=4, summary=True))
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            frame = client.frame()
            into.append((time.clock_gettime_ns(time.CLOCK_REALTIME) - frame.wall_ns) * 1e-6)


def main() -> None:
    sensors, fps, seconds = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    daemons = [Daemon(HERE, f"s{i}", f"calibration={SOURCE}/config/simulated", f"camera.fps={fps}")
               for i in range(sensors)]
    topics = [f"rt/s{i}/{kind}" for i in range(sensors) for kind in ("contact", "indentation/image")]
    dds = Dds("bench", *(word for i, one in enumerate(daemons) for word in ("--daemon", f"s{i}=127.0.0.1:{one.port}")))
    began = time.monotonic()
    with Peer() as peer:
        for topic in topics:
            name = "dtact_msgs/Contact" if topic.endswith("contact") else "sensor_msgs/Image"
            peer.say("subscribe", topic, f"{name.split('/')[0]}::msg::dds_::{name.split('/')[1]}_", "sensor", "64")
        for topic in topics:
            peer.samples[topic].get(timeout=60)
        print(f"{sensors} sensors at {fps:g} fps: {time.monotonic() - began:.2f} s until each topic has a message; "
              f"load {os.getloadavg()[0]:.1f}")
        time.sleep(2)
        for topic in topics:
            peer.samples[topic] = queue.Queue()
        own: list[float] = []
        client = threading.Thread(target=direct, args=(daemons[0].port, seconds, own))
        before, started = [cpu_s(one.process.pid) for one in (dds, *daemons)], time.monotonic()
        client.start()
        time.sleep(seconds)
        used = [cpu_s(one.process.pid) - past for one, past in zip((dds, *daemons), before)]
        took = time.monotonic() - started
        client.join()
        latencies, messages, lost = [], 0, 0
        contacts: set[int] = set()
        for topic in topics:
            stamps = []
            while not peer.samples[topic].empty():
                received, payload = peer.samples[topic].get()
                stamps.append(ns(Reader(payload).message("std_msgs/Header").stamp))
                if not topic.endswith("contact"):
                    latencies.append((received - stamps[-1]) * 1e-6)
            messages += len(stamps)
            if topic.endswith("contact"):
                contacts = set(stamps)
            else:
                # Each frame has both; the ends of the two lists may be apart.
                lost += max(0, len(contacts ^ set(stamps)) - 2)
    print(f"  to the subscriber: {percentiles(latencies)}; to a direct client: {percentiles(own)}")
    print(f"  {messages} messages, {lost} lost between dtact-dds and the subscriber")
    print(f"  processor time: dtact-dds {100 * used[0] / took / sensors:.1f} % of a core a sensor, "
          f"dtactd {100 * sum(used[1:]) / took / sensors:.1f} %")
    for one in (dds, *daemons):
        one.stop()


if __name__ == "__main__":
    main()
