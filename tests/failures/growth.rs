//! The same piece of furniture again and again: work grows as the scene does, not as its square.

use cobake::options::Resolution;

use crate::model::{Baked, Model, cuboid, down, glow, paint, sized, up, v};

/// A table of six boxes, 72 triangles, at a place of a grid.
fn table(at: glam::DVec3) -> Vec<[glam::DVec3; 3]> {
    let mut triangles = cuboid(at + v(0.2, 0.2, 0.5), at + v(0.8, 0.8, 0.55));
    for (x, y) in [(0.22, 0.22), (0.72, 0.22), (0.72, 0.72), (0.22, 0.72)] {
        triangles.extend(cuboid(at + v(x, y, 0.0), at + v(x + 0.06, y + 0.06, 0.5)));
    }
    triangles.extend(cuboid(at + v(0.4, 0.4, 0.55), at + v(0.6, 0.6, 0.63)));
    triangles
}

/// `side` times `side` tables, each under its own square metre of lamp.
fn hall(side: u32) -> Baked {
    let wide = f64::from(side);
    let mut model = Model::new()
        .add(&paint(0.4), &up((0.0, 0.0), (wide, wide), 0.0))
        .add(&glow(100.0), &down((0.0, 0.0), (wide, wide), 2.0));
    let cells = (0..side * side).map(|k| v(f64::from(k % side), f64::from(k / side), 0.0));
    model = model.add(&paint(0.5), &cells.flat_map(table).collect::<Vec<_>>());
    let mut options = sized(16);
    options.resolution = Resolution::TexelsPerMetre(12.0);
    options.gather_error = Some(0.05);
    model.bake(&options)
}

#[test]
fn work_grows_with_the_scene() {
    // Elements, rays, texels and the buffers' bytes against triangles: the slopes on logarithmic axes.
    const SLOPES: [f64; 4] = [1.1, 1.35, 1.05, 1.15];
    let [small, large] = [3, 9].map(|side| {
        let report = hall(side).result.report;
        let work = [report.elements.at_end, report.rays, report.texels.evaluated, report.cob.bytes_total];
        (report.scene.triangles as f64, work.map(|count| count as f64))
    });
    let slopes: Vec<f64> =
        (0..4).map(|i| (large.1[i] / small.1[i]).ln() / (large.0 / small.0).ln()).collect();
    for (slope, most) in slopes.iter().zip(SLOPES) {
        assert!(*slope < most, "elements, rays, texels, bytes grow with exponents {slopes:?}");
    }
}
