// Checks that baking introduces no validator message: compares the Khronos validator's errors and
// warnings about a baked file with those about its input.
//
//   npm install --prefix tools
//   node tools/validate.mjs IN.glb OUT.glb
//
// Messages are compared by code and by text without its numbers: baking renumbers accessors and gives
// instances meshes of their own, so an input's own fault may show more often and at other places.
// Exit code: 0 when OUT has no message that IN lacks, 1 when it has, 2 for wrong use.

import { readFile } from "node:fs/promises";
import { dirname, resolve } from "node:path";
import validator from "gltf-validator";

const SEVERITIES = ["error", "warning"];

async function messages(path) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(path)), {
    uri: path,
    maxIssues: 0,
    writeTimestamp: false,
    externalResourceFunction: async (uri) =>
      new Uint8Array(await readFile(resolve(dirname(path), decodeURIComponent(uri)))),
  });
  return report.issues.messages.filter((message) => message.severity < SEVERITIES.length);
}

function byKind(list) {
  const groups = new Map();
  for (const message of list) {
    const kind = `${message.code} ${message.message.replace(/-?\d+(\.\d+)?(e[+-]?\d+)?/gi, "#")}`;
    groups.set(kind, [...(groups.get(kind) ?? []), message]);
  }
  return groups;
}

const [input, output, ...rest] = process.argv.slice(2);
if (!output || rest.length > 0) {
  console.error("usage: node tools/validate.mjs IN.glb OUT.glb");
  process.exit(2);
}

const before = byKind(await messages(input));
const after = byKind(await messages(output));
let introduced = 0;
for (const [kind, list] of after) {
  if (before.has(kind)) continue;
  introduced += list.length;
  for (const message of list.slice(0, 5)) {
    const place = message.pointer ?? `byte ${message.offset}`;
    console.error(`${SEVERITIES[message.severity]} ${message.code} at ${place}: ${message.message}`);
  }
}
const count = (groups) => [...groups.values()].flat().length;
console.log(`${output}: ${count(after)} errors and warnings, ${count(before)} in the input, ${introduced} introduced`);
process.exit(introduced > 0 ? 1 : 0);
