// npm.mjs read FILE, npm.mjs write FILE: the same as mcap_sample, by @mcap/core.
import { McapIndexedReader, McapStreamReader, McapWriter } from "@mcap/core";
import { open } from "node:fs/promises";
import { readFileSync } from "node:fs";
import codec from "zstd-codec";

const zstd = await new Promise((done) => codec.ZstdCodec.run((made) => done(new made.Simple())));
const decompressHandlers = { zstd: (bytes) => zstd.decompress(bytes) };
const text = (bytes) => new TextDecoder().decode(bytes);

const [verb, path] = process.argv.slice(2);
if (verb === "read") {
  const file = await open(path);
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      await file.read(bytes, 0, bytes.length, Number(offset));
      return bytes;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  for await (const m of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(m.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    console.log("message", channel.topic, schema?.name ?? "-", m.sequence, String(m.logTime),
                String(m.publishTime), text(m.data));
  }
  for await (const a of reader.readAttachments({ validateCrcs: true })) {
    console.log("attachment", a.name, a.mediaType, String(a.logTime), String(a.createTime),
                text(a.data));
  }
  for await (const m of reader.readMetadata()) {
    console.log("metadata", m.name, ...[...m.metadata].map(([key, value]) => `${key}=${value}`));
  }
  const s = reader.statistics;
  console.log("statistics", String(s.messageCount), s.schemaCount, s.channelCount,
              s.attachmentCount, s.metadataCount, s.chunkCount, String(s.messageStartTime),
              String(s.messageEndTime),
              [...s.channelMessageCounts].map(([id, count]) => `${id}:${count}`).join(","));
  // Reads from front to end, without the index: checks every chunk's CRC and the order of records.
  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(readFileSync(path));
  let messages = 0;
  for (let record; (record = stream.nextRecord()); ) messages += record.type === "Message" ? 1 : 0;
  console.log("streamed", messages, stream.done());
} else {
  const file = await open(path, "w");
  let position = 0n;
  const writable = {
    position: () => position,
    write: async (bytes) => {
      await file.write(bytes);
      position += BigInt(bytes.byteLength);
    },
  };
  const writer = new McapWriter({
    writable,
    chunkSize: 100,
    compressChunk: (bytes) => ({ compression: "zstd", compressedData: zstd.compress(bytes, 3) }),
  });
  await writer.start({ profile: "", library: "npm" });
  const schemaId = await writer.registerSchema(
      { name: "S", encoding: "jsonschema", data: new TextEncoder().encode("{}") });
  const channel = (topic, id) => writer.registerChannel(
      { topic, schemaId: id, messageEncoding: "json", metadata: new Map() });
  const ids = [await channel("/a", schemaId), await channel("/b", 0)];
  for (let i = 0; i < 6; ++i) {
    await writer.addMessage({
      channelId: ids[i % 2], sequence: i, logTime: BigInt(100 + i), publishTime: BigInt(90 + i),
      data: new TextEncoder().encode(`{"i":${i}}`),
    });
  }
  await writer.addAttachment({ name: "a.txt", mediaType: "text/plain", logTime: 5n, createTime: 4n,
                               data: new TextEncoder().encode("attached") });
  await writer.addMetadata({ name: "m", metadata: new Map([["key", "value"]]) });
  await writer.end();
  await file.close();
}
