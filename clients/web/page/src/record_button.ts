// Starts and ends a recording, says how far it is, and hands its file over.
import { button, el, say } from "./dom";
import type { Recorded } from "./recording/recorder";
import type { Sensor } from "./session/sensor";
import { fixed, span } from "./words";

const MB = 1e6;

export class RecordButton {
  private readonly press = button("Record", () => this.toggle(), {
    title: "An MCAP file of frames, the camera's pictures and events (R)",
    "aria-pressed": "false",
    disabled: "",
  });
  private readonly told = el("span", { class: "quiet", role: "status", "data-fact": "recording" });
  readonly element = el("span", { class: "row" }, this.press, this.told);
  private recording = false;
  private allowed = false;

  constructor(private readonly sensor: Sensor) {
    addEventListener("beforeunload", (event) => {
      // Asks whether the file is to be lost.
      if (this.recording) event.preventDefault();
    });
  }

  /** Recording is for as long as there are frames. */
  allow(allowed: boolean): void {
    this.allowed = allowed;
    this.show(this.recording);
  }

  toggle(): void {
    if (this.press.disabled) return;
    this.show(!this.recording);
    if (this.recording) say(this.told, "");
    this.sensor.record(this.recording);
  }

  tell(recorded: Recorded): void {
    const { frames, missed, bytes, seconds, file, why } = recorded;
    const lost = missed === 0 ? "none missed" : `${missed} missed`;
    say(this.told, `${span(seconds)} · ${fixed(bytes / MB, 1)} MB · ${lost}`);
    if (!file && !why) return;
    this.show(false);
    const reason = why ? `${why} ` : "";
    if (!file) return say(this.told, why ?? "");
    if (frames === 0) return say(this.told, `${reason}Nothing is recorded: no frame came.`);
    const time = new Date(Date.now() - 1000 * seconds).toISOString().slice(0, 19);
    const url = URL.createObjectURL(file);
    const name = `${this.sensor.name}-${time.replaceAll(":", "")}Z.mcap`;
    el("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
    say(this.told, `${reason}${name}: ${frames} frames, ${lost}, ${fixed(bytes / MB, 1)} MB`);
  }

  private show(recording: boolean): void {
    this.recording = recording;
    say(this.press, recording ? "Stop" : "Record");
    this.press.setAttribute("aria-pressed", String(recording));
    // One that runs can be ended, whatever the link.
    this.press.disabled = !this.allowed && !recording;
  }
}
