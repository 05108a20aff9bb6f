// What engines make of a baked file, in floats, against albedo × E / π, E as `cobake inspect` tells it.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
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
async function withModule(browser, module, test, served = null) {
  const bundled = await build({ entryPoints: [here(module)], bundle: true, format: "esm", write: false });
  const { page, complaints } = await open(browser);
  // Nobody listens there: the answer is ours. A page needs an address that others can be told from.
  await page.route("http://127.0.0.1/", (route) =>
    route.fulfill({ contentType: "text/html", body: "<!doctype html><title>reader</title><link rel=icon href=data:,>" }));
  if (served) await page.route("http://127.0.0.1/level.lit.exr", (route) => route.fulfill({ body: served }));
  await page.goto("http://127.0.0.1/");
  await page.addScriptTag({ type: "module", content: bundled.outputFiles[0].text });
  await page.waitForFunction(() => globalThis.renderWithThree ?? globalThis.renderWithBabylon ?? globalThis.loadInModelViewer);
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

/** Bakes fixtures/cornell with `words`, and hands the file's name to `test`. */
async function withBake(program, words, test) {
  const folder = await mkdtemp(join(tmpdir(), "cobake-reader-"));
  try {
    const file = join(folder, "level.lit.glb");
    const scene = here("../../fixtures/cornell/scene.glb");
    await run(program, ["bake", scene, "-o", file, "--size", "96", "--quiet", ...words]);
    await test(file);
  } finally {
    await rm(folder, { recursive: true });
  }
}

/** What the materials of fixtures/cornell are at each place: previews and EXRs on unlit materials do not tell. */
async function materialsAtPlaces(browser, file) {
  const glb = (await readFile(file)).toString("base64");
  let found;
  await withModule(browser, "three_page.mjs", async (page) => {
    found = await page.evaluate(([glb, places]) => globalThis.renderWithThree(glb, places, true), [glb, PLACES]);
  });
  return found;
}

const babylonExr = ({ browser, program, a }) =>
  withBake(program, ["--for", "babylon"], async (file) => {
    const materials = await materialsAtPlaces(browser, a);
    const glb = (await readFile(file)).toString("base64");
    await withModule(
      browser, "babylon_page.mjs",
      async (page) => {
        const seen = await page.evaluate(
          ([glb, places]) => globalThis.renderWithBabylon(glb, places, "http://127.0.0.1/level.lit.exr"), [glb, PLACES],
        );
        // An unlit material shows no emission, and the lamp is not among the places.
        const rendered = materials.map((material, i) => ({ ...material, emission: [0, 0, 0], seen: seen[i] }));
        await compare({ program, file, rendered, tolerance: EXR_TOLERANCE, step: 0 });
      },
      await readFile(file.replace(/glb$/, "exr")),
    );
  });

/** White of the preview's tone map (Reinhard's extended operator), see src/picture/tone.rs. */
const WHITE = 4;

/** The light that the tone map made a colour of, but for the exposure. */
function untoned(rgb) {
  const shown = luminance(rgb);
  const half = (WHITE * WHITE * (shown - 1)) / 2;
  const light = half + Math.sqrt(half * half + WHITE * WHITE * shown);
  return rgb.map((c) => (c * light) / shown);
}

const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;

/** How much linear light half a step of an 8-bit sRGB value is, near `linear`. */
function halfStep(linear) {
  const encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
  const decoded = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return decoded(encoded + 0.5 / 255) - linear;
}

/**
 * Compares a preview with what surfaces send out. `scale` is what a texel of 1 stands for; null for a tone-mapped
 * one, whose exposure only the bake knows: it is taken from all channels, and must then be right for each.
 */
async function comparePreview({ program, file, materials, seen, scale }) {
  const expected = [];
  for (const [i, { albedo, emission }] of materials.entries()) {
    const light = await irradiance(program, file, PLACES[i]);
    expected.push(light.map((e, k) => (albedo[k] * e) / Math.PI + emission[k]));
  }
  const undo = scale ? (rgb) => rgb : untoned;
  const shares = seen.flatMap((rgb, i) => undo(rgb).map((c, k) => c / expected[i][k])).sort((a, b) => a - b);
  const exposure = scale ? 1 : shares[Math.floor(shares.length / 2)];
  for (const [i, rgb] of seen.entries()) {
    for (const k of [0, 1, 2]) {
      const own = undo(rgb)[k] / exposure;
      const texel = scale ? rgb[k] / scale : rgb[k];
      const perStep = scale ?? own / texel;
      const allowed = EXR_TOLERANCE * expected[i][k] + 2 * halfStep(texel) * perStep;
      assert.ok(
        expected[i][k] > 0.001 && Math.abs(own - expected[i][k]) <= allowed,
        `place ${PLACES[i]}, channel ${k}: ${own} instead of ${expected[i][k]}, ${allowed} allowed`,
      );
    }
  }
}

const strengthOf = (bytes) => {
  const json = JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12)));
  const strength = (material) => material.extensions?.KHR_materials_emissive_strength?.emissiveStrength ?? 1;
  return Math.max(...json.materials.filter((material) => material.emissiveTexture).map(strength));
};

const preview = (engine, form) => ({ browser, program, a }) =>
  withBake(program, ["--preview", form], async (file) => {
    const materials = await materialsAtPlaces(browser, a);
    const bytes = await readFile(file);
    const scale = form === "emissive" ? strengthOf(bytes) : null;
    const [module, render] = { three: ["three_page.mjs", "showWithThree"], babylon: ["babylon_page.mjs", "renderWithBabylon"] }[engine];
    await withModule(browser, module, async (page) => {
      const seen = await page.evaluate(
        ([render, glb, places]) => globalThis[render](glb, places), [render, bytes.toString("base64"), PLACES],
      );
      await comparePreview({ program, file, materials, seen, scale });
    });
  });

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
  ["three.js: an unlit preview", preview("three", "unlit")],
  ["three.js: an emissive preview", preview("three", "emissive")],
  ["Babylon.js: the EXR on unlit materials", babylonExr],
  ["Babylon.js: an unlit preview", preview("babylon", "unlit")],
  ["model-viewer: loads", modelViewer],
];
