// Records what a session receives: subscribes to what a recording needs, fetches what depth is made
// by, and reports its progress.
import { create } from "@bufbuild/protobuf";
import { GetCalibrationSchema, GetReferenceSchema, GetStatusSchema } from "../../gen/dtact_pb";
import type { Event, Frame, Reply } from "../../gen/dtact_pb";
import type { Request } from "../session/messages";
import { Recording } from "./recording";

/** A browser that is to keep more may keep nothing. */
const MAX_BYTES = 2 ** 30;
const REPORT_MS = 250;

/** How far a recording is; with its file once it is over. */
export interface Recorded {
  frames: number;
  missed: number;
  bytes: number;
  seconds: number;
  file?: Blob;
  /** The reason when it ended by itself. */
  why?: string;
}

interface Source {
  /** Undefined where no answer will come. */
  ask(request: Request): Promise<Reply | undefined>;
  features(): string[];
  tell(recorded: Recorded): void;
}

export class Recorder {
  private readonly recording: Recording;
  private began: number | undefined;
  private reportedAt = 0;
  private over = false;

  constructor(
    program: string,
    private readonly source: Source,
  ) {
    this.recording = new Recording(program);
    void this.fetchStatus();
    void this.fetchFiles();
  }

  /** Frames count from here on: what came before was asked for otherwise. */
  start(): void {
    this.began = performance.now();
  }

  addFrame(frame: Frame): void {
    if (this.over || this.began === undefined) return;
    this.recording.addFrame(frame);
    const now = performance.now();
    if (this.recording.bytes > MAX_BYTES) {
      void this.finish(
        "1 GB is recorded, which is all that a browser is asked to keep; dtactctl record has no limit.",
      );
    } else if (now - this.reportedAt > REPORT_MS) {
      this.reportedAt = now;
      this.source.tell(this.state());
    }
  }

  addEvent(event: Event): void {
    if (this.over) return;
    this.recording.addEvent(event);
    const { case: what } = event.what;
    if (what === "calibration" || what === "reference") void this.fetchFiles();
  }

  async finish(why?: string): Promise<void> {
    if (this.over) return;
    this.over = true;
    const state = this.state();
    try {
      const file = await this.recording.finish();
      this.source.tell({ ...state, bytes: file.size, file, ...(why && { why }) });
    } catch (error) {
      this.source.tell({ ...state, why: `The recording is lost: ${(error as Error).message}.` });
    }
  }

  private state(): Recorded {
    const { frames, missed, bytes } = this.recording;
    const now = performance.now();
    return { frames, missed, bytes, seconds: (now - (this.began ?? now)) / 1000 };
  }

  private async fetchStatus(): Promise<void> {
    const value = create(GetStatusSchema);
    const reply = await this.source.ask({ case: "getStatus", value });
    if (reply?.result.case === "status" && !this.over) this.recording.addStatus(reply.result.value);
  }

  /** What depth is made by from here on; refused where there is none, or not yet. */
  private async fetchFiles(): Promise<void> {
    const asked = create(GetCalibrationSchema);
    const calibration = await this.source.ask({ case: "getCalibration", value: asked });
    if (calibration?.result.case === "calibration" && !this.over) {
      const { calibrationToml, referencePng } = calibration.result.value;
      const mediaType = "application/toml";
      this.recording.attach({ name: "calibration.toml", mediaType, data: calibrationToml });
      this.recording.attach({ name: "reference.png", mediaType: "image/png", data: referencePng });
    }
    if (!this.source.features().includes("reference")) return;
    const value = create(GetReferenceSchema);
    const reference = await this.source.ask({ case: "getReference", value });
    if (reference?.result.case !== "reference" || this.over) return;
    const data = reference.result.value.png;
    this.recording.attach({ name: "current_reference.png", mediaType: "image/png", data });
  }
}
