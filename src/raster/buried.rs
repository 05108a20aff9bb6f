//! Which regions lie under or inside a solid.
//!
//! A floor under a box is never seen, and a texel there must not lend its darkness to its
//! neighbours. From inside a solid one sees the backs of its single-sided faces. A gap that no
//! light reaches, closed in on all sides, is no better: the space above a lamp's panel, say.

use glam::DVec3;

use crate::geom::{Frame, triangle};
use crate::surface::{Region, Surface};
use crate::trace::Tracer;

/// This many of a region's largest triangles are looked from.
const VANTAGE_POINTS: usize = 3;

/// Directions looked along from each.
const DIRECTIONS: u32 = 16;

/// Nothing farther than this fraction of the scene's diagonal is seen from a narrow gap.
const NARROW: f64 = 0.02;

/// What is seen from a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outlook {
    /// The scene.
    Open,
    /// Hardly anything but what is close by.
    Narrow,
    /// Mostly backs: the inside of a solid.
    Backs,
}

/// What is seen from a region of a surface.
#[must_use]
pub(super) fn outlook(surface: &Surface, region: &Region, tracer: &Tracer) -> Outlook {
    let mut largest: Vec<_> = region.triangles.iter().collect();
    let area = |t: &&[glam::DVec2; 3]| triangle::area(t.map(|p| p.extend(0.0)));
    largest.sort_by(|a, b| area(b).total_cmp(&area(a)));
    let (mut backs, mut near, mut all) = (0_u32, 0_u32, 0_u32);
    for t in largest.into_iter().take(VANTAGE_POINTS) {
        let centre = surface.frame.lift((t[0] + t[1] + t[2]) / 3.0);
        let from = centre + surface.frame.normal * tracer.margin();
        let frame = Frame::new(from, surface.frame.normal, surface.frame.u);
        for k in 0..DIRECTIONS {
            all += 1;
            if let Some(hit) = tracer.closest_hit(from, spiral_direction(&frame, k)) {
                let is_back = tracer.met_back(&hit);
                backs += u32::from(is_back);
                near += u32::from(is_back || hit.distance < NARROW * tracer.diagonal());
            }
        }
    }
    if 2 * backs > all {
        Outlook::Backs
    } else if 10 * near > 9 * all {
        Outlook::Narrow
    } else {
        Outlook::Open
    }
}

/// The `k`-th of [`DIRECTIONS`] directions, on a golden spiral.
fn spiral_direction(frame: &Frame, k: u32) -> DVec3 {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    frame.cosine_direction(GOLDEN * f64::from(k), (f64::from(k) + 0.5) / f64::from(DIRECTIONS))
}
