//! Where something stands close over an element.
//!
//! Interpolation can be right in the middle of an element by chance and wrong under a picture or a keyboard that
//! covers a part of it: what the Close Objects Buffer (Telea and van Overveld 1998) says of direct light holds for
//! reflected light, too. So the element is asked about the place that is covered most closely.

use glam::{DVec2, DVec3};

use crate::element::Facet;
use crate::geom::Bounds;
use crate::geom::polygon::signed_area;
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
        let space = (e.min.extend(tracer.margin()), e.max.extend(size));
        let mut most: Option<(f64, DVec2)> = None;
        for &triangle in &self.0 {
            let corners = tracer.triangles()[triangle as usize];
            let over = inside(&corners.map(|p| frame.project(p).extend(frame.height(p))), space);
            let cover: Vec<DVec2> = over.iter().map(|p| p.truncate()).collect();
            let covered = signed_area(&cover).abs();
            if covered < LEAST_COVER * area {
                continue;
            }
            let middle = cover.iter().sum::<DVec2>() / cover.len() as f64;
            let lowest = over.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
            let closeness = covered / lowest;
            if most.is_none_or(|(best, _)| closeness > best) && facet.contains(element, middle) {
                most = Some((closeness, middle));
            }
        }
        most.map(|(_, p)| p)
    }
}

/// What of a convex polygon lies in a box (Sutherland and Hodgman 1974).
fn inside(polygon: &[DVec3], (min, max): (DVec3, DVec3)) -> Vec<DVec3> {
    let mut polygon = polygon.to_vec();
    for axis in 0..3 {
        for (sign, bound) in [(1.0, min[axis]), (-1.0, -max[axis])] {
            let height = |p: DVec3| sign * p[axis] - bound;
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (i, &b) in polygon.iter().enumerate() {
                let a = polygon[if i == 0 { polygon.len() - 1 } else { i - 1 }];
                if (height(a) < 0.0) != (height(b) < 0.0) {
                    kept.push(a.lerp(b, height(a) / (height(a) - height(b))));
                }
                if height(b) >= 0.0 {
                    kept.push(b);
                }
            }
            polygon = kept;
        }
    }
    polygon
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_reaches_out_of_the_box_is_cut() {
        let slope = [DVec3::new(-1.0, 0.0, -1.0), DVec3::new(3.0, 0.0, 3.0), DVec3::new(3.0, 4.0, 3.0)];
        let cut = inside(&slope, (DVec3::new(0.0, 0.0, 0.5), DVec3::new(2.0, 2.0, 2.0)));
        let lowest = cut.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        assert!((lowest - 0.5).abs() < 1e-12, "{cut:?}");
        let area = signed_area(&cut.iter().map(|p| p.truncate()).collect::<Vec<_>>()).abs();
        // Under the line y = x + 1 between x = 0.5 and 2, and no further than y = 2.
        assert!((area - (1.5 * 2.0 - 0.5 * 0.5 * 0.5)).abs() < 1e-12, "{area}");
        assert!(inside(&slope, (DVec3::splat(5.0), DVec3::splat(6.0))).is_empty());
    }
}
