//! Where something stands close over an element.
//!
//! Interpolation can be right in the middle of an element by chance and wrong under a picture or a keyboard that
//! covers a part of it: what the Close Objects Buffer (Telea and van Overveld 1998) says of direct light holds for
//! reflected light, too. So the element is asked about the place that is covered most closely, and about the foot of
//! what stands upright there and reflects the most: a lamp's base, the side of a book.

use std::cmp::Ordering;

use glam::{DVec2, DVec3};

use crate::element::Facet;
use crate::geom::polygon::{clip_half_plane, clip_rectangle, signed_area};
use crate::geom::{Bounds, Ring};
use crate::trace::{Hit, Tracer};

/// What covers less of an element than this fraction leaves no mark that elements could show.
const LEAST_COVER: f64 = 0.02;

/// What leans no more than this, as a cosine, is upright.
const UPRIGHT: f64 = 0.3;

/// The foot of what is upright is the lowest tenth of it.
const FOOT: f64 = 0.1;

/// What stands on an element is asked about this fraction of the element's size away from it.
const BESIDE: f64 = 1.0 / 32.0;

/// What stands along this fraction of an element's edge stands at its corners, too, where light is known.
const ALONG_EDGE: f64 = 0.95;

/// The triangles over an element, no higher than that is large.
#[derive(Default)]
pub struct Nearby(Vec<u32>);

/// A place that something hangs over.
#[derive(Clone, Copy, Debug)]
pub struct Covered {
    /// Plane coordinates.
    pub place: DVec2,
    /// Of what hangs over it where it is lowest, metres.
    pub height: f64,
}

/// A place beside the foot of something upright.
#[derive(Clone, Copy, Debug)]
pub struct BrightFoot {
    /// Plane coordinates.
    pub place: DVec2,
    /// The irradiance that it gives there, about: luminance.
    pub gives: f64,
}

impl Nearby {
    /// Looks for what is near `element`.
    pub fn look(&mut self, tracer: &Tracer, facet: &Facet, element: u32) {
        let e = &facet.elements[element as usize];
        let feet = e.corners().map(|p| facet.frame.lift(p));
        let above = feet.map(|p| p + facet.frame.normal * e.size());
        self.0.clear();
        tracer.triangles_in(Bounds::of(feet.into_iter().chain(above)), &mut self.0);
    }

    /// The triangles, with corners in plane coordinates and the height over the plane.
    fn triangles(&self, tracer: &Tracer, facet: &Facet) -> impl Iterator<Item = (u32, [DVec3; 3])> {
        let frame = facet.frame;
        self.0.iter().map(move |&triangle| {
            let corners = tracer.triangles()[triangle as usize];
            (triangle, corners.map(|p| frame.project(p).extend(frame.height(p))))
        })
    }

    /// The middle of what covers `element` most closely.
    #[must_use]
    pub fn most_covered(&self, tracer: &Tracer, facet: &Facet, element: u32) -> Option<Covered> {
        let e = &facet.elements[element as usize];
        let area = (e.max - e.min).element_product();
        let mut most: Option<(f64, Covered)> = None;
        for (_, corners) in self.triangles(tracer, facet) {
            let (cover, lowest) = cover(corners, (e.min.extend(tracer.margin()), e.max.extend(e.size())));
            let covered = signed_area(&cover).abs();
            if covered < LEAST_COVER * area {
                continue;
            }
            let middle = cover.iter().sum::<DVec2>() / cover.len() as f64;
            let closeness = covered / lowest;
            if most.is_none_or(|(best, _)| closeness > best) && facet.contains(element, middle) {
                most = Some((closeness, Covered { place: middle, height: lowest }));
            }
        }
        most.map(|(_, covered)| covered)
    }

    /// The place on `element` beside the foot of what is upright and gives the most there. `radiosity` tells the
    /// luminance that a triangle reflects at a point, seen from in front or from behind.
    #[must_use]
    pub fn brightest_foot(
        &self,
        tracer: &Tracer,
        facet: &Facet,
        element: u32,
        radiosity: impl Fn(&Hit, DVec3) -> f64,
    ) -> Option<BrightFoot> {
        let e = &facet.elements[element as usize];
        let mut most: Option<BrightFoot> = None;
        for (triangle, corners) in self.triangles(tracer, facet) {
            let Some(foot) = foot(corners, (e.min, e.max), e.cut.is_some(), tracer.margin()) else {
                continue;
            };
            let at = facet.frame.lift(foot.middle.truncate()) + facet.frame.normal * foot.middle.z;
            for from_behind in [false, true] {
                let hit = Hit { triangle: triangle as usize, distance: 0.0, from_behind };
                if tracer.met_back(&hit) {
                    continue;
                }
                let away = if from_behind { -foot.front } else { foot.front };
                let place = foot.middle.truncate() + away * (BESIDE * e.size()).max(foot.lowest);
                let gives = foot.share * radiosity(&hit, at);
                let is_more = most.is_none_or(|m| gives > m.gives);
                if is_more && e.covers(place) && facet.contains(element, place) {
                    most = Some(BrightFoot { place, gives });
                }
            }
        }
        most
    }
}

/// The lowest part of something upright over an element.
#[derive(Clone, Copy, Debug)]
struct Foot {
    /// Its middle.
    middle: DVec3,
    /// Height where it is lowest, metres.
    lowest: f64,
    /// Where its front looks, unit length.
    front: DVec2,
    /// The form factor of all of it from beside its foot, about.
    share: f64,
}

/// The foot of a triangle's part over the rectangle from `low` to `high`, no higher than that is large; `None` where
/// it is not upright, not there, or along an edge that has samples at both ends, as all have but for those that `is_cut`.
fn foot([a, b, c]: [DVec3; 3], (low, high): (DVec2, DVec2), is_cut: bool, margin: f64) -> Option<Foot> {
    let normal = (b - a).cross(c - a).try_normalize()?;
    let front = normal.truncate().try_normalize()?;
    if normal.z.abs() > UPRIGHT {
        return None;
    }
    let (min, max) = (low.extend(-margin), high.extend((high - low).max_element()));
    let mut part = vec![a, b, c];
    for axis in 0..3 {
        part = clip(&clip(&part, axis, 1.0, min[axis] - margin), axis, -1.0, -max[axis] - margin);
    }
    let heights = |part: &[DVec3]| {
        part.iter().map(|p| p.z).fold((f64::INFINITY, 0.0), |(l, h), z| (z.min(l), z.max(h)))
    };
    let (lowest, highest) = heights(&part);
    let lowest = lowest.max(0.0);
    if highest <= lowest + margin {
        return None;
    }
    let slice = clip(&part, 2, -1.0, -(lowest + FOOT * (highest - lowest)));
    let along = slice.iter().map(|p| front.perp().dot(p.truncate()));
    let (first, last) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (x.min(l), x.max(h)));
    let length = last - first;
    if slice.is_empty() || length.partial_cmp(&0.0) != Some(Ordering::Greater) {
        return None;
    }
    let middle = slice.iter().sum::<DVec3>() / slice.len() as f64;
    let is_at_edge = (0..2).any(|axis| {
        let to_edge = (middle[axis] - low[axis]).abs().min((high[axis] - middle[axis]).abs());
        to_edge < 2.0 * margin && length > ALONG_EDGE * (high - low)[1 - axis]
    });
    if !is_cut && is_at_edge {
        return None;
    }
    let share = 0.5 * (1.0 - lowest / highest) * (length / highest).min(1.0);
    Some(Foot { middle, lowest, front, share })
}

/// The part of a polygon where `sign` times the coordinate along `axis` is at least `least`.
fn clip(polygon: &[DVec3], axis: usize, sign: f64, least: f64) -> Vec<DVec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    let Some(&last) = polygon.last() else { return out };
    let mut a = last;
    for &b in polygon {
        let (height_a, height_b) = (sign * a[axis] - least, sign * b[axis] - least);
        if (height_a >= 0.0) != (height_b >= 0.0) {
            out.push(a.lerp(b, height_a / (height_a - height_b)));
        }
        if height_b >= 0.0 {
            out.push(b);
        }
        a = b;
    }
    out
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

    /// The side of a box on an element: its foot is where it stands, and it fills nearly half of what is seen there.
    #[test]
    fn an_upright_side_has_a_foot() {
        let ground = (DVec2::ZERO, DVec2::splat(2.0));
        let side =
            |y: f64, z: f64| [DVec3::new(0.5, y, z), DVec3::new(1.5, y, z), DVec3::new(1.5, y, z + 0.5)];
        let at = foot(side(0.8, 0.0), ground, false, 1e-6).unwrap();
        assert!((at.middle.y - 0.8).abs() < 1e-9 && at.middle.x > 0.5 && at.middle.x < 1.5, "{at:?}");
        assert!(at.lowest == 0.0 && at.front == -DVec2::Y && (at.share - 0.5).abs() < 1e-9, "{at:?}");
        // What hovers gives less.
        let hovering = foot(side(0.8, 0.5), ground, false, 1e-6).unwrap();
        assert!((hovering.lowest - 0.5).abs() < 1e-9 && hovering.share < 0.3, "{hovering:?}");
        // What lies flat, stands beside or stands all along an edge has none that corners do not know.
        let flat = side(0.8, 0.0).map(|p| DVec3::new(p.x, p.z, p.y));
        assert!(foot(flat, ground, false, 1e-6).is_none());
        assert!(foot(side(2.5, 0.0), ground, false, 1e-6).is_none());
        let wall = [DVec3::new(-9.0, 0.0, 0.0), DVec3::new(9.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 9.0)];
        assert!(foot(wall, ground, false, 1e-6).is_none() && foot(wall, ground, true, 1e-6).is_some());
    }

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
