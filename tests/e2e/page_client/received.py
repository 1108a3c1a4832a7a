"""What every frame and event has to be."""
import time

from messages import E
from outcome import demand

UNTRUSTED = -32768


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


def check_times(c, what, monotonic_ns, wall_ns):
    demand(monotonic_ns > 0 and wall_ns > 0, f"{what} has times", (monotonic_ns, wall_ns))
    if c.local:
        now, wall = time.monotonic_ns(), time.time_ns()
        demand(monotonic_ns <= now, f"{what}: monotonic_ns is CLOCK_MONOTONIC, in the past",
               monotonic_ns - now)
        demand(abs((wall_ns - monotonic_ns) - (wall - now)) < 1e9,
               f"{what}: wall_ns is the same moment in UTC", (wall_ns, wall))


def check_frame(c, frame):
    wanted, last = c.wanted, c.last
    demand(wanted.depth or wanted.luma or wanted.jpeg or wanted.summary,
           "Frames come after a Subscribe", frame.sequence)
    check_times(c, "a frame", frame.monotonic_ns, frame.wall_ns)
    demand(frame.monotonic_ns <= frame.ready_ns <= frame.published_ns,
           "ready_ns and published_ns are later",
           (frame.monotonic_ns, frame.ready_ns, frame.published_ns))
    demand(not c.local or frame.published_ns <= time.monotonic_ns(),
           "published_ns is CLOCK_MONOTONIC", frame.published_ns)
    if last:
        demand(frame.sequence > last.sequence and frame.monotonic_ns > last.monotonic_ns,
               "A newer frame takes the waiting one's place", (last.sequence, frame.sequence))
        demand(frame.dropped >= last.dropped, "Frame.dropped counts since it connected",
               (last.dropped, frame.dropped))
    demand(frame.meaning != E.TIMESTAMP_UNSPECIFIED, "TimestampMeaning names the moment")
    demand(E.HEALTH_NONE not in frame.health, "health lists conditions", frame.health)
    demand(frame.HasField("times"), "Everything else is in every frame", "no times")
    demand(frame.frame_id == c.hello.surface_frame.frame_id, "frame_id is SurfaceFrame's",
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
        check_depth(c, frame.depth)
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
    c.last = frame


def check_depth(c, depth):
    wanted, whole = c.wanted, c.calibration
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


def check_event(c, event):
    demand(not c.wanted.HasField("events") or c.wanted.events,
           "events: false means answers only", event)
    check_times(c, "an event", event.monotonic_ns, event.wall_ns)
    if c.last and event.sequence == c.last.sequence:
        demand(event.monotonic_ns >= c.last.monotonic_ns,
               "an event's sequence is the last frame captured before it",
               (event.monotonic_ns, c.last.monotonic_ns))
