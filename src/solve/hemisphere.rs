//! What places see of the hemisphere above them.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::DVec3;

use super::sequence;
use crate::trace::{FAN, Fan};

/// The rays of the lowest level.
const LEAST_RAYS: usize = 64;

/// Each level has twice the rays of the one below.
const LEVELS: usize = 7;

/// How many directions a place looks along: a power of two, where Sobol's points are best distributed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Level(usize);

impl Level {
    /// The fewest rays.
    pub const LEAST: Self = Self(0);

    /// The level whose number of rays is nearest to `rays`.
    #[must_use]
    pub fn of(rays: f64) -> Self {
        let level = (rays / LEAST_RAYS as f64).log2().round();
        Self((level.max(0.0) as usize).min(LEVELS - 1))
    }

    /// Its number of rays.
    #[must_use]
    pub fn rays(self) -> usize {
        LEAST_RAYS << self.0
    }
}

/// Cosine-distributed directions about `z`, the same for all places, so that what is left of the error is smooth.
pub struct Directions {
    /// By level: neighbours in one fan.
    fans: Vec<Vec<Fan>>,
}

impl Directions {
    /// Prepares all levels.
    #[must_use]
    pub fn prepare() -> Self {
        let fans = (0..LEVELS).map(|level| {
            let points = (0..Level(level).rays() as u32).map(|index| sequence::point(index, 0));
            let mut square: Vec<[f64; 2]> = points.map(|[u, v, ..]| [u, v]).collect();
            square.sort_by_cached_key(|&[u, v]| interleaved(u, v));
            let directions: Vec<DVec3> = square.into_iter().map(|[u, v]| cosine_direction(u, v)).collect();
            directions.chunks_exact(FAN).map(Fan::new).collect()
        });
        Self { fans: fans.collect() }
    }

    /// Those of a level.
    #[must_use]
    pub fn fans(&self, level: Level) -> &[Fan] {
        &self.fans[level.0]
    }
}

/// The bits of both coordinates in turns, most significant first (Morton's order).
fn interleaved(u: f64, v: f64) -> u32 {
    let spread =
        |x: f64| (0..16).fold(0, |sum, bit| sum | ((((x * 65536.0) as u32 >> bit) & 1) << (2 * bit)));
    spread(u) | (spread(v) << 1)
}

/// Maps the unit square onto the hemisphere about `z`, cosine-distributed, neighbours to neighbours: the
/// concentric map of Shirley and Chiu 1997, lifted.
fn cosine_direction(u: f64, v: f64) -> DVec3 {
    let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let (radius, angle) = match () {
        () if x.abs() > y.abs() => (x, FRAC_PI_4 * (y / x)),
        () if y != 0.0 => (y, FRAC_PI_2 - FRAC_PI_4 * (x / y)),
        () => (0.0, 0.0),
    };
    let (sin, cos) = angle.sin_cos();
    DVec3::new(radius * cos, radius * sin, (1.0 - radius * radius).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_cosine_distributed() {
        let directions = Directions::prepare();
        for level in (0..LEVELS).map(Level) {
            let fans = directions.fans(level);
            assert_eq!(fans.len() * FAN, level.rays());
            let all: Vec<DVec3> = fans.iter().flat_map(|f| (0..FAN).map(|ray| f.direction(ray))).collect();
            let mean: DVec3 = all.iter().sum::<DVec3>() / all.len() as f64;
            let near = 2.0 / all.len() as f64 + 1e-3;
            assert!((mean - DVec3::new(0.0, 0.0, 2.0 / 3.0)).length() < near, "{level:?}: {mean}");
            assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-6));
        }
    }

    #[test]
    fn fans_are_narrow() {
        let directions = Directions::prepare();
        let fans = directions.fans(Level::of(1024.0));
        let widest = |fan: &Fan| {
            let first = fan.direction(0);
            (0..FAN).map(|ray| first.angle_between(fan.direction(ray))).fold(0.0, f64::max)
        };
        let mean = fans.iter().map(widest).sum::<f64>() / fans.len() as f64;
        assert!(mean < 0.45, "{mean} radians");
    }
}
