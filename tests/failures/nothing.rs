//! Scenes with almost nothing in them, and reflectances at both ends of the range.

use crate::model::{Baked, Model, cuboid, down, flipped, glow, glowing_paint, paint, quad, sized, up, v};
use crate::rectangles::{Rectangle, parallel};

/// What interpolation between texels 6 cm wide misses of a closed form, as a fraction.
const EXACT: f64 = 2e-3;

fn is_black(baked: &Baked) -> bool {
    baked.result.lightmap.texels.iter().all(|t| *t == [0.0; 3])
}

#[test]
fn no_light_is_black() {
    let room = flipped(&cuboid(v(0.0, 0.0, 0.0), v(1.0, 1.0, 1.0)));
    assert!(is_black(&Model::new().add(&paint(0.8), &room).bake(&sized(32))));
    assert!(is_black(&Model::new().add(&glow(0.0), &room).bake(&sized(32))));
    let dark = Model::new().add(&paint(0.8), &room).light("point", 0.0, v(0.5, 0.5, 0.5));
    assert!(is_black(&dark.bake(&sized(32))));
}

#[test]
fn one_triangle_lights_nothing() {
    let triangle = [[v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)]];
    let baked = Model::new().add(&glow(10.0), &triangle).bake(&sized(32));
    assert!(is_black(&baked));
    let sunny = Model::new().add(&paint(0.5), &triangle).light("directional", 7.0, v(0.0, 0.0, 1.0));
    let light = sunny.bake(&sized(32)).at(v(0.3, 0.3, 0.0), v(0.0, 0.0, 1.0));
    assert!((light - 7.0).abs() < EXACT, "{light}");
}

/// A scene without a triangle is refused in words; one whose only triangle has no area too, or it is black.
#[test]
fn no_triangle_is_an_error_in_words() {
    let error = Model::new().read().expect_err("nothing to bake").to_string();
    assert!(error.contains("triangle"), "{error}");
    let point = Model::new().add(&glow(1.0), &[[v(1.0, 1.0, 1.0); 3]]).scene();
    match cobake::bake_scene(&point, &sized(32), &mut cobake::progress::Silent) {
        Ok(result) => assert!(result.lightmap.texels.iter().all(|t| *t == [0.0; 3])),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// Nothing is reflected: a lamp's light is its form factor and no more.
#[test]
fn black_surfaces_reflect_nothing() {
    let baked = Model::new()
        .add(&paint(0.0), &flipped(&cuboid(v(-1.0, -1.0, 0.0), v(1.0, 1.0, 2.0))))
        .add(&glow(100.0), &down((-0.3, -0.3), (0.3, 0.3), 1.9))
        .bake(&sized(96));
    for (x, y) in [(0.0, 0.0), (0.5, -0.3), (-0.9, 0.9)] {
        let seen = Rectangle::new((-0.3 - x, -0.3 - y), (0.3 - x, 0.3 - y));
        let exact = 100.0 * parallel(seen, 1.9);
        let light = baked.at(v(x, y, 0.0), v(0.0, 0.0, 1.0));
        assert!((light / exact - 1.0).abs() < EXACT, "{light} not {exact}");
    }
    assert!(baked.at(v(0.0, 0.0, 2.0), v(0.0, 0.0, -1.0)) == 0.0, "light behind the lamp");
    assert!(baked.result.report.energy.unshot.max_element() == 0.0);
}

/// A furnace whose walls would reflect all light for ever: they reflect what `max_reflectance` says.
#[test]
fn white_walls_are_clamped() {
    // A room that glows evenly is as bright as the clamp allows: B = 1 / (1 − 0.95), of which E = (B − 1) / 0.95.
    const WITHIN: f64 = 5e-4;
    let room = flipped(&cuboid(v(0.0, 0.0, 0.0), v(1.0, 1.3, 0.8)));
    let baked = Model::new().add(&glowing_paint(1.0, 1.0), &room).bake(&sized(64));
    let corner = [v(0.5, 0.6, 0.0), v(0.02, 0.02, 0.0), v(0.98, 1.28, 0.0), v(0.01, 0.7, 0.0)];
    for point in corner {
        let light = baked.at(point, v(0.0, 0.0, 1.0));
        assert!((light / 20.0 - 1.0).abs() < WITHIN, "{light} at {point}");
    }
    assert!(baked.result.report.warnings.iter().any(|w| w.contains("reflect")), "nobody was told");
}

/// Light that no closed room keeps: a white floor under the open sky sends all of it away.
#[test]
fn what_escapes_is_counted() {
    let floor = Model::new().add(&paint(1.0), &up((0.0, 0.0), (2.0, 1.0), 0.0));
    let wall = quad(v(0.0, 1.0, 0.0), v(2.0, 1.0, 0.0), v(2.0, 1.0, 1.0), v(0.0, 1.0, 1.0));
    let baked = floor.add(&paint(1.0), &wall).light("directional", 10.0, v(0.0, 0.0, 5.0)).bake(&sized(48));
    let energy = &baked.result.report.energy;
    // The sun falls on two square metres; what is not absorbed escapes.
    assert!((energy.emitted.x - 20.0).abs() < 0.02, "{energy:?}");
    assert!(energy.escaped.x > 0.85 * energy.emitted.x, "{energy:?}");
}
