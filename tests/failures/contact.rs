//! Where surfaces meet: no light leaks in, no shadow leaks out, right up to the line.

use glam::DVec3;

use crate::model::{Baked, Model, both_sides, cuboid, down, glow, paint, quad, sized, up, v};
use crate::rectangles::{Boxes, Rectangle};

const EMITTED: f64 = 100.0;

fn lamp() -> Rectangle {
    Rectangle::new((-0.4, -0.3), (0.4, 0.3))
}

/// Texels from the contact at which the light is looked at: the first within the texel that the line crosses.
const AWAY: [f64; 5] = [0.05, 0.5, 1.0, 2.0, 4.0];

/// What may be missing and what may be too much, as fractions of typical light, beyond what holds within a texel.
const BESIDE: (f64, f64) = (0.05, 0.01);

/// Where a shadow's edge starts at a box's corner, the texel there cannot show it, and is 0.26 too dark.
const AT_CONTACT: (f64, f64) = (0.3, 0.01);

/// Looks along `line`, a contact, at several distances `away` from it.
fn assert_light(baked: &Baked, boxes: &Boxes, line: &[DVec3], away: DVec3, normal: DVec3, name: &str) {
    let typical = EMITTED * boxes.form_factor(v(1.2, 1.2, 0.0), DVec3::Z);
    for distance in AWAY {
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for &start in line {
            let point = start + away * distance * baked.texel();
            let (least, most) = around(baked, boxes, (point, away, distance), normal);
            let found = baked.at(point, normal);
            (low, high) = (low.min((found - least) / typical), high.max((found - most) / typical));
        }
        let (too_dark, too_bright) = if distance < 0.1 { AT_CONTACT } else { BESIDE };
        assert!(low > -too_dark && high < too_bright, "{name}, {distance} texels away: {low} {high}");
    }
}

/// The least and the most light within a texel of `point`, on its side of the contact: what a bilinear lookup
/// there may show.
fn around(
    baked: &Baked,
    boxes: &Boxes,
    (point, away, distance): (DVec3, DVec3, f64),
    normal: DVec3,
) -> (f64, f64) {
    let across = normal.cross(away);
    let reach = baked.texel();
    let mut range = (f64::INFINITY, 0.0_f64);
    for k in 0..25 {
        let at = |k: i32| f64::from(k) / 2.0 - 1.0;
        let outward = at(k % 5).max(0.02 - distance);
        let p = point + reach * (outward * away + at(k / 5) * across);
        let exact = EMITTED * boxes.form_factor(p + 1e-7 * normal, normal);
        range = (range.0.min(exact), range.1.max(exact));
    }
    range
}

fn along(a: DVec3, b: DVec3) -> Vec<DVec3> {
    (0..19).map(|i| a.lerp(b, (f64::from(i) + 1.0) / 20.0)).collect()
}

/// A box on a floor under a lamp off to one side: the floor around it, lit and in its shadow.
#[test]
fn a_box_on_a_floor() {
    let e = lamp();
    let (low, high) = (v(0.513, 0.217, 0.0), v(0.913, 0.717, 0.45));
    let boxes = Boxes { emitter: e, height: 2.0, boxes: &[(low, high)] };
    let baked = Model::new()
        .add(&paint(0.0), &up((-1.5, -1.5), (1.5, 1.5), 0.0))
        .add(&paint(0.0), &cuboid(low, high))
        .add(&glow(EMITTED), &down(e.low, e.high, 2.0))
        .bake(&sized(160));
    let c = |x: f64, y: f64| v(x, y, 0.0);
    let (x0, x1, y0, y1) = (low.x, high.x, low.y, high.y);
    assert_light(&baked, &boxes, &along(c(x0, y0), c(x0, y1)), -DVec3::X, DVec3::Z, "floor lit x");
    assert_light(&baked, &boxes, &along(c(x0, y0), c(x1, y0)), -DVec3::Y, DVec3::Z, "floor lit y");
    assert_light(&baked, &boxes, &along(c(x1, y0), c(x1, y1)), DVec3::X, DVec3::Z, "floor shadow x");
    assert_light(&baked, &boxes, &along(c(x0, y1), c(x1, y1)), DVec3::Y, DVec3::Z, "floor shadow y");
    assert_light(&baked, &boxes, &along(c(x0, y0), c(x0, y1)), DVec3::Z, -DVec3::X, "box foot lit");
    assert_light(&baked, &boxes, &along(c(x1, y0), c(x1, y1)), DVec3::Z, DVec3::X, "box foot shadow");
}

/// A shelf cut into a wall: the wall above it is lit, the wall beneath lies in its shadow.
#[test]
fn a_board_in_a_wall() {
    let e = lamp();
    let (low, high) = (v(-0.613, 0.8, 0.873), v(0.587, 1.2, 0.953));
    let boxes = Boxes { emitter: e, height: 2.0, boxes: &[(low, high)] };
    let wall = quad(v(-1.0, 1.0, 0.0), v(1.0, 1.0, 0.0), v(1.0, 1.0, 2.0), v(-1.0, 1.0, 2.0));
    let baked = Model::new()
        .add(&paint(0.0), &wall)
        .add(&paint(0.0), &cuboid(low, high))
        .add(&paint(0.0), &up((-1.5, -1.5), (1.5, 1.5), 0.0))
        .add(&glow(EMITTED), &down(e.low, e.high, 2.0))
        .bake(&sized(192));
    let above = along(v(low.x, 1.0, high.z), v(high.x, 1.0, high.z));
    let below = along(v(low.x, 1.0, low.z), v(high.x, 1.0, low.z));
    assert_light(&baked, &boxes, &above, DVec3::Z, -DVec3::Y, "wall above");
    assert_light(&baked, &boxes, &below, -DVec3::Z, -DVec3::Y, "wall below");
    assert_light(&baked, &boxes, &above, -DVec3::Y, DVec3::Z, "board top");
}

/// A box pierces another's top: the light on both, beside the line where they cut.
#[test]
fn boxes_that_pierce_each_other() {
    let e = lamp();
    let lower = (v(-0.7, -0.6, 0.0), v(0.8, 0.7, 0.5));
    let upper = (v(0.313, -0.217, 0.2), v(0.613, 0.283, 0.9));
    let boxes = Boxes { emitter: e, height: 2.0, boxes: &[lower, upper] };
    let baked = Model::new()
        .add(&paint(0.0), &cuboid(lower.0, lower.1))
        .add(&paint(0.0), &cuboid(upper.0, upper.1))
        .add(&paint(0.0), &up((-1.5, -1.5), (1.5, 1.5), 0.0))
        .add(&glow(EMITTED), &down(e.low, e.high, 2.0))
        .bake(&sized(192));
    let c = |x: f64, y: f64| v(x, y, 0.5);
    let (x0, x1, y0, y1) = (upper.0.x, upper.1.x, upper.0.y, upper.1.y);
    assert_light(&baked, &boxes, &along(c(x0, y0), c(x0, y1)), -DVec3::X, DVec3::Z, "top lit");
    assert_light(&baked, &boxes, &along(c(x1, y0), c(x1, y1)), DVec3::X, DVec3::Z, "top shadow");
    assert_light(&baked, &boxes, &along(c(x0, y0), c(x0, y1)), DVec3::Z, -DVec3::X, "side lit");
    assert_light(&baked, &boxes, &along(c(x0, y0), c(x1, y0)), DVec3::Z, -DVec3::Y, "side askew");
    assert_light(&baked, &boxes, &along(c(x1, y0), c(x1, y1)), DVec3::Z, DVec3::X, "side shadow");
}

/// Only reflected light comes here, from the floor. Corners and middles of the wall's elements lie beside the strip,
/// and agree.
#[test]
fn a_strip_before_a_wall() {
    let strip =
        |x: f64| quad(v(x, 1.99, 2.31), v(x + 0.6, 1.99, 2.31), v(x + 0.6, 1.99, 2.44), v(x, 1.99, 2.44));
    let baked = Model::new()
        .add(&paint(0.8), &up((-2.0, -2.0), (2.0, 2.0), 0.0))
        .add(&paint(0.5), &quad(v(-2.0, 2.0, 0.0), v(2.0, 2.0, 0.0), v(2.0, 2.0, 4.0), v(-2.0, 2.0, 4.0)))
        .add(&both_sides(paint(0.0)), &[-1.3, 0.13].map(strip).concat())
        .add(&glow(EMITTED), &down((-0.5, -0.5), (0.5, 0.5), 2.0))
        .bake(&sized(256));
    for x in [-1.0, 0.43] {
        let beside = baked.at(v(x, 2.0, 2.7), -DVec3::Y);
        let behind = baked.at(v(x, 2.0, 2.375), -DVec3::Y);
        assert!(
            beside > 0.3 && behind < 0.1 * beside,
            "behind the strip at {x}: {behind}, beside it {beside}"
        );
    }
}
