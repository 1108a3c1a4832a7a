// npm run build -- --outdir DIR [--node DIR] [--tree DIR]: the page into the one folder, and what the
// tests run under node into the other. Generates the messages of the wire and of recordings from the
// repository TREE into gen/ (Debian's protobuf-compiler), checks the types and bundles. Nothing of all
// this is needed to serve the page.
import * as esbuild from "esbuild";
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import path from "node:path";
import { parseArgs } from "node:util";

const { values } = parseArgs({
  options: {
    outdir: { type: "string" },
    node: { type: "string" },
    tree: { type: "string", default: "../../.." },
  },
});
if (!values.outdir && !values.node) {
  console.error("usage: npm run build -- --outdir DIR [--node DIR] [--tree DIR]");
  process.exit(2);
}
const tool = (name) => path.join("node_modules", ".bin", name);

rmSync("gen", { recursive: true, force: true });
mkdirSync("gen");
execFileSync(
  "protoc",
  [
    `--plugin=protoc-gen-es=${tool("protoc-gen-es")}`,
    "--es_out=gen",
    "--es_opt=target=ts",
    `--proto_path=${values.tree}/proto`,
    `--proto_path=${values.tree}/clients/recording`,
    `--proto_path=${values.tree}/clients/common`,
    "dtact.proto",
    "foxglove.proto",
    "guided.proto",
  ],
  { stdio: "inherit" },
);
execFileSync(tool("tsc"), [], { stdio: "inherit" });

const common = { bundle: true, format: "esm", legalComments: "eof", logLevel: "warning" };
const browser = {
  ...common,
  outdir: values.outdir,
  minify: true,
  target: ["chrome109", "firefox115", "safari16.4"],
};

/** A package and all that it needs, each once. */
function withNeeded(name, known = new Set()) {
  if (known.has(name)) return known;
  known.add(name);
  const described = JSON.parse(
    readFileSync(path.join("node_modules", name, "package.json"), "utf8"),
  );
  for (const needed of Object.keys(described.dependencies ?? {})) withNeeded(needed, known);
  return known;
}

/** Licence notices of the packages that become part of the page. */
function licences() {
  const { dependencies } = JSON.parse(readFileSync("package.json", "utf8"));
  const names = new Set(Object.keys(dependencies).flatMap((name) => [...withNeeded(name)]));
  return [...names].map((name) => {
    const folder = path.join("node_modules", name);
    const { version, license } = JSON.parse(
      readFileSync(path.join(folder, "package.json"), "utf8"),
    );
    const file = readdirSync(folder).find((entry) => /^licen[cs]e/i.test(entry));
    const text = file ? readFileSync(path.join(folder, file), "utf8").trim() : "";
    return `${name} ${version}: ${license}\n\n${text}\n`;
  });
}

if (values.outdir) {
  mkdirSync(values.outdir, { recursive: true });
  // The surface is a chunk of its own, loaded when it is looked at for the first time.
  await esbuild.build({
    ...browser,
    entryPoints: { page: "src/main.ts" },
    splitting: true,
    chunkNames: "[name]-[hash]",
  });
  await esbuild.build({ ...browser, entryPoints: { worker: "src/session/worker.ts" } });
  for (const file of ["index.html", "icon.svg"]) {
    copyFileSync(path.join("src", file), path.join(values.outdir, file));
  }
  writeFileSync(path.join(values.outdir, "licences.txt"), licences().join("\n"));
}
if (values.node) {
  await esbuild.build({
    ...common,
    entryPoints: {
      axes: "src/surface/axes.ts",
      colour_map: "src/view/colour_map.ts",
      decoders: "src/wire/depth.ts",
      framing: "src/wire/framing.ts",
    },
    outdir: values.node,
    outExtension: { ".js": ".mjs" },
    platform: "node",
  });
}
