//! Where something stands close over an element.
//!
//! Interpolation can be right in the middle of an element by chance and wrong under a picture or a keyboard that
//! covers a part of it: what the Close Objects Buffer (Telea and van Overveld 1998) says of direct light holds for
//! reflected light, too. So the element is asked about the place that is covered most closely.

use glam::DVec2;

use crate::element::Facet;
use crate::geom::Bounds;
use crate::geom::polygon::{clip_rectangle, signed_area};
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
            let heights = corners.map(|p| frame.height(p));
            let lowest = heights.into_iter().fold(f64::INFINITY, f64::min);
            if lowest >= size || heights.iter().all(|&h| h <= tracer.margin()) {
                continue;
            }
            let shadow = clip_rectangle(&corners.map(|p| frame.project(p)), e.min, e.max);
            let covered = signed_area(&shadow).abs();
            if covered < LEAST_COVER * area {
                continue;
            }
            let closeness = covered / lowest.max(tracer.margin());
            if most.is_none_or(|(best, _)| closeness > best) {
                most = Some((closeness, shadow.iter().sum::<DVec2>() / shadow.len() as f64));
            }
        }
        most.map(|(_, p)| p).filter(|&p| facet.contains(element, p))
    }
}
