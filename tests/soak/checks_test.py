"""A soak's checks on hand-made figures: every check finds its fault, and none finds
one in a healthy run."""
import pathlib
import sys
import unittest
from types import SimpleNamespace

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "clients/python/src")]
import checks  # noqa: E402
import plan  # noqa: E402
from daemon import Held, log_lines  # noqa: E402
from record import Record, Rest, Struck  # noqa: E402

HOUR = 3600
PERIOD = 16_666_667  # the camera's, ns
MS = 1_000_000


def held(**changes):
    return Held(**{"descriptors": 20, "threads": 6, "resident_kib": 50_000,
                   "anonymous_kib": 40_000, "heap_kib": 30_000, "kept_kib": 5_000, "cpu_s": 1.0,
                   "state_files": 4, "state_kib": 900, "log_kib": 3.0, **changes})


def healthy(kinds=("quiet", "unplug"), rests=20):
    """A run of two hours without a fault; the rests stand for its whole length."""
    return run_of([plan.Episode(i, kind) for i, kind in enumerate(kinds)],
                  [frame(n) for n in range(0, plan.EPISODE * len(kinds), 10)], rests)


def run_of(episodes, frames, rests=20):
    record = Record(episodes)
    record.seconds = 2 * HOUR
    names = ["socket:"] * 3 + ["/state"]
    record.rests = [Rest(i * 2 * HOUR / rests, i, held(), names, 0.5) for i in range(rests)]
    record.take("frames", frames)
    for seen in record.seen:
        for place in ("A", "B", "no_contact"):
            seen.depths.append((place, 0.02 if place != "no_contact" else 0.0, 0.002, 0.0))
    return record


def frame(sequence, health=(), late_ns=0):
    taken = sequence * PERIOD
    return (sequence, taken, taken, taken + 1_000_000, taken + 3_000_000 + late_ns, health)


def struck(kind, flag, *, came=(), reported=(), late_ns=0, states=()):
    """The camera swallows the frames 1000 to 1003; 1004 reports `reported`. `states`: since when, ns, and the
    health flags of the daemon's events."""
    episodes = [plan.Episode(0, "quiet"),
                plan.Episode(1, kind, [(kind, 1000, 4)], must=frozenset({flag}))]
    frames = [frame(n, reported if n == 1004 else ()) for n in range(2 * plan.EPISODE)
              if n not in range(1000, 1004) or n in came]
    late = [(n, taken, ready, published + late_ns, received + late_ns, health)
            for n, taken, ready, published, received, health in frames if n == 1004]
    record = run_of(episodes, [late[0] if f[0] == 1004 else f for f in frames])
    for at, health in states:
        record.event(at // PERIOD, "state", SimpleNamespace(monotonic_s=at / 1e9, health=health))
    return record


def faults(record):
    return [fault for verdict in checks.verdicts(record) for fault in verdict.faults]


class Checks(unittest.TestCase):
    def finds(self, record, *texts):
        found = faults(record)
        self.assertEqual(len(found), len(texts), found)
        for text, fault in zip(texts, found):
            self.assertIn(text, fault)

    def test_a_healthy_run_passes(self):
        self.finds(healthy())

    def test_descriptors_and_threads(self):
        record = healthy()
        record.rests[7].held = held(descriptors=21)
        record.rests[7].descriptors = record.rests[0].descriptors + ["anon_inode:[eventfd]"]
        self.finds(record, "went from 20 to 21 by episode 7: anon_inode:[eventfd] +1")
        record = healthy()
        record.rests[9].held = held(threads=5)
        self.finds(record, "threads at rest went from 6 to 5")

    def test_before_the_first_rests_nothing_counts(self):
        record = healthy()
        record.rests[0].held = held(descriptors=15, threads=3, resident_kib=20_000)
        self.finds(record)

    def test_a_slow_leak(self):
        record = healthy()  # 1 MB an hour, and single rests that are far off
        for i, rest in enumerate(record.rests):
            wild = 4000 if i % 6 == 5 else 0
            rest.held = held(resident_kib=50_000 + i * 102 + wild)
        self.finds(record, "grows by 1020 kB an hour")

    def test_a_leap(self):
        record = healthy()
        for rest in record.rests[10:]:
            rest.held = held(resident_kib=57_000)
        self.finds(record, "grew from 50000 to 57000 kB", "an hour")
        record.seconds = 300  # too short for the slope, and the leap stays
        self.finds(record, "grew from 50000 to 57000 kB")
        record.rests = record.rests[:3] + record.rests[-4:]
        self.finds(record)

    def test_a_long_run_has_a_round_to_warm_up(self):
        record = healthy(rests=2 * checks.LONG_WARM_UP_RESTS + 1)
        for i, rest in enumerate(record.rests[:checks.LONG_WARM_UP_RESTS]):
            rest.held = held(resident_kib=40_000 + 400 * i)
        self.finds(record)

    def test_varying_memory_is_no_leak(self):
        record = healthy()
        for i, rest in enumerate(record.rests):
            rest.held = held(resident_kib=50_000 + (0, 700, -300, 500)[i % 4])
        self.finds(record)

    def test_what_the_allocator_keeps_may_rise_to_its_end_and_no_further(self):
        record = healthy()
        for i, rest in enumerate(record.rests):
            rest.held = held(resident_kib=50_000 + 200 * i, kept_kib=5_000 + 200 * i)
        self.finds(record)
        for i, rest in enumerate(record.rests):
            rest.held = held(resident_kib=50_000 + 600 * i, kept_kib=5_000 + 600 * i)
        self.finds(record, "resident memory grew from")

    def test_a_leak_shows_before_the_resident_size_does(self):
        record = healthy()  # the allocator's free memory takes it up
        for i, rest in enumerate(record.rests):
            rest.held = held(heap_kib=30_000 + i * 20, kept_kib=5_000 - i * 20)
        self.finds(record, "memory in use grows by 200 kB an hour")
        for rest in record.rests[10:]:
            rest.held = held(heap_kib=31_200)
        self.finds(record, "memory in use grew from 30080 to 31200 kB", "an hour")

    def test_state_folder(self):
        record = healthy()
        record.rests[-1].held = held(state_files=61)
        self.finds(record, "61 files")

    def test_latency(self):
        record = healthy(["quiet"] * 10)
        for seen in record.seen[8:]:
            seen.client_ms = [9.0] * 100
        self.finds(record, "the median went from 3.00 to 9.00 ms")
        record.seconds = 60
        self.finds(record)

    def test_order_and_stamps(self):
        record = healthy()
        record.take("frames", [frame(5)])
        self.finds(record, "frame 5 taken")
        record = healthy()
        record.take("frames", [(2000, 40e9, 39e9, 41e9, 42e9, ())])
        self.finds(record, "was taken at")

    def test_no_frames(self):
        record = healthy()
        record.seen[1].frames = 0
        record.seen[1].cleared = []
        self.finds(record, "no frame in episode 1")
        record.seen[0].cleared = []
        self.finds(record, "no frame in episode 1", "no frame came at the end of 2 episodes")

    def test_health(self):
        record = healthy()
        record.seen[1].episode.must = frozenset({"image_repeated"})
        record.seen[1].episode.events = frozenset({"light"})
        self.finds(record, "image_repeated was never reported", "no light event came")
        record.seen[1].late = True
        self.finds(record)
        record.seen[0].late = True
        self.finds(record, "the commands of 2 episodes came too late")
        record.seen[0].late = False
        record.seen[0].flags.add("light_drifted")
        self.finds(record, "light_drifted was reported without a reason")
        record = healthy()
        record.seen[0].episode.may = frozenset({"reference_stale"})
        record.take("frames", [frame(plan.EPISODE * 2 - 1)])
        record.seen[0].left.add("reference_stale")
        self.finds(record, "reference_stale was left at its end")

    def test_what_a_late_command_does_reaches_into_the_next_episode_only(self):
        record = healthy(["light", "quiet", "quiet"] * 10)
        record.seen[0].episode.must = frozenset({"light_unsettled"})
        record.seen[0].flags = {"light_unsettled"}
        record.seen[0].left = record.seen[1].flags = {"light_unsettled"}
        self.finds(record, "left at its end", "reported without a reason")
        record.seen[0].late = True
        self.finds(record)
        record.seen[2].flags = {"light_unsettled"}
        self.finds(record, "episode 2 (quiet): light_unsettled was reported without a reason")

    def test_what_a_busy_machine_does_is_no_fault(self):
        record = healthy()
        record.seen[0].flags |= {"frames_lost", "not_realtime", "camera_slow"}
        self.finds(record)

    def test_lost_frames_are_reported_by_the_frame_behind_them(self):
        self.finds(struck("drop", "frames_lost", reported=("frames_lost",)))
        # Losses that the machine causes prove nothing.
        record = struck("drop", "frames_lost")
        record.seen[1].flags.add("frames_lost")
        self.finds(record, "frames 1000 to 1003: frame 1004 does not report frames_lost")
        # So late that the daemon need not report it any more.
        record = struck("drop", "frames_lost", late_ns=plan.LOST_NS)
        record.seen[1].flags.add("frames_lost")
        self.finds(record)
        self.finds(struck("drop", "frames_lost", reported=("frames_lost",), came=[1002]), "1 of them came")

    def test_lost_frames_are_reported_for_a_second(self):
        def steady(seconds):  # from frame 1000 on; before it ten are missing
            frames = [frame(n) for n in range(990)]
            for n in range(1000, 2 * plan.EPISODE):
                reported = n * PERIOD - frame(1000)[3] < seconds * 1e9
                frames.append(frame(n, ("frames_lost",) if reported else ()))
            return run_of([plan.Episode(i, "quiet") for i in range(2)], frames)

        self.finds(steady(1))
        self.finds(steady(1.1), "episode 1 (quiet): 6 frames report frames_lost, and none was lost")

    def test_camera_trouble_is_reported_while_the_camera_is_away(self):
        def stall(*states):
            return struck("stall", "camera_fault", states=[(0, ()), *states])

        trouble = ("camera_fault",)
        away, back = (1002 * PERIOD, trouble), (1004 * PERIOD + 1, ())
        self.finds(stall(away, back))
        self.finds(stall(), "camera_fault was never reported", "camera_fault was not reported meanwhile")
        # A busy machine raises it at any time.
        self.finds(stall((970 * PERIOD, trouble), (971 * PERIOD + 1, ())), "not reported meanwhile")
        # Frames end it; those of the episode's last seconds are checked.
        self.finds(stall(away), "camera_fault went on while frames came")
        last = 2 * plan.EPISODE - 30
        begins = (last * PERIOD + 2 * MS, trouble)
        self.finds(stall(away, back, begins, ((last + 1) * PERIOD + 1, ())))
        self.finds(stall(away, back, begins, ((last + 2) * PERIOD, ())),
                   "camera_fault went on while frames came")

    def test_no_frame_near_the_cameras_faults(self):
        record = struck("drop", "frames_lost", reported=("frames_lost",))
        record.seen[1].struck = [Struck("drop", 1000, 4)] * 2
        self.finds(record, "no frame came soon before or after 2 faults")

    def test_depth(self):
        record = healthy()
        record.take("depth", 240, (), "A", 0.051, 0.002, 0.0, 0.02)
        self.finds(record, "A: 0.0510 mm wrong inside")
        record = healthy()
        record.take("depth", 240, ("reference_stale",), "A", 0.5, 0.002, 0.0, 0.02)
        self.finds(record)
        self.assertEqual(record.seen[0].reported, 1)
        record = healthy(["quiet"] * 10)
        for seen in record.seen[8:]:
            seen.depths = [("A", 0.026, 0.002, 0.0)] + seen.depths[1:]
        self.finds(record, "depth of A drifted: 0.0200 mm wrong, then 0.0260")
        record = healthy()
        for seen in record.seen:
            seen.depths = seen.depths[:2]
        self.finds(record, "no depth of no_contact was judged")

    def test_clients_log_and_end(self):
        record = healthy()
        record.take("fault", "visitor 3: TimeoutError")
        record.log = "[2026-01-01 00:00:00.000] [dtactd] [error] the disk is full\n"
        record.ended = 139
        self.finds(record, "visitor 3", "the disk is full", "status 139")

    def test_broken_off(self):
        record = healthy(rests=1)
        self.finds(record, "never came to rest")


class Slope(unittest.TestCase):
    def test_is_the_median_of_all_pairs(self):
        # Slopes 1, 1, 1, and to the outlier 8, 4.5 and 10 / 3.
        self.assertAlmostEqual(checks.slope([(0, 0.0), (1, 1.0), (2, 2.0), (3, 10.0)]), 13 / 6)
        self.assertEqual(checks.slope([(float(i), 2.0 * i) for i in range(9)] + [(9.0, 900.0)]), 2.0)
        self.assertEqual(checks.slope([(1.0, 5.0)]), 0.0)


class Plan(unittest.TestCase):
    def test_one_seed_makes_one_run(self):
        for seed in (1, 2):
            a, b = plan.episodes(seed, 50), plan.episodes(seed, 50)
            self.assertEqual(a, b)
            self.assertEqual(plan.scene(seed, a), plan.scene(seed, b))
        self.assertNotEqual(plan.episodes(1, 50), plan.episodes(2, 50))

    def test_every_kind_comes_in_every_round(self):
        kinds = [episode.kind for episode in plan.episodes(3, 1 + 2 * len(plan.KINDS))]
        self.assertEqual(kinds[0], "quiet")
        for a in (1, 1 + len(plan.KINDS)):
            self.assertEqual(sorted(kinds[a:a + len(plan.KINDS)]), sorted(plan.KINDS))

    def test_every_command_has_its_time(self):
        for episode in plan.episodes(4, 1 + len(plan.KINDS)):
            times = [time for step in episode.steps for time in (step.sequence, step.latest)]
            if len(episode.steps) == 2:  # the change must be visible until it is undone
                self.assertLess(episode.steps[0].sequence, episode.steps[1].sequence)
            for step in episode.steps:
                self.assertLess(step.sequence, step.latest)
            self.assertLessEqual(max(times, default=0), episode.at(plan.REST))

    def test_places(self):
        episode = plan.Episode(2, "quiet")  # from frame 1920 on
        self.assertEqual([episode.place(1920 + round(60 * s)) for s in
                          (0.0, 2.0, 3.1, 4.0, 4.9, 9.0, 15.0)],
                         [None, "no_contact", None, "A", None, "B", "no_contact"])
        episode.blind = (1920 + 230, 1920 + 250)
        self.assertIsNone(episode.place(1920 + 240))

    def test_the_scene(self):
        made = plan.Episode(1, "unplug", faults=[("unplug", 990, 30)])
        text, words = plan.scene(1, [made])
        self.assertIn('[[fault]]\nkind = "unplug"\nframe = 990\nframes = 30\n', text)
        self.assertRegex(words["A"], r"^ball \d\.\d\d mm deep$")


class Log(unittest.TestCase):
    def test_levels(self):
        text = ("[2026-11-22 15:00:00.000] [dtactd] [info] listening\n"
                "[2026-11-22 15:00:01.000] [dtactd] [error] broke [error]\n"
                "[2026-11-22 15:00:02.000] [dtactd] [warning] [error] is in the text only\n")
        self.assertEqual(log_lines(text, "error"), ["broke [error]"])
        self.assertEqual(log_lines(text, "warning"), ["[error] is in the text only"])


if __name__ == "__main__":
    unittest.main()
