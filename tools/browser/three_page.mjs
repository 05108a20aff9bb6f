// Runs in the browser: a baked GLB through three.js's GLTFLoader, its light rendered to floats.

import {
  BufferAttribute, DataTexture, FloatType, LinearFilter, MeshLambertMaterial, NearestFilter, NoToneMapping,
  OrthographicCamera, Raycaster, Scene, Vector3, WebGLRenderer, WebGLRenderTarget,
} from "three";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

/** What a loader needs to know of MOZ_lightmap; three r187 has none of its own. */
class MozLightmap {
  constructor(parser) {
    this.parser = parser;
    this.name = "MOZ_lightmap";
  }

  extendMaterialParams(index, params) {
    const lightmap = this.parser.json.materials[index].extensions?.MOZ_lightmap;
    if (!lightmap) return Promise.resolve();
    params.lightMapIntensity = lightmap.intensity ?? 1;
    return this.parser.assignTexture(params, "lightMap", lightmap);
  }
}

/** Puts the EXR in the PNG's place, as the README has it. */
async function useExr(gltf) {
  const { lightmaps } = gltf.parser.json.extensions.COBAKE_lightmap;
  const bytes = await gltf.parser.getDependency("bufferView", lightmaps[0].bufferView);
  const { data, width, height, format, type } = new EXRLoader().setDataType(FloatType).parse(bytes);
  const texture = new DataTexture(data, width, height, format, type);
  Object.assign(texture, { flipY: true, channel: 1, needsUpdate: true, magFilter: LinearFilter, minFilter: LinearFilter });
  gltf.scene.traverse(({ material }) => material?.lightMap && Object.assign(material, { lightMap: texture, lightMapIntensity: 1 }));
}

/** The light that reaches a camera close by each place, [x, y, z, nx, ny, nz]: the RGB of the pixel in the middle. */
function look(content, places) {
  const renderer = new WebGLRenderer({ antialias: false });
  renderer.toneMapping = NoToneMapping;
  const target = new WebGLRenderTarget(9, 9, { type: FloatType, minFilter: NearestFilter, magFilter: NearestFilter });
  const scene = new Scene();
  scene.add(content);
  scene.updateMatrixWorld(true);
  const camera = new OrthographicCamera(-1e-5, 1e-5, 1e-5, -1e-5, 1e-4, 0.02);
  return places.map((place) => {
    const [position, normal] = [new Vector3(...place), new Vector3(...place.slice(3))];
    camera.up.set(...(Math.abs(normal.y) > 0.5 ? [1, 0, 0] : [0, 1, 0]));
    camera.position.copy(position).addScaledVector(normal, 0.01);
    camera.lookAt(position);
    camera.updateMatrixWorld(true);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    const pixels = new Float32Array(4 * 81);
    renderer.readRenderTargetPixels(target, 0, 0, 9, 9, pixels);
    const { object } = new Raycaster(camera.position, normal.clone().negate()).intersectObject(scene, true)[0];
    return { seen: [...pixels.slice(160, 163)], material: object.material };
  });
}

/** UV 0 is set to zero: it must not matter. Both sets may be one accessor; only the first is zeroed. */
function zeroFirstSet(gltf) {
  gltf.scene.traverse(({ geometry }) => {
    geometry?.setAttribute("uv", new BufferAttribute(new Float32Array(2 * geometry.attributes.position.count), 2));
  });
}

const decoded = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0)).buffer;

/** What is seen at each place of a file as it is, a preview for instance. */
globalThis.showWithThree = async (base64, places) => {
  const gltf = await new GLTFLoader().parseAsync(decoded(base64), "");
  zeroFirstSet(gltf);
  return look(gltf.scene, places).map(({ seen }) => seen);
};

/** What is seen at each place, and the material's colour. `exr` takes the EXR instead of the PNG. */
globalThis.renderWithThree = async (base64, places, exr) => {
  const gltf = await new GLTFLoader().register((parser) => new MozLightmap(parser)).parseAsync(decoded(base64), "");
  if (exr) await useExr(gltf);
  zeroFirstSet(gltf);
  // The standard material takes 1.5 % of the light away for a dielectric's gloss (r187, seen straight on).
  gltf.scene.traverse((mesh) => {
    if (!mesh.isMesh) return;
    const { color, emissive, emissiveIntensity, lightMap, lightMapIntensity } = mesh.material;
    mesh.material = new MeshLambertMaterial({ color, emissive, emissiveIntensity, lightMap, lightMapIntensity });
  });
  return look(gltf.scene, places).map(({ seen, material: { color, emissive, emissiveIntensity } }) => ({
    seen, albedo: color.toArray(), emission: emissive.toArray().map((c) => c * emissiveIntensity),
  }));
};
