// The page as a picture: its light, its charts' outlines, and where the probe is.

import { isIrradiance, luminance, sample, scaleOf } from "view/light";
import { VIRIDIS } from "view/legend";

/** The longest side of the picture, pixels. */
const LONGEST = 512;

export class Atlas {
  constructor(figure) {
    this.figure = figure;
    this.canvas = figure.querySelector("canvas");
    this.pictures = new Map();
  }

  /** Draws `page` (of bake `letter`) on the scale from `low` to `high`, and a mark at texel (x, y) if there is one. */
  draw(letter, model, page, { low, high }, mark) {
    if (!this.pictures.has(page)) this.pictures.set(page, picture(model, page, low, high));
    const drawn = this.pictures.get(page);
    this.canvas.width = drawn.width;
    this.canvas.height = drawn.height;
    const context = this.canvas.getContext("2d");
    context.drawImage(drawn, 0, 0);
    this.figure.querySelector("figcaption").textContent =
      `Page of ${letter}: ${page.width} × ${page.height}, ${model.charts} charts, ${isIrradiance(page.quantity) ? "irradiance" : "radiosity"} in false colour`;
    if (!mark) return;
    const scale = drawn.width / page.width;
    context.strokeStyle = "#fff";
    context.lineWidth = 2;
    context.beginPath();
    context.arc(mark.x * scale, mark.y * scale, 7, 0, 2 * Math.PI);
    context.stroke();
  }
}

function picture(model, page, low, high) {
  const scale = LONGEST / Math.max(page.width, page.height);
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(1, Math.round(page.width * scale));
  canvas.height = Math.max(1, Math.round(page.height * scale));
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, canvas.height);
  for (let y = 0; y < canvas.height; y++) {
    for (let x = 0; x < canvas.width; x++) {
      const light = luminance(sample(page, (x + 0.5) / canvas.width, (y + 0.5) / canvas.height)) * scaleOf(page.quantity);
      const share = light > 0 ? Math.log(light / low) / Math.log(high / low) : 0;
      const place = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1);
      const i = Math.min(Math.floor(place), VIRIDIS.length - 2);
      const colour = VIRIDIS[i].map((c, k) => 255 * (c + (VIRIDIS[i + 1][k] - c) * (place - i)));
      image.data.set(light > 0 ? [...colour, 255] : [16, 18, 23, 255], 4 * (y * canvas.width + x));
    }
  }
  context.putImageData(image, 0, 0);
  outline(context, model, page, [canvas.width, canvas.height]);
  return canvas;
}

/** Strokes the triangles' edges that only one triangle has: the charts' outlines. */
function outline(context, model, page, [width, height]) {
  const edges = new Map();
  for (const { geometry, userData } of model.scene.children) {
    if (userData.page !== page) continue;
    const { uv1 } = geometry.attributes;
    const corner = (i) => [uv1.getX(i), uv1.getY(i)];
    for (let i = 0; i < uv1.count; i++) {
      const ends = [corner(i), corner(i % 3 === 2 ? i - 2 : i + 1)];
      const key = ends.map((end) => end.join(" ")).sort().join(" ");
      edges.set(key, edges.has(key) ? null : ends);
    }
  }
  context.strokeStyle = "#ffffff66";
  context.lineWidth = 1;
  context.beginPath();
  for (const ends of edges.values()) {
    if (!ends) continue;
    context.moveTo(ends[0][0] * width, ends[0][1] * height);
    context.lineTo(ends[1][0] * width, ends[1][1] * height);
  }
  context.stroke();
}
