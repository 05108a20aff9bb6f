// The page of `cobake view`: what it shows is what `cobake inspect` says, and its controls do what they promise.

import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { fileURLToPath } from "node:url";
import { join } from "node:path";
import { once } from "node:events";
import { promisify } from "node:util";
import { open } from "./chromium.mjs";

const run = promisify(execFile);

/** Irradiance may differ by this share: the page casts its rays in single precision, on corners of single precision. */
const PROBE_TOLERANCE = 2e-3;

/** Where the cursor asks, of the window's width and height: floor, walls, ceiling and blocks, none symmetrical. */
const PLACES = [[0.31, 0.83], [0.44, 0.9], [0.27, 0.4], [0.4, 0.31], [0.55, 0.87], [0.63, 0.12], [0.42, 0.62]];

const ready = (page) => page.waitForSelector("body[data-ready]", { timeout: 60_000 });

const found = async (page) => JSON.parse(await page.locator("#probe").getAttribute("data-found"));

/** Two frames: the page draws in the one after what changed. */
const settle = (page) =>
  page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 30)))));

/** The scene's pixels alone, of 0 to 255: mean, and how far apart the brightest and the darkest are. */
async function look(page) {
  await settle(page);
  const png = (await page.screenshot({ clip: { x: 0, y: 60, width: 600, height: 560 } })).toString("base64");
  return page.evaluate(async (png) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
    const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    let [sum, least, most] = [0, 255, 0];
    for (let i = 0; i < data.length; i += 4) {
      sum += data[i + 1];
      least = Math.min(least, data[i + 1]);
      most = Math.max(most, data[i + 1]);
    }
    return { mean: (4 * sum) / data.length, span: most - least };
  }, png);
}

/** Writes a page of the bakes, opens it as a file and hands it to `test`. Nothing may be complained of. */
async function withPage({ browser, program, a, b }, test) {
  const folder = await mkdtemp(join(tmpdir(), "cobake-view-"));
  try {
    const file = join(folder, "page.html");
    await run(program, ["view", a, b, "--out", file]);
    const { page, complaints } = await open(browser);
    await page.goto(`file://${file}`);
    await ready(page);
    await test(page);
    await page.close();
    assert.deepEqual(complaints, []);
  } finally {
    await rm(folder, { recursive: true });
  }
}

async function modesShow(page) {
  const seen = new Set();
  for (const key of ["1", "2", "3", "4", "5"]) {
    await page.keyboard.press(key);
    const { mean, span } = await look(page);
    assert.ok(span > 40, `mode ${key} is blank: its pixels span ${span}`);
    seen.add(mean.toFixed(1));
    assert.equal(await page.locator("#legend").isVisible(), ["3", "4", "5"].includes(key), `legend in mode ${key}`);
  }
  assert.equal(seen.size, 5, "two modes look alike");
}

async function exposureKeys(page) {
  const before = (await look(page)).mean;
  await page.keyboard.press("+");
  await page.keyboard.press("+");
  const brighter = (await look(page)).mean;
  assert.equal(await page.locator("#exposure-out").textContent(), "+1 stops");
  await page.keyboard.press("0");
  await page.keyboard.press("-");
  await page.keyboard.press("-");
  const darker = (await look(page)).mean;
  assert.ok(brighter > 1.15 * before && darker < 0.87 * before, `${darker}, ${before}, ${brighter}`);
}

async function swipeParts(page) {
  await page.mouse.move(400, 500);
  await settle(page);
  assert.equal((await found(page)).own, 0, "left of the bar is A");
  await page.mouse.move(480, 300);
  await page.mouse.down();
  await page.mouse.move(200, 300, { steps: 4 });
  await page.mouse.up();
  await page.mouse.move(400, 500);
  await settle(page);
  assert.equal((await found(page)).own, 1, "right of it is B");
  assert.equal(await page.locator("#swipe").getAttribute("aria-valuenow"), "21");
}

async function probeTells(page, { program, a, b }) {
  let asked = 0;
  for (const [x, y] of PLACES) {
    await page.mouse.move(960 * x, 640 * y);
    await settle(page);
    const place = await found(page);
    for (const [i, file] of [a, b].entries()) {
      const value = place?.values[i];
      if (!value?.light) continue;
      const at = [...place.position, ...place.normal].join();
      const { stdout } = await run(program, ["inspect", file, "--json", `--at=${at}`]);
      const expected = JSON.parse(stdout).irradiance;
      const worst = Math.max(...expected.map((e, k) => Math.abs(value.light[k] - e))) / Math.max(...expected);
      assert.ok(worst < PROBE_TOLERANCE, `${"AB"[i]} at ${at}: ${value.light} instead of ${expected}`);
      asked += 1;
    }
  }
  assert.ok(asked >= 2 * PLACES.length - 4, `only ${asked} probes hit a surface`);
}

/** Bakes fixtures/cornell with `words`, and hands the file to `test`. */
async function withBake(program, words, test) {
  const folder = await mkdtemp(join(tmpdir(), "cobake-view-"));
  try {
    const file = join(folder, "own.glb");
    const scene = fileURLToPath(new URL("../../fixtures/cornell/scene.glb", import.meta.url));
    await run(program, ["bake", scene, "-o", file, "--size", "128", "--quiet", ...words]);
    await test(file);
  } finally {
    await rm(folder, { recursive: true });
  }
}

/** Radiance times pi is irradiance: the probe says so, and the same light in either form does not differ. */
const radianceIsIrradiance = (given) =>
  withBake(given.program, ["--quantity", "radiance"], (file) =>
    withPage({ ...given, b: file }, async (page) => {
      await probeTells(page, { ...given, b: file });
      await page.mouse.move(0.31 * 960, 0.83 * 640);
      await settle(page);
      const { values } = await found(page);
      assert.ok(values[0].isIrradiance && values[1].isIrradiance);
      const change = Number((await page.locator("#probe dl").textContent()).match(/B against A([-+\d.]+) %/)[1]);
      assert.ok(Math.abs(change) < 0.2, `radiance against irradiance: ${change} %`);
    }));

const radiosityStays = (given) =>
  withBake(given.program, ["--quantity", "radiosity"], (file) =>
    withPage({ ...given, b: file }, async (page) => {
      await page.mouse.move(0.31 * 960, 0.83 * 640);
      await settle(page);
      const { values } = await found(page);
      assert.ok(values[0].isIrradiance && !values[1].isIrradiance);
      // Surfaces that do not glow send out what they reflect, and reflect less than all.
      assert.ok(values[1].luminance < 0.96 * values[0].luminance, `${values[1].luminance}, ${values[0].luminance}`);
      assert.match(await page.locator("#probe dl").textContent(), /B radiosity.*do not compare/);
      assert.ok(await page.locator('[data-mode="difference"]').isDisabled(), "no number says how far they are apart");
      await page.keyboard.press("3");
      await settle(page);
      assert.match(await page.locator("#legend").textContent(), /Irradiance of A, Radiosity of B/);
    }));

/** Counts the scene's pixels near each of three colours. */
async function shares(page, colours) {
  await settle(page);
  const png = (await page.screenshot({ clip: { x: 0, y: 60, width: 600, height: 400 } })).toString("base64");
  return page.evaluate(async ([png, colours]) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
    const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    return colours.map((colour) => {
      let count = 0;
      for (let i = 0; i < data.length; i += 4) count += colour.every((c, k) => Math.abs(data[i + k] - c) < 6);
      return (4 * count) / data.length;
    });
  }, [png, colours]);
}

const elementsShow = (given) =>
  // Light from the mesh alone, and elements as small as this, let many buffers be asked.
  withBake(given.program, ["--elements", "--direct", "mesh", "--subdivision-threshold", "0.02"], (file) =>
    withPage({ ...given, a: file }, async (page) => {
      await page.keyboard.press("b"); // all A
      const plain = await page.locator("#facts dl").textContent();
      assert.match(plain, /elements[\d,]+/);
      const states = [[176, 176, 176], [86, 140, 205], [238, 144, 44]];
      await page.keyboard.press("6");
      const [, empty, notEmpty] = await shares(page, states);
      assert.ok(empty > 0.02 && notEmpty > 0.001, `blue ${empty}, orange ${notEmpty}`);
      assert.match(await page.locator("#legend").textContent(), /never asked.*empty.*not empty/);
      await page.keyboard.press("2");
      const lines = [[255, 140, 217]];
      assert.ok((await shares(page, lines))[0] < 1e-4);
      await page.keyboard.press("m");
      assert.ok((await shares(page, lines))[0] > 1e-3, "the elements' outlines");
    }));

async function helpAndPage(page) {
  await page.keyboard.press("p");
  assert.ok(await page.locator("#atlas").isVisible());
  await page.keyboard.press("?");
  assert.ok(await page.locator("#help").isVisible());
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Close", "what Enter does first");
  await page.keyboard.press("Escape");
  assert.ok(!(await page.locator("#help").isVisible()));
}

async function served({ browser, program, a }) {
  const server = spawn(program, ["view", a], { stdio: ["ignore", "pipe", "inherit"] });
  try {
    const address = String((await once(server.stdout, "data"))[0]).trim();
    const { page, complaints } = await open(browser);
    await page.goto(address);
    await ready(page);
    assert.ok((await look(page)).span > 40);
    assert.ok(await page.locator('[data-mode="difference"]').isDisabled(), "there is no B");
    assert.ok(await page.locator('[data-mode="elements"]').isDisabled(), "there are no elements");
    assert.equal((await fetch(`${address}favicon.ico`)).status, 404);
    await page.close();
    // Browsers ask for an icon that the page does not have.
    assert.deepEqual(complaints.filter((text) => !text.includes("404")), []);
  } finally {
    server.kill();
  }
}

async function sameBytes({ program, a }) {
  const folder = await mkdtemp(join(tmpdir(), "cobake-view-"));
  const pages = [];
  for (const name of ["one.html", "two.html"]) {
    await run(program, ["view", a, "--out", join(folder, name)]);
    pages.push(await readFile(join(folder, name)));
  }
  await rm(folder, { recursive: true });
  assert.ok(pages[0].equals(pages[1]), "two pages of one bake differ");
}

export const viewCases = [
  ["view: every mode shows something of its own", (given) => withPage(given, modesShow)],
  ["view: + and - change the exposure", (given) => withPage(given, exposureKeys)],
  ["view: the bar parts A and B", (given) => withPage(given, swipeParts)],
  ["view: the probe tells what cobake knows", (given) => withPage(given, (page) => probeTells(page, given))],
  ["view: radiance is shown as irradiance", radianceIsIrradiance],
  ["view: radiosity stays radiosity", radiosityStays],
  ["view: elements and their buffers' states", elementsShow],
  ["view: the page and the help open and close", (given) => withPage(given, helpAndPage)],
  ["view: served to this machine", served],
  ["view: the same bakes give the same bytes", sameBytes],
];
