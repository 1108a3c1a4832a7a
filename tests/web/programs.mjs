// The programs that the tests run, on the simulated sensor: DTACTD, DTACTCTL, DTACT_WEB, DTACT_PERCEIVE,
// CALIBRATE and SIM_RENDER name them; FOLDER is for their output. PAGE_DIST may name a folder with a page
// to test in place of the one built into the gateway.
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import http from "node:http";
import path from "node:path";
import { fileURLToPath } from "node:url";

const here = path.dirname(fileURLToPath(import.meta.url));
const { DTACTD, DTACTCTL, DTACT_WEB, DTACT_PERCEIVE, CALIBRATE, SIM_RENDER, FOLDER } = process.env;
/** Of the daemon's pictures a second: few, so that the tests run beside others. */
const FPS = process.env.WEB_FPS ?? "20";

const scene = path.join(here, "presses.toml");
/** The depth map, wider than high, so that an order which is confused shows. */
export const MAP = { width: 500, height: 400 };
/** A ball pressed deeper than the calibration covers, and held. */
export const beyond = path.join(here, "beyond.toml");
export const work = mkdtempSync(
  path.join(FOLDER, `run-${path.basename(process.argv[1]).split("_")[0]}-`),
);

/** Made by a press of a known ball, as ./dev run does unless told a method; kept until a program changes. */
export function calibration(method = "auto") {
  const folder = path.join(FOLDER, `calibrated-${method}`);
  const made = path.join(folder, "calibration");
  const changed = (program) => statSync(program).mtimeMs > statSync(made).mtimeMs;
  if (existsSync(path.join(made, "reference.png")) && ![CALIBRATE, SIM_RENDER].some(changed))
    return made;
  rmSync(folder, { recursive: true, force: true });
  mkdirSync(folder);
  const ball = path.resolve(here, "../../config/scenes/calibrate_ball.toml");
  for (const [name, frames] of [
    ["reference", "0:32"],
    ["ball", "200:232"],
  ]) {
    execFileSync(SIM_RENDER, ["--scene", ball, "--frames", frames, "-o", path.join(folder, name)]);
  }
  const depth = ["depth", "--radius-mm", "4.0", "--mm-per-px", "0.0413793", "--centre", "400,300"];
  const from = ["--reference", path.join(folder, "reference"), "--ball", path.join(folder, "ball")];
  const how = ["--crop", `${MAP.width},${MAP.height}`, "--method", method];
  execFileSync(CALIBRATE, [...depth, ...from, ...how, "-o", made]);
  return made;
}

const running = new Set();

class Program {
  output = "";

  constructor(program, words) {
    this.name = path.basename(program);
    this.child = spawn(program, words, { stdio: ["ignore", "pipe", "pipe"] });
    running.add(this);
    this.ended = new Promise((done) => this.child.once("exit", done)).then(() =>
      running.delete(this),
    );
    for (const stream of [this.child.stdout, this.child.stderr]) {
      stream.on("data", (text) => (this.output += text));
    }
  }

  async listening() {
    for (let tries = 0; tries < 600; ++tries) {
      const port = /listening on (?:https?:\/\/)?127\.0\.0\.1:(\d+)/.exec(this.output)?.[1];
      if (port) return Number(port);
      if (this.child.exitCode !== null) break;
      await new Promise((done) => setTimeout(done, 100));
    }
    throw new Error(`${this.name} did not start:\n${this.output}`);
  }

  async stop(signal = "SIGTERM") {
    this.child.kill(signal);
    await this.ended;
  }
}

/** All that are still there, also when a start failed half-way. */
export async function stopAll() {
  await Promise.all([...running].map((program) => program.stop()));
}

/** A daemon on the simulated sensor. Port 0: any free one. */
export async function startDaemon(name, port = 0, settings = []) {
  const state = path.join(work, `state-${name}`);
  mkdirSync(state, { recursive: true });
  const all = [
    `net.port=${port}`,
    `net.name=${name}`,
    `calibration=${calibration()}`,
    `state_dir=${state}`,
    `camera.sim.scene=${scene}`,
    `camera.fps=${FPS}`,
    "capture.fifo_priority=0",
    ...settings,
  ];
  const daemon = new Program(
    DTACTD,
    all.flatMap((setting) => ["--set", setting]),
  );
  daemon.port = await daemon.listening();
  return daemon;
}

/** The gateway to daemons by name, each at a port of this machine. */
export async function startGateway(daemons, words = []) {
  const names = Object.entries(daemons).flatMap(([name, port]) => [
    "--daemon",
    `${name}=127.0.0.1:${port}`,
  ]);
  const page = process.env.PAGE_DIST ? ["--page", process.env.PAGE_DIST] : [];
  const gateway = new Program(DTACT_WEB, [
    "--listen-port",
    "0",
    ...names,
    ...page,
    ...words,
  ]);
  gateway.port = await gateway.listening();
  return gateway;
}

/** A reverse proxy that serves the gateway below /dtact/ and keeps the Host header. Returns its port. */
export async function startProxy(gateway) {
  const target = (request) => ({
    host: "127.0.0.1",
    port: gateway.port,
    method: request.method,
    path: request.url.slice("/dtact".length),
    headers: request.headers,
  });
  const proxy = http.createServer((request, response) => {
    if (!request.url.startsWith("/dtact/")) return response.writeHead(404).end();
    const forwarded = http.request(target(request), (answer) => {
      response.writeHead(answer.statusCode, answer.headers);
      answer.pipe(response);
    });
    forwarded.on("error", () => response.destroy());
    request.pipe(forwarded);
  });
  proxy.on("upgrade", (request, socket, head) => {
    const forwarded = http.request(target(request)).end();
    forwarded.on("error", () => socket.destroy());
    forwarded.on("upgrade", (answer, upstream, first) => {
      const fields = answer.rawHeaders.flatMap((field, i) =>
        i % 2 === 0 ? [`${field}: ${answer.rawHeaders[i + 1]}`] : [],
      );
      socket.write(["HTTP/1.1 101 Switching Protocols", ...fields, "", ""].join("\r\n"));
      upstream.unshift(first);
      socket.unshift(head);
      upstream.pipe(socket).pipe(upstream);
      for (const end of [upstream, socket]) end.on("error", () => end.destroy());
    });
  });
  await new Promise((done) => proxy.listen(0, "127.0.0.1", done));
  return { port: proxy.address().port, close: () => proxy.close() };
}

/** dtact-perceive beside a daemon of this machine. It listens on any free port unless told which. */
export async function startPerceive(port, listenPort = 0, more = []) {
  const words = ["--port", String(port), "serve", "--listen-port", String(listenPort), ...more];
  const perceive = new Program(DTACT_PERCEIVE, words);
  perceive.port = await perceive.listening();
  return perceive;
}

export function status(daemon) {
  const words = ["--port", String(daemon.port), "status", "--json"];
  return JSON.parse(execFileSync(DTACTCTL, words, { encoding: "utf8" }));
}

/** A token of these rights and the file that admits it. */
export function tokenFile(rights) {
  const file = path.join(work, `tokens-${rights}`);
  const words = ["token", "--new", rights, "-o", `${file}.client`];
  writeFileSync(file, execFileSync(DTACTCTL, words, { encoding: "utf8" }), { mode: 0o600 });
  return { file, token: readFileSync(`${file}.client`, "utf8").trim() };
}
