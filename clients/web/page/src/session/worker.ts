// Runs beside the page: holds one sensor's connection, decodes its frames and keeps the last seconds.
// At most one frame is on its way to the page; of those that come meanwhile the newest one waits.
import { create } from "@bufbuild/protobuf";
import type { MessageInitShape } from "@bufbuild/protobuf";
import {
  CloudEncoding,
  DepthEncoding,
  LumaEncoding,
  PingSchema,
  SubscribeSchema,
} from "../../gen/dtact_pb";
import type { Frame as WireFrame, HelloReply, Reply } from "../../gen/dtact_pb";
import { Player } from "../recording/player";
import { Recorder } from "../recording/recorder";
import { ClockOffset, nowMs } from "./clock";
import { Connection } from "./connection";
import { History } from "./history";
import type { FromWorker, Link, Request, ToWorker, Wants } from "./messages";
import { Spare, unpack } from "./unpack";

/** The camera's picture is for looking at: half a megabyte each, it comes less often from afar. */
const LUMA_HZ = { nearby: 20, afar: 5 };
const CLOUD_HZ = { nearby: 30, afar: 10 };
/** What is asked from here must not be mistaken for a request of the page, whose ids count up from 1. */
const OWN_IDS = 2 ** 41;
/** Until a refused subscription is asked for again. */
const RETRY_MS = 5000;
const LOST = "The connection was lost.";

class Session {
  private wants: Wants;
  private readonly nearby: boolean;
  private readonly connection: Connection;
  private readonly history = new History();
  private readonly clock = new ClockOffset();
  private readonly spare = new Spare();
  /** Who waits for an answer to what was asked from here; undefined: none will come. */
  private readonly asked = new Map<number, (reply: Reply | undefined) => void>();
  private nextId = OWN_IDS;
  private features: string[] = [];
  private subscribed: Promise<Reply | undefined> | undefined;
  private retry: ReturnType<typeof setTimeout> | undefined;
  /** The page has not taken the last frame yet. */
  private underWay = false;
  private broken = false; // the newest frame was
  private waiting: WireFrame | undefined;
  private gaveWay = 0;
  private recorder: Recorder | undefined;
  /** Frames behind the newest that a paused page looks at. */
  private behind: number | undefined;

  constructor(open: ToWorker & { kind: "open" }) {
    this.wants = open.wants;
    this.nearby = open.nearby;
    this.connection = new Connection(open.url, open.program, open.token, {
      link: (link) => this.showLink(link),
      hello: (hello) => this.greet(hello),
      reply: (id, reply) => {
        if (!this.answered(id, reply)) post({ kind: "reply", id, reply });
      },
      unanswered: (id) => {
        if (!this.answered(id, undefined)) post({ kind: "unanswered", id });
      },
      event: (event) => {
        this.recorder?.addEvent(event);
        post({ kind: "event", event });
      },
      frame: (frame, bytes) => this.takeFrame(frame, bytes),
    });
    setInterval(() => this.ping(), 1000);
  }

  take(message: ToWorker): void {
    switch (message.kind) {
      case "open":
      case "play":
      case "seek":
        break;
      case "token":
        this.connection.retry(message.token);
        break;
      case "wants":
        this.wants = message.wants;
        void this.subscribe();
        break;
      case "request":
        if (!this.connection.request(message.id, message.request)) {
          post({ kind: "unanswered", id: message.id });
        }
        break;
      case "taken":
        this.spare.give(message.depth, message.luma);
        this.underWay = false;
        if (this.waiting) this.show(this.waiting, undefined);
        break;
      case "pause":
        this.behind = message.paused ? 0 : undefined;
        break;
      case "record":
        if (message.on) this.record();
        else this.stopRecording();
        break;
      case "step":
        if (this.behind !== undefined) this.step(this.behind - message.by);
        break;
    }
  }

  private showLink(link: Link): void {
    if (link.state !== "live") {
      this.stopRecording(LOST);
      // Once the sensor is back, greet() subscribes.
      clearTimeout(this.retry);
    }
    post({ kind: "link", link });
  }

  private greet(hello: HelloReply): void {
    this.features = hello.features;
    post({ kind: "hello", hello });
    // Perhaps another run of the daemon: clock and frames may begin anew.
    this.clock.clear();
    this.history.clear();
    this.waiting = undefined;
    for (let count = 0; count < 10; ++count) this.ping();
    void this.subscribe();
  }

  private ping(): void {
    const sent = nowMs();
    void this.ask({ case: "ping", value: create(PingSchema) }).then((reply) => {
      if (reply?.result.case === "pong") {
        this.clock.add(sent, nowMs(), reply.result.value.monotonicNs);
      }
    });
  }

  private ask(request: Request): Promise<Reply | undefined> {
    const id = ++this.nextId;
    return new Promise((done) => {
      this.asked.set(id, done);
      if (!this.connection.request(id, request)) this.answered(id, undefined);
    });
  }

  /** Whether it was asked from here. */
  private answered(id: number, reply: Reply | undefined): boolean {
    const waiting = this.asked.get(id);
    this.asked.delete(id);
    waiting?.(reply);
    return id > OWN_IDS;
  }

  private record(): void {
    if (this.recorder) return;
    const recorder: Recorder = new Recorder("dtact-web page", {
      ask: (request) => this.ask(request),
      features: () => this.features,
      tell: (recorded) => {
        // Over by itself.
        const over = recorded.file !== undefined || recorded.why !== undefined;
        if (over && this.recorder === recorder) this.forgetRecorder();
        post({ kind: "recorded", recorded });
      },
    });
    this.recorder = recorder;
    this.connection.every = true;
    void this.subscribe().then((reply) => {
      if (reply?.result.case === "done") return recorder.start();
      // Its frames would lack depth or the camera's picture.
      const refused = reply?.result.case === "error" && `${reply.result.value.message}.`;
      void recorder.finish(refused || LOST);
    });
  }

  private stopRecording(why?: string): void {
    void this.recorder?.finish(why);
    this.forgetRecorder();
  }

  private forgetRecorder(): void {
    if (!this.recorder) return;
    this.recorder = undefined;
    this.connection.every = false;
    void this.subscribe();
  }

  /** The answer to the newest: frames are those of an older one until that has come. */
  private subscribe(): Promise<Reply | undefined> {
    // dtact-perceive has points in place of maps.
    const value = create(
      SubscribeSchema,
      this.features.includes("cloud") ? this.points() : this.maps(),
    );
    const answer: Promise<Reply | undefined> = this.ask({ case: "subscribe", value }).then(
      (reply) => (this.subscribed === answer ? reply : this.subscribed),
    );
    this.subscribed = answer;
    clearTimeout(this.retry);
    void answer.then((reply) => {
      if (reply && this.subscribed === answer) this.takeSubscribed(reply);
    });
    return answer;
  }

  private takeSubscribed(reply: Reply): void {
    const refusal = reply.result.case === "error" ? reply.result.value.message : undefined;
    if (refusal !== undefined) this.retry = setTimeout(() => void this.subscribe(), RETRY_MS);
    this.connection.showRefusal(refusal);
  }

  private maps(): MessageInitShape<typeof SubscribeSchema> {
    return {
      depth:
        this.wants.depth || this.recorder
          ? DepthEncoding.DEPTH_PREDICT_ZSTD
          : DepthEncoding.DEPTH_NONE,
      luma: this.wants.luma ? LumaEncoding.LUMA_GREY8 : LumaEncoding.LUMA_NONE,
      lumaHz: this.nearby ? LUMA_HZ.nearby : LUMA_HZ.afar,
      summary: true,
      jpeg: this.recorder !== undefined && this.features.includes("jpeg"),
    };
  }

  private points(): MessageInitShape<typeof SubscribeSchema> {
    return {
      summary: true,
      cloud: CloudEncoding.CLOUD_INT16,
      cloudHz: this.nearby ? CLOUD_HZ.nearby : CLOUD_HZ.afar,
      decimation: 2,
      region: { case: "contactBox", value: true },
      pose: true,
      recognition: this.features.includes("recognition"),
    };
  }

  private takeFrame(frame: WireFrame, bytes: number): void {
    this.recorder?.addFrame(frame);
    // Not shown, and too large to be kept for stepping back.
    delete frame.jpeg;
    if (this.behind !== undefined) return;
    this.history.add(frame, bytes);
    if (this.underWay) {
      if (this.waiting) ++this.gaveWay;
      this.waiting = frame;
    } else {
      this.show(frame, undefined);
    }
  }

  private show(frame: WireFrame, behind: number | undefined): void {
    this.waiting = undefined;
    const dropped = Number(frame.dropped) + this.connection.gaveWay + this.gaveWay;
    try {
      const shown = unpack(frame, this.spare, this.clock.here(frame.monotonicNs), dropped, behind);
      const memory: Transferable[] = [];
      if (shown.depth) memory.push(shown.depth.values.buffer);
      if (shown.luma) memory.push(shown.luma.values.buffer);
      if (shown.cloud) memory.push(shown.cloud.values.buffer);
      this.underWay = true;
      post({ kind: "frame", frame: shown }, memory);
      if (this.broken) this.connection.tell();
      this.broken = false;
    } catch (error) {
      this.broken = true;
      const sentence = `Frame ${frame.sequence} is broken: ${(error as Error).message}.`;
      post({ kind: "link", link: { state: "live", sentence } });
    }
  }

  private step(behind: number): void {
    const found = this.history.behind(behind);
    if (!found) return;
    this.behind = found.behind;
    this.show(found.frame, found.behind);
  }
}

function post(message: FromWorker, memory: Transferable[] = []): void {
  self.postMessage(message, { transfer: memory });
}

let session: Session | Player | undefined;
self.onmessage = (message: MessageEvent<ToWorker>) => {
  if (message.data.kind === "open") session = new Session(message.data);
  else if (message.data.kind === "play") session = new Player(message.data.file, message.data.wants, post);
  else session?.take(message.data);
};
