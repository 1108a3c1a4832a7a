// The wire's framing: four bytes of length, big-endian, before each message (proto/README.md).

/** Both sides refuse a message above this, bytes. */
export const MAX_MESSAGE_BYTES = 16 * 1024 * 1024;

const HEAD_BYTES = 4;

/** A message with its length before it. */
export function framed(message: Uint8Array): Uint8Array {
  if (message.length > MAX_MESSAGE_BYTES) {
    throw new Error(`a message of ${message.length} bytes is above the wire's 16 MiB`);
  }
  const bytes = new Uint8Array(HEAD_BYTES + message.length);
  new DataView(bytes.buffer).setUint32(0, message.length);
  bytes.set(message, HEAD_BYTES);
  return bytes;
}

/** The message inside of one WebSocket message, which holds exactly one; shares its memory. */
export function unframed(bytes: Uint8Array): Uint8Array {
  if (bytes.length < HEAD_BYTES) throw new Error("a message of the wire ends within its length");
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0);
  if (length !== bytes.length - HEAD_BYTES) {
    throw new Error(`a message says ${length} bytes and has ${bytes.length - HEAD_BYTES}`);
  }
  return bytes.subarray(HEAD_BYTES);
}
