//! The same scene small, large, far away and askew: the same lightmap.

use glam::{DAffine3, DQuat, DVec3};

use crate::model::{Baked, Model, cuboid, down, flipped, glow, paint, sized, v};

/// Where patches and texels fall the same way, only rounding differs, and what rays it sends past an edge; where
/// a scene is askew, charts lie otherwise and texels at shadows' edges with them.
const SAME: (f64, f64) = (2e-3, 0.02);
const ASKEW: (f64, f64) = (0.01, 0.04);

/// A room with a lamp and a box on its floor, 2 m wide.
fn room(root: DAffine3) -> Baked {
    Model::new()
        .add(&paint(0.6), &flipped(&cuboid(v(-1.0, -1.0, 0.0), v(1.0, 1.0, 1.5))))
        .add(&paint(0.4), &cuboid(v(0.113, -0.317, 0.0), v(0.613, 0.283, 0.5)))
        .add(&glow(100.0), &down((-0.4, -0.3), (0.2, 0.3), 1.45))
        .placed(root)
        .bake(&sized(96))
}

/// Points on the floor, the box's top and a wall, with what they face.
fn points() -> Vec<(DVec3, DVec3)> {
    let mut points = Vec::new();
    for k in 0..400 {
        let (a, b) = (f64::from(k % 20) / 20.0 + 0.025, f64::from(k / 20) / 20.0 + 0.025);
        let (x, y) = (2.0 * a - 1.0, 2.0 * b - 1.0);
        let is_free = !(0.07..0.65).contains(&x) || !(-0.36..0.32).contains(&y);
        if is_free {
            points.push((v(x, y, 0.0), DVec3::Z));
        }
        points.push((v(0.113 + 0.5 * a, -0.317 + 0.6 * b, 0.5), DVec3::Z));
        points.push((v(x, 1.0, 1.5 * b), -DVec3::Y));
    }
    points
}

/// Root mean square and largest difference, as fractions of the mean light.
fn difference(a: &Baked, b: &Baked) -> (f64, f64) {
    let points = points();
    let (mut mean, mut square, mut most) = (0.0, 0.0, 0.0_f64);
    for &(point, facing) in &points {
        let (one, other) = (a.at(point, facing), b.at(point, facing));
        mean += one;
        square += (one - other).powi(2);
        most = most.max((one - other).abs());
    }
    let count = points.len() as f64;
    mean /= count;
    ((square / count).sqrt() / mean, most / mean)
}

#[test]
fn size_does_not_matter() {
    let usual = room(DAffine3::IDENTITY);
    for scale in [1e-4, 1e-2, 1e2, 1e5] {
        let (rms, most) = difference(&usual, &room(DAffine3::from_scale(DVec3::splat(scale))));
        assert!(rms < SAME.0 && most < SAME.1, "{scale} times as large: {rms}, at most {most}");
    }
}

#[test]
fn distance_from_the_origin_does_not_matter() {
    let usual = room(DAffine3::IDENTITY);
    for away in [1e3, 1e6] {
        let root = DAffine3::from_translation(v(away, -0.7 * away, 0.3 * away));
        let (rms, most) = difference(&usual, &room(root));
        assert!(rms < SAME.0 && most < SAME.1, "{away} m away: {rms}, at most {most}");
    }
}

#[test]
fn turning_does_not_matter() {
    let usual = room(DAffine3::IDENTITY);
    for (axis, angle) in [(v(0.0, 0.0, 1.0), 0.3), (v(0.3, -0.5, 0.8), 1.234), (v(1.0, 2.0, -0.4), 2.9)] {
        let root = DAffine3::from_quat(DQuat::from_axis_angle(axis.normalize(), angle));
        let (rms, most) = difference(&usual, &room(root));
        assert!(rms < ASKEW.0 && most < ASKEW.1, "turned by {angle}: {rms}, at most {most}");
    }
}
