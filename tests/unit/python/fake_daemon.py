"""A daemon on a thread that answers as the test prescribes."""
import contextlib
import socket
import threading
from unittest import mock

from dtact.messages import ClientMessage, ServerMessage


def frame(sequence, values=(0, 1000, -32768, 25), width=2, um_per_unit=1.0):
    """A Frame message with an int16 map."""
    message = ServerMessage()
    m = message.frame
    m.sequence = sequence
    m.monotonic_ns = 5_000_000_000 + sequence
    m.wall_ns = 1_700_000_000_123_456_789
    depth = m.depth
    depth.encoding = 1
    depth.width, depth.height = width, len(values) // width
    depth.full_width, depth.full_height = depth.width, depth.height
    depth.mm_per_px = 0.5
    depth.um_per_unit = um_per_unit
    depth.untrusted_value = -32768
    depth.uncertainty_um = 14.0
    depth.data = b"".join(v.to_bytes(2, "little", signed=True) for v in values)
    return message


def event(brightness):
    message = ServerMessage()
    message.event.light.brightness = brightness
    return message


class FakeDaemon:
    """Accepts connections on a port of its own. `requests` are those that came; the messages in
    `pushed` are sent behind the answer to Subscribe."""

    def __init__(self, features=(), path=None, tls=None):
        self.features, self.tls = features, tls
        self.requests = []
        self.pushed = []
        self.answers = {}  # request kind → function (request, Reply message); False: no answer
        self.ends_behind = ""  # The kind of request behind whose answer it ends the connection.
        self.connections = 0
        self.ended = 0  # Number of connections that ended.
        self._connection = None
        if path:
            self._socket = socket.socket(socket.AF_UNIX)
            self._socket.bind(path)
            self.address = f"unix:{path}"
        else:
            self._socket = socket.create_server(("127.0.0.1", 0))
            self.address = "127.0.0.1:%d" % self._socket.getsockname()[1]
        self._socket.listen()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        # A shutdown wakes the thread, which a close alone does not.
        self._socket.shutdown(socket.SHUT_RDWR)
        self.drop()
        self._thread.join(10)
        self._socket.close()

    def drop(self):
        """Ends the current connection."""
        connection = self._connection
        if connection is not None:
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def push(self, *messages):
        self._connection.sendall(b"".join(packed(m) for m in messages))

    def _serve(self):
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._greet, args=(connection,), daemon=True).start()

    def _greet(self, connection):
        try:
            if self.tls:
                connection = self.tls.wrap_socket(connection, server_side=True)
            with connection:
                self._connection = connection
                self.connections += 1
                self._talk(connection)
        except (OSError, EOFError):
            connection.close()
            self.ended += 1

    def _talk(self, connection):
        while True:
            size = int.from_bytes(read(connection, 4), "big")
            request = ClientMessage.FromString(read(connection, size))
            self.requests.append(request)
            kind = request.WhichOneof("request")
            message = ServerMessage()
            reply = message.reply
            reply.id = request.id
            if kind in self.answers:
                if self.answers[kind] is False or self.answers[kind](request, reply) is False:
                    continue
            elif kind == "hello":
                hello = reply.hello
                hello.major, hello.minor, hello.program = 1, 1, "fake"
                hello.features.extend(self.features)
            elif kind == "set_light":
                reply.light.brightness = request.set_light.brightness
            elif kind == "get_status":
                reply.status.state = 3
                reply.status.advice = "All is well."
                reply.status.health.append(6)
                reply.status.fixes.append("Set the light back.")
                reply.status.board_celsius = 48.5
                reply.status.camera.fps = 60
                reply.status.camera.width, reply.status.camera.height = 3, 2
                reply.status.calibration.width = 2
                reply.status.calibration.height = 2
            elif kind == "ping":
                reply.pong.monotonic_ns = 7_000_000_000
                reply.pong.wall_ns = 1_000_000_000
            else:
                reply.done.SetInParent()
            # In one piece, so that drop() comes after all of it.
            behind = self.pushed if kind == "subscribe" else []
            connection.sendall(b"".join(packed(m) for m in [message, *behind]))
            if kind == self.ends_behind:
                raise EOFError


@contextlib.contextmanager
def silent_first(address):
    """A host and port whose first address takes no connection and says nothing; the second is
    `address`, "127.0.0.1:PORT"."""
    port = int(address.rpartition(":")[2])
    look_up = socket.getaddrinfo

    def both(host, *arguments, **options):
        if host != "silent-first":
            return look_up(host, *arguments, **options)
        return look_up("127.0.0.3", *arguments, **options) + look_up("127.0.0.1", *arguments, **options)

    with contextlib.ExitStack() as stack:
        listening = stack.enter_context(socket.create_server(("127.0.0.3", port), backlog=0))
        for _ in range(4):  # A full queue: the kernel drops what asks for more.
            waiting = stack.enter_context(socket.socket())
            waiting.setblocking(False)
            waiting.connect_ex(listening.getsockname())
        stack.enter_context(mock.patch("socket.getaddrinfo", both))
        yield f"silent-first:{port}"


def packed(message):
    body = message.SerializeToString()
    return len(body).to_bytes(4, "big") + body


def read(connection, count):
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise EOFError
        data += part
    return data
