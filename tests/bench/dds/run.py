#!/usr/bin/env python3
"""Measures dtact-dds in front of daemons, each of which plays a recording of the simulated sensor at a quarter, with a
Fast DDS subscriber to all maps and contacts: on one machine by the number of sensors; between hosts in network
namespaces whose packets are lost and delayed; with 32 sensors on 8 hosts, one of them cut off.

A client of each daemon itself notes which frames there were; a message is lost when the subscriber has none with a
frame's time. Latency runs from the frame's time to the subscriber's callback."""
import argparse
import bisect
import contextlib
import os
import pathlib
import statistics
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / folder) for folder in ("tests/bench/loop", "tests/bench", "tests/e2e/dds")]
import daemon as loop  # noqa: E402
import goals  # noqa: E402
from dds_test import HERE, Client, Daemon, Dds, E, M, Peer, Reader, make_types, ns  # noqa: E402
from network import DEVICE, Network  # noqa: E402

PROGRAMS = {"DTACTD": "daemon/dtactd", "DTACT_DDS": "clients/dtact-dds", "FASTDDS_PEER": "tests/e2e/fastdds_peer"}
MAP, CONTACT = "indentation/image", "contact"
TYPES = {MAP: "sensor_msgs/Image", CONTACT: "dtact_msgs/Contact"}
PREFIX = "rt/"
EDGE_S = 0.5  # At both ends of a measurement frames are under way.
SENSORS = (1, 2, 4, 8)
LOSSES = ((0, 0), (0.001, 0), (0.01, 0), (0, 2), (0.01, 2))  # share of packets, milliseconds
AWAY_S = 25  # Longer than a participant's lease in either DDS, so that the host has been forgotten.


def cpu_s(pid: int) -> float:
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_mib(pid: int) -> float:
    return int(pathlib.Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def median_and_99(values: list[float]) -> tuple[float, float]:
    cuts = statistics.quantiles(values, n=100)
    return cuts[49], cuts[98]


class Direct(threading.Thread):
    """A client of a daemon itself, until `stop`: the frames' times and its own latencies."""

    def __init__(self, port: int, maps: bool, network: contextlib.AbstractContextManager) -> None:
        super().__init__(daemon=True)
        with network:
            self.client = Client(port)
        self.maps, self.stop = maps, threading.Event()
        self.wall_ns: list[int] = []
        self.latencies: list[float] = []

    def run(self) -> None:
        depth = {"depth": E.DEPTH_INT16, "decimation": 1} if self.maps else {}
        with self.client as client:
            client.call(subscribe=M.Subscribe(summary=True, **depth))
            while not self.stop.is_set():
                frame = client.frame()
                self.wall_ns.append(frame.wall_ns)
                self.latencies.append((time.clock_gettime_ns(time.CLOCK_REALTIME) - frame.wall_ns) * 1e-6)


class Fleet:
    """Daemons and a dtact-dds on each host, until the block ends. Without a network all are on this machine; in one,
    host 0 is the subscriber's and the sensors are spread over the others."""

    def __init__(self, recording: dict, sensors: int, fps: float, network: Network | None = None) -> None:
        self.network = network
        hosts = range(1, len(network.hosts)) if network else [0]
        self.daemons, self.dds, self.host = [], [], {}
        for host in hosts:
            within = network.hosts[host] if network else ()
            mine = []
            for index in range(sensors // len(hosts)):
                name = f"h{host}s{index}"
                self.host[name] = host
                mine.append((name, Daemon(HERE, name, "camera.backend=replay", f"camera.fps={fps}",
                                          f"camera.replay.folder={recording['mjpeg']}",
                                          f"calibration={recording['calibration']}", "ring.backend=null",
                                          "reconstruction.resolution=quarter", within=within)))
            self.daemons += mine
            interface = ("--interface", DEVICE) if network else ()
            self.dds.append(Dds(f"dds{host}", *interface, *(word for name, one in mine for word in (
                "--daemon", f"{name}=127.0.0.1:{one.port}")), within=within))

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        for program in (*self.dds, *(one for _, one in self.daemons)):
            program.stop()

    def topics(self) -> list[str]:
        return [f"{PREFIX}{name}/{kind}" for name, _ in self.daemons for kind in (CONTACT, MAP)]

    def subscriber(self, qos: str) -> Peer:
        peer = Peer(within=self.network.hosts[0] if self.network else ())
        for topic in self.topics():
            kind = topic[len(PREFIX):].split("/", 1)[1]
            peer.say("subscribe", topic, make_types.dds_name(TYPES[kind]), qos, "64")
        return peer

    def direct(self, number: int, maps: bool) -> Direct:
        name, one = self.daemons[number]
        inside = self.network.inside(self.host[name]) if self.network else contextlib.nullcontext()
        client = Direct(one.port, maps, inside)
        client.start()
        return client


def drain(peer: Peer, topic: str) -> list[tuple[int, int, bytes]]:
    """(received, stamp, payload) of each message that has come."""
    came = []
    while not peer.samples[topic].empty():
        received, payload = peer.samples[topic].get()
        came.append((received, ns(Reader(payload).message("std_msgs/Header").stamp), payload))
    return came


def discover(fleet: Fleet, peer: Peer, began: float) -> float:
    for topic in fleet.topics():
        peer.samples[topic].get(timeout=60)
    return time.monotonic() - began


def measure(fleet: Fleet, peer: Peer, seconds: float) -> dict:
    """Latency, loss and processor time of a running fleet."""
    clients = [fleet.direct(number, maps=number == 0) for number in range(len(fleet.daemons))]
    time.sleep(1)
    for topic in fleet.topics():
        drain(peer, topic)
    fleet_pids = [one.process.pid for one in fleet.dds], [one.process.pid for _, one in fleet.daemons]
    before, began, wall = [sum(map(cpu_s, pids)) for pids in fleet_pids], time.monotonic(), time.time_ns()
    time.sleep(seconds)
    used, took = [sum(map(cpu_s, pids)) - past for pids, past in zip(fleet_pids, before)], time.monotonic() - began
    time.sleep(EDGE_S)
    for client in clients:
        client.stop.set()
    frames, lost, latencies = 0, {CONTACT: 0, MAP: 0}, []
    for (name, _), client in zip(fleet.daemons, clients):
        client.join()
        times = sorted(at for at in client.wall_ns
                       if wall + EDGE_S * 1e9 < at < wall + (seconds - EDGE_S) * 1e9)
        frames += len(times)
        half_ns = (times[-1] - times[0]) / (len(times) - 1) / 2
        for kind in lost:
            came = drain(peer, f"{PREFIX}{name}/{kind}")
            stamps = sorted(stamp for _, stamp, _ in came)
            if kind == MAP:
                latencies += [(received - stamp) * 1e-6 for received, stamp, _ in came]
            for at in times:
                place = bisect.bisect_left(stamps, at - half_ns / 2)
                lost[kind] += place == len(stamps) or stamps[place] > at + half_ns / 2
    sensors = len(fleet.daemons)
    return {"sensors": sensors, "frames": frames, "fps": frames / sensors / (seconds - 2 * EDGE_S),
            "lost_maps": lost[MAP], "lost_contacts": lost[CONTACT],
            "map_ms": median_and_99(latencies) if len(latencies) > 1 else (float("nan"),) * 2,
            "direct_ms": median_and_99(clients[0].latencies),
            "dds_percent": 100 * used[0] / took / sensors, "daemon_percent": 100 * used[1] / took / sensors}


def show(row: dict, head: str) -> None:
    print(f"{head}: {row['sensors']} sensors at {row['fps']:.1f} fps; map median {row['map_ms'][0]:.2f} ms, 99 % "
          f"{row['map_ms'][1]:.2f} ms (direct {row['direct_ms'][0]:.2f}, {row['direct_ms'][1]:.2f}); lost of "
          f"{row['frames']}: {row['lost_maps']} maps, {row['lost_contacts']} contacts; processor a sensor: dtact-dds "
          f"{row['dds_percent']:.2f} %, dtactd {row['daemon_percent']:.1f} %; load {os.getloadavg()[0]:.1f}",
          flush=True)


def by_sensors(recording: dict, seconds: float) -> list[tuple]:
    rows = []
    for sensors in SENSORS:
        with Fleet(recording, sensors, loop.FPS) as fleet:
            began = time.monotonic()
            with fleet.subscriber("sensor") as peer:
                found = discover(fleet, peer, began)
                rows.append(measure(fleet, peer, seconds))
        show(rows[-1], f"one machine, found within {found:.2f} s")
    beside = max(row["map_ms"][1] - row["direct_ms"][1] for row in rows)
    lost = 100 * sum(row["lost_maps"] for row in rows) / sum(row["frames"] for row in rows)
    used = max(row["dds_percent"] for row in rows)
    return [("at most 0.1 % of maps lost on one machine", f"{lost:.3f} %", lost <= 0.1, f"{lost - 0.1:.3f} % too many"),
            ("99 % of maps at most 8 ms beside a direct client's", f"{beside:.1f} ms", beside <= 8,
             f"{beside - 8:.1f} ms too late"),
            ("dtact-dds at most 1.5 % of a core a sensor", f"{used:.2f} %", used <= 1.5, f"{used - 1.5:.2f} % too much")]


def lossy(recording: dict, seconds: float) -> None:
    with Network(3) as network, Fleet(recording, 4, loop.FPS, network) as fleet:
        for qos in ("sensor", "reliable"):
            for loss, delay_ms in LOSSES:
                network.set(loss, delay_ms)
                began, before = time.monotonic(), network.counts()
                with fleet.subscriber(qos) as peer:
                    found = discover(fleet, peer, began)
                    row = measure(fleet, peer, seconds)
                packets = [now - past for now, past in zip(network.counts(), before)]
                show(row, f"2 hosts, {qos}, {100 * loss:g} % of packets lost, delay 0 to {delay_ms} ms, found within "
                     f"{found:.2f} s, packets (passed, lost, queue full, in parts) {packets}")


def many(recording: dict, seconds: float) -> list[tuple]:
    """32 sensors on 8 hosts, slow, and one of the hosts cut off."""
    with Network(9) as network, Fleet(recording, 32, 4, network) as fleet:
        began = time.monotonic()
        with fleet.subscriber("sensor") as peer:
            found = discover(fleet, peer, began)
            show(measure(fleet, peer, seconds), f"8 hosts, found within {found:.2f} s")
            network.cut(1)
            during = threading.Timer(AWAY_S, network.join, [1])
            during.start()
            time.sleep(1)
            mine = {topic for topic in fleet.topics() if topic.startswith(f"{PREFIX}h1")}
            for topic in fleet.topics():
                drain(peer, topic)
            time.sleep(AWAY_S - 3)
            others = {topic: len(drain(peer, topic)) for topic in fleet.topics()}
            during.join()
            joined = time.monotonic()
            for topic in mine:
                peer.samples[topic].get(timeout=60)
            back = time.monotonic() - joined
        slowest = min(count for topic, count in others.items() if topic not in mine) / (AWAY_S - 3)
        print(f"8 hosts, one cut off for {AWAY_S} s: the others' slowest topic {slowest:.2f} of 4 messages a second, its "
              f"own {sum(others[topic] for topic in mine)} messages; back {back:.2f} s after")
    return [("32 sensors found within 3 s", f"{found:.1f} s", found <= 3, f"{found - 3:.1f} s too late"),
            ("a host that was cut off back within 5 s", f"{back:.1f} s", back <= 5, f"{back - 5:.1f} s too late")]


def memory(recording: dict, minutes: float) -> None:
    """Subscribers come and go, daemons leave and come back; what does dtact-dds hold?"""
    with Fleet(recording, 2, 20) as fleet:
        began, rounds, samples = time.monotonic(), 0, []
        while time.monotonic() < began + 60 * minutes:
            rounds += 1
            with fleet.subscriber("reliable" if rounds % 2 else "sensor") as peer:
                discover(fleet, peer, 0)
                for _ in range(4):
                    time.sleep(5)
                    samples.append(((time.monotonic() - began) / 60, resident_mib(fleet.dds[0].process.pid)))
            if rounds % 5 == 0:
                one = fleet.daemons[rounds // 5 % 2][1]
                one.stop()
                time.sleep(1)
                one.restart()
            if rounds % 10 == 0:
                print(f"{samples[-1][0]:.1f} min: {samples[-1][1]:.1f} MiB", flush=True)
        first, last = samples[len(samples) // 12:len(samples) // 6], samples[-len(samples) // 12:]
        print(f"dtact-dds after {first[0][0]:.0f} to {first[-1][0]:.0f} min: at most {max(m for _, m in first):.1f} MiB; "
              f"in the last {samples[-1][0] - last[0][0]:.0f} min: at most {max(m for _, m in last):.1f} MiB; "
              f"{rounds} subscribers, {rounds // 5} restarts of a daemon")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--build", required=True, type=pathlib.Path, help="folder of the release build with tests")
    parser.add_argument("--out", default="build/bench/results", help="folder for the goals")
    parser.add_argument("--seconds", type=float, default=20, help="of each measurement")
    parser.add_argument("--only", choices=("sensors", "lossy", "many"), help="this part alone")
    parser.add_argument("--memory", type=float, metavar="MINUTES", help="measure memory alone, for this long")
    options = parser.parse_args()
    for variable, path in PROGRAMS.items():
        os.environ[variable] = str(options.build.resolve() / path)
    with tempfile.TemporaryDirectory() as folder:
        recording = loop.prepare(loop.Programs(str(options.build)), os.path.join(folder, "loop"))
        if options.memory:
            memory(recording, options.memory)
            return
        reported = []
        if options.only in (None, "sensors"):
            reported += by_sensors(recording, options.seconds)
        if options.only in (None, "lossy"):
            lossy(recording, options.seconds)
        if options.only in (None, "many"):
            reported += many(recording, options.seconds)
    os.makedirs(options.out, exist_ok=True)
    goals.report(options.out, "dds", reported)


if __name__ == "__main__":
    main()
