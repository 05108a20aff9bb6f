//! From linear light to a picture's pixels.
//!
//! The luminance is compressed by Reinhard's extended operator,
//!
//! ```text
//! L_d = L (1 + L / W²) / (1 + L)        L = exposure × luminance,  W the least L that becomes white
//! ```
//!
//! (E. Reinhard et al., "Photographic Tone Reproduction for Digital Images", SIGGRAPH 2002, eq. 4),
//! the ratio of the channels kept, then encoded as sRGB.

use glam::DVec3;

use super::Colour;

/// The share of the values that the exposure is set by: a few lamps may burn out.
const BRIGHT_SHARE: f64 = 0.98;

/// What the value at [`BRIGHT_SHARE`] becomes before compression. With `WHITE_POINT` it ends near 0.75.
const EXPOSED: f64 = 1.6;

/// `W` above.
const WHITE_POINT: f64 = 4.0;

/// Luminance of linear Rec. 709 primaries.
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// A mapping from linear RGB to pixels. Pictures made with the same one can be compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneMap {
    /// Factor on the linear values, above 0.
    pub exposure: f64,
}

impl ToneMap {
    /// The exposure that suits `values` (linear RGB of any unit): a high percentile of those above
    /// black becomes bright. Values that are not finite are left out; nothing above black gives 1.
    pub fn for_values(values: impl IntoIterator<Item = DVec3>) -> Self {
        let mut luminances: Vec<f64> =
            values.into_iter().map(|v| v.dot(LUMINANCE)).filter(|l| l.is_finite() && *l > 0.0).collect();
        if luminances.is_empty() {
            return Self { exposure: 1.0 };
        }
        let rank = ((luminances.len() - 1) as f64 * BRIGHT_SHARE) as usize;
        let (_, &mut bright, _) = luminances.select_nth_unstable_by(rank, f64::total_cmp);
        let exposure = EXPOSED / bright;
        Self { exposure: if exposure.is_finite() { exposure } else { 1.0 } }
    }

    /// The pixel for a linear RGB value. Negative and NaN channels are black.
    #[must_use]
    pub fn colour(&self, value: DVec3) -> Colour {
        let value = value.max(DVec3::ZERO) * self.exposure;
        let luminance = value.dot(LUMINANCE);
        if !luminance.is_finite() {
            return if luminance.is_nan() { [0; 3] } else { [255; 3] };
        }
        let compression = (1.0 + luminance / (WHITE_POINT * WHITE_POINT)) / (1.0 + luminance);
        (value * compression).to_array().map(srgb_byte)
    }
}

/// One channel as sRGB (IEC 61966-2-1).
pub(crate) fn srgb_byte(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brighter_is_never_darker_and_grey_stays_grey() {
        let tone = ToneMap::for_values((1..100).map(|i| DVec3::splat(f64::from(i))));
        let greys: Vec<_> = (0..1000).map(|i| tone.colour(DVec3::splat(f64::from(i)))).collect();
        assert!(greys.iter().all(|c| c[0] == c[1] && c[1] == c[2]));
        assert!(greys.windows(2).all(|w| w[0] <= w[1]));
        assert_eq!((greys[0], greys[999]), ([0; 3], [255; 3]));
        assert!((190..250).contains(&greys[97][0]), "the bright share is bright: {:?}", greys[97]);
    }

    #[test]
    fn the_unit_does_not_matter() {
        let values = |unit: f64| (1..50).map(move |i| DVec3::new(f64::from(i), 3.0, 2.0) * unit);
        let (lux, kilolux) = (ToneMap::for_values(values(1.0)), ToneMap::for_values(values(1e-3)));
        assert!(values(1.0).zip(values(1e-3)).all(|(a, b)| lux.colour(a) == kilolux.colour(b)));
    }

    #[test]
    fn odd_values_do_no_harm() {
        let odd = [DVec3::NAN, DVec3::INFINITY, DVec3::NEG_ONE, DVec3::ZERO];
        let tone = ToneMap::for_values(odd);
        assert_eq!(tone, ToneMap { exposure: 1.0 });
        assert_eq!(tone.colour(DVec3::NAN), [0; 3]);
        assert_eq!(tone.colour(DVec3::INFINITY), [255; 3]);
        assert_eq!(tone.colour(DVec3::NEG_ONE), [0; 3]);
    }
}
