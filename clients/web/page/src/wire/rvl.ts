// RVL: A. D. Wilson, "Fast Lossless Depth Image Compression" (ISS 2017), as proto/README.md has it.

/** The numbers in RVL's nibbles, the first one in the highest four bits of each 32-bit word. */
class Nibbles {
  private word = 0;
  private left = 0;
  private at = 0;
  private readonly view: DataView;

  constructor(private readonly data: Uint8Array) {
    if (data.length % 4 !== 0) throw new Error("RVL data of no whole number of words");
    this.view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  }

  /** The next number: three bits a nibble, the lowest first; 8 says that another one follows. */
  next(): number {
    let value = 0;
    for (let shift = 0; shift <= 24; shift += 3) {
      if (this.left === 0) {
        if (this.at === this.data.length) throw new Error("RVL data end too early");
        this.word = this.view.getInt32(this.at, true);
        this.at += 4;
        this.left = 8;
      }
      const nibble = this.word >>> 28;
      this.word <<= 4;
      --this.left;
      value |= (nibble & 7) << shift;
      if (nibble < 8) {
        if (nibble === 0 && shift > 0) throw new Error("an RVL number ends with an empty nibble");
        return value;
      }
    }
    throw new Error("an RVL number is too long");
  }

  /** Whether words are left over behind the last number. */
  get more(): boolean {
    return this.at !== this.data.length;
  }
}

/** Fills `out`, of which it refuses to write more or less. */
export function decodeRvl(data: Uint8Array, out: Int16Array): void {
  const nibbles = new Nibbles(data);
  let at = 0;
  let last = 0;
  while (at < out.length) {
    const zeros = nibbles.next();
    if (zeros > out.length - at) throw new Error("RVL data have more values than the map");
    if (zeros === 0 && at > 0) throw new Error("an empty run inside of the RVL data");
    out.fill(0, at, at + zeros);
    at += zeros;
    const run = nibbles.next();
    if (run > out.length - at) throw new Error("RVL data have more values than the map");
    if (run === 0 && at < out.length) throw new Error("an empty run inside of the RVL data");
    for (const end = at + run; at < end; ++at) {
      const zigzag = nibbles.next();
      last += (zigzag >>> 1) ^ -(zigzag & 1);
      if (last === 0 || last < -32768 || last > 32767) throw new Error("an RVL value out of range");
      out[at] = last;
    }
  }
  if (nibbles.more) throw new Error("words are left over behind the RVL data");
}
