//! Geometry that is out of order: the light on what is in order stays right, and nothing takes for ever.

use glam::DVec3;

use crate::model::{Baked, Model, cuboid, down, flipped, glow, paint, quad, sized, up, v};
use crate::rectangles::{Rectangle, parallel};

const EMITTED: f64 = 100.0;

/// What texels miss of the closed form.
const CLOSE: f64 = 3e-3;

type Triangles = Vec<[DVec3; 3]>;

/// A floor under a lamp, one metre up, and `junk` that lies on the floor's right half or beside it.
fn with(junk: &[Triangles]) -> Baked {
    let mut model = Model::new()
        .add(&paint(0.0), &up((-2.0, -1.0), (2.0, 1.0), 0.0))
        .add(&glow(EMITTED), &down((-1.3, -0.3), (-0.7, 0.3), 1.0));
    for triangles in junk {
        model = model.add(&paint(0.0), triangles);
    }
    model.bake(&sized(96))
}

/// The floor's left half has nothing on it: the closed form holds there.
fn assert_left_half(baked: &Baked, name: &str) {
    for k in 0..15 * 15 {
        let (x, y) = (-1.9 + 0.12 * f64::from(k % 15), -0.9 + 0.128 * f64::from(k / 15));
        let seen = Rectangle::new((-1.3 - x, -0.3 - y), (-0.7 - x, 0.3 - y));
        let exact = EMITTED * parallel(seen, 1.0);
        let found = baked.at(v(x, y, 0.0), DVec3::Z);
        let brightest = EMITTED * 0.11;
        assert!((found - exact).abs() < CLOSE * brightest, "{name}: {found} not {exact} at {x}, {y}");
    }
}

#[test]
fn slivers() {
    let sliver = |x: f64, width: f64| vec![[v(x, -0.9, 0.2), v(x + width, 0.0, 0.2), v(x, 0.9, 0.2)]];
    let standing = |x: f64| quad(v(x, -0.9, 0.0), v(x, 0.9, 0.0), v(x, 0.9, 1e-6), v(x, -0.9, 1e-6));
    let on_floor =
        quad(v(0.5, -0.9, 0.0), v(0.5 + 1.8e-6, -0.9, 0.0), v(0.5 + 1.8e-6, 0.9, 0.0), v(0.5, 0.9, 0.0));
    let junk = [sliver(1.0, 1.8e-6), sliver(1.2, 1e-4), standing(1.4), standing(1.5), on_floor];
    assert_left_half(&with(&junk), "slivers");
}

/// A fan of a hundred slivers, as exporters make of round plates.
#[test]
fn a_fan_of_slivers() {
    let at = |i: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 100.0).sin_cos();
        v(1.0 + 0.5 * cos, 0.5 * sin, 0.1)
    };
    let fan: Triangles = (1..99).map(|i| [at(0), at(i), at(i + 1)]).collect();
    assert_left_half(&with(&[fan]), "a fan");
}

#[test]
fn no_area() {
    let p = v(1.0, 0.2, 0.3);
    let junk = vec![
        [p; 3],
        [p, p, p + DVec3::X],
        [p, p + DVec3::X, p + 0.3 * DVec3::X],
        [v(0.5, 0.0, 0.0), v(1.5, 0.0, 0.0), v(1.0, 0.0, 0.0)],
        [v(0.5, 0.0, 0.1), v(1.5, 0.0, 0.1), v(1.0, 1e-30, 0.1)],
    ];
    assert_left_half(&with(&[junk]), "no area");
}

/// The right half of the floor twice, thrice, turned over, and overlapping in part.
#[test]
fn coplanar_over_each_other() {
    let plate = up((0.5, -0.8), (1.5, 0.8), 0.0);
    let shifted = up((0.9, -0.3), (1.9, 0.93), 0.0);
    for (name, junk) in [
        ("twice", vec![plate.clone()]),
        ("thrice", vec![plate.clone(), plate.clone()]),
        ("in one mesh", vec![[plate.clone(), plate.clone()].concat()]),
        ("turned over", vec![flipped(&plate)]),
        ("overlapping", vec![plate.clone(), shifted.clone()]),
        ("overlapping and turned over", vec![[plate, flipped(&shifted)].concat()]),
    ] {
        assert_left_half(&with(&junk), name);
    }
}

/// A floor of which one half lies there twice: both are lit, and energy still adds up.
#[test]
fn duplicates_are_lit_alike() {
    let floor = up((-1.0, -1.0), (1.0, 1.0), 0.0);
    let baked = Model::new()
        .add(&paint(0.0), &floor)
        .add(&paint(0.0), &up((-0.1, -1.0), (1.0, 1.0), 0.0))
        .add(&glow(EMITTED), &down((-0.3, -0.3), (0.3, 0.3), 1.0))
        .bake(&sized(96));
    let exact = EMITTED * parallel(Rectangle::new((-0.3, -0.3), (0.3, 0.3)), 1.0);
    let floors: Vec<usize> =
        (0..baked.result.surfaces.len()).filter(|&s| baked.result.surfaces[s].frame.normal.z > 0.9).collect();
    assert_eq!(floors.len(), 2);
    for floor in floors {
        let found = baked.on(floor, v(0.0, 0.0, 0.0));
        assert!((found / exact - 1.0).abs() < CLOSE, "{found} not {exact} on floor {floor}");
    }
}

/// Three sheets that share one edge, a box without a lid, and a face turned over: edges with one or three faces.
#[test]
fn non_manifold() {
    let sheets = [(1.0, 0.0), (0.3, 0.8), (-0.2, 0.9)].map(|(x, z)| {
        let (a, b, out) = (v(1.0, -0.5, 0.1), v(1.0, 0.5, 0.1), v(0.4 * x, 0.0, 0.4 * z));
        quad(a, b, b + out, a + out)
    });
    let mut open = cuboid(v(1.2, -0.9, 0.0), v(1.5, -0.6, 0.3));
    open.truncate(9);
    open[4].swap(1, 2);
    assert_left_half(&with(&[sheets.concat(), open]), "non-manifold");
}

/// The floor in strips that meet in T-junctions: one surface, and no seam in the light.
#[test]
fn t_junctions() {
    let mut floor = Triangles::new();
    for row in 0..5 {
        let (y0, y1) = (-1.0 + 0.4 * f64::from(row), -0.6 + 0.4 * f64::from(row));
        let columns = 2 + row;
        for column in 0..columns {
            let x = |c: i32| -1.0 + 2.0 * f64::from(c) / f64::from(columns);
            floor.extend(up((x(column), y0), (x(column + 1), y1), 0.0));
        }
    }
    let lamp = Rectangle::new((-0.3, -0.3), (0.3, 0.3));
    let baked = Model::new()
        .add(&paint(0.0), &floor)
        .add(&glow(EMITTED), &down(lamp.low, lamp.high, 1.0))
        .bake(&sized(64));
    for k in 0..40 * 40 {
        let (x, y) = (-0.975 + 0.05 * f64::from(k % 40), -0.975 + 0.05 * f64::from(k / 40));
        let exact = parallel(Rectangle::new((-0.3 - x, -0.3 - y), (0.3 - x, 0.3 - y)), 1.0);
        let found = baked.at(v(x, y, 0.0), DVec3::Z) / EMITTED;
        assert!((found - exact).abs() < CLOSE * 0.11, "{found} not {exact} at {x}, {y}");
    }
}

/// A floor that faces down hides the light from below and takes none.
#[test]
fn a_flipped_floor_is_dark() {
    let baked = Model::new()
        .add(&paint(0.5), &down((-1.0, -1.0), (1.0, 1.0), 0.0))
        .add(&glow(EMITTED), &down((-0.3, -0.3), (0.3, 0.3), 1.0))
        .bake(&sized(48));
    let light = baked.at(v(0.0, 0.0, 0.0), -DVec3::Z);
    assert!(light == 0.0, "{light} through a floor");
}
