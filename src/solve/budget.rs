//! How finely reflected light is gathered: rounds, their rays, and the error that a scene affords.
//!
//! A simple room is lit to a sixth of a per cent in a second or two; a house at the same error would take minutes. So
//! a coarse round goes first, and what its places see tells how many rays each error would cost.

use super::hemisphere::Level;

/// How far a round goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// The standard error of a place's light that its rays may leave, as a fraction of the light there.
    pub noise: f64,
    /// The error in an element's middle that calls for a split, likewise.
    pub tolerance: f64,
}

impl Round {
    /// The first shows the last how light varies within patches.
    #[must_use]
    pub fn first(error: f64) -> Self {
        Self { noise: 4.0 * error, tolerance: 6.0 * error }
    }

    /// Follows light into narrow gaps, from one side to the other, after another round: elements stay as they are.
    #[must_use]
    pub fn in_gaps(after: Self) -> Self {
        Self { noise: 2.0 * after.noise, tolerance: f64::INFINITY }
    }

    /// Whether elements may be split.
    #[must_use]
    pub fn splits(&self) -> bool {
        self.tolerance.is_finite()
    }

    /// The last makes the light that the lightmap holds; its rays may leave this `error`.
    #[must_use]
    pub fn last(error: f64) -> Self {
        Self { noise: error, tolerance: 5.0 * error }
    }
}

/// Rays of an element go with its area to this power, for all errors together to be least: an error that falls with
/// the power 3/4 of the rays, squared, times the area.
const RAYS_BY_AREA: f64 = 0.4;

/// The error that calls for a split goes with the inverse of an element's side to this power.
const TOLERANCE_BY_SIZE: f64 = 0.5;

/// What of an element's error is let pass, in multiples of a [`Round`]'s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leniency {
    /// That rays leave.
    pub noise: f64,
    /// In the middle.
    pub tolerance: f64,
}

impl Leniency {
    /// None.
    pub const NONE: Self = Self { noise: 1.0, tolerance: 1.0 };

    /// For an element whose side is this many times as long as a patch's: the error on a small one is an error on few
    /// texels, and costs as much to mend. Half a patch has the round's.
    #[must_use]
    pub fn for_size(size: f64) -> Self {
        let smaller = 0.5 / size;
        Self {
            noise: smaller.powf(2.0 * RAYS_BY_AREA * 0.75).clamp(1.0, 2.8),
            tolerance: smaller.powf(TOLERANCE_BY_SIZE).clamp(0.5, 4.0),
        }
    }
}

/// The greatest error that is left where nobody says how much may be, as a fraction of the light.
pub const COARSEST: f64 = 0.008;

/// An error below this fraction of the greatest asks for another round before the last.
pub const MUCH_FINER: f64 = 0.25;

/// The least, likewise: an eye sees no less, and lightmaps interpolate no better.
const FINEST: f64 = 0.0015;

/// An error below the greatest costs no more rays than this, some two seconds of one core,
const AFFORDABLE_RAYS: f64 = 1e7;

/// and this many for each texel, since more texels show more of it.
const AFFORDABLE_RAYS_A_TEXEL: f64 = 100.0;

/// The number of places grows with this power of the tolerance's inverse.
const GROWTH: f64 = 0.4;

/// The least error that costs the last round no more than the affordable number of rays for a page of so many
/// `texels`, told by the `places` of a `round` before.
#[must_use]
pub fn affordable_error(places: &Contrasts, round: Round, texels: f64) -> f64 {
    let affordable = AFFORDABLE_RAYS + AFFORDABLE_RAYS_A_TEXEL * texels;
    let rays = |last: Round| (round.tolerance / last.tolerance).powf(GROWTH) * places.rays(last.noise);
    let steps = 32;
    let error = |step: i32| FINEST * (COARSEST / FINEST).powf(f64::from(step) / f64::from(steps));
    (0..steps).map(error).find(|&e| rays(Round::last(e)) <= affordable).unwrap_or(COARSEST)
}

/// How many places gathered, by the contrast of what they see.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contrasts([u64; Self::CLASSES]);

impl Contrasts {
    const CLASSES: usize = 32;

    /// Classes for each doubling.
    const FINENESS: f64 = 2.0;

    /// The class of contrast 1.
    const ONE: f64 = 16.0;

    /// Counts more places.
    pub(super) fn add(&mut self, contrast: f64, places: u64) {
        let class = (contrast.log2() * Self::FINENESS + Self::ONE).round();
        self.0[(class.max(0.0) as usize).min(Self::CLASSES - 1)] += places;
    }

    /// Adds those of another round.
    pub(super) fn add_all(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, n)| *sum += n);
    }

    /// The rays that bring the error of all places down to `noise`.
    fn rays(&self, noise: f64) -> f64 {
        let contrast = |class: usize| ((class as f64 - Self::ONE) / Self::FINENESS).exp2();
        self.0.iter().enumerate().map(|(c, &n)| n as f64 * level_for(contrast(c), noise).rays() as f64).sum()
    }
}

/// How many rays bring the error down to `noise` where single ones deviate by `contrast`: strata of the hemisphere
/// make it fall with the power of 3/4.
pub(super) fn level_for(contrast: f64, noise: f64) -> Level {
    Level::of((contrast / noise).powf(4.0 / 3.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(count: u64, contrast: f64) -> Contrasts {
        let mut places = Contrasts::default();
        places.add(contrast, count);
        places
    }

    #[test]
    fn what_many_places_afford_is_coarser() {
        let error = |count| affordable_error(&places(count, 0.5), Round::first(COARSEST), 0.0);
        let errors = [10, 3_000, 10_000, 30_000, 10_000_000].map(error);
        assert!(errors.windows(2).all(|e| e[0] <= e[1]), "{errors:?}");
        assert!((errors[0] - FINEST).abs() < 1e-9 && (errors[4] - COARSEST).abs() < 1e-9, "{errors:?}");
        assert!(errors[2] > FINEST && errors[2] < COARSEST, "{errors:?}");
    }

    #[test]
    fn the_affordable_error_costs_no_more_than_said() {
        let (places, round) = (places(10_000, 0.5), Round::first(0.004));
        let rays = |texels: f64| {
            let last = Round::last(affordable_error(&places, round, texels));
            (round.tolerance / last.tolerance).powf(GROWTH) * places.rays(last.noise)
        };
        for (texels, most) in [(0.0, AFFORDABLE_RAYS), (AFFORDABLE_RAYS / AFFORDABLE_RAYS_A_TEXEL, 2e7)] {
            let rays = rays(texels);
            assert!(rays <= most && rays > 0.3 * most, "{rays} of {most}");
        }
    }

    /// A quarter of the side is a sixteenth of the area: a third of the rays, and twice the tolerance.
    #[test]
    fn small_elements_are_let_pass_more() {
        let [half, eighth] = [0.5, 0.125].map(Leniency::for_size);
        assert_eq!(half, Leniency::NONE);
        assert!((eighth.tolerance - 2.0).abs() < 1e-9, "{eighth:?}");
        assert!((eighth.noise.powf(-4.0 / 3.0) - 16_f64.powf(-RAYS_BY_AREA)).abs() < 1e-9, "{eighth:?}");
        let (least, most) = (Leniency::for_size(10.0), Leniency::for_size(1e-9));
        assert!(least.noise == 1.0 && least.tolerance == 0.5, "{least:?}");
        assert!(most.noise < 3.0 && most.tolerance <= 4.0, "{most:?}");
    }

    #[test]
    fn places_are_counted_by_contrast() {
        let rays = |contrast: f64| level_for(contrast, 0.01).rays() as f64;
        let places = places(3, 0.25);
        assert!((places.rays(0.01) - 3.0 * rays(0.25)).abs() < 1e-9);
        assert!(rays(1.0) > rays(0.25));
    }
}
