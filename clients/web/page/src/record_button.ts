// Starts and ends a recording, says how far it is, and hands its file over.
import { button, el, say } from "./dom";
import type { Recorded } from "./recording/recorder";
import type { Sensor } from "./session/sensor";
import { fixed, span } from "./labels";

const MB = 1e6;

function missedOf({ missed }: Recorded): string {
  return missed === 0 ? "none missed" : `${missed} missed`;
}

export class RecordButton {
  private readonly press = button("Record", () => this.toggle(), {
    title: "An MCAP file of frames, the camera's pictures and events (R)",
    "aria-pressed": "false",
    disabled: "",
  });
  private readonly reported = el("span", { class: "quiet", role: "status", "data-fact": "recording" });
  readonly element = el("span", { class: "row" }, this.press, this.reported);
  /** Ending: its file is still to come. */
  private state: "idle" | "recording" | "ending" = "idle";
  private allowed = false;
  private ended = (): void => {};
  private readonly keep = (event: BeforeUnloadEvent): void => {
    // Asks whether the file is to be lost.
    if (this.state !== "idle") event.preventDefault();
  };

  constructor(private readonly sensor: Sensor) {
    addEventListener("beforeunload", this.keep);
  }

  /** Recording is for as long as there are frames. */
  allow(allowed: boolean): void {
    this.allowed = allowed;
    this.show(this.state);
  }

  toggle(): void {
    if (this.press.disabled) return;
    const begins = this.state === "idle";
    this.show(begins ? "recording" : "ending");
    if (begins) say(this.reported, "");
    this.sensor.record(begins);
  }

  /** Ends the recording; done when its file is saved. */
  async close(): Promise<void> {
    const over = new Promise<void>((done) => (this.ended = done));
    if (this.state === "recording") this.toggle();
    if (this.state !== "idle") await over;
    removeEventListener("beforeunload", this.keep);
  }

  tell(recorded: Recorded): void {
    const { bytes, seconds, file, why } = recorded;
    say(this.reported, `${span(seconds)} · ${fixed(bytes / MB, 1)} MB · ${missedOf(recorded)}`);
    if (!file && !why) return;
    this.show("idle");
    this.handOver(recorded);
    this.ended();
  }

  private handOver(recorded: Recorded): void {
    const { frames, bytes, seconds, file, why } = recorded;
    const reason = why ? `${why} ` : "";
    if (!file) return say(this.reported, why ?? "");
    if (frames === 0) return say(this.reported, `${reason}Nothing is recorded: no frame came.`);
    const time = new Date(Date.now() - 1000 * seconds).toISOString().slice(0, 19);
    const url = URL.createObjectURL(file);
    const name = `${this.sensor.name}-${time.replaceAll(":", "")}Z.mcap`;
    el("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
    say(
      this.reported,
      `${reason}${name}: ${frames} frames, ${missedOf(recorded)}, ${fixed(bytes / MB, 1)} MB`,
    );
  }

  private show(state: typeof this.state): void {
    this.state = state;
    const recording = state === "recording";
    say(this.press, recording ? "Stop" : "Record");
    this.press.setAttribute("aria-pressed", String(recording));
    // What runs can be ended whatever the link; another one begins once its file has come.
    this.press.disabled = state === "ending" || (state === "idle" && !this.allowed);
  }
}
