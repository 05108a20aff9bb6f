// Runs in the browser: a baked GLB through Babylon.js's glTF loader, rendered to floats.

import * as BABYLON from "babylonjs";
import "babylonjs-loaders";

/** The light as the README has it, lines and all; `address` is that of the EXR beside the output. */
function useExr(scene, address) {
  const light = new BABYLON.Texture(address, scene, true, false);
  Object.assign(light, { coordinatesIndex: 1, vScale: -1, vOffset: 1, wrapU: 0, wrapV: 0 });
  light.onLoadObservable.addOnce(() => { light.gammaSpace = false; });
  for (const mesh of scene.meshes)
    if (mesh.material && mesh.isVerticesDataPresent("uv2"))
      Object.assign(mesh.material, { unlit: true, lightmapTexture: light, useLightmapAsShadowmap: true });
  return new Promise((done) => light.onLoadObservable.addOnce(done));
}

/** UV 0 must not matter to the light; nothing of fixtures/cornell has a texture on it. */
function zeroFirstSet(scene) {
  for (const mesh of scene.meshes) {
    if (mesh.getTotalVertices() > 0) mesh.setVerticesData("uv", new Float32Array(2 * mesh.getTotalVertices()));
  }
}

/**
 * Looks straight at each place, [x, y, z, nx, ny, nz], from close by, and returns the RGB of the pixel in the middle.
 * `exr` is the address of the light; without it the file is shown as it is.
 */
globalThis.renderWithBabylon = async (base64, places, exr) => {
  const canvas = document.createElement("canvas");
  const engine = new BABYLON.Engine(canvas, false);
  const scene = new BABYLON.Scene(engine);
  scene.useRightHandedSystem = true;
  scene.clearColor = new BABYLON.Color4(0, 0, 0, 1);
  // Nothing is encoded for a screen: the floats are what a camera would get.
  scene.imageProcessingConfiguration.applyByPostProcess = true;
  await BABYLON.AppendSceneAsync(`data:model/gltf-binary;base64,${base64}`, scene);
  zeroFirstSet(scene);
  if (exr) await useExr(scene, exr);
  const camera = new BABYLON.FreeCamera("close", BABYLON.Vector3.Zero(), scene);
  camera.mode = BABYLON.Camera.ORTHOGRAPHIC_CAMERA;
  Object.assign(camera, { orthoLeft: -1e-5, orthoRight: 1e-5, orthoTop: 1e-5, orthoBottom: -1e-5, minZ: 1e-4, maxZ: 0.02 });
  scene.activeCamera = camera;
  const target = new BABYLON.RenderTargetTexture("floats", 9, scene, {
    type: BABYLON.Constants.TEXTURETYPE_FLOAT, generateMipMaps: false, samplingMode: BABYLON.Texture.NEAREST_SAMPLINGMODE,
  });
  target.renderList = scene.meshes;
  target.activeCamera = camera;
  scene.customRenderTargets.push(target);
  const seen = [];
  for (const [x, y, z, ...facing] of places) {
    const normal = new BABYLON.Vector3(...facing);
    const place = new BABYLON.Vector3(x, y, z);
    camera.upVector = Math.abs(normal.y) > 0.5 ? new BABYLON.Vector3(1, 0, 0) : new BABYLON.Vector3(0, 1, 0);
    camera.position = place.add(normal.scale(0.01));
    camera.setTarget(place);
    await new Promise((ready) => scene.executeWhenReady(ready));
    while (!target.isReadyForRendering()) await new Promise((later) => setTimeout(later, 20));
    scene.render();
    const pixels = await target.readPixels();
    seen.push([...pixels.slice(160, 163)]);
  }
  engine.dispose();
  return seen;
};
