// Runs in the browser: a baked GLB in <model-viewer>.

import "@google/model-viewer";

/** Resolves to the model's materials' names once it is loaded. */
globalThis.loadInModelViewer = async (base64) => {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const viewer = document.createElement("model-viewer");
  viewer.style.cssText = "width: 300px; height: 300px; display: block";
  viewer.loading = "eager";
  const loaded = new Promise((done, failed) => {
    viewer.addEventListener("load", done);
    viewer.addEventListener("error", (event) => failed(new Error(JSON.stringify(event.detail))));
  });
  viewer.src = URL.createObjectURL(new Blob([bytes], { type: "model/gltf-binary" }));
  document.body.append(viewer);
  await loaded;
  return viewer.model.materials.map((material) => material.name);
};
