// The ring as it lies round the picture: brightness, each LED's colour, schemes; and the re-zero.
import { create } from "@bufbuild/protobuf";
import { ErrorCode, RezeroSchema, RgbSchema, SetLightSchema } from "../../gen/dtact_pb";
import type { LightState, Rgb } from "../../gen/dtact_pb";
import { button, el, panel, say, svg } from "../dom";
import { Refusal } from "../session/sensor";
import type { Sensor } from "../session/sensor";

const SCHEMES = ["all", "scheme1", "scheme2", "scheme3", "scheme4"];
const LEDS = 8;

function hex(led: Rgb): string {
  return `#${[led.r, led.g, led.b].map((part) => part.toString(16).padStart(2, "0")).join("")}`;
}

function rgb(colour: string): Rgb {
  const part = (at: number): number => parseInt(colour.slice(at, at + 2), 16);
  return create(RgbSchema, { r: part(1), g: part(3), b: part(5) });
}

export class LightPanel {
  private readonly slider = el("input", {
    type: "range",
    min: "0",
    max: "255",
    step: "1",
    "aria-label": "Brightness",
  });
  private readonly number = el("output", {}, "–");
  private readonly leds: SVGElement[] = [];
  private readonly colour = el("input", {
    type: "color",
    "aria-label": "Colour of the LED",
    value: "#ffffff",
  });
  private readonly chosen = el("span", { class: "quiet" });
  private readonly answer = el("p", { class: "answer", role: "alert" });
  private readonly zero = button("Re-zero", () => void this.rezero(false), {
    title: "Take a new reference image (Z)",
  });
  private readonly anyway = button("Re-zero anyway", () => void this.rezero(true), {
    class: "warn",
    hidden: "",
  });
  private readonly controls: HTMLElement;
  readonly element: HTMLElement;
  private light: LightState | undefined;
  private selected = 0;
  /** One SetLight is under way; what the slider did meanwhile goes with the next. */
  private busy = false;
  private wanted: number | undefined;

  constructor(private readonly sensor: Sensor) {
    const ring = this.makeRing();
    this.slider.addEventListener("input", () => {
      this.wanted = Number(this.slider.value);
      say(this.number, this.slider.value);
      void this.sendBrightness();
    });
    this.colour.addEventListener("change", () => void this.paint());
    const schemes = SCHEMES.map((scheme, i) =>
      button(i === 0 ? "All" : String(i), () => void this.set({ scheme }), {
        title: i === 0 ? "All eight, white" : `Scheme ${i}: four of the eight, white`,
        "aria-label": i === 0 ? "All LEDs" : `Scheme ${i}`,
      }),
    );
    this.controls = el(
      "div",
      { class: "controls" },
      el("label", { class: "row" }, "Brightness", this.slider, this.number),
      el(
        "div",
        { class: "ringrow" },
        ring,
        el(
          "div",
          { class: "column" },
          el("label", { class: "row" }, this.chosen, this.colour),
          el(
            "div",
            { class: "row wrap schemes", role: "group", "aria-label": "Schemes of the light" },
            ...schemes,
          ),
          el("div", { class: "row wrap" }, this.zero, this.anyway),
        ),
      ),
    );
    this.element = panel("Light", this.controls, this.answer);
    this.select(0);
  }

  /** With a token that may only watch, the light is shown and nothing can be set. */
  allow(control: boolean): void {
    for (const input of this.controls.querySelectorAll("input")) input.disabled = !control;
    for (const made of this.controls.querySelectorAll<HTMLElement>(".column"))
      made.hidden = !control;
    say(this.answer, control ? "" : "This token may watch, not set the light.");
  }

  show(light: LightState): void {
    this.light = light;
    // Not under a hand that is moving it.
    if (!this.busy && this.wanted === undefined) {
      this.slider.value = String(light.brightness);
      say(this.number, String(light.brightness));
    }
    light.leds.forEach((led, i) => this.leds[i]?.setAttribute("fill", hex(led)));
    const selected = light.leds[this.selected];
    if (selected && document.activeElement !== this.colour) this.colour.value = hex(selected);
  }

  /** There is no contact any more: there is nothing to do anyway. */
  noContact(): void {
    if (this.anyway.hidden) return;
    this.anyway.hidden = true;
    say(this.answer, "");
  }

  async rezero(force: boolean): Promise<void> {
    this.anyway.hidden = true;
    say(this.answer, "Taking a new reference.");
    try {
      await this.sensor.request({ case: "rezero", value: create(RezeroSchema, { force }) });
      say(this.answer, "A new reference is in use.");
    } catch (error) {
      say(this.answer, (error as Error).message);
      this.anyway.hidden = !(error instanceof Refusal && error.code === ErrorCode.ERROR_CONTACT);
    }
  }

  private makeRing(): SVGElement {
    const ring = svg("svg", {
      class: "ring",
      viewBox: "-60 -60 120 120",
      role: "group",
      "aria-label": "LEDs, as the camera sees them",
    });
    ring.append(svg("circle", { class: "rim", r: "44", cx: "0", cy: "0" }));
    for (let i = 0; i < LEDS; ++i) {
      // LED 0 at the image's right, the others clockwise as the camera sees them.
      const angle = (2 * Math.PI * i) / LEDS;
      const [x, y] = [44 * Math.cos(angle), 44 * Math.sin(angle)];
      const led = svg("circle", {
        class: "led",
        r: "14",
        cx: String(x),
        cy: String(y),
        fill: "#000",
        tabindex: "0",
        role: "button",
        "aria-label": `LED ${i}`,
      });
      led.addEventListener("click", () => this.select(i));
      led.addEventListener("keydown", (event) => {
        const key = (event as KeyboardEvent).key;
        if (key === "Enter" || key === " ") {
          event.preventDefault();
          event.stopPropagation();
          this.select(i);
        }
      });
      this.leds.push(led);
      const text = svg("text", { x: String(0.52 * x), y: String(0.52 * y) }, String(i));
      ring.append(led, text);
    }
    return ring;
  }

  private select(led: number): void {
    this.selected = led;
    this.leds.forEach((made, i) => made.setAttribute("aria-pressed", String(i === led)));
    say(this.chosen, `LED ${led}`);
    const colour = this.light?.leds[led];
    if (colour) this.colour.value = hex(colour);
  }

  private async paint(): Promise<void> {
    const leds = this.light?.leds.map((led, i) =>
      i === this.selected ? rgb(this.colour.value) : led,
    );
    if (leds?.length === LEDS) await this.set({ leds });
  }

  private async sendBrightness(): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    while (this.wanted !== undefined) {
      const brightness = this.wanted;
      await this.set({ brightness });
      if (this.wanted === brightness) this.wanted = undefined;
    }
    this.busy = false;
  }

  private async set(change: { brightness?: number; scheme?: string; leds?: Rgb[] }): Promise<void> {
    try {
      const result = await this.sensor.request({
        case: "setLight",
        value: create(SetLightSchema, change),
      });
      this.anyway.hidden = true;
      say(this.answer, "");
      if (result.case === "light") this.show(result.value);
    } catch (error) {
      say(this.answer, (error as Error).message);
    }
  }
}
