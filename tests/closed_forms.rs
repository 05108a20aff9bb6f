//! The solver against rooms whose light is known in closed form.
mod support;

use cobake::options::BakeOptions;
use cobake::scene::{PunctualKind, PunctualLight};
use glam::DVec3;
use support::{Case, Uniform, leaves, room, sphere};

/// The mean is balanced; the corners of a bright room get too little still, up to 6.4 % at a reflectance of
/// 0.95, where interpolation in elements sums over twenty bounces. The aim is 0.02.
const FURNACE_LOCAL: f64 = 0.07;
const FURNACE_MEAN: f64 = 0.002;

/// 3. White furnace: every point of a closed room that glows evenly has the same radiosity.
#[test]
fn white_furnace() {
    for reflectance in [0.0, 0.5, 0.8, 0.95] {
        let appearance = Uniform { reflectance, exitance: 1.0 };
        let walls = room(DVec3::ZERO, DVec3::new(1.0, 1.5, 0.7));
        let case = Case {
            surfaces: &walls,
            appearance: &appearance,
            lights: &[],
            patch_size: 0.25,
            threshold: 0.06,
        };
        let solution = case.solve(&BakeOptions::default());
        let expected = 1.0 / (1.0 - reflectance);
        let (mut sum, mut area) = (0.0, 0.0);
        for (a, direct, indirect) in leaves(&solution.facets) {
            let radiosity = 1.0 + reflectance * (direct + indirect).x;
            assert!(
                (radiosity / expected - 1.0).abs() < FURNACE_LOCAL,
                "reflectance {reflectance}: {radiosity} instead of {expected}"
            );
            sum += a * radiosity;
            area += a;
        }
        let mean = sum / area;
        assert!(
            (mean / expected - 1.0).abs() < FURNACE_MEAN,
            "reflectance {reflectance}: mean {mean}, not {expected}"
        );
    }
}

/// 4. Any closed scene of one reflectance: the mean of E is flux / (area (1 − ρ)), whatever its shape.
#[test]
fn mean_irradiance_follows_from_the_flux() {
    let reflectance = 0.6;
    let mut walls = room(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0));
    // An L: a second, smaller room opens into the first through its whole end; plus a lamp.
    let lights = [PunctualLight {
        kind: PunctualKind::Point { position: DVec3::new(0.4, 0.3, 0.6), range: f64::INFINITY },
        intensity: DVec3::splat(3.0),
        node: 0,
    }];
    let appearance = Uniform { reflectance, exitance: 0.0 };
    walls.truncate(6);
    let case =
        Case { surfaces: &walls, appearance: &appearance, lights: &lights, patch_size: 0.2, threshold: 0.03 };
    let solution = case.solve(&BakeOptions::default());
    let area: f64 = walls.iter().map(|s| s.area).sum();
    let mean = leaves(&solution.facets).iter().map(|(a, d, i)| a * (*d + *i).x).sum::<f64>() / area;
    let expected = 3.0 * 4.0 * std::f64::consts::PI / area / (1.0 - reflectance);
    assert!((mean / expected - 1.0).abs() < 0.01, "{mean} instead of {expected}");
}

/// 5. A sphere with a point source at its centre: uniform, indirect = direct ρ / (1 − ρ).
#[test]
fn sphere_with_a_point_source() {
    let reflectance = 0.5;
    let walls = sphere(3);
    let lights = [PunctualLight {
        kind: PunctualKind::Point { position: DVec3::ZERO, range: f64::INFINITY },
        intensity: DVec3::splat(2.0),
        node: 0,
    }];
    let appearance = Uniform { reflectance, exitance: 0.0 };
    let case =
        Case { surfaces: &walls, appearance: &appearance, lights: &lights, patch_size: 1.0, threshold: 0.2 };
    let solution = case.solve(&BakeOptions::default());
    let (mut direct_sum, mut indirect_sum, mut area) = (0.0, 0.0, 0.0);
    for (a, direct, indirect) in leaves(&solution.facets) {
        // Facets lie up to 1.3 % inside of the sphere.
        assert!((direct.x / 2.0 - 1.0).abs() < 0.05, "direct {direct}");
        assert!((indirect.x / 2.0 - 1.0).abs() < 0.05, "indirect {indirect}");
        direct_sum += a * direct.x;
        indirect_sum += a * indirect.x;
        area += a;
    }
    let expected = 2.0 * 4.0 * std::f64::consts::PI / area;
    assert!((direct_sum / area / expected - 1.0).abs() < 0.01);
    assert!((indirect_sum / direct_sum - reflectance / (1.0 - reflectance)).abs() < 0.01);
}
