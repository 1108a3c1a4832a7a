// The fleet: all sensors of the gateway with state, rate, version and health; each can be opened.
import "./fleet.css";
import { button, el, say } from "./dom";
import { keptTokens } from "./kept";
import { fixed } from "./labels";

interface Status {
  state: string;
  fps: number;
  version: string;
  health: string[];
  advice: string;
}

interface Entry {
  name: string;
  connected: boolean;
  error?: string;
  status?: Status;
}

/** Between two looks; shorter until all that are connected have said how they are. */
const POLL_MS = 2000;
const FIRST_POLL_MS = 300;

const NO_TOKEN = "A token is needed: open a sensor and enter it there.";

class Row {
  readonly element: HTMLElement;
  private readonly name: HTMLButtonElement;
  private readonly state = el("span", { class: "state" });
  private readonly rate = el("span", { class: "fps" });
  private readonly version = el("span", { class: "version quiet" });
  private readonly health = el("ul", { class: "health", "aria-label": "Health flags" });
  private readonly advice = el("p", { class: "quiet" });

  constructor(name: string, open: () => void) {
    this.name = button(name, open);
    const more = el("div", { class: "more" }, this.health, this.advice);
    this.element = el("li", {}, this.name, this.state, this.rate, this.version, more);
  }

  /** Whether it is well, as far as is known. */
  show(entry: Entry, opened: boolean): boolean {
    const { connected, status } = entry;
    const serves = !status || (status.state === "serving" && status.health.length === 0);
    const well = connected && serves;
    this.element.dataset["well"] = String(well);
    this.name.setAttribute("aria-pressed", String(opened));
    say(this.state, connected ? (status?.state.replaceAll("_", " ") ?? "…") : "away");
    say(this.rate, status ? `${fixed(status.fps, 1)} fps` : "");
    say(this.version, status?.version ?? "");
    say(this.advice, connected ? (status?.advice ?? "") : (entry.error ?? ""));
    const flags = (status?.health ?? []).map((flag) => flag.replaceAll("_", " "));
    if (flags.join() !== [...this.health.children].map((one) => one.textContent).join()) {
      this.health.replaceChildren(...flags.map((flag) => el("li", {}, flag)));
    }
    return well;
  }
}

export class Fleet {
  readonly element = el("section", { class: "fleet", "aria-label": "Fleet", hidden: "" });
  private readonly summary = el("p", { class: "quiet", role: "status" });
  private readonly list = el("ul", {});
  private readonly rows = new Map<string, Row>();
  private timer = 0;
  /** A token that was refused is not tried again: each try is answered later than the last. */
  private readonly refused = new Set<string>();

  constructor(
    private readonly open: (name: string) => void,
    private readonly isOpen: (name: string) => boolean,
  ) {
    this.element.append(this.summary, this.list);
  }

  get shown(): boolean {
    return !this.element.hidden;
  }

  toggle(): void {
    this.element.hidden = this.shown;
    clearTimeout(this.timer);
    if (this.shown) void this.poll();
  }

  private async poll(): Promise<void> {
    let pause = POLL_MS;
    try {
      const query = tokens().find((one) => !this.refused.has(one));
      if (query === undefined) throw new Error(NO_TOKEN);
      const response = await fetch(`fleet${query}`, { cache: "no-store" });
      if (response.status === 401) this.refused.add(query);
      if (!response.ok) throw new Error(this.refused.has(query) ? NO_TOKEN : await response.text());
      const entries = (await response.json()) as Entry[];
      this.show(entries);
      if (entries.some(({ connected, status }) => connected && !status)) pause = FIRST_POLL_MS;
    } catch (error) {
      say(this.summary, (error as Error).message);
    }
    clearTimeout(this.timer);
    if (this.shown) this.timer = setTimeout(() => void this.poll(), pause);
  }

  private show(entries: Entry[]): void {
    // The gateway may have been started again with other sensors.
    for (const [name, row] of this.rows) {
      if (entries.some((entry) => entry.name === name)) continue;
      row.element.remove();
      this.rows.delete(name);
    }
    let unwell = 0;
    for (const entry of entries) {
      let row = this.rows.get(entry.name);
      if (!row) {
        row = new Row(entry.name, () => this.open(entry.name));
        this.rows.set(entry.name, row);
        this.list.append(row.element);
      }
      if (!row.show(entry, this.isOpen(entry.name))) ++unwell;
    }
    const all = `${entries.length} sensors`;
    say(this.summary, unwell === 0 ? `${all}, all well` : `${all}, ${unwell} not well`);
  }
}

/** The tokens that were entered for sensors, each as part of an address; an empty one where none was. */
function tokens(): string[] {
  const entered = keptTokens();
  if (entered.length === 0) return [""];
  return entered.map((token) => `?token=${encodeURIComponent(token)}`);
}
