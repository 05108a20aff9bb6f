//! Texels where the light needs them: less error from as many texels, no gaps, no overlaps, no seams.

use cobake::bake_scene;
use cobake::error::Error;
use cobake::progress::{Progress, Stage};
use cobake::unwrap::UnwrapError;
use glam::{DVec2, DVec3};

use crate::model::{Baked, Model, by_light, cuboid, down, glow, paint, sized, up, v};
use crate::rectangles::{Boxes, Rectangle};

const EMITTED: f64 = 100.0;

/// A small box on a wide floor, lit from above: nearly all of the floor is smooth.
fn small_box() -> (impl Fn() -> Model, Rectangle, (DVec3, DVec3)) {
    let lamp = Rectangle::new((-0.2, -0.15), (0.2, 0.15));
    let (low, high) = (v(0.513, 0.217, 0.0), v(0.663, 0.317, 0.12));
    let model = move || {
        Model::new()
            .add(&paint(0.0), &up((-1.5, -1.5), (1.5, 1.5), 0.0))
            .add(&paint(0.0), &cuboid(low, high))
            .add(&glow(EMITTED), &down(lamp.low, lamp.high, 2.0))
    };
    (model, lamp, (low, high))
}

/// Root mean square error of lookups on the floor around the box.
fn error(baked: &Baked, lamp: Rectangle, (low, high): (DVec3, DVec3)) -> f64 {
    let boxes = Boxes { emitter: lamp, height: 2.0, boxes: &[(low, high)] };
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for k in 0..4000 {
        // A lattice that no texel's grid agrees with (R. Kronecker's, golden ratio).
        let at = (f64::from(k) * DVec2::new(0.754_877_666, 0.569_840_291)).fract();
        let p = v(0.3 + 0.7 * at.x, 0.1 + 0.5 * at.y, 0.0);
        if p.x > low.x && p.x < high.x && p.y > low.y && p.y < high.y {
            continue;
        }
        let exact = EMITTED * boxes.form_factor(p + 1e-7 * DVec3::Z, DVec3::Z);
        sum += (baked.at(p, DVec3::Z) - exact).powi(2);
        count += 1.0;
    }
    (sum / count).sqrt()
}

/// Measured: 4.3 times less error on the same page.
#[test]
fn as_many_texels_leave_less_than_half_the_error() {
    let (model, lamp, solid) = small_box();
    let uniform = error(&model().bake(&sized(96)), lamp, solid);
    let by_light = error(&model().bake(&by_light(96)), lamp, solid);
    assert!(by_light < 0.5 * uniform, "{by_light} by light, {uniform} uniform");
}

/// A quarter of the texels is as good as all of them in a uniform atlas.
#[test]
fn a_quarter_of_the_texels_is_enough() {
    let (model, lamp, solid) = small_box();
    let uniform = error(&model().bake(&sized(128)), lamp, solid);
    let by_light = error(&model().bake(&by_light(64)), lamp, solid);
    assert!(by_light < uniform, "{by_light} with 64² texels, {uniform} with 128²");
}

#[test]
fn error_falls_steadily_with_the_page() {
    let (model, lamp, solid) = small_box();
    let errors = [40, 64, 112].map(|side| error(&model().bake(&by_light(side)), lamp, solid));
    assert!(errors.windows(2).all(|e| e[1] < 0.8 * e[0]), "{errors:?}");
}

/// Every point of every surface lies in one chart, its lookup inside the page.
#[test]
fn charts_cover_the_surfaces_once() {
    let (model, ..) = small_box();
    let baked = model().bake(&by_light(96));
    let atlas = &baked.result.atlas;
    assert!(atlas.charts.len() > baked.result.surfaces.len(), "nothing was cut");
    for (index, surface) in baked.result.surfaces.iter().enumerate() {
        for &[a, b, c] in surface.regions.iter().flat_map(|r| &r.triangles) {
            for k in 0..100 {
                let at = (f64::from(k) * DVec2::new(0.754_877_666, 0.569_840_291)).fract();
                let at = if at.x + at.y > 1.0 { 1.0 - at } else { at };
                let p = a + at.x * (b - a) + at.y * (c - a);
                let holds = |ring: &[DVec2]| {
                    let next = ring.iter().cycle().skip(1);
                    ring.iter().zip(next).all(|(&q, &r)| (r - q).perp_dot(p - q) >= -1e-9)
                };
                let holding = atlas.charts_of(index).iter().filter(|c| holds(&c.outline)).count();
                assert_eq!(holding, 1, "{p} of surface {index}");
                let texel = atlas.chart_at(index, p).expect("a chart").texel(p);
                let page = DVec2::new(f64::from(atlas.width), f64::from(atlas.height)) - 0.5;
                assert!(
                    texel.cmpge(DVec2::splat(0.5 - 1e-6)).all() && texel.cmple(page + 1e-6).all(),
                    "{texel}"
                );
            }
        }
    }
}

/// From one side of a cut to the other lookups jump by no more than a small part of the light.
#[test]
fn cuts_do_not_show() {
    let (model, lamp, (low, high)) = small_box();
    let typical =
        EMITTED * Boxes { emitter: lamp, height: 2.0, boxes: &[] }.form_factor(DVec3::ZERO, DVec3::Z);
    let baked = model().bake(&by_light(96));
    let is_seen = |p: DVec3| p.x < low.x || p.x > high.x || p.y < low.y || p.y > high.y;
    let floor = baked.surface_at(v(-1.0, -1.0, 0.0), DVec3::Z).expect("a floor");
    let frame = &baked.result.surfaces[floor].frame;
    let mut jumps = Vec::new();
    for chart in baked.result.atlas.charts_of(floor) {
        for (a, b) in chart.outline.iter().zip(chart.outline.iter().cycle().skip(1)) {
            let across = 1e-7 * (*b - *a).perp().normalize();
            for k in 1..16 {
                let p = a.lerp(*b, f64::from(k) / 16.0);
                let sides = [p + across, p - across].map(|q| frame.lift(q));
                if sides.iter().all(|&q| is_seen(q) && baked.surface_at(q, DVec3::Z) == Some(floor)) {
                    let [one, other] = sides.map(|q| baked.on(floor, q));
                    jumps.push((one - other).abs() / typical);
                }
            }
        }
    }
    jumps.sort_by(f64::total_cmp);
    let at = |share: f64| jumps[(share * (jumps.len() - 1) as f64) as usize];
    assert!(jumps.len() > 100 && at(0.5) < 0.001 && at(0.95) < 0.02, "{} {}", at(0.5), at(0.95));
}

/// The stages that a bake came to.
#[derive(Default)]
struct Stages(Vec<Stage>);

impl Progress for Stages {
    fn begin(&mut self, stage: Stage) {
        self.0.push(stage);
    }
    fn advance(&mut self, _: f64) {}
    fn warn(&mut self, _: &str) {}
}

/// 20 boxes have 120 faces; of the smallest charts 64 fit into 16 × 16 texels.
#[test]
fn a_page_that_can_hold_no_texel_a_chart_is_refused_before_light_is_solved() {
    let boxes = (0..20).map(|k| v(f64::from(k), 0.0, 0.0));
    let triangles: Vec<_> = boxes.flat_map(|p| cuboid(p, p + v(0.5, 0.5, 0.5))).collect();
    let scene = Model::new().add(&glow(EMITTED), &triangles).scene();
    let mut stages = Stages::default();
    let refused = bake_scene(&scene, &sized(16), &mut stages).expect_err("too small");
    assert!(
        matches!(refused, Error::Unwrap(UnwrapError::TooSmall { charts: 120, side: 16, .. })),
        "{refused}"
    );
    assert_eq!(stages.0.last(), Some(&Stage::Surfaces));
}
