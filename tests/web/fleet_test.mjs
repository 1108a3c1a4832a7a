// The list of all sensors: four daemons, of which one has no calibration and one is away.
import assert from "node:assert/strict";
import path from "node:path";
import { after, before, test } from "node:test";
import { accessibilityFaults, DESKTOP, open, PHONE, until } from "./browser.mjs";
import { startDaemon, startGateway, stopAll, work } from "./programs.mjs";

let view;
let fleet;
let last;

/** The texts of a row's parts. */
async function rowOf(name) {
  const row = fleet.locator("> ul > li", { has: view.page.getByRole("button", { name, exact: true }) });
  const text = async (part) => (await row.locator(part).textContent()) ?? "";
  return {
    well: await row.getAttribute("data-well"),
    state: await text(".state"),
    fps: await text(".fps"),
    version: await text(".version"),
    flags: await row.locator(".health li").allTextContents(),
    advice: await text(".more p"),
  };
}

before(async () => {
  const nothing = ["camera.sim.scene=", "camera.fps=10"];
  const daemons = {};
  for (const name of ["index_left", "index_right"])
    daemons[name] = (await startDaemon(name, 0, nothing)).port;
  const bare = await startDaemon("thumb", 0, [...nothing, "calibration=", "camera.sim.calibration="]);
  last = await startDaemon("palm", 0, nothing);
  view = await open(await startGateway({ ...daemons, thumb: bare.port, palm: last.port }));
  fleet = view.page.locator(".fleet");
});

after(async () => {
  await view?.close();
  await stopAll();
});

test("each daemon has a row with state, rate, version and what to do", async () => {
  await view.page.getByRole("button", { name: "Fleet" }).click();
  assert.ok(await view.page.locator(".chooser").isHidden());
  const left = await until(
    () => rowOf("index_left"),
    ({ state, fps }) => state === "serving" && !/^0/.test(fps),
  );
  assert.match(left.fps, /^\d+\.\d fps$/);
  assert.match(left.version, /^\d+\.\d+\.\d+/);
  const bare = await until(
    () => rowOf("thumb"),
    ({ state }) => state === "uncalibrated",
  );
  assert.equal(bare.well, "false");
  assert.ok(bare.flags.includes("uncalibrated"), bare.flags.join());
  assert.match(bare.advice, /dtact-calibrate guided/);
  await last.stop();
  const gone = await until(
    () => rowOf("palm"),
    ({ state }) => state === "away",
  );
  assert.deepEqual([gone.well, gone.fps, gone.flags.length], ["false", "", 0]);
  assert.match(gone.advice, /dtactd/);
  assert.match(await fleet.getByRole("status").textContent(), /^4 sensors, \d not well$/);
});

test("any of them is opened", async () => {
  const pane = view.page.locator('[data-sensor="thumb"]');
  assert.equal(await pane.count(), 0);
  const button = fleet.getByRole("button", { name: "thumb" });
  await button.click();
  await pane.waitFor();
  await until(
    () => button.getAttribute("aria-pressed"),
    (pressed) => pressed === "true",
    5000,
  );
  await button.click();
  await until(
    () => pane.count(),
    (count) => count === 0,
    5000,
  );
});

/** Addresses of the list. */
const LIST = /\/fleet(\?.*)?$/;

test("a sensor that the gateway has no longer leaves the list", async () => {
  const palm = fleet.getByRole("button", { name: "palm" });
  assert.equal(await palm.count(), 1);
  await view.page.route(LIST, async (route) => {
    const response = await route.fetch();
    const entries = await response.json();
    await route.fulfill({ response, json: entries.filter(({ name }) => name !== "palm") });
  });
  const shown = (wanted) => until(() => palm.count(), (count) => count === wanted, 10_000);
  await shown(0);
  assert.match(await fleet.getByRole("status").textContent(), /^3 sensors/);
  await view.page.unroute(LIST);
  await shown(1);
});

// Before: the panes that were shown were closed, and their recordings ended.
test("panes stay while a gateway that was started again finds no sensor yet", async () => {
  const panes = view.page.locator(".pane");
  const buttons = view.page.locator(".chooser button");
  assert.equal(await panes.count(), 2);
  await view.page.route("**/sensors", (route) => route.fulfill({ json: [] }));
  await until(() => buttons.count(), (count) => count === 0, 10_000);
  await view.page.unroute("**/sensors");
  await until(() => buttons.count(), (count) => count === 4, 10_000);
  assert.equal(await panes.count(), 2);
});

test("a refused token does not hide one that is good", async () => {
  const enter = (...names) =>
    view.page.evaluate((names) => {
      sessionStorage.clear();
      for (const name of names) sessionStorage.setItem(`dtact token ${name}`, `of ${name}`);
    }, names);
  await enter("index_left", "index_right");
  // Whichever the page tries first is refused.
  const tried = [];
  await view.page.route(LIST, (route) => {
    tried.push(new URL(route.request().url()).searchParams.get("token"));
    return tried.at(-1) === tried[0] ? route.fulfill({ status: 401 }) : route.fallback();
  });
  await until(() => tried.length, (count) => count >= 3, 10_000);
  assert.notEqual(tried[1], tried[0]);
  assert.equal(tried[2], tried[1]);
  await until(
    () => fleet.getByRole("status").textContent(),
    (text) => /^4 sensors/.test(text),
    10_000,
  );
  await view.page.unroute(LIST);
  await enter();
  // The console reports the refusal.
  const reported = view.complaints.splice(0);
  assert.ok(reported.every((text) => text.includes("401")), reported.join("\n"));
});

test("it fits a desktop and a phone, and axe-core finds nothing", async () => {
  for (const [name, size] of Object.entries({ desktop: DESKTOP, phone: PHONE })) {
    await view.page.setViewportSize(size);
    await until(
      () => view.page.evaluate(() => document.documentElement.scrollWidth),
      (width) => width <= size.width,
      5000,
    );
    for (const row of await fleet.locator("> ul > li > *").all()) {
      const box = await row.boundingBox();
      assert.ok(!box || (box.x >= 0 && box.x + box.width <= size.width), `${box?.x}, ${box?.width}`);
    }
    await view.page.evaluate(() => scrollTo(0, 0));
    await view.page.screenshot({ path: path.join(work, `fleet-${name}.png`) });
  }
  assert.deepEqual(await accessibilityFaults(view.page), []);
});
