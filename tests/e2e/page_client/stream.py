"""Which frames and events come: rates, a client that does not read, contacts made and lost."""
import socket
import time

from connection import PATIENCE, Connection, read_together
from messages import E, M
from outcome import demand, passed


def check_rates(c, fps):
    c.subscribe(depth=E.DEPTH_INT16, decimation=4, depth_hz=fps / 6, summary=True, events=False)
    read_together([c], 2.0)
    frames = list(c.frames)
    with_depth = [f for f in frames if f.HasField("depth")]
    seconds = (frames[-1].monotonic_ns - frames[0].monotonic_ns) / 1e9
    # Each is the frame nearest to its time, so the last may come half a frame before that.
    demand(len(with_depth) <= (seconds + 0.5 / fps) * fps / 6 + 1, "never more often than asked",
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
