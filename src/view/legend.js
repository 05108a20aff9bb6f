// Colours that stand for numbers: maps, and the legend that explains them.

/** Of "viridis" (N. Smith and S. van der Walt 2015, CC0): dark violet to yellow. */
export const VIRIDIS = [
  [0.267004, 0.004874, 0.329415], [0.278826, 0.17549, 0.483397], [0.229739, 0.322361, 0.545706],
  [0.172719, 0.448791, 0.557885], [0.127568, 0.566949, 0.550556], [0.157851, 0.683765, 0.501686],
  [0.369214, 0.788888, 0.382914], [0.678489, 0.863742, 0.189503], [0.993248, 0.906157, 0.143936],
];

/** Blue: B is darker; dark grey: alike; orange: B is brighter. */
export const DIVERGING = [
  [0.6, 0.85, 1.0], [0.2, 0.56, 0.94], [0.11, 0.27, 0.5], [0.13, 0.14, 0.16], [0.5, 0.24, 0.08], [0.95, 0.5, 0.12],
  [1.0, 0.86, 0.5],
];

/** Of a Close Objects Buffer: never asked, empty, not empty; the colours of the pictures that a bake draws. */
export const COB_STATES = [[176, 176, 176], [86, 140, 205], [238, 144, 44]].map((colour) => colour.map((c) => c / 255));

const css = ([r, g, b]) => `rgb(${[r, g, b].map((c) => Math.round(255 * c)).join(" ")})`;

/** A short number: three digits, whatever its size. */
export function short(value) {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  return size >= 1e5 || size < 1e-3 ? value.toExponential(2) : Number(value.toPrecision(3)).toString();
}

/** Draws the legend into `element`, or hides it where the mode has none. */
export function drawLegend(element, mode, scale) {
  const kinds = {
    false: {
      title: `${scale.name}, luminance (lux), logarithmic`,
      map: VIRIDIS,
      ticks: [0, 0.25, 0.5, 0.75, 1].map((t) => short(scale.low * (scale.high / scale.low) ** t)),
    },
    difference: {
      title: "B against A, of A’s light; grey: not to be compared",
      map: DIVERGING,
      ticks: [-1, -0.5, 0, 0.5, 1].map((t) => `${t > 0 ? "+" : ""}${short(100 * scale.difference * t)} %`),
    },
    elements: {
      title: "Elements of the solver, by their Close Objects Buffer",
      keys: ["never asked", "empty", "not empty"].map((name, state) => [COB_STATES[state], name]),
    },
    charts: { title: "Each chart of the page in a colour of its own" },
  };
  const kind = kinds[mode];
  element.hidden = !kind;
  if (!kind) return;
  const bar = kind.map ? `<i style="background:linear-gradient(90deg,${kind.map.map(css).join()})"></i>` : "";
  const keys = (kind.keys ?? []).map(([colour, name]) => `<span><s style="background:${css(colour)}"></s>${name}</span>`).join("");
  const ticks = (kind.ticks ?? []).map((tick) => `<span>${tick}</span>`).join("");
  element.innerHTML = `<b>${kind.title}</b>${bar}${keys && `<div>${keys}</div>`}${ticks && `<div>${ticks}</div>`}`;
}
