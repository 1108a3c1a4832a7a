// dtact-perceive behind the gateway: its points and motion on the page.
import assert from "node:assert/strict";
import path from "node:path";
import { after, before, test } from "node:test";
import { fact, numberOf, open, until } from "./browser.mjs";
import { MAP, startDaemon, startGateway, startPerceive, stopAll, work } from "./programs.mjs";

let daemon;
let port;
let view;
let pane;

before(async () => {
  daemon = await startDaemon("left");
  // Started and stopped only to get a free port.
  const perceive = await startPerceive(daemon.port);
  port = perceive.port;
  await perceive.stop();
  view = await open(await startGateway({ touch: port }));
  pane = view.page.locator('[data-sensor="touch"]');
});

after(async () => {
  await view?.close();
  await stopAll();
});

/** How much of the canvas is drawn, its middle, and how many colours there are. */
const drawn = () =>
  pane.locator(".surface canvas").evaluate((canvas) => {
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext("2d");
    // The drawing stays only until the browser has shown it.
    return new Promise((done) =>
      requestAnimationFrame(() => {
        context.drawImage(canvas, 0, 0);
        const { data } = context.getImageData(0, 0, copy.width, copy.height);
        const colours = new Set();
        let pixels = 0;
        for (let at = 0; at < data.length; at += 4) {
          if (data[at + 3] < 128) continue;
          ++pixels;
          colours.add((data[at] << 16) | (data[at + 1] << 8) | data[at + 2]);
        }
        done({ pixels, colours: colours.size });
      }),
    );
  });

test("a page that was there first takes a later dtact-perceive for what it is", async () => {
  await until(
    () => pane.getAttribute("data-link"),
    (link) => link === "away",
  );
  assert.equal(await pane.getAttribute("data-kind"), null);
  await startPerceive(daemon.port, port);
  await until(
    () => pane.getAttribute("data-kind"),
    (kind) => kind === "points",
  );
  await until(
    () => pane.getAttribute("data-sequence"),
    (sequence) => Number(sequence) > 0,
  );
});

test("points are drawn during contact, and none else", async () => {
  await until(
    () => fact(pane, "points").textContent(),
    (text) => /^\d+ points/.test(text),
  );
  const reported = await until(
    () => numberOf(pane, "points"),
    (points) => points > 500,
  );
  assert.ok(reported < MAP.width * MAP.height);
  const lit = await until(drawn, ({ pixels }) => pixels > 500);
  assert.ok(lit.colours > 20, `${lit.colours} shades of a ball`);
  await view.page.screenshot({ path: path.join(work, "points.png") });
  await until(
    () => fact(pane, "points").textContent(),
    (text) => text.startsWith("No contact"),
  );
  await until(drawn, ({ pixels }) => pixels === 0);
});

test("motion is shown, and only commands of dtact-perceive are offered", async () => {
  await until(
    () => fact(pane, "moved").textContent(),
    (text) => /mm/.test(text),
  );
  for (const name of ["Record", "Snapshot", "Re-zero"]) {
    assert.equal(await pane.getByRole("button", { name }).isVisible(), false, name);
  }
  assert.equal(await pane.locator(".tools").isVisible(), false);
});
