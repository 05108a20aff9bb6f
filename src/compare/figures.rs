//! Errors of many points in a few numbers.

use glam::DVec3;
use serde::Serialize;

/// Darker points than this share of the mean count as that bright where an error is relative to the point.
pub(super) const DARK: f64 = 0.05;

/// The errors of a set of points against irradiance that is known.
///
/// `E` is the bake's, `R` the reference's, both linear RGB; "mean" is that of `R` over all points and
/// channels. All but `n` and `mean_ref` are fractions. A point's brightness is the mean of its channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SetFigures {
    /// How many points.
    pub n: usize,
    /// Mean of `R`, in the scene's units.
    pub mean_ref: f64,
    /// Root mean square of `E − R`, over the mean.
    pub rrmse: f64,
    /// The same with the reference's own variance taken out.
    pub rrmse_corr: f64,
    /// Mean of `|E − R|`, over the mean.
    pub mare: f64,
    /// Mean of `|E − R| / R`, `R` at least a twentieth of the mean.
    pub mape: f64,
    /// Median of the error in brightness over the point's own (at least a twentieth of the mean).
    pub p50: f64,
    /// 95th percentile of the same.
    pub p95: f64,
    /// 99th percentile of the same.
    pub p99: f64,
    /// 95th percentile of the error in brightness over the mean.
    pub p95m: f64,
    /// 99th percentile of the same.
    pub p99m: f64,
    /// Mean of `E − R`, over the mean.
    pub bias: f64,
    /// The reference's own noise: root mean square of its standard errors, over the mean.
    pub floor: f64,
}

/// One point: what is measured, what it should be, the standard error of that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) value: DVec3,
    pub(super) reference: DVec3,
    pub(super) standard_error: DVec3,
}

impl SetFigures {
    /// The figures of `points`; `None` where there are none.
    pub(super) fn of(points: &[Measured]) -> Option<Self> {
        if points.is_empty() {
            return None;
        }
        let mean_of = |term: &dyn Fn(&Measured) -> DVec3| {
            points.iter().map(|point| brightness(term(point))).sum::<f64>() / points.len() as f64
        };
        let mean = mean_of(&|p| p.reference);
        let square = mean_of(&|p| (p.value - p.reference) * (p.value - p.reference));
        let noise = mean_of(&|p| p.standard_error * p.standard_error);
        let floor = DVec3::splat(DARK * mean);
        let errors: Vec<(f64, f64)> =
            points.iter().map(|p| (brightness(p.value), brightness(p.reference))).collect();
        let relative = Percentiles::of(errors.iter().map(|&(e, r)| ratio((e - r).abs(), r.max(DARK * mean))));
        let absolute = Percentiles::of(errors.iter().map(|&(e, r)| ratio((e - r).abs(), mean)));
        Some(Self {
            n: points.len(),
            mean_ref: mean,
            rrmse: ratio(square.sqrt(), mean),
            rrmse_corr: ratio((square - noise).max(0.0).sqrt(), mean),
            mare: ratio(mean_of(&|p| (p.value - p.reference).abs()), mean),
            mape: mean_of(&|p| {
                let (error, whole) = ((p.value - p.reference).abs(), p.reference.max(floor));
                DVec3::new(ratio(error.x, whole.x), ratio(error.y, whole.y), ratio(error.z, whole.z))
            }),
            p50: relative.at(50.0),
            p95: relative.at(95.0),
            p99: relative.at(99.0),
            p95m: absolute.at(95.0),
            p99m: absolute.at(99.0),
            bias: ratio(mean_of(&|p| p.value - p.reference), mean),
            floor: ratio(noise.sqrt(), mean),
        })
    }
}

/// The mean of the channels.
pub(super) fn brightness(value: DVec3) -> f64 {
    value.element_sum() / 3.0
}

/// `part / whole`; no part of nothing is 0, so that two black bakes are alike.
pub(super) fn ratio(part: f64, whole: f64) -> f64 {
    if part == 0.0 { 0.0 } else { part / whole }
}

/// Values in order, to read percentiles from.
pub(super) struct Percentiles(Vec<f64>);

impl Percentiles {
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        Self(sorted)
    }

    /// The value that `percent` of the values lie below, interpolated as NumPy does; 0 without values.
    pub(super) fn at(&self, percent: f64) -> f64 {
        let last = self.0.len().saturating_sub(1);
        let rank = percent.clamp(0.0, 100.0) / 100.0 * last as f64;
        let get = |index: usize| self.0.get(index.min(last)).copied().unwrap_or(0.0);
        let (low, high) = (get(rank as usize), get(rank as usize + 1));
        // Not `low + 0 × (high − low)`, which is NaN where `high` is infinite.
        if rank.fract() == 0.0 { low } else { low + rank.fract() * (high - low) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_lie_between_values() {
        let values = Percentiles::of([4.0, 1.0, 3.0, 2.0]);
        assert_eq!([values.at(0.0), values.at(50.0), values.at(100.0)], [1.0, 2.5, 4.0]);
        assert!((values.at(95.0) - 3.85).abs() < 1e-12);
        assert_eq!(Percentiles::of([]).at(50.0), 0.0);
    }

    /// A bake that is a tenth too bright everywhere, against a reference without noise.
    #[test]
    fn a_tenth_too_bright_is_a_tenth() {
        let point = |value: f64| Measured {
            value: DVec3::splat(1.1 * value),
            reference: DVec3::splat(value),
            standard_error: DVec3::ZERO,
        };
        let figures = SetFigures::of(&[point(1.0), point(2.0), point(3.0)]).unwrap();
        for part in [figures.bias, figures.mare, figures.mape, figures.p50, figures.p99] {
            assert!((part - 0.1).abs() < 1e-12, "{figures:?}");
        }
        assert!((figures.rrmse - 0.1 * (14.0_f64 / 3.0).sqrt() / 2.0).abs() < 1e-12);
        assert_eq!((figures.rrmse, figures.floor), (figures.rrmse_corr, 0.0));
    }

    #[test]
    fn black_against_black_is_no_error() {
        let black = Measured { value: DVec3::ZERO, reference: DVec3::ZERO, standard_error: DVec3::ZERO };
        let figures = SetFigures::of(&[black]).unwrap();
        assert_eq!((figures.rrmse, figures.bias, figures.p99), (0.0, 0.0, 0.0));
    }
}
