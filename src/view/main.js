// The page: what is shown, and what mouse, fingers and keys do.

import {
  DoubleSide, FloatType, FrontSide, HalfFloatType, NearestFilter, OrbitControls, PerspectiveCamera, Raycaster, Vector2,
  Vector3, WebGLRenderer, WebGLRenderTarget,
} from "three";
import { Atlas } from "view/atlas";
import { drawLegend, short } from "view/legend";
import { isIrradiance, range } from "view/light";
import { loadModel, probe } from "view/model";
import { MEASURE, MODES, shared } from "view/shader";
import { elementUniforms } from "view/elements";

const $ = (id) => document.getElementById(id);

/** What the pages' texels are shown as. */
function quantityName(pages) {
  const names = new Set(pages.map(({ quantity }) => (isIrradiance(quantity) ? "Irradiance" : "Radiosity")));
  return [...names].join(" of A, ") + (names.size > 1 ? " of B" : "");
}

const state = { mode: "lit", stops: 0, swipe: 0.5, difference: 0.2, grid: false, wire: false, mesh: false, cut: false, pinned: null };

function fail(error) {
  $("status").textContent = `The bake cannot be shown: ${error.message ?? error}`;
  $("status").className = "fault";
  $("status").hidden = false;
}

async function start() {
  const renderer = new WebGLRenderer({ canvas: $("stage"), antialias: true });
  renderer.autoClear = false;
  renderer.setClearColor(0x0d0f13);
  const models = [];
  for (const [index, bake] of JSON.parse($("bakes").textContent).entries()) models.push(await loadModel(index, bake));
  run(renderer, models);
  $("status").hidden = true;
}

function run(renderer, models) {
  const [a, b] = models;
  const canvas = renderer.domElement;
  const light = range(a.pages);
  const size = a.box.getSize(new Vector3()).length();
  const camera = new PerspectiveCamera(50, 1, size / 5000, size * 20);
  const controls = new OrbitControls(camera, canvas);
  const raycaster = new Raycaster();
  const atlas = new Atlas($("atlas"));
  const type = renderer.extensions.has("EXT_color_buffer_float") ? FloatType : HalfFloatType;
  const target = new WebGLRenderTarget(1, 1, { type, minFilter: NearestFilter, magFilter: NearestFilter });
  const hasElements = models.some((model) => model.elements);
  // Where one holds radiosity and the other what irradiance follows from, no number says how far they are apart.
  const isComparable = Boolean(b) && isIrradiance(a.pages[0].quantity) === isIrradiance(b.pages[0].quantity);
  let pointer = null;
  let wanted = 0;

  const low = Math.max(light.low, light.high * 1e-4);
  Object.assign(shared.low, { value: low });
  Object.assign(shared.high, { value: Math.max(light.top, low * 1.01) });
  // At first, bright surfaces (98 of 100 are darker) of albedo 0.6 come near to white.
  const standard = Math.PI / (0.6 * Math.max(light.high, 1e-9));

  function place() {
    if (a.camera) {
      camera.fov = a.camera.fov;
      a.camera.matrixWorld.decompose(camera.position, camera.quaternion, new Vector3());
      raycaster.set(camera.position, camera.getWorldDirection(new Vector3()));
      const hit = probe(a, raycaster);
      controls.target.copy(raycaster.ray.at(hit?.distance ?? size / 2, new Vector3()));
    } else {
      controls.target.copy(a.box.getCenter(new Vector3()));
      camera.position.copy(controls.target).add(new Vector3(0.45, 0.4, 0.8).multiplyScalar(size));
    }
    controls.update();
  }

  function draw() {
    const [width, height] = [window.innerWidth, window.innerHeight];
    const ratio = Math.min(window.devicePixelRatio, 2);
    if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
      target.setSize(canvas.width, canvas.height);
    }
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    shared.exposure.value = standard * 2 ** state.stops;
    shared.differenceRange.value = state.difference;
    shared.grid.value = Number(state.grid);
    shared.wire.value = Number(state.wire);
    for (const { scene } of models) {
      for (const mesh of scene.children) mesh.material.side = state.cut ? FrontSide : mesh.userData.side;
    }
    if (state.mode === "difference") {
      shared.mode.value = MEASURE;
      shared.other.value = null;
      renderer.setRenderTarget(target);
      renderer.setClearAlpha(0);
      renderer.clear();
      renderer.render(b.scene, camera);
      renderer.setRenderTarget(null);
      shared.other.value = target.texture;
    }
    elementUniforms.filled.value = state.mode === "elements";
    renderer.setClearAlpha(1);
    shared.mode.value = MODES.indexOf(state.mode);
    const split = isSplit() ? Math.round(state.swipe * width) : width;
    renderer.setScissorTest(true);
    for (const [model, x, w] of [[a, 0, split], [b, split, width - split]]) {
      if (!model || w <= 0) continue;
      renderer.setScissor(x, 0, w, height);
      renderer.clear();
      renderer.render(model.scene, camera);
      if (model.elements && (state.mesh || state.mode === "elements")) renderer.render(model.elements, camera);
    }
    renderer.setScissorTest(false);
  }

  const isSplit = () => Boolean(b) && state.mode !== "difference";

  function ask(x, y) {
    raycaster.setFromCamera(new Vector2((2 * x) / window.innerWidth - 1, 1 - (2 * y) / window.innerHeight), camera);
    const own = isSplit() && x > state.swipe * window.innerWidth ? 1 : 0;
    const found = models.map((model) => probe(model, raycaster));
    return found[own] && { own, ...found[own], values: found };
  }

  function showProbe() {
    const found = state.pinned ?? (pointer && ask(pointer.x, pointer.y));
    const rows = $("probe").querySelector("dl");
    $("probe").querySelector("h2").textContent = state.pinned ? "Kept place" : "Under the cursor";
    $("probe").dataset.found = JSON.stringify(found ? plain(found) : null);
    if (!found) rows.innerHTML = '<div class="none">Point at a surface.</div>';
    else {
      const [first, second] = found.values;
      const lines = [];
      for (const [i, value] of found.values.entries()) {
        if (!value) continue;
        const name = value.isIrradiance === false ? "radiosity" : "irradiance";
        const letter = "AB"[i];
        lines.push([`${letter} ${name}`, value.light ? `<b>${short(value.luminance)}</b> lux` : "no lightmap", letter.toLowerCase()]);
        if (value.light) lines.push(["R G B", value.light.map(short).join(" &nbsp;")]);
        if (value.page) lines.push(["texel", `${value.x.toFixed(1)}, ${value.y.toFixed(1)}`], ["texels a metre", short(value.density)]);
      }
      if (first?.light && second?.light && first.isIrradiance !== second.isIrradiance) {
        lines.push(["B against A", "radiosity and irradiance do not compare"]);
      } else if (first?.light && second?.light) {
        const change = (100 * (second.luminance - first.luminance)) / first.luminance;
        lines.push(["B against A", `<b>${change > 0 ? "+" : ""}${change.toFixed(2)} %</b>`]);
      }
      lines.push(["place, m", found.position.toArray().map((c) => c.toFixed(3)).join("&nbsp; ")]);
      rows.innerHTML = lines.map(([name, text, kind]) => `<dt>${name}</dt><dd class="${kind ?? ""}">${text}</dd>`).join("");
      for (const name of ["node", "material"]) {
        rows.append(Object.assign(document.createElement("dt"), { textContent: name }));
        rows.append(Object.assign(document.createElement("dd"), { textContent: found[name] }));
      }
    }
    if (!$("atlas").hidden) {
      const own = found?.own ?? 0;
      const page = found?.page ?? models[own].pages[0];
      atlas.draw("AB"[own], models[own], page, { low: shared.low.value, high: shared.high.value }, found?.page && found);
    }
  }

  const plain = ({ own, position, normal, node, material, values }) => ({
    own, position: position.toArray(), normal: normal.toArray(), node, material,
    values: values.map((v) => v && { light: v.light, isIrradiance: v.isIrradiance, x: v.x, y: v.y, luminance: v.luminance }),
  });

  function refresh() {
    if (wanted) return;
    wanted = requestAnimationFrame(() => {
      wanted = 0;
      draw();
      showProbe();
    });
  }

  function showState() {
    for (const button of $("modes").children) {
      const own = button.dataset.mode === state.mode;
      button.setAttribute("aria-checked", own);
      button.disabled = !isPossible(button.dataset.mode);
    }
    for (const name of ["grid", "wire", "mesh", "cut"]) $(name).checked = state[name];
    $("mesh").disabled = !hasElements;
    $("atlas-box").checked = !$("atlas").hidden;
    $("exposure").value = state.stops;
    $("exposure-out").textContent = `${state.stops > 0 ? "+" : ""}${state.stops} stops`;
    $("difference-row").hidden = state.mode !== "difference";
    $("range").value = Math.log10(state.difference);
    $("range-out").textContent = `${short(100 * state.difference)} %`;
    $("swipe").hidden = !isSplit();
    $("swipe").style.left = `${100 * state.swipe}%`;
    $("swipe").setAttribute("aria-valuenow", Math.round(100 * state.swipe));
    drawLegend($("legend"), state.mode, {
      low: shared.low.value, high: shared.high.value, difference: state.difference, name: quantityName(models.map((model) => model.pages[0])),
    });
    refresh();
  }

  const isPossible = (mode) =>
    ({ difference: isComparable, elements: hasElements })[mode] ?? true;

  function set(changes) {
    if (!isPossible(changes.mode ?? state.mode) || (changes.mesh && !hasElements)) return;
    Object.assign(state, changes);
    state.swipe = Math.min(Math.max(state.swipe, 0), 1);
    state.stops = Math.min(Math.max(state.stops, -6), 6);
    state.difference = Math.min(Math.max(state.difference, 0.01), 3.2);
    showState();
  }

  function walk(right, up, ahead) {
    const step = new Vector3(right, 0, -ahead).applyQuaternion(camera.quaternion).add(new Vector3(0, up, 0));
    step.multiplyScalar(size / 60);
    camera.position.add(step);
    controls.target.add(step);
    controls.update();
    refresh();
  }

  const togglePanel = () => {
    $("panel").hidden = !$("panel").hidden;
    $("panel-button").setAttribute("aria-expanded", !$("panel").hidden);
  };
  const togglePage = () => {
    $("atlas").hidden = !$("atlas").hidden;
    showState();
  };
  const next = () => (state.swipe === 1 ? 0 : state.swipe === 0 ? 0.5 : 1);
  const keys = {
    ...Object.fromEntries(MODES.map((mode, i) => [String(i + 1), () => set({ mode })])),
    ",": () => set({ swipe: state.swipe - 0.05 }),
    ".": () => set({ swipe: state.swipe + 0.05 }),
    b: () => set({ swipe: next() }),
    "-": () => set({ stops: state.stops - 0.5 }),
    "+": () => set({ stops: state.stops + 0.5 }),
    "=": () => set({ stops: state.stops + 0.5 }),
    0: () => set({ stops: 0 }),
    "[": () => set({ difference: state.difference / 1.25 }),
    "]": () => set({ difference: state.difference * 1.25 }),
    g: () => set({ grid: !state.grid }),
    t: () => set({ wire: !state.wire }),
    m: () => set({ mesh: !state.mesh }),
    x: () => set({ cut: !state.cut }),
    p: togglePage,
    w: () => walk(0, 0, 1), s: () => walk(0, 0, -1), a: () => walk(-1, 0, 0), d: () => walk(1, 0, 0),
    q: () => walk(0, -1, 0), e: () => walk(0, 1, 0),
    r: () => { place(); refresh(); },
    tab: togglePanel,
    "?": () => $("help").showModal(),
  };
  window.addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    const typed = event.target.closest?.("input[type=range], dialog");
    if (event.ctrlKey || event.metaKey || event.altKey || typed || $("help").open) return;
    // Tab still walks through the controls; it opens and shuts the panel over the scene alone.
    if (key === "tab" && document.activeElement !== canvas && document.activeElement !== document.body) return;
    if (!keys[key]) return;
    event.preventDefault();
    keys[key]();
  });

  $("modes").addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (button) set({ mode: button.dataset.mode });
  });
  for (const name of ["grid", "wire", "mesh", "cut"]) $(name).addEventListener("change", () => set({ [name]: $(name).checked }));
  $("atlas-box").addEventListener("change", togglePage);
  $("exposure").addEventListener("input", () => set({ stops: Number($("exposure").value) }));
  $("range").addEventListener("input", () => set({ difference: 10 ** Number($("range").value) }));
  $("panel-button").addEventListener("click", togglePanel);
  $("help-button").addEventListener("click", () => $("help").showModal());

  const swipe = $("swipe");
  swipe.addEventListener("pointerdown", (event) => swipe.setPointerCapture(event.pointerId));
  swipe.addEventListener("pointermove", (event) => {
    if (swipe.hasPointerCapture(event.pointerId)) set({ swipe: event.clientX / window.innerWidth });
  });
  swipe.addEventListener("keydown", (event) => {
    const to = { ArrowLeft: state.swipe - 0.02, ArrowRight: state.swipe + 0.02, Home: 0, End: 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    set({ swipe: to });
  });

  let pressed = null;
  canvas.addEventListener("pointermove", (event) => {
    pointer = { x: event.clientX, y: event.clientY };
    if (!state.pinned) refresh();
  });
  canvas.addEventListener("pointerleave", () => { pointer = null; refresh(); });
  canvas.addEventListener("pointerdown", (event) => { pressed = { x: event.clientX, y: event.clientY }; });
  canvas.addEventListener("click", (event) => {
    // The end of a drag is no click.
    if (!pressed || Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > 4) return;
    state.pinned = state.pinned ? null : ask(event.clientX, event.clientY);
    refresh();
  });
  canvas.addEventListener("dblclick", (event) => {
    const found = ask(event.clientX, event.clientY);
    if (!found) return;
    controls.target.copy(found.position);
    state.pinned = null;
    controls.update();
    refresh();
  });
  controls.addEventListener("change", refresh);
  window.addEventListener("resize", refresh);

  for (const [i, model] of models.entries()) {
    const span = document.createElement("span");
    span.innerHTML = `<span class="letter ${"ab"[i]}">${"AB"[i]}</span>`;
    span.append(model.name);
    $("files").append(span);
    const [page] = model.pages;
    const facts = [
      [`${"AB"[i]} page`, model.pages.map((p) => `${p.width} × ${p.height}`).join(", ")],
      ["holds", `${page.quantity}, ${page.isHalf ? "half" : "single"} floats`],
      ["charts", model.charts.toLocaleString("en")],
      ...(model.elements ? [["elements", model.elements.userData.count.toLocaleString("en")]] : []), ["triangles", model.triangles.toLocaleString("en")],
      ["file", `${short(model.bytes / 1024)} KiB`],
    ];
    for (const [name, text] of facts) {
      $("facts").querySelector("dl").append(
        Object.assign(document.createElement("dt"), { textContent: name }),
        Object.assign(document.createElement("dd"), { textContent: text }),
      );
    }
  }
  document.title = `${models.map((model) => model.name).join(" | ")} – cobake view`;
  if (window.innerWidth < 700) togglePanel();
  place();
  state.cut = !a.camera;
  showState();
  document.body.dataset.ready = "true";
}

start().catch(fail);
