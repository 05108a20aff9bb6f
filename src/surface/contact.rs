//! Contact edges: lines in a surface's plane on which another triangle meets or cuts it.
//!
//! A triangle counts when some of it lies on the side that the surface faces (on either side of a
//! double-sided one) and it reaches the plane. Heights within the tolerance count as touching, since
//! what was modelled as standing on the floor stands a few f32 steps above or below it. A triangle
//! that lies in the plane gives nothing: the closed bottom of a book on a desk does not darken the
//! desk, the book's sides do, and they give its outline.

use glam::{DVec2, DVec3};

use super::Geometry;
use super::outline::Outline;
use crate::geom::{Bounds, Frame, polygon};

/// Finds the scene's triangles by their boxes.
pub trait BoxQuery: Sync {
    /// Appends the index of each scene triangle whose box overlaps `bounds` (touching counts), in any
    /// order. More than those, and one more than once, does no harm.
    fn triangles_in(&self, bounds: Bounds, out: &mut Vec<u32>);
}

/// What contacts are looked for.
pub(super) struct ContactSearch<'a> {
    /// The scene.
    pub(super) geometry: &'a Geometry<'a>,
    /// The scene's triangles by place.
    pub(super) neighbours: &'a dyn BoxQuery,
    /// How far off the plane still touches, metres.
    pub(super) tolerance: f64,
}

impl ContactSearch<'_> {
    /// The contact segments of a surface in plane coordinates, clipped to its extent; not yet cleared of
    /// those that run along the outline. `own` holds the surface's triangles, ascending.
    pub(super) fn contacts(&self, outline: &Outline, own: &[usize], double_sided: Sides) -> Vec<[DVec2; 2]> {
        let corners = || outline.rings.iter().flatten();
        let bounds = Bounds::of(corners().map(|&p| outline.frame.lift(p))).grown(self.tolerance);
        let (low, high) = corners()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
        let mut found = Vec::new();
        self.neighbours.triangles_in(bounds, &mut found);
        found.sort_unstable();
        found.dedup();
        let mut segments = Vec::new();
        for id in found {
            if own.binary_search(&(id as usize)).is_ok() {
                continue;
            }
            let Some(points) = self.geometry.points(id as usize) else { continue };
            let Some([a, b]) = cut(&outline.frame, points, self.tolerance, double_sided) else { continue };
            segments.extend(polygon::clip_segment(a, b, low, high));
        }
        segments
    }
}

/// Which sides of a surface reflect light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sides {
    /// The one that the normal points to.
    Front,
    /// Both.
    Both,
}

/// The segment in which a triangle touches or cuts the plane, `None` where it does not, does so in a
/// point only, lies within the plane, or lies wholly on a side that does not count.
fn cut(frame: &Frame, points: [DVec3; 3], tolerance: f64, sides: Sides) -> Option<[DVec2; 2]> {
    let heights = points.map(|p| {
        let h = frame.height(p);
        if h.abs() <= tolerance { 0.0 } else { h }
    });
    let above = heights.iter().any(|&h| h > 0.0);
    let below = heights.iter().any(|&h| h < 0.0);
    if !(above || below && sides == Sides::Both) {
        return None;
    }
    let mut ends = [DVec2::ZERO; 3];
    let mut count = 0;
    for i in 0..3 {
        let j = (i + 1) % 3;
        let (hi, hj) = (heights[i], heights[j]);
        let end = if hi == 0.0 {
            frame.project(points[i])
        } else if hi * hj < 0.0 {
            frame.project(points[i].lerp(points[j], hi / (hi - hj)))
        } else {
            continue;
        };
        ends[count] = end;
        count += 1;
    }
    (count == 2 && ends[0] != ends[1]).then_some([ends[0], ends[1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOOR: Frame = Frame { origin: DVec3::ZERO, u: DVec3::X, v: DVec3::Y, normal: DVec3::Z };

    fn cut_at(heights: [f64; 3], sides: Sides) -> Option<[DVec2; 2]> {
        let points = [
            DVec3::new(0.0, 0.0, heights[0]),
            DVec3::new(1.0, 0.0, heights[1]),
            DVec3::new(0.0, 1.0, heights[2]),
        ];
        cut(&FLOOR, points, 1e-6, sides)
    }

    #[test]
    fn standing_cutting_and_hovering() {
        use Sides::{Both, Front};
        assert!(cut_at([0.0, 0.0, 1.0], Front).is_some(), "standing on an edge");
        assert!(cut_at([5e-7, -5e-7, 1.0], Front).is_some(), "standing, with noise");
        assert!(cut_at([-1.0, 1.0, 1.0], Front).is_some(), "cutting");
        assert!(cut_at([0.0, -1.0, 1.0], Front).is_some(), "cutting through a corner");
        assert!(cut_at([0.0, 1.0, 1.0], Front).is_none(), "standing on a corner");
        assert!(cut_at([2e-6, 2e-6, 1.0], Front).is_none(), "hovering");
        assert!(cut_at([5e-7, 0.0, -5e-7], Both).is_none(), "lying in the plane");
        assert!(cut_at([0.0, 0.0, -1.0], Front).is_none(), "behind");
        assert!(cut_at([0.0, 0.0, -1.0], Both).is_some(), "behind a double-sided surface");
        assert!(cut_at([f64::NAN, 0.0, 1.0], Front).is_none(), "not finite");
    }

    #[test]
    fn the_cut_lies_where_the_height_is_zero() {
        let [a, b] = cut_at([-1.0, 1.0, 3.0], Sides::Front).unwrap();
        assert_eq!((a, b), (DVec2::new(0.5, 0.0), DVec2::new(0.0, 0.25)));
    }
}
