"""How a connection begins, and what ends it."""
import struct

from connection import MESSAGE_LIMIT, Connection, hello_request
from messages import E, M
from outcome import demand, passed

HELLO_LIMIT = 1024
FEATURES = """contact_absence decimation events force jpeg ping predict_zstd rates reconstruction
              reference region rvl stamps units""".split()
HELLO_EXAMPLE = bytes.fromhex("0000000b 0801 1207 08011001 1a0178")


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
