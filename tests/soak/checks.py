"""The faults in what a soak has seen. Every limit is here, with its reason."""
from __future__ import annotations

import math
import statistics
from dataclasses import dataclass

import plan
from daemon import log_lines
from record import Record, Rest, Seen

# ------------------------------------------------------------ limits

#: Both at every rest, when the same three clients are connected and nothing is under way.
MAX_DESCRIPTORS_MORE = 0
MAX_THREADS_MORE = 0
#: Rests before the figures count: by then every kind of client has come once, and the allocator has
#: its arenas. In a run that has time for it, every kind of episode as well.
WARM_UP_RESTS = 3
LONG_WARM_UP_RESTS = 1 + len(plan.KINDS)
#: Fewer are too few to judge memory, which sanitizers hold back for a while as well.
MIN_RESTS_FOR_MEMORY = 8
#: From the median of the first rests after warm-up to the median of the last. glibc returns memory that is
#: free at a heap's end only above 4 MB (M_TRIM_THRESHOLD in daemon/app/daemon.cpp), and each peak of
#: what clients have waiting raises what it keeps; the limit is half as much again.
MAX_RESIDENT_KIB_MORE = 6 * 1024
#: The goal is no growth; a daemon that grows by this for a year has grown by 4.4 GB. Two hours can resolve
#: this much with Theil and Sen's slope, because single rests scatter. The slope is taken of the resident
#: memory without the allocator's free memory. That grows to the largest peak of the load and no further (in
#: half an hour, while the blocks in use stay the same): a slope cannot judge growth that ends, so the limit
#: above judges it.
MAX_TAKEN_KIB_PER_HOUR = 512
#: Blocks in use as the allocator counts them: a leak shows here whatever the pages
#: of the heap do.
MAX_HEAP_KIB_MORE, MAX_HEAP_KIB_PER_HOUR = 1024, 128
#: Slopes, and latency at the end against the beginning, are judged in runs of at least this length.
MIN_S_FOR_DRIFT = 1800
#: 22 calibrations of two files (the store keeps 20 besides the current one and the one before), with
#: the reference and the link.
MAX_STATE_FILES = 60
MAX_STATE_KIB = 22 * 800
#: Medians over a fifth of the run, at its end against its beginning. Another program on the same
#: cores causes half as much again and a millisecond.
MAX_LATENCY_RATIO, MAX_LATENCY_MS_MORE = 1.5, 1.0
#: Mean absolute error of one frame, millimetres, while no health flag is set. Inside the
#: contact the ball reads as in tests/e2e/stream_test.cpp; edges of nuts and cylinders are
#: blurred by the gel (README, where methods fail).
MAX_ERROR_MM = {"A": 0.05, "B": 0.15, "no_contact": 0.01}
#: The bulge and the contact's own blurred edge are outside the contact.
MAX_OUTSIDE_MM = {"A": 0.03, "B": 0.03, "no_contact": 0.01}
#: Share of untrusted pixels inside the contact.
MAX_UNTRUSTED = 0.05
#: Median of the last fifth minus that of the first: the depth must not drift.
MAX_ERROR_MM_MORE = 0.005


# ------------------------------------------------------------ the checks

@dataclass(frozen=True)
class Verdict:
    check: str
    measured: str
    limit: str
    faults: tuple[str, ...] = ()
    judged: bool = True  #: False: the run is too short to judge

    @property
    def word(self):
        return "FAULT" if self.faults else "passed" if self.judged else "not judged"


def slope(points: list[tuple[float, float]]) -> float:
    """Theil and Sen's: the median of the slopes between all pairs, so that a fourth of outliers
    moves it little."""
    slopes = [(y2 - y1) / (x2 - x1) for i, (x1, y1) in enumerate(points)
              for x2, y2 in points[i + 1:] if x2 != x1]
    return statistics.median(slopes) if slopes else 0.0


def ends(values: list[float]) -> tuple[float, float]:
    """Medians of the first and the last fifth."""
    n = max(1, len(values) // 5)
    return statistics.median(values[:n]), statistics.median(values[-n:])


def verdicts(record: Record) -> list[Verdict]:
    long = record.seconds >= MIN_S_FOR_DRIFT
    return [*_held(record.rests, long), *_latency(record.seen, long), _frames(record),
            _health(record.seen), _camera(record), *_depth(record.seen, long), _answers(record),
            _log(record.log), _end(record.ended)]


def _held(rests: list[Rest], long: bool) -> list[Verdict]:
    if len(rests) < 2:
        return [Verdict("rests", str(len(rests)), "two at least", ("the run never came to rest",))]
    warm_up = LONG_WARM_UP_RESTS if len(rests) > 2 * LONG_WARM_UP_RESTS else WARM_UP_RESTS
    warm = rests[min(warm_up, len(rests) - 2):]
    base = warm[0]
    made = []
    for name, most in (("descriptors", MAX_DESCRIPTORS_MORE), ("threads", MAX_THREADS_MORE)):
        counts = [getattr(rest.held, name) for rest in warm]
        faults = []
        for rest in warm:
            if abs(getattr(rest.held, name) - counts[0]) > most:
                more = ""
                if name == "descriptors":
                    more = ": " + ", ".join(_differ(base.descriptors, rest.descriptors))
                faults.append(f"{name} at rest went from {counts[0]} to {getattr(rest.held, name)} by "
                              f"episode {rest.episode}{more}")
        made.append(Verdict(f"{name} at rest", f"{min(counts)} to {max(counts)}",
                            "the same each time", tuple(faults[:3])))

    enough = len(rests) >= MIN_RESTS_FOR_MEMORY
    for name, key, most in (("resident memory", "resident_kib", MAX_RESIDENT_KIB_MORE),
                            ("memory in use", "heap_kib", MAX_HEAP_KIB_MORE)):
        first, last = ends([float(getattr(rest.held, key)) for rest in warm])
        faults = [f"{name} grew from {first:.0f} to {last:.0f} kB"
                  ] if enough and last - first > most else []
        made.append(Verdict(f"{name}, beginning to end", f"{last - first:+.0f} kB", f"{most} kB",
                            tuple(faults), enough))
    for name, key, max_rate in (
            ("resident memory but for what is kept", "taken_kib", MAX_TAKEN_KIB_PER_HOUR),
            ("memory in use", "heap_kib", MAX_HEAP_KIB_PER_HOUR)):
        rate = 3600 * slope([(rest.at_s, float(getattr(rest.held, key))) for rest in warm])
        faults = [f"{name} grows by {rate:.0f} kB an hour"] if long and rate > max_rate else []
        made.append(Verdict(f"{name}, slope", f"{rate:+.0f} kB/h", f"{max_rate} kB/h",
                            tuple(faults), long))

    files = max(rest.held.state_files for rest in rests)
    size = max(rest.held.state_kib for rest in rests)
    faults = [f"the state folder has {files} files of {size} kB"
              ] if files > MAX_STATE_FILES or size > MAX_STATE_KIB else []
    made.append(Verdict("state folder", f"{files} files, {size} kB",
                        f"{MAX_STATE_FILES} files, {MAX_STATE_KIB} kB", tuple(faults)))
    return made


def _differ(before: list[str], after: list[str]) -> list[str]:
    names = sorted(set(before) | set(after))
    return [f"{name} {after.count(name) - before.count(name):+d}" for name in names
            if after.count(name) != before.count(name)]


def _latency(seen: list[Seen], long: bool) -> list[Verdict]:
    made = []
    for name, key in (("ready to published", "daemon_ms"), ("ready to received", "client_ms")):
        medians = [statistics.median(getattr(s, key)) for s in seen if getattr(s, key)]
        if not medians:
            continue
        first, last = ends(medians)
        limit = MAX_LATENCY_RATIO * first + MAX_LATENCY_MS_MORE
        faults = [f"{name}: the median went from {first:.2f} to {last:.2f} ms"
                  ] if long and last > limit else []
        made.append(Verdict(f"latency, {name}, median at the beginning and the end",
                            f"{first:.2f}, {last:.2f} ms", f"{limit:.2f} ms", tuple(faults), long))
    return made


def _frames(record: Record) -> Verdict:
    empty = [s.episode.index for s in record.seen if s.frames == 0]
    faults = [f"no frame in episode {index}" for index in empty[:3]]
    return Verdict("frames", f"{sum(s.frames for s in record.seen)} taken by the honest client",
                   "some in every episode, in order of sequence and time", tuple(faults))


def _health(seen: list[Seen]) -> Verdict:
    faults = []
    reaching: frozenset[str] = frozenset()  # a late undo reaches into the next episode
    for s in seen:
        where = f"episode {s.episode.index} ({s.episode.kind})"
        may = s.episode.must | s.episode.may | plan.MACHINE | reaching
        reaching = s.episode.must | s.episode.may if s.late else frozenset()
        if not s.late:
            for name in sorted(s.episode.must - s.flags):
                faults.append(f"{where}: {name} was never reported")
            for name in sorted(s.episode.events - s.events):
                faults.append(f"{where}: no {name} event came")
        for name in sorted(s.flags - may):
            faults.append(f"{where}: {name} was reported without a reason")
        for name in sorted(s.left - plan.MACHINE - reaching):
            faults.append(f"{where}: {name} was left at its end")
    judged = sum(1 for s in seen if s.episode.must and not s.late)
    # The machine is so busy that the camera skips more than a second: the next episodes show it.
    unseen = sum(1 for s in seen if not s.cleared)
    if unseen > max(1, len(seen) // 10):
        faults.append(f"no frame came at the end of {unseen} episodes")
    late = sum(1 for s in seen if s.late)
    if late > max(1, len(seen) // 10):
        faults.append(f"the commands of {late} episodes came too late")
    return Verdict("health flags", f"{judged} scripted faults, {unseen} ends unseen, {late} late",
                   "each reported, and cleared", tuple(faults))


def _camera(record: Record) -> Verdict:
    """Checks frames_lost and camera_fault, which a busy machine raises as well: they are reported for every
    scripted fault and for nothing else. Compares times of the daemon only, so that it does
    not matter how late the frames were."""
    faults = []
    judged = unseen = 0
    trouble = _trouble(record.states)
    for s in record.seen:
        where = f"episode {s.episode.index} ({s.episode.kind})"
        for struck in s.struck:
            what = f"{where}, {struck.kind} of frames {struck.frame} to {struck.frame + struck.frames - 1}"
            if struck.came:
                faults.append(f"{what}: {struck.came} of them came")
            if struck.before is None or struck.after is None:
                unseen += 1
                continue
            span = (struck.before.taken, struck.after.published)
            if "camera_fault" in s.episode.must:
                judged += 1
                if not any(span[0] < at < span[1] and "camera_fault" in health
                           for at, health in record.states):
                    faults.append(f"{what}: camera_fault was not reported meanwhile")
            elif span[1] - span[0] < plan.LOST_NS:
                judged += 1
                if "frames_lost" not in struck.after.health:
                    faults.append(f"{what}: frame {struck.after.sequence} does not report frames_lost")
            else:
                unseen += 1
        if s.lost_unseen:
            faults.append(f"{where}: {s.lost_unseen} frames report frames_lost, and none was lost in the "
                          "second before")
        if any(begin < frame.taken and frame.published < end
               for frame in s.cleared for begin, end in trouble):
            faults.append(f"{where}: camera_fault went on while frames came")
    if unseen > max(1, len(record.seen) // 10):
        faults.append(f"no frame came soon before or after {unseen} faults of the camera")
    return Verdict("what the camera swallows", f"{judged} faults, {unseen} with no frame near",
                   "each reported while its frames are missing, nothing else", tuple(faults))


def _trouble(states: list[tuple[int, tuple[str, ...]]]) -> list[tuple[float, float]]:
    """Spans in which the daemon reported camera_fault."""
    ends = [float(at) for at, _ in states[1:]] + [math.inf]
    return [(at, end) for (at, health), end in zip(states, ends) if "camera_fault" in health]


def _depth(seen: list[Seen], long: bool) -> list[Verdict]:
    made = []
    for place, most in MAX_ERROR_MM.items():
        of = [(s, *d[1:]) for s in seen for d in s.depths if d[0] == place]
        if not of:
            made.append(Verdict(f"depth, {place}", "no frame", "one at least",
                                (f"no depth of {place} was judged",)))
            continue
        which = 2 if place == "no_contact" else 1
        errors = [d[which] for d in of]
        faults = [f"episode {s.episode.index} ({s.episode.kind}), {place}: {inside:.4f} mm wrong "
                  f"inside, {outside:.4f} outside, {100 * untrusted:.0f} % untrusted, and no health flag "
                  "was set"
                  for s, inside, outside, untrusted in of
                  if inside > most or outside > MAX_OUTSIDE_MM[place] or untrusted > MAX_UNTRUSTED]
        if len(faults) > 5:
            faults = faults[:5] + [f"and {len(faults) - 5} frames more of {place}"]
        first, last = ends(errors)
        if long and last - first > MAX_ERROR_MM_MORE:
            faults.append(f"depth of {place} drifted: {first:.4f} mm wrong, then {last:.4f}")
        made.append(Verdict(
            f"depth, {place}: mean absolute error, median and worst of {len(of)} frames",
            f"{statistics.median(errors):.4f}, {max(errors):.4f} mm", f"{most} mm", tuple(faults)))
    return made


def _answers(record: Record) -> Verdict:
    return Verdict("answers and clients", f"{record.answered} requests answered, {record.visits} visits",
                   "every request answered, nothing unexpected", tuple(record.faults[:10]))


def _log(text: str) -> Verdict:
    errors = [line for level in ("critical", "error") for line in log_lines(text, level)]
    return Verdict("log", f"{len(text.splitlines())} lines, {len(errors)} of level error", "no error",
                   tuple(f"the log says: {line}" for line in errors[:5]))


def _end(status: int) -> Verdict:
    return Verdict("SIGTERM", f"exit status {status}", "0",
                   () if status == 0 else (f"the daemon ended with status {status}",))
