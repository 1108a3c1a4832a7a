// One sensor: its picture, its panels, and what its connection says.
import { create } from "@bufbuild/protobuf";
import { GetReferenceSchema, Health, State } from "../gen/dtact_pb";
import type { Event, HelloReply, Status } from "../gen/dtact_pb";
import { button, Choice, el, say } from "./dom";
import { keepToken, keptToken } from "./kept";
import { Meter } from "./meter";
import { CalibrationsPanel } from "./panels/calibrations";
import { CameraPanel } from "./panels/camera";
import { ContactPanel } from "./panels/contact";
import { LightPanel } from "./panels/light";
import { ObjectsPanel } from "./panels/objects";
import { Plots, ProfilePlot } from "./panels/plots";
import { QualityPanel } from "./panels/quality";
import { ReconstructionPanel } from "./panels/reconstruction";
import type { Played } from "./recording/player";
import { RecordButton } from "./record_button";
import type { Frame, Link, Wants } from "./session/messages";
import { Sensor } from "./session/sensor";
import { Timeline } from "./timeline";
import { saveSnapshot } from "./snapshot";
import type { CloudView } from "./surface/cloud";
import type { SurfaceView } from "./surface/surface";
import { RangeForm } from "./view/range_form";
import { isPicture, Stage } from "./view/stage";
import type { Tool, View } from "./view/stage";
import { fixed } from "./labels";

/** Update interval of numbers that change with every frame: faster is unreadable. */
const REPORT_MS = 100;

/** From frame to frame the camera's picture may be left out, when it comes less often. */
const OLD_MS = 1000;

const KEYS_OF_POINTS = [" ", "ArrowLeft", "ArrowRight"];

const NO_REFERENCE = "No reference: ";

const RELOAD = "A part of the page could not be loaded. Reload it: dtact-web was updated, or is away.";

export class Pane {
  readonly element: HTMLElement;
  private readonly stage = new Stage();
  private readonly sensor: Sensor;
  private readonly contact = new ContactPanel();
  private readonly quality = new QualityPanel();
  private readonly light: LightPanel;
  private readonly camera: CameraPanel;
  private readonly calibrations: CalibrationsPanel;
  private readonly objects: ObjectsPanel;
  private readonly reconstruction: ReconstructionPanel;
  private readonly recording: RecordButton;
  private readonly plots = new Plots();
  private readonly profile = new ProfilePlot();
  private readonly meter = new Meter();
  private readonly notice = el("p", { class: "notice", role: "status" });
  private readonly rate = el("span", { class: "rate", "data-fact": "rate" });
  private readonly state = el("span", { class: "link" }, "connecting");
  private readonly tokenForm = this.makeTokenForm();
  private readonly pauseButton = button("Pause", () => this.pause(!this.paused), {
    title: "Space",
  });
  private readonly snapshotButton = button("Snapshot", () => void this.snapshot(), {
    title: "A PNG with time and settings (S)",
  });
  private readonly timeline = new Timeline(this.pauseButton, (seconds) => this.sensor.seek(seconds));
  private readonly steps = el("span", { class: "row steps", hidden: "" });
  private readonly behind = el("span", { class: "quiet" });
  private readonly range: RangeForm;
  private readonly commands = el("div", { class: "side commands" });
  private readonly calibrate = button("Calibrate…", () => void this.calibrations.guide());
  private readonly views: Choice<View>;
  private readonly tools: Choice<Tool>;
  private surface: SurfaceView | undefined;
  private cloud: CloudView | undefined;
  private frame: Frame | undefined;
  private lastStatus: Status | undefined;
  private servesPoints = false;
  private paused = false;
  private closed = false;
  private reportedAt = 0;

  /** Of a sensor, or of a recording named so. Throws where the browser has no WebGL 2. */
  constructor(
    readonly name: string,
    private readonly file?: File,
  ) {
    this.range = new RangeForm(name, (range, outlineMm) => {
      if (range) this.stage.range = range;
      if (outlineMm !== undefined) this.stage.outlineMm = outlineMm;
    });
    this.views = new Choice<View>(
      "View",
      { depth: "Depth", camera: "Camera", difference: "Difference", surface: "Surface" },
      "depth",
      (view) => void this.look(view),
    );
    this.tools = new Choice<Tool>("Tool", { point: "Point", line: "Line" }, "point", (tool) =>
      this.stage.use(tool),
    );
    this.sensor = new Sensor(name, keptToken(name), this.wants(), {
      link: (link) => this.link(link),
      hello: (hello) => this.hello(hello),
      frame: (frame) => this.show(frame),
      event: (event) => this.event(event),
      status: (status) => this.status(status),
      recorded: (recorded) => this.recording.tell(recorded),
      played: (played) => this.played(played),
    }, file);
    this.light = new LightPanel(this.sensor);
    this.camera = new CameraPanel(this.sensor);
    this.calibrations = new CalibrationsPanel(this.sensor, () => this.stage.cameraLine);
    this.objects = new ObjectsPanel(this.sensor);
    this.reconstruction = new ReconstructionPanel(this.sensor);
    this.recording = new RecordButton(this.sensor);
    this.steps.append(
      button("◂", () => this.sensor.step(-1), { "aria-label": "One frame back" }),
      button("▸", () => this.sensor.step(1), { "aria-label": "One frame on" }),
      this.behind,
    );
    this.element = this.build();
    this.stage.profiled = (profile) => this.profile.show(profile, this.stage.range);
    this.stage.look("depth");
    this.stage.cover("Waiting for the first frame.");
  }

  /** Once the element is in the page. */
  start(): void {
    this.plots.start();
    this.stage.drawBar();
  }

  /** What is recorded comes from the worker, which therefore ends last. */
  async close(): Promise<void> {
    this.closed = true;
    // Listeners of theirs at the window would keep the whole pane.
    this.surface?.close();
    this.cloud?.close();
    this.surface = this.cloud = undefined;
    this.plots.close();
    this.profile.close();
    this.element.remove();
    await this.recording.close();
    this.sensor.close();
  }

  /** Colours that canvases have from the theme. */
  recolour(): void {
    this.stage.drawBar();
    this.plots.draw();
  }

  /** Whether the key meant something here. */
  key(key: string): boolean {
    const actions: Record<string, () => void> = {
      "1": () => this.views.choose("depth"),
      "2": () => this.views.choose("camera"),
      "3": () => this.views.choose("surface"),
      "4": () => this.views.choose("difference"),
      p: () => this.tools.choose("point"),
      l: () => this.tools.choose("line"),
      s: () => void this.snapshot(),
      r: () => this.recording.toggle(),
      z: () => {
        if (this.sensor.mayControl) void this.light.rezero(false);
      },
      " ": () => this.pause(!this.paused),
      ArrowLeft: () => this.sensor.step(-1),
      ArrowRight: () => this.sensor.step(1),
    };
    const action = actions[key];
    // Points are only looked at.
    if (!action || (this.servesPoints && !KEYS_OF_POINTS.includes(key))) return false;
    action();
    return true;
  }

  private build(): HTMLElement {
    const head = el(
      "header",
      { class: "panehead" },
      el("h2", {}, this.name),
      this.state,
      this.rate,
      el(
        "span",
        { class: "row" },
        this.steps,
        this.file ? "" : this.pauseButton,
        this.snapshotButton,
        this.file ? "" : this.recording.element,
      ),
    );
    const tools = el(
      "div",
      { class: "tools", role: "toolbar", "aria-label": "View" },
      this.views.element,
      this.tools.element,
      ...this.range.elements,
    );
    this.commands.append(
      this.light.element,
      this.camera.element,
      this.reconstruction.element,
      this.calibrations.element,
      this.objects.element,
    );
    return el(
      "article",
      {
        class: "pane",
        "aria-label": `${this.file ? "Recording" : "Sensor"} ${this.name}`,
        [this.file ? "data-recording" : "data-sensor"]: this.name,
      },
      el(
        "div",
        { class: "frame" },
        head,
        this.notice,
        this.tokenForm,
        el(
          "div",
          { class: "body" },
          el("div", { class: "main" }, tools, this.stage.element, this.file ? this.timeline.element : ""),
          this.profile.element,
          el("div", { class: "side" }, this.contact.element, this.quality.element),
          this.commands,
        ),
        this.plots.element,
      ),
    );
  }

  private makeTokenForm(): HTMLFormElement {
    const input = el("input", { type: "password", autocomplete: "off", "aria-label": "Token" });
    const form = el(
      "form",
      { class: "token row", hidden: "" },
      input,
      el("button", { type: "submit" }, "Connect"),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      keepToken(this.name, input.value);
      form.hidden = true;
      this.sensor.useToken(input.value);
      input.value = "";
    });
    return form;
  }

  private wants(): Wants {
    const picture = isPicture(this.views.value);
    return { depth: !picture, luma: picture };
  }

  private async look(view: View): Promise<void> {
    this.stage.look(view);
    this.sensor.want(this.wants());
    if (view === "difference") void this.fetchReference();
    else this.clearNoReference();
    // The frame that stays may have come without what is looked at now.
    if (this.paused && !this.file) this.sensor.step(0);
    if (view !== "surface") return;
    if (!this.surface) {
      const part = await import("./surface/surface").catch(() => undefined);
      if (!part) return this.showNotice(RELOAD);
      if (this.servesPoints || this.closed) return;
      this.surface ??= new part.SurfaceView(this.stage.surfaceHost);
    }
    if (this.stage.depth) this.surface.show(this.stage.depth, this.stage.range);
  }

  /** The daemon's reference image, in the present light. */
  private async fetchReference(): Promise<void> {
    // An old one would be taken from pictures in another light.
    if (this.views.value !== "difference") {
      this.stage.reference = undefined;
      return this.clearNoReference();
    }
    try {
      const result = await this.sensor.request({
        case: "getReference",
        value: create(GetReferenceSchema),
      });
      if (result.case !== "reference") return;
      const png = new Blob([result.value.png as BlobPart], { type: "image/png" });
      const bitmap = await createImageBitmap(png, { colorSpaceConversion: "none" });
      const { width, height } = bitmap;
      const context = new OffscreenCanvas(width, height).getContext("2d");
      context?.drawImage(bitmap, 0, 0);
      bitmap.close();
      // Red of each pixel, which is its grey.
      const rgba = context?.getImageData(0, 0, width, height).data;
      const values = new Uint8Array(width * height).map((_, i) => rgba?.[4 * i] ?? 0);
      this.stage.reference = { width, height, values };
      // No frame follows that would show it.
      if (this.paused) this.sensor.step(0);
      this.clearNoReference();
    } catch (error) {
      this.stage.reference = undefined;
      if (this.views.value === "difference") this.showNotice(NO_REFERENCE + (error as Error).message);
    }
  }

  private clearNoReference(): void {
    if (this.notice.textContent?.startsWith(NO_REFERENCE)) this.showNotice("");
  }

  /** dtact-perceive serves no maps, and is commanded nothing. */
  private async lookAtPoints(): Promise<void> {
    this.element.dataset["kind"] = "points";
    this.snapshotButton.hidden = this.recording.element.hidden = true;
    this.surface?.close();
    this.surface = undefined;
    this.stage.look("surface");
    if (this.cloud) return;
    const part = await import("./surface/cloud").catch(() => undefined);
    if (!part) return this.showNotice(RELOAD);
    if (this.servesPoints && !this.closed) this.cloud ??= new part.CloudView(this.stage.surfaceHost);
  }

  /** Another daemon may serve maps where one of points was. */
  private lookAtMaps(): void {
    if (this.element.dataset["kind"] === undefined) return;
    delete this.element.dataset["kind"];
    this.snapshotButton.hidden = this.recording.element.hidden = false;
    this.cloud?.close();
    this.cloud = undefined;
    this.contact.hideMotion();
    void this.look(this.views.value);
  }

  private link(link: Link): void {
    this.element.dataset["link"] = link.state;
    this.commands.inert = link.state !== "live";
    this.calibrate.disabled = link.state !== "live";
    say(
      this.state,
      {
        connecting: "connecting",
        live: this.file ? "recording" : "live",
        away: "away",
        token: "token needed",
        ended: "ended",
      }[link.state],
    );
    this.showNotice(link.state === "live" && link.sentence === "Connected." ? "" : link.sentence);
    this.recording.allow(link.state === "live" && !this.file);
    this.tokenForm.hidden = link.state !== "token";
    // A paused view goes on showing its frame.
    if (this.paused) this.stage.cover("");
    else if (link.state !== "live") {
      this.stage.cover(this.frame ? "The last frame; the sensor is away." : link.sentence);
      say(this.rate, "");
    }
  }

  private showNotice(sentence: string): void {
    say(this.notice, sentence);
    this.notice.hidden = sentence === "";
  }

  private hello(hello: HelloReply): void {
    const title = [hello.program, hello.name, hello.serial]
      .filter((part) => part !== "")
      .join(" · ");
    this.state.title = title;
    this.light.allow(this.sensor.mayControl);
    this.camera.allow(this.sensor.mayControl);
    this.reconstruction.allow(this.sensor.mayControl);
    this.objects.allow();
    // A recording may have been paused while it was opened.
    if (!this.file) this.pause(false);
    this.servesPoints = hello.features.includes("cloud");
    if (this.servesPoints) return void this.lookAtPoints();
    this.lookAtMaps();
    // That of another run of the daemon, or one that could not be had before.
    this.stage.reference = undefined;
    void this.fetchReference();
    void this.quality.ask(this.sensor);
    void this.calibrations.refresh();
  }

  private event(event: Event): void {
    this.quality.event(event);
    if (event.what.case === "calibration") {
      void this.calibrations.refresh();
      void this.quality.ask(this.sensor);
    }
    if (event.what.case === "reference" || event.what.case === "light") void this.fetchReference();
    if (event.what.case === "light") this.light.show(event.what.value);
    if (event.what.case === "reconstruction") this.reconstruction.show(event.what.value);
  }

  private played(played: Played): void {
    this.timeline.show(played);
    if (played.ended) this.pause(true);
  }

  private status(status: Status): void {
    this.lastStatus = status;
    this.quality.status(status);
    // One that is made for another light during contact comes without an event.
    if (!this.stage.reference) void this.fetchReference();
    if (status.light) this.light.show(status.light);
    this.camera.show(status.camera?.settings);
    if (status.reconstruction) this.reconstruction.show(status.reconstruction);
    this.showCameraAway(status.health.includes(Health.CAMERA_FAULT), status.advice);
  }

  /** The camera gives no frames, so that none tells that the one shown is old. */
  private showCameraAway(away: boolean, advice: string): void {
    if (this.file || this.paused) return;
    this.element.classList.toggle("camera-away", away);
    if (!away) return;
    this.stage.cover(this.frame ? "The last frame; the camera gives none." : advice);
    say(this.rate, "");
  }

  private show(frame: Frame): boolean {
    // One that was still on its way when the view was paused, or went on.
    if (this.closed || this.paused !== (frame.behind !== undefined)) return false;
    this.frame = frame;
    this.element.classList.remove("camera-away");
    if (!this.paused) this.meter.count(frame);
    this.stage.cover(this.coverOf(frame), this.offersCalibration(frame) ? this.calibrate : undefined);
    this.stage.show(frame);
    if (this.views.value === "surface" && frame.depth)
      this.surface?.show(frame.depth, this.stage.range);
    this.cloud?.show(frame);
    if (!this.paused) this.reconstruction.frame(frame);
    if (!this.paused) this.plots.add(frame, this.meter.latencyMs);
    const now = performance.now();
    if (now - this.reportedAt < REPORT_MS && !this.paused) return true;
    this.reportedAt = now;
    this.contact.show(frame);
    if (frame.contact?.inContact === false) this.light.noContact();
    this.quality.show(frame);
    this.element.dataset["sequence"] = String(frame.sequence);
    this.showRate(frame);
    return true;
  }

  private coverOf(frame: Frame): string {
    // Parts that the view did not need were not sent, so what is drawn may be of long ago.
    const drawn = this.stage.frameOfPicture;
    const isOld = drawn !== undefined && Math.abs(drawn.wallMs - frame.wallMs) > OLD_MS;
    if (this.paused && !this.file && isOld) {
      const part = isPicture(this.views.value) ? "the camera's picture" : "its map";
      return `This frame came without ${part}: resume, or choose another view.`;
    }
    if (this.views.value === "difference" && !this.stage.reference)
      return "Waiting for the reference.";
    if (isPicture(this.views.value) && this.file && !this.sensor.features.includes("jpeg"))
      return "The recording has no pictures of the camera.";
    if (isPicture(this.views.value))
      return frame.luma || this.stage.luma ? "" : "Waiting for the camera's picture.";
    if (frame.depth) return "";
    if (this.isUncalibrated(frame))
      return this.sensor.mayCalibrate
        ? "No calibration yet."
        : "No calibration yet. This client may not calibrate.";
    if (frame.contact) return this.stage.depth ? "" : "Waiting for depth.";
    const advice = this.lastStatus?.advice ?? "";
    return this.frame && advice ? advice : "No depth at present.";
  }

  private isUncalibrated(frame: Frame): boolean {
    return (
      !frame.depth &&
      !isPicture(this.views.value) &&
      this.lastStatus?.state === State.UNCALIBRATED
    );
  }

  private offersCalibration(frame: Frame): boolean {
    return this.isUncalibrated(frame) && this.sensor.mayCalibrate;
  }

  private showRate(frame: Frame): void {
    if (this.paused) {
      say(
        this.behind,
        frame.behind === 0
          ? `frame ${frame.sequence}`
          : `frame ${frame.sequence}, ${frame.behind} back`,
      );
      return;
    }
    const latency = this.meter.latencyMs;
    const late = latency === undefined ? "" : ` · ${fixed(latency, 0)} ms to the screen`;
    say(this.rate, `${fixed(this.meter.fps, 1)} fps${late} · ${frame.dropped} dropped`);
  }

  private pause(paused: boolean): void {
    if (paused === this.paused) return;
    this.paused = paused;
    this.sensor.pause(paused);
    say(this.pauseButton, paused ? "Resume" : "Pause");
    this.pauseButton.setAttribute("aria-pressed", String(paused));
    // Not the number shown at an earlier pause.
    say(this.behind, "");
    this.steps.hidden = !paused;
    this.element.classList.toggle("paused", paused);
    if (paused) this.sensor.step(0);
  }

  private async snapshot(): Promise<void> {
    const frame = this.stage.frameOfPicture ?? this.frame;
    if (!frame) return;
    try {
      await saveSnapshot(this.name, this.views.value, this.stage, frame, this.lastStatus);
    } catch (error) {
      this.showNotice((error as Error).message);
    }
  }
}
