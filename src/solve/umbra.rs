//! Whether one convex occluder hides a whole emitter from a whole element.
//!
//! For a convex element, a convex emitter and a convex occluder whose plane parts them, it is
//! enough to test the segments between corners: for a fixed point of the emitter the element's
//! shadow on the occluder's plane is the hull of its corners' shadows, and likewise the other
//! way round. Such an element receives nothing and gains nothing from being split: only a
//! shadow's boundary does.

use glam::DVec3;

use super::emitter::Emitter;
use crate::surface::Surface;
use crate::trace::Tracer;

/// The convex polygons that occlude: whole surfaces where they are convex, else their triangles.
#[derive(Debug, Default)]
pub struct Occluders {
    surface_of_triangle: Vec<u32>,
    outlines: Vec<Option<Vec<DVec3>>>,
    areas: Vec<f64>,
}

/// A convex polygon that occludes.
#[derive(Clone, Copy, Debug)]
pub struct Occluder<'a> {
    /// World-space corners, in order.
    pub corners: &'a [DVec3],
    /// Whether it lets light through somewhere.
    pub is_screen: bool,
}

/// Outlines with more corners occlude as triangles.
const MOST_OUTLINE_CORNERS: usize = 6;

const NO_SURFACE: u32 = u32::MAX;

/// This many occluders are tried; an umbra's occluder is large and among the first.
const MOST_TRIED: usize = 24;

impl Occluders {
    /// Prepares `surfaces` over a scene of `triangles` triangles.
    #[must_use]
    pub fn new(surfaces: &[Surface], triangles: usize) -> Self {
        let mut surface_of_triangle = vec![NO_SURFACE; triangles];
        let mut outlines = Vec::with_capacity(surfaces.len());
        for (index, surface) in surfaces.iter().enumerate() {
            for &t in &surface.source_triangles {
                if let Some(owner) = surface_of_triangle.get_mut(t) {
                    *owner = index as u32;
                }
            }
            outlines.push(match surface.rings.as_slice() {
                [ring] if crate::geom::hull::is_convex(ring) => {
                    Some(ring.iter().map(|&p| surface.frame.lift(p)).collect())
                }
                _ => None,
            });
        }
        let areas = surfaces.iter().map(|s| s.area).collect();
        Self { surface_of_triangle, outlines, areas }
    }

    /// The triangles `between` as convex polygons, those of large surfaces first, which may hide all that others
    /// would be tried on. A convex surface stands for all of its triangles.
    ///
    /// `between` ascends, so a surface's triangles come one after the other, or nearly.
    #[must_use]
    pub fn polygons<'a>(&'a self, tracer: &'a Tracer, between: &[u32]) -> Vec<Occluder<'a>> {
        let mut polygons: Vec<(f64, Occluder)> = Vec::with_capacity(between.len());
        let mut taken: Vec<u32> = Vec::new();
        for &t in between {
            let surface = self.surface_of_triangle[t as usize];
            let is_screen = tracer.is_screen(t as usize);
            match self.outlines.get(surface as usize).and_then(Option::as_deref) {
                Some(outline) if outline.len() <= MOST_OUTLINE_CORNERS => {
                    if !taken.contains(&surface) {
                        taken.push(surface);
                        polygons
                            .push((self.areas[surface as usize], Occluder { corners: outline, is_screen }));
                    }
                }
                _ => {
                    let area = self.areas.get(surface as usize).copied().unwrap_or_default();
                    polygons.push((area, Occluder { corners: &tracer.triangles()[t as usize], is_screen }));
                }
            }
        }
        polygons.sort_by(|a, b| b.0.total_cmp(&a.0));
        polygons.into_iter().map(|(_, polygon)| polygon).collect()
    }

    /// Whether some one of the triangles `between`, or the convex surface it belongs to, hides all of
    /// `emitter` from all of the polygon with corners `receiver`.
    #[must_use]
    pub fn one_hides(&self, receiver: &[DVec3], emitter: &Emitter, tracer: &Tracer, between: &[u32]) -> bool {
        let mut corners = Vec::new();
        let mut last = NO_SURFACE;
        let solid = between.iter().filter(|&&t| !tracer.is_screen(t as usize));
        solid.take(MOST_TRIED).any(|&t| {
            let surface = self.surface_of_triangle[t as usize];
            let outline = self.outlines.get(surface as usize).and_then(Option::as_deref);
            let occluder = match outline {
                Some(_) if surface == last => return false,
                Some(outline) => outline,
                None => &tracer.triangles()[t as usize],
            };
            last = surface;
            receiver.iter().all(|&p| {
                emitter.corners_seen_from(p, tracer.diagonal(), &mut corners);
                !corners.is_empty() && corners.iter().all(|&q| crosses(occluder, p, q))
            })
        })
    }
}

/// Whether the segment from `p` to `q` passes through a convex planar polygon.
fn crosses(polygon: &[DVec3], p: DVec3, q: DVec3) -> bool {
    let [a, b, c, ..] = *polygon else { return false };
    let normal = (b - a).cross(c - a);
    if normal.dot(p - a) * normal.dot(q - a) >= 0.0 {
        return false;
    }
    let d = q - p;
    let (mut left, mut right) = (false, false);
    for i in 0..polygon.len() {
        let side = d.dot((polygon[i] - p).cross(polygon[(i + 1) % polygon.len()] - p));
        left |= side > 0.0;
        right |= side < 0.0;
    }
    left != right
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{PunctualKind, PunctualLight};

    #[test]
    fn only_an_occluder_that_covers_everything_makes_an_umbra() {
        let lamp = Emitter::Punctual(PunctualLight {
            kind: PunctualKind::Point { position: DVec3::new(0.0, 0.0, 2.0), range: f64::INFINITY },
            intensity: DVec3::ONE,
            node: 0,
        });
        let element =
            [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)].map(|(x, y)| DVec3::new(x, y, 0.0));
        for (size, hidden) in [(0.3, true), (0.08, false)] {
            let occluder = [
                DVec3::new(-size, -size, 1.0),
                DVec3::new(2.0 * size, -size, 1.0),
                DVec3::new(-size, 2.0 * size, 1.0),
            ];
            let tracer = Tracer::new(vec![occluder]);
            let occluders = Occluders::new(&[], 1);
            assert_eq!(occluders.one_hides(&element, &lamp, &tracer, &[0]), hidden, "{size}");
        }
    }
}
