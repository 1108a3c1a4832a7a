#!/usr/bin/env python3
"""A client of dtactd written from proto/README.md and proto/dtact.proto alone, with nothing but
Python's standard library, protobuf and protoc: the proof that the page suffices.

    page_client.py HOST PORT

Something has to touch the sensor and let go of it every few seconds. One line a check; exits 1 at
the first that the daemon fails, saying what the page says, and 77 where protobuf is missing.
zstd's encodings are checked where the module zstandard is.
"""
import array
import collections
import itertools
import pathlib
import select
import socket
import struct
import subprocess
import sys
import tempfile
import time
import types
import zlib

try:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
except ImportError:
    print("skipped: apt-get install python3-protobuf")
    sys.exit(77)
try:
    import zstandard
except ImportError:
    zstandard = None

SOURCE = pathlib.Path(__file__).resolve().parents[2]
MESSAGE_LIMIT = 16 * 1024 * 1024
HELLO_LIMIT = 1024
UNTRUSTED = -32768
PATIENCE = 20.0  # seconds, for what comes by itself
FEATURES = """contact_absence decimation events jpeg ping predict_zstd rates reference region rvl
              stamps units""".split()
SCHEMES = {"all": range(8), "scheme1": (0, 1, 4, 5), "scheme2": (2, 3, 6, 7),
           "scheme3": (1, 2, 5, 6), "scheme4": (0, 1, 6, 7)}
HELLO_EXAMPLE = bytes.fromhex("0000000b 0801 1207 08011001 1a0178")


class Failed(Exception):
    pass


def demand(condition, page_says, seen=""):
    if not condition:
        raise Failed(f"{page_says}\n        but: {seen}" if seen != "" else page_says)


def passed(what):
    print("ok     ", what, flush=True)


def skipped(what):
    print("skipped", what, flush=True)


# ------------------------------------------------------------------------------------- messages


def load_messages():
    """The classes of dtact.proto's messages by name, and its enums' values."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder, "dtact.pb")
        try:
            subprocess.run(["protoc", "-I", SOURCE / "proto", f"--descriptor_set_out={out}",
                            "dtact.proto"], check=True)
        except FileNotFoundError:
            print("skipped: apt-get install protobuf-compiler")
            sys.exit(77)
        files = descriptor_pb2.FileDescriptorSet.FromString(out.read_bytes())
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.AddSerializedFile(file.SerializeToString())
    make = getattr(message_factory, "GetMessageClass", None)
    if make is None:
        make = message_factory.MessageFactory(pool).GetPrototype
    classes, values = {}, {}
    for file in files.file:
        for message in file.message_type:
            name = f"{file.package}.{message.name}"
            classes[message.name] = make(pool.FindMessageTypeByName(name))
        for enum in file.enum_type:
            values.update({value.name: value.number for value in enum.value})
            values[enum.name] = {value.number: value.name for value in enum.value}
    return types.SimpleNamespace(**classes), types.SimpleNamespace(**values)


M, E = load_messages()


# ------------------------------------------------------------------------------ depth encodings


class Damaged(Exception):
    pass


def numbers(code, data):
    out = array.array(code)
    out.frombytes(data)
    if sys.byteorder == "big":
        out.byteswap()
    return out


def signed(values):
    """Modulo 65536."""
    return array.array("h", array.array("H", values).tobytes())


def decode_int16(data, width, height):
    if len(data) != 2 * width * height:
        raise Damaged("not two bytes a value")
    return numbers("h", data)


def running_sums(rows):
    for row in rows:
        yield list(itertools.accumulate(row, lambda a, b: (a + b) & 0xFFFF))


def undo_delta(content, width, height):
    if len(content) != 2 * width * height:
        raise Damaged("not two bytes a value")
    differences = numbers("H", content)
    rows = (differences[y * width:(y + 1) * width] for y in range(height))
    return signed(itertools.chain.from_iterable(running_sums(rows)))


def undo_predict(content, width, height):
    count = width * height
    nibbles = (count + 1) // 2
    if not nibbles <= len(content) <= nibbles + 3 * count:
        raise Damaged("too short or too long")
    if count % 2 and content[nibbles - 1] >> 4:
        raise Damaged("the last byte's upper half is not 0")
    at = nibbles
    residuals = []
    try:
        for i in range(count):
            z = content[i // 2] >> 4 * (i % 2) & 15
            if z == 15:
                z += content[at]
                at += 1
                if z == 270:
                    z = content[at] | content[at + 1] << 8
                    at += 2
            residuals.append((z // 2 if z % 2 == 0 else -(z + 1) // 2) & 0xFFFF)
    except IndexError:
        raise Damaged("ends too early") from None
    if at != len(content):
        raise Damaged("goes on after the last value")
    above, out = [0] * width, []
    for row in running_sums(residuals[y * width:(y + 1) * width] for y in range(height)):
        above = [(a + b) & 0xFFFF for a, b in zip(above, row)]
        out += above
    return signed(out)


def unzstd(data, at_most):
    if zstandard.frame_content_size(data) not in range(at_most + 1):
        raise Damaged("the frame's content has another size")
    decompressor = zstandard.ZstdDecompressor().decompressobj()
    content = decompressor.decompress(data)
    if not decompressor.eof or decompressor.unused_data:
        raise Damaged("ends too early or goes on")
    return content


def decode_delta_zstd(data, width, height):
    return undo_delta(unzstd(data, 2 * width * height), width, height)


def decode_predict_zstd(data, width, height):
    count = width * height
    return undo_predict(unzstd(data, (count + 1) // 2 + 3 * count), width, height)


def decode_rvl(data, width, height):
    if len(data) % 4:
        raise Damaged("not whole words")
    # The first nibble of a word is its highest four bits.
    text = "".join(f"{word:08x}" for word in numbers("I", data))
    nibbles = iter([int(digit, 16) for digit in text])

    def number():
        value = shift = 0
        for nibble in nibbles:
            value |= (nibble & 7) << shift
            if nibble < 8:
                return value
            shift += 3
            if shift > 30:
                break
        raise Damaged("a number does not end")

    count = width * height
    out, last = [], 0
    while len(out) < count:
        zeros = number()
        if zeros > count - len(out):
            raise Damaged("zeros beyond the map")
        out += [0] * zeros
        others = number()
        if others > count - len(out):
            raise Damaged("values beyond the map")
        for _ in range(others):
            z = number()
            last += z // 2 if z % 2 == 0 else -(z + 1) // 2
            if not -32768 <= last <= 32767:
                raise Damaged("a value of more than 16 bits")
            out.append(last)
        if not zeros and not others:
            raise Damaged("nothing follows nothing")
    if len(list(nibbles)) >= 8:
        raise Damaged("goes on after the last value")
    return array.array("h", out)


DECODERS = {E.DEPTH_INT16: decode_int16, E.DEPTH_RVL: decode_rvl}
if zstandard:
    DECODERS[E.DEPTH_DELTA_ZSTD] = decode_delta_zstd
    DECODERS[E.DEPTH_PREDICT_ZSTD] = decode_predict_zstd


def decode(depth):
    return DECODERS[depth.encoding](depth.data, depth.width, depth.height)


def check_golden():
    forms = {"int16": decode_int16, "delta": undo_delta, "rvl": decode_rvl, "predict": undo_predict}
    if zstandard:
        forms.update(delta_zstd=decode_delta_zstd, predict_zstd=decode_predict_zstd)
    files = sorted((SOURCE / "tests/golden/depth").glob("*.txt"))
    demand(files, "tests/golden/depth/*.txt hold maps", "none is there")
    for file in files:
        lines = dict(line.split(" ") for line in file.read_text().splitlines())
        width, height = int(lines["width"]), int(lines["height"])
        values = numbers("h", bytes.fromhex(lines["int16"]))
        for form, decoder in forms.items():
            data = bytes.fromhex(lines[form])
            demand(decoder(data, width, height) == values, "A decoder has to give the map",
                   f"{file.name}, {form}")
            for wrong, name in ((data[:-1], "cut"), (data[:len(data) // 2], "halved"),
                                (data + bytes(4), "lengthened")):
                try:
                    decoder(wrong, width, height)
                except (Damaged, *([zstandard.ZstdError] if zstandard else [])):
                    continue
                raise Failed(f"A decoder has to refuse data that end too early or go on\n"
                             f"        but: {file.name}, {form}, {name}")
    passed(f"{len(files)} golden maps in {len(forms)} forms, and refused when cut or lengthened")


# ----------------------------------------------------------------------------------- connection


def hello_request(minor=1, program="page_client", **more):
    return M.ClientMessage(id=1, hello=M.Hello(major=1, minor=minor, program=program, **more))


def left_out(full_size, decimation):
    """Pixels of the full resolution before the first one of the coarser map."""
    return full_size % decimation // 2


def blocks(begin, size, full_size, decimation):
    """The first pixel of the coarser map that has one of these of the full resolution, and the one
    behind the last."""
    before, there = left_out(full_size, decimation), full_size // decimation
    first = (begin - before) // decimation
    end = -(-(begin + size - before) // decimation)
    return max(first, 0), min(end, there)


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
            self.check_frame(message.frame)
            self.frames.append(message.frame)
        elif body == "event":
            self.check_event(message.event)
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
                    "ping": "pong"}[kind]
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

    # What every frame and event has to be

    def check_times(self, what, monotonic_ns, wall_ns):
        demand(monotonic_ns > 0 and wall_ns > 0, f"{what} has times", (monotonic_ns, wall_ns))
        if self.local:
            now, wall = time.monotonic_ns(), time.time_ns()
            demand(monotonic_ns <= now, f"{what}: monotonic_ns is CLOCK_MONOTONIC, in the past",
                   monotonic_ns - now)
            demand(abs((wall_ns - monotonic_ns) - (wall - now)) < 1e9,
                   f"{what}: wall_ns is the same moment in UTC", (wall_ns, wall))

    def check_frame(self, frame):
        wanted, last = self.wanted, self.last
        demand(wanted.depth or wanted.luma or wanted.jpeg or wanted.summary,
               "Frames come after a Subscribe", frame.sequence)
        self.check_times("a frame", frame.monotonic_ns, frame.wall_ns)
        demand(frame.monotonic_ns <= frame.ready_ns <= frame.published_ns,
               "ready_ns and published_ns are later",
               (frame.monotonic_ns, frame.ready_ns, frame.published_ns))
        demand(not self.local or frame.published_ns <= time.monotonic_ns(),
               "published_ns is CLOCK_MONOTONIC", frame.published_ns)
        if last:
            demand(frame.sequence > last.sequence and frame.monotonic_ns > last.monotonic_ns,
                   "A newer frame takes the waiting one's place", (last.sequence, frame.sequence))
            demand(frame.dropped >= last.dropped, "Frame.dropped counts since it connected",
                   (last.dropped, frame.dropped))
        demand(frame.meaning != E.TIMESTAMP_UNSPECIFIED, "TimestampMeaning names the moment")
        demand(E.HEALTH_NONE not in frame.health, "health lists conditions", frame.health)
        demand(frame.HasField("times"), "Everything else is in every frame", "no times")
        demand(frame.frame_id == self.hello.surface_frame.frame_id, "frame_id is SurfaceFrame's",
               frame.frame_id)
        demand(len(frame.light.leds) == 8 and frame.light.brightness <= 255,
               "Everything else is in every frame: the light, eight colours", frame.light)
        demand(frame.HasField("contact") == (frame.contact_absence == E.CONTACT_ABSENCE_NONE),
               "contact is unset when it was not measured; contact_absence says why",
               f"{frame.contact_absence} {frame.contact}")
        for part in ("depth", "luma", "jpeg"):
            demand(getattr(wanted, part) or not frame.HasField(part),
                   "After its answer comes no frame of the subscription before", part)
        demand(frame.HasField("depth") or not wanted.depth or wanted.depth_hz
               or not frame.HasField("contact") or wanted.WhichOneof("region") == "contact_box",
               "depth may be absent while uncalibrated or referencing", frame.sequence)
        if frame.HasField("depth"):
            self.check_depth(frame.depth)
            if wanted.WhichOneof("region") == "contact_box":
                demand(frame.contact.touching, "of a contact's box no map while nothing touches",
                       frame.sequence)
        if frame.HasField("luma"):
            demand(frame.luma.encoding == E.LUMA_GREY8 and
                   len(frame.luma.data) == frame.luma.width * frame.luma.height,
                   "LUMA_GREY8 is one byte a pixel", len(frame.luma.data))
        if frame.HasField("jpeg"):
            demand(frame.jpeg.data[:2] == b"\xff\xd8" and frame.jpeg.data[-2:] == b"\xff\xd9",
                   "jpeg is a whole JPEG", frame.jpeg.data[:4])
        self.last = frame

    def check_depth(self, depth):
        wanted, whole = self.wanted, Connection.calibration
        demand(depth.encoding == wanted.depth, "the encoding that was asked for", depth.encoding)
        demand(depth.um_per_unit == (wanted.um_per_unit or 1), "um_per_unit as asked",
               depth.um_per_unit)
        demand(depth.untrusted_value == UNTRUSTED, "untrusted_value is -32768",
               depth.untrusted_value)
        by = depth.decimation
        demand(by in (1, 2, 4) and by >= (wanted.decimation or 1),
               "decimation may be coarser than asked", by)
        demand(abs(depth.mm_per_px - whole.mm_per_px * by) < 1e-9,
               "all in pixels of the map that was sent", (depth.mm_per_px, whole.mm_per_px))
        demand((depth.full_width, depth.full_height) == (whole.width // by, whole.height // by),
               "the whole map's size is the calibration's / decimation, rounded down",
               (depth.full_width, depth.full_height))
        demand(depth.uncertainty_um >= 0, "uncertainty_um", depth.uncertainty_um)
        place = (depth.x, depth.y, depth.width, depth.height)
        region = wanted.WhichOneof("region")
        if region is None:
            demand(place == (0, 0, depth.full_width, depth.full_height),
                   "x, y are 0, 0 and its own size unless a region was asked", place)
        elif region == "box":
            box = wanted.box
            x, right = blocks(box.x, box.width, whole.width, by)
            y, bottom = blocks(box.y, box.height, whole.height, by)
            asked = (x, y, right - x, bottom - y)
            demand(place == asked, "a region is grown outward to whole pixels of the map that is "
                   "sent and cut at its border", f"{place}, not {asked}")
        demand(depth.width >= 1 and depth.height >= 1 and depth.x + depth.width <= depth.full_width
               and depth.y + depth.height <= depth.full_height,
               "columns x ... x + width - 1 of full_width", place)

    def check_event(self, event):
        demand(not self.wanted.HasField("events") or self.wanted.events,
               "events: false means answers only", event)
        self.check_times("an event", event.monotonic_ns, event.wall_ns)
        if self.last and event.sequence == self.last.sequence:
            demand(event.monotonic_ns >= self.last.monotonic_ns,
                   "an event's sequence is the last frame captured before it",
                   (event.monotonic_ns, self.last.monotonic_ns))


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


def ended(connection, code, page_says, number=None, within=3.0):
    """The daemon says why, and ends the connection."""
    reply = None
    while (message := connection.receive(within)) is not None:
        if message.WhichOneof("body") == "reply":
            reply = message.reply
            if number is not None and reply.id == number:
                break
            if reply.WhichOneof("result") == "error":
                break
    demand(reply is not None and reply.WhichOneof("result") == "error", page_says, "no error came")
    demand(reply.error.code == code and reply.error.message, f"{E.ErrorCode[code]}: {page_says}",
           f"{reply}")
    demand(number is None or reply.id == number, f"{page_says}: id {number}", f"{reply}")
    demand(connection.receive(within) is None and not connection.buffer
           and not connection.alive(), "the connection ends",
           f"it is open {within:.0f} s after {E.ErrorCode[code]}")
    connection.close()


# --------------------------------------------------------------------------------------- checks


def check_first_message(address):
    """What ends a connection before Hello, and what does not."""
    def fresh():
        return Connection(address, hello=False)

    with fresh() as c:
        c.send_message(M.ClientMessage(id=0, hello=M.Hello(major=1, minor=1, program="x")))
        ended(c, E.ERROR_BAD_MESSAGE, "id 0 ends the connection")
    passed("a first message with id 0: ERROR_BAD_MESSAGE and the end")
    with fresh() as c:
        c.send_bytes(b"")
        ended(c, E.ERROR_BAD_MESSAGE, "an empty message has no id and is refused")
    passed("an empty message: ERROR_BAD_MESSAGE and the end")
    with fresh() as c:
        c.send_bytes(b"\xff" * 20)
        ended(c, E.ERROR_BAD_MESSAGE, "no ClientMessage ends the connection", 0)
    passed("20 bytes of no message: ERROR_BAD_MESSAGE, id 0, and the end")
    with fresh() as c:
        c.socket.sendall(struct.pack(">I", HELLO_LIMIT + 1))
        ended(c, E.ERROR_TOO_LARGE, "a length above the limit ends the connection", 0)
    passed("1,025 bytes before Hello: ERROR_TOO_LARGE, id 0, and the end")
    with fresh() as c:
        # An unknown field fills it up to the very limit.
        body = hello_request().SerializeToString()
        padding = HELLO_LIMIT - len(body) - 4
        body += bytes([0xFA, 0x07]) + bytes([padding & 127 | 128, padding >> 7]) + bytes(padding)
        c.send_bytes(body)
        demand(c.answer(1).HasField("hello"), "At most 1,024 bytes before Hello is answered")
    passed("a Hello of 1,024 bytes is answered")
    with fresh() as c:
        c.send_message(M.ClientMessage(id=7, ping=M.Ping()))
        ended(c, E.ERROR_VERSION, "no Hello first")
    passed("a request before Hello: ERROR_VERSION and the end")
    with fresh() as c:
        c.send_message(M.ClientMessage(id=7, hello=M.Hello(major=2, minor=0, program="x")))
        ended(c, E.ERROR_VERSION, "another major version", 7)
    passed("another major version: ERROR_VERSION and the end")
    with fresh() as c:
        c.send_message(hello_request(program="x" * 65))
        demand(c.answer(1).error.code == E.ERROR_INVALID, "Hello.program: 64 bytes")
        c.answered.clear()
        c.send_message(hello_request(program="x" * 64))
        demand(c.answer(1).HasField("hello"), "after ERROR_INVALID the connection stays")
    passed("a program's name of 65 bytes: ERROR_INVALID, and 64 are answered")


def check_hello(c):
    demand(M.ClientMessage(id=1, hello=M.Hello(major=1, minor=1, program="x")).SerializeToString()
           == HELLO_EXAMPLE[4:], "Hello with the program name x and id 1 is these bytes")
    c.socket.sendall(HELLO_EXAMPLE)
    first = c.receive()
    demand(first is not None and first.WhichOneof("body") == "reply" and first.reply.id == 1
           and first.reply.WhichOneof("result") == "hello",
           "The daemon answers with HelloReply before all else", first)
    hello = c.hello = c.replies.pop(1).hello
    demand(hello.major == 1 and hello.minor >= 1, "version 1.1", (hello.major, hello.minor))
    frame = hello.surface_frame
    demand(frame.frame_id and frame.right_handed and frame.mirrored_from_outside
           and frame.origin == "centre",
           "right-handed, mirrored from outside, origin at the centre", frame)
    demand(hello.rights == E.RIGHTS_CONTROL, "without tokens everything is allowed", hello.rights)
    passed(f"the page's Hello, byte for byte: {hello.program} speaks {hello.major}.{hello.minor}")
    missing = set(FEATURES) - set(hello.features)
    demand(not missing, "a daemon of 1.1 can do all that is listed", f"missing: {missing}")
    more = set(hello.features) - set(FEATURES)
    passed("every feature of the page" + (f", and not of the page: {more}" if more else ""))
    demand(not more, "HelloReply.features: proto/README.md lists the names", more)


def check_requests(c):
    one, two = c.send(get_status=M.GetStatus()), c.send(ping=M.Ping())
    demand(c.answer(two).HasField("pong") and c.answer(one).HasField("status"),
           "Requests may be sent before the answer to the one before")
    passed("two requests before their answers")

    number = next(c.ids)
    c.send_bytes(M.ClientMessage(id=number).SerializeToString() + bytes([0x9A, 0x06, 0x00]))
    reply = c.answer(number)
    demand(reply.error.code == E.ERROR_UNSUPPORTED and reply.error.message,
           "a request that this daemon does not know is ERROR_UNSUPPORTED", reply)
    c.call(ping=M.Ping())
    passed("an unknown request: ERROR_UNSUPPORTED, and the connection stays")

    best = None
    for _ in range(10):
        before = time.monotonic_ns()
        pong = c.call(ping=M.Ping())
        after = time.monotonic_ns()
        if c.local:
            demand(before <= pong.monotonic_ns <= after,
                   "Pong.monotonic_ns is CLOCK_MONOTONIC at some moment in between",
                   (before, pong.monotonic_ns, after))
            demand(abs(pong.wall_ns - time.time_ns()) < 1e9, "wall_ns is UTC since 1970", pong)
        best = min(best, after - before) if best else after - before
    passed(f"ten Pings, the fastest in {best / 1e3:.0f} us")

    c.refused(E.ERROR_INVALID, "hello", hello=M.Hello(major=1, minor=1))
    passed("a second Hello: ERROR_INVALID, and the connection stays")
    S = M.Subscribe
    for word, wrong in (("decimation", dict(decimation=3)), ("um_per_unit", dict(um_per_unit=3)),
                        ("depth_hz", dict(depth_hz=0.001)), ("luma_hz", dict(luma_hz=1001)),
                        ("summary_hz", dict(summary_hz=-1)), ("box", dict(box=M.Region(x=1)))):
        c.refused(E.ERROR_INVALID, word, subscribe=S(depth=E.DEPTH_INT16, **wrong))
    passed("fields out of range: ERROR_INVALID names the field, and the connection stays")
    c.refused(E.ERROR_UNSUPPORTED, subscribe=S(depth=77))
    c.refused(E.ERROR_UNSUPPORTED, subscribe=S(luma=77))
    passed("encodings that nobody knows: ERROR_UNSUPPORTED, and the connection stays")
    c.refused(E.ERROR_INVALID, set_light=M.SetLight(brightness=256))
    c.refused(E.ERROR_INVALID, set_light=M.SetLight(leds=[M.Rgb(r=1)] * 3))
    c.refused(E.ERROR_INVALID, set_light=M.SetLight(scheme="none"))
    passed("lights out of range: ERROR_INVALID, and the connection stays")


def check_status(c):
    until = time.monotonic() + 60
    while (status := c.call(get_status=M.GetStatus())).state != E.STATE_SERVING:
        demand(time.monotonic() < until, "the daemon serves, calibrated", f"{status}")
        time.sleep(0.2)
    summary = status.calibration
    demand(summary.width and summary.height and summary.mm_per_px > 0, "calibration is there",
           summary)
    demand(any(s.program == "x" and s.rights == E.RIGHTS_CONTROL and s.endpoint
               for s in status.clients), "clients lists this one", status.clients)
    demand(status.endpoints, "endpoints lists where it listens")
    demand(status.camera.condition == "streaming", "the camera streams",
           status.camera)
    demand(len(status.light.leds) == 8 and status.light.HasField("since_ns"),
           "the light has eight colours and since_ns", status.light)
    Connection.calibration = summary
    passed(f"status: {status.camera.width} x {status.camera.height} at {status.camera.fps:.0f} Hz, "
           f"depth {summary.width} x {summary.height}")
    stored = c.call(list_calibrations=M.ListCalibrations()).calibrations
    demand([s for s in stored if s.in_use][0].summary.name, "at most one is in use", stored)
    files = c.call(get_calibration=M.GetCalibration())
    demand(b"[crop]" in files.calibration_toml and files.reference_png[:4] == b"\x89PNG",
           "[crop] stands in the calibration's file", files.calibration_toml)
    passed("the calibrations' list and the current one's files")
    return status


def check_reference(c, status):
    image = c.call(get_reference=M.GetReference())
    demand(image.png[:8] == b"\x89PNG\r\n\x1a\n", "ReferenceImage.png is a PNG")
    width, height, bits, colour = struct.unpack_from(">IIBB", image.png, 16)
    demand((width, height, bits, colour) == (status.camera.width, status.camera.height, 16, 0),
           "grey at 16 bits, the camera's size", (width, height, bits, colour))
    with Connection.open() as other:
        other.subscribe(luma=E.LUMA_GREY8)
        luma = other.frame(where=lambda f: f.HasField("luma")).luma
    rows = unfilter(zlib.decompress(png_data(image.png)), width, height)
    mean = sum(map(sum, rows)) / (width * height) / 256
    seen = sum(luma.data) / len(luma.data)
    demand(abs(mean - seen) < 8, "luma L is compared with value / 256", (mean, seen))
    passed(f"the untouched image: 16-bit grey, {mean:.1f} grey levels of 256 units on the mean; "
           f"luma {seen:.1f}")


def png_data(png):
    at, data = 8, b""
    while at < len(png):
        length, kind = struct.unpack_from(">I4s", png, at)
        if kind == b"IDAT":
            data += png[at + 8:at + 8 + length]
        at += 12 + length
    return data


def unfilter(data, width, height):
    """Rows of 16-bit values of a grey PNG."""
    above = bytearray(2 * width)
    for y in range(height):
        kind, row = data[y * (2 * width + 1)], bytearray(data[y * (2 * width + 1) + 1:
                                                              (y + 1) * (2 * width + 1)])
        for i in range(2 * width if kind else 0):
            left, up = row[i - 2] if i >= 2 else 0, above[i]
            corner = above[i - 2] if i >= 2 else 0
            if kind == 4:
                p = left + up - corner
                guess = min((left, up, corner), key=lambda v: abs(p - v))
            else:
                guess = (0, left, up, (left + up) // 2)[kind]
            row[i] = (row[i] + guess) & 255
        above = row
        yield struct.unpack(f">{width}H", row)


def touched(c):
    """The next frame in which something is well pressed."""
    return c.frame(where=lambda f: f.contact.touching and f.contact.deepest_mm > 0.3,
                   page_says="something has to touch the sensor every few seconds")


def check_maps():
    """All encodings, decimation, units and regions of the very same frames."""
    S, by_name = M.Subscribe, {}
    box = M.Region(x=251, y=147, width=301, height=252)
    kinds = {"int16, decimation 4": S(depth=E.DEPTH_INT16, decimation=4),
             "int16": S(depth=E.DEPTH_INT16), "rvl": S(depth=E.DEPTH_RVL),
             "delta_zstd": S(depth=E.DEPTH_DELTA_ZSTD),
             "predict_zstd": S(depth=E.DEPTH_PREDICT_ZSTD),
             "a box in units of 5 um": S(depth=E.DEPTH_RVL, box=box, um_per_unit=5),
             "a box, decimation 2": S(depth=E.DEPTH_INT16, box=box, decimation=2),
             "the contact's box": S(depth=E.DEPTH_INT16, contact_box=True),
             "the contact's box, decimation 4": S(depth=E.DEPTH_RVL, contact_box=True,
                                                  decimation=4)}
    for name, wanted in list(kinds.items()):
        if wanted.depth not in DECODERS:
            skipped(f"{name}: apt-get install python3-zstandard")
            del kinds[name]
    watch = Connection.open()
    for name in kinds:
        by_name[name] = Connection.open()
    common = None
    for _ in range(5):
        watch.subscribe(summary=True)
        touched(watch)
        watch.subscribe()
        for name, wanted in kinds.items():
            by_name[name].call(subscribe=wanted)
        read_together(by_name.values(), 0.6)
        frames = {name: {f.sequence: f for f in c.frames if f.HasField("depth")}
                  for name, c in by_name.items()}
        for c in by_name.values():
            c.call(subscribe=S())
            c.frames.clear()
        common = sorted(set.intersection(*map(set, frames.values())))
        if common and frames["int16"][common[-1]].contact.deepest_mm > 0.3:
            break
    demand(common, "a frame of the same number comes to every client", {
        name: sorted(of) for name, of in frames.items()})
    for c in (watch, *by_name.values()):
        c.close()
    compare({name: of[common[-1]] for name, of in frames.items()})


def compare(frames):
    """The same frame in every kind."""
    whole = frames["int16"]
    full = decode(whole.depth)
    width, height = whole.depth.width, whole.depth.height
    mm = whole.depth.mm_per_px
    demand({(f.monotonic_ns, f.wall_ns, f.ready_ns, f.contact.SerializeToString(deterministic=True))
            for f in frames.values()} == {(whole.monotonic_ns, whole.wall_ns, whole.ready_ns,
            whole.contact.SerializeToString(deterministic=True))},
           "the same frame has the same times and contact for everyone")
    for name in ("rvl", "delta_zstd", "predict_zstd"):
        if name in frames:
            demand(decode(frames[name].depth) == full,
                   "All of them give back exactly the values that were encoded", name)
            passed(f"{name} and int16 of frame {whole.sequence} are the same {width} x {height} "
                   f"values, in {len(frames[name].depth.data):,} and {2 * len(full):,} bytes")

    demand(whole.depth.decimation == 1, "this program needs a daemon of full resolution")

    def block(column, row, by):
        column, row = column * by + left_out(width, by), row * by + left_out(height, by)
        return [full[y * width + x] for y in range(row, row + by)
                for x in range(column, column + by)]

    for name, frame in frames.items():
        depth, by, values = frame.depth, frame.depth.decimation, decode(frame.depth)
        untrusted = 0
        for i, value in enumerate(values):
            source = block(depth.x + i % depth.width, depth.y + i // depth.width, by)
            trusted = [v for v in source if v != UNTRUSTED]
            if 2 * len(trusted) > len(source):
                # Half away from zero.
                units, total = len(trusted) * round(depth.um_per_unit), sum(trusted)
                mean = (2 * abs(total) + units) // (2 * units) * (1 if total > 0 else -1)
            else:
                mean = UNTRUSTED
                untrusted += 1
            demand(value == mean, f"{name}: the mean of the trusted pixels, rounded to units, half "
                   "away from zero; untrusted when half of them are not", (i, value, mean, source))
        passed(f"{name}: {depth.width} x {depth.height} at {depth.x}, {depth.y} of "
               f"{depth.full_width} x {depth.full_height} are the whole map's"
               + (f"; {untrusted} untrusted" if untrusted else ""))
        # What contact says of the same frame, by the page's formula.
        contact = frame.contact
        deepest = max(values) * depth.um_per_unit / 1000
        demand(abs(deepest - contact.deepest_mm) < 0.005 + 0.03 * contact.deepest_mm * (by > 1),
               "Indentation in millimetres is value * um_per_unit / 1000",
               (name, deepest, contact.deepest_mm))
        column = contact.deepest_x_mm / depth.mm_per_px + (depth.full_width - 1) / 2 - depth.x
        row = contact.deepest_y_mm / depth.mm_per_px + (depth.full_height - 1) / 2 - depth.y
        there = values[round(row) * depth.width + round(column)] * depth.um_per_unit / 1000
        demand(there >= deepest - 0.02 * (by > 1) and
               (by > 1 or max(abs(column - round(column)), abs(row - round(row))) < 0.01),
               f"{name}: pixel (column, row) lies at "
               "(x + column - (full_width - 1) / 2) * mm_per_px",
               f"at {column}, {row} it is {there} mm deep, elsewhere {deepest}")
        centroid = [0.0, 0.0, 0.0]
        threshold = contact.deepest_mm * 1000 / depth.um_per_unit / 5
        for i, value in enumerate(values):
            if value > threshold:
                centroid[0] += value
                centroid[1] += value * (depth.x + i % depth.width - (depth.full_width - 1) / 2)
                centroid[2] += value * (depth.y + i // depth.width - (depth.full_height - 1) / 2)
        off = [centroid[k] / centroid[0] * depth.mm_per_px - at
               for k, at in ((1, contact.x_mm), (2, contact.y_mm))]
        demand(max(map(abs, off)) < mm / 2, f"{name}: the centroid lies in the surface frame", off)
    passed("the deepest pixel and the centroid lie where contact says: "
           f"{contact.deepest_mm:.3f} mm at {contact.deepest_x_mm:.2f}, "
           f"{contact.deepest_y_mm:.2f} mm")
    # The contact's box: 16 pixels around what is pressed deeper than the threshold.
    depth = frames["the contact's box"].depth
    inside = decode(depth)
    across, down = range(depth.width), range(depth.height)
    rim = [inside[y * depth.width + x] for y in down for x in across
           if not (15 < x < depth.width - 16 and 15 < y < depth.height - 16)]
    core = [v for v in inside if v != UNTRUSTED]
    demand(max(rim) < max(core) / 2, "the box has 16 pixels around what is pressed",
           (max(rim), max(core)))
    outside = max(full[y * width + x] for y in range(height) for x in range(width)
                  if not (depth.x <= x < depth.x + depth.width and
                          depth.y <= y < depth.y + depth.height))
    passed(f"the contact's box: at most {max(rim)} um in its rim of 16 pixels, {outside} um "
           f"outside it, {max(core)} um inside")


def check_borders(c):
    whole = Connection.calibration
    c.subscribe(depth=E.DEPTH_INT16, um_per_unit=10, decimation=4,
                box=M.Region(x=whole.width - 10, y=3, width=0xFFFFFFFF, height=0xFFFFFFFF))
    depth = c.frame(where=lambda f: f.HasField("depth")).depth
    passed(f"a box beyond the border is cut to {depth.width} x {depth.height} of "
           f"{depth.full_width} x {depth.full_height}")
    c.refused(E.ERROR_INVALID, "box", subscribe=M.Subscribe(
        depth=E.DEPTH_INT16, box=M.Region(x=whole.width, width=1, height=1)))
    passed("a box that begins outside of the map: ERROR_INVALID")
    c.subscribe(depth=E.DEPTH_INT16, contact_box=True)
    frame = c.frame(where=lambda f: f.HasField("contact") and not f.contact.touching)
    demand(not frame.HasField("depth"), "no map while nothing touches", frame.depth.width)
    passed("frames without a map of the contact's box while nothing touches")


def check_rates(c, fps):
    c.subscribe(depth=E.DEPTH_INT16, decimation=4, depth_hz=fps / 6, summary=True, events=False)
    read_together([c], 2.0)
    frames = list(c.frames)
    with_depth = [f for f in frames if f.HasField("depth")]
    seconds = (frames[-1].monotonic_ns - frames[0].monotonic_ns) / 1e9
    demand(len(with_depth) <= seconds * fps / 6 + 1, "never more often than asked",
           (len(with_depth), seconds))
    demand(len(with_depth) >= seconds * fps / 6 * 0.8 - 1, "of each period a frame is taken",
           (len(with_depth), seconds))
    demand(len(frames) > len(with_depth), "summary without a rate is every frame", len(frames))
    passed(f"depth_hz {fps / 6:.0f} beside summary: {len(with_depth)} maps in {len(frames)} frames "
           f"of {seconds:.2f} s")
    c.subscribe(summary=True, every=3, events=False)
    read_together([c], 1.0)
    gaps = [b.sequence - a.sequence for a, b in zip(list(c.frames), list(c.frames)[1:])]
    demand(gaps and min(gaps) >= 3, "every n-th frame", gaps)
    passed(f"every 3: distances of {min(gaps)} ... {max(gaps)} in {len(gaps) + 1} frames")
    c.subscribe(luma=E.LUMA_GREY8, jpeg=True, luma_hz=5)
    frame = c.frame(where=lambda f: f.HasField("luma"))
    status = c.call(get_status=M.GetStatus())
    demand((frame.luma.width, frame.luma.height) == (status.camera.width, status.camera.height),
           "The luma map is the camera's whole image", (frame.luma.width, frame.luma.height))
    if status.camera.pixel_format.lower() == "mjpeg":
        demand(c.frame().HasField("jpeg"), "jpeg is the camera's own, as it came")
    passed(f"luma {frame.luma.width} x {frame.luma.height}"
           + (f", jpeg of {len(frame.jpeg.data):,} bytes" if frame.HasField("jpeg") else ""))


def check_flow():
    """A client that does not read."""
    with Connection.open() as c:
        c.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
        lost = c.call(get_status=M.GetStatus()).camera
        c.subscribe(depth=E.DEPTH_INT16, luma=E.LUMA_GREY8)
        first = c.frame()
        time.sleep(1.5)
        read_together([c], 0.5)
        frames = [first, *c.frames]
        dropped = frames[-1].dropped - first.dropped
        missing = frames[-1].sequence - first.sequence + 1 - len(frames)
        now = c.call(get_status=M.GetStatus()).camera
        lost = now.lost + now.skipped + now.damaged - lost.lost - lost.skipped - lost.damaged
        demand(dropped > 0, "a newer frame takes the waiting one's place, and dropped counts it",
               (dropped, missing))
        demand(missing - lost <= dropped <= missing or not lost and dropped == missing,
               "A gap in sequence without a drop is a frame that the camera lost",
               f"{missing} missing, {dropped} dropped, {lost} lost by the camera")
        passed(f"a client that does not read: {missing} frames missing, {dropped} dropped, "
               f"{lost} lost by the camera")


def check_contact_events(c):
    c.subscribe(summary=True)
    c.events.clear()
    seen = {}
    made = lost = None
    until = time.monotonic() + PATIENCE
    while not (made and lost) and time.monotonic() < until:
        message = c.receive(1.0)
        if message and message.WhichOneof("body") == "frame":
            seen[message.frame.sequence] = message.frame
        elif message and message.event.WhichOneof("what") == "contact":
            event = message.event
            if event.contact.contact.touching:
                made = event
            elif made:
                lost = event
    demand(made and lost, "a contact event when a contact was made or lost", "none came")
    # Frames of the same moment may come after their event.
    deadline = time.monotonic() + 0.3
    while message := c.receive(max(0, deadline - time.monotonic())):
        if message.WhichOneof("body") == "frame":
            seen[message.frame.sequence] = message.frame
    for event, touching in ((made, True), (lost, False)):
        inner = event.contact
        demand(inner.sequence <= event.sequence and inner.monotonic_ns <= event.monotonic_ns,
               "an event tells the last frame captured before it",
               (inner.sequence, event.sequence))
        if frame := seen.get(inner.sequence):
            demand(frame.contact.touching == touching, "the frame of the event's number shows it",
                   frame.sequence)
            demand(frame.monotonic_ns == inner.monotonic_ns and frame.contact == inner.contact,
                   "the event has this frame's time and contact", (frame.contact, inner))
        row = [seen[s].contact.touching for s in range(inner.sequence - 3, inner.sequence + 3)
               if s in seen]
        passed(f"contact {'made' if touching else 'lost'} in frame {inner.sequence}, told "
               f"{event.sequence - inner.sequence} frames later; around it "
               + " ".join("-x"[t] for t in row))


def follow_light(c, brightness, asked, since):
    """Reads until depth has paused and goes on: the frame with which it does, the untouched image's
    event and how many frames of the light there were."""
    shown, paused, until = 0, False, time.monotonic() + PATIENCE
    while time.monotonic() < until:
        if not c.frames:
            c.receive(1.0)
            continue
        frame = c.frames.popleft()
        if frame.monotonic_ns < asked:
            continue
        if frame.monotonic_ns >= since:
            shown += 1
            demand(frame.light.brightness == brightness,
                   "a frame not before since_ns was exposed under this light alone",
                   (frame.sequence, frame.light.brightness))
            demand(frame.light.since_ns in (0, since), "frames carry the same since_ns",
                   (frame.light.since_ns, since))
        paused = paused or (frame.contact_absence == E.CONTACT_ABSENCE_REFERENCING
                            and not frame.HasField("depth"))
        if paused and frame.HasField("depth"):
            return frame, c.event("reference").reference, shown
    raise Failed("a light other than the untouched image's: depth pauses (REFERENCING), and goes "
                 f"on against a new one\n        but: paused {paused}")


def check_brightness(c, other, brightness, leds):
    c.events.clear()
    asked = c.call(ping=M.Ping()).monotonic_ns
    light = c.call(set_light=M.SetLight(brightness=brightness))
    demand(light.brightness == brightness and list(light.leds) == leds,
           "Unset fields stay as they are", light)
    event = c.event("light", lambda e: e.light.brightness == brightness)
    demand(asked <= event.monotonic_ns, "an event's time is when it happened",
           (asked, event.monotonic_ns))
    theirs = other.event("light", lambda e: e.light.brightness == brightness,
                         "every client is told by an event")
    demand(theirs.SerializeToString(deterministic=True)
           == event.SerializeToString(deterministic=True), "the same event to everyone",
           (theirs, event))
    until = time.monotonic() + PATIENCE
    while not (now := c.call(get_status=M.GetStatus()).light).HasField("since_ns"):
        demand(time.monotonic() < until, "since_ns is known once the ring has been written", now)
    since = now.since_ns
    demand(since > asked, "since_ns: frames from then on are exposed under this light",
           (since, asked))
    demand(event.light.since_ns in (0, since), "the event's since_ns is the status'",
           (event.light.since_ns, since))
    frame, reference, shown = follow_light(c, brightness, asked, since)
    demand(frame.sequence >= reference.sequence, "a new untouched image is in use from this frame "
           "on", (frame.sequence, reference.sequence))
    c.event("state", lambda e: e.state.state == E.STATE_SERVING)
    demand(c.call(get_status=M.GetStatus()).state == E.STATE_SERVING,
           "the event says what status says")
    image = c.call(get_reference=M.GetReference())
    demand(image.light.brightness == brightness, "the light that it was taken under", image.light)
    passed(f"brightness {brightness}: told after {(event.monotonic_ns - asked) / 1e6:.1f} ms, "
           f"since_ns {(since - event.monotonic_ns) / 1e6:.1f} ms later; depth goes on {shown} "
           f"frames after that, in frame {frame.sequence}, where the untouched image is new")


def check_light(c):
    with Connection.open() as other, Connection.open() as silent:
        silent.subscribe(events=False)
        before = c.call(get_status=M.GetStatus()).light
        c.subscribe(depth=E.DEPTH_INT16, decimation=4)
        c.frame(where=lambda f: f.contact.touching)
        c.frame(where=lambda f: f.HasField("contact") and not f.contact.touching)
        for brightness in (before.brightness // 2 + 40, before.brightness):
            check_brightness(c, other, brightness, list(before.leds))
        c.subscribe()
        for scheme, lit in SCHEMES.items():
            light = c.call(set_light=M.SetLight(scheme=scheme))
            demand([(led.r, led.g, led.b) for led in light.leds]
                   == [(255 * (i in lit),) * 3 for i in range(8)], f"{scheme} is LEDs {lit}", light)
        c.call(set_light=M.SetLight(leds=before.leds))
        passed("the schemes' LEDs, and the light from before")
        read_together([silent], 0.1)
        demand(not silent.events, "events: false means none")
        passed("no event to a client that wants none")


def check_rezero(c):
    c.subscribe(summary=True)
    touched(c)
    reply = c.answer(c.send(rezero=M.Rezero()))
    demand(reply.error.code == E.ERROR_CONTACT, "refused while something touches", reply)
    passed("Rezero while something touches: ERROR_CONTACT")
    c.frame(where=lambda f: f.HasField("contact") and not f.contact.touching)
    time.sleep(0.1)
    c.call(ping=M.Ping())
    asked = c.last.sequence
    c.call(rezero=M.Rezero())
    told = c.event("reference", lambda e: e.reference.sequence > asked)
    image = c.call(get_reference=M.GetReference())
    demand(image.sequence <= told.reference.sequence, "sequence is the last that was averaged",
           (image.sequence, told.reference.sequence))
    passed(f"Rezero: in use from frame {told.reference.sequence} on, averaged up to "
           f"{image.sequence}")


def check_after_hello(address):
    with Connection(address) as c:
        c.send_message(M.ClientMessage(id=0, ping=M.Ping()))
        ended(c, E.ERROR_BAD_MESSAGE, "id 0 ends the connection", 0)
    with Connection(address) as c:
        c.socket.sendall(struct.pack(">I", MESSAGE_LIMIT + 1))
        ended(c, E.ERROR_TOO_LARGE, "a length above 16 MiB ends the connection", 0)
    passed("id 0 and a length above 16 MiB after Hello: an error and the end")
    with Connection(address) as c:
        waiting = [c.send(ping=M.Ping()) for _ in range(400)]
        demand(all(c.answer(number).HasField("pong") for number in waiting),
               "500 requests a second, and as many at once after a rest")
        for _ in range(5000):
            try:
                c.send(ping=M.Ping())
            except OSError:
                break
        ended(c, E.ERROR_FLOOD, "more than 500 requests a second end the connection")
    passed("400 requests at once are answered, of 5,000: ERROR_FLOOD and the end")
    clients = []
    try:
        while len(clients) < 40:
            c = Connection(address, hello=False)
            clients.append(c)
            c.send_message(hello_request())
            demand(message := c.receive(), "HelloReply, or an error", "nothing")
            if message.reply.WhichOneof("result") == "error":
                demand(message.reply.id == 0 and message.reply.error.code == E.ERROR_BUSY,
                       "too many clients: ERROR_BUSY, id 0", message.reply)
                demand(c.receive(3.0) is None and not c.buffer, "the connection ends")
                break
    finally:
        for c in clients:
            c.close()
    passed(f"too many clients: the {len(clients)}th gets ERROR_BUSY with id 0 and the end")


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    address = (sys.argv[1], int(sys.argv[2]))
    Connection.open = lambda: Connection(address)
    try:
        check_golden()
        late = Connection(address, hello=False)
        began = time.monotonic()
        check_first_message(address)
        with Connection(address, hello=False) as c:
            check_hello(c)
            check_requests(c)
            status = check_status(c)
            message = late.receive(max(0, 8 - (time.monotonic() - began)))
            demand(message is None and not late.alive(),
                   "without a Hello within 5 s the connection ends, with no word", f"{message}")
            passed(f"no Hello: the end {time.monotonic() - began:.1f} s later")
            check_reference(c, status)
            check_maps()
            check_borders(c)
            check_rates(c, status.camera.fps)
            check_flow()
            check_contact_events(c)
            check_light(c)
            check_rezero(c)
        check_after_hello(address)
    except Failed as failure:
        print("FAILED  the page says:", failure, flush=True)
        return 1
    print("all that the page says and a client sees is so")
    return 0


if __name__ == "__main__":
    sys.exit(main())
