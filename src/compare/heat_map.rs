//! A page of errors as a picture.
//!
//! Black is no error, pale yellow the scale's end or more, in the "magma" colour map of N. Smith and
//! S. van der Walt (2015, CC0), in which equal steps look equal. Blue-grey texels hold no surface that is seen; green
//! ones a surface that the other bake lacks.

use super::CompareError;
use super::figures::Percentiles;
use super::page::{PageLight, TexelLight};
use crate::picture::{Colour, encode_rgb, shade};

/// The scale ends at the first round number above this percentile of the errors.
const SCALE_PERCENTILE: f64 = 99.0;

/// The shortest scale: what differs less than this looks black.
const LEAST_SCALE: f64 = 1e-3;

const EMPTY: Colour = [62, 70, 84];
const UNMATCHED: Colour = [64, 200, 120];

/// Seventeen samples of the map, evenly apart.
const MAGMA: [[f64; 3]; 17] = [
    [0.001_462, 0.000_466, 0.013_866],
    [0.039_608, 0.031_090, 0.133_515],
    [0.113_094, 0.065_492, 0.276_784],
    [0.211_718, 0.061_992, 0.418_647],
    [0.316_654, 0.071_690, 0.485_380],
    [0.414_709, 0.110_431, 0.504_662],
    [0.512_831, 0.148_179, 0.507_648],
    [0.613_617, 0.181_811, 0.498_536],
    [0.716_387, 0.214_982, 0.475_290],
    [0.816_914, 0.255_895, 0.436_461],
    [0.904_281, 0.319_610, 0.388_137],
    [0.960_949, 0.418_323, 0.359_630],
    [0.986_700, 0.535_582, 0.382_210],
    [0.996_096, 0.653_659, 0.446_213],
    [0.996_898, 0.769_591, 0.534_892],
    [0.992_440, 0.884_330, 0.640_099],
    [0.987_053, 0.991_438, 0.749_504],
];

/// A heat map of a comparison.
#[derive(Clone, Debug)]
pub struct HeatMap {
    /// The picture, one pixel a texel of the first bake's page.
    pub png: Vec<u8>,
    /// The error that the brightest colour stands for (and all above it): a fraction of the texel's
    /// brightness in the first bake.
    pub scale: f64,
}

impl HeatMap {
    /// Draws the errors of a page; texels darker than `darkest` count as that bright.
    pub(super) fn of(page: &PageLight, darkest: f64) -> Result<Self, CompareError> {
        let errors: Vec<Option<f64>> = page.errors(darkest).collect();
        let high = Percentiles::of(errors.iter().copied().flatten()).at(SCALE_PERCENTILE);
        let scale = round_up(high.max(LEAST_SCALE));
        let colour = |(error, texel): (&Option<f64>, &TexelLight)| match (error, texel) {
            (Some(error), _) => magma(error / scale),
            (None, TexelLight::Unmatched(_)) => UNMATCHED,
            (None, _) => EMPTY,
        };
        let pixels: Vec<u8> = errors.iter().zip(&page.texels).flat_map(colour).collect();
        Ok(Self { png: encode_rgb(&pixels, (page.width, page.height))?, scale })
    }
}

/// The least of 1, 2 and 5 times a power of ten that is not below `value`, a positive number.
fn round_up(value: f64) -> f64 {
    if !value.is_finite() {
        return 1.0;
    }
    let power = 10.0_f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|step| step * power).find(|&s| s >= value).unwrap_or(10.0 * power)
}

/// The colour of `share` of the scale.
fn magma(share: f64) -> Colour {
    shade(&MAGMA, share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_round() {
        assert_eq!([0.0012, 0.002, 0.3, 7.0].map(round_up), [0.002, 0.002, 0.5, 10.0]);
        assert_eq!(round_up(f64::INFINITY), 1.0);
    }

    #[test]
    fn more_is_brighter() {
        let luma = |[r, g, b]: Colour| 2126 * u32::from(r) + 7152 * u32::from(g) + 722 * u32::from(b);
        let lumas: Vec<u32> = (0..=100).map(|i| luma(magma(f64::from(i) / 100.0))).collect();
        assert!(lumas.windows(2).all(|w| w[0] <= w[1]), "{lumas:?}");
        assert_eq!((magma(-1.0), magma(9.0)), (magma(0.0), magma(1.0)));
    }
}
