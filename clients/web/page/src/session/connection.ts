// One sensor's connection: Hello, requests and their answers, and again after it was lost.
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { ClientMessageSchema, ErrorCode, ServerMessageSchema } from "../../gen/dtact_pb";
import type { Event, Frame, HelloReply, Reply } from "../../gen/dtact_pb";
import { framed, unframed } from "../wire/framing";
import type { Link, Request } from "./messages";

interface Listener {
  link(link: Link): void;
  hello(hello: HelloReply): void;
  reply(id: number, reply: Reply): void;
  unanswered(id: number): void;
  event(event: Event): void;
  frame(frame: Frame, bytes: number): void;
}

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;
/** A server that says nothing at all for so long is taken for gone; status is asked once a second. */
const SILENCE_MS = 10_000;
/** Errors before HelloReply that another token fixes: this one is wrong or too long. */
const TOKEN_ERRORS = [ErrorCode.ERROR_DENIED, ErrorCode.ERROR_INVALID, ErrorCode.ERROR_TOO_LARGE];
/** A field of ServerMessage's that is a Frame, as protobuf's tag byte: field 2, length-delimited. */
const FRAME_TAG = 0x12;

/** Requests that the session makes itself have ids above those of the page. */
const HELLO_ID = 2 ** 40;

export class Connection {
  private socket: WebSocket | undefined;
  private waitMs = FIRST_WAIT_MS;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private heardAt = 0;
  private readonly open = new Set<number>();
  private ready = false;
  /** Whether the gateway has the sensor itself, and why not. */
  private reached = true;
  private why = "";
  /** Why the newest subscription was refused; undefined where it was not. */
  private refusal: string | undefined;
  /** Said last by the other end before it ended the connection. */
  private lastWord: string | undefined;
  /** The newest frame not decoded yet; it replaces an older one. */
  private pending: Uint8Array | undefined;
  private readonly later = new MessageChannel();
  /** Frames that gave way here. */
  gaveWay = 0;
  /** No frame is skipped. */
  every = false;

  constructor(
    private readonly url: string,
    private readonly program: string,
    private token: string,
    private readonly listener: Listener,
  ) {
    this.later.port1.onmessage = () => this.takePending();
    setInterval(() => this.watch(), 2000);
    this.connect();
  }

  /** Tries at once with another token. */
  retry(token: string): void {
    this.token = token;
    this.waitMs = FIRST_WAIT_MS;
    this.connect();
  }

  /** Sends a request; false when there is no connection to send it on. */
  request(id: number, request: Request): boolean {
    if (!this.ready) return false;
    this.open.add(id);
    this.send(id, request);
    return true;
  }

  /** Shows a refused subscription with the link; undefined: it was accepted. */
  showRefusal(refusal: string | undefined): void {
    if (refusal === this.refusal) return;
    this.refusal = refusal;
    this.tell();
  }

  private connect(): void {
    clearTimeout(this.timer);
    this.drop();
    this.listener.link({ state: "connecting", sentence: "Connecting to the sensor." });
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heardAt = performance.now();
    this.lastWord = undefined;
    this.reached = true;
    socket.onopen = () => {
      const hello = { major: 1, minor: 1, program: this.program, token: this.token };
      this.send(HELLO_ID, { case: "hello", value: { $typeName: "dtact.v1.Hello", ...hello } });
    };
    socket.onmessage = (message) => {
      this.heardAt = performance.now();
      if (typeof message.data === "string") this.takeNotice(message.data);
      else this.take(new Uint8Array(message.data as ArrayBuffer));
    };
    socket.onclose = () => this.lost();
  }

  private drop(): void {
    const socket = this.socket;
    this.socket = undefined;
    this.ready = false;
    this.refusal = undefined;
    this.pending = undefined;
    if (socket) {
      socket.onopen = socket.onmessage = socket.onclose = null;
      socket.close();
    }
    for (const id of this.open) this.listener.unanswered(id);
    this.open.clear();
  }

  private lost(): void {
    const was = this.lastWord ?? (this.ready ? "The connection was lost." : "Nothing answers.");
    this.drop();
    const seconds = this.waitMs / 1000;
    this.listener.link({
      state: "away",
      sentence: `${was} Trying again in ${seconds} s, and until the sensor is back.`,
    });
    this.timer = setTimeout(() => this.connect(), this.waitMs);
    this.waitMs = Math.min(2 * this.waitMs, LONGEST_WAIT_MS);
  }

  private watch(): void {
    if (this.socket && performance.now() - this.heardAt > SILENCE_MS) {
      this.lastWord = "The sensor has not answered for 10 s.";
      this.lost();
    }
  }

  private send(id: number, request: Request): void {
    const message = create(ClientMessageSchema, { id: BigInt(id), request });
    this.socket?.send(framed(toBinary(ClientMessageSchema, message)));
  }

  /** The gateway's word on whether it has the sensor: its entry of /sensors, as JSON. */
  private takeNotice(text: string): void {
    const { connected, error } = JSON.parse(text) as { connected: boolean; error?: string };
    const back = connected && !this.reached;
    this.reached = connected;
    this.why = error ?? "";
    // Its features and rights may differ from those in this connection's HelloReply.
    if (back) return this.connect();
    this.tell();
  }

  tell(): void {
    if (!this.ready) return;
    const why = this.why && `: ${this.why}`;
    const away = `The sensor is away${why}. It goes on by itself when it is back.`;
    const live =
      this.refusal === undefined
        ? "Connected."
        : `The subscription was refused: ${this.refusal}. Asking again every few seconds.`;
    this.listener.link(
      this.reached ? { state: "live", sentence: live } : { state: "away", sentence: away },
    );
  }

  private take(bytes: Uint8Array): void {
    let message: Uint8Array;
    try {
      message = unframed(bytes);
    } catch (error) {
      this.lastWord = `The stream is broken: ${(error as Error).message}.`;
      return this.lost();
    }
    // Answers and events stay between the frames that they came between.
    if (this.every) this.takePending();
    if (message[0] !== FRAME_TAG) return this.takeWord(message);
    if (this.every) return this.deliver(message);
    if (this.pending) ++this.gaveWay;
    // Behind what has come meanwhile, so that of several frames that wait the newest is decoded.
    else this.later.port2.postMessage(null);
    this.pending = message;
  }

  private takePending(): void {
    const message = this.pending;
    this.pending = undefined;
    if (message && this.ready) this.deliver(message);
  }

  private deliver(message: Uint8Array): void {
    const body = fromBinary(ServerMessageSchema, message).body;
    if (body.case === "frame") this.listener.frame(body.value, message.length);
  }

  private takeWord(message: Uint8Array): void {
    const body = fromBinary(ServerMessageSchema, message).body;
    if (body.case === "event") return this.listener.event(body.value);
    if (body.case !== "reply") return;
    const reply = body.value;
    const id = Number(reply.id);
    if (id === HELLO_ID || id === 0) return this.takeGreeting(reply);
    if (this.open.delete(id)) this.listener.reply(id, reply);
  }

  private takeGreeting(reply: Reply): void {
    if (reply.result.case === "hello") {
      this.ready = true;
      this.waitMs = FIRST_WAIT_MS;
      this.tell();
      return this.listener.hello(reply.result.value);
    }
    if (reply.result.case !== "error") return;
    const { code, message } = reply.result.value;
    if (TOKEN_ERRORS.includes(code) && !this.ready) {
      this.drop();
      this.listener.link({ state: "token", sentence: message });
    } else if (code === ErrorCode.ERROR_VERSION) {
      this.drop();
      this.listener.link({ state: "ended", sentence: message });
    } else {
      this.lastWord = message;
    }
  }
}
