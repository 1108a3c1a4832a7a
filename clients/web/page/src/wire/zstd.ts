// zstd frames (RFC 8878) whose content's size is known within bounds.
import { decompress } from "fzstd";

const MAGIC = 0xfd2fb528;

/** What the frame's head says its content's size is, bytes; it is refused when it says nothing. */
function contentSize(frame: Uint8Array): number {
  const view = new DataView(frame.buffer, frame.byteOffset, frame.byteLength);
  if (frame.length < 6 || view.getUint32(0, true) !== MAGIC) throw new Error("no zstd frame");
  const descriptor = view.getUint8(4);
  const sizeFlag = descriptor >> 6;
  const singleSegment = (descriptor & 0x20) !== 0;
  const dictionaryBytes = [0, 1, 2, 4][descriptor & 3] as number;
  const at = 5 + (singleSegment ? 0 : 1) + dictionaryBytes;
  const bytes = sizeFlag === 0 ? (singleSegment ? 1 : 0) : 1 << sizeFlag;
  if (bytes === 0) throw new Error("the zstd frame does not say its content's size");
  if (frame.length < at + bytes) throw new Error("the zstd frame ends within its head");
  switch (bytes) {
    case 1:
      return view.getUint8(at);
    case 2:
      return view.getUint16(at, true) + 256;
    case 4:
      return view.getUint32(at, true);
    default:
      return Number(view.getBigUint64(at, true));
  }
}

/** The content of one frame, of least … most bytes. Nothing is allocated for one outside of that. */
export function unzstd(frame: Uint8Array, least: number, most: number): Uint8Array {
  const size = contentSize(frame);
  if (size < least || size > most) {
    throw new Error(`the zstd frame says ${size} bytes where ${least} to ${most} are possible`);
  }
  const content = decompress(frame);
  if (content.length !== size) throw new Error("bytes behind the zstd frame");
  return content;
}
