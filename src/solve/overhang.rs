//! What hangs closely over a part of an element that is not split further.
//!
//! A mug's foot keeps half a millimetre from the desk. An element a few millimetres wide under its rim is lit beside
//! the mug and dark below it, and holds one value. That is the value of its open part, which is the one that is seen;
//! rays that look at it out of the gap must not find it, or the gap would shine from both sides.

use glam::DVec2;

use crate::element::Facet;
use crate::geom::polygon::rectangle;
use crate::trace::Tracer;

/// What hangs no higher than this fraction of the element's size above it shuts its light out.
pub(super) const CLOSE: f64 = 0.25;

/// Of the rays that leave a gap's one side all but a 65th meet the other one within this many times its height.
const REACH: f64 = 8.0;

/// Places this fraction of the way from the middle to the corners are asked, too.
const ASIDE: f64 = 0.8;

/// What hangs over an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overhang {
    /// A place that it leaves open, plane coordinates.
    pub open: DVec2,
    /// Rays that come from no farther than this may come out of the gap, metres.
    pub reach: f64,
}

impl Overhang {
    /// Looks over an element's middle and corners; `None` where nothing hangs over them, or over all.
    #[must_use]
    pub fn over(tracer: &Tracer, facet: &Facet, element: u32) -> Option<Self> {
        let e = &facet.elements[element as usize];
        let height = |p: &DVec2| {
            let foot = facet.frame.lift(*p) + facet.frame.normal * tracer.margin();
            let hit = tracer.closest_hit(foot, facet.frame.normal)?;
            (hit.distance < CLOSE * e.size()).then_some(hit.distance)
        };
        let corners = rectangle(e.min, e.max).map(|corner| e.centroid.lerp(corner, ASIDE));
        let places = std::iter::once(e.centroid).chain(corners).filter(|&p| facet.contains(element, p));
        let (mut open, mut lowest) = (None, f64::INFINITY);
        for place in places {
            match height(&place) {
                None => open = open.or(Some(place)),
                Some(height) => lowest = lowest.min(height),
            }
        }
        let reach = (REACH * lowest.max(tracer.margin())).min(e.size());
        open.filter(|_| lowest.is_finite()).map(|open| Self { open, reach })
    }
}
