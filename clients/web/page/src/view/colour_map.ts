// The colours of depth: a path through OKLab (B. Ottosson, 2020) from a dark violet over blue and green
// to a light yellow, walked in equal steps, so that equal differences of depth look equally different.
// Lightness rises all the way: it reads the same in grey and with any colour blindness.

export const COLOURS = 256;

type Triple = [number, number, number];

const DARKEST = 0.2;
const LIGHTEST = 0.94;
const FIRST_HUE_DEG = 298;
const LAST_HUE_DEG = 103;

/** Linear sRGB of an OKLab colour; outside of 0 … 1 where sRGB has no such colour. */
function linearRgb([lightness, a, b]: Triple): Triple {
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
}

/** A point of the path, 0 … 1, in OKLab. */
function pathAt(t: number): Triple {
  const hue = ((FIRST_HUE_DEG + (LAST_HUE_DEG - FIRST_HUE_DEG) * t) * Math.PI) / 180;
  // What sRGB has room for: least where blue turns into green.
  const chroma = 0.075 + 0.085 * t - 0.045 * Math.sin(Math.PI * t) ** 2;
  return [DARKEST + (LIGHTEST - DARKEST) * t, chroma * Math.cos(hue), chroma * Math.sin(hue)];
}

function byte(linear: number): number {
  const clipped = Math.min(Math.max(linear, 0), 1);
  const encoded = clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * clipped ** (1 / 2.4) - 0.055;
  return Math.round(255 * encoded);
}

function makeColours(): Uint8Array {
  const samples = 2048;
  const points = Array.from({ length: samples + 1 }, (_, i) => pathAt(i / samples));
  const walked = [0];
  for (let i = 1; i <= samples; ++i) {
    const [from, to] = [points[i - 1] as Triple, points[i] as Triple];
    const step = Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
    walked.push((walked[i - 1] as number) + step);
  }
  const whole = walked[samples] as number;
  const colours = new Uint8Array(4 * COLOURS);
  let at = 0;
  for (let i = 0; i < COLOURS; ++i) {
    const due = (whole * i) / (COLOURS - 1);
    while (at < samples && (walked[at] as number) < due) ++at;
    const rgb = linearRgb(points[at] as Triple);
    colours.set([byte(rgb[0]), byte(rgb[1]), byte(rgb[2]), 255], 4 * i);
  }
  return colours;
}

/** 256 colours of four bytes, from the range's lower end to its upper one. */
export const colourMap: Uint8Array = makeColours();

/** Deeper than the range: a colour that the map does not have. */
export const BEYOND: readonly [number, number, number] = [255, 138, 128];
