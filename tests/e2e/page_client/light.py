"""The light and the untouched image: how they are changed, and what is told of it."""
import time

from connection import PATIENCE, Connection, read_together, touched
from messages import E, M
from outcome import Failed, demand, passed

SCHEMES = {"all": range(8), "scheme1": (0, 1, 4, 5), "scheme2": (2, 3, 6, 7),
           "scheme3": (1, 2, 5, 6), "scheme4": (0, 1, 6, 7)}


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
        silent.events.clear()  # what came before the answer
        before = c.call(get_status=M.GetStatus()).light
        c.subscribe(depth=E.DEPTH_INT16, decimation=4)
        for brightness in (before.brightness // 2 + 40, before.brightness):
            # Under something that touches depth would go on against a stand-in.
            c.frame(where=lambda f: f.contact.touching)
            c.frame(where=lambda f: f.HasField("contact") and not f.contact.touching)
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
    for _ in range(5):  # it may be gone before the request comes
        touched(c)
        reply = c.answer(c.send(rezero=M.Rezero()))
        if reply.HasField("error"):
            break
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
