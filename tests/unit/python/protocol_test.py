"""The protocol without a connection."""
import unittest

import dtact
from dtact.messages import ClientMessage, ServerMessage
from dtact.protocol import Conversation
from fake_daemon import event, frame, packed


def feed(conversation, data, step=None):
    while data:
        buffer = conversation.get_buffer()
        count = min(len(buffer), len(data), step or len(data))
        buffer[:count] = data[:count]
        buffer.release()
        conversation.buffer_updated(count)
        data = data[count:]


def reply(number, **error):
    message = ServerMessage()
    message.reply.id = number
    if error:
        message.reply.error.code = error["code"]
        message.reply.error.message = error["message"]
    else:
        message.reply.done.SetInParent()
    return message


class Framing(unittest.TestCase):
    def test_any_pieces_are_put_together(self):
        data = packed(frame(1)) + packed(event(7)) + packed(frame(2))
        for step in (1, 2, 3, 5, 1000):
            c = Conversation(4)
            feed(c, data, step)
            self.assertEqual(c.take_frame().sequence, 1)
            self.assertEqual(c.take_event().light.brightness, 7)
            self.assertEqual(c.take_frame().sequence, 2)
            self.assertIsNone(c.take())

    def test_requests_are_numbered_and_have_their_length_before_them(self):
        c = Conversation(4)
        for number in (1, 2):
            message = ClientMessage()
            message.get_status.SetInParent()
            self.assertEqual(c.request(message), (number, bytes([0, 0, 0, 4, 8, number, 0x32, 0])))

    def test_too_long_is_refused_both_ways(self):
        c = Conversation(4)
        feed(c, (16 << 20).to_bytes(4, "big"))
        with self.assertRaisesRegex(dtact.ProtocolError, "16777217 bytes"):
            feed(Conversation(4), ((16 << 20) + 1).to_bytes(4, "big"))
        message = ClientMessage()
        message.upload_calibration.reference_png = bytes(16 << 20)
        with self.assertRaisesRegex(ValueError, "at most 16777216"):
            c.request(message)

    def test_what_is_no_message_is_refused(self):
        with self.assertRaises(dtact.ProtocolError):
            feed(Conversation(4), b"\0\0\0\2\xff\xff")

    def test_an_empty_message_says_nothing(self):
        c = Conversation(4)
        feed(c, bytes(4) + packed(event(1)))
        self.assertEqual(c.take().light.brightness, 1)


class Inbox(unittest.TestCase):
    def test_the_newest_frames_and_every_event_are_kept_in_their_order(self):
        c = Conversation(2)
        feed(c, b"".join(packed(m) for m in
                         [event(1), frame(1), event(2), frame(2), event(3), frame(3)]))
        seen = []
        while (item := c.take()) is not None:
            seen.append(item.light.brightness if isinstance(item, dtact.Event) else -item.sequence)
        self.assertEqual(seen, [1, 2, -2, 3, -3])

    def test_frames_of_an_earlier_subscription_are_dropped(self):
        c = Conversation(4)
        message = ClientMessage()
        message.subscribe.depth = 1
        number, _ = c.request(message)
        feed(c, packed(frame(1)) + packed(reply(number)) + packed(frame(2)))
        self.assertEqual(c.take_frame().sequence, 2)
        self.assertIsNone(c.take_frame())

    def test_what_was_not_taken_outlives_a_connection(self):
        c = Conversation(4)
        feed(c, packed(event(1)) + packed(frame(1)))
        following = c.successor()
        message = ClientMessage()
        message.subscribe.depth = 1
        number, _ = following.request(message, again=True)
        feed(following, packed(reply(number)) + packed(event(2)) + packed(frame(2)))
        self.assertEqual(following.take().light.brightness, 1)
        self.assertEqual(following.take().sequence, 1)
        self.assertEqual(following.take().light.brightness, 2)
        number, _ = following.request(message)
        feed(following, packed(reply(number)))
        self.assertIsNone(following.take())

    def test_unknown_bodies_and_events_are_passed_over(self):
        c = Conversation(4)
        # Field 15 of ServerMessage, and an event of an unknown kind.
        feed(c, b"\0\0\0\2\x7a\0" + b"\0\0\0\5\x1a\3\x9a\6\0")
        self.assertIsNone(c.take())


class Answers(unittest.TestCase):
    def test_only_those_that_are_waited_for_are_kept(self):
        c = Conversation(4)
        message = ClientMessage()
        message.get_status.SetInParent()
        first, _ = c.request(message)
        second, _ = c.request(message)
        c.forget(first)
        feed(c, packed(reply(first)) + packed(reply(77)) + packed(reply(second)))
        self.assertEqual(list(c.answers), [second])

    def test_number_0_says_why_the_daemon_ends_the_connection(self):
        c = Conversation(4)
        feed(c, packed(reply(0, code=12, message="you flood")))
        self.assertIsInstance(c.farewell, dtact.EndedByDaemon)
        self.assertEqual((str(c.farewell), c.farewell.code), ("you flood", 12))
        feed(c, packed(reply(0, code=3, message="another version")))
        self.assertIsInstance(c.farewell, dtact.ProtocolError)


if __name__ == "__main__":
    unittest.main()
