//! Surfaces that are drawn with interpolated normals, lit about these.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic)]

#[allow(dead_code, reason = "import's tests use the rest")]
#[path = "import/draft.rs"]
mod draft;

use std::f64::consts::{PI, TAU};

use cobake::options::{BakeOptions, DensityPolicy, Normals, Resolution};
use cobake::progress::Silent;
use cobake::scene::{ImportError, ImportOptions, Scene, from_bytes};
use cobake::{BakeResult, bake_scene};
use draft::{Draft, FLOAT, INT, floats};
use glam::{DMat3, DVec3, Vec3};
use serde_json::{Value, json};

/// Of the most light that there is: what texels miss between their centres, and facets of the sphere's radius.
const WITHIN: f64 = 0.015;

/// Triangles, and the normals that their corners are drawn with.
#[derive(Clone, Default)]
struct Mesh {
    triangles: Vec<[DVec3; 3]>,
    normals: Vec<[DVec3; 3]>,
}

impl Mesh {
    /// A sphere of radius 1 around the origin, of 16 × 8 facets, drawn as round.
    fn sphere() -> Self {
        let at = |column: u32, row: u32| {
            let (sin, cos) = (TAU * f64::from(column % 16) / 16.0).sin_cos();
            let (across, up) = (PI * f64::from(row) / 8.0).sin_cos();
            DVec3::new(across * cos, across * sin, up)
        };
        let mut sphere = Self::default();
        for (column, row) in (0..16 * 8).map(|k| (k % 16, k / 16)) {
            let quad = [at(column, row), at(column, row + 1), at(column + 1, row + 1), at(column + 1, row)];
            if row < 7 {
                sphere.add([quad[0], quad[1], quad[2]]);
            }
            if row > 0 {
                sphere.add([quad[0], quad[2], quad[3]]);
            }
        }
        sphere
    }

    fn add(&mut self, corners: [DVec3; 3]) {
        self.triangles.push(corners);
        self.normals.push(corners);
    }

    /// A box around the origin, drawn with its faces' normals.
    fn cuboid(half: DVec3) -> Self {
        let mut cuboid = Self::default();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let [n, u, v] = [0, 1, 2].map(|k| DVec3::AXES[(axis + k) % 3]);
                let corner = |x: f64, y: f64| half * (side * n + x * u + side * y * v);
                let [a, b, c, d] =
                    [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
                cuboid.triangles.extend([[a, b, c], [a, c, d]]);
                cuboid.normals.extend([[side * n; 3]; 2]);
            }
        }
        cuboid
    }

    /// The same seen from inside.
    fn inside_out(self) -> Self {
        let turned = |list: Vec<[DVec3; 3]>, sign: f64| {
            list.into_iter().map(move |[a, b, c]| [a, c, b].map(|v| sign * v))
        };
        Self {
            triangles: turned(self.triangles, 1.0).collect(),
            normals: turned(self.normals, -1.0).collect(),
        }
    }
}

/// Meshes, each with a material, and lights; the first mesh's node is stretched.
struct Model {
    draft: Draft,
    root: DMat3,
    first: Option<Mesh>,
}

impl Model {
    fn new() -> Self {
        let mut draft = Draft::square();
        draft.set("/materials", json!([])).set("/meshes", json!([])).set("/nodes", json!([]));
        draft.set("/scenes/0/nodes", json!([]));
        Self { draft, root: DMat3::IDENTITY, first: None }
    }

    fn node(&mut self, node: Value) {
        let index = self.draft.json["nodes"].as_array().unwrap().len();
        self.draft.set("/nodes/-", node).set("/scenes/0/nodes/-", json!(index));
    }

    /// Adds a mesh of this reflectance and exitance, stretched by `scale`.
    fn with(mut self, mesh: &Mesh, (reflectance, exitance): (f64, f64), scale: DVec3) -> Self {
        let all = |list: &[[DVec3; 3]]| -> Vec<u8> {
            list.iter().flatten().flat_map(|v| floats(&v.as_vec3().to_array())).collect()
        };
        let position = self.draft.accessor("VEC3", FLOAT, &all(&mesh.triangles));
        let normal = self.draft.accessor("VEC3", FLOAT, &all(&mesh.normals));
        let indices: Vec<u8> = (0..3 * mesh.triangles.len() as u32).flat_map(u32::to_le_bytes).collect();
        let indices = self.draft.accessor("SCALAR", INT, &indices);
        let index = self.draft.json["meshes"].as_array().unwrap().len();
        self.draft.set(
            "/meshes/-",
            json!({"primitives": [{"attributes": {"POSITION": position, "NORMAL": normal}, "indices": indices,
                "material": index}]}),
        );
        self.draft.set(
            "/materials/-",
            json!({"pbrMetallicRoughness": {"baseColorFactor": [reflectance, reflectance, reflectance, 1],
                "metallicFactor": 0}, "emissiveFactor": [1, 1, 1],
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": exitance / PI}}}),
        );
        self.node(json!({"mesh": index, "scale": scale.to_array()}));
        if self.first.is_none() {
            self.root = DMat3::from_diagonal(scale);
            self.first = Some(mesh.clone());
        }
        self
    }

    /// Adds a light that shines from `place`, from far away where it is directional.
    fn lit(mut self, light: &Value, place: DVec3) -> Self {
        self.draft.set("/extensions", json!({"KHR_lights_punctual": {"lights": [light]}}));
        self.draft.set("/extensionsUsed", json!(["KHR_lights_punctual", "KHR_materials_emissive_strength"]));
        let turn = glam::DQuat::from_rotation_arc(-DVec3::Z, -place.normalize());
        self.node(json!({"translation": place.to_array(), "rotation": turn.to_array(),
            "extensions": {"KHR_lights_punctual": {"light": 0}}}));
        self
    }

    fn scene(&self, normals: Normals) -> Result<Scene, ImportError> {
        from_bytes(&self.draft.glb(), None, &ImportOptions { normals, ..ImportOptions::default() })
    }

    fn bake(&self, normals: Normals, side: u32) -> BakeResult {
        let mut options = BakeOptions::default();
        (options.normals, options.resolution) = (normals, Resolution::Size(side));
        options.density = DensityPolicy::Uniform;
        bake_scene(&self.scene(normals).unwrap(), &options, &mut Silent).expect("baked")
    }

    /// Places all over the first mesh: the point, the interpolated normal, and what a viewer sees there.
    fn seen(&self, result: &BakeResult) -> Vec<(DVec3, DVec3, f64)> {
        let mesh = self.first.as_ref().unwrap();
        let normals =
            mesh.normals.iter().map(|t| t.map(|n| (self.root.inverse().transpose() * n).normalize()));
        let corners = mesh.triangles.iter().map(|t| t.map(|p| self.root * p));
        let mut seen = Vec::new();
        for (triangle, (corners, normals)) in corners.zip(normals).enumerate() {
            let surface =
                result.surfaces.iter().position(|s| s.source_triangles.contains(&triangle)).unwrap();
            for k in 0..25 {
                let (u, v) = (0.02 + 0.24 * f64::from(k % 5), 0.02 + 0.24 * f64::from(k / 5));
                if u + v < 1.0 {
                    let mix = |c: [DVec3; 3]| (1.0 - u - v) * c[0] + u * c[1] + v * c[2];
                    let point = mix(corners);
                    seen.push((point, mix(normals).normalize(), lookup(result, surface, point)));
                }
            }
        }
        seen
    }
}

/// What a viewer sees at a point: the bilinear interpolation of the texels around it.
fn lookup(result: &BakeResult, surface: usize, point: DVec3) -> f64 {
    let p = result.surfaces[surface].frame.project(point);
    let at = result.atlas.chart_at(surface, p).unwrap().texel(p) - 0.5;
    let (low, fraction) = (at.floor(), at.fract().as_vec2());
    let texel = |x: f64, y: f64| {
        let index = y as usize * result.lightmap.width as usize + x as usize;
        Vec3::from(result.lightmap.texels[index])
    };
    let top = texel(low.x, low.y).lerp(texel(low.x + 1.0, low.y), fraction.x);
    let bottom = texel(low.x, low.y + 1.0).lerp(texel(low.x + 1.0, low.y + 1.0), fraction.x);
    f64::from(top.lerp(bottom, fraction.y).x)
}

/// Every place has the light that `expected` tells of its position and normal, to a fraction of `most`.
fn assert_seen(model: &Model, side: u32, most: f64, expected: impl Fn(DVec3, DVec3) -> f64) {
    let result = model.bake(Normals::Shading, side);
    for (point, normal, seen) in model.seen(&result) {
        let expected = expected(point, normal);
        assert!((seen - expected).abs() <= WITHIN * most, "{point}: {seen} instead of {expected}");
    }
}

const BLACK: (f64, f64) = (0.0, 0.0);

/// Light from a direction that is parallel to no edge, by which terminators cross facets at all angles.
const SUN: DVec3 = DVec3::new(0.3, -0.5, 0.7);

fn sunlit(mesh: &Mesh, scale: DVec3) -> Model {
    Model::new().with(mesh, BLACK, scale).lit(&json!({"type": "directional", "intensity": 1}), SUN)
}

/// No facets, and no blotches where the normals turn away from the light.
#[test]
fn a_coarse_sphere_in_the_sun_is_round() {
    let cosine = |_, normal: DVec3| normal.dot(SUN.normalize()).max(0.0);
    assert_seen(&sunlit(&Mesh::sphere(), DVec3::ONE), 512, 1.0, cosine);
}

/// Normals follow a node that stretches and mirrors.
#[test]
fn normals_are_stretched_and_mirrored() {
    let cosine = |_, normal: DVec3| normal.dot(SUN.normalize()).max(0.0);
    assert_seen(&sunlit(&Mesh::sphere(), DVec3::new(-1.0, 1.3, 0.8)), 512, 1.0, cosine);
}

#[test]
fn a_coarse_sphere_under_a_lamp_is_round() {
    let lamp = 8.0 * SUN.normalize();
    let model = Model::new().with(&Mesh::sphere(), BLACK, DVec3::ONE);
    let model = model.lit(&json!({"type": "point", "intensity": 49}), lamp);
    assert_seen(&model, 512, 1.0, |_, normal| {
        let way = lamp - normal;
        49.0 * normal.dot(way).max(0.0) / way.length().powi(3)
    });
}

/// A lamp in a hollow sphere shines on all of it.
#[test]
fn a_hollow_sphere_is_round() {
    let lamp = DVec3::new(0.2, 0.3, -0.1);
    let model = Model::new().with(&Mesh::sphere().inside_out(), BLACK, DVec3::ONE);
    let model = model.lit(&json!({"type": "point", "intensity": 1}), lamp);
    assert_seen(&model, 512, 2.0, |point, normal| {
        let way = lamp - point;
        normal.dot(way).max(0.0) / way.length().powi(3)
    });
}

/// A bowl's own wall throws its shadow into it: facets in that shadow have no light, though their normals face the sun.
#[test]
fn a_bowl_shades_itself() {
    let whole = Mesh::sphere().inside_out();
    let mut bowl = Mesh::default();
    for (triangle, normals) in whole.triangles.iter().zip(&whole.normals) {
        if triangle.iter().all(|p| p.z < 1e-6) {
            bowl.triangles.push(*triangle);
            bowl.normals.push(*normals);
        }
    }
    let model = sunlit(&bowl, DVec3::ONE);
    let (sun, mut facing) = (SUN.normalize(), 0);
    for (point, normal, seen) in model.seen(&model.bake(Normals::Shading, 512)) {
        let cosine = normal.dot(sun);
        // Where the way to the sun leaves the sphere.
        let height = (-normal + 2.0 * cosine * sun).z;
        if height < -0.2 || cosine < 0.0 {
            facing += u32::from(cosine > 0.05);
            assert!(seen < WITHIN, "{point} in the shadow: {seen}, cosine {cosine}");
        } else if height > 0.2 {
            assert!((seen - cosine).abs() < WITHIN, "{point} in the sun: {seen}, cosine {cosine}");
        }
    }
    assert!(facing > 20, "{facing}");
}

/// White furnaces: in a room that glows evenly a sphere has even light, and in a sphere that does.
#[test]
fn even_light_is_even() {
    let room = Mesh::cuboid(DVec3::new(2.0, 2.5, 1.5)).inside_out();
    let sphere =
        Model::new().with(&Mesh::sphere(), (0.5, 1.0), DVec3::ONE).with(&room, (0.5, 1.0), DVec3::ONE);
    assert_seen(&sphere, 256, 2.0, |_, _| 2.0);
    let hollow = Model::new().with(&Mesh::sphere().inside_out(), (0.5, 1.0), DVec3::ONE);
    assert_seen(&hollow, 256, 2.0, |_, _| 2.0);
}

/// Facets on both sides of an edge have the same light there: from a lamp with extent, and reflected.
#[test]
fn neighbours_agree() {
    let ground = Mesh::cuboid(DVec3::new(4.0, 4.0, 0.1));
    let lamp = Mesh::cuboid(DVec3::new(0.5, 0.5, 0.5));
    let move_by = |mesh: &Mesh, by: DVec3| {
        let triangles = mesh.triangles.iter().map(|t| t.map(|p| p + by)).collect();
        Mesh { triangles, normals: mesh.normals.clone() }
    };
    let sphere = Mesh::sphere();
    let model = Model::new()
        .with(&sphere, (0.5, 0.0), DVec3::ONE)
        .with(&move_by(&ground, DVec3::new(0.0, 0.0, -1.2)), (0.7, 0.0), DVec3::ONE)
        .with(&move_by(&lamp, 3.5 * SUN.normalize()), (0.0, 10.0), DVec3::ONE);
    let result = model.bake(Normals::Shading, 512);
    let most = model.seen(&result).iter().map(|s| s.2).fold(0.0, f64::max);
    let surface = |t: usize| result.surfaces.iter().position(|s| s.source_triangles.contains(&t)).unwrap();
    let mut edges = 0;
    for (t, a) in sphere.triangles.iter().enumerate() {
        for (o, b) in sphere.triangles.iter().enumerate().skip(t + 1) {
            let shared: Vec<DVec3> =
                a.iter().copied().filter(|p| b.iter().any(|q| q.distance(*p) < 1e-6)).collect();
            let (first, second) = (surface(t), surface(o));
            if let [from, to] = shared[..]
                && first != second
            {
                edges += 1;
                for k in 1..8 {
                    let point = from.lerp(to, f64::from(k) / 8.0);
                    let (one, other) = (lookup(&result, first, point), lookup(&result, second, point));
                    assert!((one - other).abs() <= WITHIN * most, "{point}: {one} and {other} of {most}");
                }
            }
        }
    }
    assert!(edges > 200, "{edges}");
}

/// What is flat is the same either way, to the byte, its normals rounded to eight bits; so is what has normals that
/// point inwards.
#[test]
fn flat_surfaces_stay_as_they_are() {
    let room = Mesh::cuboid(DVec3::new(2.0, 2.5, 1.5)).inside_out();
    let mut block = Mesh::cuboid(DVec3::new(0.4, 0.5, 0.6));
    block.normals.iter_mut().flatten().for_each(|n| *n += DVec3::new(0.003, -0.002, 0.004));
    let mut wrong = Mesh::sphere();
    wrong.normals.iter_mut().flatten().for_each(|n| *n = -*n);
    for mesh in [block, wrong] {
        let model = Model::new().with(&mesh, (0.5, 0.0), DVec3::ONE).with(&room, (0.7, 1.0), DVec3::ONE);
        let [geometric, shading] = [Normals::Geometric, Normals::Shading].map(|n| model.bake(n, 128).glb);
        assert!(geometric == shading);
    }
}

/// Facets are lit as facets unless told otherwise, whatever is wrong with their normals.
#[test]
fn normals_are_read_when_asked_for() {
    let mut sphere = Mesh::sphere();
    sphere.normals.pop();
    let model = Model::new().with(&sphere, (0.5, 1.0), DVec3::ONE);
    assert!(model.scene(Normals::Geometric).unwrap().normals.is_empty());
    let refusal = model.scene(Normals::Shading).unwrap_err().to_string();
    assert!(refusal.contains("NORMAL"), "{refusal}");
}
