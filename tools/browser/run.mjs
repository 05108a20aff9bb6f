// Drives what cobake writes in a real browser.
//
//   npm ci --prefix tools
//   node tools/browser/run.mjs COBAKE A.glb B.glb
//
// COBAKE is the program, A and B are two bakes of fixtures/cornell. Each case of the table is a name and a function
// that throws where something is not as it should be. Exit code: 0 when all hold, 1 when one does not, 2 for wrong use.

import { launch } from "./chromium.mjs";
import { readerCases } from "./readers.mjs";
import { viewCases } from "./view.mjs";

const [program, a, b, ...rest] = process.argv.slice(2);
if (!b || rest.length > 0) {
  console.error("usage: node tools/browser/run.mjs COBAKE A.glb B.glb");
  process.exit(2);
}

const CASES = [...viewCases, ...readerCases];

const browser = await launch();
let failed = 0;
for (const [name, test] of CASES) {
  try {
    await test({ browser, program, a, b });
    console.log(`ok    ${name}`);
  } catch (error) {
    failed += 1;
    console.error(`FAILS ${name}\n${error.stack}`);
  }
}
await browser.close();
process.exit(failed > 0 ? 1 : 0);
