"""The page's depth encodings. zstd's are there where the module zstandard is."""
import array
import itertools
import sys

try:
    import zstandard
except ImportError:
    zstandard = None

from messages import SOURCE, E
from outcome import Failed, demand, passed


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
