// What the page and the worker that holds a sensor's connection say to each other.
import type {
  ClientMessage,
  Contact,
  Event,
  HelloReply,
  LightState,
  ObjectPose,
  Recognition,
  Reply,
} from "../../gen/dtact_pb";
import type { ContactAbsence, Health } from "../../gen/dtact_pb";
import type { Played } from "../recording/player";
import type { Recorded } from "../recording/recorder";
import type { Viewpoint } from "../view/overlay";

/** Which parts of a frame the page shows at present. */
export interface Wants {
  depth: boolean;
  luma: boolean;
}

/** A request as the wire has it: a case of ClientMessage and its value. */
export type Request = Exclude<ClientMessage["request"], { case: undefined }>;

/** A map of depth, with the memory that holds it. */
export interface DepthMap {
  values: Int16Array;
  width: number;
  height: number;
  mmPerPx: number;
  viewpoint: Viewpoint;
  /** Micrometres a unit. */
  umPerUnit: number;
  untrusted: number;
  uncertaintyUm: number;
  decimation: number;
  sharpenSteps: number;
}

export interface LumaMap {
  values: Uint8Array;
  width: number;
  height: number;
}

/** Points with normals, in the surface frame, on a grid of pixels; of dtact-perceive alone. */
export interface Cloud {
  /** x, y, z in units, then the normals in 1/32767: six arrays of width * height. -32768: no point. */
  values: Int16Array;
  width: number;
  height: number;
  mmPerUnit: number;
  /** Number of points. */
  points: number;
}

export interface Frame {
  sequence: number;
  /** UTC, milliseconds since 1970, by the daemon's clock. */
  wallMs: number;
  /** When it was captured, milliseconds by this page's clock; undefined while that is not known. */
  capturedMs: number | undefined;
  health: Health[];
  contact: Contact | undefined;
  contactAbsence: ContactAbsence;
  light: LightState | undefined;
  calibration: number | undefined;
  depth: DepthMap | undefined;
  luma: LumaMap | undefined;
  /** Only dtact-perceive sends pose, recognition and cloud. */
  pose: ObjectPose | undefined;
  recognition: Recognition | undefined;
  cloud: Cloud | undefined;
  /** What making the depth took, milliseconds, and at which share of the resolution: 1, 2 or 4. */
  madeMs: number;
  madeDecimation: number;
  /** Root mean square of trusted depth, micrometres, without contact; not of every frame. */
  noContactRmsUm: number | undefined;
  /** Frames that were missed since the connection was made: by the daemon's count, and here. */
  dropped: number;
  /** How far behind the newest one that is kept, of a paused view; undefined of a live one. */
  behind: number | undefined;
}

/** Where a connection stands; `sentence` says it, and what to do. */
export interface Link {
  state: "connecting" | "live" | "away" | "token" | "ended";
  sentence: string;
}

export type ToWorker =
  | { kind: "open"; url: string; program: string; token: string; nearby: boolean; wants: Wants }
  /** In place of "open": a recording. */
  | { kind: "play"; file: File; wants: Wants }
  | { kind: "seek"; seconds: number }
  | { kind: "token"; token: string }
  | { kind: "wants"; wants: Wants }
  | { kind: "request"; id: number; request: Request }
  /** The page has taken a frame and gives memory back that it does not show any more. */
  | { kind: "taken"; depth: Int16Array | undefined; luma: Uint8Array | undefined }
  | { kind: "pause"; paused: boolean }
  | { kind: "record"; on: boolean }
  | { kind: "step"; by: number };

export type FromWorker =
  | { kind: "link"; link: Link }
  | { kind: "hello"; hello: HelloReply }
  | { kind: "frame"; frame: Frame }
  | { kind: "event"; event: Event }
  | { kind: "recorded"; recorded: Recorded }
  | { kind: "played"; played: Played }
  | { kind: "reply"; id: number; reply: Reply }
  /** A request that will have no answer: the connection is gone. */
  | { kind: "unanswered"; id: number };
