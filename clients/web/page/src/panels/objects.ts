// The objects that dtact-perceive recognises because they were taught: teach one by presses, rename or
// forget it.
import type { GuidedScene, TaughtObject } from "../../gen/guided_pb";
import { button, el, say } from "../dom";
import type { Sensor } from "../session/sensor";
import { converse, Talk } from "./talk";

/** Runs a command of dtact-calibrate objects; none lists them. */
function run(sensor: Sensor, objects: object): Promise<TaughtObject[]> {
  return new Promise((done, failed) => {
    let found: TaughtObject[] = [];
    const socket = converse(
      sensor,
      { objects },
      (line) => {
        if (line.case === "taught") found = line.value.objects;
        if (line.case !== "ended") return;
        if (line.value.error === "") done(found);
        else failed(new Error(line.value.error));
        socket.close();
      },
      () => failed(new Error("The connection was lost.")),
    );
  });
}

/** Teaches one object after the other. */
class Lesson {
  private readonly name = el("input", {
    type: "text",
    "aria-label": "Name of the object",
    required: "",
    maxlength: "60",
  });
  private readonly count = el("strong", { "data-fact": "presses" });
  private readonly progress = el("progress", { "aria-label": "Presses taken" });
  private readonly closing = button("Close", () => this.element.close());
  private readonly form = el(
    "form",
    { class: "start" },
    el(
      "p",
      { class: "quiet" },
      "Press the object in ten times, each time turned or with another side that is to be known. It " +
        "takes two minutes. Presses taught earlier under this name are replaced.",
    ),
    el("label", {}, el("span", {}, "Name"), this.name),
    el("button", { type: "submit" }, "Begin"),
  );
  private readonly talk: Talk;
  readonly element: HTMLDialogElement;

  constructor(sensor: Sensor, changed: () => void) {
    this.talk = new Talk(sensor, el("div", { class: "row" }, this.count, this.progress), {
      scene: (scene) => this.show(scene),
      ended: (error) => {
        if (error === "") this.name.value = "";
        this.form.hidden = false;
        say(this.closing, "Close");
        changed();
      },
    });
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.form.hidden = true;
      say(this.closing, "End");
      this.talk.begin({ objects: { teach: this.name.value } }, "Nothing is stored: teach it again.");
    });
    this.element = el(
      "dialog",
      { class: "guide lesson", "aria-label": "Teach an object" },
      el("h3", {}, `Teach an object on ${sensor.name}`),
      this.talk.element,
      this.form,
      el("div", { class: "row" }, this.closing),
    );
    this.element.addEventListener("close", () => {
      this.talk.close();
      this.element.remove();
    });
    this.element.addEventListener("cancel", (event) => {
      if (this.talk.running) event.preventDefault();
    });
    // The page's own keys mean nothing here.
    this.element.addEventListener("keydown", (event) => event.stopPropagation());
  }

  private show({ presses, pressesRequired }: GuidedScene): void {
    say(this.count, `${presses.length} of ${pressesRequired}`);
    this.progress.max = pressesRequired;
    this.progress.value = presses.length;
  }
}

export class ObjectsPanel {
  private readonly list = el("ul", { class: "calibrations" });
  private readonly answer = el("p", { class: "answer", role: "alert" });
  /** Closed at first: the gateway starts a program to list them. */
  readonly element = el(
    "details",
    { class: "panel", role: "group", "aria-label": "Taught objects" },
    el("summary", {}, el("h3", {}, "Taught objects")),
    this.list,
    el(
      "div",
      { class: "row" },
      button("Teach…", () => this.teach(), {
        title: "Makes dtact-perceive recognise an object by ten presses",
      }),
    ),
    this.answer,
  );

  constructor(private readonly sensor: Sensor) {
    this.element.addEventListener("toggle", () => {
      if (this.element.open) void this.run({});
    });
  }

  allow(): void {
    this.element.hidden = !this.sensor.mayCalibrate;
  }

  private teach(): void {
    const lesson = new Lesson(this.sensor, () => void this.run({}));
    this.element.append(lesson.element);
    lesson.element.showModal();
  }

  /** Runs the command, and lists what there is then. */
  private async run(command: { forget?: string; rename?: { name: string; new_name: string } }): Promise<void> {
    try {
      if (Object.keys(command).length > 0) await run(this.sensor, command);
      const taught = await run(this.sensor, {});
      this.list.replaceChildren(...taught.map((object) => this.item(object)));
      say(this.answer, "");
    } catch (error) {
      say(this.answer, (error as Error).message);
    }
  }

  private item({ name, presses, damage }: TaughtObject): HTMLElement {
    const rename = (): void => {
      const input = el("input", { type: "text", "aria-label": `New name of ${name}`, maxlength: "60" });
      input.value = name;
      const form = el("form", { class: "row" }, input, el("button", { type: "submit" }, "Rename"));
      form.addEventListener("submit", (event) => {
        event.preventDefault();
        void this.run({ rename: { name, new_name: input.value } });
      });
      item.replaceChildren(form);
      input.select();
    };
    const item = el(
      "li",
      {},
      el("span", { class: "name" }, name),
      el("span", { class: "quiet" }, damage || `${presses} presses`),
      button("Rename…", rename),
      button("Forget", () => void this.run({ forget: name })),
    );
    return item;
  }
}
