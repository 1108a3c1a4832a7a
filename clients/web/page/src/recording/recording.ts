// A recording as dtactctl makes it, in the browser: clients/recording/README.md says what it holds.
import { create, toBinary } from "@bufbuild/protobuf";
import type { DescMessage, MessageShape } from "@bufbuild/protobuf";
import type { GenFile } from "@bufbuild/protobuf/codegenv2";
import { FileDescriptorSetSchema, TimestampSchema } from "@bufbuild/protobuf/wkt";
import { McapWriter } from "@mcap/core";
import { EventSchema, FrameSchema, LightStateSchema, StatusSchema } from "../../gen/dtact_pb";
import type { DepthMap, Event, Frame, Status } from "../../gen/dtact_pb";
import { CompressedImageSchema, RawImageSchema } from "../../gen/foxglove_pb";
import { decodeDepth } from "../wire/depth";
import { GrowingFile } from "./file";

const CHUNK_BYTES = 4 * 1024 * 1024;
const SECOND_NS = 1_000_000_000n;
/** Between depth pictures for viewing: ten a second, as dtactctl's. */
const PICTURE_NS = SECOND_NS / 10n;

/** What describes frames beside themselves. */
interface Attachment {
  name: "calibration.toml" | "reference.png" | "current_reference.png";
  mediaType: string;
  data: Uint8Array;
}

interface Moment {
  logTime: bigint;
  publishTime: bigint;
  sequence: number;
}

interface Stamped {
  sequence: bigint;
  monotonicNs: bigint;
  wallNs: bigint;
}

/** Micrometres as little-endian uint16, 0 where less or untrusted. */
function pixelsOf(map: DepthMap): Uint8Array {
  const values = new Int16Array(map.width * map.height);
  decodeDepth(map.encoding, map.data, map.width, map.height, values);
  const pixels = new DataView(new ArrayBuffer(2 * values.length));
  values.forEach((value, at) => {
    const um = value === map.untrustedValue ? 0 : Math.round(value * map.umPerUnit);
    pixels.setUint16(2 * at, Math.min(Math.max(um, 0), 65535), true);
  });
  return new Uint8Array(pixels.buffer);
}

/** A file's descriptor and those of all that it imports, these first. */
function withImports(file: GenFile, known: Set<string>): GenFile["proto"][] {
  if (known.has(file.name)) return [];
  known.add(file.name);
  return [...file.dependencies.flatMap((needed) => withImports(needed, known)), file.proto];
}

export class Recording {
  frames = 0;
  private readonly file = new GrowingFile();
  private readonly writer = new McapWriter({ writable: this.file, chunkSize: CHUNK_BYTES });
  /** The writer does one thing after another. */
  private last: Promise<unknown> = Promise.resolve();
  private readonly channels = new Map<string, Promise<number>>();
  /** Wall time of the monotonic clock's zero, at what came first. */
  private epochNs: bigint | undefined;
  private now: Moment = { logTime: 0n, publishTime: 0n, sequence: 0 };
  private first = 0n;
  private newest = 0n;
  private lastLight = "";
  private pictureDueNs: bigint | undefined;
  /** These wait for the first frame. */
  private status: Status | undefined;
  private attachments: Attachment[] = [];

  constructor(program: string) {
    void this.queue(() => this.writer.start({ profile: "", library: program }));
  }

  get bytes(): number {
    return this.file.bytes;
  }

  /** Frames between the first one and the newest that are not in the file. */
  get missed(): number {
    return this.frames === 0 ? 0 : Number(this.newest - this.first) + 1 - this.frames;
  }

  addFrame(frame: Frame): void {
    this.now = this.momentOf(frame);
    const { jpeg, ...rest } = frame;
    // Only the page's view asked for it; the JPEG is the same picture.
    delete rest.luma;
    const timestamp = create(TimestampSchema, {
      seconds: this.now.logTime / SECOND_NS,
      nanos: Number(this.now.logTime % SECOND_NS),
    });
    const { depth, frameId, monotonicNs } = frame;
    const due = this.pictureDueNs ?? monotonicNs;
    if (depth && monotonicNs >= due) {
      // From the time it was due on, so that the mean rate is ten; from now after a gap.
      const newest = monotonicNs - PICTURE_NS + 1n;
      this.pictureDueNs = (due > newest ? due : newest) + PICTURE_NS;
      const { width, height } = depth;
      const size = { width, height, step: 2 * width, encoding: "16UC1" };
      const picture = { timestamp, frameId, ...size, data: pixelsOf(depth) };
      this.add("/dtact/depth", RawImageSchema, create(RawImageSchema, picture));
    }
    if (jpeg) {
      const picture = { timestamp, frameId: "dtact_camera", data: jpeg.data, format: "jpeg" };
      this.add("/camera/jpeg", CompressedImageSchema, create(CompressedImageSchema, picture));
    }
    if (frame.light) {
      const light = toBinary(LightStateSchema, frame.light).join();
      if (light !== this.lastLight) this.add("/dtact/light", LightStateSchema, frame.light);
      this.lastLight = light;
    }
    this.add("/dtact/frame", FrameSchema, rest);
    if (this.frames++ === 0) {
      this.first = frame.sequence;
      if (this.status) this.add("/dtact/status", StatusSchema, this.status);
    }
    this.newest = frame.sequence;
    for (const attachment of this.attachments.splice(0)) this.put(attachment);
  }

  addEvent(event: Event): void {
    this.now = this.momentOf(event);
    this.add("/dtact/event", EventSchema, event);
  }

  /** Value at the first frame. */
  addStatus(status: Status): void {
    if (this.frames === 0) this.status = status;
    else this.add("/dtact/status", StatusSchema, status);
  }

  attach(attachment: Attachment): void {
    if (this.frames === 0) this.attachments.push(attachment);
    else this.put(attachment);
  }

  /** Nothing may be added any more. */
  async finish(): Promise<Blob> {
    await this.queue(() => this.writer.end());
    return this.file.whole();
  }

  private momentOf({ sequence, monotonicNs, wallNs }: Stamped): Moment {
    this.epochNs ??= wallNs - monotonicNs;
    return {
      logTime: this.epochNs + monotonicNs,
      publishTime: wallNs,
      sequence: Number(sequence & 0xffffffffn),
    };
  }

  private queue<T>(step: () => Promise<T>): Promise<T> {
    const done = this.last.then(step);
    // A failure fails all queued writes; finish() reports it.
    done.catch(() => {});
    this.last = done;
    return done;
  }

  private put(attachment: Attachment): void {
    const { logTime } = this.now;
    void this.queue(() =>
      this.writer.addAttachment({ logTime, createTime: logTime, ...attachment }),
    );
  }

  private add<D extends DescMessage>(topic: string, schema: D, message: MessageShape<D>): void {
    const data = toBinary(schema, message);
    const { now } = this;
    void this.queue(async () => {
      const channelId = await this.channelOf(topic, schema);
      await this.writer.addMessage({ channelId, ...now, data });
    });
  }

  private channelOf(topic: string, type: DescMessage): Promise<number> {
    const known = this.channels.get(topic);
    if (known) return known;
    const file = withImports(type.file as GenFile, new Set());
    const data = toBinary(FileDescriptorSetSchema, create(FileDescriptorSetSchema, { file }));
    const made = this.writer
      .registerSchema({ name: type.typeName, encoding: "protobuf", data })
      .then((schemaId) =>
        this.writer.registerChannel({
          schemaId,
          topic,
          messageEncoding: "protobuf",
          metadata: new Map(),
        }),
      );
    this.channels.set(topic, made);
    return made;
  }
}
