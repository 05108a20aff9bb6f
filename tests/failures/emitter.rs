//! Emitters that touch what they light: where `cos cos / π r²` is infinite, and horizons cut.

use crate::model::{Model, down, glow, paint, quad, sized, up, v};
use crate::rectangles::{Rectangle, parallel, perpendicular};

const EMITTED: f64 = 100.0;

/// What texels miss of the closed form where they can show it, as a fraction.
const CLOSE: f64 = 1e-3;

/// The same within the texel at the contact, whose value a lookup interpolates with the one beside it.
const AT_CONTACT: f64 = 0.01;

/// A wall that glows stands on a floor, its lower edge on it: the point on the floor's middle line at `d`
/// sees what the table of unit squares says.
#[test]
fn an_edge_on_a_floor() {
    const TABLE: [(f64, f64); 7] = [
        (1.0, 0.07109),
        (0.5, 0.19014),
        (0.2, 0.35042),
        (0.1, 0.42254),
        (0.05, 0.46091),
        (0.02, 0.48432),
        (0.01, 0.49216),
    ];
    let wall = quad(v(-0.5, 0.0, 0.0), v(-0.5, 0.0, 1.0), v(0.5, 0.0, 1.0), v(0.5, 0.0, 0.0));
    let baked = Model::new()
        .add(&paint(0.5), &up((-1.0, 0.0), (1.0, 2.0), 0.0))
        .add(&glow(EMITTED), &wall)
        .bake(&sized(256));
    for (d, table) in TABLE {
        let exact = perpendicular(Rectangle::new((-0.5, 0.0), (0.5, 1.0)), d);
        assert!((exact - table).abs() < 6e-6, "the catalogue's own {exact} at {d}");
        let found = baked.at(v(0.0, d, 0.0), v(0.0, 0.0, 1.0)) / EMITTED;
        assert!((found / exact - 1.0).abs() < CLOSE, "{found} not {exact} at {d}");
    }
    // The texels beside the contact show no dark line, and no bright one.
    for k in 1..25 {
        let d = 0.002 * f64::from(k);
        let exact = perpendicular(Rectangle::new((-0.5, 0.0), (0.5, 1.0)), d);
        let found = baked.at(v(0.0, d, 0.0), v(0.0, 0.0, 1.0)) / EMITTED;
        assert!((found / exact - 1.0).abs() < AT_CONTACT, "{found} not {exact} at {d}");
    }
    // Along the contact half of all is seen, and little beside it.
    for x in [-0.45, -0.2, 0.3, 0.45] {
        let found = baked.at(v(x, 1e-4, 0.0), v(0.0, 0.0, 1.0)) / EMITTED;
        let exact = perpendicular(Rectangle::new((-0.5 - x, 0.0), (0.5 - x, 1.0)), 1e-4);
        assert!((found / exact - 1.0).abs() < AT_CONTACT, "{found} not {exact} at {x}");
    }
    for x in [-0.9, -0.6, 0.7, 0.9] {
        let found = baked.at(v(x, 0.05, 0.0), v(0.0, 0.0, 1.0)) / EMITTED;
        let exact = perpendicular(Rectangle::new((-0.5 - x, 0.0), (0.5 - x, 1.0)), 0.05);
        assert!((found / exact - 1.0).abs() < AT_CONTACT, "{found} not {exact} beside, at {x}");
    }
}

/// A lamp lies on its face, a gap above the floor: under its middle the floor gets all it sends out.
#[test]
fn a_face_on_a_floor() {
    for gap in [1e-4, 1e-3, 1e-2] {
        let baked = Model::new()
            .add(&paint(0.5), &up((-1.0, -1.0), (1.0, 1.0), 0.0))
            .add(&glow(EMITTED), &down((-0.25, -0.25), (0.25, 0.25), gap))
            .bake(&sized(128));
        for (x, y) in [(0.0, 0.0), (0.1, 0.15), (0.2, -0.2), (0.4, 0.0), (0.7, 0.6)] {
            let seen = Rectangle::new((-0.25 - x, -0.25 - y), (0.25 - x, 0.25 - y));
            let exact = parallel(seen, gap);
            let found = baked.at(v(x, y, 0.0), v(0.0, 0.0, 1.0)) / EMITTED;
            assert!((found - exact).abs() < 3e-3, "{found} not {exact} under a gap of {gap} at {x}, {y}");
        }
    }
}

/// The lamp lies in the receiver's plane, looking away or up with it: neither lights the other.
#[test]
fn an_emitter_in_the_receivers_plane() {
    for lift in [0.0, -0.3] {
        let baked = Model::new()
            .add(&paint(0.5), &up((-1.0, -1.0), (1.0, 1.0), 0.0))
            .add(&glow(EMITTED), &up((1.0, -1.0), (2.0, 1.0), lift))
            .add(&glow(EMITTED), &down((-2.0, -1.0), (-1.0, 1.0), 0.0))
            .bake(&sized(96));
        let floor = baked.surface_at(v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0)).expect("a floor");
        for k in 0..40 * 40 {
            let at = |i: i32| -1.0 + (f64::from(i) + 0.5) / 20.0;
            let light = baked.on(floor, v(at(k % 40), at(k / 40), 0.0));
            assert!(light == 0.0, "{light} of a lamp in the same plane ({lift})");
        }
    }
}

/// A box that glows stands on a floor: its foot touches, four sides meet the floor at right angles.
#[test]
fn a_lamp_that_stands_on_the_floor() {
    let baked = Model::new()
        .add(&paint(0.5), &up((-1.0, -1.0), (1.0, 1.0), 0.0))
        .add(&glow(EMITTED), &crate::model::cuboid(v(-0.2, -0.3, 0.0), v(0.2, 0.3, 0.5)))
        .bake(&sized(192));
    for (x, y) in [(0.21, 0.0), (0.205, 0.1), (0.25, -0.2), (0.3, 0.0), (0.6, 0.25), (0.9, 0.0)] {
        let exact = perpendicular(Rectangle::new((-0.3 - y, 0.0), (0.3 - y, 0.5)), x - 0.2);
        let found = baked.at(v(x, y, 0.0), v(0.0, 0.0, 1.0)) / EMITTED;
        assert!((found / exact - 1.0).abs() < CLOSE, "{found} not {exact} at {x}, {y}");
    }
}
