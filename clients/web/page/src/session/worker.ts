// Runs beside the page: holds one sensor's connection, decodes its frames and keeps the last seconds.
// At most one frame is on its way to the page; of those that come meanwhile the newest one waits.
import { create } from "@bufbuild/protobuf";
import { DepthEncoding, LumaEncoding, PingSchema, SubscribeSchema } from "../../gen/dtact_pb";
import type { Frame as WireFrame, HelloReply, Subscribe } from "../../gen/dtact_pb";
import { ClockOffset, nowMs } from "./clock";
import { Connection } from "./connection";
import { History } from "./history";
import type { FromWorker, ToWorker, Wants } from "./messages";
import { Spare, unpack } from "./unpack";

/** The camera's picture is for looking at: half a megabyte each, it comes less often from afar. */
const LUMA_HZ = { nearby: 20, afar: 5 };
/** A Pong must not be mistaken for an answer to the page, whose ids count up from 1. */
const PING_IDS = 2 ** 41;
const SUBSCRIBE_IDS = 2 ** 42;

class Session {
  private wants: Wants;
  private readonly nearby: boolean;
  private readonly connection: Connection;
  private readonly history = new History();
  private readonly clock = new ClockOffset();
  private readonly spare = new Spare();
  private readonly pings = new Map<number, number>();
  private nextId = 0;
  private features: string[] = [];
  /** The page has not taken the last frame yet. */
  private underWay = false;
  private waiting: WireFrame | undefined;
  private gaveWay = 0;
  /** Frames behind the newest that a paused page looks at. */
  private behind: number | undefined;

  constructor(open: ToWorker & { kind: "open" }) {
    this.wants = open.wants;
    this.nearby = open.nearby;
    this.connection = new Connection(open.url, open.program, open.token, {
      link: (link) => post({ kind: "link", link }),
      hello: (hello) => this.greet(hello),
      again: () => this.begin(),
      reply: (id, reply) => {
        const sent = this.pings.get(id);
        if (sent === undefined) {
          if (id < PING_IDS) post({ kind: "reply", id, reply });
        } else if (reply.result.case === "pong") {
          this.clock.add(sent, nowMs(), reply.result.value.monotonicNs);
        }
        this.pings.delete(id);
      },
      unanswered: (id) => {
        if (id < PING_IDS) post({ kind: "unanswered", id });
        this.pings.delete(id);
      },
      event: (event) => post({ kind: "event", event }),
      frame: (frame, bytes) => this.takeFrame(frame, bytes),
    });
    setInterval(() => this.ping(), 1000);
  }

  take(message: ToWorker): void {
    switch (message.kind) {
      case "open":
        break;
      case "token":
        this.connection.retry(message.token);
        break;
      case "wants":
        this.wants = message.wants;
        this.subscribe();
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
      case "step":
        if (this.behind !== undefined) this.step(this.behind - message.by);
        break;
    }
  }

  private greet(hello: HelloReply): void {
    this.features = hello.features;
    post({ kind: "hello", hello });
    this.begin();
  }

  /** Another connection, or another run of the daemon: clock and frames may begin anew. */
  private begin(): void {
    this.clock.clear();
    this.history.clear();
    this.waiting = undefined;
    for (let count = 0; count < 10; ++count) this.ping();
    this.subscribe();
  }

  private ping(): void {
    if (!this.features.includes("ping")) return;
    const id = PING_IDS + ++this.nextId;
    this.pings.set(id, nowMs());
    if (!this.connection.request(id, { case: "ping", value: create(PingSchema) })) {
      this.pings.delete(id);
    }
  }

  /** The cheapest encoding: of bytes from another machine, of work on the same. */
  private encoding(): DepthEncoding {
    if (this.nearby && this.features.includes("rvl")) return DepthEncoding.DEPTH_RVL;
    if (this.features.includes("predict_zstd")) return DepthEncoding.DEPTH_PREDICT_ZSTD;
    return DepthEncoding.DEPTH_DELTA_ZSTD;
  }

  private subscribe(): void {
    const value: Subscribe = create(SubscribeSchema, {
      depth: this.wants.depth ? this.encoding() : DepthEncoding.DEPTH_NONE,
      luma: this.wants.luma ? LumaEncoding.LUMA_GREY8 : LumaEncoding.LUMA_NONE,
      lumaHz: this.nearby ? LUMA_HZ.nearby : LUMA_HZ.afar,
      summary: true,
      pose: this.features.includes("pose"),
    });
    this.connection.request(SUBSCRIBE_IDS + ++this.nextId, { case: "subscribe", value });
  }

  private takeFrame(frame: WireFrame, bytes: number): void {
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
      this.underWay = true;
      post({ kind: "frame", frame: shown }, memory);
    } catch (error) {
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

let session: Session | undefined;
self.onmessage = (message: MessageEvent<ToWorker>) => {
  if (message.data.kind === "open") session = new Session(message.data);
  else session?.take(message.data);
};
