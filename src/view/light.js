// Lightmap pages: from the EXR's bytes to texels, and from a texel to irradiance.

import { DataTexture, DataUtils, EXRLoader, FloatType, HalfFloatType, NearestFilter, RGBAFormat } from "three";

/** Decodes a page; row 0 is the top one, as texture coordinates have it. Halves stay halves, floats floats. */
export function decodePage(bytes, quantity) {
  const loader = new EXRLoader();
  let image = loader.setDataType(HalfFloatType).parse(bytes);
  const isHalf = image.header.channels.every((channel) => channel.pixelType === 1);
  if (!isHalf) image = loader.setDataType(FloatType).parse(bytes);
  const { data, width, height } = image;
  const row = 4 * width;
  // The loader puts the bottom row first.
  for (let top = 0, bottom = height - 1; top < bottom; top++, bottom--) {
    const kept = data.slice(top * row, (top + 1) * row);
    data.copyWithin(top * row, bottom * row, (bottom + 1) * row);
    data.set(kept, bottom * row);
  }
  const texture = new DataTexture(data, width, height, RGBAFormat, isHalf ? HalfFloatType : FloatType);
  texture.magFilter = texture.minFilter = NearestFilter;
  texture.flipY = false;
  texture.needsUpdate = true;
  return { data, width, height, isHalf, texture, quantity };
}

/** A texel's RGB, in the page's own quantity. */
export function texel(page, x, y) {
  const at = 4 * (y * page.width + x);
  const rgb = [page.data[at], page.data[at + 1], page.data[at + 2]];
  return page.isHalf ? rgb.map(DataUtils.fromHalfFloat) : rgb;
}

/** The page at (u, v): bilinear, clamped to the edge, texel centres at (x + 1/2) / width. */
export function sample(page, u, v) {
  const place = (t, size) => Math.min(Math.max(t * size - 0.5, 0), size - 1);
  const [x, y] = [place(u, page.width), place(v, page.height)];
  const [x0, y0] = [Math.floor(x), Math.floor(y)];
  const [x1, y1] = [Math.min(x0 + 1, page.width - 1), Math.min(y0 + 1, page.height - 1)];
  const mix = (a, b, t) => a.map((value, i) => value + (b[i] - value) * t);
  const row = (y) => mix(texel(page, x0, y), texel(page, x1, y), x - x0);
  return mix(row(y0), row(y1), y - y0);
}

/** Whether irradiance follows from a texel alone; of radiosity only the surface, which knows its albedo, could tell. */
export const isIrradiance = (quantity) => quantity !== "radiosity";

/** What makes irradiance of a texel, where that can be; 1 for radiosity, which stays what it is. */
export const scaleOf = (quantity) => (quantity === "radiance" ? Math.PI : 1);

export const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;

/** Percentiles of the luminance of texels that hold light: what scales and exposure start from. */
export function range(pages) {
  const values = [];
  for (const page of pages) {
    const step = Math.max(1, Math.floor((page.width * page.height) / 65536));
    for (let i = 0; i < page.width * page.height; i += step) {
      const light = luminance(texel(page, i % page.width, Math.floor(i / page.width))) * scaleOf(page.quantity);
      if (light > 0) values.push(light);
    }
  }
  values.sort((a, b) => a - b);
  const at = (share) => values[Math.min(values.length - 1, Math.floor(share * values.length))] ?? 1;
  return { low: at(0.02), middle: at(0.5), high: at(0.98), top: at(0.999) };
}
