// A bake: its GLB from the page, as meshes to draw and triangles to ask.

import { Box3, BufferAttribute, GLTFLoader, Mesh, Scene, Vector3 } from "three";
import { readElements } from "view/elements";
import { decodePage, isIrradiance, luminance, sample, scaleOf } from "view/light";
import { surfaceMaterial } from "view/shader";

const EXTENSION = "COBAKE_lightmap";

function bytesOf(element) {
  const text = atob(element.textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  element.remove();
  return bytes.buffer;
}

/** Reads bake number `index`. */
export async function loadModel(index, { name, scene, bytes }) {
  const gltf = await new GLTFLoader().parseAsync(bytesOf(document.getElementById(`glb-${index}`)), "");
  const { json } = gltf.parser;
  const extension = json.extensions[EXTENSION];
  const pages = [];
  for (const { bufferView, quantity } of extension.lightmaps) {
    pages.push(decodePage(await gltf.parser.getDependency("bufferView", bufferView), quantity ?? "irradiance"));
  }
  const elements = extension.elements ? await readElements(gltf.parser, extension.elements) : null;
  const root = gltf.scenes[scene ?? json.scene ?? 0];
  root.updateMatrixWorld(true);
  const drawn = new Scene();
  const meshes = [];
  let camera = null;
  root.traverse((object) => {
    if (object.isPerspectiveCamera) camera ??= object;
    if (object.isMesh) meshes.push(object);
  });
  for (const source of meshes) drawn.add(surface(gltf, source, json, pages, extension.baked?.maxReflectance ?? 1));
  const charts = numberCharts(drawn.children, pages);
  const triangles = drawn.children.reduce((sum, mesh) => sum + mesh.geometry.attributes.position.count / 3, 0);
  const box = new Box3().setFromObject(drawn);
  return { name, bytes, scene: drawn, pages, camera, charts, triangles, box, elements, baked: extension.baked ?? {} };
}

/** One primitive of one node, its triangles taken apart, so that each knows its corners. */
function surface(gltf, source, json, pages, mostReflected) {
  let node = source;
  while (node && gltf.parser.associations.get(node)?.nodes === undefined) node = node.parent;
  const nodeIndex = gltf.parser.associations.get(node)?.nodes;
  const light = json.nodes[nodeIndex]?.extensions?.[EXTENSION];
  const page = source.geometry.attributes.uv1 ? (pages[light?.lightmap] ?? null) : null;
  const geometry = source.geometry.index ? source.geometry.toNonIndexed() : source.geometry.clone();
  const { material } = source;
  const count = geometry.attributes.position.count;
  const set = (texture) => (texture?.channel ? `uv${texture.channel}` : "uv");
  const coordinates = (name) => geometry.attributes[name] ?? new BufferAttribute(new Float32Array(2 * count), 2);
  const wanted = {
    position: geometry.attributes.position,
    uv1: coordinates("uv1"),
    colourUv: coordinates(set(material.map)),
    emissionUv: coordinates(set(material.emissiveMap)),
    metalUv: coordinates(set(material.metalnessMap)),
    tint: new BufferAttribute(tints(geometry.attributes.color, count), 3),
    chart: new BufferAttribute(new Float32Array(count).fill(-1), 1),
  };
  for (const name of Object.keys(geometry.attributes)) geometry.deleteAttribute(name);
  for (const [name, attribute] of Object.entries(wanted)) geometry.setAttribute(name, attribute);
  const mesh = new Mesh(geometry, surfaceMaterial(material, page, mostReflected));
  mesh.matrixAutoUpdate = false;
  mesh.matrix.copy(source.matrixWorld);
  mesh.userData = {
    node: json.nodes[nodeIndex]?.name ?? `node ${nodeIndex}`,
    material: material.name || "unnamed",
    page,
    pageIndex: light?.lightmap,
    side: mesh.material.side,
  };
  mesh.updateMatrixWorld(true);
  return mesh;
}

function tints(colours, count) {
  const tint = new Float32Array(3 * count).fill(1);
  for (let i = 0; colours && i < count; i++) tint.set([colours.getX(i), colours.getY(i), colours.getZ(i)], 3 * i);
  return tint;
}

/** Numbers the charts of all pages: triangles that share a corner in the page are of one chart. Returns how many. */
function numberCharts(meshes, pages) {
  const parents = [];
  const find = (i) => {
    while (parents[i] !== i) i = parents[i] = parents[parents[i]];
    return i;
  };
  const known = pages.map(() => new Map());
  const corners = new Map();
  for (const mesh of meshes) {
    if (!mesh.userData.page) continue;
    const { uv1 } = mesh.geometry.attributes;
    const ids = new Uint32Array(uv1.count);
    for (let i = 0; i < uv1.count; i++) {
      const key = `${uv1.getX(i)} ${uv1.getY(i)}`;
      let id = known[mesh.userData.pageIndex].get(key);
      if (id === undefined) {
        id = parents.push(parents.length) - 1;
        known[mesh.userData.pageIndex].set(key, id);
      }
      ids[i] = id;
      if (i % 3 > 0) parents[find(ids[i])] = find(ids[i - 1]);
    }
    corners.set(mesh, ids);
  }
  const numbers = new Map();
  for (const [mesh, ids] of corners) {
    mesh.geometry.attributes.chart.array.set(
      Array.from(ids, (id) => {
        const root = find(id);
        if (!numbers.has(root)) numbers.set(root, numbers.size);
        return numbers.get(root);
      }),
    );
  }
  return numbers.size;
}

/** What is known about the place where `raycaster` meets the model; null where it meets nothing. */
export function probe(model, raycaster) {
  const hit = raycaster.intersectObjects(model.scene.children, false)[0];
  if (!hit) return null;
  const { geometry, userData, matrixWorld } = hit.object;
  const [a, b, c] = [hit.face.a, hit.face.b, hit.face.c];
  const corner = (i) => new Vector3().fromBufferAttribute(geometry.attributes.position, i).applyMatrix4(matrixWorld);
  const [p, q, r] = [corner(a), corner(b), corner(c)];
  const cross = q.clone().sub(p).cross(r.clone().sub(p));
  const normal = cross.clone().normalize();
  if (matrixWorld.determinant() < 0) normal.negate();
  const found = {
    position: hit.point, normal, distance: hit.distance, node: userData.node, material: userData.material,
    chart: geometry.attributes.chart.getX(a),
  };
  const { page } = userData;
  if (!page) return found;
  // The ray's meeting point, in the triangle's own terms: areas of the three parts over the whole.
  const part = (s, t) => s.clone().sub(hit.point).cross(t.clone().sub(hit.point)).dot(cross) / cross.lengthSq();
  const weights = [part(q, r), part(r, p), part(p, q)];
  const uv1 = geometry.attributes.uv1;
  const [u, v] = ["getX", "getY"].map((get) => [a, b, c].reduce((sum, i, k) => sum + weights[k] * uv1[get](i), 0));
  const inPage = (i) => new Vector3(uv1.getX(i) * page.width, uv1.getY(i) * page.height, 0);
  const area = inPage(b).sub(inPage(a)).cross(inPage(c).sub(inPage(a))).length();
  const value = sample(page, u, v);
  const light = value.map((c) => c * scaleOf(page.quantity));
  return {
    ...found, page, pageIndex: userData.pageIndex, u, v, x: u * page.width, y: v * page.height, light,
    luminance: luminance(light), isIrradiance: isIrradiance(page.quantity), density: Math.sqrt(area / cross.length()),
  };
}
