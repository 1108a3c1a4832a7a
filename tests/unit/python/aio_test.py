"""The asyncio client, against a daemon that does as a test says."""
import asyncio
import builtins
import socket
import tempfile
import threading
import time
import unittest
from unittest import mock

import certificate
import dtact
from fake_daemon import FakeDaemon, event, frame, silent_first


class Aio(unittest.IsolatedAsyncioTestCase):
    async def first(self, iterator):
        async for item in iterator:
            return item

    async def until(self, holds):
        async with asyncio.timeout(10):
            while not holds():
                await asyncio.sleep(0.01)

    async def test_frames_events_and_requests(self):
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(1), event(3), frame(2)]
            async with dtact.aio.connect(daemon.address, token="t", kept_frames=2) as s:
                self.assertTrue(s.same_machine)
                sock = s._link.transport.get_extra_info("socket")
                self.assertTrue(sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE))
                seen = []
                async for f in s.frames():
                    seen.append((f.sequence, f.depth_mm.shape))
                    if len(seen) == 2:
                        break
                self.assertEqual(seen, [(1, (2, 2)), (2, (2, 2))])
                self.assertEqual((await self.first(s.events())).light.brightness, 3)
                self.assertEqual((await s.status()).state, "serving")
                self.assertEqual((await s.set_light(brightness=4)).brightness, 4)
                self.assertEqual((await s.ping()).monotonic_s, 7.0)
                self.assertIsNone(await s.next(0.05))
                await s.rezero()
                await s.activate_calibration(1)
            self.assertEqual(daemon.requests[0].hello.token, "t")

    async def test_requests_of_several_tasks(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address) as s:
                lights = await asyncio.gather(*(s.set_light(brightness=b) for b in range(20)))
                self.assertEqual([light.brightness for light in lights], list(range(20)))

    async def test_a_cancelled_requests_answer_is_not_kept(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address) as s:
                def late(request, reply):
                    time.sleep(0.2)
                    return True
                daemon.answers["get_status"] = late
                with self.assertRaises(builtins.TimeoutError):
                    await asyncio.wait_for(s.status(), 0.05)
                await s.ping()
                self.assertEqual(s._conversation.answers, {})

    async def test_a_slow_reader_gets_the_newest(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address) as s:
                daemon.pushed = [frame(1)]
                frames = s.frames()
                self.assertEqual((await anext(frames)).sequence, 1)
                daemon.push(*(frame(n) for n in range(2, 31)))
                asyncio.get_running_loop().slow_callback_duration = 1
                time.sleep(0.2)  # The loop reads nothing meanwhile.
                self.assertEqual((await anext(frames)).sequence, 30)

    async def test_a_silent_address_does_not_delay_the_next_one(self):
        with FakeDaemon() as daemon, silent_first(daemon.address) as host:
            began = time.monotonic()
            async with dtact.aio.connect(host, timeout=30) as s:
                self.assertEqual((await s.status()).state, "serving")
            self.assertLess(time.monotonic() - began, 10)

    async def test_another_event_loop_is_named(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address) as s:
                def elsewhere():
                    asyncio.run(s.status())
                with self.assertRaisesRegex(dtact.SharedClient, "another event loop"):
                    await asyncio.to_thread(elsewhere)
                self.assertEqual((await s.status()).state, "serving")

    async def test_refusal_and_no_frame(self):
        def refuse(request, reply):
            reply.error.code, reply.error.message = 5, "there is contact"
        with FakeDaemon() as daemon:
            daemon.answers["rezero"] = refuse
            async with dtact.aio.connect(daemon.address) as s:
                with self.assertRaisesRegex(dtact.InContact, "there is contact"):
                    await s.rezero()
                with self.assertRaisesRegex(dtact.NoFrame, "serving"):
                    await self.first(s.frames(timeout=0.05))

    async def test_timeouts(self):
        with FakeDaemon() as daemon:
            daemon.answers["rezero"] = False
            async with dtact.aio.connect(daemon.address, timeout=0.2) as s:
                with self.assertRaises(dtact.TimeoutError):
                    await s.rezero()
                self.assertEqual((await s.status()).state, "serving")
        with self.assertRaises(dtact.ConnectionError):
            async with dtact.aio.connect(daemon.address):
                pass

    async def test_breaking_and_connecting_again(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address) as s:
                daemon.pushed = [frame(1)]
                await s.subscribe()
                daemon.drop()
                self.assertEqual((await s.next(5)).sequence, 1)
                with self.assertRaisesRegex(dtact.ConnectionError, "ended the connection"):
                    await s.next(5)
            async with dtact.aio.connect(daemon.address, reconnect=True) as s:
                self.assertEqual((await self.first(s.frames())).sequence, 1)
                daemon.drop()
                self.assertEqual((await self.first(s.frames(timeout=10))).sequence, 1)
                self.assertIsInstance(await self.first(s.events()), dtact.Reconnected)
                self.assertEqual(daemon.connections, 3)
                await s.close()
                with self.assertRaisesRegex(dtact.ConnectionError, "was closed"):
                    await s.status()

    async def test_kept_frames_outlive_the_connection(self):
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(1), frame(2)]
            async with dtact.aio.connect(daemon.address, reconnect=True, kept_frames=4) as s:
                await s.subscribe()
                daemon.drop()
                daemon.pushed = [frame(3)]
                self.assertIsInstance(await self.first(s.events(timeout=10)), dtact.Reconnected)
                taken = [(await s.next(5)).sequence for _ in range(3)]
                self.assertEqual(taken, [1, 2, 3])

    async def test_several_tasks_share_one_new_connection(self):
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(1), event(2)]
            async with dtact.aio.connect(daemon.address, reconnect=True) as s:
                await s.subscribe()
                self.assertEqual((await s.next(5)).sequence, 1)
                self.assertEqual((await s.next(5)).light.brightness, 2)
                waiting = [asyncio.create_task(self.first(s.frames(timeout=10))),
                           asyncio.create_task(self.first(s.events(timeout=10)))]
                await asyncio.sleep(0.05)
                daemon.drop()
                f, e = await asyncio.gather(*waiting)
                self.assertEqual(f.sequence, 1)
                self.assertIsInstance(e, dtact.Event | dtact.Reconnected)
                lights = await asyncio.gather(*(s.set_light(brightness=b) for b in range(5)))
                self.assertEqual([light.brightness for light in lights], list(range(5)))
                self.assertEqual(daemon.connections, 2)

    async def test_giving_up_while_it_connects_again(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address, reconnect=True) as s:
                await s.subscribe()
                answer = threading.Event()
                # The daemon takes longer than the callers wait.
                def late(request, reply):
                    answer.wait(10)
                    reply.hello.major, reply.hello.program = 1, "late"
                daemon.answers["hello"] = late
                daemon.pushed = [frame(7)]
                daemon.drop()
                for _ in range(3):
                    self.assertIsNone(await s.next(0.05))
                given_up = asyncio.create_task(s.status())
                await asyncio.sleep(0.05)
                given_up.cancel()
                with self.assertRaises(asyncio.CancelledError):
                    await given_up
                answer.set()
                self.assertEqual((await self.first(s.frames(timeout=10))).sequence, 7)
                self.assertEqual((await s.status()).state, "serving")
                self.assertEqual(daemon.connections, 2)

    async def test_closing_while_it_connects_again(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address, reconnect=True) as s:
                daemon.answers["hello"] = False
                daemon.drop()
                waiting = asyncio.create_task(s.next(10))
                await self.until(lambda: daemon.connections == 2 and len(daemon.requests) == 2)
                await s.close()
                with self.assertRaisesRegex(dtact.ConnectionError, "given up"):
                    await waiting
                with self.assertRaisesRegex(dtact.ConnectionError, "was closed"):
                    await s.next(1)
                await self.until(lambda: daemon.ended == 2)

    async def test_no_use_after_close(self):
        with FakeDaemon() as daemon:
            s = dtact.aio.connect(daemon.address, reconnect=True)
            async with s:
                pass
            # Before: it gave a frame that the first block had left, however long ago.
            with self.assertRaisesRegex(dtact.ConnectionError, "was closed"):
                async with s:
                    pass
            self.assertEqual(daemon.connections, 1)

    async def test_giving_up_the_first_connection(self):
        with FakeDaemon() as daemon:
            daemon.answers["hello"] = False
            with self.assertRaises(builtins.TimeoutError):
                async with asyncio.timeout(0.1):
                    async with dtact.aio.connect(daemon.address):
                        pass
            await self.until(lambda: daemon.ended == 1)

    async def test_who_polls_does_not_crowd_a_daemon_that_is_away(self):
        with FakeDaemon() as daemon:
            s = await dtact.aio.connect(daemon.address, reconnect=True).__aenter__()
        with mock.patch.object(s, "_connected", side_effect=ConnectionRefusedError) as attempts:
            for _ in range(50):
                self.assertIsNone(await s.next(0.01))
        self.assertLess(attempts.call_count, 8)
        await s.close()

    async def test_a_daemon_that_ends_each_connection_is_not_crowded(self):
        with FakeDaemon() as daemon:
            async with dtact.aio.connect(daemon.address, reconnect=True) as s:
                await s.subscribe()
                daemon.ends_behind = "subscribe"
                daemon.drop()
                until = time.monotonic() + 0.6
                while time.monotonic() < until:
                    await s.next(0.05)
                self.assertTrue(2 < daemon.connections < 8, daemon.connections)

    async def test_to_nobody_at_any_address_of_a_host(self):
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
        look_up = socket.getaddrinfo

        def both(host, *arguments, **options):
            return [found for address in ("127.0.0.1", "127.0.0.2")
                    for found in look_up(address, *arguments, **options)]
        with mock.patch("socket.getaddrinfo", both):
            with self.assertRaisesRegex(dtact.ConnectionError,
                                        f"nothing listens on localhost port {port}"):
                await dtact.aio.connect(f"localhost:{port}").__aenter__()

    async def test_unix_socket(self):
        with tempfile.TemporaryDirectory() as folder, FakeDaemon(path=f"{folder}/socket") as daemon:
            async with dtact.aio.connect(daemon.address, token="t", kept_frames=2) as s:
                self.assertTrue(s.same_machine)

    async def test_tls(self):
        with tempfile.TemporaryDirectory() as folder:
            made = certificate.make(folder)
        if made is None:
            self.skipTest("there is no openssl to make a certificate with")
        context, fingerprint = made
        with FakeDaemon(tls=context) as daemon, \
                mock.patch("dtact.aio.is_local", return_value=False):
            daemon.pushed = [frame(1)]
            async with dtact.aio.connect(daemon.address, fingerprint=fingerprint, token="t") as s:
                self.assertEqual((await self.first(s.frames())).sequence, 1)
            sent = len(daemon.requests)
            with self.assertRaisesRegex(dtact.IdentityError, fingerprint):
                async with dtact.aio.connect(daemon.address, fingerprint="0" * 64):
                    pass
            self.assertEqual(len(daemon.requests), sent)
        with FakeDaemon() as daemon, mock.patch("dtact.aio.is_local", return_value=False):
            with self.assertRaisesRegex(dtact.IdentityError, "fingerprint"):
                async with dtact.aio.connect(daemon.address, token="t"):
                    pass
            self.assertEqual(daemon.requests, [])

    async def test_frames_are_kept_while_nobody_takes_them(self):
        with FakeDaemon() as daemon:
            daemon.pushed = [frame(n) for n in range(1, 21)]
            async with dtact.aio.connect(daemon.address, kept_frames=2) as s:
                await s.subscribe()
                until = time.monotonic() + 0.2
                while time.monotonic() < until:
                    await asyncio.sleep(0.02)
                self.assertEqual((await s.next(1)).sequence, 19)


if __name__ == "__main__":
    unittest.main()
