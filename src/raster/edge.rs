//! Where a shadow's edge falls: visibility in every texel, several points a texel, and a fit through these.

use std::collections::HashSet;

use glam::{DVec2, DVec3};

use super::cover::{Covering, neighbours};
use super::direct::{Done, Edges, LitTexel, Shining, extent};
use super::fit::{FitTexel, LightSample, fit};
use super::ways::TexelWays;
use crate::geom::polygon::{contains, is_in_convex, nearest_on_segment};
use crate::light::luminance;
use crate::solve::emitter::{Between, Evaluation, Precision};
use crate::solve::umbra::Occluder;

/// Light that changes by less than this fraction within a small block is taken once a texel.
const SMOOTH: f64 = 0.3;

/// Light from one emitter that is everywhere below this fraction of the scene's typical light is taken once a
/// texel, too.
const DIM: f64 = 0.02;

/// Where a shadow's edge crosses a texel, light is evaluated at this many points a side of it.
const POINTS_A_SIDE: u32 = 3;

/// Samples keep this many texels from their region's outline.
const OUTLINE: f64 = 0.02;

/// Lets the texels at a shadow's edge, and those beside them, fit the samples.
///
/// The ones beside the edge have no samples yet: their light is about the same all over.
pub(super) fn fit_edges(texels: &mut [LitTexel], mut samples: Vec<LightSample>) {
    let at_edge: HashSet<[u32; 2]> = texels.iter().filter(|t| t.is_at_edge).map(|t| t.cell).collect();
    let is_beside = |cell| neighbours(cell).any(|n| at_edge.contains(&n));
    let mut fitted = Vec::with_capacity(texels.len());
    for texel in texels.iter() {
        let is_free = texel.covering != Covering::Under && (texel.is_at_edge || is_beside(texel.cell));
        if is_free && !texel.is_at_edge && texel.covering == Covering::Seen {
            let middle = DVec2::new(texel.cell[0].into(), texel.cell[1].into()) + 0.5;
            let around = [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)];
            samples
                .extend(around.map(|(x, y)| LightSample { at: middle + DVec2::new(x, y), light: texel.now }));
        }
        fitted.push(FitTexel { cell: texel.cell, value: texel.now, is_free });
    }
    fit(&mut fitted, &samples);
    for (texel, fitted) in texels.iter_mut().zip(fitted) {
        texel.now = fitted.value;
    }
}

impl Shining<'_> {
    /// A small block in which shadow may fall: one point a texel where the light changes little from texel
    /// to texel; where it changes much, the mean over several, and these as samples to be fitted.
    pub(super) fn shadow_edge(&self, texels: &mut [LitTexel], between: &[Occluder]) -> Done {
        let mut evaluation = Evaluation::new(Precision::TEXEL);
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for texel in texels.iter_mut() {
            texel.now = self.irradiance(texel.point, Between::Polygons(between), &mut evaluation);
            let light = luminance(texel.now);
            (least, most) = (least.min(light), most.max(light));
        }
        if self.light.edges == Edges::Once {
            let middle = texels[texels.len() / 2].point;
            let unoccluded = luminance(self.irradiance(middle, Between::Nothing, &mut evaluation));
            texels.iter_mut().for_each(|t| t.doubtful += unoccluded);
        }
        let mut samples = Vec::new();
        let is_bright = self.light.edges == Edges::Fitted && most > DIM * self.light.typical;
        if is_bright && (texels.len() == 1 || most - least > SMOOTH * most) {
            let outlines = self.outlines_near(texels);
            for texel in texels.iter_mut().filter(|t| t.covering == Covering::Seen) {
                let first = samples.len();
                self.sample(texel, between, &outlines, (&mut evaluation, &mut samples));
                let own = &samples[first..];
                if !own.is_empty() {
                    texel.now = own.iter().map(|s| s.light).sum::<DVec3>() / own.len() as f64;
                    texel.is_at_edge = true;
                }
            }
        }
        let edge = texels.iter().filter(|t| t.is_at_edge).count() as u64;
        let ways = TexelWays { edge, crossed: texels.len() as u64 - edge, ..TexelWays::default() };
        Done { ways, effort: evaluation.effort, samples }
    }

    /// The edges of all regions' outlines that may pass through the texels' squares.
    fn outlines_near(&self, texels: &[LitTexel]) -> Vec<[DVec2; 2]> {
        let [right, down] = self.cover.step;
        let (low, high) = extent(texels);
        let reach = 2.0 * (right.abs() + down.abs());
        let (low, high) = (low - reach, high + reach);
        let edges = self
            .surface
            .regions
            .iter()
            .flat_map(|r| &r.rings)
            .flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)).map(|(&a, &b)| [a, b]));
        edges.filter(|[a, b]| a.max(*b).cmpge(low).all() && a.min(*b).cmple(high).all()).collect()
    }

    /// Light at points of the texel's square that lie in its region; `outlines` are those near it.
    fn sample(
        &self,
        texel: &LitTexel,
        between: &[Occluder],
        outlines: &[[DVec2; 2]],
        (evaluation, samples): (&mut Evaluation, &mut Vec<LightSample>),
    ) {
        let rings = self.surface.regions.get(texel.region as usize).map_or(&[][..], |r| &r.rings);
        let corner = DVec2::new(texel.cell[0].into(), texel.cell[1].into());
        for k in 0..POINTS_A_SIDE * POINTS_A_SIDE {
            let place = DVec2::new((k % POINTS_A_SIDE).into(), (k / POINTS_A_SIDE).into());
            let at = corner + (place + 0.5) / f64::from(POINTS_A_SIDE);
            let point = self.plane_from_texel.transform_point2(at);
            let is_inside = (outlines.is_empty() && !rings.is_empty())
                || (contains(rings, point) && !self.is_at_outline(outlines, point));
            // What lies beyond a cut is another chart's.
            if is_inside && is_in_convex(self.outline, point) && !self.cover.hides(point) {
                let light = self.irradiance(point, Between::Polygons(between), evaluation);
                samples.push(LightSample { at, light });
            }
        }
    }

    /// Whether a point lies on an outline: where an emitter stands on that, it is seen edge-on from there.
    fn is_at_outline(&self, outlines: &[[DVec2; 2]], point: DVec2) -> bool {
        let [right, down] = self.cover.step;
        let least = OUTLINE * right.length().min(down.length());
        outlines.iter().any(|&[a, b]| nearest_on_segment(a, b, point).distance(point) < least)
    }
}
