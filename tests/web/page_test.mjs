// The page in a browser, on simulated sensors: the shown values against the daemon's messages.
import assert from "node:assert/strict";
import { readFile, writeFile } from "node:fs/promises";
import path from "node:path";
import { after, before, beforeEach, test } from "node:test";
import { accessibilityFaults, canvas, fact, numberOf, open, pause, PHONE, resume, until } from "./browser.mjs";
import { MAP, beyond, startDaemon, startGateway, startProxy, stopAll, work } from "./programs.mjs";
import { Tap } from "./tap.mjs";

const { colourMap } = await import(path.resolve(process.env.PAGE_NODE, "colour_map.mjs"));

/** The locked range of 0 to 1.5 mm in 256 colours. */
const STEP_MM = 1.5 / 256;

let left;
let gateway;
let tap;
let rightTap;
let view;
let pane;

before(async () => {
  left = await startDaemon("left");
  const right = await startDaemon("right", 0, [`camera.sim.scene=${beyond}`]);
  rightTap = new Tap(right.port);
  gateway = await startGateway({ left: left.port, right: right.port });
  tap = new Tap(left.port);
  view = await open(gateway);
  pane = view.page.locator('[data-sensor="left"]');
});

after(async () => {
  tap?.close();
  rightTap?.close();
  await view?.close();
  await stopAll();
});

// Runs after failed tests as well.
beforeEach(async () => {
  if (await pane.getByRole("button", { name: "Resume" }).isVisible()) await resume(pane);
});

const COLOURS = new Map();
for (let i = 0; i < 256; ++i)
  COLOURS.set(colourMap.subarray(4 * i, 4 * i + 3).join(), (i + 0.5) * STEP_MM);

/** Depth by the colour of a pixel; undefined for one that the map does not have. */
const depthOf = (picture, row, column) => {
  const at = 4 * (row * picture.width + column);
  return COLOURS.get(picture.rgba.subarray(at, at + 3).join());
};

/** Pauses a pane in a frame that the other client has, too: on a busy machine each misses some. */
async function pausedWith(sensor, other, accepted) {
  for (let tries = 0; tries < 20; ++tries) {
    const sequence = await pause(sensor);
    for (let waited = 0; waited < 20; ++waited) {
      const frame = other.frame(sequence);
      if (frame && (await accepted())) return frame;
      await new Promise((done) => setTimeout(done, 50));
    }
    await resume(sensor);
  }
  throw new Error("no frame that both clients have");
}

/** Waits for a press of about this depth, and pauses in it. */
async function pausedAt(deepestMm) {
  const near = (mm) => Math.abs(mm - deepestMm) < 0.08;
  await until(() => numberOf(pane, "deepest"), near);
  // The press may just have ended: then the next one of that depth is used.
  return pausedWith(pane, tap, async () => near(await numberOf(pane, "deepest")));
}

/** The calibration assumes the camera 30 mm above the middle of the map. */
const CAMERA_MM = 30;

/** Where a point along one axis is that is seen at `mm` and pressed in by `um`. */
const placeOf = (mm, um) => mm * (1 - um / 1000 / CAMERA_MM);

/** What is pressed deeper than half a millimetre by the canvas' colours: where and how deep. */
function pressed(picture, mmPerPx) {
  let [sum, x, y, deepest] = [0, 0, 0, 0];
  for (let row = 0; row < picture.height; ++row) {
    for (let column = 0; column < picture.width; ++column) {
      const mm = depthOf(picture, row, column);
      if (mm === undefined || mm < 0.5) continue;
      sum += mm;
      x += mm * placeOf((column - (picture.width - 1) / 2) * mmPerPx, 1000 * mm);
      y += mm * placeOf((row - (picture.height - 1) / 2) * mmPerPx, 1000 * mm);
      deepest = Math.max(deepest, mm);
    }
  }
  return { x: x / sum, y: y / sum, deepest };
}

/** Every 7th pixel's colour means the frame's depth, but where the outline is drawn. */
function assertEqual(picture, frame) {
  let compared = 0;
  for (let row = 0; row < frame.height; row += 7) {
    for (let column = 0; column < frame.width; column += 7) {
      const shown = depthOf(picture, row, column);
      if (shown === undefined) continue;
      const mm = frame.um(row, column) / 1000;
      ++compared;
      const within = Math.abs(Math.min(Math.max(mm, 0), 1.5) - shown) <= 0.51 * STEP_MM;
      assert.ok(within, `row ${row}, column ${column}: ${mm} mm is shown as ${shown} mm`);
    }
  }
  assert.ok(compared > 3900, `${compared} pixels of the map's colours`);
}

test("the ball is at its place and depth, within the map's step of the frame", async () => {
  const frame = await pausedAt(1.0);
  const picture = await canvas(pane);
  assert.equal(picture.width, MAP.width);
  assert.equal(picture.height, MAP.height);
  assertEqual(picture, frame);
  const ball = pressed(picture, frame.mmPerPx);
  // The scene's own numbers; other tests check the accuracy of depth.
  assert.ok(Math.hypot(ball.x - 3.0, ball.y + 2.0) < 0.1, `at ${ball.x}, ${ball.y}`);
  assert.ok(Math.abs(ball.deepest - 1.0) < 0.08, `${ball.deepest} mm deep`);
  await resume(pane);
});

test("the range stays when something deeper comes", async () => {
  const frame = await pausedAt(1.3);
  const picture = await canvas(pane);
  assertEqual(picture, frame);
  const ball = pressed(picture, frame.mmPerPx);
  assert.ok(Math.hypot(ball.x + 4.0, ball.y - 3.0) < 0.1, `at ${ball.x}, ${ball.y}`);
  assert.equal(await pane.getByLabel("Range to, mm").inputValue(), "1.5");
  await resume(pane);
});

test("deeper than the range has a colour of its own", async () => {
  const upper = pane.getByLabel("Range to, mm");
  await upper.fill("0.5");
  await upper.press("Enter");
  const frame = await pausedAt(1.0);
  const picture = await canvas(pane);
  const row = Math.round(-2.0 / frame.mmPerPx + 199.5);
  const column = Math.round(3.0 / frame.mmPerPx + 249.5);
  const at = 4 * (row * picture.width + column);
  assert.deepEqual([...picture.rgba.subarray(at, at + 3)], [255, 138, 128]);
  await resume(pane);
  await upper.fill("1.5");
  await upper.press("Enter");
});

test("the cursor tells the frame's value, by mouse and by keyboard", async () => {
  const frame = await pausedAt(1.0);
  const marks = pane.locator("canvas.marks");
  const box = await marks.boundingBox();
  await view.page.mouse.move(box.x + 0.645 * box.width, box.y + 0.379 * box.height);
  const readout = pane.locator("output.readout");
  const reported = async () => {
    const text = (await readout.textContent()).replaceAll("−", "-");
    const [, um, row, column, x, y] =
      /^(-?\d+) µm · row (\d+), column (\d+) · x (-?[\d.]+) mm, y (-?[\d.]+) mm/.exec(text) ?? [];
    return { um: Number(um), row: Number(row), column: Number(column), x: Number(x), y: Number(y) };
  };
  const mouse = await reported();
  assert.equal(mouse.column, Math.floor(0.645 * MAP.width));
  assert.equal(mouse.row, Math.floor(0.379 * MAP.height));
  assert.equal(mouse.um, frame.um(mouse.row, mouse.column));
  assert.ok(mouse.um > 500);
  const placed = (mm) => Number(placeOf(mm, mouse.um).toFixed(2));
  assert.equal(mouse.x, placed((mouse.column - 249.5) * frame.mmPerPx));
  assert.equal(mouse.y, placed((mouse.row - 199.5) * frame.mmPerPx));
  await marks.focus();
  await view.page.keyboard.press("ArrowRight");
  await view.page.keyboard.press("Shift+ArrowDown");
  const keys = await reported();
  assert.equal(keys.column, mouse.column + 1);
  assert.equal(keys.row, mouse.row + 10);
  assert.equal(keys.um, frame.um(keys.row, keys.column));
  await resume(pane);
});

test("wheel and drag zoom and move the map, and the cursor tells the pixel under it", async () => {
  const box = await pane.locator("canvas.marks").boundingBox();
  const at = [box.x + 0.7511 * box.width, box.y + 0.2512 * box.height];
  const readout = () => pane.locator("output.readout").textContent();
  await view.page.mouse.move(...at);
  const before = /row \d+, column \d+/.exec(await readout())[0];
  await view.page.mouse.wheel(0, -800);
  const zoom = () =>
    pane.locator("canvas.map").evaluate((map) => new DOMMatrix(getComputedStyle(map).transform).a);
  await until(zoom, (factor) => factor > 7 && factor < 8);
  await view.page.mouse.move(at[0] + 1, at[1]);
  assert.equal(/row \d+, column \d+/.exec(await readout())[0], before);
  await view.page.mouse.down();
  await view.page.mouse.move(at[0] - 0.2 * box.width, at[1], { steps: 3 });
  await view.page.mouse.up();
  assert.equal(/row \d+, column \d+/.exec(await readout())[0], before, "it went with the pointer");
  await view.page.mouse.dblclick(...at);
  await until(zoom, (factor) => factor === 1);
  await view.page.mouse.move(box.x + box.width + 5, box.y);
});

test("a line tells its length and the difference of its ends", async () => {
  const frame = await pausedAt(1.0);
  await pane.getByRole("radio", { name: "Line" }).click();
  const box = await pane.locator("canvas.marks").boundingBox();
  const at = (column, row) => [
    box.x + ((column + 0.5) / MAP.width) * box.width,
    box.y + ((row + 0.5) / MAP.height) * box.height,
  ];
  await view.page.mouse.move(...at(160, 151));
  await view.page.mouse.down();
  await view.page.mouse.move(...at(322, 151));
  await view.page.mouse.up();
  const text = (await pane.locator("output.readout").textContent()).replaceAll("−", "-");
  const [, long, step] = /A–B ([\d.]+) mm, B - A (-?\d+) µm/.exec(text) ?? [];
  const end = (column) =>
    [column - 249.5, 151 - 199.5].map((px) => placeOf(px * frame.mmPerPx, frame.um(151, column)));
  const [a, b] = [end(160), end(322)];
  assert.equal(Number(long), Number(Math.hypot(b[0] - a[0], b[1] - a[1]).toFixed(2)));
  assert.equal(Number(step), frame.um(151, 322) - frame.um(151, 160));
  assert.ok(await pane.locator("figure.profile").isVisible());
  await pane.getByRole("radio", { name: "Point" }).click();
  assert.ok(!(await pane.locator("figure.profile").isVisible()));
  await resume(pane);
});

test("while paused the frames before are shown one by one", async () => {
  const paused = await pausedAt(1.0);
  const shown = async () =>
    Number(/frame (\d+)/.exec(await pane.locator(".steps").textContent())[1]);
  const first = await shown();
  let [sequence, frame] = [first, undefined];
  // The other client may have missed some of them.
  for (let steps = 0; steps < 30 && frame === undefined; ++steps) {
    const before = sequence;
    await pane.getByRole("button", { name: "One frame back" }).click();
    sequence = await until(shown, (now) => now < before, 10_000);
    frame = tap.frame(sequence);
  }
  assert.ok(frame, "one that both clients have");
  assert.notEqual(frame, paused);
  assertEqual(await canvas(pane), frame);
  await view.page.locator("body").press("ArrowRight");
  await until(shown, (now) => now > sequence, 10_000);
  await resume(pane);
});

test("keys choose what is shown and how it is read", async () => {
  const press = (key) => view.page.locator("body").press(key);
  const chosen = (name) => pane.getByRole("radio", { name }).isChecked();
  await press("l");
  assert.ok(await chosen("Line"));
  await press("p");
  assert.ok(await chosen("Point"));
  await press("3");
  assert.ok(await chosen("Surface"));
  await press("2");
  assert.ok(await chosen("Camera"));
  await press("1");
  assert.ok(await chosen("Depth"));
  const [download] = await Promise.all([view.page.waitForEvent("download"), press("s")]);
  assert.match(download.suggestedFilename(), /\.png$/);
  await press(" ");
  await pane.getByRole("button", { name: "Resume" }).waitFor();
  await press(" ");
  await pane.getByRole("button", { name: "Pause" }).waitFor();
});

test("deeper is lighter in the colour map, step by step", () => {
  const linear = (value) => {
    const share = value / 255;
    return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
  };
  const luminance = (i) => {
    const [r, g, b] = colourMap.subarray(4 * i, 4 * i + 3);
    return 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  };
  for (let i = 8; i < 256; i += 8) assert.ok(luminance(i) > luminance(i - 8), `colour ${i}`);
});

test("the theme turns and is remembered", async () => {
  const stored = () => view.page.evaluate(() => JSON.parse(localStorage.getItem("dtact theme")));
  const ground = () =>
    view.page.evaluate(() => getComputedStyle(document.documentElement).backgroundColor);
  const brightness = async () =>
    (await ground())
      .match(/\d+/g)
      .slice(0, 3)
      .reduce((sum, part) => sum + Number(part), 0);
  const turn = view.page.getByRole("button", { name: "Light / dark" });
  const before = await brightness();
  await turn.click();
  const turned = await brightness();
  assert.ok(Math.abs(turned - before) > 300, `${before} and ${turned}`);
  assert.equal(await stored(), turned > before ? "light" : "dark");
  await turn.click();
  assert.equal(await brightness(), before);
});

test("the camera's picture and its grey values", async () => {
  await pane.getByRole("radio", { name: "Camera" }).click();
  await until(
    () => pane.locator("canvas.map").getAttribute("width"),
    (width) => width === "800",
    10_000,
  );
  const box = await pane.locator("canvas.marks").boundingBox();
  await view.page.mouse.move(box.x + 5, box.y + 5);
  assert.match(
    await pane.locator("output.readout").textContent(),
    /^grey \d+ of 255 · row \d+, column \d+$/,
  );
  await pane.getByRole("radio", { name: "Depth" }).click();
});

test("the difference from the reference shows what darkened", async () => {
  await view.page.keyboard.press("4");
  const canvas = pane.locator("canvas.map");
  // In a corner nothing happens; where something presses it gets darker than the reference.
  const levels = () =>
    canvas.evaluate((map) => {
      const copy = new OffscreenCanvas(map.width, map.height).getContext("2d");
      copy.drawImage(map, 0, 0);
      const { data } = copy.getImageData(0, 0, map.width, map.height);
      const red = data.filter((_, i) => i % 4 === 0);
      let corner = 0;
      for (let i = 0; i < 400; ++i) corner += red[(i % 20) + map.width * Math.floor(i / 20)] / 400;
      return { width: map.width, corner, darkest: red.reduce((a, b) => Math.min(a, b), 255) };
    });
  await until(
    levels,
    ({ width, corner, darkest }) => width === 800 && Math.abs(corner - 128) < 8 && darkest < 64,
    30_000,
  );
  const box = await pane.locator("canvas.marks").boundingBox();
  await view.page.mouse.move(box.x + 0.02 * box.width, box.y + 0.02 * box.height);
  const [, grey, before] = /^grey (\d+) of 255 · reference (\d+) · row/.exec(
    await pane.locator("output.readout").textContent(),
  );
  assert.ok(Math.abs(grey - before) <= 6, `${grey} ${before}`);
  await view.page.keyboard.press("1");
});

test("a place on the map is none on the camera's picture", async () => {
  const box = await pane.locator("canvas.marks").boundingBox();
  const readout = pane.locator("output.readout");
  await view.page.mouse.move(box.x + 0.6 * box.width, box.y + 0.4 * box.height);
  await until(
    () => readout.textContent(),
    (text) => text.includes("row"),
    5000,
  );
  await view.page.keyboard.press("2");
  await until(
    () => pane.locator("canvas.map").getAttribute("width"),
    (width) => width === "800",
    10_000,
  );
  assert.equal(await readout.textContent(), "Point at the map for its values.");
  const camera = await pane.locator("canvas.marks").boundingBox();
  await view.page.mouse.move(camera.x + 0.5 * camera.width, camera.y + 0.5 * camera.height);
  assert.match(await readout.textContent(), /^grey \d+ of 255 · row \d+, column \d+$/);
  await view.page.keyboard.press("1");
  assert.equal(await readout.textContent(), "Point at the map for its values.");
});

test("a snapshot is a PNG with its time in its name", async () => {
  const [download] = await Promise.all([
    view.page.waitForEvent("download"),
    pane.getByRole("button", { name: "Snapshot" }).click(),
  ]);
  assert.match(download.suggestedFilename(), /^left-\d{4}-\d\d-\d\dT\d{6}\.\d{3}Z\.png$/);
});

test("the surface is loaded when it is looked at", async () => {
  await pane.getByRole("radio", { name: "Surface" }).click();
  await pane.locator(".surface canvas").waitFor();
  await until(
    () => pane.locator(".surface").getAttribute("data-every"),
    (every) => Number(every) >= 2,
    20_000,
  );
  await pane.getByLabel("Exaggeration of depth").fill("1");
  assert.equal(await pane.locator(".exaggeration output").textContent(), "true scale");
  await pane.getByRole("radio", { name: "Depth" }).click();
});

// Before: an empty view, without a word.
test("a part of the page that is gone after an update is named", async () => {
  const other = await open(gateway);
  try {
    await other.page.route(/surface-[^/]*\.js/, (route) => route.fulfill({ status: 404 }));
    const sensor = other.page.locator('[data-sensor="left"]');
    await sensor.getByRole("radio", { name: "Surface" }).click();
    await until(
      () => sensor.locator(".notice").first().textContent(),
      (text) => text.includes("Reload it"),
      10_000,
    );
    // The console reports the missing file.
    const reported = other.complaints.splice(0);
    assert.ok(reported.every((text) => text.includes("404")), reported.join("\n"));
  } finally {
    await other.close();
  }
});

test("a snapshot of the surface is the newest map, not what was shown before", async () => {
  await view.page.keyboard.press("2");
  await until(
    () => pane.locator("canvas.map").getAttribute("width"),
    (width) => width === "800",
    10_000,
  );
  await pane.getByRole("radio", { name: "Surface" }).click();
  const [download] = await Promise.all([
    view.page.waitForEvent("download"),
    pane.getByRole("button", { name: "Snapshot" }).click(),
  ]);
  const png = (await readFile(await download.path())).toString("base64");
  const picture = await view.page.evaluate(async ([base64, { width, height }]) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(12, 12, width, height);
    let coloured = 0;
    for (let i = 0; i < data.length; i += 4) if (Math.abs(data[i] - data[i + 2]) > 8) ++coloured;
    return { width: image.width, coloured: coloured / (width * height) };
  }, [png, MAP]);
  assert.equal(picture.width, MAP.width + 96 + 12);
  assert.ok(picture.coloured > 0.5, `${picture.coloured} of the map is in colour`);
  await pane.getByRole("radio", { name: "Depth" }).click();
});

test("the page reports a dead daemon at once and continues when it is back", async () => {
  const { port } = left;
  await left.stop("SIGKILL");
  await until(
    () => pane.getAttribute("data-link"),
    (link) => link === "away",
    15_000,
  );
  assert.match(await pane.locator(".notice").textContent(), /away|Trying again/);
  const controls = () => pane.locator(".commands").evaluate((element) => element.inert);
  assert.ok(await controls(), "nothing can be commanded meanwhile");
  assert.ok((await pane.locator(".side").first().evaluate((side) => getComputedStyle(side).opacity)) < 1);
  const before = Number(await pane.getAttribute("data-sequence"));
  // A page that is opened meanwhile finds no list of calibrations.
  const early = await open(gateway);
  const earlyPane = early.page.locator('[data-sensor="left"]');
  const calibrations = earlyPane.locator('[aria-label="Calibrations"]');
  await until(
    () => calibrations.locator(".answer").textContent(),
    (text) => text.includes("away"),
    15_000,
  );
  left = await startDaemon("left", port);
  await until(
    () => pane.getAttribute("data-link"),
    (link) => link === "live",
    30_000,
  );
  await until(
    () => pane.getAttribute("data-sequence"),
    (sequence) => Number(sequence) > 0 && Number(sequence) !== before,
    30_000,
  );
  assert.equal(await pane.locator(".notice").isVisible(), false);
  assert.equal(await controls(), false);
  await until(
    () => earlyPane.getAttribute("data-sequence"),
    (sequence) => Number(sequence) > 0,
    30_000,
  );
  await calibrations.getByText("in use").waitFor();
  assert.equal(await calibrations.locator(".answer").textContent(), "");
  await early.close();
});

test("two sensors beside each other", async () => {
  const other = view.page.locator('[data-sensor="right"]');
  await until(
    () => numberOf(other, "deepest"),
    (mm) => mm > 0.5,
  );
  const [a, b] = await Promise.all([pane.boundingBox(), other.boundingBox()]);
  assert.ok(a.x + a.width <= b.x && a.y === b.y, "beside each other");
});

test("untrusted pixels are striped, and told as such", async () => {
  const other = view.page.locator('[data-sensor="right"]');
  const row = 200;
  const frame = await pausedWith(other, rightTap, async () => true);
  const picture = await canvas(other);
  const untrusted = [];
  for (let column = 0; column < MAP.width; ++column) {
    const at = 4 * (row * MAP.width + column);
    const [r, g, b] = picture.rgba.subarray(at, at + 3);
    const striped = r === g && g === b && r < 200;
    assert.equal(striped, frame.um(row, column) === -32768, `column ${column}`);
    if (striped) untrusted.push(column);
  }
  assert.ok(untrusted.length > 10, `${untrusted.length} untrusted pixels in the row`);
  const box = await other.locator("canvas.marks").boundingBox();
  const column = untrusted[untrusted.length >> 1];
  await view.page.mouse.move(
    box.x + ((column + 0.5) / MAP.width) * box.width,
    box.y + ((row + 0.5) / MAP.height) * box.height,
  );
  assert.match(await other.locator("output.readout").textContent(), /^untrusted · row 200/);
  await resume(other);
});

test("a sensor that is not chosen is not shown", async () => {
  const other = view.page.locator('[data-sensor="right"]');
  await view.page.getByRole("navigation").getByRole("button", { name: "right" }).click();
  assert.equal(await other.count(), 0);
});

test("sensors, range and panels are as they were after a reload", async () => {
  await pane.getByLabel("Range to, mm").fill("0.8");
  await pane.getByLabel("Range to, mm").press("Enter");
  await pane.getByLabel("Speed and accuracy").locator("summary").click();
  // The browser tells the page of the open panel in a task of its own.
  await until(
    () => view.page.evaluate(() => localStorage.getItem("dtact speed and accuracy")),
    (open) => open === "true",
    10_000,
  );
  await view.page.reload();
  await until(
    () => pane.getAttribute("data-sequence"),
    (sequence) => Number(sequence) > 0,
    20_000,
  );
  assert.equal(await view.page.locator('[data-sensor="right"]').count(), 0);
  assert.equal(await pane.getByLabel("Range to, mm").inputValue(), "0.8");
  assert.match(await pane.locator("canvas.bar").getAttribute("aria-label"), /from 0 to 0.8 mm/);
  assert.ok(await pane.getByLabel("Speed and accuracy").evaluate((panel) => panel.open));
  await pane.getByLabel("Speed and accuracy").locator("summary").click();
  await pane.getByLabel("Range to, mm").fill("1.5");
  await pane.getByLabel("Range to, mm").press("Enter");
});

test("a value that a finger tapped stays when it lifts", async () => {
  const box = await pane.locator("canvas.marks").boundingBox();
  const at = { clientX: box.x + 0.3 * box.width, clientY: box.y + 0.6 * box.height };
  for (const type of ["pointermove", "pointerdown", "pointerup", "pointerleave"])
    await pane.locator("canvas.marks").dispatchEvent(type, { ...at, pointerType: "touch" });
  assert.match(await pane.locator("output.readout").textContent(), /row 2[34]\d, column 1[45]\d/);
  await pane.locator("canvas.marks").dispatchEvent("pointerleave", { ...at, pointerType: "mouse" });
  assert.doesNotMatch(await pane.locator("output.readout").textContent(), /row/);
});

test("without a calibration the map's place offers to make one", async () => {
  const bare = await startDaemon("bare", 0, ["calibration=", "camera.sim.calibration="]);
  const bareGateway = await startGateway({ bare: bare.port });
  const uncalibrated = await open(bareGateway);
  try {
    const offer = uncalibrated.page.locator(".veil").getByRole("button", { name: "Calibrate…" });
    await offer.click();
    await uncalibrated.page.getByRole("dialog").waitFor();
  } finally {
    await uncalibrated.close();
    await bareGateway.stop();
    await bare.stop();
  }
});

// Before: with the daemon there, the last frame stood as live, with its contact and its rate.
test("while the camera is unplugged the last frame is not shown as live", async () => {
  const faults = [...Array(20).keys()].map(
    (i) => `[[fault]]\nkind = "unplug"\nframe = ${100 + 170 * i}\nframes = 80\n`,
  );
  const file = path.join(work, "unplugged.toml");
  await writeFile(file, (await readFile(beyond, "utf8")) + faults.join(""));
  const loose = await startDaemon("loose", 0, [`camera.sim.scene=${file}`]);
  const looseGateway = await startGateway({ loose: loose.port });
  const unplugged = await open(looseGateway);
  const pane = unplugged.page.locator('[data-sensor="loose"]');
  const shown = async () => ({
    veil: await pane.locator(".veil p").textContent(),
    rate: await fact(pane, "rate").textContent(),
  });
  try {
    const isOld = ({ veil, rate }) => veil === "The last frame; the camera gives none." && rate === "";
    const isLive = ({ veil, rate }) => veil === "" && /fps/.test(rate);
    for (const state of [isOld, isLive, isOld]) await until(shown, state);
  } finally {
    await unplugged.close();
    await looseGateway.stop();
    await loose.stop();
  }
});

// Before: the picture of an hour ago stood as that of the paused frame.
test("a paused frame is not shown by a picture of another moment", async () => {
  const veil = () => pane.locator(".veil p").textContent();
  const look = (name) => pane.getByRole("radio", { name }).click();
  await look("Camera");
  await until(
    () => pane.locator("canvas.map").getAttribute("width"),
    (width) => width === "800",
  );
  await look("Depth");
  await new Promise((done) => setTimeout(done, 2000));
  await pause(pane);
  assert.equal(await veil(), "");
  await look("Camera");
  await until(veil, (text) => text === "This frame came without the camera's picture: resume, or choose another view.");
  await look("Depth");
  await until(veil, (text) => text === "");
  await resume(pane);
});

test("behind a proxy's path it shows depth", async () => {
  const proxy = await startProxy(gateway);
  const proxied = await open(proxy, { path: "/dtact/" });
  try {
    await until(
      () => proxied.page.locator('[data-sensor="left"]').getAttribute("data-sequence"),
      (sequence) => Number(sequence) > 0,
      20_000,
    );
  } finally {
    await proxied.close();
    proxy.close();
  }
});

/** Where these parts of the pane lie, all at the same moment: a line of advice may come between two looks. */
function boxesOf(parts) {
  return pane.evaluate(
    (root, selectors) => selectors.map((one) => root.querySelector(one).getBoundingClientRect().toJSON()),
    parts,
  );
}

test("on a phone everything is below each other and nothing is cut off", async () => {
  await view.page.setViewportSize(PHONE);
  try {
    await until(
      () => view.page.evaluate(() => document.documentElement.scrollWidth),
      (width) => width <= 390,
      5000,
    );
    const [picture, ...boxes] = await boxesOf([
      ".picture",
      ".stage",
      '[aria-label="Contact"]',
      '[aria-label="Quality"]',
      '[aria-label="Light"]',
      ".plots",
    ]);
    for (let i = 1; i < boxes.length; ++i) {
      assert.ok(
        boxes[i].y >= boxes[i - 1].y + boxes[i - 1].height,
        `part ${i} begins below the one before`,
      );
      assert.ok(boxes[i].x >= 0 && boxes[i].x + boxes[i].width <= 390);
    }
    assert.ok(
      Math.abs(picture.width / picture.height - MAP.width / MAP.height) < 0.01,
      `a map of ${picture.width} x ${picture.height}`,
    );
    await until(
      () => numberOf(pane, "deepest"),
      (mm) => mm > 0.9,
    );
    await view.page.screenshot({ path: path.join(work, "phone.png"), fullPage: true });
  } finally {
    await view.page.setViewportSize({ width: 1440, height: 900 });
  }
});

test("axe-core finds nothing, in either theme", async () => {
  assert.deepEqual(await accessibilityFaults(view.page), []);
  const turn = view.page.getByRole("button", { name: "Light / dark" });
  await turn.click();
  assert.deepEqual(await accessibilityFaults(view.page), []);
  await turn.click();
});

test("on a desktop picture, numbers and plots are seen at once", async () => {
  await until(
    () => numberOf(pane, "deepest"),
    (mm) => mm > 0.9,
  );
  const parts = [".stage", '[aria-label="Contact"]', '[aria-label="Light"]', ".plots"];
  for (const [i, box] of (await boxesOf(parts)).entries()) {
    assert.ok(box.y >= 0 && box.y + box.height <= 900, `${parts[i]} ends at ${box.y + box.height}`);
  }
  await view.page.screenshot({ path: path.join(work, "desktop.png") });
});

test("a browser without WebGL 2 gets a message", async () => {
  const withoutWebGl = await open(gateway, {
    before: () => {
      const plain = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
        return kind === "webgl2" ? null : plain.call(this, kind, ...more);
      };
    },
  });
  const reported = withoutWebGl.page.getByRole("alert").first();
  await reported.waitFor();
  assert.match(await reported.textContent(), /no WebGL 2.*Switch on hardware acceleration/);
  await withoutWebGl.close();
});
