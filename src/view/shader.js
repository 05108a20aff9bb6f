// How a surface is drawn: one program for all modes.

import { DoubleSide, FrontSide, GLSL3, Matrix3, ShaderMaterial, Vector2, Vector3 } from "three";
import { DIVERGING, VIRIDIS } from "view/legend";
import { scaleOf } from "view/light";

export const MODES = ["lit", "light", "false", "difference", "charts", "elements"];

/** The mode that writes the light's brightness and the place in space, for the difference. */
export const MEASURE = MODES.length;

/** Uniforms that all surfaces share. */
export const shared = {
  mode: { value: 0 },
  exposure: { value: 1 },
  low: { value: 0.1 },
  high: { value: 100 },
  differenceRange: { value: 0.2 },
  grid: { value: 0 },
  wire: { value: 0 },
  other: { value: null },
  viewport: { value: new Vector2(1, 1) },
};

const vertexShader = `
in vec2 uv1; in vec2 colourUv; in vec2 emissionUv; in vec2 metalUv; in vec3 tint; in float chart;
// At a triangle's edge a pixel's middle may lie beside it, and in the page beside its chart: hence centroid.
centroid out vec2 vUv1;
out vec2 vColourUv, vEmissionUv, vMetalUv; out vec3 vTint, vCorner, vPlace; flat out float vChart;
void main() {
  vUv1 = uv1; vColourUv = colourUv; vEmissionUv = emissionUv; vMetalUv = metalUv; vTint = tint; vChart = chart;
  int corner = gl_VertexID % 3;
  vCorner = vec3(corner == 0, corner == 1, corner == 2);
  vPlace = (modelMatrix * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const mapFunction = (name, map) => `
vec3 ${name}(float t) {
  const vec3 c[${map.length}] = vec3[](${map.map((c) => `vec3(${c.map((x) => x.toFixed(6)).join()})`).join()});
  float p = clamp(t, 0.0, 1.0) * ${(map.length - 1).toFixed(1)};
  int i = min(int(p), ${map.length - 2});
  return mix(c[i], c[i + 1], p - float(i));
}`;

const fragmentShader = `
precision highp float; precision highp int; precision highp sampler2D;
centroid in vec2 vUv1;
in vec2 vColourUv, vEmissionUv, vMetalUv; in vec3 vTint, vCorner, vPlace; flat in float vChart;
out vec4 pixel;
uniform sampler2D page, colourMap, emissionMap, metalMap, other;
uniform bool hasPage, hasColourMap, hasEmissionMap, hasMetalMap, isRadiosity;
uniform vec3 colour, emission; uniform float metal, most, cutoff, pageScale;
uniform mat3 colourTransform, emissionTransform, metalTransform;
uniform int mode; uniform float exposure, low, high, differenceRange, grid, wire;
uniform vec2 viewport;
const float PI = 3.14159265358979;
${mapFunction("viridis", VIRIDIS)}
${mapFunction("diverging", DIVERGING)}
float brightness(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }
vec3 encoded(vec3 c) { return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
// Khronos PBR Neutral: leaves colours below 0.8 as they are.
vec3 toned(vec3 c) {
  float x = min(c.r, min(c.g, c.b));
  c -= x < 0.08 ? x - 6.25 * x * x : 0.04;
  float peak = max(c.r, max(c.g, c.b));
  if (peak < 0.76) return c;
  float newPeak = 1.0 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
  c *= newPeak / peak;
  return mix(c, vec3(newPeak), 1.0 - 1.0 / (0.15 * (peak - newPeak) + 1.0));
}
// Bilinear by hand: exact, and float textures need no filtering extension.
vec3 stored(vec2 uv) {
  ivec2 size = textureSize(page, 0);
  vec2 p = clamp(uv * vec2(size) - 0.5, vec2(0.0), vec2(size - 1));
  ivec2 a = ivec2(floor(p)), b = min(a + 1, size - 1);
  vec2 t = p - vec2(a);
  return mix(mix(texelFetch(page, a, 0).rgb, texelFetch(page, ivec2(b.x, a.y), 0).rgb, t.x),
             mix(texelFetch(page, ivec2(a.x, b.y), 0).rgb, texelFetch(page, b, 0).rgb, t.x), t.y);
}
vec3 hue(float n) {
  float h = fract(n * 0.61803398875), v = 0.62 + 0.3 * fract(n * 0.3819);
  return v * mix(vec3(1.0), clamp(abs(fract(h + vec3(0.0, 2.0, 1.0) / 3.0) * 6.0 - 3.0) - 1.0, 0.0, 1.0), 0.62);
}
void main() {
  vec3 albedo = colour * vTint; float alpha = 1.0;
  if (hasColourMap) {
    vec4 t = texture(colourMap, (colourTransform * vec3(vColourUv, 1.0)).xy);
    albedo *= t.rgb; alpha = t.a;
  }
  if (alpha < cutoff) discard;
  float m = metal;
  if (hasMetalMap) m *= texture(metalMap, (metalTransform * vec3(vMetalUv, 1.0)).xy).b;
  albedo = min(albedo * (1.0 - m), vec3(most));
  vec3 shone = emission;
  if (hasEmissionMap) shone *= texture(emissionMap, (emissionTransform * vec3(vEmissionUv, 1.0)).xy).rgb;
  vec3 value = hasPage ? stored(vUv1) : vec3(0.0);
  // Radiosity stays what it is: a dark albedo would make much of its rounding.
  vec3 E = value * pageScale;
  if (mode == ${MEASURE}) { pixel = vec4(hasPage ? brightness(E) : -1.0, vPlace); return; }
  vec3 c;
  if (mode == 0) c = encoded(toned(exposure * (isRadiosity ? value / PI : albedo * E / PI + shone)));
  else if (!hasPage) c = vec3(0.16);
  else if (mode == 1) c = encoded(toned(exposure * 0.6 * E / PI));
  else if (mode == 2) c = viridis(log(max(brightness(E), 1e-20) / low) / log(high / low));
  else if (mode == 3) {
    vec4 b = texelFetch(other, ivec2(gl_FragCoord.xy), 0);
    float a = brightness(E);
    // At an edge the pixel's middle may lie beside this surface, where B shows another one.
    bool isSame = b.r >= 0.0 && distance(b.gba, vPlace) < 0.1 * length(fwidth(vPlace)) + 1e-6 * length(vPlace);
    c = isSame ? diverging(0.5 + 0.5 * (b.r - a) / max(a, 1e-9 * high) / differenceRange) : vec3(0.3);
  } else if (mode == 5) c = vec3(0.16);
  else c = hue(vChart) * (0.75 + 0.25 * clamp(log(max(brightness(E), 1e-20) / low) / log(high / low), 0.0, 1.0));
  if (grid > 0.0 && hasPage) {
    vec2 t = vUv1 * vec2(textureSize(page, 0)), w = max(fwidth(t), vec2(1e-6));
    vec2 line = 1.0 - clamp(min(fract(t), 1.0 - fract(t)) / w, 0.0, 1.0);
    float seen = 1.0 - smoothstep(0.15, 0.4, max(w.x, w.y));
    c = mix(c, brightness(c) > 0.45 ? vec3(0.0) : vec3(1.0), 0.45 * seen * max(line.x, line.y));
  }
  if (wire > 0.0) {
    vec3 d = vCorner / max(fwidth(vCorner), vec3(1e-9));
    float line = 1.0 - smoothstep(0.5, 1.3, min(d.x, min(d.y, d.z)));
    c = mix(c, mode == 2 || mode == 4 ? vec3(0.02, 0.05, 0.1) : vec3(0.35, 0.85, 1.0), 0.75 * line);
  }
  pixel = vec4(c, 1.0);
}`;

/** The material that draws what glTF's `material` says, lit by `page` (null: by none). */
export function surfaceMaterial(material, page, mostReflected) {
  const map = (texture) => texture?.matrix ?? new Matrix3();
  const emission = new Vector3().setFromColor(material.emissive ?? { r: 0, g: 0, b: 0 });
  for (const texture of [material.map, material.emissiveMap, material.metalnessMap]) texture?.updateMatrix();
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader,
    fragmentShader,
    side: material.side === DoubleSide ? DoubleSide : FrontSide,
    uniforms: {
      ...shared,
      page: { value: page?.texture ?? null },
      hasPage: { value: Boolean(page) },
      isRadiosity: { value: page?.quantity === "radiosity" },
      pageScale: { value: page ? scaleOf(page.quantity) : 1 },
      colour: { value: new Vector3().setFromColor(material.color) },
      colourMap: { value: material.map ?? null },
      hasColourMap: { value: Boolean(material.map) },
      colourTransform: { value: map(material.map) },
      emission: { value: emission.multiplyScalar(material.emissiveIntensity ?? 1) },
      emissionMap: { value: material.emissiveMap ?? null },
      hasEmissionMap: { value: Boolean(material.emissiveMap) },
      emissionTransform: { value: map(material.emissiveMap) },
      metal: { value: material.metalness ?? 0 },
      metalMap: { value: material.metalnessMap ?? null },
      hasMetalMap: { value: Boolean(material.metalnessMap) },
      metalTransform: { value: map(material.metalnessMap) },
      most: { value: mostReflected },
      cutoff: { value: material.alphaTest ?? 0 },
    },
  });
}
