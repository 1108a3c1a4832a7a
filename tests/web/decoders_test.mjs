// The page's decoders against the wire's golden vectors: PAGE_NODE is the folder of the bundles that
// prepare.sh makes of its sources, GOLDEN that of the vectors, RANDOM_MAPS that of random_maps.py.
import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import path from "node:path";
import test from "node:test";

const { decodeDepth } = await import(path.resolve(process.env.PAGE_NODE, "decoders.mjs"));
const { framed, unframed } = await import(path.resolve(process.env.PAGE_NODE, "framing.mjs"));
const golden = process.env.GOLDEN;
const encodings = { int16: 1, predict_zstd: 2 };

function vector(name, folder = golden) {
  const lines = readFileSync(path.join(folder, name), "utf8").trimEnd().split("\n");
  const fields = Object.fromEntries(lines.map((line) => line.split(" ")));
  const bytes = (key) => new Uint8Array(Buffer.from(fields[key], "hex"));
  const [width, height] = [Number(fields.width), Number(fields.height)];
  const raw = Buffer.from(bytes("int16"));
  const expected = Int16Array.from({ length: width * height }, (_, i) => raw.readInt16LE(2 * i));
  return { width, height, bytes, expected };
}

function decoded(encoding, data, width, height) {
  const out = new Int16Array(width * height).fill(12345);
  decodeDepth(encoding, data, width, height, out);
  return out;
}

const names = readdirSync(golden).filter((name) => name.endsWith(".txt"));

test("there are golden vectors", () => assert.equal(names.length, 10));

for (const name of names) {
  const { width, height, bytes, expected } = vector(name);
  for (const [key, encoding] of Object.entries(encodings)) {
    test(`${name}: ${key}`, () => {
      assert.deepEqual(decoded(encoding, bytes(key), width, height), expected);
    });
    test(`${name}: ${key} that ends early is refused`, () => {
      const data = bytes(key);
      for (const left of [0, 1, data.length >> 1, data.length - 1]) {
        assert.throws(() => decoded(encoding, data.slice(0, left), width, height));
      }
    });
    test(`${name}: ${key} of a smaller or larger map is refused`, () => {
      // By two rows: the nibble that fills a byte up may count as one more value of 0.
      assert.throws(() => decoded(encoding, bytes(key), width, height + 2));
      if (height > 2) assert.throws(() => decoded(encoding, bytes(key), width, height - 2));
    });
    test(`${name}: ${key} with bytes behind it is refused`, () => {
      const longer = new Uint8Array([...bytes(key), 0, 0, 0, 0]);
      assert.throws(() => decoded(encoding, longer, width, height));
    });
  }
}

test("random maps", () => {
  const folder = process.env.RANDOM_MAPS;
  const names = readdirSync(folder);
  assert.equal(names.length, 24);
  for (const name of names) {
    const { width, height, bytes, expected } = vector(name, folder);
    for (const [key, encoding] of Object.entries(encodings)) {
      assert.deepEqual(decoded(encoding, bytes(key), width, height), expected, `${name}: ${key}`);
    }
  }
});

test("a zstd frame that announces too much is refused before it is decompressed", () => {
  const frame = vector("worked_example.txt").bytes("predict_zstd");
  // A single segment with a content size of 8 bytes: 2^40.
  const liar = Uint8Array.from([
    ...frame.slice(0, 4),
    0xe0,
    0,
    0,
    0,
    0,
    0,
    1,
    0,
    0,
    ...frame.slice(6),
  ]);
  assert.throws(() => decoded(2, liar, 4, 2), /says 1099511627776 bytes/);
});

test("an encoding that is not known is named", () => {
  assert.throws(() => decoded(9, new Uint8Array(4), 1, 2), /encoding 9/);
});

test("framing", () => {
  assert.deepEqual([...framed(Uint8Array.of(8, 1))], [0, 0, 0, 2, 8, 1]);
  assert.deepEqual([...unframed(Uint8Array.of(0, 0, 0, 1, 7))], [7]);
  assert.throws(() => unframed(Uint8Array.of(0, 0, 0, 2, 7)), /says 2 bytes and has 1/);
  assert.throws(() => unframed(Uint8Array.of(0, 0)), /ends within/);
});
