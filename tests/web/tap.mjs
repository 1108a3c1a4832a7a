// A client of the daemon that is independent of the page: it keeps the last frames that the daemon
// made, in DEPTH_INT16, parsed after proto/README.md and dtact.proto's field numbers.
import net from "node:net";

const KEPT = 100;
const HELLO = [8, 1, 0x12, 7, 8, 1, 0x10, 1, 0x1a, 1, 0x78]; // id 1, version 1.1, program "x"
const SUBSCRIBE = [8, 2, 0x1a, 2, 8, 1]; // id 2, depth: DEPTH_INT16
const SUBSCRIBE_JPEG = [8, 2, 0x1a, 4, 8, 1, 0x28, 1]; // the same, jpeg: true

/** The fields of a message by number: bigint, Buffer (of 8 or 4 bytes for fixed ones), the last one. */
export function fields(message) {
  const found = {};
  let at = 0;
  const varint = () => {
    let value = 0n;
    for (let shift = 0n; ; shift += 7n) {
      const byte = message[at++];
      value |= BigInt(byte & 127) << shift;
      if (byte < 128) return value;
    }
  };
  while (at < message.length) {
    const tag = Number(varint());
    const number = tag >> 3;
    const wire = tag & 7;
    if (wire === 0) {
      found[number] = varint();
      continue;
    }
    const length = { 1: 8, 5: 4 }[wire] ?? Number(varint());
    found[number] = message.subarray(at, at + length);
    at += length;
  }
  return found;
}

export class Tap {
  #frames = new Map();
  #socket;

  /**
   * `jpeg`: it asks for the camera's JPEGs, too. Every frame has one then, also the first of another
   * client's subscription, which may be older than that.
   */
  constructor(port, jpeg = false) {
    let bytes = Buffer.alloc(0);
    this.#socket = net.connect(port, "127.0.0.1");
    for (const message of [HELLO, jpeg ? SUBSCRIBE_JPEG : SUBSCRIBE]) {
      this.#socket.write(Buffer.from([0, 0, 0, message.length, ...message]));
    }
    this.#socket.on("data", (chunk) => {
      bytes = Buffer.concat([bytes, chunk]);
      while (bytes.length >= 4 && bytes.length >= 4 + bytes.readUInt32BE(0)) {
        const end = 4 + bytes.readUInt32BE(0);
        this.#take(Buffer.from(bytes.subarray(4, end)));
        bytes = bytes.subarray(end);
      }
    });
    this.#socket.on("error", () => {});
  }

  /** Depth of a frame in millimetres by row and column; undefined where it is not kept. */
  frame(sequence) {
    return this.#frames.get(sequence);
  }

  /** Of the frames that are kept, oldest first. */
  sequences() {
    return [...this.#frames.keys()];
  }

  close() {
    this.#socket.destroy();
  }

  #take(message) {
    const frame = fields(message)[2];
    if (!frame) return;
    const { 1: sequence, 11: depth } = fields(frame);
    if (!depth) return;
    const map = fields(depth);
    const width = Number(map[2]);
    const umPerUnit = map[5].readDoubleLE();
    this.#frames.set(Number(sequence), {
      width,
      height: Number(map[3]),
      mmPerPx: map[4].readDoubleLE(),
      um: (row, column) => map[7].readInt16LE(2 * (row * width + column)) * umPerUnit,
    });
    if (this.#frames.size > KEPT) this.#frames.delete(this.#frames.keys().next().value);
  }
}
