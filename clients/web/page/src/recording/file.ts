// What a recording is written to: memory at first, then the browser's own files.
import type { IWritable } from "@mcap/core";

/** Pieces of this many bytes become a Blob, which browsers keep on disk. */
const PIECE_BYTES = 16 * 1024 * 1024;

export class GrowingFile implements IWritable {
  private readonly pieces: Blob[] = [];
  private fresh: Uint8Array[] = [];
  private freshBytes = 0;
  bytes = 0;

  write(buffer: Uint8Array): Promise<void> {
    // The writer uses its memory again.
    this.fresh.push(buffer.slice());
    this.freshBytes += buffer.length;
    this.bytes += buffer.length;
    if (this.freshBytes >= PIECE_BYTES) this.put();
    return Promise.resolve();
  }

  position(): bigint {
    return BigInt(this.bytes);
  }

  whole(): Blob {
    this.put();
    return new Blob(this.pieces, { type: "application/octet-stream" });
  }

  private put(): void {
    this.pieces.push(new Blob(this.fresh));
    this.fresh = [];
    this.freshBytes = 0;
  }
}
