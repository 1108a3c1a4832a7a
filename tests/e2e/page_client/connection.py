"""A connection: requests, their answers, and the frames and events beside them."""
import collections
import itertools
import select
import socket
import struct
import time

from messages import E, M
from outcome import demand
from received import check_event, check_frame

MESSAGE_LIMIT = 16 * 1024 * 1024
PATIENCE = 20.0  # seconds, for what comes by itself


def hello_request(minor=1, program="page_client", **more):
    return M.ClientMessage(id=1, hello=M.Hello(major=1, minor=minor, program=program, **more))


class Connection:
    """Reads what comes in its order; every frame and event is checked as it is read."""

    calibration = None  # CalibrationSummary

    def __init__(self, address, hello=True):
        self.local = address[0] in ("localhost", "127.0.0.1", "::1")
        self.socket = socket.create_connection(address, timeout=PATIENCE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.buffer = bytearray()
        self.ids = itertools.count(2)
        self.replies, self.answered = {}, set()
        self.frames, self.events = collections.deque(), collections.deque()
        self.wanted, self.wanting = M.Subscribe(), {}
        self.last = None
        if hello:
            self.send_message(hello_request())
            self.hello = self.answer(1).hello

    def close(self):
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    # Sending

    def send_bytes(self, body):
        self.socket.sendall(struct.pack(">I", len(body)) + body)

    def send_message(self, message):
        self.send_bytes(message.SerializeToString())

    def send(self, **request):
        number = next(self.ids)
        if "subscribe" in request:
            self.wanting[number] = request["subscribe"]
        self.send_message(M.ClientMessage(id=number, **request))
        return number

    # Receiving

    def receive(self, seconds=PATIENCE):
        """The next message, after its check; None at the connection's end and when none came."""
        until = time.monotonic() + seconds
        while True:
            if len(self.buffer) >= 4:
                (length,) = struct.unpack_from(">I", self.buffer)
                demand(length <= MESSAGE_LIMIT, "At most 16 MiB a message, both ways", length)
                if len(self.buffer) >= 4 + length:
                    message = M.ServerMessage.FromString(bytes(self.buffer[4:4 + length]))
                    del self.buffer[:4 + length]
                    self.sort(message)
                    return message
            left = until - time.monotonic()
            if left <= 0 or not select.select([self.socket], [], [], left)[0]:
                return None
            if not self.take():
                return None

    def take(self):
        """What is there, into the buffer; false at the connection's end."""
        try:
            chunk = self.socket.recv(1 << 20)
        except ConnectionResetError:
            chunk = b""
        self.buffer += chunk
        return bool(chunk)

    def alive(self):
        return not select.select([self.socket], [], [], 0)[0] or self.take()

    def sort(self, message):
        body = message.WhichOneof("body")
        if body == "frame":
            check_frame(self, message.frame)
            self.frames.append(message.frame)
        elif body == "event":
            check_event(self, message.event)
            self.events.append(message.event)
        elif body == "reply":
            reply = message.reply
            demand(reply.id not in self.answered or reply.id == 0,
                   "Each request gets exactly one Reply", f"two with id {reply.id}")
            self.answered.add(reply.id)
            self.replies[reply.id] = reply
            if reply.id in self.wanting:
                wanting = self.wanting.pop(reply.id)
                if reply.WhichOneof("result") == "done":
                    self.wanted = wanting

    def answer(self, number):
        until = time.monotonic() + PATIENCE
        while number not in self.replies:
            demand(0 not in self.replies, "no end of the connection", self.replies.get(0))
            demand(self.receive(until - time.monotonic()), "Each request gets exactly one Reply",
                   f"none with id {number}")
        return self.replies.pop(number)

    def call(self, **request):
        """The answer's result, which has to be of the kind that the page's table says."""
        (kind,) = request
        reply = self.answer(self.send(**request))
        expected = {"subscribe": "done", "set_light": "light", "rezero": "done",
                    "get_status": "status", "get_calibration": "calibration",
                    "list_calibrations": "calibrations", "get_reference": "reference",
                    "set_reconstruction": "reconstruction", "ping": "pong"}[kind]
        result = reply.WhichOneof("result")
        demand(result == expected, f"the answer to {kind} is {expected}", f"{reply}")
        return getattr(reply, result)

    def refused(self, code, word="", **request):
        """The request gets this error, with a sentence that holds the word, and the connection
        stays."""
        reply = self.answer(self.send(**request))
        demand(reply.WhichOneof("result") == "error" and reply.error.code == code,
               f"{E.ErrorCode[code]} for {request}", f"{reply}")
        demand(reply.error.message and word in reply.error.message,
               f"Error.message says what happened, and names '{word}'", reply.error.message)
        self.call(ping=M.Ping())

    def subscribe(self, **wanted):
        self.call(subscribe=M.Subscribe(**wanted))
        self.frames.clear()

    def frame(self, seconds=PATIENCE, where=lambda frame: True, page_says="frames come"):
        until = time.monotonic() + seconds
        while True:
            while self.frames:
                frame = self.frames.popleft()
                if where(frame):
                    return frame
            demand(time.monotonic() < until and self.receive(until - time.monotonic()), page_says,
                   f"none within {seconds} s")

    def event(self, kind, where=lambda event: True, page_says="events come"):
        until = time.monotonic() + PATIENCE
        while True:
            for event in list(self.events):
                if event.WhichOneof("what") == kind and where(event):
                    self.events.remove(event)
                    return event
            demand(time.monotonic() < until and self.receive(until - time.monotonic()), page_says,
                   f"no {kind} event within {PATIENCE} s")


def read_together(connections, seconds):
    """Reads several connections for a while; each one's frames are in its `frames`."""
    until = time.monotonic() + seconds
    while (left := until - time.monotonic()) > 0:
        for ready in select.select([c.socket for c in connections], [], [], left)[0]:
            demand(next(c for c in connections if c.socket is ready).take(),
                   "a connection that only misses frames is not ended", "it ended")
    for connection in connections:
        while connection.receive(0):
            pass


def touched(c):
    """The next frame in which something is well pressed."""
    return c.frame(where=lambda f: f.contact.touching and f.contact.deepest_mm > 0.3,
                   page_says="something has to touch the sensor every few seconds")
