"""Hosts in network namespaces of their own, joined by a switch that loses and delays packets as netem
would, which not every kernel has. Run as a program, this file is the switch, in a namespace of its own."""
import argparse
import contextlib
import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import sys
import time

TUNSETIFF = 0x400454CA
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
CLONE_NEWNET = 0x40000000
MAX_FRAME = 2048
IPV4, MORE_OR_OFFSET = b"\x08\x00", 0x3FFF
DEVICE = "tap0"


def ip(pid: int, *words: str) -> None:
    subprocess.run(["nsenter", f"--net=/proc/{pid}/ns/net", "ip", *words], check=True)


def usable() -> bool:
    return os.access("/dev/net/tun", os.R_OK | os.W_OK) and subprocess.run(
        ["unshare", "--net", "true"], capture_output=True, check=False).returncode == 0


class Network:
    """`hosts` holds the arguments that run a command on each: 10.77.0.1 and on, interface tap0."""

    def __init__(self, hosts: int) -> None:
        self.holders = [subprocess.Popen(["unshare", "--net", "sh", "-c", "echo; read _"], stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE) for _ in range(hosts)]
        for holder in self.holders:
            holder.stdout.readline()  # the namespace is there
            ip(holder.pid, "link", "set", "lo", "up")
        self.hosts = [("nsenter", f"--net=/proc/{holder.pid}/ns/net") for holder in self.holders]
        self.switch = subprocess.Popen(
            ["unshare", "--net", sys.executable, "-B", __file__, *(str(holder.pid) for holder in self.holders)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        if self.switch.stdout.readline() != "ready\n":
            raise OSError("the switch did not start; namespaces and TAP devices need root")

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        for process in (self.switch, *self.holders):
            process.stdin.close()
            process.wait(timeout=20)
            process.stdout.close()

    def set(self, loss: float = 0, delay_ms: float = 0) -> None:
        """Each packet is lost with probability `loss` and delayed by 0 to `delay_ms`, so packets overtake."""
        self.tell(f"set {loss} {delay_ms}")

    def cut(self, host: int) -> None:
        self.tell(f"cut {host}")

    def join(self, host: int) -> None:
        self.tell(f"join {host}")

    def counts(self) -> tuple[int, int, int, int]:
        """Packets passed on, lost on purpose, lost because a host's queue was full; parts of IP datagrams."""
        return tuple(map(int, self.tell("counts").split()))

    def tell(self, line: str) -> str:
        print(line, file=self.switch.stdin, flush=True)
        return self.switch.stdout.readline()

    @contextlib.contextmanager
    def inside(self, host: int):
        """The calling thread's new sockets are the host's."""
        libc = ctypes.CDLL(None, use_errno=True)
        with open("/proc/thread-self/ns/net", "rb") as own, \
                open(f"/proc/{self.holders[host].pid}/ns/net", "rb") as other:
            if libc.setns(other.fileno(), CLONE_NEWNET) != 0:
                raise OSError(ctypes.get_errno(), "setns")
            try:
                yield
            finally:
                libc.setns(own.fileno(), CLONE_NEWNET)


class Switch:
    def __init__(self, pids: list[int]) -> None:
        self.ports = []
        for number, pid in enumerate(pids):
            port = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
            fcntl.ioctl(port, TUNSETIFF, struct.pack("16sH22x", f"port{number}".encode(), IFF_TAP | IFF_NO_PI))
            subprocess.run(["ip", "link", "set", f"port{number}", "netns", str(pid)], check=True)
            ip(pid, "link", "set", f"port{number}", "name", DEVICE, "txqueuelen", "10000")
            ip(pid, "addr", "add", f"10.77.0.{number + 1}/24", "dev", DEVICE)
            ip(pid, "link", "set", DEVICE, "up", "multicast", "on")
            ip(pid, "route", "add", "default", "dev", DEVICE)
            self.ports.append(port)
        self.loss, self.delay_s = 0.0, 0.0
        self.cut: set[int] = set()
        self.learned: dict[bytes, int] = {}
        self.waiting: list[tuple[float, int, int, bytes]] = []
        self.passed = self.lost = self.overflowed = self.parts = 0

    def run(self) -> None:
        print("ready", flush=True)
        poll = select.epoll()
        for port in (*self.ports, sys.stdin.fileno()):
            poll.register(port, select.EPOLLIN)
        number_of = {port: number for number, port in enumerate(self.ports)}
        while True:
            # epoll counts in milliseconds: the last one is waited for without sleep.
            rest = self.waiting[0][0] - time.monotonic() if self.waiting else None
            for port, _ in poll.poll(None if rest is None else max(0.0, rest - 0.001)):
                if port == sys.stdin.fileno():
                    line = sys.stdin.readline()
                    if not line:
                        return
                    self.obey(*line.split())
                else:
                    self.read(number_of[port], port)
            now = time.monotonic()
            while self.waiting and self.waiting[0][0] <= now:
                _, _, to, frame = heapq.heappop(self.waiting)
                self.write(to, frame)

    def obey(self, verb: str, *words: str) -> None:
        if verb == "set":
            self.loss, self.delay_s = float(words[0]), float(words[1]) * 1e-3
        elif verb == "cut":
            self.cut.add(int(words[0]))
        elif verb == "join":
            self.cut.discard(int(words[0]))
        print(self.passed, self.lost, self.overflowed, self.parts, flush=True)

    def read(self, number: int, port: int) -> None:
        for _ in range(64):
            try:
                frame = os.read(port, MAX_FRAME)
            except BlockingIOError:
                return
            if number in self.cut:
                continue
            self.parts += frame[12:14] == IPV4 and int.from_bytes(frame[20:22], "big") & MORE_OR_OFFSET != 0
            self.learned[frame[6:12]] = number
            known = self.learned.get(frame[:6])
            for to in range(len(self.ports)) if known is None else (known,):
                if to != number and to not in self.cut:
                    self.send(to, frame)

    def send(self, to: int, frame: bytes) -> None:
        if self.loss > 0 and random.random() < self.loss:
            self.lost += 1
        elif self.delay_s > 0:
            self.passed += 1
            heapq.heappush(self.waiting, (time.monotonic() + random.uniform(0, self.delay_s), self.passed, to, frame))
        else:
            self.passed += 1
            self.write(to, frame)

    def write(self, to: int, frame: bytes) -> None:
        try:
            os.write(self.ports[to], frame)
        except OSError:
            self.overflowed += 1


def main() -> None:
    parser = argparse.ArgumentParser(description="The switch; commands come from standard input.")
    parser.add_argument("pids", nargs="+", type=int, help="a process in the namespace of each host")
    Switch(parser.parse_args().pids).run()


if __name__ == "__main__":
    main()
