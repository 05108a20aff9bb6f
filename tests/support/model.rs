//! Scenes made of quads, baked the whole way, and looked at as a viewer would.
#![allow(dead_code, reason = "each test binary uses a part")]
#![allow(clippy::expect_used, reason = "clippy lets tests expect things, but not what they share")]

use cobake::options::{BakeOptions, DensityPolicy, Resolution};
use cobake::progress::Silent;
use cobake::scene::{ImportError, ImportOptions, Scene, from_bytes};
use cobake::{BakeResult, bake_scene};
use glam::{DAffine3, DVec2, DVec3, Vec3};
use serde_json::{Value, json};

use crate::draft::{Draft, FLOAT, INT, floats};

/// Grey that reflects.
pub(crate) fn paint(reflectance: f64) -> Value {
    json!({"pbrMetallicRoughness": {"baseColorFactor": [reflectance, reflectance, reflectance, 1], "metallicFactor": 0}})
}

/// Black that sends out `radiosity` lux.
pub(crate) fn glow(radiosity: f64) -> Value {
    glowing_paint(0.0, radiosity)
}

/// Grey that reflects and sends out `radiosity` lux.
pub(crate) fn glowing_paint(reflectance: f64, radiosity: f64) -> Value {
    let mut material = paint(reflectance);
    material["emissiveFactor"] = json!([1, 1, 1]);
    let strength = radiosity / std::f64::consts::PI;
    material["extensions"] = json!({"KHR_materials_emissive_strength": {"emissiveStrength": strength}});
    material
}

/// `material`, seen from both sides.
pub(crate) fn both_sides(mut material: Value) -> Value {
    material["doubleSided"] = json!(true);
    material
}

/// The quad `abcd`, facing the side from which it runs counter-clockwise.
pub(crate) fn quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Vec<[DVec3; 3]> {
    vec![[a, b, c], [a, c, d]]
}

pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The rectangle from `low` to `high` at height `z`, facing up.
pub(crate) fn up(low: (f64, f64), high: (f64, f64), z: f64) -> Vec<[DVec3; 3]> {
    quad(v(low.0, low.1, z), v(high.0, low.1, z), v(high.0, high.1, z), v(low.0, high.1, z))
}

/// The same triangles seen from the other side.
pub(crate) fn flipped(triangles: &[[DVec3; 3]]) -> Vec<[DVec3; 3]> {
    triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
}

/// The rectangle from `low` to `high` at height `z`, facing down.
pub(crate) fn down(low: (f64, f64), high: (f64, f64), z: f64) -> Vec<[DVec3; 3]> {
    flipped(&up(low, high, z))
}

/// The six sides of a box, facing outward.
pub(crate) fn cuboid(low: DVec3, high: DVec3) -> Vec<[DVec3; 3]> {
    let p = |i: usize| v([low.x, high.x][i & 1], [low.y, high.y][i >> 1 & 1], [low.z, high.z][i >> 2 & 1]);
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .iter()
        .flat_map(|&[a, b, c, d]| quad(p(a), p(b), p(c), p(d)))
        .collect()
}

/// A scene under construction.
pub(crate) struct Model {
    draft: Draft,
    root: DAffine3,
}

impl Model {
    pub(crate) fn new() -> Self {
        let mut draft = Draft::square();
        draft.set("/materials", json!([])).set("/meshes/0/primitives", json!([]));
        draft.set("/extensionsUsed", json!(["KHR_materials_emissive_strength", "KHR_lights_punctual"]));
        draft.set("/extensions", json!({"KHR_lights_punctual": {"lights": []}}));
        Self { draft, root: DAffine3::IDENTITY }
    }

    /// Adds a primitive with vertices and a material of its own.
    pub(crate) fn add(mut self, material: &Value, triangles: &[[DVec3; 3]]) -> Self {
        let positions: Vec<f32> = triangles.iter().flatten().flat_map(|p| p.as_vec3().to_array()).collect();
        let position = self.draft.accessor("VEC3", FLOAT, &floats(&positions));
        let indices: Vec<u8> = (0..3 * triangles.len() as u32).flat_map(u32::to_le_bytes).collect();
        let indices = self.draft.accessor("SCALAR", INT, &indices);
        let number = self.count("/materials");
        self.draft.set("/materials/-", material.clone());
        let primitive = json!({"attributes": {"POSITION": position}, "indices": indices, "material": number});
        self.draft.set("/meshes/0/primitives/-", primitive);
        self
    }

    /// Adds a light of `intensity` (candela, or lux of a `directional` one) at `position`, shining down.
    pub(crate) fn light(mut self, kind: &str, intensity: f64, position: DVec3) -> Self {
        let light = self.count("/extensions/KHR_lights_punctual/lights");
        self.draft
            .set("/extensions/KHR_lights_punctual/lights/-", json!({"type": kind, "intensity": intensity}));
        let node = self.count("/nodes");
        let placed = json!({"translation": position.to_array(),
            "extensions": {"KHR_lights_punctual": {"light": light}}});
        self.draft.set("/nodes/-", placed).set("/nodes/0/children/-", json!(node));
        self
    }

    /// Moves, turns and scales the whole scene.
    pub(crate) fn placed(mut self, root: DAffine3) -> Self {
        self.draft.set("/nodes/0/matrix", json!(glam::DMat4::from(root).to_cols_array()));
        self.root = root;
        self
    }

    fn count(&self, pointer: &str) -> usize {
        self.draft.json.pointer(pointer).and_then(Value::as_array).map_or(0, Vec::len)
    }

    pub(crate) fn scene(self) -> Scene {
        self.read().expect("a scene")
    }

    /// The scene as an importer reads it.
    pub(crate) fn read(mut self) -> Result<Scene, ImportError> {
        if self.count("/meshes/0/primitives") == 0 {
            self.draft.set("/meshes", json!([]));
            self.draft.json["nodes"][1].as_object_mut().expect("an object").remove("mesh");
        }
        from_bytes(&self.draft.glb(), None, &ImportOptions::default())
    }

    pub(crate) fn bake(self, options: &BakeOptions) -> Baked {
        let root = self.root;
        let result = bake_scene(&self.scene(), options, &mut Silent).expect("baked");
        let baked = Baked { result, root };
        baked.check();
        baked
    }
}

/// Options for a page of `side` texels, all of a size, so that distances can be told in texels. The padding is given
/// since what texels miss of a sharp edge depends on where it falls between them.
pub(crate) fn sized(side: u32) -> BakeOptions {
    let mut options = BakeOptions::default();
    options.resolution = Resolution::Size(side);
    options.density = DensityPolicy::Uniform;
    options.padding = Some(1);
    options
}

/// The same with texels where the light needs them.
pub(crate) fn by_light(side: u32) -> BakeOptions {
    let mut options = sized(side);
    options.density = DensityPolicy::Light;
    options
}

/// What a bake gave, and where its scene was placed.
pub(crate) struct Baked {
    pub(crate) result: BakeResult,
    root: DAffine3,
}

/// What the ledger may lose of what was emitted.
const LEDGER: f64 = 1e-3;

impl Baked {
    /// What holds for every bake: no NaN, no negative light, no lost energy.
    fn check(&self) {
        let texels = &self.result.lightmap.texels;
        assert!(texels.iter().flatten().all(|t| t.is_finite() && *t >= 0.0), "a texel that is no light");
        let energy = &self.result.report.energy;
        let lost = energy.imbalance().abs().max_element();
        let emitted = energy.emitted.max_element();
        assert!(lost <= LEDGER * emitted, "{lost} of {emitted} lost: {energy:?}");
    }

    /// A texel's side, metres of the placed scene.
    pub(crate) fn texel(&self) -> f64 {
        1.0 / self.result.atlas.texels_per_metre
    }

    /// The surface on which `point` lies and whose front is on the side of `facing`.
    pub(crate) fn surface_at(&self, point: DVec3, facing: DVec3) -> Option<usize> {
        let (point, facing) =
            (self.root.transform_point3(point), self.root.transform_vector3(facing).normalize());
        let slack = 1e-6 * self.root.transform_vector3(DVec3::X).length() + 1e-9 * point.length();
        self.result.surfaces.iter().position(|s| {
            let at = s.frame.project(point);
            s.frame.normal.dot(facing) > 0.99
                && s.frame.height(point).abs() < slack
                && s.regions.iter().flat_map(|r| &r.triangles).any(|t| inside(t, at, slack))
        })
    }

    /// What a viewer sees at `point`: the bilinear interpolation of the texels around it. Before placing.
    pub(crate) fn at(&self, point: DVec3, facing: DVec3) -> f64 {
        let surface = self.surface_at(point, facing).unwrap_or_else(|| panic!("nothing at {point}"));
        self.on(surface, point)
    }

    /// The same on a surface that is known.
    pub(crate) fn on(&self, surface: usize, point: DVec3) -> f64 {
        let p = self.result.surfaces[surface].frame.project(self.root.transform_point3(point));
        let lightmap = &self.result.lightmap;
        let at = self.result.atlas.chart_at(surface, p).unwrap().texel(p) - 0.5;
        let (low, fraction) = (at.floor(), at.fract().as_vec2());
        let texel = |x: f64, y: f64| {
            let clamp = |v: f64, side: u32| v.clamp(0.0, f64::from(side - 1)) as usize;
            let index = clamp(y, lightmap.height) * lightmap.width as usize + clamp(x, lightmap.width);
            Vec3::from(lightmap.texels[index])
        };
        let top = texel(low.x, low.y).lerp(texel(low.x + 1.0, low.y), fraction.x);
        let bottom = texel(low.x, low.y + 1.0).lerp(texel(low.x + 1.0, low.y + 1.0), fraction.x);
        f64::from(top.lerp(bottom, fraction.y).x)
    }
}

/// Whether `p` lies in the triangle or within `slack` of it.
fn inside(triangle: &[DVec2; 3], p: DVec2, slack: f64) -> bool {
    (0..3).all(|i| {
        let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
        (b - a).perp_dot(p - a) >= -slack * (b - a).length()
    })
}
