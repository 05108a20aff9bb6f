//! Colours that stand for numbers.

use super::Colour;

/// Seventeen samples, evenly apart, of the "viridis" colour map of N. Smith and S. van der Walt (2015, CC0):
/// dark violet to yellow. Equal steps look equal, to the colour-blind and in grey too.
pub(super) const VIRIDIS: [[f64; 3]; 17] = [
    [0.267_004, 0.004_874, 0.329_415],
    [0.282_327, 0.094_955, 0.417_331],
    [0.278_826, 0.175_490, 0.483_397],
    [0.258_965, 0.251_537, 0.524_736],
    [0.229_739, 0.322_361, 0.545_706],
    [0.199_430, 0.387_607, 0.554_642],
    [0.172_719, 0.448_791, 0.557_885],
    [0.149_039, 0.508_051, 0.557_250],
    [0.127_568, 0.566_949, 0.550_556],
    [0.120_638, 0.625_828, 0.533_488],
    [0.157_851, 0.683_765, 0.501_686],
    [0.246_070, 0.738_910, 0.452_024],
    [0.369_214, 0.788_888, 0.382_914],
    [0.515_992, 0.831_158, 0.294_279],
    [0.678_489, 0.863_742, 0.189_503],
    [0.845_561, 0.887_322, 0.099_702],
    [0.993_248, 0.906_157, 0.143_936],
];

/// The colour of `share` of a map: 0 and less its first, 1 and more its last, between samples a mixture.
pub(crate) fn shade(map: &[[f64; 3]], share: f64) -> Colour {
    let last = map.len().saturating_sub(1);
    let place = share.clamp(0.0, 1.0) * last as f64;
    let get = |index: usize| map.get(index.min(last)).copied().unwrap_or_default();
    let (low, high) = (get(place as usize), get(place as usize + 1));
    std::array::from_fn(|k| (255.0 * (low[k] + place.fract() * (high[k] - low[k]))).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_brighter() {
        let luma = |[r, g, b]: Colour| 2126 * u32::from(r) + 7152 * u32::from(g) + 722 * u32::from(b);
        let lumas: Vec<u32> = (0..=100).map(|i| luma(shade(&VIRIDIS, f64::from(i) / 100.0))).collect();
        assert!(lumas.windows(2).all(|w| w[0] <= w[1]), "{lumas:?}");
        assert_eq!(shade(&VIRIDIS, -1.0), shade(&VIRIDIS, 0.0));
        assert_eq!(shade(&VIRIDIS, 9.0), [253, 231, 37]);
        assert_eq!(shade(&[], 0.5), [0; 3]);
    }
}
