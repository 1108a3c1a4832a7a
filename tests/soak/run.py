#!/usr/bin/env python3
"""Runs dtactd on the simulated sensor for a long time, with scripted faults, commands and clients
that come and go, all from one seed, and checks it the whole time. See README.md.

Exit status: 0 nothing was found; 1 something was; 77 Debian's packages are missing.
"""
import argparse
import math
import multiprocessing
import os
import pathlib
import queue
import shutil
import signal
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "clients/python/src")]
try:
    import checks
    import clients
    import plan
    import record
    import report
    from commander import Commander
    from daemon import Daemon, Programs, calibrate, run
except ImportError as problem:
    print(f"soak: {problem}: apt-get install python3-numpy python3-protobuf python3-zstandard")
    sys.exit(77)

#: The honest client, the judge and the commander, which are always connected.
RESIDENTS = 3


def alone(target, *arguments):
    """A client's process: Ctrl-C is for its parent, which ends all of them in order."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    target(*arguments)


class Soak:
    def __init__(self, programs, folder, seed, episodes, per_second):
        self.folder = folder
        self.episodes = episodes
        self.record = record.Record(episodes)
        calibration = calibrate(programs, folder, "calibration", 1)
        uploads = any(step.verb == "upload" for episode in episodes for step in episode.steps)
        other = calibrate(programs, folder, "other", 2) if uploads else calibration
        text, self.words = plan.scene(seed, episodes)
        scene = folder / "scene.toml"
        scene.write_text(text)
        still = {"A": plan.HOLD_A, "B": plan.HOLD_B, "no_contact": plan.NO_CONTACT}
        size = run(programs.truth, scene, *(f"{folder / name}.truth:{round(sum(span) / 2 * plan.FPS)}"
                                            for name, span in still.items()))
        truths = clients.truth_maps(folder, *map(int, size.split()))
        self.daemon = Daemon(programs, folder, calibration, scene)
        self.began = time.monotonic()

        self._queue = multiprocessing.Queue()
        self._stop = multiprocessing.Event()
        self._open = multiprocessing.Event()
        self._inside = multiprocessing.Value("i", 0)
        address = self.daemon.address
        common = (address, self._queue, self._stop)
        self._processes = [
            multiprocessing.Process(target=alone, args=arguments, daemon=True) for arguments in (
                (clients.honest, *common),
                (clients.judge, *common, episodes, truths, per_second),
                (clients.visitors, *common, self._open, self._inside, seed))]
        for process in self._processes:
            process.start()
        self.commander = Commander(address, other, self.record.faults.append)

    def drain(self):
        while True:
            try:
                self.record.take(*self._queue.get_nowait())
            except queue.Empty:
                return

    def wait(self, done):
        """Waits until `done()`; reads messages meanwhile. RuntimeError when nothing moves any more."""
        moved, at = time.monotonic(), self.commander.sequence
        while not done():
            self.commander.listen(0.05)
            self.drain()
            if self.commander.sequence != at:
                moved, at = time.monotonic(), self.commander.sequence
            if not self.daemon.alive():
                raise RuntimeError("the daemon has ended")
            if time.monotonic() - moved > clients.TIMEOUT_S:
                raise RuntimeError(f"no frame and no event came for {clients.TIMEOUT_S:.0f} s after "
                                   f"frame {at}")

    def reached(self, sequence):
        return lambda: self.commander.sequence >= sequence

    def play(self, episode):
        self._open.set()
        seen = self.record.seen[episode.index]
        for step in episode.steps:
            self.wait(self.reached(step.sequence))
            # The previous episode has not come to rest in time: a step that did not begin is not undone.
            if step is episode.steps[0] and not self.commander.in_time(step):
                seen.late = True
                break
            in_time, took = self.commander.do(step)
            seen.late |= not in_time
            seen.answer_s = max(seen.answer_s, took)
        self.wait(self.reached(episode.at(plan.VISITORS_LEAVE)))
        self._open.clear()
        self.wait(self.reached(episode.at(plan.REST)))
        until = time.monotonic() + clients.TIMEOUT_S
        self.wait(lambda: self._inside.value == 0 or time.monotonic() > until)
        # The daemon notices a reset a moment later.
        self.wait(lambda: len(self.commander.status().message.clients) == RESIDENTS
                  or time.monotonic() > until)
        if time.monotonic() > until:
            self.record.faults.append(f"episode {episode.index}: clients that have left are still "
                                      "connected, or did not leave")
        late_s = (self.commander.sequence - episode.at(plan.REST)) / plan.FPS
        names = self.daemon.descriptors()
        self.record.rests.append(record.Rest(
            time.monotonic() - self.began, episode.index, self.daemon.held(), names,
            os.getloadavg()[0], late_s))

    def run(self):
        try:
            for episode in self.episodes:
                self.play(episode)
                print(f"soak: {time.monotonic() - self.began:6.0f} s  episode {episode.index + 1} of "
                      f"{len(self.episodes)}, {episode.kind}; {self.record.visits} visits", flush=True)
            self.wait(self.reached(plan.EPISODE * len(self.episodes)))
        except (Exception, KeyboardInterrupt) as problem:  # the report has what was seen until then
            self.record.faults.append(f"the run broke off: {type(problem).__name__}: {problem}")
            del self.record.seen[len(self.record.rests):]  # those that were not played to their end
        self.finish()

    def finish(self):
        self._open.clear()
        self._stop.set()
        until = time.monotonic() + clients.TIMEOUT_S
        while any(process.is_alive() for process in self._processes) and time.monotonic() < until:
            self.drain()
            time.sleep(0.05)
        for process in self._processes:
            if process.is_alive():
                self.record.faults.append("a client did not end")
                process.kill()
            process.join()
        self.drain()
        self.commander.close()
        self.record.seconds = time.monotonic() - self.began
        for event in self.commander.events:
            self.record.event(*event)
        self.record.answered += self.commander.answers
        self.record.ended = self.daemon.end()
        self.record.log = self.daemon.log()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", required=True, type=pathlib.Path, help="folder of a build with tests")
    parser.add_argument("--out", required=True, type=pathlib.Path, help="folder, made anew")
    how_long = parser.add_mutually_exclusive_group(required=True)
    how_long.add_argument("--hours", type=float)
    how_long.add_argument("--minutes", type=float)
    how_long.add_argument("--smoke", action="store_true", help="three short episodes")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()

    if options.smoke:
        episodes = plan.episodes(options.seed, 1 + len(plan.SHORT), plan.SHORT)
    else:
        seconds = options.hours * 3600 if options.hours is not None else options.minutes * 60
        if not 2 * plan.EPISODE_S <= seconds <= 365 * 86400:
            parser.error(f"a soak takes from {2 * plan.EPISODE_S} seconds to a year")
        episodes = plan.episodes(options.seed, math.ceil(seconds / plan.EPISODE_S))
    shutil.rmtree(options.out, ignore_errors=True)
    options.out.mkdir(parents=True)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    soak = Soak(Programs(options.build.resolve()), options.out.resolve(), options.seed, episodes,
                5.0 if len(episodes) < 200 else 2.0)
    soak.run()

    verdicts = checks.verdicts(soak.record)
    about = [f"dtactd on the simulated sensor, {soak.record.seconds / 60:.1f} minutes, seed "
             f"{options.seed}, {os.cpu_count()} CPUs, Linux {os.uname().release.split('-')[0]}."]
    report.write(options.out, soak.record, verdicts, soak.words, about)
    for verdict in verdicts:
        print(f"{verdict.word:10}  {verdict.check}: {verdict.measured} (limit: {verdict.limit})")
        for fault in verdict.faults:
            print(f"            {fault.strip()}")
    print(f"soak: report in {options.out / 'report.md'}")
    return 1 if any(verdict.faults for verdict in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main())
