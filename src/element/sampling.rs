//! Where an element receives, and how values there become values in its corners.

use glam::{DMat3, DVec2, DVec3};

use super::facet::{Facet, Sample};
use crate::geom::Ring;
use crate::geom::polygon::{contains, nearest_on_segment};

/// Keeps the fitted plane level where the samples lie too close together to tell its slope;
/// in squares of the element's side.
const LEVELLING: f64 = 0.01;

impl Facet {
    /// The sample at a lattice corner of a full element, shared with its neighbours.
    ///
    /// It is moved towards `inside` so that it stays off the outline, and off walls that stand there.
    pub(super) fn corner_sample(&mut self, key: [u32; 2], corner: DVec2, inside: DVec2) -> u32 {
        if let Some(&sample) = self.lattice.get(&key) {
            return sample;
        }
        // As far along both axes, so that it comes off walls at slender elements' feet, too.
        let d = inside - corner;
        let step = d.signum() * (0.5 * d.abs()).min(DVec2::splat(self.nudge));
        let sample = self.add_sample(corner + step);
        self.lattice.insert(key, sample);
        sample
    }

    /// A sample inside convex `parts` as near to `corner` as can be.
    pub(super) fn nearest_sample(&mut self, parts: &[Ring], corner: DVec2, centroid: DVec2) -> u32 {
        let foot = nearest_in_parts(parts, corner);
        // The centroid of a concave piece may lie outside, and then a longer step may leave it.
        let step = self.nudge;
        let inside = [step, 4.0 * step, 0.25 * step]
            .into_iter()
            .map(|s| toward(foot, centroid, s))
            .find(|&p| parts.iter().any(|part| contains(std::slice::from_ref(part), p)))
            .unwrap_or_else(|| toward(foot, middle_of_nearest(parts, foot), step));
        self.add_sample(inside)
    }

    fn add_sample(&mut self, position: DVec2) -> u32 {
        let point = self.receiving(position);
        self.samples.push(Sample { position, point });
        (self.samples.len() - 1) as u32
    }
}

/// `from`, moved by `step` metres towards `to`, at most half-way.
fn toward(from: DVec2, to: DVec2, step: f64) -> DVec2 {
    let d = to - from;
    let length = d.length();
    if length == 0.0 { from } else { from + d * (step / length).min(0.5) }
}

/// The point of convex `parts` nearest to `p`.
fn nearest_in_parts(parts: &[Ring], p: DVec2) -> DVec2 {
    if parts.iter().any(|part| contains(std::slice::from_ref(part), p)) {
        return p;
    }
    let edges = parts.iter().flat_map(|r| (0..r.len()).map(|i| (r[i], r[(i + 1) % r.len()])));
    let feet = edges.map(|(a, b)| nearest_on_segment(a, b, p));
    feet.min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p))).unwrap_or(p)
}

/// The middle of the part that comes nearest to `p`.
fn middle_of_nearest(parts: &[Ring], p: DVec2) -> DVec2 {
    let distance = |part: &Ring| nearest_in_parts(std::slice::from_ref(part), p).distance_squared(p);
    let nearest = parts.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.map_or(p, |part| part.iter().sum::<DVec2>() / part.len() as f64)
}

/// The matrix that takes values at `samples` to the corners of the rectangle from `min` to `max`,
/// by the least-squares plane through them.
pub(super) fn plane_fit(samples: [DVec2; 4], min: DVec2, max: DVec2) -> [[f64; 4]; 4] {
    let scale = (max - min).max_element();
    let local = samples.map(|p| (p - min) / scale);
    let mean = local.iter().sum::<DVec2>() / 4.0;
    let rows = local.map(|p| DVec3::new(1.0, p.x - mean.x, p.y - mean.y));
    let mut normal = DMat3::from_diagonal(DVec3::new(0.0, LEVELLING, LEVELLING));
    for r in rows {
        normal += DMat3::from_cols(r * r.x, r * r.y, r * r.z);
    }
    let inverse = normal.inverse();
    let size = (max - min) / scale;
    let corners = [DVec2::ZERO, DVec2::new(size.x, 0.0), size, DVec2::new(0.0, size.y)];
    corners.map(|c| {
        let weights = inverse * DVec3::new(1.0, c.x - mean.x, c.y - mean.y);
        rows.map(|r| weights.dot(r))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear function comes back but for what the levelling takes from its slope.
    #[test]
    fn a_plane_is_fitted_through_the_samples() {
        let (min, max) = (DVec2::ZERO, DVec2::splat(2.0));
        let samples =
            [DVec2::new(0.0, 0.0), DVec2::new(2.0, 0.0), DVec2::new(1.0, 1.0), DVec2::new(0.0, 2.0)];
        let f = |p: DVec2| 3.0 + 0.5 * p.x - 0.25 * p.y;
        let fit = plane_fit(samples, min, max);
        for (row, corner) in fit.iter().zip([min, DVec2::new(2.0, 0.0), max, DVec2::new(0.0, 2.0)]) {
            let value: f64 = row.iter().zip(&samples).map(|(w, &p)| w * f(p)).sum();
            assert!((value - f(corner)).abs() < 0.02, "{corner}: {value}");
        }
    }

    /// Four samples in one place carry their mean everywhere and do not blow up.
    #[test]
    fn coinciding_samples_give_their_mean() {
        let fit = plane_fit([DVec2::splat(0.3); 4], DVec2::ZERO, DVec2::ONE);
        assert!(fit.iter().flatten().all(|w| (w - 0.25).abs() < 1e-9));
    }
}
