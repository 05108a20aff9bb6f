//! Two bakes of one scene.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::baked::check_matched;
use super::figures::{DARK, Percentiles, brightness, ratio};
use super::page::{PageFigures, PageLight};
use super::spread::places;
use super::{BakedScene, CompareError, HeatMap, Place};
use crate::options::Quantity;

/// Points that two bakes are compared at.
const POINTS: usize = 1 << 16;

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Light {
    /// What the texels hold, which is the same quantity in both.
    Stored,
    /// The irradiance that follows from it.
    Irradiance,
}

impl Light {
    pub(super) fn at(self, baked: &BakedScene, place: &Place) -> Option<DVec3> {
        let value = match self {
            Self::Stored => baked.value_at(place),
            Self::Irradiance => baked.irradiance_at(place),
        };
        value.filter(|value| value.is_finite())
    }
}

/// How far bake B is from bake A, at points spread evenly over A's lit surfaces.
///
/// `A` and `B` are linear RGB. A point's brightness is the mean of its channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairFigures {
    /// What is compared: what the texels hold where that is the same in both, else irradiance.
    pub quantity: Quantity,
    /// Points that both bakes have.
    pub points: usize,
    /// Points of A that lie on no lit surface of B. They count in no figure.
    pub unmatched: usize,
    /// Points of A inside solids, under a box on a floor, say: nobody sees them. They count in no figure.
    pub hidden: usize,
    /// Mean of A over points and channels, in the scene's units.
    pub mean_a: f64,
    /// Mean of B.
    pub mean_b: f64,
    /// `‖B − A‖ / ‖A‖` over all points and channels, a fraction.
    pub rel_l2: f64,
    /// Mean of `B − A` over the mean of A, a fraction.
    pub bias: f64,
    /// Median of the difference in brightness, as a fraction of the point's in A (at least a twentieth
    /// of A's mean).
    pub p50: f64,
    /// 95th percentile of the same.
    pub p95: f64,
    /// 99th percentile of the same.
    pub p99: f64,
    /// What a person would see of it.
    pub flip: PageFigures,
}

/// A comparison of two bakes.
pub struct PairComparison {
    /// In numbers.
    pub figures: PairFigures,
    page: PageLight,
}

impl PairComparison {
    /// The error of each texel of A's first page.
    ///
    /// # Errors
    /// [`CompareError::Picture`].
    pub fn heat_map(&self) -> Result<HeatMap, CompareError> {
        HeatMap::of(&self.page, DARK * self.figures.mean_a)
    }
}

/// Compares bake `b` with bake `a`, whatever their atlases and triangles.
///
/// # Errors
/// [`CompareError::FewMatched`] where most points of `a` do not lie on `b`, [`CompareError::Unlit`] where `a`'s
/// lit surfaces have no area that is seen.
pub fn with_bake(a: &BakedScene, b: &BakedScene) -> Result<PairComparison, CompareError> {
    let light = if a.quantity() == b.quantity() { Light::Stored } else { Light::Irradiance };
    let all = places(a, POINTS);
    let total = all.len();
    let seen: Vec<Place> = all.into_par_iter().filter(|place| !a.is_hidden(place)).collect();
    let look_up = |place: &Place| {
        let (point, normal) = a.point_at(place)?;
        let found = b.locate(point, normal)?;
        Some((light.at(a, place)?, light.at(b, &found)?))
    };
    let found: Vec<Option<(DVec3, DVec3)>> = seen.par_iter().map(look_up).collect();
    let pairs: Vec<(DVec3, DVec3)> = found.into_iter().flatten().collect();
    if seen.is_empty() {
        return Err(CompareError::Unlit { path: a.path().to_owned() });
    }
    check_matched(b, pairs.len(), seen.len())?;
    let page = PageLight::of(a, b, light).ok_or_else(|| CompareError::Unlit { path: a.path().to_owned() })?;
    let count = pairs.len() as f64;
    let sum = |term: &dyn Fn(DVec3, DVec3) -> f64| pairs.iter().map(|&(a, b)| term(a, b)).sum::<f64>();
    let mean_a = sum(&|a, _| brightness(a)) / count;
    let mean_b = sum(&|_, b| brightness(b)) / count;
    let relative = Percentiles::of(pairs.iter().map(|&(a, b)| {
        let (a, b) = (brightness(a), brightness(b));
        ratio((b - a).abs(), a.max(DARK * mean_a))
    }));
    let figures = PairFigures {
        quantity: if light == Light::Stored { a.quantity() } else { Quantity::Irradiance },
        points: pairs.len(),
        unmatched: seen.len() - pairs.len(),
        hidden: total - seen.len(),
        mean_a,
        mean_b,
        rel_l2: ratio(sum(&|a, b| (b - a).length_squared()).sqrt(), sum(&|a, _| a.length_squared()).sqrt()),
        bias: ratio(mean_b - mean_a, mean_a),
        p50: relative.at(50.0),
        p95: relative.at(95.0),
        p99: relative.at(99.0),
        flip: page.figures(),
    };
    Ok(PairComparison { figures, page })
}
