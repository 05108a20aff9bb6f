//! Where one chart of a surface ends and another begins.

use glam::DVec2;

use super::Corner;
use super::edges::{Edge, Edges, edges_of};
use crate::geom::polygon::{nearest_on_segment, orient};
use crate::surface::Surface;
use crate::unwrap::Chart;

/// Borders bend by this share of the surface's extent to meet vertices: far below a texel.
const SNAP: f64 = 1e-6;

/// At most by this share, however coarse the positions.
const MOST_SNAP: f64 = 1e-4;

/// Steps of a 32-bit position that must lie between two vertices.
const STEPS: f64 = 4.0;

/// The inner borders of a surface's charts.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Borders {
    /// Each between two charts; they meet at their ends, up to rounding.
    pub(super) segments: Vec<[DVec2; 2]>,
    /// What is closer together than this is one, metres.
    pub(super) snap: f64,
}

impl Borders {
    /// The borders between `charts`, all of one surface.
    ///
    /// Only what has a chart on both sides is a border: outlines also run along the surface's own
    /// outline, a hair inside or outside of it, where there is nothing to cut.
    pub(in super::super) fn of(surface: &Surface, charts: &[Chart]) -> Self {
        let snap = snap(surface);
        let mut segments = Vec::new();
        for (index, one) in charts.iter().enumerate() {
            for other in charts.get(index + 1..).unwrap_or_default() {
                if near(&one.outline, &other.outline, snap) {
                    common(&one.outline, &other.outline, snap, &mut segments);
                }
            }
        }
        Self { segments, snap }
    }

    /// Notes where the borders meet a triangle's edges.
    pub(super) fn meet(&self, triangle: &[Corner; 3], edges: &mut Edges) {
        let points = triangle.map(|corner| corner.point);
        for &segment in &self.segments {
            if !near(&points, &segment, self.snap) {
                continue;
            }
            for edge in edges_of(triangle) {
                self.meet_edge(segment, &edge, edges);
            }
        }
    }

    fn meet_edge(&self, [a, b]: [DVec2; 2], edge: &Edge, edges: &mut Edges) {
        let [low, high] = edge.ends;
        if !near(&edge.ends, &[a, b], self.snap) {
            return;
        }
        // Half the reach of the arrangement, so that it finds here what was merged.
        let radius = self.snap / 2.0;
        for end in [a, b] {
            let foot = nearest_on_segment(low, high, end);
            if foot.distance(end) <= self.snap {
                edges.insert(edge, foot.distance(low) / high.distance(low), radius);
            }
        }
        let (from, to) = (orient(a, b, low), orient(a, b, high));
        if from * to < 0.0 && orient(low, high, a) * orient(low, high, b) < 0.0 {
            edges.insert(edge, from / (from - to), radius);
        }
    }
}

/// What is one in a surface: of its size, and of what 32-bit positions can tell apart.
fn snap(surface: &Surface) -> f64 {
    let (low, high) = surface.extent();
    let size = (high - low).length();
    let far = [low, high].map(|p| surface.frame.lift(p).abs().max_element());
    let step = f64::from(f32::EPSILON) * far[0].max(far[1]);
    (SNAP * size).max((STEPS * step).min(MOST_SNAP * size))
}

/// Whether the bounds of two sets of points come within `reach` of each other.
fn near(one: &[DVec2], other: &[DVec2], reach: f64) -> bool {
    let bounds = |points: &[DVec2]| {
        points
            .iter()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
    };
    let ((low, high), (other_low, other_high)) = (bounds(one), bounds(other));
    low.cmple(other_high + reach).all() && other_low.cmple(high + reach).all()
}

/// Adds what two counter-clockwise outlines have in common, one on the left, the other on the right.
fn common(one: &[DVec2], other: &[DVec2], snap: f64, segments: &mut Vec<[DVec2; 2]>) {
    let sides = |ring: &[DVec2]| -> Vec<[DVec2; 2]> {
        ring.iter().zip(ring.iter().cycle().skip(1)).map(|(&a, &b)| [a, b]).collect()
    };
    for [a, b] in sides(one) {
        for [c, d] in sides(other) {
            let along = (b - a).normalize_or_zero();
            let off = |p: DVec2| along.perp_dot(p - a).abs();
            if along.dot(d - c) < 0.0 && off(c).max(off(d)) <= snap {
                let by = |p: &DVec2, q: &DVec2| along.dot(*p - *q).total_cmp(&0.0);
                let (from, to) = (std::cmp::max_by(a, d, by), std::cmp::min_by(b, c, by));
                if along.dot(to - from) > snap {
                    segments.push([from, to]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::polygon::rectangle;

    /// Three rectangles that meet in a T have three borders, and none around them.
    #[test]
    fn borders_lie_between_charts_only() {
        let box_of = |x0: f64, y0: f64, x1: f64, y1: f64| rectangle(DVec2::new(x0, y0), DVec2::new(x1, y1));
        let charts = [box_of(0.0, 0.0, 1.0, 2.0), box_of(1.0, 0.0, 3.0, 0.5), box_of(1.0, 0.5, 3.0, 2.0)];
        let mut segments = Vec::new();
        for (i, one) in charts.iter().enumerate() {
            for other in &charts[i + 1..] {
                common(one, other, 1e-6, &mut segments);
            }
        }
        let expected = [[(1.0, 0.0), (1.0, 0.5)], [(1.0, 0.5), (1.0, 2.0)], [(3.0, 0.5), (1.0, 0.5)]];
        assert_eq!(segments, expected.map(|s| s.map(DVec2::from)));
    }
}
