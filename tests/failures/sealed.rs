//! A sealed box in bright light: inside it is dark, however thin the walls.

use crate::model::{Baked, Model, cuboid, flipped, paint, sized, up, v};

const LUX: f64 = 100_000.0;

/// A box of 1 m with walls `thickness` thick outside of it, askew to the sun, on bright ground.
fn sealed(thickness: f64, side: u32) -> Baked {
    let out = v(1.0, 1.0, 1.0) * thickness;
    let mut model = Model::new().light("directional", LUX, v(0.0, 0.0, 3.0));
    model = model.light("point", LUX, v(2.0, 1.5, 2.2));
    model
        .add(&paint(0.8), &flipped(&cuboid(v(0.0, 0.0, 0.0), v(1.0, 1.0, 1.0))))
        .add(&paint(0.8), &cuboid(-out, v(1.0, 1.0, 1.0) + out))
        .add(&paint(0.8), &up((-1.0, -1.0), (2.0, 2.0), -thickness))
        .bake(&sized(side))
}

/// The brightest light within, everywhere a viewer can look, the corners included.
fn brightest_inside(baked: &Baked) -> f64 {
    let mut brightest = 0.0_f64;
    for axis in 0..3 {
        for far in [0.0, 1.0] {
            let place = |a: f64, b: f64| {
                let mut p = v(far, far, far);
                (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (a, b);
                p
            };
            let mut inward = v(0.0, 0.0, 0.0);
            inward[axis] = 1.0 - 2.0 * far;
            let surface = baked.surface_at(place(0.5, 0.5), inward).expect("a wall");
            for k in 0..101 * 101 {
                let (a, b) = (f64::from(k % 101) / 100.0, f64::from(k / 101) / 100.0);
                brightest = brightest.max(baked.on(surface, place(a, b)));
            }
        }
    }
    brightest
}

#[test]
fn nothing_gets_in() {
    for texels in [0.0, 0.1, 0.5, 1.0, 2.0] {
        let texel = sealed(0.05, 96).texel();
        let baked = sealed(texels * texel, 96);
        let outside = baked.at(v(0.5, 0.5, 1.0 + texels * texel), v(0.0, 0.0, 1.0));
        assert!(outside > LUX, "{outside} outside");
        let inside = brightest_inside(&baked);
        assert!(inside == 0.0, "{inside} inside of walls of {texels} texels");
    }
}

/// A wall of one sheet seen from both sides: its texels hold the front, which looks inward.
#[test]
fn nothing_gets_through_a_sheet() {
    let sheet = crate::model::both_sides(paint(0.8));
    let baked = Model::new()
        .light("directional", LUX, v(0.0, 0.0, 3.0))
        .add(&sheet, &flipped(&cuboid(v(0.0, 0.0, 0.0), v(1.0, 1.0, 1.0))))
        .bake(&sized(96));
    let inside = brightest_inside(&baked);
    assert!(inside == 0.0, "{inside} inside of sheets");
}
