// A recording made in the browser, read by the command-line tools and compared with the frames of another client
// of the daemon.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { after, before, test } from "node:test";
import { fact, open, until } from "./browser.mjs";
import { calibration, startDaemon, startGateway, stopAll, work } from "./programs.mjs";
import { fields, Tap } from "./tap.mjs";

let daemon;
let tap;
let view;
let pane;

before(async () => {
  daemon = await startDaemon("left");
  tap = new Tap(daemon.port, true);
  // The same sensor twice: a page keeps at least one pane.
  view = await open(await startGateway({ left: daemon.port, other: daemon.port }));
  await choose("other");
  pane = view.page.locator('[data-sensor="left"]');
  await until(
    () => pane.getAttribute("data-sequence"),
    (sequence) => sequence !== null,
  );
});

after(async () => {
  tap?.close();
  await view?.close();
  await stopAll();
});

// A package that the page is built with.
const { McapStreamReader, McapWriter } = createRequire(path.resolve(process.env.FOLDER, "page/package.json"))(
  "@mcap/core",
);

/** The records of a recording of the page, as they stand in the file. */
function* recordsOf(recording) {
  const reader = new McapStreamReader();
  reader.append(readFileSync(recording));
  for (let record = reader.nextRecord(); record; record = reader.nextRecord()) yield record;
}

/** The messages of a topic. */
function messagesOf(recording, topic) {
  const records = [...recordsOf(recording)];
  const ids = records.filter((one) => one.type === "Channel" && one.topic === topic).map(({ id }) => id);
  return records.filter((one) => one.type === "Message" && ids.includes(one.channelId));
}

const sequencesOf = (recording, topic) => messagesOf(recording, topic).map(({ sequence }) => sequence);

const ctl = (...words) => execFileSync(process.env.DTACTCTL, words, { encoding: "utf8" });

/** The frames of a recording as dtactctl exports them, and their depth in millimetres. */
function framesOf(recording) {
  const folder = `${recording}-npy`;
  ctl("export", recording, "--to", "npy", "-o", folder);
  const [names, ...lines] = readFileSync(path.join(folder, "frames.csv"), "utf8")
    .trim()
    .split("\n")
    .map((line) => line.split(","));
  const npy = readFileSync(path.join(folder, "depth.npy"));
  const shape = /'shape': \((\d+), (\d+), (\d+)\)/.exec(npy.subarray(0, 128).toString("latin1"));
  const [, , height, width] = shape.map(Number);
  const data = 10 + npy.readUInt16LE(8);
  return lines.map((line) => {
    const frame = Object.fromEntries(names.map((name, at) => [name, line[at]]));
    const at = (row, column) => (Number(frame.map) * height + row) * width + column;
    return {
      sequence: Number(frame.sequence),
      map: frame.map,
      height,
      width,
      mm: (row, column) => npy.readFloatLE(data + 4 * at(row, column)),
    };
  });
}

/** Shows a sensor or, where it is shown, closes its pane. */
const choose = (name) => view.page.locator(".chooser button", { hasText: name }).click();

/** Records for three seconds and until `ended`, which ends it, is done. */
async function record(ended) {
  await pane.getByRole("button", { name: "Record" }).click();
  await until(
    () => fact(pane, "recording").textContent(),
    (text) => Number(/^(\d+) s/.exec(text)?.[1]) >= 3,
  );
  const coming = view.page.waitForEvent("download");
  await ended();
  const download = await coming;
  const file = path.join(work, download.suggestedFilename());
  await download.saveAs(file);
  return file;
}

test("what is recorded is what the daemon sent", async () => {
  let sent = [];
  const file = await record(async () => {
    // Read while the other client still has them.
    sent = tap.sequences().map((sequence) => ({ sequence, ...tap.frame(sequence) }));
    await pane.getByRole("button", { name: "Stop" }).click();
  });
  assert.match(path.basename(file), /^left-\d{4}-\d\d-\d\dT\d{6}Z\.mcap$/);
  const frames = framesOf(file);
  assert.ok(frames.length > 20, `${frames.length} frames`);
  const reported = await fact(pane, "recording").textContent();
  assert.ok(reported.includes(`: ${frames.length} frames, `), reported);
  assert.deepEqual(
    sequencesOf(file, "/camera/jpeg"),
    frames.map(({ sequence }) => sequence),
  );
  // Ten pictures a second for viewing, of frames with depth.
  const pictures = sequencesOf(file, "/dtact/depth");
  const withDepth = frames.filter(({ map }) => map !== "").map(({ sequence }) => sequence);
  assert.ok(pictures.length > 10 && pictures.length < withDepth.length, `${pictures.length} pictures`);
  assert.ok(pictures.every((sequence) => withDepth.includes(sequence)));
  const both = sent.flatMap((other) => {
    const frame = frames.find(({ sequence, map }) => sequence === other.sequence && map !== "");
    return frame ? [[frame, other]] : [];
  });
  assert.ok(both.length > 0, "no frame that both clients have");
  for (const [frame, other] of both) {
    assert.deepEqual([frame.width, frame.height], [other.width, other.height]);
    for (let row = 0; row < other.height; row += 3) {
      for (let column = 0; column < other.width; column += 3) {
        const mm = frame.mm(row, column);
        const same = Number.isNaN(mm) || Math.abs(1000 * mm - other.um(row, column)) < 0.01;
        assert.ok(same, `frame ${frame.sequence}, ${row}, ${column}: ${mm} mm`);
      }
    }
  }
});

/** Of Frame in dtact.proto. */
const LUMA = 12;

// Before: half a megabyte more a frame, so that a recording ended at its largest size in half the time.
test("grey levels that the view asks for are not recorded beside the JPEG", async () => {
  await pane.getByRole("radio", { name: "Camera" }).click();
  await until(
    () => pane.locator("canvas.map").getAttribute("width"),
    (width) => width === "800",
  );
  const file = await record(() => pane.getByRole("button", { name: "Stop" }).click());
  await pane.getByRole("radio", { name: "Depth" }).click();
  const frames = messagesOf(file, "/dtact/frame").map(({ data }) => fields(Buffer.from(data)));
  assert.ok(frames.length > 20, `${frames.length} frames`);
  assert.equal(frames.filter((frame) => LUMA in frame).length, 0);
  assert.equal(sequencesOf(file, "/camera/jpeg").length, frames.length);
});

test("depth can be made anew from it", async () => {
  const file = await record(() => pane.getByRole("button", { name: "Stop" }).click());
  const anew = `${file}-anew.mcap`;
  execFileSync(process.env.CALIBRATE, [
    "reprocess",
    file,
    "--calibration",
    calibration(),
    "-o",
    anew,
  ]);
  const [recorded, remade] = [framesOf(file), framesOf(anew)];
  assert.equal(remade.length, recorded.length);
  const maps = (frames) => frames.filter(({ map }) => map !== "").map(({ sequence }) => sequence);
  assert.ok(maps(recorded).length > 0, "no depth was recorded");
  assert.deepEqual(maps(remade), maps(recorded));
});

/** Opens a file in the page. The pane that plays it. */
async function play(file) {
  await view.page.getByLabel("Recording", { exact: true }).setInputFiles(file);
  const player = view.page.locator(`[data-recording="${path.basename(file)}"]`);
  await player.waitFor();
  return player;
}

const close = (player) => player.getByRole("button", { name: "Close" }).click();

for (const [by, make] of [
  ["this page", () => record(() => pane.getByRole("button", { name: "Stop" }).click())],
  [
    "dtactctl",
    () => {
      const file = path.join(work, "ctl.mcap");
      ctl("--port", String(daemon.port), "record", "--seconds", "4", "-o", file);
      return file;
    },
  ],
]) {
  test(`a recording of ${by} plays, and any moment of it is shown`, async () => {
    const file = await make();
    const frames = framesOf(file);
    const player = await play(file);
    await until(
      () => player.getAttribute("data-sequence"),
      (sequence) => sequence !== null,
    );
    await until(
      () => player.getByRole("button", { name: "Resume" }).count(),
      (count) => count === 1,
    );
    const [at, length] = (await fact(player, "played").textContent()).split(" of ");
    assert.equal(at, length);
    // A recording does not say when its reference was taken.
    assert.equal(await fact(player, "reference").textContent(), "–");
    await until(
      () => player.getAttribute("data-sequence"),
      (sequence) => Number(sequence) === frames.at(-1).sequence,
    );
    // A frame with a map, some way into the recording, by its number.
    const slider = player.getByLabel("Time in the recording");
    const seconds = Number(await slider.getAttribute("max"));
    await slider.evaluate((input, value) => {
      input.value = String(value);
      input.dispatchEvent(new Event("input"));
    }, seconds / 3);
    await until(
      () => player.getAttribute("data-sequence"),
      (sequence) => Number(sequence) < frames.at(-1).sequence,
    );
    const sought = Number(await player.getAttribute("data-sequence"));
    const frame = frames.find(({ sequence }) => sequence === sought);
    await player.locator("canvas.marks").hover();
    const [, um, row, column] = /^(−?\d+) µm · row (\d+), column (\d+)/.exec(
      await player.locator(".readout").textContent(),
    );
    const mm = frame.mm(Number(row), Number(column));
    assert.ok(Math.abs(1000 * mm - Number(um.replace("−", "-"))) <= 0.51, `${mm} mm, ${um} µm`);
    await player.getByRole("button", { name: "One frame back" }).click();
    await until(
      () => player.getAttribute("data-sequence"),
      (sequence) => Number(sequence) === frames[frames.indexOf(frame) - 1].sequence,
    );
    await player.getByRole("radio", { name: "Camera" }).click();
    await until(
      () => player.locator(".veil p").textContent(),
      (text) => text === "",
    );
    await player.getByRole("button", { name: "Resume" }).click();
    await until(
      () => player.getAttribute("data-sequence"),
      (sequence) => Number(sequence) > frame.sequence,
    );
    await close(player);
    assert.equal(await player.count(), 0);
  });
}

/** Where two pictures differ by the largest amount, and their grey levels there. */
const largestDifference = (one, other) =>
  view.page.evaluate(
    async (pictures) => {
      const greys = [];
      let size;
      for (const base64 of pictures) {
        const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
        const bitmap = await createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none" });
        size = { width: bitmap.width, height: bitmap.height };
        const context = new OffscreenCanvas(size.width, size.height).getContext("2d");
        context.drawImage(bitmap, 0, 0);
        greys.push(context.getImageData(0, 0, size.width, size.height).data.filter((_, i) => i % 4 === 0));
      }
      let at = 0;
      const apart = (i) => Math.abs(greys[0][i] - greys[1][i]);
      for (let i = 0; i < greys[0].length; ++i) if (apart(i) > apart(at)) at = i;
      return { ...size, row: Math.floor(at / size.width), column: at % size.width, greys: greys.map((grey) => grey[at]) };
    },
    [one, other].map((png) => Buffer.from(png).toString("base64")),
  );

// Before: from the reference of the moment at which the view was chosen.
test("the difference is taken from the reference of the frame that is shown", async () => {
  const file = await record(async () => {
    await until(
      () => fact(pane, "inContact").textContent(),
      (text) => text === "in contact",
    );
    ctl("--port", String(daemon.port), "rezero", "--force");
    await new Promise((done) => setTimeout(done, 2000));
    await pane.getByRole("button", { name: "Stop" }).click();
  });
  const references = [...recordsOf(file)].filter(
    ({ type, name }) => type === "Attachment" && name === "current_reference.png",
  );
  assert.ok(references.length > 1, `${references.length} references`);
  const { width, height, row, column, greys } = await largestDifference(references[0].data, references.at(-1).data);
  assert.ok(Math.abs(greys[0] - greys[1]) > 20, greys.join());
  const player = await play(file);
  await player.getByRole("radio", { name: "Difference" }).click();
  const marks = player.locator("canvas.marks");
  // Points anew each time: the canvas takes its size with the first picture, and may lie below the window.
  const reference = async () => {
    await marks.waitFor();
    const box = await marks.boundingBox();
    const position = { x: ((column + 0.5) / width) * box.width, y: ((row + 0.5) / height) * box.height };
    await marks.hover({ position });
    return Number(/reference (\d+) ·/.exec(await player.locator(".readout").textContent())?.[1]);
  };
  await until(reference, (grey) => Math.abs(grey - greys[1]) <= 2);
  await until(
    () => player.getByRole("button", { name: "Resume" }).count(),
    (count) => count === 1,
  );
  await player.getByLabel("Time in the recording").evaluate((input) => {
    input.value = "0";
    input.dispatchEvent(new Event("input"));
  });
  await until(reference, (grey) => Math.abs(grey - greys[0]) <= 2);
  await close(player);
});

test("one that is paused while it is opened shows its first frame, and plays from there", async () => {
  const file = path.join(work, "paused.mcap");
  copyFileSync(path.join(work, "ctl.mcap"), file);
  const [first] = framesOf(file);
  // Before the worker has read any of the file.
  await view.page.evaluate(() => {
    const observer = new MutationObserver(() => {
      const pause = document.querySelector("[data-recording] .timeline button");
      pause?.click();
      if (pause) observer.disconnect();
    });
    observer.observe(document.body, { childList: true, subtree: true });
  });
  const player = await play(file);
  const sequence = async () => Number(await player.getAttribute("data-sequence"));
  await until(sequence, (shown) => shown === first.sequence);
  await new Promise((done) => setTimeout(done, 500));
  assert.equal(await sequence(), first.sequence);
  assert.equal(await player.locator(".timeline .trouble").textContent(), "");
  await player.getByRole("button", { name: "Resume" }).click();
  await until(sequence, (shown) => shown > first.sequence);
  await close(player);
});

/** A recording of another program: `fill` is given its writer. */
async function made(fill, options = {}) {
  const parts = [];
  const writer = new McapWriter({
    ...options,
    writable: {
      write: async (part) => void parts.push(Buffer.from(part)),
      position: () => BigInt(Buffer.concat(parts).length),
    },
  });
  await writer.start({ profile: "", library: "another" });
  await fill(writer);
  await writer.end();
  return Buffer.concat(parts);
}

// Before: the part that follows a damaged one, which begins within the same frame, was skipped with it.
test("what stands on both sides of a damaged part is shown", async () => {
  const recorded = await record(() => pane.getByRole("button", { name: "Stop" }).click());
  const one = (topic) => Buffer.from(messagesOf(recorded, topic).at(-1).data);
  const frame = one("/dtact/frame");
  const jpeg = one("/camera/jpeg");
  // Fields at the end: a sequence of two bytes, and one that nobody knows.
  const numbered = (sequence) => Buffer.concat([frame, Buffer.from([0x08, 0x80 | (sequence & 0x7f), sequence >> 7])]);
  const size = 3 * frame.length;
  const padded = (value) =>
    Buffer.concat([jpeg, Buffer.from([0xfa, 0x7f, 0x80 | (size & 0x7f), 0x80 | ((size >> 7) & 0x7f), size >> 14]), Buffer.alloc(size, value)]);
  const [first, last] = [201, 210];
  // Parts of 201, 202 and the picture of 203; from there to the picture of 206; to that of 209; and the rest.
  const chunkSize = Math.round(2.5 * padded(0).length + 2 * frame.length);
  const bytes = await made(async (writer) => {
    const register = async (name, topic) => {
      const schemaId = await writer.registerSchema({ name, encoding: "protobuf", data: new Uint8Array() });
      return writer.registerChannel({ schemaId, topic, messageEncoding: "protobuf", metadata: new Map() });
    };
    const pictures = await register("foxglove.CompressedImage", "/camera/jpeg");
    const frames = await register("dtact.v1.Frame", "/dtact/frame");
    for (let sequence = first; sequence <= last; ++sequence) {
      const time = BigInt(sequence) * 20_000_000n;
      const message = { sequence, logTime: time, publishTime: time };
      await writer.addMessage({ ...message, channelId: pictures, data: padded(sequence) });
      await writer.addMessage({ ...message, channelId: frames, data: numbered(sequence) });
    }
  }, { chunkSize });
  const damage = bytes.indexOf(Buffer.alloc(100, 204));
  assert.ok(damage > 0);
  bytes[damage] ^= 1;
  const file = path.join(work, "boundary.mcap");
  writeFileSync(file, bytes);
  const player = await play(file);
  await until(
    () => player.getByRole("button", { name: "Resume" }).count(),
    (count) => count === 1,
  );
  const shown = async () => Number(await player.getAttribute("data-sequence"));
  await until(shown, (sequence) => sequence === last);
  const step = async (name, sequence) => {
    await player.getByRole("button", { name }).click();
    await until(shown, (now) => now === sequence, 20_000);
  };
  for (const sequence of [209, 208, 207, 206, 202, 201]) await step("One frame back", sequence);
  for (const sequence of [202, 206, 207]) await step("One frame on", sequence);
  await close(player);
});

test("of a damaged recording the rest plays; what is none says what is wrong", async () => {
  const whole = readFileSync(path.join(work, "ctl.mcap"));
  const written = (name, bytes) => {
    const file = path.join(work, name);
    writeFileSync(file, bytes);
    return file;
  };
  const damaged = Buffer.from(whole);
  const middle = whole.length >> 1;
  damaged.fill(0x5a, middle, middle + 40);
  const player = await play(written("damaged.mcap", damaged));
  await until(
    () => player.locator(".timeline .trouble").textContent(),
    (text) => /^Not readable, part of the file: 1 \(/.test(text),
  );
  await until(
    () => player.getByRole("button", { name: "Resume" }).count(),
    (count) => count === 1,
  );
  await close(player);
  const foreign = await made(async (writer) => {
    const channel = { schemaId: 0, topic: "/x", messageEncoding: "json", metadata: new Map() };
    const channelId = await writer.registerChannel(channel);
    await writer.addMessage({ channelId, sequence: 0, logTime: 1n, publishTime: 1n, data: Buffer.from("{}") });
  });
  const noMessages = await made(async (writer) => {
    const schema = { name: "dtact.v1.Frame", encoding: "protobuf", data: new Uint8Array() };
    const schemaId = await writer.registerSchema(schema);
    const channel = { schemaId, topic: "/dtact/frame", messageEncoding: "protobuf", metadata: new Map() };
    await writer.registerChannel(channel);
  });
  const cases = {
    "text.mcap": [Buffer.from("no recording, but longer than the head of one"), /cannot be played/],
    "empty.mcap": [Buffer.alloc(0), /cannot be played: it ends too early/],
    "cut.mcap": [whole.subarray(0, whole.length * 0.7), /cannot be played: .*mcap recover/],
    "foreign.mcap": [foreign, /it has no frames of dtactd, only \/x\.$/],
    "no_messages.mcap": [noMessages, /cannot be played: it has no frames\.$/],
  };
  for (const [name, [bytes, sentence]] of Object.entries(cases)) {
    const player = await play(written(name, bytes));
    await until(
      () => player.locator(".notice").first().textContent(),
      (text) => sentence.test(text),
    );
    await close(player);
  }
});

test("a closed pane downloads its recording", async () => {
  await choose("other");
  const file = await record(() => choose("left"));
  assert.ok(framesOf(file).length > 20);
  assert.equal(await pane.count(), 0);
  await choose("left");
  await until(
    () => pane.getAttribute("data-sequence"),
    (sequence) => sequence !== null,
  );
});

test("a daemon that ends leaves what was recorded until then", async () => {
  const file = await record(() => daemon.stop("SIGKILL"));
  assert.match(await fact(pane, "recording").textContent(), /^The connection was lost\. left-/);
  assert.ok(framesOf(file).length > 20);
});
