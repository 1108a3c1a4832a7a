"""The blocking client when the connection ends."""
import errno
import os
import signal
import tempfile
import time
import unittest
from unittest import mock

import dtact
from dtact.messages import ServerMessage
from fake_daemon import FakeDaemon, event, frame


class Breaking(unittest.TestCase):
    def test_what_came_before_is_given_first(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, kept_frames=2) as s:
            daemon.pushed = [frame(1), frame(2)]
            frames = s.frames()
            self.assertEqual(next(frames).sequence, 1)
            daemon.drop()
            self.assertEqual(next(frames).sequence, 2)
            with self.assertRaisesRegex(dtact.ConnectionError, "ended the connection"):
                next(frames)
            with self.assertRaisesRegex(dtact.ConnectionError, "ended the connection"):
                s.status()
            self.assertEqual(daemon.connections, 1)

    def test_a_link_that_the_kernel_gives_up_is_lost(self):
        """Nothing answers any more: recv() ends with a time-out that the client did not set."""
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            daemon.pushed = [frame(1)]
            self.assertEqual(next(s.frames()).sequence, 1)
            gone = mock.Mock(wraps=s._link._socket)
            gone.recv_into.side_effect = [BlockingIOError(), TimeoutError(errno.ETIMEDOUT, "timed out")]
            s._link._socket = gone
            with self.assertRaises(dtact.ConnectionError):
                list(s.events())

    def test_the_daemons_reason_is_given(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address) as s:
            def end(request, reply):
                message = ServerMessage()
                message.reply.error.code = 12
                message.reply.error.message = "more requests than are served"
                daemon.push(message)
                daemon.drop()
                return False
            daemon.answers["rezero"] = end
            with self.assertRaisesRegex(dtact.EndedByDaemon, "more requests than are served") as e:
                s.rezero()
            self.assertEqual(e.exception.code, 12)

    def test_reconnects_and_subscribes_again(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, reconnect=True) as s:
            s.subscribe(dtact.Subscription(depth="int16", every=2))
            daemon.push(frame(1), event(1))
            self.assertEqual(next(s.frames()).sequence, 1)
            daemon.pushed = [frame(2)]
            daemon.drop()
            self.assertEqual(next(s.frames(timeout=10)).sequence, 2)
            events = s.events(timeout=10)
            self.assertEqual(next(events).light.brightness, 1)
            back = next(events)
            self.assertIsInstance(back, dtact.Reconnected)
            self.assertEqual(back.sequence, 1)
            self.assertIn("ended the connection", back.reason)
            self.assertEqual(daemon.connections, 2)
            self.assertEqual(daemon.requests[-1].subscribe.every, 2)
            daemon.drop()
            time.sleep(0.1)
            with self.assertRaises(dtact.ConnectionError):
                s.set_light(brightness=1)  # It was under way: it may have been done or not.
            self.assertEqual(s.set_light(brightness=1).brightness, 1)

    def test_kept_frames_outlive_the_connection(self):
        with FakeDaemon() as daemon, \
                dtact.connect(daemon.address, reconnect=True, kept_frames=4) as s:
            daemon.pushed = [frame(1), frame(2)]
            s.subscribe()
            daemon.drop()
            daemon.pushed = [frame(3)]
            self.assertIsInstance(next(s.events(timeout=10)), dtact.Reconnected)
            frames = s.frames(timeout=10)
            self.assertEqual([next(frames).sequence for _ in range(3)], [1, 2, 3])

    def test_a_new_subscription_drops_them(self):
        with FakeDaemon() as daemon, \
                dtact.connect(daemon.address, reconnect=True, kept_frames=4) as s:
            daemon.pushed = [frame(1)]
            s.subscribe()
            daemon.drop()
            self.assertIsInstance(next(s.events(timeout=10)), dtact.Reconnected)
            daemon.pushed = [frame(2)]
            s.subscribe(dtact.Subscription(every=2))
            self.assertEqual(next(s.frames(timeout=10)).sequence, 2)

    def test_waits_for_a_daemon_that_comes_back(self):
        with tempfile.TemporaryDirectory() as folder:
            with FakeDaemon(path=f"{folder}/socket") as daemon:
                s = dtact.connect(daemon.address, reconnect=True)
                s.subscribe()
            os.unlink(f"{folder}/socket")
            self.assertIsNone(s.next(timeout=0.3))
            with self.assertRaisesRegex(dtact.ConnectionError, "nothing listens"):
                s.status()
            with FakeDaemon(path=f"{folder}/socket") as daemon:
                daemon.pushed = [frame(5)]
                self.assertEqual(next(s.frames(timeout=10)).sequence, 5)
                back = next(s.events())
                self.assertIn("ended the connection", back.reason)
                self.assertGreater(back.away_s, 0.3)
                s.close()

    def test_who_polls_is_connected_again(self):
        def late(request, reply):
            time.sleep(0.1)
            reply.hello.major, reply.hello.program = 1, "late"
        for timeout in (0, 0.01):
            with FakeDaemon() as daemon, dtact.connect(daemon.address, reconnect=True) as s:
                s.subscribe()
                daemon.answers["hello"] = late
                daemon.pushed = [frame(3)]
                daemon.drop()
                until = time.monotonic() + 5
                found = None
                while not isinstance(found, dtact.Frame) and time.monotonic() < until:
                    found = s.next(timeout)
                self.assertIsInstance(found, dtact.Frame, timeout)
                self.assertEqual(daemon.connections, 2)

    def test_who_polls_does_not_crowd_a_daemon_that_is_away(self):
        with FakeDaemon() as daemon:
            s = dtact.connect(daemon.address, reconnect=True)
        with mock.patch("dtact.client.Link", side_effect=ConnectionRefusedError) as attempts:
            for _ in range(50):
                self.assertIsNone(s.next(0.01))
        self.assertTrue(2 < attempts.call_count < 8, attempts.call_count)
        s.close()

    def test_a_daemon_that_ends_each_connection_is_not_crowded(self):
        with FakeDaemon() as daemon, dtact.connect(daemon.address, reconnect=True) as s:
            s.subscribe()
            daemon.ends_behind = "subscribe"
            daemon.drop()
            until = time.monotonic() + 0.6
            while time.monotonic() < until:
                s.next(0.05)
            self.assertTrue(2 < daemon.connections < 8, daemon.connections)
            while s._link is not None:
                s.next(0.05)
            daemon.ends_behind = ""
            s._next_attempt += 60
            self.assertEqual(s.status().state, "serving")  # A request does not wait.
            # Once a connection has lasted, the waits begin with the shortest.
            s._opened_at -= 10
            s._next_attempt = 0
            daemon.drop()
            while not isinstance(s.next(5), dtact.Reconnected):
                pass
            while s.next(0.05) is not None:
                pass
            self.assertLess(s._next_attempt - s._opened_at, 0.11)

    def test_an_interrupt_while_it_connects_again(self):
        def interrupt(*_):
            raise KeyboardInterrupt
        with FakeDaemon() as daemon, dtact.connect(daemon.address, reconnect=True) as s:
            daemon.pushed = [frame(1)]
            self.assertEqual(next(s.frames()).sequence, 1)
            daemon.answers["hello"] = False
            daemon.drop()
            before = signal.signal(signal.SIGALRM, interrupt)
            try:
                signal.setitimer(signal.ITIMER_REAL, 0.5)
                with self.assertRaises(KeyboardInterrupt):
                    next(s.frames(timeout=30))
            finally:
                signal.signal(signal.SIGALRM, before)
            del daemon.answers["hello"]
            daemon.pushed = [frame(2)]
            # Before: the connection stayed open without a subscription, and nothing came.
            self.assertEqual(next(s.frames(timeout=10)).sequence, 2)

    def test_no_use_after_close(self):
        with FakeDaemon() as daemon:
            s = dtact.connect(daemon.address, reconnect=True)
            s.close()
            for call in (s.status, lambda: s.next(1), lambda: next(s.frames())):
                with self.assertRaisesRegex(dtact.ConnectionError, "was closed"):
                    call()
            self.assertEqual(daemon.connections, 1)


if __name__ == "__main__":
    unittest.main()
