//! One bake's page, with another bake's light on it.

use glam::{DVec2, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::figures::{Percentiles, brightness, ratio};
use super::flip::{PIXELS_PER_DEGREE, flip};
use super::pair::Light;
use super::{BakedScene, Place};
use crate::geom::polygon::orient;
use crate::geom::triangle_grid::nearest_in_triangle;
use crate::picture::{Colour, ToneMap};

/// A texel shows a triangle whose chart comes as near as this to its centre, texels.
const REACH: f64 = 0.5;

/// No triangle.
const NONE: u32 = u32::MAX;

/// What a person would see of the difference, over the first bake's page.
///
/// Both bakes' light is put on the texels of the first one's first lightmap, tone-mapped alike, and
/// compared by [`flip`] at the paper's viewing distance, a texel a pixel. Texels without a surface or inside a
/// solid, and those whose surface the other bake lacks, are the same in both and are not counted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PageFigures {
    /// Texels counted.
    pub texels: usize,
    /// Texels whose point lies on no lit surface of the other bake.
    pub unmatched: usize,
    /// Mean of FLIP, 0 (alike) to 1.
    pub mean: f64,
    /// 95th percentile.
    pub p95: f64,
    /// The largest.
    pub max: f64,
}

/// What the texels of the first bake's page show in both bakes.
pub(super) struct PageLight {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Row by row from the top.
    pub(super) texels: Vec<TexelLight>,
}

/// A texel in both bakes. Pages are large, and half precision is what most of them hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TexelLight {
    /// No surface, too small a part of one, or one inside a solid.
    Empty,
    /// The other bake does not have this surface.
    Unmatched(Vec3),
    /// The first bake's light, and the other's.
    Both(Vec3, Vec3),
}

impl PageLight {
    /// Looks both bakes up at what the texels of `first`'s first page show.
    pub(super) fn of(first: &BakedScene, other: &BakedScene, light: Light) -> Option<Self> {
        let page = first.first_page()?;
        let (width, height) = (page.width, page.height);
        let triangles = triangles_of_texels(first, (width, height));
        let look_up = |(index, &triangle): (usize, &u32)| {
            let centre = DVec2::new((index % width as usize) as f64, (index / width as usize) as f64) + 0.5;
            let shown = corners_on_page(first, triangle as usize, (width, height));
            let Some((_, barycentric)) = shown.map(|corners| nearest(corners, centre)) else {
                return TexelLight::Empty;
            };
            let place = Place { triangle: triangle as usize, barycentric: off_edges(barycentric) };
            if first.is_hidden(&place) {
                return TexelLight::Empty;
            }
            let Some(value) = light.at(first, &place).map(|value| value.as_vec3()) else {
                return TexelLight::Empty;
            };
            let found = first.point_at(&place).and_then(|(point, normal)| other.locate(point, normal));
            found
                .and_then(|place| light.at(other, &place))
                .map_or(TexelLight::Unmatched(value), |found| TexelLight::Both(value, found.as_vec3()))
        };
        let texels = triangles.par_iter().enumerate().map(look_up).collect();
        Some(Self { width, height, texels })
    }

    /// FLIP over the texels that both bakes have.
    pub(super) fn figures(&self) -> PageFigures {
        let values = self.texels.iter().filter_map(|texel| match *texel {
            TexelLight::Empty => None,
            TexelLight::Unmatched(value) | TexelLight::Both(value, _) => Some(value.as_dvec3()),
        });
        let tone = ToneMap::for_values(values);
        let picture = |of_other: bool| -> Vec<Colour> {
            let colour = |texel: &TexelLight| match *texel {
                TexelLight::Empty => [0; 3],
                TexelLight::Both(_, value) if of_other => tone.colour(value.as_dvec3()),
                TexelLight::Unmatched(value) | TexelLight::Both(value, _) => tone.colour(value.as_dvec3()),
            };
            self.texels.par_iter().map(colour).collect()
        };
        let differences = flip(&picture(false), &picture(true), self.width as usize, PIXELS_PER_DEGREE);
        let counted = differences.iter().zip(&self.texels);
        let counted = counted.filter(|(_, texel)| matches!(texel, TexelLight::Both(..)));
        let counted: Vec<f64> = counted.map(|(&difference, _)| difference.into()).collect();
        let percentiles = Percentiles::of(counted.iter().copied());
        PageFigures {
            texels: counted.len(),
            unmatched: self.texels.iter().filter(|texel| matches!(texel, TexelLight::Unmatched(_))).count(),
            mean: ratio(counted.iter().sum(), counted.len() as f64),
            p95: percentiles.at(95.0),
            max: percentiles.at(100.0),
        }
    }

    /// The error in brightness of each texel over the first bake's (at least `darkest`); `None` where
    /// there is nothing to compare.
    pub(super) fn errors(&self, darkest: f64) -> impl Iterator<Item = Option<f64>> {
        self.texels.iter().map(move |texel| match *texel {
            TexelLight::Both(first, other) => {
                let (first, other) = (brightness(first.as_dvec3()), brightness(other.as_dvec3()));
                Some(ratio((other - first).abs(), first.max(darkest)))
            }
            TexelLight::Empty | TexelLight::Unmatched(_) => None,
        })
    }
}

/// Moves a place off its triangle's edges: from there, a neighbour with another chart is as near.
fn off_edges(barycentric: [f64; 3]) -> [f64; 3] {
    const LEAST: f64 = 1e-4;
    let raised = barycentric.map(|weight| weight.max(LEAST));
    let sum: f64 = raised.iter().sum();
    raised.map(|weight| weight / sum)
}

/// A triangle's corners on the first page, texels.
fn corners_on_page(baked: &BakedScene, triangle: usize, (width, height): (u32, u32)) -> Option<[DVec2; 3]> {
    let (page, corners) = baked.chart(triangle)?;
    let size = DVec2::new(width.into(), height.into());
    (page == 0).then(|| corners.map(|corner| corner * size))
}

/// The nearest triangle within reach of each texel's centre, of equally near ones the first.
fn triangles_of_texels(baked: &BakedScene, (width, height): (u32, u32)) -> Vec<u32> {
    let count = width as usize * height as usize;
    let mut found = vec![NONE; count];
    let mut distances = vec![f32::INFINITY; count];
    for triangle in 0..baked.triangles().len() {
        let Some(corners) = corners_on_page(baked, triangle, (width, height)) else { continue };
        let [a, b, c] = corners;
        let first = (a.min(b).min(c) - 0.5 - REACH).floor().max(DVec2::ZERO);
        let last = (a.max(b).max(c) - 0.5 + REACH).ceil();
        for y in first.y as u32..=(last.y.max(0.0) as u32).min(height.saturating_sub(1)) {
            for x in first.x as u32..=(last.x.max(0.0) as u32).min(width.saturating_sub(1)) {
                let centre = DVec2::new(x.into(), y.into()) + 0.5;
                let distance = nearest(corners, centre).0 as f32;
                let index = y as usize * width as usize + x as usize;
                let (Some(slot), Some(least)) = (found.get_mut(index), distances.get_mut(index)) else {
                    continue;
                };
                if f64::from(distance) <= REACH && distance < *least {
                    (*slot, *least) = (triangle as u32, distance);
                }
            }
        }
    }
    found
}

/// Distance to, and barycentric coordinates of, the point of a triangle of either winding nearest to `p`.
fn nearest([a, b, c]: [DVec2; 3], p: DVec2) -> (f64, [f64; 3]) {
    let is_mirrored = orient(a, b, c) < 0.0;
    let found = nearest_in_triangle(if is_mirrored { [a, c, b] } else { [a, b, c] }, p);
    let [u, v, w] = found.barycentric;
    (found.distance_squared.sqrt(), if is_mirrored { [u, w, v] } else { [u, v, w] })
}
