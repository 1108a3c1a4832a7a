// Chromium with the page in it, and helpers that read the page.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { work } from "./programs.mjs";

const { chromium } = createRequire(path.resolve(process.env.FOLDER, "browser/package.json"))(
  "playwright-core",
);

const axe = readFileSync(
  path.resolve(process.env.FOLDER, "browser/node_modules/axe-core/axe.min.js"),
  "utf8",
);

export const DESKTOP = { width: 1440, height: 900 };
export const PHONE = { width: 390, height: 844 };

// No network except loopback, and a temporary profile.
const SWITCHES = [
  "--headless",
  "--no-sandbox",
  "--disable-gpu",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--enable-unsafe-swiftshader",
];

/** Opens a page of the gateway. What its console complains of, and each foreign address, fails it. */
export async function open(gateway, { viewport = DESKTOP, dark = true, before = undefined, path: place = "/" } = {}) {
  const context = await chromium.launchPersistentContext(path.join(work, `profile-${Date.now()}`), {
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: SWITCHES,
    viewport,
    colorScheme: dark ? "dark" : "light",
  });
  const page = context.pages()[0];
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(error.stack ?? String(error)));
  page.on("console", (message) => {
    // The software renderer warns when its pixels are read.
    if (/GPU stall due to ReadPixels/.test(message.text())) return;
    // Some tests are about a daemon or a gateway that is away.
    if (/ERR_CONNECTION_REFUSED|WebSocket connection to/.test(message.text())) return;
    if (["error", "warning"].includes(message.type())) complaints.push(message.text());
  });
  page.on("request", (request) => {
    const { protocol, host } = new URL(request.url());
    if (protocol !== "blob:" && host !== `127.0.0.1:${gateway.port}`)
      complaints.push(request.url());
  });
  // Runs in the page before its own scripts.
  if (before) await page.addInitScript(before);
  await page.goto(`http://127.0.0.1:${gateway.port}${place}`);
  return {
    page,
    complaints,
    async close() {
      await context.close();
      assert.deepEqual(complaints, []);
    },
  };
}

/** What axe-core finds wrong with the page's accessibility, a line each. */
export async function accessibilityFaults(page) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => window.axe.run());
  return violations.flatMap(({ id, help, nodes }) =>
    nodes.map(({ target }) => `${id}: ${help}: ${target.join(" ")}`),
  );
}

export const fact = (root, name) => root.locator(`[data-fact="${name}"]`);

/** A number of a fact, as "0.994 mm" or "−3.2 µm" has it. */
export async function numberOf(root, name) {
  return Number((await fact(root, name).textContent()).replaceAll("−", "-").match(/-?[\d.]+/)?.[0]);
}

/** Waits until what a fact says satisfies a condition. */
export async function until(what, condition, timeoutMs = 60_000) {
  for (const end = Date.now() + timeoutMs; Date.now() < end; ) {
    const value = await what();
    if (condition(value)) return value;
    await new Promise((done) => setTimeout(done, 50));
  }
  throw new Error(`never came about: the last was ${JSON.stringify(await what())}`);
}

/** Pauses the page and says which frame it shows. */
export async function pause(pane) {
  await pane.getByRole("button", { name: "Pause" }).click();
  const reported = await until(
    () => pane.locator(".steps").textContent(),
    (text) => /frame \d+/.test(text),
  );
  return Number(/frame (\d+)/.exec(reported)[1]);
}

export async function resume(pane) {
  await pane.getByRole("button", { name: "Resume" }).click();
}

/** The map's canvas as RGBA, with its size. */
export async function canvas(pane) {
  const png = await pane.locator("canvas.map").evaluate((element) => {
    const copy = document.createElement("canvas");
    copy.width = element.width;
    copy.height = element.height;
    const context = copy.getContext("2d");
    context.drawImage(element, 0, 0);
    const { data, width, height } = context.getImageData(0, 0, copy.width, copy.height);
    let text = "";
    for (let at = 0; at < data.length; at += 8192)
      text += String.fromCharCode(...data.subarray(at, at + 8192));
    return { width, height, text: btoa(text) };
  });
  return { width: png.width, height: png.height, rgba: Buffer.from(png.text, "base64") };
}
