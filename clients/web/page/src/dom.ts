// Elements made in a line each. Styles are classes of page.css: the page's Content-Security-Policy
// forbids style attributes.

type Child = Node | string;

/** An element with attributes ("" for those that only stand there) and children. */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, string> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

export function svg(
  tag: string,
  attributes: Record<string, string> = {},
  ...children: Child[]
): SVGElement {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Changes the text only where it differs: a live region speaks at every change. */
export function say(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

export function button(
  label: string,
  pressed: () => void,
  attributes: Record<string, string> = {},
): HTMLButtonElement {
  const made = el("button", { type: "button", ...attributes }, label);
  made.addEventListener("click", pressed);
  return made;
}

/** Choices of which one holds, as a row of buttons; `chosen` is called with the one that is taken. */
export class Choice<T extends string> {
  readonly element: HTMLElement;
  private readonly buttons = new Map<T, HTMLButtonElement>();

  constructor(
    name: string,
    labels: Record<T, string>,
    private held: T,
    private readonly chosen: (value: T) => void,
  ) {
    this.element = el("div", { class: "choice", role: "radiogroup", "aria-label": name });
    for (const value of Object.keys(labels) as T[]) {
      const made = button(labels[value], () => this.choose(value), { role: "radio" });
      this.buttons.set(value, made);
      this.element.append(made);
    }
    this.mark(held);
  }

  get value(): T {
    return this.held;
  }

  choose(value: T): void {
    if (value === this.held) return;
    this.mark(value);
    this.chosen(value);
  }

  /** It holds already. */
  mark(value: T): void {
    this.held = value;
    for (const [value, made] of this.buttons) {
      made.setAttribute("aria-checked", String(value === this.held));
    }
  }
}

/** A table of names and values. */
export class Facts {
  readonly element = el("dl", { class: "facts" });
  private readonly values = new Map<string, HTMLElement>();

  constructor(names: Record<string, { label: string; hint?: string }>) {
    for (const [name, { label, hint }] of Object.entries(names)) {
      const value = el("dd", { "data-fact": name }, "–");
      this.values.set(name, value);
      const term = el("dt", hint ? { title: hint } : {}, label);
      this.element.append(term, value);
    }
  }

  set(name: string, text: string): void {
    const value = this.values.get(name);
    if (value) say(value, text);
  }
}

export function panel(title: string, ...children: Child[]): HTMLElement {
  return el("section", { class: "panel", role: "group", "aria-label": title }, el("h3", {}, title), ...children);
}
