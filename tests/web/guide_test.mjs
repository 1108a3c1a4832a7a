// The guided calibration on the page: the gateway runs dtact-calibrate on a sensor that a ball of 4 mm
// is pressed into repeatedly.
import assert from "node:assert/strict";
import { readdirSync } from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { fact, open, until } from "./browser.mjs";
import { startDaemon, startGateway, status, stopAll, tokenFile, work } from "./programs.mjs";

const here = path.dirname(fileURLToPath(import.meta.url));
const folder = path.join(work, "sessions");
const START = { radius_mm: 4, mm_per_px: 0.0413793, crop: [560, 520] };

let left;
let view;
let pane;

before(async () => {
  left = await startDaemon("left", 0, [
    `camera.sim.scene=${path.join(here, "guide_presses.toml")}`,
    "camera.fps=15",
  ]);
  view = await open(await startGateway({ left: left.port }, ["--work-folder", folder]));
  pane = view.page.locator('[data-sensor="left"]');
  // Without a connection the form has no values.
  await until(
    () => fact(pane, "map").textContent(),
    (text) => text.startsWith("500 × 400"),
  );
});

after(async () => {
  await view?.close();
  await stopAll();
});

/** What the gateway says last to one that sends this first. */
function lastWord(page, first, token = "") {
  return page.evaluate(
    ([message, query]) =>
      new Promise((done) => {
        const socket = new WebSocket(`ws://${location.host}/sensors/left/calibrate${query}`);
        let last = "";
        socket.onopen = () => socket.send(message);
        socket.onmessage = ({ data }) => (last = data);
        socket.onclose = () => done(last);
      }),
    [first, token && `?token=${token}`],
  );
}

test("presses become a calibration that the daemon uses", async () => {
  await pane.getByRole("button", { name: "Calibrate…" }).click();
  const guide = view.page.getByRole("dialog", { name: "Guided calibration" });
  // The values of the calibration in use.
  assert.equal(await guide.getByLabel("Millimetres per pixel").inputValue(), "0.0413793");
  assert.equal(await guide.getByLabel("Map's width, pixels").inputValue(), "500");
  assert.equal(await guide.getByLabel("Map's height, pixels").inputValue(), "400");
  // Wider than high, so that swapped axes show.
  await guide.getByLabel("Map's width, pixels").fill("560");
  await guide.getByLabel("Map's height, pixels").fill("520");
  await guide.getByRole("button", { name: "Begin" }).click();
  const said = guide.getByLabel("Said", { exact: true });
  const done = /the daemon uses calibration left-\d{8}-\d{6} from now on/;
  let refused;
  // The session asks again at a place with a press.
  const end = Date.now() + 300_000;
  while (Date.now() < end && !done.test(await said.textContent())) {
    const answer = guide.getByRole("button", { name: /^(take the press|take the images|yes)$/ });
    if (await answer.isVisible()) await answer.click({ timeout: 1000 }).catch(() => {});
    if (!refused && /press-01 taken/.test(await said.textContent())) {
      refused = await lastWord(view.page, JSON.stringify(START));
      await guide.screenshot({ path: path.join(work, "guide.png") });
    }
    await view.page.waitForTimeout(100);
  }
  const words = await said.textContent();
  assert.match(words, /reference taken: 32 frames/);
  assert.match(words, /press-06 taken/);
  assert.match(words, done);
  assert.match(refused, /somebody calibrates this sensor already/);
  assert.ok((await guide.locator(".depths circle").count()) >= 6);
  assert.match(await guide.locator(".depths").textContent(), /the LUT reaches [\d.]+ mm/);
  // As large as the map, with the presses' circles on it.
  const canvas = guide.locator("canvas");
  assert.equal(await canvas.evaluate(({ width, height }) => `${width} ${height}`), "560 520");
  await guide.screenshot({ path: path.join(work, "guide-done.png") });
  await until(
    () => guide.getByRole("button", { name: "Close" }).isVisible(),
    (visible) => visible,
    10_000,
  );
  await guide.getByRole("button", { name: "Close" }).click();
  assert.equal(await guide.count(), 0);
  const { name } = status(left).calibration;
  assert.deepEqual(readdirSync(folder), [name]);
  const panel = pane.getByLabel("Calibrations");
  await until(
    () => panel.textContent(),
    (text) => text.includes(name) && text.includes("in use"),
    10_000,
  );
});

test("the scale comes from a line along a known length", async () => {
  await pane.getByRole("radio", { name: "Camera" }).click();
  await pane.getByRole("radio", { name: "Line" }).click();
  const marks = pane.locator("canvas.marks");
  const point = async (x, y) => {
    const box = await marks.boundingBox();
    await view.page.mouse.move(box.x + x * box.width, box.y + y * box.height);
  };
  // Once the camera's picture is there, which has another shape.
  await until(
    async () => {
      await point(0.3, 0.3);
      return pane.locator(".readout").textContent();
    },
    (text) => text.startsWith("grey"),
    10_000,
  );
  await point(0.2, 0.3);
  await view.page.mouse.down();
  await point(0.5, 0.7);
  await view.page.mouse.up();
  // 800 x 600: 240 columns and 240 rows, but for a pixel at each end.
  const pixels = Number(/A–B ([\d.]+) pixels/.exec(await pane.locator(".readout").textContent())[1]);
  assert.ok(Math.abs(pixels - 339.4) < 3, `${pixels}`);
  await pane.getByRole("button", { name: "Calibrate…" }).click();
  const guide = view.page.getByRole("dialog", { name: "Guided calibration" });
  await guide.getByLabel("Length of the drawn line, mm").fill("14");
  const scale = Number(await guide.getByLabel("Millimetres per pixel").inputValue());
  assert.ok(Math.abs(scale - 14 / pixels) < 1e-5, `${scale}`);
  await guide.getByRole("button", { name: "Begin" }).click();
  const words = await until(
    () => guide.getByLabel("Said", { exact: true }).textContent(),
    (text) => text.includes("scale: "),
    20_000,
  );
  const [, found, ...points] =
    /scale: ([\d.]+) mm per pixel, from a ruler, 14 mm from (\d+), (\d+) to (\d+), (\d+)/.exec(words);
  assert.ok(Math.abs(Number(found) - scale) < 1e-5, words);
  [160, 180, 400, 420].forEach((wanted, i) => assert.ok(Math.abs(points[i] - wanted) <= 2, words));
  await guide.getByRole("button", { name: "end the session" }).click();
  await guide.getByRole("button", { name: "Close" }).click();
  await pane.getByRole("radio", { name: "Depth" }).click();
});

test("what cannot be is refused in words", async () => {
  assert.match(await lastWord(view.page, "nonsense"), /GuidedStart in JSON/);
  assert.equal(await lastWord(view.page, "x".repeat(5000)), "");
  assert.match(
    await lastWord(view.page, JSON.stringify({ ...START, radius_mm: 0 })),
    /--radius-mm/,
  );
});

test("one that may only look may not calibrate", async () => {
  const { file, token } = tokenFile("view");
  const gateway = await startGateway({ left: left.port }, [
    "--tokens",
    file,
    "--work-folder",
    folder,
  ]);
  const viewer = await open(gateway);
  try {
    // Without a token there is no WebSocket; a page is not told why, only the browser is.
    const refused = [];
    viewer.page.on("websocket", (socket) => socket.on("socketerror", (why) => refused.push(why)));
    assert.equal(await lastWord(viewer.page, JSON.stringify(START)), "");
    await until(
      () => refused.join(),
      (reasons) => /401|Authentication failed/.test(reasons),
      10_000,
    );
    assert.match(
      await lastWord(viewer.page, JSON.stringify(START), token),
      /may not calibrate: connect with a token that allows calibrate/,
    );
    await viewer.page.getByLabel("Token").fill(token);
    await viewer.page.getByLabel("Token").press("Enter");
    await until(
      () => viewer.page.locator(".calibrations li").count(),
      (count) => count > 0,
    );
    assert.equal(await viewer.page.getByRole("button", { name: "Calibrate…" }).isVisible(), false);
  } finally {
    await viewer.close();
  }
});
