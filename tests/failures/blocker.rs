//! A square blocker between a square emitter and a floor, at any height: its shadow in closed form.

use cobake::options::{BakeOptions, CobHeight, Direct, Refine};

use crate::model::{Baked, Model, both_sides, down, glow, paint, sized, up, v};
use crate::rectangles::{Rectangle, Shaded};

const EMITTED: f64 = 100.0;
const HEIGHTS: [f64; 7] = [0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9];

/// The emitter is 1 m above the floor; the blocker is off its axis, and off the texels' grid.
fn shaded(height: f64) -> Shaded {
    Shaded {
        emitter: Rectangle::new((-0.25, -0.25), (0.25, 0.25)),
        emitter_height: 1.0,
        blocker: Rectangle::new((-0.217, -0.151), (0.183, 0.249)),
        blocker_height: height,
    }
}

fn bake(shaded: &Shaded, options: &BakeOptions) -> Baked {
    let (e, b) = (shaded.emitter, shaded.blocker);
    Model::new()
        .add(&paint(0.0), &up((-1.5, -1.5), (1.5, 1.5), 0.0))
        .add(&glow(EMITTED), &down(e.low, e.high, shaded.emitter_height))
        .add(&both_sides(paint(0.0)), &up(b.low, b.high, shaded.blocker_height))
        .bake(options)
}

/// How far a lightmap is from the closed form, as fractions of the brightest light.
struct Miss {
    /// Root mean square over the floor.
    all: f64,
    /// The most beyond the least and the most light within a texel and a half.
    beyond: f64,
}

fn miss(baked: &Baked, shaded: &Shaded) -> Miss {
    let floor = baked.surface_at(v(-1.4, -1.4, 0.0), v(0.0, 0.0, 1.0)).expect("a floor");
    let brightest = shaded_peak(shaded);
    let texel = baked.texel();
    let (mut sum, mut beyond, mut count) = (0.0, 0.0_f64, 0.0);
    let steps = 80;
    for k in 0..steps * steps {
        let at = |i: i32| -1.4 + 2.8 * (f64::from(i) + 0.5) / f64::from(steps);
        let (x, y) = (at(k % steps), at(k / steps));
        let exact = |dx: f64, dy: f64| EMITTED * shaded.form_factor(x + dx * texel, y + dy * texel);
        let error = (baked.on(floor, v(x, y, 0.0)) - exact(0.0, 0.0)).abs() / brightest;
        let near = (0..49).map(|k| exact(f64::from(k % 7) / 2.0 - 1.5, f64::from(k / 7) / 2.0 - 1.5));
        let (least, most) = near.fold((f64::INFINITY, 0.0_f64), |(l, m), e| (l.min(e), m.max(e)));
        let found = baked.on(floor, v(x, y, 0.0));
        beyond = beyond.max((least - found).max(found - most) / brightest);
        (sum, count) = (sum + error * error, count + 1.0);
    }
    Miss { all: f64::sqrt(sum / count), beyond }
}

/// The floor's brightest place, were nothing in the way.
fn shaded_peak(shaded: &Shaded) -> f64 {
    EMITTED * crate::rectangles::parallel(shaded.emitter, shaded.emitter_height)
}

/// Texels evaluate direct light anew, so neither the height nor the mesh matters: what is missed is what texels
/// 6 cm wide cannot show of an edge that is the sharper the lower the blocker lies.
#[test]
fn texels_hold_the_closed_form_at_any_height() {
    const WITHIN: [f64; 7] = [0.055, 0.04, 0.01, 0.0025, 0.0012, 0.0006, 0.0004];
    // Texels that fit an edge best overshoot beside it.
    const BEYOND: f64 = 0.1;
    for (height, within) in HEIGHTS.into_iter().zip(WITHIN) {
        let shaded = shaded(height);
        for refine in [Refine::Cob, Refine::None] {
            let mut options = sized(96);
            options.refine = refine;
            let Miss { all, beyond } = miss(&bake(&shaded, &options), &shaded);
            assert!(all < within, "{height} m, {refine:?}: {all} of the light is missed");
            assert!(beyond < BEYOND, "{height} m, {refine:?}: {beyond} too much or too little");
        }
    }
}

/// With light from the mesh alone, the buffer finds what stands within its prism, and splits for nothing else.
#[test]
fn the_buffer_finds_the_shadow_within_its_height() {
    // Of what a mesh without splits misses, this much may be left.
    const LEFT: f64 = 0.9;
    // The floor's first elements are a thirty-second of its side.
    let element = 3.0 / 32.0 * std::f64::consts::SQRT_2;
    for height in [0.001, 0.01, 0.1, 0.3, 0.7] {
        let shaded = shaded(height);
        let with = |refine, h| {
            let mut options = sized(192);
            (options.refine, options.direct) = (refine, Direct::Mesh);
            options.cob_height = CobHeight::OfElement(h);
            options.subdivision_threshold = Some(0.02);
            let baked = bake(&shaded, &options);
            (miss(&baked, &shaded).all, baked.result.report.cob.splits)
        };
        let (blind, _) = with(Refine::None, 1.0);
        for h in [0.1, 1.0, 10.0] {
            let (found, splits) = with(Refine::Cob, h);
            if height < h * element {
                assert!(splits > 0, "nothing found at {height} with {h}");
                assert!(found < LEFT * blind, "{found} of {blind} left at {height} with {h}");
            } else {
                assert!(splits == 0, "{splits} useless splits at {height} with {h}");
            }
        }
    }
}
