"""The client that waits, against a daemon that does as a test says."""
import errno
import itertools
import os
import pathlib
import socket
import sys
import tempfile
import threading
import time
import types
import unittest
from unittest import mock

import numpy as np

import dtact
from fake_daemon import FakeDaemon, event, frame, silent_first


def refuse(code, sentence):
    def answer(request, reply):
        reply.error.code = code
        reply.error.message = sentence
    return answer


class Connecting(unittest.TestCase):
    def test_says_hello_and_who_answered(self):
        with FakeDaemon(features=["jpeg", "reference"]) as daemon:
            with dtact.connect(daemon.address, program="test", token="secret") as s:
                self.assertEqual(s.server.program, "fake")
                self.assertEqual(s.server.features, {"jpeg", "reference"})
                self.assertTrue(s.same_machine)
            hello = daemon.requests[0].hello
            self.assertEqual((hello.major, hello.minor, hello.program, hello.token),
                             (1, 1, "test", "secret"))

    def test_over_a_unix_socket(self):
        with tempfile.TemporaryDirectory() as folder, FakeDaemon(path=f"{folder}/socket") as daemon:
            with dtact.connect(daemon.address, token="secret") as s:
                self.assertTrue(s.same_machine)
                status = s.status()
                self.assertEqual((status.state, status.fixes, status.board_celsius),
                                 ("serving", {"light_mismatch": "Set the light back."}, 48.5))

    def test_a_daemon_whose_machine_is_gone_is_noticed(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            sock = s._link._socket
            self.assertTrue(sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE))
            wait, every, times = (sock.getsockopt(socket.IPPROTO_TCP, option) for option in
                                  (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT))
            self.assertEqual(wait + every * times, 30)

    def test_to_nobody(self):
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
        with self.assertRaisesRegex(dtact.ConnectionError, f"nothing listens on 127.0.0.1 port {port}"):
            dtact.connect(f"127.0.0.1:{port}")
        with self.assertRaisesRegex(dtact.ConnectionError, "nothing listens on /nowhere"):
            dtact.connect("unix:/nowhere")
        with self.assertRaises(dtact.ConnectionError):
            dtact.connect("no.such.host.invalid")

    def test_to_one_who_says_nothing(self):
        with socket.create_server(("127.0.0.1", 0)) as server:
            began = time.monotonic()
            with self.assertRaisesRegex(dtact.TimeoutError, "no answer in time"):
                dtact.connect("127.0.0.1:%d" % server.getsockname()[1], timeout=0.2)
            self.assertLess(time.monotonic() - began, 5)

    def test_to_another_version_and_without_rights(self):
        with FakeDaemon() as daemon:
            daemon.answers["hello"] = refuse(3, "this daemon speaks version 2")
            with self.assertRaisesRegex(dtact.ProtocolError, "version 2"):
                dtact.connect(daemon.address)
            daemon.answers["hello"] = refuse(11, "no such token")
            with self.assertRaisesRegex(dtact.Denied, "no such token"):
                dtact.connect(daemon.address)

    def test_token_from_a_file(self):
        with tempfile.NamedTemporaryFile("w") as file, FakeDaemon() as daemon:
            file.write("of-the-file\nelse")
            file.flush()
            dtact.connect(daemon.address, token_file=file.name).close()
            self.assertEqual(daemon.requests[0].hello.token, "of-the-file")
            self.assertRaises(ValueError, dtact.connect, token="a", token_file="b")

    def test_a_line_of_the_daemons_list_is_no_token(self):
        with tempfile.NamedTemporaryFile("w") as file:
            file.write("control sha256:" + 64 * "a" + " gripper\n")
            file.flush()
            with self.assertRaisesRegex(dtact.Error, "dtactctl token -o"):
                dtact.connect(token_file=file.name)

    def test_no_token_to_unauthenticated(self):
        with FakeDaemon() as daemon, mock.patch("dtact.transport.is_local", return_value=False):
            with self.assertRaisesRegex(dtact.IdentityError, "fingerprint"):
                dtact.connect(daemon.address, token="secret")
            self.assertEqual(daemon.requests, [])
            dtact.connect(daemon.address, token="secret", insecure=True).close()
            self.assertEqual(daemon.requests[0].hello.token, "secret")

    def test_token_that_systemd_hands_in(self):
        with tempfile.TemporaryDirectory() as folder, FakeDaemon() as daemon:
            file = pathlib.Path(folder, "token")
            file.write_text("handed-in")
            file.chmod(0o640)
            if file.stat().st_gid != 0:
                self.skipTest("only root has files of root's group")
            with mock.patch.dict("os.environ", CREDENTIALS_DIRECTORY=folder):
                dtact.connect(daemon.address, token_file=file).close()
                self.assertEqual(daemon.requests[0].hello.token, "handed-in")
                file.chmod(0o644)
                with self.assertRaisesRegex(dtact.Error, "chmod 600"):
                    dtact.connect(daemon.address, token_file=file)

    def test_token_files_that_will_not_do(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "token")
            file.write_text("secret")
            file.chmod(0o640)
            with self.assertRaisesRegex(dtact.Error, "chmod 600"):
                dtact.connect(token_file=file)
            file.chmod(0o600)
            for text in ("", "\nx", "x" * 257):
                file.write_text(text)
                with self.assertRaisesRegex(dtact.Error, "1 to 256 bytes"):
                    dtact.connect(token_file=file)
        with self.assertRaisesRegex(dtact.Error, "cannot read a token"):
            dtact.connect(token_file=file)


class Frames(unittest.TestCase):
    def test_come_as_arrays(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, kept_frames=2) as s:
            daemon.pushed = [frame(1), event(3), frame(2)]
            f, g = itertools.islice(s.frames(), 2)
            self.assertEqual((f.sequence, g.sequence), (1, 2))
            np.testing.assert_array_equal(f.depth_mm,
                                          np.array([[0, 1], [np.nan, 0.025]], np.float32))
            self.assertEqual(daemon.requests[1].subscribe.depth, 1)
            self.assertEqual(next(s.events()).light.brightness, 3)
            self.assertEqual(list(s.events(timeout=0.05)), [])

    def test_a_slow_reader_gets_the_newest(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            daemon.pushed = [frame(1)]
            frames = s.frames()
            next(frames)
            for newest in (40, 80):
                daemon.push(*(frame(n) for n in range(newest - 38, newest + 1)))
                time.sleep(0.2)
                self.assertEqual(next(frames).sequence, newest)

    def test_a_queue_keeps_as_many_as_asked_for(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, kept_frames=2) as s:
            daemon.pushed = [frame(n) for n in range(1, 21)]
            frames = s.frames()
            next(frames)
            daemon.push(*(frame(n) for n in range(21, 41)))
            time.sleep(0.2)
            self.assertEqual([next(frames).sequence for _ in range(2)], [39, 40])

    def test_none_in_time(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            with self.assertRaisesRegex(dtact.NoFrame, "no frame came within 0.05 s; the daemon's "
                                        "state is serving. All is well."):
                next(s.frames(timeout=0.05))
            daemon.push(frame(9))
            self.assertEqual(s.next(5).sequence, 9)
            self.assertIsNone(s.next(0))

    def test_a_request_between_frames_loses_none(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, kept_frames=4) as s:
            def with_frames(request, reply):
                daemon.push(frame(2), event(1), frame(3))
                reply.light.brightness = 5
            daemon.answers["set_light"] = with_frames
            daemon.pushed = [frame(1)]
            frames = s.frames()
            self.assertEqual(next(frames).sequence, 1)
            self.assertEqual(s.set_light(brightness=5).brightness, 5)
            self.assertEqual([next(frames).sequence for _ in range(2)], [2, 3])

    def test_a_damaged_map_is_a_protocol_error(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            broken = frame(1)
            broken.frame.depth.data = b"x"
            daemon.pushed = [broken]
            with self.assertRaises(dtact.ProtocolError):
                next(s.frames()).depth_mm


class Addresses(unittest.TestCase):
    def test_a_silent_address_does_not_delay_the_next_one(self):
        with FakeDaemon() as daemon, silent_first(daemon.address) as host:
            began = time.monotonic()
            with dtact.connect(host, timeout=30) as s:
                self.assertEqual(s.status().state, "serving")
            self.assertTrue(0.25 <= time.monotonic() - began < 10, time.monotonic() - began)

    def test_what_an_address_answers_is_named_when_the_others_are_silent(self):
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
        with silent_first(f"127.0.0.1:{port}") as host:
            with self.assertRaisesRegex(dtact.ConnectionError, "nothing listens on silent-first"):
                dtact.connect(host, timeout=0.6)

    def test_nobody_answers(self):
        with FakeDaemon() as daemon, silent_first(daemon.address) as host:
            with self.assertRaisesRegex(dtact.ConnectionError, "does not answer"):
                dtact.connect(host, timeout=0.1)


class Sharing(unittest.TestCase):
    def test_a_second_thread_is_named_and_the_first_goes_on(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, timeout=30) as s:
            seen = []
            s.subscribe()
            waiting = threading.Thread(target=lambda: seen.append(next(s.frames())), name="reader")
            waiting.start()
            until = time.monotonic() + 10
            while not s._in_use.locked() and time.monotonic() < until:
                time.sleep(0.01)
            for call in (s.status, lambda: next(s.frames()), s.close):
                with self.assertRaisesRegex(dtact.SharedClient, "thread reader is in a call"):
                    call()
            daemon.push(frame(6))
            waiting.join(10)
            self.assertEqual(seen[0].sequence, 6)
            self.assertEqual(s.status().state, "serving")

    def test_a_forked_process_is_named_and_the_first_goes_on(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            child = os.fork()
            if child == 0:
                said = ""
                try:
                    s.status()
                except dtact.SharedClient as e:
                    said = str(e)
                s.close()
                os._exit(0 if f"process {os.getppid()} made this client" in said else 1)
            self.assertEqual(os.waitpid(child, 0)[1], 0)
            self.assertEqual(s.status().state, "serving")
            self.assertEqual(daemon.connections, 1)


class Requests(unittest.TestCase):
    def test_refusals_have_types_and_the_daemons_sentence(self):
        kinds = {4: dtact.Invalid, 5: dtact.InContact, 6: dtact.DeviceFailed, 7: dtact.Busy,
                 8: dtact.Uncalibrated, 9: dtact.StorageFailed, 10: dtact.Unsupported,
                 11: dtact.Denied, 99: dtact.Refused}
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            for code, kind in kinds.items():
                daemon.answers["rezero"] = refuse(code, f"because of {code}")
                with self.assertRaises(dtact.Refused) as caught:
                    s.rezero()
                self.assertIs(type(caught.exception), kind)
                self.assertEqual((str(caught.exception), caught.exception.code),
                                 (f"because of {code}", code))
            self.assertEqual(s.status().state, "serving")

    def test_set_light(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            s.set_light(brightness=0, scheme="all", leds=[(1, 2, 3)] * 8)
            sent = daemon.requests[-1].set_light
            self.assertTrue(sent.HasField("brightness"))
            self.assertEqual((sent.scheme, len(sent.leds), sent.leds[7].b), ("all", 8, 3))
            s.set_light(leds=[(1, 2, 3)] * 8)
            self.assertFalse(daemon.requests[-1].set_light.HasField("brightness"))

    def test_calibrations(self):
        def files(request, reply):
            reply.calibration.name = "c"
            reply.calibration.calibration_toml = b"t"
            reply.calibration.reference_png = b"p"

        def listed(request, reply):
            reply.calibrations.calibrations.add(number=0, name="a", damage="d")
            one = reply.calibrations.calibrations.add(number=4, name="b", current=True, in_use=True)
            one.summary.width = 580

        def uploaded(request, reply):
            reply.done.calibration = 5

        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s, \
                tempfile.TemporaryDirectory() as folder:
            daemon.answers = {"get_calibration": files, "list_calibrations": listed,
                              "upload_calibration": uploaded}
            got = s.calibration()
            self.assertEqual(got, dtact.CalibrationFiles("c", b"t", b"p", None))
            first, second = s.calibrations()
            self.assertEqual((first.damage, first.summary, first.in_use), ("d", None, False))
            self.assertEqual((second.summary.width, second.in_use), (580, True))
            got.write(f"{folder}/mine")
            self.assertEqual(s.upload_calibration(dtact.CalibrationFiles.read(f"{folder}/mine")), 5)
            self.assertEqual(daemon.requests[-1].upload_calibration.name, "mine")
            s.activate_calibration(0)
            self.assertTrue(daemon.requests[-1].activate_calibration.HasField("number"))

    def test_a_large_upload_has_the_time_that_a_slow_network_needs(self):
        def late(request, reply):
            time.sleep(0.5)
            reply.done.calibration = 5

        with FakeDaemon() as daemon, dtact.connect(daemon.address, timeout=0.2) as s, \
                mock.patch("dtact.session._SLOW_S", 0.2):
            daemon.answers = {"upload_calibration": late}
            files = dtact.CalibrationFiles("c", b"t", bytes(5_000_000))
            self.assertEqual(s.upload_calibration(files), 5)

    def test_a_calibration_that_cannot_be_written_leaves_the_one_before(self):
        with tempfile.TemporaryDirectory() as folder:
            before = dtact.CalibrationFiles(pathlib.Path(folder).name, b"t", b"p")
            before.write(folder)
            full = OSError(errno.ENOSPC, "No space left on device")
            with mock.patch("os.fsync", side_effect=[None, full]), self.assertRaises(OSError):
                dtact.CalibrationFiles("c", b"other", b"other").write(folder)
            self.assertEqual(dtact.CalibrationFiles.read(folder), before)
            self.assertEqual(sorted(os.listdir(folder)), ["calibration.toml", "reference.png"])
            dtact.CalibrationFiles("c", b"new t", b"new p").write(folder)
            read = dtact.CalibrationFiles.read(folder)
            self.assertEqual((read.calibration_toml, read.reference_png), (b"new t", b"new p"))
            self.assertEqual(sorted(os.listdir(folder)), ["calibration.toml", "reference.png"])

    def test_every_part_of_a_subscription_is_sent(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            s.subscribe(dtact.Subscription(
                depth="predict_zstd", jpeg=True, summary=True, depth_hz=30, luma_hz=1, jpeg_hz=2,
                summary_hz=60, decimation=4, um_per_unit=5, region=(1, 2, 3, 4), events=False))
            m = daemon.requests[-1].subscribe
            self.assertEqual((m.depth, m.jpeg, m.summary, m.depth_hz, m.luma_hz, m.jpeg_hz,
                              m.summary_hz, m.decimation, m.um_per_unit, m.events),
                             (2, True, True, 30, 1, 2, 60, 4, 5, False))
            self.assertEqual((m.box.x, m.box.y, m.box.width, m.box.height), (1, 2, 3, 4))
            self.assertTrue(m.HasField("events"))
            s.subscribe(dtact.Subscription(region="contact"))
            m = daemon.requests[-1].subscribe
            self.assertTrue(m.contact_box)
            self.assertEqual(m.depth, 1)
            self.assertFalse(m.HasField("events"))
            s.subscribe(None)
            self.assertEqual(daemon.requests[-1].subscribe.ByteSize(), 0)

    def test_ping(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            pong = s.ping()
            self.assertEqual((pong.monotonic_s, pong.time.timestamp()), (7.0, 1.0))
            self.assertGreater(pong.round_trip_s, 0)

    def test_no_answer_in_time_leaves_the_connection(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, timeout=0.2) as s:
            daemon.answers["rezero"] = False
            self.assertRaises(dtact.TimeoutError, s.rezero)
            self.assertEqual(s.status().state, "serving")

    def test_a_rezero_may_take_as_long_as_the_daemon_says(self):
        def hello(request, reply):
            reply.hello.major, reply.hello.rezero_timeout_s = 1, 60

        def late(request, reply):
            time.sleep(0.5)
            refuse(5, "the picture is not still")(request, reply)

        with FakeDaemon() as daemon:
            daemon.answers |= {"hello": hello, "rezero": late}
            with dtact.connect(daemon.address, timeout=0.2) as s:
                with self.assertRaisesRegex(dtact.Refused, "not still"):
                    s.rezero()


class Spaces(unittest.TestCase):
    def test_box(self):
        gymnasium = types.ModuleType("gymnasium")
        gymnasium.spaces = types.ModuleType("gymnasium.spaces")
        gymnasium.spaces.Box = lambda **settings: settings
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            with mock.patch.dict(sys.modules, {"gymnasium": gymnasium,
                                               "gymnasium.spaces": gymnasium.spaces}):
                daemon.pushed = [frame(1, values=(0,) * 6, width=3)]
                self.assertEqual(s.observation_space, {
                    "low": np.float32(-32.768), "high": np.float32(32.767), "shape": (2, 3),
                    "dtype": np.float32})
            with mock.patch.dict(sys.modules, {"gymnasium": None}):
                daemon.push(frame(2))
                with self.assertRaisesRegex(ImportError, "pip install gymnasium"):
                    s.observation_space


if __name__ == "__main__":
    unittest.main()
