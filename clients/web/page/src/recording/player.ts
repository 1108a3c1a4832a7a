// Plays a recording in the place of a sensor's connection: each frame at its own time, from any moment on.
import { create, fromBinary } from "@bufbuild/protobuf";
import { McapIndexedReader } from "@mcap/core";
import type { IReadable, McapTypes } from "@mcap/core";
import { decompress } from "fzstd";
import {
  CalibrationFilesSchema,
  ErrorCode,
  EventSchema,
  FrameSchema,
  HelloReplySchema,
  ReferenceEventSchema,
  ReferenceImageSchema,
  ReplySchema,
  Rights,
  State,
  StatusSchema,
} from "../../gen/dtact_pb";
import type { Frame, Reply } from "../../gen/dtact_pb";
import { CompressedImageSchema } from "../../gen/foxglove_pb";
import type { FromWorker, LumaMap, Request, ToWorker, Wants } from "../session/messages";
import { Spare, unpack } from "../session/unpack";

const FRAMES = "/dtact/frame";
const JPEG = "/camera/jpeg";
const POINTS = "/dtact/points";
const STATUS = "/dtact/status";

/** How far a recording has been played. */
export interface Played {
  seconds: number;
  length: number;
  /** The last frame is shown. */
  ended: boolean;
  /** What could not be read so far; empty when all could. */
  trouble: string;
}

type Message = McapTypes.TypedMcapRecords["Message"];
type ChunkIndex = McapTypes.TypedMcapRecords["ChunkIndex"];

/** A frame, and the camera's picture of it where the recording has one. */
interface Recorded {
  message: Message;
  picture: Message | undefined;
}

class FileBytes implements IReadable {
  constructor(private readonly file: Blob) {}

  size(): Promise<bigint> {
    return Promise.resolve(BigInt(this.file.size));
  }

  async read(offset: bigint, size: bigint): Promise<Uint8Array> {
    if (offset + size > this.file.size) throw new Error("it ends too early");
    const piece = this.file.slice(Number(offset), Number(offset + size));
    return new Uint8Array(await piece.arrayBuffer());
  }
}

/** A reader of a recording, which has read no more than its index. */
const readerOf = (file: Blob): Promise<McapIndexedReader> =>
  McapIndexedReader.Initialize({
    readable: new FileBytes(file),
    decompressHandlers: { zstd: (bytes) => decompress(bytes) },
  });

/** The grey levels of a JPEG. */
async function greyOf(jpeg: Uint8Array): Promise<LumaMap> {
  const bitmap = await createImageBitmap(new Blob([jpeg as BlobPart], { type: "image/jpeg" }));
  const { width, height } = bitmap;
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context?.drawImage(bitmap, 0, 0);
  bitmap.close();
  const rgba = context?.getImageData(0, 0, width, height).data ?? [];
  const part = (at: number): number => rgba[at] ?? 0;
  const values = new Uint8Array(width * height).map((_, i) =>
    Math.round(0.299 * part(4 * i) + 0.587 * part(4 * i + 1) + 0.114 * part(4 * i + 2)),
  );
  return { values, width, height };
}

/** What the reader says, without the name of the program that wrote the file. */
const words = (error: unknown): string =>
  (error as Error).message.replace(/ \[library=.*\]$/s, "").replace(/\.$/, "");

export class Player {
  private readonly spare = new Spare();
  private reader: McapIndexedReader | undefined;
  /** Log times, nanoseconds: of the first and last chunk's bounds, and of the frame shown. */
  private first = 0n;
  private last = 0n;
  private at = 0n;
  private paused = false;
  private ended = false;
  /** A newer run ends the one before. */
  private runs = 0;
  /** The page has not taken the last frame yet; of those that come meanwhile the newest one waits. */
  private underWay = false;
  private waiting: Recorded | undefined;
  /** By the time of a frame, which is met again when played again, and by where a part stands in the file. */
  private readonly broken = new Set<bigint>();
  private readonly damaged = new Set<bigint>();
  private reason = "";
  private shown: Frame | undefined;
  /** Where the reference of the frame shown stands in the file. */
  private reference: bigint | undefined;

  constructor(
    private readonly file: File,
    private wants: Wants,
    private readonly post: (message: FromWorker, memory?: Transferable[]) => void,
  ) {
    void this.open();
  }

  take(message: ToWorker): void {
    switch (message.kind) {
      case "request":
        void this.answer(message.id, message.request);
        break;
      case "taken":
        this.spare.give(message.depth, message.luma);
        this.underWay = false;
        if (this.waiting) void this.show(this.waiting);
        break;
      case "wants":
        this.wants = message.wants;
        if (this.paused) void this.step(0);
        break;
      case "pause":
        this.paused = message.paused;
        ++this.runs;
        if (!this.paused) void this.play(this.ended ? this.first : this.at);
        break;
      case "step":
        if (this.paused) void this.step(message.by);
        break;
      case "seek":
        void this.seek(this.first + BigInt(Math.round(1e9 * message.seconds)));
        break;
    }
  }

  private async open(): Promise<void> {
    let reader: McapIndexedReader | undefined;
    try {
      reader = await readerOf(this.file);
      const topics = [...reader.channelsById.values()];
      const frames = topics.find(({ topic }) => topic === FRAMES);
      if (reader.schemasById.get(frames?.schemaId ?? 0)?.name !== FrameSchema.typeName) {
        const names = topics.map(({ topic }) => topic).join(", ");
        throw new Error(`it has no frames of dtactd, only ${names || "no messages"}`);
      }
      if (reader.chunkIndexes.length === 0) throw new Error("it has no frames");
      const times = reader.chunkIndexes.flatMap((chunk) => [chunk.messageStartTime, chunk.messageEndTime]);
      this.first = times.reduce((a, b) => (a < b ? a : b));
      this.last = times.reduce((a, b) => (a > b ? a : b));
      this.at = this.first;
      this.reader = reader;
      const has = (wanted: string): boolean => topics.some(({ topic }) => topic === wanted);
      const features = ["reference"];
      if (has(JPEG)) features.push("jpeg");
      if (has(POINTS)) features.push("cloud");
      this.post({ kind: "link", link: { state: "live", sentence: "Connected." } });
      const hello = { program: reader.header.library, features, rights: Rights.VIEW };
      this.post({ kind: "hello", hello: create(HelloReplySchema, hello) });
      // It may have been paused while it was opened.
      await this.seek(this.first);
    } catch (error) {
      const whole = " A recording that was cut off is made whole by: mcap recover FILE -o WHOLE.mcap";
      const sentence = `${this.file.name} cannot be played: ${words(error)}.${reader ? "" : whole}`;
      this.post({ kind: "link", link: { state: "ended", sentence } });
    }
  }

  /** What a topic's messages are from a time on, or from it back. A damaged part of the file is left out,
   * from then on. */
  private async *messages(topics: string[], from: bigint, reverse = false): AsyncGenerator<Message> {
    const { reader } = this;
    if (!reader) return;
    let reached = from;
    let given = 0; // messages of that time
    for (;;) {
      const start = reached;
      const parts = reader.chunkIndexes.length;
      let read = 0; // of the time `reached`, since `start`
      try {
        const range = reverse ? { endTime: start } : { startTime: start };
        for await (const message of reader.readMessages({ topics, reverse, ...range })) {
          if (message.logTime !== reached) {
            reached = message.logTime;
            read = given = 0;
          }
          if (++read <= given) continue;
          given = read;
          yield message;
        }
        return;
      } catch (error) {
        this.reason ||= words(error);
        await this.leaveOutDamaged(reached, reverse);
        // Another run may have left out the part that this one met.
        if (reader.chunkIndexes.length === parts) return;
      }
    }
  }

  /** Takes the part of the file that cannot be read from a time on, or from it back, out of the reader's
   * index. */
  private async leaveOutDamaged(time: bigint, reverse: boolean): Promise<void> {
    const all = this.reader?.chunkIndexes as ChunkIndex[];
    const coming = all
      .filter((chunk) => (reverse ? chunk.messageStartTime <= time : chunk.messageEndTime >= time))
      .sort((a, b) =>
        reverse
          ? Number(b.messageEndTime - a.messageEndTime)
          : Number(a.messageStartTime - b.messageStartTime),
      );
    // A reader of its own: the other one may be in use. None where the file itself is gone.
    const alone = await readerOf(this.file).catch(() => undefined);
    if (!alone) return;
    const chunks = alone.chunkIndexes as ChunkIndex[];
    for (const chunk of coming) {
      chunks.splice(0, chunks.length, chunk);
      try {
        for await (const _ of alone.readMessages()) break;
      } catch {
        this.damaged.add(chunk.chunkStartOffset);
        const at = all.findIndex(({ chunkStartOffset }) => chunkStartOffset === chunk.chunkStartOffset);
        if (at >= 0) all.splice(at, 1);
        return;
      }
    }
  }

  /** The frames from a time on. A picture stands before its frame and has the same time. */
  private async *frames(from: bigint): AsyncGenerator<Recorded> {
    const isPicture = new Set(
      [...(this.reader?.channelsById.values() ?? [])]
        .filter(({ topic }) => topic === JPEG)
        .map(({ id }) => id),
    );
    let picture: Message | undefined;
    for await (const message of this.messages([FRAMES, JPEG], from)) {
      if (isPicture.has(message.channelId)) picture = message;
      else
        yield { message, picture: picture?.logTime === message.logTime ? picture : undefined };
    }
  }

  private async play(from: bigint): Promise<void> {
    // Without a reader the file cannot be played, or is still being opened: open() plays it then.
    if (!this.reader) return;
    const run = ++this.runs;
    this.ended = false;
    const began = performance.now();
    for await (const frame of this.frames(from)) {
      const due = began + Number(frame.message.logTime - from) / 1e6 - performance.now();
      if (due > 0) await new Promise((done) => setTimeout(done, due));
      if (run !== this.runs) return;
      this.offer(frame);
    }
    if (run !== this.runs) return;
    this.ended = true;
    this.report();
  }

  /** The first frame from there on, and what follows unless paused. */
  private async seek(to: bigint): Promise<void> {
    if (!this.paused) return this.play(to);
    const run = ++this.runs;
    if (to !== this.at) this.ended = false;
    for await (const frame of this.frames(to)) {
      if (run === this.runs) this.offer(frame);
      return;
    }
  }

  /** Shows a frame again, the one after it or the one before. */
  private async step(by: number): Promise<void> {
    if (by >= 0) return this.seek(by === 0 ? this.at : this.at + 1n);
    const run = ++this.runs;
    for await (const { logTime } of this.messages([FRAMES], this.at - 1n, true)) {
      if (run === this.runs) await this.seek(logTime);
      return;
    }
  }

  private offer(frame: Recorded): void {
    this.at = frame.message.logTime;
    if (this.underWay) this.waiting = frame;
    else void this.show(frame);
  }

  private async show({ message, picture }: Recorded): Promise<void> {
    this.waiting = undefined;
    this.underWay = true;
    this.report();
    try {
      const behind = this.paused ? 0 : undefined;
      const wire = fromBinary(FrameSchema, message.data);
      const frame = unpack(wire, this.spare, undefined, 0, behind);
      this.shown = wire;
      this.followReference();
      if (picture && this.wants.luma)
        frame.luma = await greyOf(fromBinary(CompressedImageSchema, picture.data).data);
      const maps = [frame.depth, frame.luma, frame.cloud];
      this.post(
        { kind: "frame", frame },
        maps.flatMap((map) => (map ? [map.values.buffer] : [])),
      );
    } catch (error) {
      this.broken.add(message.logTime);
      this.reason ||= words(error);
      this.underWay = false;
      this.report();
    }
  }

  /** Tells the page when another reference applies, as a daemon does: after a re-zero, or a jump. */
  private followReference(): void {
    const offset = this.newest("current_reference.png")?.offset;
    const before = this.reference;
    this.reference = offset;
    if (before === undefined || offset === before) return;
    const what = { case: "reference", value: create(ReferenceEventSchema) } as const;
    this.post({ kind: "event", event: create(EventSchema, { what }) });
  }

  private report(): void {
    const missing = [
      [this.broken.size, "frame"],
      [this.damaged.size, "part of the file"],
    ] as const;
    const parts = missing.flatMap(([count, what]) => (count > 0 ? [`${what}: ${count}`] : []));
    const trouble = parts.length > 0 ? `Not readable, ${parts.join(", ")} (${this.reason}).` : "";
    const seconds = Number(this.at - this.first) / 1e9;
    const length = Number(this.last - this.first) / 1e9;
    this.post({ kind: "played", played: { seconds, length, ended: this.ended, trouble } });
  }

  private async answer(id: number, request: Request): Promise<void> {
    const result = await this.resultOf(request).catch(() => undefined);
    const message = "A recording does not answer this.";
    const error = { case: "error", value: { code: ErrorCode.ERROR_UNSUPPORTED, message } } as const;
    const reply = create(ReplySchema, { id: BigInt(id), result: result ?? error });
    this.post({ kind: "reply", id, reply });
  }

  private async resultOf(request: Request): Promise<Reply["result"] | undefined> {
    if (request.case === "getStatus") {
      for await (const { data } of this.reader?.readMessages({ topics: [STATUS] }) ?? []) {
        // That of the beginning; what a frame says of itself is newer.
        const value = fromBinary(StatusSchema, data);
        const { health = value.health, contact } = this.shown ?? {};
        const state = contact ? State.SERVING : value.state;
        return { case: "status", value: { ...value, state, health, advice: "As it was recorded." } };
      }
    }
    if (request.case === "getReference") {
      const png = await this.attached("current_reference.png");
      if (png) return { case: "reference", value: create(ReferenceImageSchema, { png }) };
    }
    if (request.case === "getCalibration") {
      const calibrationToml = await this.attached("calibration.toml");
      const referencePng = await this.attached("reference.png");
      if (calibrationToml && referencePng) {
        const value = create(CalibrationFilesSchema, { calibrationToml, referencePng });
        return { case: "calibration", value };
      }
    }
    return undefined;
  }

  /** The attachment that applies to the frame shown: the newest up to its time, else the first. */
  private newest(name: string): McapTypes.TypedMcapRecords["AttachmentIndex"] | undefined {
    const all = (this.reader?.attachmentIndexes ?? []).filter((one) => one.name === name);
    return all.filter(({ logTime }) => logTime <= this.at).at(-1) ?? all[0];
  }

  private async attached(name: string): Promise<Uint8Array | undefined> {
    const wanted = this.newest(name)?.logTime;
    if (wanted === undefined) return undefined;
    let found: Uint8Array | undefined;
    const times = { startTime: wanted, endTime: wanted };
    for await (const { data } of this.reader?.readAttachments({ name, ...times }) ?? []) found = data;
    return found;
  }
}
