// node foxglove.mjs URL SUBPROTOCOL COUNT: prints what Foxglove's own client gets, a line of JSON each: the server's
// information, its channels and services, COUNT messages of each channel that has any within its time, and the
// answers to two calls.
import { createRequire } from "node:module";
import path from "node:path";
import process from "node:process";

// The packages are where the test was started, the module itself is in the tree.
const require = createRequire(path.join(process.cwd(), "node_modules", "x.js"));
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const WebSocket = require("ws");

const [url, subprotocol, wanted] = process.argv.slice(2);
const count = Number(wanted);
const tell = (kind, what) => process.stdout.write(`${JSON.stringify({ kind, ...what })}\n`);
const client = new FoxgloveClient({ ws: new WebSocket(url, [subprotocol]) });
const topics = new Map();
const left = new Map();
const calls = new Map();
let services = 0;

function end(why) {
  tell("end", { why });
  process.exit(0);
}
function finished() {
  // A camera without JPEGs sends none, and the light may not change.
  const open = [...left].filter(([topic, n]) => n > 0 && !/jpeg|light|event/.test(topic));
  if (open.length === 0 && services === 0 && topics.size > 0) end("all came");
}
setTimeout(() => end(`only ${JSON.stringify([...left])} are missing`), 60000).unref();

client.on("error", (error) => end(`error: ${error.message}`));
client.on("close", () => end("closed"));
client.on("status", (status) => tell("status", { status }));
client.on("serverInfo", (info) => tell("info", { info }));
client.on("advertise", (channels) => {
  for (const channel of channels) {
    tell("channel", { channel });
    const subscription = client.subscribe(channel.id);
    topics.set(subscription, channel.topic);
    left.set(channel.topic, count);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const topic = topics.get(subscriptionId);
  if (left.get(topic) > 0) {
    left.set(topic, left.get(topic) - 1);
    const bytes = Buffer.from(data.buffer, data.byteOffset, data.byteLength);
    tell("message", { topic, time: timestamp.toString(), data: bytes.toString("base64") });
  }
  finished();
});
client.on("advertiseServices", (advertised) => {
  for (const service of advertised) tell("service", { service });
  const call = (name, request) => {
    const service = advertised.find((one) => one.name.endsWith(name));
    const callId = ++services + 100;
    calls.set(callId, name);
    const data = new TextEncoder().encode(JSON.stringify(request));
    client.sendServiceCallRequest({ serviceId: service.id, callId, encoding: "json", data });
  };
  call("/set_light", { brightness: 200 });
  call("/set_light", { brightness: 300 });
  call("/set_light", { brightnes: 3 });
});
client.on("serviceCallResponse", ({ callId, encoding, data }) => {
  tell("answer", { name: calls.get(callId), encoding, text: new TextDecoder().decode(data) });
  services -= 1;
  finished();
});
client.on("serviceCallFailure", ({ callId, message }) => {
  tell("failure", { name: calls.get(callId), message });
  services -= 1;
  finished();
});
