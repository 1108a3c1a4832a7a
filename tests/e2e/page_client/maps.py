"""Depth maps of the very same frames in every encoding, decimation, unit and region."""
from connection import Connection, read_together, touched
from depth import DECODERS, decode
from messages import E, M
from outcome import demand, passed, skipped
from received import UNTRUSTED, left_out


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
