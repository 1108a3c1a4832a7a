// The page: which sensors there are, which are shown, light or dark, the keyboard.
import "uplot/dist/uPlot.min.css";
import "./page.css";
import { button, el, say } from "./dom";
import { Fleet } from "./fleet";
import { keep, kept } from "./kept";
import { Pane } from "./pane";

interface SensorEntry {
  name: string;
  connected: boolean;
  error?: string;
}

const POLL_MS = 3000;
const THEME = "theme";
const SENSORS = "sensors";

class Page {
  private readonly chooser = el("nav", { class: "chooser", "aria-label": "Sensors" });
  private readonly notice = el("p", { class: "notice", role: "status", hidden: "" });
  private readonly panes = el("main", { class: "panes" });
  private readonly help = this.makeHelp();
  private readonly picker = el("input", {
    type: "file",
    accept: ".mcap",
    hidden: "",
    "aria-label": "Recording",
  });
  private readonly fleet = new Fleet(
    (name) => this.open(name),
    (name) => this.shown.has(name),
  );
  private readonly fleetButton = button("Fleet", () => this.showFleet(), {
    title: "All sensors with state, rate and health",
    "aria-pressed": "false",
    hidden: "",
  });
  private readonly shown = new Map<string, Pane>();
  private readonly buttons = new Map<string, HTMLButtonElement>();
  /** The pane that receives keys: the one used last. */
  private active = "";
  /** Recordings opened so far. */
  private played = 0;

  constructor() {
    document.body.append(
      el(
        "header",
        { class: "top" },
        el("h1", {}, "dtact"),
        this.fleetButton,
        this.chooser,
        el(
          "span",
          { class: "row end" },
          button("Open recording…", () => this.picker.click(), {
            title: "An MCAP file of dtactctl record or of this page",
          }),
          this.picker,
          button("Keys", () => this.help.showModal(), { title: "?" }),
          button("Light / dark", () => this.switchTheme(), {
            title: "Switch between light and dark",
          }),
        ),
      ),
      this.notice,
      this.fleet.element,
      this.panes,
      this.help,
    );
    const theme = kept(THEME);
    if (theme === "dark" || theme === "light") document.documentElement.dataset["theme"] = theme;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
    this.picker.addEventListener("change", () => {
      const file = this.picker.files?.[0];
      if (file) this.play(file);
      this.picker.value = "";
    });
    document.addEventListener("keydown", (event) => this.key(event));
    void this.poll();
    setInterval(() => void this.poll(), POLL_MS);
  }

  private async poll(): Promise<void> {
    try {
      const response = await fetch("sensors", { cache: "no-store" });
      if (!response.ok) throw new Error(`status ${response.status}`);
      this.tell("");
      this.list((await response.json()) as SensorEntry[]);
    } catch (error) {
      this.tell(`dtact-web does not answer (${(error as Error).message}). Trying again.`);
    }
  }

  private tell(sentence: string): void {
    say(this.notice, sentence);
    this.notice.hidden = sentence === "";
  }

  private list(sensors: SensorEntry[]): void {
    const names = sensors.map(({ name }) => name);
    const before = kept(SENSORS);
    const chosen = Array.isArray(before) ? names.filter((name) => before.includes(name)) : [];
    // At first as many as fit beside each other.
    const first = chosen.length > 0 ? chosen : names.slice(0, 2);
    const fresh = this.buttons.size === 0;
    // The gateway may have been started again with other sensors.
    for (const [name, made] of this.buttons) {
      if (names.includes(name)) continue;
      made.remove();
      this.buttons.delete(name);
    }
    for (const { name, connected, error } of sensors) {
      let made = this.buttons.get(name);
      if (!made) {
        made = button(name, () => this.choose(name));
        this.buttons.set(name, made);
        this.chooser.append(made);
      }
      made.dataset["connected"] = String(connected);
      made.title = error ?? "connected";
      made.setAttribute("aria-pressed", String(this.shown.has(name)));
    }
    // Panes stay while a gateway that was started again looks for its sensors.
    if (fresh) for (const name of first) if (!this.shown.has(name)) this.toggle(name);
    if (sensors.length === 0) this.tell("dtact-web has no sensor: see its --help.");
    this.fleetButton.hidden = sensors.length < 2;
    this.chooser.hidden = sensors.length < 2 || this.fleet.shown;
  }

  /** The fleet's list in place of the chooser, and back. */
  private showFleet(): void {
    this.fleet.toggle();
    this.chooser.hidden = this.fleet.shown;
    this.fleetButton.setAttribute("aria-pressed", String(this.fleet.shown));
  }

  private open(name: string): void {
    this.choose(name);
    this.shown.get(name)?.element.scrollIntoView({ behavior: "smooth" });
  }

  private choose(name: string): void {
    this.toggle(name);
    keep(SENSORS, [...this.shown.keys()]);
  }

  private toggle(name: string): void {
    const shown = this.shown.get(name);
    if (shown) {
      if (this.shown.size === 1) return;
      void shown.close();
      this.shown.delete(name);
    } else {
      try {
        this.add(name, new Pane(name), null);
      } catch (error) {
        this.panes.append(el("p", { class: "notice", role: "alert" }, (error as Error).message));
      }
    }
    this.count();
    this.buttons.get(name)?.setAttribute("aria-pressed", String(this.shown.has(name)));
  }

  /** A recording in a pane of its own, above the sensors'. */
  private play(file: File): void {
    const name = `${file.name} ${++this.played}`;
    const pane = new Pane(file.name, file);
    const close = button("Close", () => {
      this.shown.delete(name);
      this.count();
      void pane.close();
    });
    pane.element.querySelector(".panehead")?.append(close);
    this.add(name, pane, this.panes.firstChild);
    pane.element.scrollIntoView();
  }

  private add(name: string, pane: Pane, before: Node | null): void {
    this.shown.set(name, pane);
    this.panes.insertBefore(pane.element, before);
    pane.start();
    pane.element.addEventListener("pointerdown", () => (this.active = name));
    pane.element.addEventListener("focusin", () => (this.active = name));
    this.active = name;
    this.count();
  }

  private count(): void {
    this.panes.dataset["count"] = String(this.shown.size);
  }

  private key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    const typing = target.closest("input, textarea, select, dialog") !== null;
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    // Space on a button presses that.
    if (event.key === " " && target.closest("button") !== null) return;
    if (event.key === "?") return this.help.showModal();
    const pane = this.shown.get(this.active) ?? this.shown.values().next().value;
    if (pane?.key(event.key)) event.preventDefault();
  }

  private makeHelp(): HTMLDialogElement {
    const keys: [string, string][] = [
      ["1 2 3 4", "depth, camera, surface, camera − reference"],
      ["P L", "point, line from A to B"],
      ["arrows on the map", "move the cursor; with Shift by ten"],
      ["+ − 0 on the map", "zoom; also by the wheel or two fingers, a drag moves the map"],
      ["Space", "pause, and on"],
      ["← →", "step through the last seconds, paused"],
      ["S", "snapshot"],
      ["R", "record, and stop"],
      ["Z", "re-zero"],
      ["?", "these keys"],
    ];
    const list = el("dl", { class: "keys" });
    for (const [key, what] of keys) list.append(el("dt", {}, key), el("dd", {}, what));
    const licences = el("a", { href: "licences.txt", target: "_blank" }, "Licences");
    const dialog = el("dialog", { "aria-label": "Keys" }, el("h2", {}, "Keys"), list);
    dialog.append(
      el(
        "p",
        { class: "row" },
        button("Close", () => dialog.close()),
        licences,
      ),
    );
    return dialog;
  }

  private switchTheme(): void {
    const root = document.documentElement;
    const dark =
      root.dataset["theme"] ??
      (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    root.dataset["theme"] = dark === "dark" ? "light" : "dark";
    keep(THEME, root.dataset["theme"]);
    this.recolour();
  }

  private recolour(): void {
    for (const pane of this.shown.values()) pane.recolour();
  }
}

new Page();
