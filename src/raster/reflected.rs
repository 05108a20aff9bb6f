//! Reflected light in texels: looked up in the mesh, and fitted to it where it changes within a texel.
//!
//! In a gap between two books light dies within millimetres of the opening, far less than a texel. The texels
//! along the opening have the light there, and a lookup between them and the next row would find half of it,
//! a texel deep into the dark. So texels between which the mesh does not hold what they say are
//! chosen such that lookups come closest to the mesh everywhere.

use std::collections::HashMap;

use glam::DVec2;

use super::Lighting;
use super::cover::{Cover, Covering};
use super::direct::LitTexel;
use super::fit::{FitTexel, LightSample, fit};
use crate::geom::Ring;
use crate::geom::polygon::{contains, is_in_convex};
use crate::light::luminance;
use crate::unwrap::Chart;

/// Lookups between texels may miss the mesh by this fraction of the light there,
const TOLERANCE: f64 = 0.03;

/// or in the dark of this fraction of the scene's typical light.
const DIM: f64 = 0.5;

/// Where they miss more, the mesh is asked at this many points a side of a texel.
const POINTS_A_SIDE: u32 = 4;

/// Fits the reflected light of a chart's texels, which have that at their points, where it is uneven.
pub(super) fn fit_reflected(lighting: &Lighting, chart: &Chart, cover: &Cover, texels: &mut [LitTexel]) {
    let index: HashMap<[u32; 2], usize> = texels.iter().enumerate().map(|(i, t)| (t.cell, i)).collect();
    let work = Fitting { lighting, chart, cover, plane_from_texel: chart.texel_from_plane.inverse() };
    let mut is_free = vec![false; texels.len()];
    for texel in texels.iter() {
        if let Some(four) = four_from(texel.cell, &index)
            && work.is_missed_between(four.map(|i| &texels[i]))
        {
            four.into_iter()
                .filter(|&i| texels[i].covering == Covering::Seen)
                .for_each(|i| is_free[i] = true);
        }
    }
    if !is_free.contains(&true) {
        return;
    }
    let mut samples = Vec::new();
    let mut fitted: Vec<FitTexel> = Vec::with_capacity(texels.len());
    for (texel, &is_free) in texels.iter().zip(&is_free) {
        let first = samples.len();
        if is_free {
            work.sample(texel, &mut samples);
        }
        let own = &samples[first..];
        let mean = own.iter().map(|s| s.light).sum::<glam::DVec3>() / own.len() as f64;
        let value = if own.is_empty() { texel.indirect } else { mean };
        fitted.push(FitTexel { cell: texel.cell, value, is_free: is_free && !own.is_empty() });
    }
    fit(&mut fitted, &samples);
    texels.iter_mut().zip(fitted).for_each(|(texel, fitted)| texel.indirect = fitted.value);
}

/// The texels around the corner that a cell shares with the next ones right and down.
fn four_from([x, y]: [u32; 2], index: &HashMap<[u32; 2], usize>) -> Option<[usize; 4]> {
    let at = |dx: u32, dy: u32| index.get(&[x + dx, y + dy]).copied();
    Some([at(0, 0)?, at(1, 0)?, at(0, 1)?, at(1, 1)?])
}

struct Fitting<'a> {
    lighting: &'a Lighting<'a>,
    chart: &'a Chart,
    cover: &'a Cover<'a>,
    plane_from_texel: glam::DAffine2,
}

impl Fitting<'_> {
    /// Whether a lookup in the middle of four texels finds another light than the mesh holds there.
    fn is_missed_between(&self, four: [&LitTexel; 4]) -> bool {
        let [first, ..] = four;
        let corner = DVec2::new(first.cell[0].into(), first.cell[1].into()) + 1.0;
        let point = self.plane_from_texel.transform_point2(corner);
        let seen = four.iter().filter(|t| t.covering == Covering::Seen);
        let Some(texel) =
            seen.min_by(|a, b| a.point.distance_squared(point).total_cmp(&b.point.distance_squared(point)))
        else {
            return false;
        };
        let found = 0.25 * four.iter().map(|t| t.indirect).sum::<glam::DVec3>();
        let (_, light) = self.lighting.locators[self.chart.surface].light_at(point, texel.region);
        let error = luminance((found - light).abs());
        let least = DIM * self.lighting.input.typical;
        error > TOLERANCE * luminance(light + texel.direct).max(least) && self.is_shown(texel, point)
    }

    /// Reflected light at points of the texel's square that lie in its region and in its chart.
    fn sample(&self, texel: &LitTexel, samples: &mut Vec<LightSample>) {
        let corner = DVec2::new(texel.cell[0].into(), texel.cell[1].into());
        for k in 0..POINTS_A_SIDE * POINTS_A_SIDE {
            let place = DVec2::new((k % POINTS_A_SIDE).into(), (k / POINTS_A_SIDE).into());
            let at = corner + (place + 0.5) / f64::from(POINTS_A_SIDE);
            let point = self.plane_from_texel.transform_point2(at);
            if self.is_shown(texel, point) {
                let (_, light) = self.lighting.locators[self.chart.surface].light_at(point, texel.region);
                samples.push(LightSample { at, light });
            }
        }
    }

    fn is_shown(&self, texel: &LitTexel, point: DVec2) -> bool {
        let surface = &self.lighting.input.surfaces[self.chart.surface];
        let rings: &[Ring] = surface.regions.get(texel.region as usize).map_or(&[], |r| &r.rings);
        contains(rings, point) && is_in_convex(&self.chart.outline, point) && !self.cover.hides(point)
    }
}
