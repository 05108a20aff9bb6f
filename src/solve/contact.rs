//! Where something stands close over an element.
//!
//! Interpolation can be right in the middle of an element by chance and wrong under a picture or a keyboard that
//! covers a part of it: what the Close Objects Buffer (Telea and van Overveld 1998) says of direct light holds for
//! reflected light, too. So the element is asked about the place that is covered most closely.

use glam::{DVec2, DVec3};

use crate::element::Facet;
use crate::geom::polygon::{clip_half_plane, clip_rectangle, signed_area};
use crate::geom::{Bounds, Ring};
use crate::trace::Tracer;

/// What covers less of an element than this fraction leaves no mark that elements could show.
const LEAST_COVER: f64 = 0.02;

/// Memory for looking.
#[derive(Default)]
pub struct Nearby(Vec<u32>);

impl Nearby {
    /// The middle of what covers `element` most closely, nearer than the element is large; plane coordinates.
    pub fn most_covered(&mut self, tracer: &Tracer, facet: &Facet, element: u32) -> Option<DVec2> {
        let e = &facet.elements[element as usize];
        let (frame, size) = (&facet.frame, e.size());
        let feet = e.corners().map(|p| frame.lift(p));
        let above = feet.map(|p| p + frame.normal * size);
        self.0.clear();
        tracer.triangles_in(Bounds::of(feet.into_iter().chain(above)), &mut self.0);
        let area = (e.max - e.min).element_product();
        let mut most: Option<(f64, DVec2)> = None;
        for &triangle in &self.0 {
            let corners = tracer.triangles()[triangle as usize];
            let corners = corners.map(|p| frame.project(p).extend(frame.height(p)));
            let (cover, lowest) = cover(corners, (e.min.extend(tracer.margin()), e.max.extend(size)));
            let covered = signed_area(&cover).abs();
            if covered < LEAST_COVER * area {
                continue;
            }
            let middle = cover.iter().sum::<DVec2>() / cover.len() as f64;
            let closeness = covered / lowest;
            if most.is_none_or(|(best, _)| closeness > best) && facet.contains(element, middle) {
                most = Some((closeness, middle));
            }
        }
        most.map(|(_, p)| p)
    }
}

/// What a triangle covers of a box's foot with its part inside the box, and how high that is where it is lowest.
///
/// Coordinates are those of the plane and the height over it. An upright triangle covers nothing.
fn cover([a, b, c]: [DVec3; 3], (min, max): (DVec3, DVec3)) -> (Ring, f64) {
    let normal = (b - a).cross(c - a);
    if normal.z == 0.0 {
        return (Ring::new(), f64::INFINITY);
    }
    // The height is `base + slope · p`.
    let slope = -normal.truncate() / normal.z;
    let base = a.z - slope.dot(a.truncate());
    let over = clip_rectangle(&[a, b, c].map(|p| p.truncate()), min.truncate(), max.truncate());
    let over = clip_half_plane(&over, slope, min.z - base);
    let over = clip_half_plane(&over, -slope, base - max.z);
    let lowest = over.iter().map(|&p| base + slope.dot(p)).fold(f64::INFINITY, f64::min);
    (over, lowest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_reaches_out_of_the_box_is_cut() {
        let slope = [DVec3::new(-1.0, 0.0, -1.0), DVec3::new(3.0, 0.0, 3.0), DVec3::new(3.0, 4.0, 3.0)];
        let (over, lowest) = cover(slope, (DVec3::new(0.0, 0.0, 0.5), DVec3::new(2.0, 2.0, 2.0)));
        assert!((lowest - 0.5).abs() < 1e-12, "{over:?}");
        let area = signed_area(&over).abs();
        // Under the line y = x + 1 between x = 0.5 and 2, and no further than y = 2.
        assert!((area - (1.5 * 2.0 - 0.5 * 0.5 * 0.5)).abs() < 1e-12, "{area}");
        assert!(cover(slope, (DVec3::splat(5.0), DVec3::splat(6.0))).0.is_empty());
    }
}
