//! LDR-FLIP: how different two pictures look to a person who flips between them.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström and M. D. Fairchild, "FLIP: A
//! Difference Evaluator for Alternating Images", Proceedings of the ACM on Computer Graphics and
//! Interactive Techniques 3(2), 2020; constants and borders as in NVIDIA's own implementation.
//!
//! The colour pipeline filters both pictures by the eye's contrast sensitivity (in YCxCz, a linear
//! opponent space) and takes the HyAB distance in Hunt-adjusted CIELab; the feature pipeline compares
//! edges and points in luminance. Per pixel, `FLIP = ΔE_c ^ (1 − ΔE_f)`, in `[0, 1]`.
//!
//! All filters are separable (or, for the blue-yellow channel, a sum of two that are), and are applied
//! in bands of rows, so that memory does not grow with the picture's height.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::picture::Colour;

/// Pixels in a degree of sight: 0.7 m before a 4K screen that is 0.7 m wide, as the paper has it.
pub const PIXELS_PER_DEGREE: f64 = 67.020_643_276_582_26;

/// Contrast sensitivity: amplitudes and widths of `a √(π/b) exp(−π² x² / b)` for the achromatic and the
/// red-green channel, and the two that sum up to the blue-yellow one (the paper's table 1).
const SENSITIVITY: [(f64, f64); 4] = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];

/// The widest of the above: three of its standard deviations are filtered over.
const WIDEST: f64 = 0.04;

/// The exponent of the colour difference.
const COLOUR_EXPONENT: f64 = 0.7;
/// Colour differences below this share of the largest fill `KNEE_VALUE` of the range.
const KNEE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;
/// Width of the feature detectors, degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// The exponent of the feature difference.
const FEATURE_EXPONENT: f64 = 0.5;

/// Rows that are made in one go.
const BAND: usize = 64;

/// XYZ of white (D65), which the opponent spaces are relative to.
const WHITE: DVec3 = DVec3::new(0.950_428_545, 1.0, 1.088_900_371);

/// sRGB's primaries in XYZ, a column each.
const TO_XYZ: DMat3 = DMat3::from_cols(
    DVec3::new(10_135_552.0 / 24_577_794.0, 2_613_072.0 / 12_288_897.0, 1_425_312.0 / 73_733_382.0),
    DVec3::new(8_788_810.0 / 24_577_794.0, 8_788_810.0 / 12_288_897.0, 8_788_810.0 / 73_733_382.0),
    DVec3::new(4_435_075.0 / 24_577_794.0, 887_015.0 / 12_288_897.0, 70_074_185.0 / 73_733_382.0),
);

/// FLIP of `test` against `reference`, pixel by pixel: rows of `width` sRGB pixels, top first.
///
/// A picture that has fewer pixels than the other, or no whole row, is compared as far as both go.
#[must_use]
pub fn flip(reference: &[Colour], test: &[Colour], width: usize, pixels_per_degree: f64) -> Vec<f32> {
    let height = reference.len().min(test.len()).checked_div(width).unwrap_or(0);
    let kernels = Kernels::new(pixels_per_degree);
    let largest = distance(hunt(DVec3::Y), hunt(DVec3::Z)).powf(COLOUR_EXPONENT);
    let bands: Vec<Vec<f32>> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let rows = band * BAND..height.min((band + 1) * BAND);
            let filter = |pixels| kernels.filter(&Rows { pixels, width, height }, rows.clone());
            let pairs = filter(reference).into_iter().zip(filter(test));
            pairs.map(|(a, b)| difference(a, b, largest) as f32).collect()
        })
        .collect();
    bands.concat()
}

/// A picture.
struct Rows<'a> {
    pixels: &'a [Colour],
    width: usize,
    height: usize,
}

/// What the filters make of a pixel.
#[derive(Clone, Copy)]
struct Seen {
    /// Hunt-adjusted CIELab.
    colour: DVec3,
    /// How much of an edge, and of a point or line, there is.
    edge: f64,
    point: f64,
}

/// Combines the two pipelines.
fn difference(a: Seen, b: Seen, largest: f64) -> f64 {
    let colour = distance(a.colour, b.colour).powf(COLOUR_EXPONENT);
    let knee = KNEE * largest;
    let colour = if colour < knee {
        colour * KNEE_VALUE / knee
    } else {
        KNEE_VALUE + (colour - knee) / (largest - knee) * (1.0 - KNEE_VALUE)
    };
    let feature = (a.edge - b.edge).abs().max((a.point - b.point).abs());
    let feature = (feature * std::f64::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
    colour.powf(1.0 - feature).clamp(0.0, 1.0)
}

/// City block in lightness, Euclidean in colour (Abasi, Tehran and Fairchild 2020).
fn distance(a: DVec3, b: DVec3) -> f64 {
    (a.x - b.x).abs() + (a.y - b.y).hypot(a.z - b.z)
}

/// CIELab of linear RGB, colourfulness scaled by lightness: dark colours look grey.
fn hunt(rgb: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let bend = |t: f64| {
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let xyz = TO_XYZ * rgb / WHITE;
    let lab = opponent(DVec3::new(bend(xyz.x), bend(xyz.y), bend(xyz.z)));
    DVec3::new(lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z)
}

/// YCxCz of XYZ relative to white; CIELab of the cube roots of it.
fn opponent(xyz: DVec3) -> DVec3 {
    DVec3::new(116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z))
}

/// YCxCz of an sRGB pixel.
fn ycxcz(pixel: Colour) -> DVec3 {
    let linear = pixel.map(|channel| {
        let value = f64::from(channel) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    });
    opponent(TO_XYZ * DVec3::from_array(linear) / WHITE)
}

/// Linear RGB of YCxCz, clamped to what a screen shows.
fn screen(ycxcz: DVec3, to_rgb: DMat3) -> DVec3 {
    let y = (ycxcz.x + 16.0) / 116.0;
    let xyz = DVec3::new(y + ycxcz.y / 500.0, y, y - ycxcz.z / 200.0) * WHITE;
    (to_rgb * xyz).clamp(DVec3::ZERO, DVec3::ONE)
}

/// One-dimensional filters, each of `2 × radius + 1` weights.
struct Kernels {
    /// As [`SENSITIVITY`].
    spatial: [Vec<f64>; 4],
    gaussian: Vec<f64>,
    first_derivative: Vec<f64>,
    second_derivative: Vec<f64>,
    to_rgb: DMat3,
}

impl Kernels {
    fn new(pixels_per_degree: f64) -> Self {
        let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let bell = |(a, b): (f64, f64)| {
            // The square root, since the two-dimensional filter is the product of two of these.
            let weight = (a * (PI / b).sqrt()).sqrt();
            weights(radius, |x| weight * (-PI * PI * (x / pixels_per_degree).powi(2) / b).exp())
        };
        let mut spatial = SENSITIVITY.map(bell);
        let [achromatic, red_green, blue, yellow] = &mut spatial;
        let sum = |kernel: &[f64]| kernel.iter().sum::<f64>();
        let (one, two) = (sum(achromatic), sum(red_green));
        let both = sum(blue).hypot(sum(yellow));
        for (kernel, whole) in [(achromatic, one), (red_green, two), (blue, both), (yellow, both)] {
            kernel.iter_mut().for_each(|weight| *weight /= whole);
        }
        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let radius = (3.0 * deviation).ceil() as i32;
        let bell = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        Self {
            spatial,
            gaussian: balanced(weights(radius, bell)),
            first_derivative: balanced(weights(radius, |x| -x * bell(x))),
            second_derivative: balanced(weights(radius, |x| {
                (x * x / (deviation * deviation) - 1.0) * bell(x)
            })),
            to_rgb: TO_XYZ.inverse(),
        }
    }

    /// Filters a band of rows; pixels beyond the picture are those at its edge.
    fn filter(&self, picture: &Rows, band: std::ops::Range<usize>) -> Vec<Seen> {
        let reach = self.spatial[0].len().max(self.gaussian.len()) / 2;
        let rows = band.start..band.end + 2 * reach;
        let row = |row: usize| row.saturating_sub(reach).min(picture.height.saturating_sub(1));
        let across: Vec<Vec<[f64; 7]>> = rows.map(|r| self.across(picture, row(r))).collect();
        let mut seen = Vec::with_capacity(band.len() * picture.width);
        for line in 0..band.len() {
            let Some(rows) = across.get(line..=line + 2 * reach) else { continue };
            for sums in self.down(rows, reach, picture.width) {
                let [y, cx, blue, yellow, dx, dy, ddx, ddy] = sums;
                let colour = hunt(screen(DVec3::new(y, cx, blue + yellow), self.to_rgb));
                seen.push(Seen { colour, edge: dx.hypot(dy), point: ddx.hypot(ddy) });
            }
        }
        seen
    }

    /// Filters rows that were filtered [`across`](Self::across) down to the one in their middle: the four
    /// spatial channels, then luminance's first derivative across and down, and its second.
    fn down(&self, rows: &[Vec<[f64; 7]>], reach: usize, width: usize) -> Vec<[f64; 8]> {
        let weight = |kernel: &[f64], k: usize| {
            let index = (k + kernel.len() / 2).checked_sub(reach);
            index.and_then(|index| kernel.get(index)).copied().unwrap_or(0.0)
        };
        let mut sums = vec![[0.0; 8]; width];
        for (k, row) in rows.iter().enumerate() {
            let [y, cx, blue, yellow] = self.spatial.each_ref().map(|kernel| weight(kernel, k));
            let gaussian = weight(&self.gaussian, k);
            let (first, second) = (weight(&self.first_derivative, k), weight(&self.second_derivative, k));
            let weights = [y, cx, blue, yellow, gaussian, first, gaussian, second];
            for (sum, &[y, cx, blue, yellow, dx, ddx, smooth]) in sums.iter_mut().zip(row) {
                let values = [y, cx, blue, yellow, dx, smooth, ddx, smooth];
                for ((sum, value), weight) in sum.iter_mut().zip(values).zip(weights) {
                    *sum += weight * value;
                }
            }
        }
        sums
    }

    /// One row filtered along itself: the four spatial kernels, then luminance by the first and the
    /// second derivative and by the Gaussian.
    fn across(&self, picture: &Rows, row: usize) -> Vec<[f64; 7]> {
        let start = row * picture.width;
        let line: Vec<DVec3> =
            picture.pixels[start..start + picture.width].iter().map(|&pixel| ycxcz(pixel)).collect();
        let luminance = |pixel: &DVec3| (pixel.x + 16.0) / 116.0;
        let [achromatic, red_green, blue, yellow] = &self.spatial;
        let columns = [
            along(&line, achromatic, |pixel| pixel.x),
            along(&line, red_green, |pixel| pixel.y),
            along(&line, blue, |pixel| pixel.z),
            along(&line, yellow, |pixel| pixel.z),
            along(&line, &self.first_derivative, luminance),
            along(&line, &self.second_derivative, luminance),
            along(&line, &self.gaussian, luminance),
        ];
        (0..line.len()).map(|x| columns.each_ref().map(|column| column[x])).collect()
    }
}

/// A channel of a row filtered along it; beyond its ends it goes on as it ends.
fn along(line: &[DVec3], kernel: &[f64], value: impl Fn(&DVec3) -> f64) -> Vec<f64> {
    let radius = kernel.len() / 2;
    let last = line.len().saturating_sub(1);
    let padded: Vec<f64> = (0..line.len() + 2 * radius)
        .map(|x| line.get(x.saturating_sub(radius).min(last)).map_or(0.0, &value))
        .collect();
    let sum = |window: &[f64]| window.iter().zip(kernel).map(|(value, weight)| value * weight).sum();
    padded.windows(kernel.len()).map(sum).collect()
}

fn weights(radius: i32, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|x| weight(f64::from(x))).collect()
}

/// Scales the positive weights so that they sum to 1, and the negative ones to −1.
fn balanced(mut kernel: Vec<f64>) -> Vec<f64> {
    let above: f64 = kernel.iter().filter(|w| **w > 0.0).sum();
    let below: f64 = -kernel.iter().filter(|w| **w < 0.0).sum::<f64>();
    kernel.iter_mut().for_each(|w| *w /= if *w > 0.0 { above } else { below.max(f64::MIN_POSITIVE) });
    kernel
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: u32 = 96;
    const HEIGHT: u32 = 80;

    /// Gradients and a checkerboard; the second with stripes, a darker part and a shift.
    fn pictures() -> [Vec<Colour>; 2] {
        let pixels = (0..WIDTH * HEIGHT).map(|i| (i % WIDTH, i / WIDTH));
        let check = |x: u32, y: u32| if (x / 12 + y / 10).is_multiple_of(2) { 200 } else { 40 };
        let low = |value: u32| (value % 256) as u8;
        let first = pixels.clone().map(|(x, y)| [low(2 * x + y), low(3 * y), check(x, y)]);
        let second = pixels.map(|(x, y)| {
            let green = low(3 * y) / if x > 60 { 2 } else { 1 };
            [low(2 * x + y + x * y % 23), green, check(x, y + 3)]
        });
        [first.collect(), second.collect()]
    }

    /// Figures of NVIDIA's implementation for the same pictures (C++, version 1.2, through the crate
    /// nv-flip 0.1.2). It works in single precision.
    #[test]
    fn agrees_with_the_authors_implementation() {
        const WITHIN: f64 = 2e-4;
        let [first, second] = pictures();
        let found = flip(&first, &second, WIDTH as usize, 67.02064);
        let mean = found.iter().map(|&f| f64::from(f)).sum::<f64>() / found.len() as f64;
        assert!((mean - 0.423_471_6).abs() < WITHIN, "{mean}");
        for ((x, y), expected) in [
            ((0, 0), 0.016_652_84),
            ((95, 79), 0.963_652_8),
            ((48, 40), 0.218_928_08),
            ((70, 20), 0.272_366_46),
            ((12, 9), 0.315_485_15),
            ((61, 77), 0.890_605_5),
        ] {
            let value = f64::from(found[(y * WIDTH + x) as usize]);
            assert!((value - expected).abs() < WITHIN, "({x}, {y}): {value}, not {expected}");
        }
    }

    #[test]
    fn a_picture_is_like_itself() {
        let [first, _] = pictures();
        assert!(flip(&first, &first, WIDTH as usize, PIXELS_PER_DEGREE).iter().all(|&f| f == 0.0));
        let (black, white) = ([[0; 3]; 4], [[255; 3]; 4]);
        assert!(flip(&black, &white, 2, PIXELS_PER_DEGREE).iter().all(|&f| f > 0.9));
        assert!(flip(&black, &white, 0, PIXELS_PER_DEGREE).is_empty());
    }
}
