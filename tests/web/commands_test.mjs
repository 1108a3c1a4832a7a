// Commands of the page: light, re-zero, calibrations, reconstruction, and clients without the right to them.
import assert from "node:assert/strict";
import path from "node:path";
import { after, before, test } from "node:test";
import { fact, numberOf, open, until } from "./browser.mjs";
import { calibration, startDaemon, startGateway, status, stopAll, tokenFile } from "./programs.mjs";

let left;
let view;
let pane;

before(async () => {
  // A LUT from the known ball alone comes without LUTs for sharpened levels.
  left = await startDaemon("left", 0, [`calibration=${calibration("list")}`]);
  view = await open(await startGateway({ left: left.port }));
  pane = view.page.locator('[data-sensor="left"]');
});

after(async () => {
  await view?.close();
  await stopAll();
});

test("a re-zero during contact is refused in words, and offered anyway", async () => {
  await until(
    () => fact(pane, "inContact").textContent(),
    (text) => text === "in contact",
  );
  await pane.getByRole("button", { name: "Re-zero", exact: true }).click();
  const answer = pane.getByLabel("Light", { exact: true }).locator(".answer");
  await until(
    () => answer.textContent(),
    (text) => text !== "" && text !== "Taking a new reference.",
    10_000,
  );
  assert.match(await answer.textContent(), /there is contact|still/);
  assert.ok(await pane.getByRole("button", { name: "Re-zero anyway" }).isVisible());
});

test("slider, scheme and colour change the simulated light", async () => {
  await pane.getByLabel("Brightness").fill("128");
  await until(
    () => status(left).light.brightness,
    (brightness) => brightness === 128,
    10_000,
  );
  await pane.getByRole("button", { name: "Scheme 1" }).click();
  const lit = () =>
    status(left)
      .light.leds.map((led) => ((led.r ?? 0) > 0 ? 1 : 0))
      .join("");
  await until(lit, (leds) => leds === "11001100", 10_000);
  await pane.getByRole("button", { name: "LED 2" }).click();
  await pane.getByLabel("Colour of the LED").fill("#ff8000");
  await until(
    () => status(left).light.leds[2],
    (led) => led.r === 255 && led.g === 128 && (led.b ?? 0) === 0,
    10_000,
  );
  await pane.getByRole("button", { name: "All LEDs" }).click();
  await pane.getByLabel("Brightness").fill("255");
  await until(
    () => status(left).light.brightness,
    (brightness) => brightness === 255,
    10_000,
  );
});

test("the difference waits for the reference of a changed light", async () => {
  await pane.getByRole("radio", { name: "Difference" }).click();
  const cover = pane.locator(".veil p");
  await until(
    () => cover.textContent(),
    (text) => text === "",
  );
  // All that it says, however short.
  await cover.evaluate((sentence) => {
    window.covers = new Set();
    const add = () => window.covers.add(sentence.textContent);
    new MutationObserver(add).observe(sentence, { childList: true, characterData: true, subtree: true });
  });
  await pane.getByLabel("Brightness").fill("128");
  await until(
    () => view.page.evaluate(() => [...window.covers]),
    (covers) => covers.includes("Waiting for the reference."),
    20_000,
  );
  await until(
    () => cover.textContent(),
    (text) => text === "",
  );
  await pane.getByLabel("Brightness").fill("255");
  await pane.getByRole("radio", { name: "Depth" }).click();
});

test("a snapshot has the time of its map, not that of a newer frame without one", async () => {
  const sentence = pane.locator(".veil p");
  const cover = () => sentence.textContent();
  await sentence.evaluate((element) => {
    const look = () => (window.uncovered ||= element.textContent === "");
    new MutationObserver(look).observe(element, { childList: true, characterData: true, subtree: true });
  });
  const snapshot = async () => {
    const coming = view.page.waitForEvent("download");
    await pane.getByRole("button", { name: "Snapshot" }).click();
    return (await coming).suggestedFilename();
  };
  // Without a map while a changed light settles, which may be over before the second one.
  for (let tries = 0; ; ++tries) {
    assert.ok(tries < 20, "each time there was a map again");
    await until(cover, (text) => text === "");
    await pane.getByLabel("Brightness").fill(tries % 2 === 0 ? "128" : "255");
    await until(cover, (text) => text !== "", 10_000);
    await view.page.evaluate(() => (window.uncovered = false));
    if ((await cover()) === "") continue;
    const first = await snapshot();
    await new Promise((done) => setTimeout(done, 100));
    const second = await snapshot();
    if (await view.page.evaluate(() => window.uncovered)) continue;
    assert.equal(second, first);
    break;
  }
  await pane.getByLabel("Brightness").fill("255");
});

test("exposure and gain are changed within the camera's range, and refused beyond in words", async () => {
  const panel = pane.getByLabel("Camera", { exact: true });
  // Shown with the first status.
  await until(
    () => panel.textContent(),
    (text) => text.includes("Exposureµs2500 to 20000Gain1 to 2"),
    10_000,
  );
  await panel.locator("summary").click();
  const exposure = panel.getByLabel("Exposure");
  await exposure.fill("4170");
  await exposure.press("Enter");
  await until(
    () => status(left).camera.settings.exposure_us.value,
    (value) => Math.abs(value - 4170) < 0.01,
    10_000,
  );
  await until(
    () => panel.locator(".answer").textContent(),
    (text) => text.startsWith("Set until the daemon ends"),
    10_000,
  );
  await panel.getByLabel("Gain").fill("7");
  await panel.getByLabel("Gain").press("Enter");
  await until(
    () => panel.locator(".answer").textContent(),
    (text) => text === "set_camera.gain: 7; this camera has 1 to 2",
    10_000,
  );
  await exposure.fill("10000");
  await exposure.press("Enter");
  await until(
    () => status(left).camera.settings.exposure_us.value,
    (value) => value === 10000,
    10_000,
  );
});

test("depth is made as the panel says, and its worth and time are on the chart", async () => {
  const panel = pane.getByLabel("Speed and accuracy");
  const reported = () => panel.locator("[data-fact=worth]").textContent();
  await until(reported, (text) => /^full: [\d.]+ ms, ± \d+ µm$/.test(text));
  await panel.locator("summary").click();
  await panel.getByRole("radio", { name: "Quarter" }).click();
  await until(
    () => status(left).reconstruction.resolution,
    (resolution) => resolution === "quarter",
    10_000,
  );
  await until(
    () => fact(pane, "map").textContent(),
    (text) => text === "125 × 100, quarter",
  );
  await until(reported, (text) => text.startsWith("quarter: "));
  // The faster variant depends on the machine; the chart orders them by the measured time.
  const dots = await panel.locator("circle").evaluateAll((circles) =>
    circles.map((circle) => ({
      right: Number(circle.getAttribute("cx")),
      seen: circle.classList.contains("seen"),
      reported: circle.textContent,
    })),
  );
  const seen = dots.filter((dot) => dot.seen).map(({ reported }) => reported.split(":")[0]);
  assert.deepEqual(seen, ["full", "quarter"]);
  const ms = dots
    .sort((a, b) => a.right - b.right)
    .map(({ reported }) => Number(/([\d.]+) ms/.exec(reported)[1]));
  assert.deepEqual(
    ms,
    [...ms].sort((a, b) => a - b),
  );
  await panel
    .getByRole("radiogroup", { name: "Resolution" })
    .getByRole("radio", { name: "Auto" })
    .click();
  await panel.getByLabel("Error bound").fill("200");
  await panel.getByLabel("Error bound").press("Enter");
  await until(
    () => status(left).reconstruction,
    ({ resolution, max_error_um: bound }) => resolution === "auto" && bound === 200,
    10_000,
  );
  await until(
    () => panel.locator("line.bound").count(),
    (count) => count === 1,
    10_000,
  );
  await panel
    .getByRole("radiogroup", { name: "Sharpen" })
    .getByRole("radio", { name: "2" })
    .click();
  await until(
    () => panel.locator(".answer").textContent(),
    (text) =>
      text.startsWith("reconstruction.sharpen is 2, but the calibration has no LUT for levels"),
    10_000,
  );
  assert.equal(status(left).reconstruction.sharpen, "off");
  const off = panel
    .getByRole("radiogroup", { name: "Sharpen" })
    .getByRole("radio", { name: "Off" });
  assert.equal(await off.getAttribute("aria-checked"), "true");
  await panel.getByRole("radio", { name: "Full" }).click();
  // Until it is made, the daemon refuses an upload as busy.
  await until(
    () => status(left).reconstruction.resolution,
    (resolution) => resolution === "full",
    10_000,
  );
});

test("a calibration is uploaded, used and left again; a bad one is refused in words", async () => {
  const panel = pane.getByLabel("Calibrations");
  await until(
    () => panel.locator("li").count(),
    (count) => count === 1,
    10_000,
  );
  const picker = panel.locator("input[type=file]");
  const folder = calibration();
  await picker.setInputFiles([
    path.join(folder, "calibration.toml"),
    path.join(folder, "reference.png"),
  ]);
  await until(
    () => panel.locator("li").count(),
    (count) => count === 2,
    30_000,
  );
  await until(
    () => panel.locator("li", { hasText: "in use" }).textContent(),
    (text) => /^1 web-/.test(text),
    10_000,
  );
  await panel.getByRole("button", { name: /configured/ }).click();
  await until(
    () => panel.locator("li", { hasText: "in use" }).textContent(),
    (text) => /configured/.test(text),
    10_000,
  );
  const before = await panel.locator(".answer").textContent();
  await picker.setInputFiles([
    { name: "calibration.toml", mimeType: "text/plain", buffer: Buffer.from("nonsense") },
    { name: "reference.png", mimeType: "image/png", buffer: Buffer.from("no picture") },
  ]);
  await until(
    () => panel.locator(".answer").textContent(),
    (text) => ![before, "", "Uploading."].includes(text),
    10_000,
  );
  await picker.setInputFiles([
    { name: "other.toml", mimeType: "text/plain", buffer: Buffer.from("") },
  ]);
  await until(
    () => panel.locator(".answer").textContent(),
    (text) => text.includes("Choose both calibration.toml and reference.png"),
    10_000,
  );
  await picker.setInputFiles([
    { name: "calibration.toml", mimeType: "text/plain", buffer: Buffer.from("") },
    { name: "reference.png", mimeType: "image/png", buffer: Buffer.alloc(2 ** 24) },
  ]);
  await until(
    () => panel.locator(".answer").textContent(),
    (text) => text.includes("too large"),
    10_000,
  );
});

test("a token that may watch sees no control that would fail", async () => {
  const { file, token } = tokenFile("view");
  const guarded = await startGateway({ left: left.port }, ["--tokens", file]);
  const watching = await open(guarded);
  try {
    const form = watching.page.locator("form.token");
    await form.waitFor();
    await form.getByLabel("Token").fill("wrong");
    await form.getByRole("button").click();
    await form.waitFor({ state: "hidden" });
    await form.waitFor();
    await form.getByLabel("Token").fill("x".repeat(300));
    await form.getByRole("button").click();
    await until(
      () => watching.page.locator(".pane .notice").textContent(),
      (text) => text.includes("hello.token"),
      10_000,
    );
    await form.waitFor();
    await form.getByLabel("Token").fill(token);
    await form.getByRole("button").click();
    await until(
      () => watching.page.locator("[data-sensor]").getAttribute("data-sequence"),
      (sequence) => Number(sequence) > 0,
      20_000,
    );
    const light = watching.page.getByLabel("Light", { exact: true });
    assert.equal(await light.getByRole("button", { name: "Re-zero" }).isVisible(), false);
    assert.equal(await light.getByLabel("Brightness").isDisabled(), true);
    assert.equal(await watching.page.getByRole("button", { name: "Upload…" }).isVisible(), false);
    assert.match(await light.textContent(), /may watch/);
  } finally {
    await watching.close();
    await guarded.stop();
  }
});
