//! Narrow gaps: what hangs closely over a surface ends its light at a line.

use glam::DVec3;

use crate::model::{Model, by_light, cuboid, down, flipped, glow, glowing_paint, paint, up, v};
use crate::rectangles::{Boxes, Rectangle};

const EMITTED: f64 = 100.0;

/// Two books a millimetre and a half apart, one 4.5 cm deeper than the other: what of the deeper one's side is seen is a
/// strip, and the rest is dark right behind the other one's edge, far less than a texel away.
#[test]
fn a_book_beside_a_shallower_one() {
    let lamp = Rectangle::new((-0.6, -0.3), (0.6, 0.3));
    let books = [(v(-0.04, 0.0, 0.01), v(0.0, 0.2, 0.25)), (v(0.0015, 0.045, 0.01), v(0.04, 0.2, 0.25))];
    let boxes = Boxes { emitter: lamp, height: 2.0, boxes: &books };
    let mut model = Model::new()
        .add(&paint(0.0), &up((-1.5, -1.5), (1.5, 1.5), 0.0))
        .add(&glow(EMITTED), &down(lamp.low, lamp.high, 2.0));
    for (low, high) in books {
        model = model.add(&paint(0.0), &cuboid(low, high));
    }
    let baked = model.bake(&by_light(64));
    let exact = |p: DVec3| EMITTED * boxes.form_factor(p + 1e-7 * DVec3::X, DVec3::X);
    let bright = exact(v(0.0, 0.02, 0.12));
    for height in [0.08, 0.12, 0.16] {
        for (depth, within) in [(0.01, 0.05), (0.03, 0.05), (0.06, 0.01), (0.1, 0.01)] {
            let p = v(0.0, depth, height);
            let (light, exact) = (baked.at(p, DVec3::X), exact(p));
            assert!((light - exact).abs() < within * bright, "{light} not {exact} at {p}");
        }
    }
}

/// A mug's foot half a millimetre above the table: no light between them, and all of it beside.
#[test]
fn a_foot_just_above_a_table() {
    let room = flipped(&cuboid(v(-1.0, -1.0, 0.0), v(1.0, 1.0, 2.0)));
    let with = |model: Model| {
        let lamp = down((-0.3, -0.3), (0.3, 0.3), 1.99);
        model.add(&paint(0.6), &room).add(&glow(EMITTED), &lamp).bake(&by_light(48))
    };
    let empty = with(Model::new());
    let foot = cuboid(v(0.3, 0.2, 0.0005), v(0.38, 0.28, 0.1));
    let baked = with(Model::new().add(&paint(0.6), &foot));
    let beside = empty.at(v(0.34, 0.16, 0.0), DVec3::Z);
    for (x, y) in [(0.34, 0.24), (0.33, 0.24), (0.34, 0.23)] {
        let above = baked.at(v(x, y, 0.0005), -DVec3::Z);
        assert!(above < 0.03 * beside, "{above} under the foot at {x} {y}, {beside} beside");
    }
    for point in [v(0.4, 0.1, 0.0), v(0.2, 0.1, 0.0), v(0.34, 0.1, 0.0)] {
        let (found, without) = (baked.at(point, DVec3::Z), empty.at(point, DVec3::Z));
        assert!(
            found > 0.75 * without && found < 1.1 * without,
            "{found} at {point}, {without} without the foot"
        );
    }
}

/// A small lamp 2 cm below a white ceiling: what is reflected to and fro between them comes out, and no more: on all
/// surfaces of a closed room lies `Φ / (1 − ρ)`.
#[test]
fn a_lamp_just_below_a_ceiling() {
    const REFLECTANCE: f64 = 0.7;
    let room = flipped(&cuboid(v(-1.0, -1.0, 0.0), v(1.0, 1.0, 2.0)));
    let baked = Model::new()
        .add(&paint(REFLECTANCE), &room)
        .add(&glowing_paint(REFLECTANCE, EMITTED), &cuboid(v(-0.1, -0.1, 1.97), v(0.1, 0.1, 1.98)))
        .bake(&by_light(256));
    let received: f64 = baked
        .result
        .facets
        .iter()
        .flat_map(|f| {
            f.leaves().map(move |leaf| f.elements[leaf as usize].area * (f.mean(leaf).0 + f.mean(leaf).1).x)
        })
        .sum();
    let expected = EMITTED * 0.088 / (1.0 - REFLECTANCE);
    assert!((received / expected - 1.0).abs() < 0.01, "{received} not {expected}");
}

/// A plate 1 cm above the floor where all surfaces glow and reflect alike: light is the same everywhere, `M / (1 − ρ)`, and
/// between the two it has come to and fro many times.
#[test]
fn light_goes_to_and_fro_in_a_gap() {
    const REFLECTANCE: f64 = 0.8;
    let paint = glowing_paint(REFLECTANCE, 1.0);
    let room = flipped(&cuboid(v(-1.0, -1.0, 0.0), v(1.0, 1.0, 2.0)));
    let plate = cuboid(v(-0.3, -0.3, 0.01), v(0.3, 0.3, 0.03));
    let baked = Model::new().add(&paint, &room).add(&paint, &plate).bake(&by_light(64));
    let expected = 1.0 / (1.0 - REFLECTANCE);
    for (x, y) in [(0.0, 0.0), (0.1, 0.17), (-0.25, 0.05), (0.6, 0.1)] {
        let floor = baked.at(v(x, y, 0.0), DVec3::Z);
        assert!((floor / expected - 1.0).abs() < 0.02, "{floor} not {expected} on the floor at {x} {y}");
    }
    for (x, y) in [(0.0, 0.0), (0.1, 0.17), (-0.25, 0.05)] {
        let under = baked.at(v(x, y, 0.01), -DVec3::Z);
        assert!((under / expected - 1.0).abs() < 0.02, "{under} not {expected} under the plate at {x} {y}");
    }
}
