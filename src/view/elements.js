// The elements that the light was solved on, and the states of their Close Objects Buffers (`cobake bake --elements`).

import { BufferAttribute, BufferGeometry, FrontSide, GLSL3, Mesh, Scene, ShaderMaterial } from "three";
import { COB_STATES } from "view/legend";

/** Whether elements are filled with the colours of their states, or only outlined. */
export const elementUniforms = { filled: { value: false } };

const vertexShader = `
in float state; in vec3 away;
flat out int vState; out vec3 vAway;
void main() {
  vState = int(state); vAway = away;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const fragmentShader = `
precision highp float;
flat in int vState; in vec3 vAway;
out vec4 pixel;
uniform bool filled;
const vec3 states[3] = vec3[](${COB_STATES.map((c) => `vec3(${c.map((x) => x.toFixed(6)).join()})`).join()});
void main() {
  vec3 d = vAway / max(fwidth(vAway), vec3(1e-9));
  float line = 1.0 - smoothstep(0.4, 1.2, min(d.x, min(d.y, d.z)));
  if (!filled && line < 0.5) discard;
  pixel = vec4(filled ? mix(states[vState], vec3(0.05, 0.06, 0.09), 0.8 * line) : vec3(1.0, 0.55, 0.85), 1.0);
}`;

/** Reads what the extension says of elements: a scene that draws them over the surfaces. */
export async function readElements(parser, { count, positions, corners, states }) {
  const view = ({ bufferView }) => parser.getDependency("bufferView", bufferView);
  const [places, sizes, kinds] = await Promise.all([positions, corners, states].map(view));
  const geometry = fans(new Float32Array(places), new Uint32Array(sizes), new Uint8Array(kinds));
  const material = new ShaderMaterial({
    glslVersion: GLSL3, vertexShader, fragmentShader, side: FrontSide, uniforms: elementUniforms,
    // They lie in the surfaces.
    polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -2,
  });
  const scene = new Scene();
  scene.add(new Mesh(geometry, material));
  scene.userData.count = count;
  return scene;
}

/** Convex polygons as fans. `away` tells how far a place is from each side, 0 to 1; a fan's inner sides are far. */
function fans(places, sizes, kinds) {
  const triangles = sizes.reduce((sum, size) => sum + Math.max(size - 2, 0), 0);
  const [position, away] = [new Float32Array(9 * triangles), new Float32Array(9 * triangles)];
  const state = new Float32Array(3 * triangles);
  let [first, at] = [0, 0];
  for (const [element, size] of sizes.entries()) {
    for (let k = 1; k + 1 < size; k++, at++) {
      const isInner = [false, k + 2 < size, k > 1];
      for (const [i, corner] of [0, k, k + 1].entries()) {
        position.set(places.subarray(3 * (first + corner), 3 * (first + corner + 1)), 9 * at + 3 * i);
        away.set(isInner.map((inner, side) => Number(inner || side === i)), 9 * at + 3 * i);
      }
      state.fill(kinds[element], 3 * at, 3 * at + 3);
    }
    first += size;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(position, 3));
  geometry.setAttribute("away", new BufferAttribute(away, 3));
  geometry.setAttribute("state", new BufferAttribute(state, 1));
  return geometry;
}
