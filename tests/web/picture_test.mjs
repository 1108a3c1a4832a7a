// The page in the state that README shows: an M4 nut on the simulated sensor, with depth along a line. The picture
// stays in FOLDER/run-picture-*/page.png.
import assert from "node:assert/strict";
import { statSync } from "node:fs";
import path from "node:path";
import { test } from "node:test";
import { numberOf, open, until } from "./browser.mjs";
import { startDaemon, startGateway, stopAll, work } from "./programs.mjs";

test("picture, numbers, profile and plots on one screen", async () => {
  // A machine that leaves frames out is flagged, which moves the plots down.
  const daemon = await startDaemon("left", 0, ["camera.sim.scene=", "camera.fps=10", "reference.frames=16"]);
  const gateway = await startGateway({ left: daemon.port });
  const view = await open(gateway);
  try {
    const pane = view.page.locator('[data-sensor="left"]');
    // The built-in scene's ball, nut and cylinder, and the nut again.
    for (const deepest of [1.2, 0.76, 0.8, 1.2]) {
      await until(
        () => numberOf(pane, "deepest"),
        (mm) => Math.abs(mm - deepest) < 0.06,
      );
      await until(
        () => pane.locator('[data-fact="inContact"]').textContent(),
        (text) => text === "no contact",
      );
    }
    await pane.getByRole("radio", { name: "Line" }).click();
    const box = await pane.locator("canvas.marks").boundingBox();
    await view.page.mouse.move(box.x + 0.15 * box.width, box.y + 0.56 * box.height);
    await view.page.mouse.down();
    await view.page.mouse.move(box.x + 0.52 * box.width, box.y + 0.61 * box.height);
    await view.page.mouse.up();
    await view.page.mouse.move(box.x, box.y - 20);
    await until(
      () => numberOf(pane, "centroid"),
      (x) => Math.abs(x + 4) < 0.1,
    );
    // Wait until it is pressed to its depth and the plots show it.
    await new Promise((done) => setTimeout(done, 900));
    await until(
      () => pane.locator(".health li").count(),
      (flags) => flags === 0,
    );
    const file = path.join(work, "page.png");
    await view.page.screenshot({ path: file });
    assert.ok(statSync(file).size < 200_000, `${statSync(file).size} bytes`);
    const plots = await pane.locator(".plots").boundingBox();
    assert.ok(plots.y + plots.height <= 900, `the plots end at ${plots.y + plots.height}`);
    assert.ok(await pane.locator("figure.profile").isVisible());
  } finally {
    await view.close();
    await stopAll();
  }
});
