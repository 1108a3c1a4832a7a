// The page's cost: memory that must not grow, and the main thread's time for a frame, which is
// measured and printed, not judged: a machine without a graphics card draws in software. WEB_SECONDS (12)
// is the duration, WEB_FPS the daemon's frame rate.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { test } from "node:test";
import { open, until } from "./browser.mjs";
import { startDaemon, startGateway, stopAll, work } from "./programs.mjs";

const SECONDS = Number(process.env.WEB_SECONDS ?? "12");
const wait = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));

/** Milliseconds of the page's main thread, computing and with what it waited for; pictures drawn. */
function mainThread(trace) {
  const named = trace.filter(
    (event) => event.name === "thread_name" && event.args.name === "CrRendererMain",
  );
  const frames = (thread) =>
    trace.filter(
      (event) =>
        event.pid === thread.pid && event.tid === thread.tid && event.name === "FireAnimationFrame",
    );
  // The main thread of the renderer that draws.
  const thread = named.sort((a, b) => frames(b).length - frames(a).length)[0];
  const mine = trace.filter(
    (event) => event.pid === thread.pid && event.tid === thread.tid && event.ph === "X",
  );
  // Of nested tasks the outer one counts.
  const tasks = mine.filter((event) => /RunTask$/.test(event.name)).sort((a, b) => a.ts - b.ts);
  let [busyUs, takenUs, end] = [0, 0, 0];
  for (const task of tasks) {
    if (task.ts >= end) {
      busyUs += task.tdur ?? 0;
      takenUs += task.dur;
      end = task.ts + task.dur;
    }
  }
  return { busyMs: busyUs / 1000, takenMs: takenUs / 1000, pictures: frames(thread).length };
}

test("memory does not grow, and what a frame costs", async (t) => {
  const daemon = await startDaemon("left");
  const gateway = await startGateway({ left: daemon.port });
  const view = await open(gateway);
  try {
    const { page } = view;
    const pane = page.locator('[data-sensor="left"]');
    await until(
      () => pane.getAttribute("data-sequence"),
      (sequence) => Number(sequence) > 0,
    );
    const session = await page.context().newCDPSession(page);
    await session.send("Performance.enable");
    const heap = async () => {
      await session.send("HeapProfiler.collectGarbage");
      const { metrics } = await session.send("Performance.getMetrics");
      return metrics.find((metric) => metric.name === "JSHeapUsedSize").value / 2 ** 20;
    };
    const nodes = async () => (await session.send("Memory.getDOMCounters")).nodes;
    const browser = await page.context().browser()?.newBrowserCDPSession();
    const renderers = async () => {
      const { processInfo } = (await browser?.send("SystemInfo.getProcessInfo")) ?? {
        processInfo: [],
      };
      const resident = processInfo
        .filter(({ type }) => type === "renderer")
        .map(
          ({ id }) =>
            Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${id}/status`, "utf8"))[1]) / 1024,
        );
      return Math.max(0, ...resident);
    };
    await wait(2);
    const first = { heap: await heap(), nodes: await nodes() };
    await wait(SECONDS / 2);
    const middle = await renderers();
    await wait(SECONDS / 2);
    const last = { heap: await heap(), nodes: await nodes() };
    const resident = await renderers();
    t.diagnostic(`heap ${first.heap.toFixed(1)} to ${last.heap.toFixed(1)} MiB in ${SECONDS} s`);
    t.diagnostic(
      `the renderer's memory ${middle.toFixed(0)} to ${resident.toFixed(0)} MiB in the second half`,
    );
    assert.ok(last.heap - first.heap < 2, `${first.heap} MiB of heap grew to ${last.heap}`);
    assert.ok(last.nodes - first.nodes < 50, `${first.nodes} nodes grew to ${last.nodes}`);

    const traced = await page.context().newCDPSession(page);
    const events = [];
    traced.on("Tracing.dataCollected", ({ value }) => events.push(...value));
    const complete = new Promise((done) => traced.once("Tracing.tracingComplete", done));
    const categories =
      "devtools.timeline,disabled-by-default-devtools.timeline,toplevel,__metadata";
    const before = Number(await pane.getAttribute("data-sequence"));
    await traced.send("Tracing.start", { categories, transferMode: "ReportEvents" });
    await wait(5);
    await traced.send("Tracing.end");
    await complete;
    writeFileSync(path.join(work, "trace.json"), JSON.stringify(events));
    const made = Number(await pane.getAttribute("data-sequence")) - before;
    const { busyMs, takenMs, pictures } = mainThread(events);
    const rate = await pane.locator('[data-fact="rate"]').textContent();
    const renderer = await page.evaluate(() => {
      const gl = document.createElement("canvas").getContext("webgl2");
      const info = gl.getExtension("WEBGL_debug_renderer_info");
      return gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
    });
    const [computed, taken] = [busyMs, takenMs].map((ms) => (ms / pictures).toFixed(2));
    t.diagnostic(
      `main thread: ${computed} ms computing a picture, ${taken} ms with waiting for the compositor`,
    );
    t.diagnostic(`${pictures} pictures of ${made} frames in 5 s`);
    t.diagnostic(`${rate}; drawn by ${renderer}`);
    assert.ok(pictures > 0, "no picture in 5 s");
  } finally {
    await view.close();
    await stopAll();
  }
});
