// What the page of `cobake view` uses of three.js; esbuild leaves the rest out.
export {
  Box3, BufferAttribute, BufferGeometry, Color, DataTexture, DataUtils, DoubleSide, FloatType, FrontSide, GLSL3, HalfFloatType, Matrix3,
  Mesh, NearestFilter, PerspectiveCamera, Raycaster, RGBAFormat, Scene, ShaderMaterial, Vector2, Vector3, WebGLRenderer,
  WebGLRenderTarget,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { EXRLoader } from "three/addons/loaders/EXRLoader.js";
export { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
