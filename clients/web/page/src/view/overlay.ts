// What is drawn over the map: scale bar, centroid and deepest point, the cursor, the drawn line.
import type { Contact } from "../../gen/dtact_pb";
import type { Zoom } from "./zoom";

/** A place of the surface frame, millimetres. */
export interface Place {
  xMm: number;
  yMm: number;
}

export interface Line {
  from: Place;
  to: Place;
}

/** Where the camera stands above a plane surface: dtact.v1.Surface. */
export interface Viewpoint {
  footXMm: number;
  footYMm: number;
  perMm: number;
}

/** How the map that is shown lies in the surface frame. */
export interface Grid {
  width: number;
  height: number;
  mmPerPx: number;
  viewpoint: Viewpoint;
}

/** Where a point lies that appears at `seen` and is pressed in by `depthMm`. */
export function truePlace({ footXMm, footYMm, perMm }: Viewpoint, seen: Place, depthMm: number): Place {
  const share = perMm * depthMm;
  return {
    xMm: seen.xMm - share * (seen.xMm - footXMm),
    yMm: seen.yMm - share * (seen.yMm - footYMm),
  };
}

/** Where a point appears at `place` and is pressed in by `depthMm`. */
function seenPlace({ footXMm, footYMm, perMm }: Viewpoint, place: Place, depthMm: number): Place {
  const rest = 1 - perMm * depthMm;
  return {
    xMm: footXMm + (place.xMm - footXMm) / rest,
    yMm: footYMm + (place.yMm - footYMm) / rest,
  };
}

export function placeOf(grid: Grid, column: number, row: number): Place {
  return {
    xMm: (column - (grid.width - 1) / 2) * grid.mmPerPx,
    yMm: (row - (grid.height - 1) / 2) * grid.mmPerPx,
  };
}

/** The nearest pixel; undefined outside of the map. */
export function pixelOf(grid: Grid, place: Place): { column: number; row: number } | undefined {
  const column = Math.round(place.xMm / grid.mmPerPx + (grid.width - 1) / 2);
  const row = Math.round(place.yMm / grid.mmPerPx + (grid.height - 1) / 2);
  const inside = column >= 0 && row >= 0 && column < grid.width && row < grid.height;
  return inside ? { column, row } : undefined;
}

const INK = "#ffffff";
const SHADE = "rgba(0, 0, 0, 0.65)";
const LENGTHS_MM = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];

export interface Marks {
  grid: Grid;
  contact: Contact | undefined;
  cursor: Place | undefined;
  line: Line | undefined;
  zoom: Zoom;
  /** Not on the camera's picture, whose grid counts pixels. */
  hasScale: boolean;
}

/** A length in round millimetres of about a fifth of what is shown. */
function scaleLength(grid: Grid, zoom: Zoom): number {
  const fifth = (grid.width * grid.mmPerPx) / zoom.factor / 5;
  return LENGTHS_MM.reduce((best, length) => (length <= fifth * 1.05 ? length : best));
}

/** Draws the marks into a picture; its size is in CSS pixels. */
export function drawMarks(
  context: CanvasRenderingContext2D,
  width: number,
  height: number,
  marks: Marks,
): void {
  const { grid, zoom } = marks;
  const scale = (width / grid.width) * zoom.factor;
  const at = (place: Place): [number, number] => [
    (place.xMm / grid.mmPerPx + grid.width * (0.5 - zoom.left)) * scale,
    (place.yMm / grid.mmPerPx + grid.height * (0.5 - zoom.top)) * scale,
  ];
  // Each stroke twice: a dark one under a light one is seen on any colour.
  const stroke = (path: () => void, line = 1.5): void => {
    for (const [colour, thickness] of [
      [SHADE, line + 2],
      [INK, line],
    ] as const) {
      context.strokeStyle = colour;
      context.lineWidth = thickness;
      context.beginPath();
      path();
      context.stroke();
    }
  };
  const write = (text: string, x: number, y: number): void => {
    context.lineWidth = 3;
    context.strokeStyle = SHADE;
    context.strokeText(text, x, y);
    context.fillStyle = INK;
    context.fillText(text, x, y);
  };
  context.font = "12px system-ui, sans-serif";
  context.textBaseline = "alphabetic";
  context.lineCap = "round";

  if (marks.contact?.inContact) {
    const { areaMm2, volumeMm3, deepestMm } = marks.contact;
    const pressedMm = areaMm2 > 0 ? volumeMm3 / areaMm2 : 0;
    const centroid = { xMm: marks.contact.xMm, yMm: marks.contact.yMm };
    const [cx, cy] = at(seenPlace(grid.viewpoint, centroid, pressedMm));
    stroke(() => context.arc(cx, cy, 6, 0, 2 * Math.PI));
    const deepest = { xMm: marks.contact.deepestXMm, yMm: marks.contact.deepestYMm };
    const [dx, dy] = at(seenPlace(grid.viewpoint, deepest, deepestMm));
    stroke(() => {
      context.moveTo(dx - 5, dy - 5);
      context.lineTo(dx + 5, dy + 5);
      context.moveTo(dx + 5, dy - 5);
      context.lineTo(dx - 5, dy + 5);
    });
  }
  if (marks.line) {
    const [x0, y0] = at(marks.line.from);
    const [x1, y1] = at(marks.line.to);
    stroke(() => {
      context.moveTo(x0, y0);
      context.lineTo(x1, y1);
    });
    for (const [x, y, name] of [
      [x0, y0, "A"],
      [x1, y1, "B"],
    ] as const) {
      stroke(() => context.arc(x, y, 3, 0, 2 * Math.PI));
      write(name, x + 7, y - 7);
    }
  }
  if (marks.cursor) {
    const [x, y] = at(marks.cursor);
    stroke(() => {
      for (const [ux, uy] of [
        [1, 0],
        [-1, 0],
        [0, 1],
        [0, -1],
      ] as const) {
        context.moveTo(x + 4 * ux, y + 4 * uy);
        context.lineTo(x + 11 * ux, y + 11 * uy);
      }
    }, 1);
  }
  if (!marks.hasScale) return;
  const length = scaleLength(grid, zoom);
  const long = (length / grid.mmPerPx) * scale;
  stroke(() => {
    context.moveTo(14, height - 14);
    context.lineTo(14 + long, height - 14);
  }, 2);
  write(`${length} mm`, 14, height - 21);
}
