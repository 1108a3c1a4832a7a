#!/usr/bin/env python3
"""gateway_test.py: dtact-web in front of two daemons on the simulated sensor, one of them calibrated."""
import json
import os
import pathlib
import signal
import socket
import ssl
import subprocess
import tempfile
import time
import unittest

from programs import Daemon, Gateway, calibrate, write_tokens
from viewer import Client, E, M, Viewer, length
from web_socket import BINARY, TIMEOUT, TEXT, Closed, Refused, WebSocket, connect, request

FOLDER = tempfile.TemporaryDirectory(prefix="dtact_web_")
HERE = pathlib.Path(FOLDER.name)
EVERYTHING = dict(depth=E.DEPTH_INT16, luma=E.LUMA_GREY8, summary=True)
VIEW, CONTROL = "a-token-to-look-on", "a-token-to-command"
CALIBRATE = "a-token-to-calibrate"
left: Daemon
right: Daemon
gateway: Gateway


def setUpModule() -> None:
    global left, right, gateway
    # dtact-web starts it.
    os.environ["PATH"] = f"{os.path.dirname(os.environ['CALIBRATE'])}:{os.environ['PATH']}"
    (HERE / "page").mkdir()
    (HERE / "page/index.html").write_text("<!doctype html><title>The page</title>")
    (HERE / "page/a.js").write_text("export const a = 1;\n")
    left = Daemon(HERE, "left", f"calibration={calibrate(HERE)}")
    right = Daemon(HERE, "right")
    gateway = Gateway(HERE, "--daemon", f"left=127.0.0.1:{left.port}", "--daemon",
                      f"right=127.0.0.1:{right.port}", "--page", str(HERE / "page"))
    # Both daemons run before the first request.
    for name in ("left", "right"):
        with Viewer(gateway.port, name) as viewer:
            viewer.notice(lambda reported: reported["connected"])
    # Depth comes once the reference is taken.
    with Client(left.port) as client:
        client.call(subscribe=M.Subscribe(**EVERYTHING))
        client.frame(lambda frame: frame.HasField("depth"))


def tearDownModule() -> None:
    ended = [program.stop() for program in (gateway, left, right)]
    FOLDER.cleanup()
    assert ended == [0, 0, 0], ended


class Frames(unittest.TestCase):
    def test_a_frame_is_the_daemons_own(self) -> None:
        with Viewer(gateway.port) as viewer, Client(left.port) as client:
            for one in (viewer, client):
                one.call(subscribe=M.Subscribe(**EVERYTHING))
            theirs = {}
            for _ in range(40):
                frame = client.frame()
                theirs[frame.sequence] = frame
            same = viewer.frame(lambda frame: frame.sequence in theirs)
            other = theirs[same.sequence]
            self.assertEqual((same.depth.width, same.depth.height), (570, 582))
            for frame in (same, other):
                # Fields of each connection, and the time that encoding took.
                frame.ClearField("dropped")
                frame.ClearField("times")
            self.assertEqual(same.SerializeToString(deterministic=True),
                             other.SerializeToString(deterministic=True))

    def test_equal_subscriptions_are_one_client_of_the_daemon(self) -> None:
        with Viewer(gateway.port) as one, Viewer(gateway.port) as two, Viewer(gateway.port) as third:
            for viewer in (one, two):
                viewer.call(subscribe=M.Subscribe(depth=E.DEPTH_PREDICT_ZSTD, depth_hz=20))
            third.call(subscribe=M.Subscribe(summary=True))
            for viewer in (one, two, third):
                viewer.frame()
            programs = [client.program for client in one.call(get_status=M.GetStatus()).status.clients]
            self.assertEqual(len([p for p in programs if p.startswith("dtact-web")]), 3,
                             "one that asks and one for each of two streams")

    def test_a_new_subscription_takes_the_place_of_the_old(self) -> None:
        with Viewer(gateway.port) as viewer:
            viewer.call(subscribe=M.Subscribe(luma=E.LUMA_GREY8))
            viewer.frame(lambda frame: frame.HasField("luma"))
            viewer.call(subscribe=M.Subscribe(summary=True))
            viewer.frames.clear()
            for _ in range(5):
                self.assertFalse(viewer.frame().HasField("luma"))
            viewer.call(subscribe=M.Subscribe())
            viewer.frames.clear()
            viewer.call(ping=M.Ping())
            self.assertEqual(len(viewer.frames), 0)

    def test_what_the_daemon_refuses_is_refused_in_its_words(self) -> None:
        with Viewer(gateway.port) as viewer:
            error = viewer.refused(subscribe=M.Subscribe(summary=True, decimation=3))
            self.assertEqual(error.code, E.ERROR_INVALID)
            self.assertIn("subscribe.decimation: 3", error.message)
            error = viewer.refused(subscribe=M.Subscribe(pose=True))
            self.assertEqual(error.code, E.ERROR_UNSUPPORTED)

    def test_two_sensors_are_two(self) -> None:
        with Viewer(gateway.port, "left") as viewer, Viewer(gateway.port, "right") as other:
            self.assertEqual((viewer.hello.name, other.hello.name), ("left", "right"))
            other.call(subscribe=M.Subscribe(**EVERYTHING))
            frame = other.frame(lambda frame: frame.HasField("luma"))
            self.assertFalse(frame.HasField("depth"), "it has no calibration")

    def test_different_streams_are_bounded(self) -> None:
        with Viewer(gateway.port, "right") as viewer:
            viewers = [Viewer(gateway.port, "right") for _ in range(5)]
            for rate, one in enumerate(viewers):
                one.call(subscribe=M.Subscribe(summary=True, summary_hz=rate + 1))
            error = viewer.refused(subscribe=M.Subscribe(summary=True))
            self.assertEqual(error.code, E.ERROR_BUSY)
            self.assertIn("this machine has 5 different subscriptions", error.message)
            viewer.call(subscribe=M.Subscribe(summary=True, summary_hz=1))
            # The stream that it leaves makes room for the new one.
            viewers[4].call(subscribe=M.Subscribe(summary=True, summary_hz=9))
            for one in viewers:
                one.link.close()

    def test_one_who_does_not_read_holds_nobody(self) -> None:
        with Viewer(gateway.port, receive_buffer=65536) as slow, Viewer(gateway.port) as viewer:
            for one in (slow, viewer):
                one.call(subscribe=M.Subscribe(**EVERYTHING))
            sequences = [viewer.frame().sequence for _ in range(100)]
            self.assertEqual(sequences, sorted(sequences))
            newest = slow.frame(lambda frame: frame.sequence > sequences[-1])
            self.assertGreater(newest.dropped, 30)


class Requests(unittest.TestCase):
    def test_light_is_passed_on_and_all_are_reported(self) -> None:
        with Viewer(gateway.port) as viewer, Viewer(gateway.port) as other:
            reply = viewer.call(set_light=M.SetLight(brightness=97))
            self.assertEqual(reply.light.brightness, 97)
            for one in (viewer, other):
                one.until(lambda one=one: any(event.light.brightness == 97 for event in one.events),
                          "the light's event")
            viewer.call(set_light=M.SetLight(brightness=255))

    def test_answers_find_who_asked(self) -> None:
        with Viewer(gateway.port) as viewer, Viewer(gateway.port, "right") as other:
            numbers = [viewer.ask(ping=M.Ping()) for _ in range(20)]
            others = [other.ask(get_status=M.GetStatus()) for _ in range(3)]
            self.assertTrue(all(viewer.answer(n).pong.monotonic_ns > 0 for n in numbers))
            self.assertTrue(all(other.answer(n).status.name == "right" for n in others))

    def test_the_daemons_errors(self) -> None:
        with Viewer(gateway.port, "right") as viewer:
            error = viewer.refused(get_calibration=M.GetCalibration())
            self.assertEqual(error.code, E.ERROR_UNCALIBRATED)


class Rights(unittest.TestCase):
    gate: Gateway

    @classmethod
    def setUpClass(cls) -> None:
        tokens = HERE / "tokens"
        write_tokens(tokens, f"view {VIEW} eyes", f"control {CONTROL} hands", f"calibrate {CALIBRATE} bench")
        cls.gate = Gateway(HERE, "--daemon", f"left=127.0.0.1:{left.port}", "--daemon",
                           "gone=127.0.0.1:1", "--tokens", str(tokens))

    @classmethod
    def tearDownClass(cls) -> None:
        assert cls.gate.stop() == 0

    def test_view_rights(self) -> None:
        with Viewer(self.gate.port, token=VIEW) as viewer:
            self.assertEqual(viewer.hello.rights, E.RIGHTS_VIEW)
            error = viewer.refused(set_light=M.SetLight(brightness=3))
            self.assertEqual(error.code, E.ERROR_DENIED)
            viewer.call(get_status=M.GetStatus())

    def test_control_rights(self) -> None:
        with Viewer(self.gate.port, token=CONTROL) as viewer:
            self.assertEqual(viewer.hello.rights, E.RIGHTS_CONTROL)
            viewer.notice(lambda reported: reported["connected"])
            viewer.call(set_light=M.SetLight(brightness=254))
            error = viewer.refused(activate_calibration=M.ActivateCalibration(number=0))
            self.assertEqual(error.code, E.ERROR_DENIED)
            viewer.call(set_light=M.SetLight(brightness=255))
        self.assertRegex(left.text(), r"127\.0\.0\.1:\d+ \(dtact-web [^)]*\) on behalf of "
                                      r"127\.0\.0\.1:\d+ \(test, token hands\): "
                                      r"set_light brightness 254: done\n")
        self.assertRegex(self.gate.text(), r"\(test, token hands\): activate_calibration 0: this client "
                                           r"may not change calibrations")

    def test_calibrate_rights(self) -> None:
        with Viewer(self.gate.port, token=CALIBRATE) as viewer:
            self.assertEqual(viewer.hello.rights, E.RIGHTS_CALIBRATE)
            viewer.notice(lambda reported: reported["connected"])
            viewer.call(activate_calibration=M.ActivateCalibration(number=0))

    def test_the_fleet_needs_a_token(self) -> None:
        self.assertEqual(request(self.gate.port, "/fleet")[0], 401)
        status, _, body = request(self.gate.port, f"/fleet?token={VIEW}")
        self.assertEqual(status, 200)
        gone = json.loads(body)[1]
        self.assertEqual((gone["name"], gone["connected"], "status" in gone), ("gone", False, False))

    def test_a_guided_calibration_needs_them(self) -> None:
        for token, expected in ((CONTROL, "may not calibrate"), (CALIBRATE, "GuidedStart")):
            with WebSocket(self.gate.port, f"/sensors/left/calibrate?token={token}") as page:
                page.send(b"no start" if token == CALIBRATE else b"{}", TEXT)
                self.assertIn(expected, page.receive()[1].decode())

    def test_a_reload_ends_whose_token_is_gone(self) -> None:
        tokens = HERE / "tokens-to-revoke"
        write_tokens(tokens, f"view {VIEW}", f"control {CONTROL} hands")
        gate = Gateway(HERE, "--daemon", f"left=127.0.0.1:{left.port}", "--tokens", str(tokens))
        protocol = "foxglove.sdk.v1"
        with Viewer(gate.port, token=VIEW) as stays, Viewer(gate.port, token=CONTROL) as goes, \
                WebSocket(gate.port, f"/foxglove?token={CONTROL}", Sec_WebSocket_Protocol=protocol) as foxglove:
            write_tokens(tokens, f"view {VIEW}")
            assert gate.process is not None
            gate.process.send_signal(signal.SIGHUP)
            error = goes.answer(0).error
            self.assertEqual(error.code, E.ERROR_DENIED)
            self.assertIn("revoked", error.message)
            for ended in (goes.socket, foxglove):
                with self.assertRaises((Closed, ConnectionError)):
                    while True:
                        ended.receive()
            stays.call(ping=M.Ping())
            self.assertIn("certificate, key and tokens read again", gate.text())
            # A file with a mistake changes nothing.
            tokens.write_text("view short\n")
            gate.process.send_signal(signal.SIGHUP)
            until = time.monotonic() + TIMEOUT
            while "everything stays as it was: " not in gate.text():
                self.assertLess(time.monotonic(), until)
                time.sleep(0.05)
            stays.call(ping=M.Ping())
        self.assertEqual(gate.stop(), 0)

    def test_beyond_this_machine_anonymous_viewers_only_view(self) -> None:
        beyond = ["--daemon", f"left=127.0.0.1:{left.port}", "--listen", "0.0.0.0", "--listen-insecure"]
        for more, rights in (([], E.RIGHTS_VIEW), (["--anonymous-rights", "control"], E.RIGHTS_CONTROL)):
            gate = Gateway(HERE, *beyond, *more)
            with Viewer(gate.port) as viewer:
                self.assertEqual(viewer.hello.rights, rights)
            self.assertEqual(gate.stop(), 0)
        with Viewer(gateway.port) as viewer:
            self.assertEqual(viewer.hello.rights, E.RIGHTS_CALIBRATE)

    def test_viewers_leave_room_for_commands_and_others(self) -> None:
        """Before: 38 of 50 commands failed, and nobody else got depth."""
        greedy = [Viewer(self.gate.port, token=VIEW) for _ in range(8)]
        greedy[0].notice(lambda reported: reported["connected"])
        served = 0
        for rate, one in enumerate(greedy):
            answer = one.answer(one.ask(subscribe=M.Subscribe(summary=True, summary_hz=rate + 1)))
            served += not answer.HasField("error")
        self.assertEqual(served, 5)
        with Viewer(self.gate.port, token=CONTROL) as hands:
            hands.call(subscribe=M.Subscribe(depth=E.DEPTH_INT16))
            hands.frame(lambda frame: frame.HasField("depth"))
            done = 0
            for brightness in range(50):
                for one in greedy:
                    for _ in range(9):  # fewer than its connection is ended for
                        one.ask(get_status=M.GetStatus())
                done += hands.call(set_light=M.SetLight(brightness=205 + brightness)).HasField("light")
            self.assertEqual(done, 50)
        for one in greedy:
            one.link.close()

    def test_a_wrong_token_opens_no_web_socket(self) -> None:
        """Before: each stayed for 10 s and counted nowhere; 1 of 11 honest requests was answered."""
        for target in ("/sensors/left/calibrate", "/sensors/left/calibrate?token=wrong"):
            with self.assertRaises(Refused) as refused:
                WebSocket(self.gate.port, target)
            self.assertEqual(refused.exception.status, 401)
        head = (f"GET /sensors/left/calibrate?token=wrong HTTP/1.1\r\nHost: 127.0.0.1:{self.gate.port}\r\n"
                "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n").encode()
        held = []
        answered = 0
        for number in range(400):
            held.append(connect(self.gate.port))
            held[-1].sendall(head)
            if number % 40 == 39:
                answered += request(self.gate.port, "/sensors")[0] == 200
        self.assertEqual(answered, 10)
        self.assertLess(self.gate.descriptors(), 64 + 60, "of one address 64 may wait")
        for stream in held:
            stream.close()

    def test_few_programs_run_for_pages_at_once(self) -> None:
        """Before: one for each of 48 pages that asked for the taught objects."""
        pages = [WebSocket(gateway.port, "/sensors/left/calibrate") for _ in range(12)]
        for page in pages:
            page.send(b'{"objects":{}}', TEXT)
        refused = served = 0
        for page in pages:
            ended = ""
            while not ended:
                ended = page.receive()[1].decode()
                ended = ended if '"ended"' in ended else ""
            refused += "ask again in a moment" in ended
            served += '"error":""' in ended or '"ended":{}' in ended
            page.stream.close()
        self.assertGreaterEqual(served, 4)
        self.assertGreaterEqual(refused, 1)
        self.assertEqual(served + refused, 12)

    def test_web_sockets_without_hello_are_bounded_over_all_sensors(self) -> None:
        """Before: 64 for each sensor, so that a fleet's gateway ran out of descriptors."""
        names = [f"s{number}" for number in range(4)]
        gate = Gateway(HERE, *(word for name in names for word in ("--daemon", f"{name}=127.0.0.1:1")))
        rest = gate.descriptors()
        held = [WebSocket(gate.port, f"/sensors/{names[number % 4]}/wire") for number in range(120)]
        self.assertLessEqual(gate.descriptors(), rest + 64 + 8)
        with Viewer(gate.port, names[0]):
            self.assertEqual(request(gate.port, "/sensors")[0], 200)
        for one in held:
            one.stream.close()
        self.assertEqual(gate.stop(), 0)

    def test_no_token_and_a_wrong_one(self) -> None:
        for token in ("", "a-token-that-is-not-known"):
            with Viewer(self.gate.port, greet=False) as viewer:
                error = viewer.refused(hello=M.Hello(major=1, minor=1, program="t", token=token))
                self.assertEqual(error.code, E.ERROR_DENIED)
                with self.assertRaises(Closed):
                    viewer.socket.receive()

    def test_unauthenticated_are_reported_no_addresses(self) -> None:
        _, _, body = request(self.gate.port, "/sensors")
        self.assertEqual(json.loads(body)[1],
                         {"name": "gone", "connected": False,
                          "error": "its daemon is away: dtact-web's log says why"})

    def test_rights_are_no_more_than_the_gateways_own(self) -> None:
        tokens, token = HERE / "daemon-tokens", HERE / "gateway-token"
        write_tokens(tokens, f"view {VIEW}")
        token.write_text(VIEW)
        token.chmod(0o600)
        daemon = Daemon(HERE, "guarded", f"net.tokens={tokens}")
        gate = Gateway(HERE, "--daemon", f"left=127.0.0.1:{daemon.port},token-file={token}")
        with Viewer(gate.port) as viewer:
            viewer.notice(lambda reported: reported["connected"])
        with Viewer(gate.port) as viewer:
            self.assertEqual(viewer.hello.rights, E.RIGHTS_VIEW)
            self.assertEqual(viewer.refused(rezero=M.Rezero()).code, E.ERROR_DENIED)
        self.assertEqual([gate.stop(), daemon.stop()], [0, 0])


class Restarts(unittest.TestCase):
    def test_viewers_stay_while_the_daemon_is_away(self) -> None:
        daemon = Daemon(HERE, "brief")
        gate = Gateway(HERE, "--host", f"127.0.0.1:{daemon.port}")
        with Viewer(gate.port, "sensor") as viewer:
            viewer.notice(lambda reported: reported["connected"])
            viewer.call(subscribe=M.Subscribe(luma=E.LUMA_GREY8))
            viewer.frame()
            daemon.stop(signal.SIGKILL)
            reported = viewer.notice(lambda reported: not reported["connected"])
            self.assertEqual(reported["name"], "sensor")
            self.assertIn("dtactd", reported["error"])
            error = viewer.refused(get_status=M.GetStatus())
            self.assertEqual(error.code, E.ERROR_DEVICE)
            self.assertIn("the daemon of sensor is away", error.message)
            self.assertEqual(viewer.refused(subscribe=M.Subscribe(summary=True)).code, E.ERROR_DEVICE)
            with Viewer(gate.port, "sensor") as late:
                self.assertFalse(late.notice(lambda reported: True)["connected"])
                self.assertEqual(late.hello.name, "brief", "what it said last")
                daemon.restart()
                late.notice(lambda reported: reported["connected"])
            viewer.notice(lambda reported: reported["connected"])
            viewer.frames.clear()
            viewer.call(subscribe=M.Subscribe(luma=E.LUMA_GREY8))
            viewer.frame()
        self.assertEqual([gate.stop(), daemon.stop()], [0, 0])


class Http(unittest.TestCase):
    def test_the_page(self) -> None:
        status, fields, body = request(gateway.port, "/")
        self.assertEqual((status, body), (200, b"<!doctype html><title>The page</title>"))
        self.assertEqual(fields["content-type"], "text/html; charset=utf-8")
        self.assertEqual(fields["x-content-type-options"], "nosniff")
        self.assertTrue(fields["content-security-policy"].startswith("default-src 'none'; script-src 'self';"))
        self.assertNotIn("unsafe", fields["content-security-policy"])
        status, fields, _ = request(gateway.port, "/a.js")
        self.assertEqual((status, fields["content-type"]), (200, "text/javascript; charset=utf-8"))
        status, _, body = request(gateway.port, "/a.js", If_None_Match=fields["etag"])
        self.assertEqual((status, body), (304, b""))
        status, fields, body = request(gateway.port, "/a.js", "HEAD")
        self.assertEqual((status, fields["content-length"], body), (200, "20", b""))

    def test_sensors(self) -> None:
        _, fields, body = request(gateway.port, "/sensors")
        self.assertEqual(json.loads(body), [{"name": "left", "connected": True},
                                            {"name": "right", "connected": True}])
        self.assertEqual((fields["content-type"], fields["cache-control"]),
                         ("application/json", "no-store"))

    def test_fleet(self) -> None:
        until = time.monotonic() + 20
        while True:  # the first answer comes before the daemons'
            _, fields, body = request(gateway.port, "/fleet")
            entries = json.loads(body)
            if all("status" in one for one in entries) or time.monotonic() > until:
                break
            time.sleep(0.1)
        self.assertEqual(fields["content-type"], "application/json")
        self.assertEqual([one["name"] for one in entries], ["left", "right"])
        for one in entries:
            self.assertEqual(set(one["status"]), {"state", "fps", "version", "health", "advice"})
            self.assertRegex(one["status"]["version"], r"^\d+\.\d+\.\d+")

    def test_nothing_else(self) -> None:
        for target in ("/../../etc/passwd", "/..%2f..%2fetc/passwd", "/%2e%2e/page", "//etc/passwd",
                       "/sensors/", "/sensors/left", "/page/index.html", "/a.js/", "/nothing"):
            self.assertEqual(request(gateway.port, target)[0], 404, target)
        self.assertEqual(request(gateway.port, "/", "POST")[0], 405)
        self.assertEqual(request(gateway.port, "/", "POST", b"much")[0], 413)

    def test_other_names_are_not_ours(self) -> None:
        for host in ("evil.example", "evil.example:7380", "localhost.evil.example", ""):
            self.assertEqual(request(gateway.port, "/", Host=host)[0], 421, host)
        for host in ("localhost", "LOCALHOST:7380", "[::1]:7380", socket.gethostname()):
            self.assertEqual(request(gateway.port, "/", Host=host)[0], 200, host)

    def test_pages_of_others_open_no_web_socket(self) -> None:
        for origin in ("http://evil.example", "https://evil.example", "null", "http://127.0.0.1:1", "file://"):
            with self.assertRaises(Refused) as refused:
                WebSocket(gateway.port, "/sensors/left/wire", Origin=origin)
            self.assertEqual(refused.exception.status, 403, origin)
        for scheme in ("http", "https"):  # a proxy may end TLS
            with Viewer(gateway.port, Origin=f"{scheme}://127.0.0.1:{gateway.port}"):
                pass
        with self.assertRaises(Refused) as refused:
            WebSocket(gateway.port, "/sensors/left/wire", Host="evil.example")
        self.assertEqual(refused.exception.status, 421)
        for target in ("/sensors/nobody/wire", "/wire", "/sensors/wire", "/"):
            with self.assertRaises(Refused) as refused:
                WebSocket(gateway.port, target)
            self.assertEqual(refused.exception.status, 404, target)

    def test_origins_for_foxglove(self) -> None:
        def status(gate: Gateway, origin: str) -> int:
            try:
                WebSocket(gate.port, "/foxglove", Origin=origin,
                          Sec_WebSocket_Protocol="foxglove.sdk.v1").close()
                return 101
            except Refused as refused:
                return refused.status

        self.assertEqual(status(gateway, "file://"), 101, "programs on the desktop")
        for origin in ("http://localhost:8080", "https://app.foxglove.dev"):
            self.assertEqual(status(gateway, origin), 403, origin)
            self.assertIn(f"a page of {origin} may not look at this sensor: start dtact-web with "
                          f"--foxglove-origin {origin}\n", gateway.text())
        gate = Gateway(HERE, "--daemon", f"left=127.0.0.1:{left.port}", "--foxglove-origin",
                       "http://localhost:8080")
        for origin, expected in (("http://localhost:8080", 101), ("file://", 101),
                                 ("https://app.foxglove.dev", 403)):
            self.assertEqual(status(gate, origin), expected, origin)
        self.assertEqual(gate.stop(), 0)

    def test_no_extension_is_agreed_on(self) -> None:
        with WebSocket(gateway.port, "/sensors/left/wire",
                       Sec_WebSocket_Extensions="permessage-deflate") as opened:
            self.assertNotIn("sec-websocket-extensions", opened.fields)

    def test_heads_are_bounded(self) -> None:
        self.assertEqual(request(gateway.port, "/", X_Much="x" * 9000)[0], 431)
        with connect(gateway.port) as stream:
            stream.sendall(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03")
            self.assertEqual(stream.recv(100)[:5], b"", "what is no HTTP gets no answer")

    def test_half_sent_requests_lock_nobody_out(self) -> None:
        """Before: everybody was reset for 15 s."""
        held = []
        for _ in range(128):
            held.append(connect(gateway.port))
            held[-1].sendall(b"GET / HTTP/1.1\r\n")
        answered = sum(request(gateway.port, "/")[0] == 200 for _ in range(20))
        self.assertEqual(answered, 20)
        self.assertEqual(held[0].recv(1), b"", "the oldest has lost its place")
        held[-1].sendall(f"Host: 127.0.0.1:{gateway.port}\r\n\r\n".encode())
        self.assertEqual(held[-1].recv(12), b"HTTP/1.1 200")
        for stream in held:
            stream.close()


class BadMessages(unittest.TestCase):
    def ends(self, viewer: Viewer) -> None:
        with self.assertRaises(Closed):
            while True:
                viewer.socket.receive()

    def test_frames_that_no_client_sends(self) -> None:
        for send in (lambda v: v.socket.send(b"\0\0\0\0", masked=False),
                     lambda v: v.socket.send(b"text", TEXT),
                     lambda v: v.socket.send(b"", 3),
                     lambda v: v.socket.send(b"", BINARY, announced=1 << 40),
                     lambda v: v.socket.stream.sendall(b"\xff" * 100)):
            with Viewer(gateway.port) as viewer:
                send(viewer)
                self.ends(viewer)

    def test_bytes_that_no_client_sends(self) -> None:
        for payload, code in ((length(1 << 30), E.ERROR_TOO_LARGE), (length(0), E.ERROR_BAD_MESSAGE),
                              (length(3) + b"\xff\xff\xff", E.ERROR_BAD_MESSAGE)):
            with Viewer(gateway.port) as viewer:
                viewer.socket.send(payload)
                self.assertEqual(viewer.answer(0).error.code, code)
                self.ends(viewer)

    def test_without_hello_nothing_is_said(self) -> None:
        with Viewer(gateway.port, greet=False) as viewer:
            error = viewer.refused(get_status=M.GetStatus())
            self.assertEqual(error.code, E.ERROR_VERSION)
            self.ends(viewer)

    def test_a_message_may_come_in_pieces(self) -> None:
        with Viewer(gateway.port) as viewer:
            body = M.ClientMessage(id=9, ping=M.Ping()).SerializeToString()
            for byte in length(len(body)) + body:
                viewer.socket.send(bytes([byte]))
            self.assertGreater(viewer.answer(9).pong.monotonic_ns, 0)


class Security(unittest.TestCase):
    def refusal(self, *arguments: str) -> str:
        done = subprocess.run([os.environ["DTACT_WEB"], "--listen-port", "0", *arguments],
                              capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 1, done.stdout)
        return done.stderr

    def test_beyond_this_machine_it_wants_tls_and_tokens(self) -> None:
        self.assertIn("needs TLS and a token", self.refusal("--listen", "0.0.0.0"))

    def test_daemons_are_named_once(self) -> None:
        self.assertIn("two are named a",
                      self.refusal("--daemon", "a=127.0.0.1:1", "--daemon", "a=127.0.0.1:2"))
        self.assertIn("it has to be NAME=ADDRESS", self.refusal("--daemon", "a/b=127.0.0.1"))

    def test_tls(self) -> None:
        subprocess.run([os.environ["DTACTCTL"], "cert", "-o", HERE / "keys"], check=True,
                       capture_output=True)
        certificate, key = sorted((HERE / "keys").iterdir(), key=lambda p: "key" in p.name)
        gate = Gateway(HERE, "--daemon", f"left=127.0.0.1:{left.port}", "--tls-certificate",
                       str(certificate), "--tls-key", str(key))
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        self.assertEqual(request(gate.port, "/sensors", tls=context)[0], 200)
        with Viewer(gate.port, tls=context, Origin=f"https://127.0.0.1:{gate.port}") as viewer:
            viewer.notice(lambda reported: reported["connected"])
            viewer.call(subscribe=M.Subscribe(**EVERYTHING))
            frame = viewer.frame(lambda frame: frame.HasField("depth"))
            self.assertEqual(len(frame.depth.data), 582 * 570 * 2)
        with self.assertRaises((Closed, ConnectionError)):
            request(gate.port, "/")
        # Each handshake of an unauthenticated client costs a signature. Before: as many as there was time for.
        flood = [connect(gate.port) for _ in range(600)]
        time.sleep(2)
        self.assertEqual(request(gate.port, "/sensors", tls=context)[0], 200)
        for one in flood:
            one.close()
        self.assertEqual(gate.stop(), 0)
        self.assertIn("more than 100 TLS handshakes a second came from", gate.text())


if __name__ == "__main__":
    unittest.main(verbosity=2)
