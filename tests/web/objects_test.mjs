// Teaching on the page: the gateway runs dtact-calibrate on a sensor that a star is pressed into, each time
// at another place and turned. dtact-perceive, which reads the same folder, then names it.
import assert from "node:assert/strict";
import { existsSync, readdirSync, writeFileSync } from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import { open, until } from "./browser.mjs";
import { startDaemon, startGateway, startPerceive, stopAll, tokenFile, work } from "./programs.mjs";

const taught = path.join(work, "taught");

let left;
let view;
let pane;
let panel;

/** Twelve presses of a star, repeatedly: held for two seconds, and off for a second and a half. */
function scene() {
  const keys = Array.from({ length: 12 }, (_, i) => {
    const begin = 2 + 3.5 * i;
    const [x, y] = [2.4 * Math.cos(1.9 * i) + 0.5, 1.5 * Math.sin(1.9 * i) - 0.3];
    return `  { t = ${begin}, x = ${x.toFixed(2)}, y = ${y.toFixed(2)}, rotation = ${29 * i}, depth = -0.3 },
  { t = ${begin + 0.3}, depth = ${0.8 + 0.02 * (i % 5)} },
  { t = ${begin + 2.3} },
  { t = ${begin + 2.6}, depth = -0.3 },`;
  });
  const file = path.join(work, "stars.toml");
  writeFileSync(
    file,
    `[loop]\nfrom_s = 1.5\nto_s = 44\n[[press]]\nobject = "star"\nradius_mm = 4\nkeys = [\n${keys.join("\n")}\n]\n`,
  );
  return file;
}

before(async () => {
  left = await startDaemon("left", 0, [`camera.sim.scene=${scene()}`]);
  const touch = await startPerceive(left.port, 0, ["--taught", taught]);
  view = await open(
    await startGateway({ left: left.port, touch: touch.port }, [
      "--work-folder",
      path.join(work, "sessions"),
      "--taught",
      taught,
    ]),
  );
  pane = view.page.locator('[data-sensor="left"]');
  panel = pane.getByRole("group", { name: "Taught objects" });
});

after(async () => {
  await view?.close();
  await stopAll();
});

const listed = () => panel.locator("li").allTextContents();

test("ten presses teach an object that dtact-perceive names", async () => {
  await panel.getByRole("heading", { name: "Taught objects" }).click();
  await panel.getByRole("button", { name: "Teach…" }).click();
  const lesson = view.page.getByRole("dialog", { name: "Teach an object" });
  await lesson.getByLabel("Name of the object").fill("left lid");
  await lesson.screenshot({ path: path.join(work, "teach-form.png") });
  // All that it asks for, however short.
  await lesson.locator(".prompt").evaluate((prompt) => {
    window.asked = new Set();
    const add = () => window.asked.add(prompt.textContent);
    new MutationObserver(add).observe(prompt, { childList: true, characterData: true, subtree: true });
  });
  await lesson.getByRole("button", { name: "Begin" }).click();
  const said = () => lesson.getByLabel("Said", { exact: true }).textContent();
  await until(said, (text) => text.includes("press 3 of 10 taken"));
  await lesson.screenshot({ path: path.join(work, "teach.png") });
  await lesson.getByRole("button", { name: "take the last press back" }).click();
  const words = await until(said, (text) => text.includes("stored"), 150_000);
  const asked = await view.page.evaluate(() => [...window.asked]);
  for (const line of ["Press again: turned, or with another side", "Hold it still", "Lift it"])
    assert.ok(asked.includes(line), asked.join());
  await until(
    () => lesson.locator('[data-fact="presses"]').textContent(),
    (text) => text === "10 of 10",
    5000,
  );
  const result = await until(said, (text) => /all 10 look like left lid|are like no other press/.test(text), 5000);
  assert.equal(words.match(/press \d+ of 10 taken/g).length, 11, words);
  assert.ok(result.includes(`serve --taught ${taught}`), result);
  await lesson.getByRole("button", { name: "Close" }).waitFor();
  await lesson.screenshot({ path: path.join(work, "teach-done.png") });
  await lesson.getByRole("button", { name: "Close" }).click();
  assert.deepEqual(readdirSync(taught), ["left lid.png"]);
  await until(listed, (items) => items.length === 1 && items[0].startsWith("left lid10 presses"));
  // Read without a restart.
  const object = view.page.locator('[data-sensor="touch"] .object strong');
  await until(() => object.textContent(), (name) => name === "left lid", 30_000);
  await view.page.screenshot({ path: path.join(work, "taught.png") });
});

test("an object is renamed and forgotten", async () => {
  await panel.getByRole("button", { name: "Rename…" }).click();
  await panel.getByLabel("New name of left lid").fill("../lid");
  await panel.getByRole("button", { name: "Rename", exact: true }).click();
  await until(() => panel.locator(".answer").textContent(), (text) => /no name of an object/.test(text));
  await panel.getByLabel("New name of left lid").fill("right lid");
  await panel.getByRole("button", { name: "Rename", exact: true }).click();
  await until(listed, (items) => items.length === 1 && items[0].startsWith("right lid"));
  const object = view.page.locator('[data-sensor="touch"] .object strong');
  await until(() => object.textContent(), (name) => name === "right lid", 30_000);
  await panel.screenshot({ path: path.join(work, "objects.png") });
  writeFileSync(path.join(taught, "torn.png"), "no picture");
  await panel.getByRole("button", { name: "Forget" }).click();
  await until(listed, (items) => items.length === 1 && items[0].includes("forget torn, or teach it again"));
  await panel.getByRole("button", { name: "Forget" }).click();
  await until(listed, (items) => items.length === 0);
  assert.equal(existsSync(path.join(taught, "right lid.png")), false);
});

test("what is no name, or ended early, stores nothing", async () => {
  await panel.getByRole("button", { name: "Teach…" }).click();
  const lesson = view.page.getByRole("dialog", { name: "Teach an object" });
  await lesson.getByLabel("Name of the object").fill("--help");
  await lesson.getByRole("button", { name: "Begin" }).click();
  await until(
    () => lesson.getByRole("alert").textContent(),
    (text) => text.includes('"--help" is no name of an object'),
    10_000,
  );
  await lesson.getByLabel("Name of the object").fill("lid");
  await lesson.getByRole("button", { name: "Begin" }).click();
  await lesson.getByRole("button", { name: "end without storing anything" }).click();
  await until(
    () => lesson.getByRole("alert").textContent(),
    (text) => text.includes("nothing is stored"),
    10_000,
  );
  await lesson.getByRole("button", { name: "Close" }).click();
  assert.deepEqual(readdirSync(taught), []);
});

/** A socket's end is reported late, as over a slow network. */
function reportLate() {
  window.WebSocket = class extends WebSocket {
    set onclose(handler) {
      super.onclose = (event) => setTimeout(() => handler.call(this, event), 4000);
    }
  };
}

// Before: it was taken for the end of the lesson that ran by then.
test("the end of an earlier lesson leaves the next one", async () => {
  const folders = ["--work-folder", path.join(work, "late"), "--taught", path.join(work, "late-taught")];
  const late = await open(await startGateway({ left: left.port }, folders), { before: reportLate });
  try {
    const objects = late.page.locator('[data-sensor="left"]').getByRole("group", { name: "Taught objects" });
    await objects.getByRole("heading", { name: "Taught objects" }).click();
    await objects.getByRole("button", { name: "Teach…" }).click();
    const lesson = late.page.getByRole("dialog", { name: "Teach an object" });
    const alert = () => lesson.locator('[role="alert"]').textContent();
    await lesson.getByLabel("Name of the object").fill("--help");
    await lesson.getByRole("button", { name: "Begin" }).click();
    await until(alert, (text) => text.includes("is no name of an object"), 10_000);
    await lesson.getByLabel("Name of the object").fill("lid");
    await lesson.getByRole("button", { name: "Begin" }).click();
    await new Promise((done) => setTimeout(done, 5000));
    assert.equal(await alert(), "");
    await lesson.getByRole("button", { name: "end without storing anything" }).click();
    await until(alert, (text) => text.includes("nothing is stored"), 10_000);
  } finally {
    await late.close();
  }
});

test("one that may only look may not teach", async () => {
  const { file, token } = tokenFile("view");
  const viewer = await open(await startGateway({ left: left.port }, ["--tokens", file]));
  try {
    await viewer.page.getByLabel("Token").fill(token);
    await viewer.page.getByLabel("Token").press("Enter");
    await until(
      () => viewer.page.locator(".calibrations li").count(),
      (count) => count > 0,
    );
    assert.equal(await viewer.page.getByRole("group", { name: "Taught objects" }).isVisible(), false);
  } finally {
    await viewer.close();
  }
});
