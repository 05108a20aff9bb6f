// Bundles what the page of `cobake view` needs of three.js into src/view/three.bundle.min.js, with the licence beside it.
//
//   npm ci --prefix tools
//   node tools/three/bundle.mjs            # writes both
//   node tools/three/bundle.mjs --check    # fails where the committed ones are not what the pinned packages give

import { readFile, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const { version } = JSON.parse(await readFile(here("../node_modules/three/package.json"), "utf8"));

const bundled = await build({
  entryPoints: [here("entry.mjs")],
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "none",
  charset: "ascii",
  banner: { js: `/* three.js ${version}, MIT licence: three.LICENSE.txt; made by tools/three/bundle.mjs */` },
  write: false,
});
const files = [
  ["../../src/view/three.bundle.min.js", bundled.outputFiles[0].text],
  ["../../src/view/three.LICENSE.txt", await readFile(here("../node_modules/three/LICENSE"), "utf8")],
];

const check = process.argv.slice(2).includes("--check");
let stale = 0;
for (const [path, text] of files) {
  if (!check) {
    await writeFile(here(path), text);
    console.log(`${here(path)}: ${text.length} bytes`);
  } else if ((await readFile(here(path), "utf8").catch(() => "")) !== text) {
    console.error(`${here(path)} is not what three ${version} gives; run node tools/three/bundle.mjs`);
    stale += 1;
  }
}
process.exit(stale > 0 ? 1 : 0);
