// read_bag.mjs FILE: prints what Foxglove's readers find in a ROS 2 bag, a JSON object a message.
import { createRequire } from "node:module";
import { readFile } from "node:fs/promises";

const require = createRequire(`${process.cwd()}/`);
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { McapIndexedReader } = require("@mcap/core");
const { decompress } = require("fzstd");

const file = await readFile(process.argv[2]);
const reader = await McapIndexedReader.Initialize({
  readable: {
    size: async () => BigInt(file.length),
    read: async (offset, size) => new Uint8Array(file.subarray(Number(offset), Number(offset + size))),
  },
  decompressHandlers: { zstd: (bytes, size) => decompress(bytes, new Uint8Array(Number(size))) },
});
const readers = new Map();
let rosbag2;
for await (const { name, metadata } of reader.readMetadata()) rosbag2 = { name, ...Object.fromEntries(metadata) };
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (!readers.has(channel.id)) {
    readers.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const { data, ...content } = readers.get(channel.id).readMessage(message.data);
  console.log(JSON.stringify({
    profile: reader.header.profile, topic: channel.topic, encoding: channel.messageEncoding, type: schema.name,
    bytes: data?.byteLength, content, qos: channel.metadata.get("offered_qos_profiles"), rosbag2,
  }, (_, value) => (typeof value === "bigint" ? Number(value) : value)));
}
