// The depth encodings of proto/README.md. Each decoder fills `out`, width × height values, and throws
// where the data are not exactly one such map.
import { unzstd } from "./zstd";

/** dtact.v1.DepthEncoding. */
const DEPTH_INT16 = 1;
export const DEPTH_PREDICT_ZSTD = 2;

/** Largest number of values in a message; a decoder allocates for no more. */
export const MAX_VALUES = 8_388_608;

function decodeInt16(data: Uint8Array, out: Int16Array): void {
  if (data.length !== 2 * out.length) {
    throw new Error(`${data.length} bytes of depth where ${2 * out.length} are due`);
  }
  // Copied without swapping: every machine with a browser is little-endian.
  new Uint8Array(out.buffer, out.byteOffset, out.byteLength).set(data);
}

function decodePredictZstd(data: Uint8Array, width: number, out: Int16Array): void {
  const nibbles = (out.length + 1) >> 1;
  const content = unzstd(data, nibbles, nibbles + 3 * out.length);
  let second = nibbles;
  let at = 0;
  const byte = (): number => {
    const value = content[second++];
    if (value === undefined) throw new Error("the residuals end too early");
    return value;
  };
  while (at < out.length) {
    let sum = 0;
    for (const end = at + width; at < end; ++at) {
      let zigzag = ((content[at >> 1] as number) >> ((at & 1) << 2)) & 15;
      if (zigzag === 15) {
        const more = byte();
        zigzag = more < 255 ? more + 15 : byte() | (byte() << 8);
        if (more === 255 && zigzag < 270) throw new Error("a residual in more bytes than it needs");
      }
      sum = (sum + ((zigzag >>> 1) ^ -(zigzag & 1))) | 0;
      // Storing takes it modulo 65536.
      out[at] = at < width ? sum : sum + (out[at - width] as number);
    }
  }
  if (out.length % 2 !== 0 && (content[nibbles - 1] as number) > 15) {
    throw new Error("the last nibble is not empty");
  }
  if (second !== content.length) throw new Error("bytes are left over behind the residuals");
}

/** Decodes a map of width × height values into `out`, which is exactly that long. */
export function decodeDepth(
  encoding: number,
  data: Uint8Array,
  width: number,
  height: number,
  out: Int16Array,
): void {
  if (width < 1 || height < 1 || width * height > MAX_VALUES) {
    throw new Error(`a depth map of ${width} x ${height}`);
  }
  if (out.length !== width * height) throw new Error("room for another depth map");
  switch (encoding) {
    case DEPTH_INT16:
      return decodeInt16(data, out);
    case DEPTH_PREDICT_ZSTD:
      return decodePredictZstd(data, width, out);
    default:
      throw new Error(`depth in encoding ${encoding}, which this page does not know`);
  }
}
