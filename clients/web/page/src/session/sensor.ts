// One sensor as the page sees it: its worker's messages, and requests as promises.
import { create } from "@bufbuild/protobuf";
import { GetStatusSchema, Rights } from "../../gen/dtact_pb";
import type { Event, HelloReply, Reply, Status } from "../../gen/dtact_pb";
import type { Played } from "../recording/player";
import type { Recorded } from "../recording/recorder";
import type { Frame, FromWorker, Link, Request, ToWorker, Wants } from "./messages";

/** An answer that says why not. */
export class Refusal extends Error {
  constructor(
    readonly code: number,
    message: string,
  ) {
    super(message);
  }
}

type Result = Exclude<Reply["result"], { case: "error" } | { case: undefined }>;

interface Watcher {
  link(link: Link): void;
  hello(hello: HelloReply): void;
  /** The newest frame, at most once a drawn picture; false: it is not shown, the one before stays. */
  frame(frame: Frame): boolean;
  event(event: Event): void;
  status(status: Status): void;
  recorded(recorded: Recorded): void;
  played(played: Played): void;
}

const HERE = ["localhost", "127.0.0.1", "[::1]"];

export class Sensor {
  private readonly worker = new Worker("worker.js", { type: "module" });
  private readonly waiting = new Map<
    number,
    { done: (result: Result) => void; failed: (error: Error) => void }
  >();
  private nextId = 0;
  private readonly asking: ReturnType<typeof setInterval>;
  private depth: Int16Array | undefined;
  private luma: Uint8Array | undefined;
  rights: Rights = Rights.UNSPECIFIED;
  features: string[] = [];

  constructor(
    readonly name: string,
    private token: string,
    wants: Wants,
    private readonly watcher: Watcher,
    recording?: File,
  ) {
    this.worker.onmessage = (message: MessageEvent<FromWorker>) => this.take(message.data);
    if (recording) this.send({ kind: "play", file: recording, wants });
    else this.send({
      kind: "open",
      url: this.address("wire"),
      program: "dtact-web page",
      token,
      nearby: HERE.includes(location.hostname),
      wants,
    });
    this.asking = setInterval(() => void this.askStatus(), 1000);
  }

  get mayControl(): boolean {
    return this.rights !== Rights.VIEW;
  }

  get mayCalibrate(): boolean {
    return this.mayControl && this.rights !== Rights.CONTROL;
  }

  /** A WebSocket that the gateway has for this sensor, beside the page: a proxy may serve it below a path. */
  private address(what: string): string {
    const url = new URL(`sensors/${encodeURIComponent(this.name)}/${what}`, document.baseURI);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    return url.href;
  }

  /** Address of the guided calibration. */
  get calibrateAddress(): string {
    const token = this.token && `?token=${encodeURIComponent(this.token)}`;
    return this.address("calibrate") + token;
  }

  useToken(token: string): void {
    this.token = token;
    this.send({ kind: "token", token });
  }

  want(wants: Wants): void {
    this.send({ kind: "wants", wants });
  }

  pause(paused: boolean): void {
    this.send({ kind: "pause", paused });
  }

  /** Plays a recording from there on. */
  seek(seconds: number): void {
    this.send({ kind: "seek", seconds });
  }

  /** Begins a recording, or ends it: its file comes with recorded(). */
  record(on: boolean): void {
    this.send({ kind: "record", on });
  }

  /** Shows a later frame of those that are kept, or an earlier one. */
  step(by: number): void {
    this.send({ kind: "step", by });
  }

  close(): void {
    clearInterval(this.asking);
    this.worker.terminate();
  }

  /** Rejects with a Refusal, or an Error where the connection is gone. */
  request(request: Request): Promise<Result> {
    const id = ++this.nextId;
    this.send({ kind: "request", id, request });
    return new Promise((done, failed) => this.waiting.set(id, { done, failed }));
  }

  private async askStatus(): Promise<void> {
    try {
      const result = await this.request({ case: "getStatus", value: create(GetStatusSchema) });
      if (result.case === "status") this.watcher.status(result.value);
    } catch {
      // The link says that it is gone; a refused status is asked for again.
    }
  }

  private send(message: ToWorker, memory: Transferable[] = []): void {
    this.worker.postMessage(message, memory);
  }

  private take(message: FromWorker): void {
    switch (message.kind) {
      case "link":
        return this.watcher.link(message.link);
      case "hello":
        this.rights = message.hello.rights;
        this.features = message.hello.features;
        return this.watcher.hello(message.hello);
      case "event":
        return this.watcher.event(message.event);
      case "recorded":
        return this.watcher.recorded(message.recorded);
      case "played":
        return this.watcher.played(message.played);
      case "frame":
        return this.takeFrame(message.frame);
      case "reply": {
        const asked = this.waiting.get(message.id);
        this.waiting.delete(message.id);
        const result = message.reply.result;
        if (result.case === "error")
          asked?.failed(new Refusal(result.value.code, result.value.message));
        else if (result.case) asked?.done(result);
        return;
      }
      case "unanswered":
        this.waiting.get(message.id)?.failed(new Error("The sensor is away."));
        this.waiting.delete(message.id);
        return;
    }
  }

  /** Shows it with the next picture, and then asks for another one with the memory of the last. */
  private takeFrame(frame: Frame): void {
    const show = (): void => {
      const shown = this.watcher.frame(frame);
      const back = { depth: frame.depth?.values, luma: frame.luma?.values };
      if (shown) {
        [this.depth, back.depth] = [back.depth ?? this.depth, back.depth && this.depth];
        [this.luma, back.luma] = [back.luma ?? this.luma, back.luma && this.luma];
      }
      const memory = [back.depth, back.luma].flatMap((map) => (map ? [map.buffer] : []));
      this.send({ kind: "taken", ...back }, memory);
    };
    // A page in the background draws nothing, and would leave the frames standing.
    if (document.hidden) show();
    else requestAnimationFrame(show);
  }
}
