//! Texels that something lies upon.
//!
//! Under a sheet of paper a millimetre above a desk it is dark, and nobody sees it. A texel that the
//! sheet covers in part stands for the part that is seen; one that it covers wholly, but that a lookup
//! beside the sheet still touches, takes after its neighbours; those farther under the sheet stay dark.

use std::collections::HashMap;

use glam::DVec2;

use super::direct::LitTexel;
use crate::geom::Ring;
use crate::geom::polygon::{contains, is_in_convex};
use crate::surface::Surface;
use crate::trace::Tracer;

/// What comes nearer to a surface than this many texels, along their shorter side, covers it.
const GAP: f64 = 0.25;

/// A texel is searched for a place that is seen in a square of this many a side.
const PLACES_A_SIDE: u32 = 5;

/// Covered texels at a chart's border show what is this many texels inside of it.
const DEPTH: f64 = 0.5;

/// What is seen of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Covering {
    /// At least a part of it.
    Seen,
    /// Nothing, but places nearby whose lookups touch it.
    Beside,
    /// Nothing, and no lookup at a place that is seen touches it.
    Under,
}

/// Looks for what lies upon one surface.
#[derive(Clone, Copy)]
pub(super) struct Cover<'a> {
    /// The scene.
    pub tracer: &'a Tracer,
    /// The surface.
    pub surface: &'a Surface,
    /// What of the surface the chart shows.
    pub outline: &'a Ring,
    /// From one texel to the next, right and down, plane coordinates.
    pub step: [DVec2; 2],
}

impl Cover<'_> {
    /// Whether something lies upon the surface at a point of its plane.
    pub(super) fn hides(&self, point: DVec2) -> bool {
        let frame = &self.surface.frame;
        let texel = self.step[0].length().min(self.step[1].length());
        let foot = frame.lift(point) + frame.normal * self.tracer.margin();
        self.tracer.occluded(foot, foot + frame.normal * (GAP * texel))
    }

    /// Moves covered texels to a place that is seen, and tells which have none.
    pub(super) fn uncover(&self, texels: &mut [LitTexel]) {
        for texel in texels {
            if self.hides(texel.point) {
                if let Some(point) = self.seen_place(texel, 1.0) {
                    texel.point = point;
                } else if self.seen_place(texel, 1.2).is_some() {
                    texel.covering = Covering::Beside;
                } else {
                    texel.covering = Covering::Under;
                    texel.point = self.farther_inside(texel.point);
                }
            }
        }
    }

    /// A place within the chart that is farther from its border, where that ends at the cover's outline: within a gap's
    /// height of it there is light that dies away farther inside.
    fn farther_inside(&self, point: DVec2) -> DVec2 {
        let reach = DEPTH * (self.step[0].abs() + self.step[1].abs());
        let ends = |pick: fn(DVec2, DVec2) -> DVec2| self.outline.iter().copied().reduce(pick);
        let (Some(low), Some(high)) = (ends(DVec2::min), ends(DVec2::max)) else { return point };
        let reach = reach.min(0.5 * (high - low));
        point.clamp(low + reach, high - reach)
    }

    /// The place that is seen, of the texel's region, and nearest to its point, in a square of `side` texels.
    fn seen_place(&self, texel: &LitTexel, side: f64) -> Option<DVec2> {
        let rings = &self.surface.regions.get(texel.region as usize)?.rings;
        let place = |k: u32| {
            let at = DVec2::new((k % PLACES_A_SIDE).into(), (k / PLACES_A_SIDE).into());
            let offset = ((at + 0.5) / f64::from(PLACES_A_SIDE) - 0.5) * side;
            texel.point + offset.x * self.step[0] + offset.y * self.step[1]
        };
        (0..PLACES_A_SIDE * PLACES_A_SIDE)
            .map(place)
            .filter(|&p| contains(rings, p) && is_in_convex(self.outline, p) && !self.hides(p))
            .min_by(|a, b| a.distance_squared(texel.point).total_cmp(&b.distance_squared(texel.point)))
    }
}

/// Gives covered texels beside ones that are seen the mean of those neighbours' values.
pub(super) fn take_after_neighbours<T>(texels: &mut [LitTexel], value: impl Fn(&mut LitTexel) -> &mut T)
where
    T: Copy + std::iter::Sum<T> + std::ops::Div<f64, Output = T>,
{
    let beside: Vec<usize> = (0..texels.len()).filter(|&i| texels[i].covering == Covering::Beside).collect();
    if beside.is_empty() {
        return;
    }
    let index: HashMap<[u32; 2], usize> = texels.iter().enumerate().map(|(i, t)| (t.cell, i)).collect();
    for i in beside {
        let seen: Vec<usize> = neighbours(texels[i].cell)
            .filter_map(|cell| index.get(&cell).copied())
            .filter(|&n| texels[n].covering == Covering::Seen)
            .collect();
        if !seen.is_empty() {
            let sum: T = seen.iter().map(|&n| *value(&mut texels[n])).sum();
            *value(&mut texels[i]) = sum / seen.len() as f64;
        }
    }
}

/// The eight cells around a cell, or fewer at the page's edge.
pub(super) fn neighbours([x, y]: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let offsets = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    offsets
        .into_iter()
        .filter_map(move |(dx, dy)| Some([x.checked_add_signed(dx)?, y.checked_add_signed(dy)?]))
}
