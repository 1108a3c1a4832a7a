"""Requests and their answers: refusals, the clock, status, calibrations, the untouched image."""
import struct
import time
import zlib

from connection import Connection
from messages import E, M
from outcome import demand, passed


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


def check_reconstruction(c):
    before = c.call(get_status=M.GetStatus()).reconstruction
    how = c.call(set_reconstruction=M.SetReconstruction(resolution="half"))
    demand((how.resolution, how.sharpen, how.max_error_um) == ("half", before.sharpen, before.max_error_um),
           "unset fields stay as they are", how)
    with Connection.open() as other:
        other.subscribe(depth=E.DEPTH_INT16)
        depth = other.frame(where=lambda f: f.HasField("depth")).depth
    demand(depth.decimation == 2, "answered once frames are made so", depth.decimation)
    c.refused(E.ERROR_INVALID, "resolution", set_reconstruction=M.SetReconstruction(resolution="best"))
    again = c.call(set_reconstruction=M.SetReconstruction(resolution=before.resolution))
    demand(again == before, "the way that depth was made before", again)
    passed(f"depth made at half resolution, and again {before.resolution}")


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
