// What engines make of a baked file, in floats, against albedo × E / π, E as `cobake inspect` tells it.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { readFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { build } from "esbuild";
import { open } from "./chromium.mjs";

const run = promisify(execFile);
const here = (path) => fileURLToPath(new URL(path, import.meta.url));

/** Position and normal of places of fixtures/cornell at which a flipped or turned page would show another value. */
const PLACES = [
  [0.11, 0, 0.07, 0, 1, 0], [0.45, 0, 0.13, 0, 1, 0], [0.07, 0.5488, 0.41, 0, -1, 0], [0.13, 0.17, 0.5592, 0, 0, -1],
  [0.41, 0.39, 0.5592, 0, 0, -1],
];

/** The share by which a reader may be off: its own arithmetic is in single precision, its texels in halves. */
const EXR_TOLERANCE = 0.01;

/** As much of the PNG's brightest value: it has 8 bits. */
const PNG_STEP = 1 / 255;

/** A page that has run a module of ours, bundled with what it imports. */
async function withModule(browser, module, test) {
  const bundled = await build({ entryPoints: [here(module)], bundle: true, format: "esm", write: false });
  const { page, complaints } = await open(browser);
  // Nobody listens there: the answer is ours. A page needs an address that others can be told from.
  await page.route("http://127.0.0.1/", (route) =>
    route.fulfill({ contentType: "text/html", body: "<!doctype html><title>reader</title><link rel=icon href=data:,>" }));
  await page.goto("http://127.0.0.1/");
  await page.addScriptTag({ type: "module", content: bundled.outputFiles[0].text });
  await page.waitForFunction(() => globalThis.renderWithThree ?? globalThis.loadInModelViewer);
  await test(page);
  await page.close();
  assert.deepEqual(complaints, []);
}

async function irradiance(program, file, place) {
  const { stdout } = await run(program, ["inspect", file, "--json", `--at=${place.join()}`]);
  return JSON.parse(stdout).irradiance;
}

/** Compares what a reader rendered with what is right. `step` is how far off a texel may be stored, of its brightest. */
async function compare({ program, file, rendered, tolerance, step }) {
  for (const [i, { seen, albedo, emission }] of rendered.entries()) {
    const light = await irradiance(program, file, PLACES[i]);
    for (const k of [0, 1, 2]) {
      const expected = (albedo[k] * light[k]) / Math.PI + emission[k];
      const allowed = tolerance * expected + (albedo[k] * step) / Math.PI;
      assert.ok(
        expected > 0.001 && Math.abs(seen[k] - expected) <= allowed,
        `place ${PLACES[i]}, channel ${k}: ${seen[k]} instead of ${expected}, ${allowed} allowed`,
      );
    }
  }
}

const intensityOf = (bytes) => {
  const json = JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12)));
  return Math.max(...json.materials.map((material) => material.extensions?.MOZ_lightmap?.intensity ?? 0));
};

const three = (exr) => async ({ browser, program, a: file }) => {
  const bytes = await readFile(file);
  await withModule(browser, "three_page.mjs", async (page) => {
    const rendered = await page.evaluate(
      ([glb, places, exr]) => globalThis.renderWithThree(glb, places, exr), [bytes.toString("base64"), PLACES, exr],
    );
    const step = exr ? 0 : PNG_STEP * intensityOf(bytes);
    await compare({ program, file, rendered, tolerance: EXR_TOLERANCE, step });
  });
};

async function modelViewer({ browser, a: file }) {
  const bytes = await readFile(file);
  const json = JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12)));
  await withModule(browser, "model_viewer_page.mjs", async (page) => {
    const names = await page.evaluate((glb) => globalThis.loadInModelViewer(glb), bytes.toString("base64"));
    assert.deepEqual(names, json.materials.map((material) => material.name));
  });
}

/** Name and test of each reader; a further kind of output is a further line. */
export const readerCases = [
  ["three.js: the EXR as light map", three(true)],
  ["three.js: MOZ_lightmap", three(false)],
  ["model-viewer: loads", modelViewer],
];
