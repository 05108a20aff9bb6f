//! A logarithmic scale of colours, and its legend: the one place where pictures carry text.

use glam::DVec2;

use super::canvas::Canvas;
use super::colour_map::{VIRIDIS, shade};
use super::{Colour, INK, WHITE};

/// Pixels to the left and to the right of a legend, room for half a number.
const MARGIN: f64 = 32.0;
/// Pixels above a legend.
const TOP: f64 = 12.0;
/// The height of the strip of colours, pixels.
const BAR: f64 = 20.0;
/// The side of a glyph's dot, pixels.
const DOT: f64 = 2.0;
/// From one glyph to the next, dots.
const ADVANCE: f64 = 6.0;
/// What the numbers count.
const UNIT: &str = "texels per metre";

/// Texels per metre as colours: equal ratios are equal steps in viridis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DensityScale {
    low: f64,
    high: f64,
}

impl DensityScale {
    /// Height of [`legend`](Self::legend), pixels.
    pub(super) const LEGEND: u32 = 84;

    /// The scale from `low` to `high`, both moved out to round numbers, at least a factor of ten.
    pub(super) fn around(low: f64, high: f64) -> Self {
        let is_good = |x: f64| x.is_finite() && x > 0.0;
        if !is_good(low) || !is_good(high) {
            return Self { low: 1.0, high: 10.0 };
        }
        let widen = (10.0 * low / high).max(1.0).sqrt();
        let (low, high) = (low / widen, high * widen);
        let end = round_numbers(low / 10.0, high * 10.0);
        Self {
            low: end.iter().copied().filter(|&x| x <= low).fold(low / 10.0, f64::max),
            high: end.iter().copied().filter(|&x| x >= high).fold(f64::INFINITY, f64::min).min(high * 10.0),
        }
    }

    /// The colour of a density; what is beyond an end has the end's.
    pub(super) fn colour(&self, density: f64) -> Colour {
        shade(&VIRIDIS, self.share(density))
    }

    fn share(&self, density: f64) -> f64 {
        (density / self.low).ln() / (self.high / self.low).ln()
    }

    /// A strip of colours `width` pixels wide with its numbers, [`LEGEND`](Self::LEGEND) pixels high, RGB rows.
    pub(super) fn legend(&self, width: u32) -> Vec<u8> {
        let mut canvas = Canvas::new(width, Self::LEGEND, WHITE);
        let length = (f64::from(width) - 2.0 * MARGIN).max(1.0);
        let rectangle = |x: f64, y: f64, w: f64, h: f64| {
            [(x, y), (x + w, y), (x + w, y + h), (x, y + h)].map(DVec2::from)
        };
        for step in 0..length as u32 {
            let x = f64::from(step);
            canvas.fill(&rectangle(MARGIN + x, TOP, 1.0, BAR), shade(&VIRIDIS, x / length));
        }
        let below = TOP + BAR;
        let mut free = 0.0;
        for number in round_numbers(self.low, self.high) {
            let text = format!("{number}");
            let x = MARGIN + length * self.share(number);
            let wide = text_width(&text);
            let left = (x - wide / 2.0).min(f64::from(width) - wide).max(0.0);
            if left >= free {
                canvas.fill(&rectangle(x - 1.0, below, 2.0, 4.0), INK);
                write(&mut canvas, DVec2::new(left, below + 7.0), &text);
                free = left + wide + 2.0 * DOT * ADVANCE;
            }
        }
        let left = ((f64::from(width) - text_width(UNIT)) / 2.0).max(0.0);
        write(&mut canvas, DVec2::new(left, below + 25.0), UNIT);
        canvas.into_pixels()
    }
}

/// 1, 2 and 5 times the powers of ten from `low` to `high`.
fn round_numbers(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let slack = 1e-9;
    (first..=last)
        .flat_map(|power| [1.0, 2.0, 5.0].map(|digit| format!("{digit}e{power}").parse().unwrap_or(digit)))
        .filter(|&x| (low * (1.0 - slack)..=high * (1.0 + slack)).contains(&x))
        .collect()
}

fn text_width(text: &str) -> f64 {
    DOT * (ADVANCE * text.len() as f64 - 1.0)
}

/// Writes `text`, its top left corner at `at`.
fn write(canvas: &mut Canvas, at: DVec2, text: &str) {
    for (index, character) in text.chars().enumerate() {
        for (row, bits) in glyph(character).into_iter().enumerate() {
            for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                let dot = DVec2::new(ADVANCE * index as f64 + f64::from(column), row as f64);
                let corner = at + DOT * dot;
                let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|k| corner + DOT * k);
                canvas.fill(&corners, INK);
            }
        }
    }
}

/// A character as seven rows of five dots; blank for what legends have no need of.
#[rustfmt::skip]
fn glyph(character: char) -> [u8; 7] {
    match character {
        '0' => [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111],
        '3' => [0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
        '.' => [0, 0, 0, 0, 0, 0b01100, 0b01100],
        'e' => [0, 0, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110],
        'l' => [0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        'm' => [0, 0, 0b11010, 0b10101, 0b10101, 0b10001, 0b10001],
        'p' => [0, 0, 0b11110, 0b10001, 0b11110, 0b10000, 0b10000],
        'r' => [0, 0, 0b10110, 0b11001, 0b10000, 0b10000, 0b10000],
        's' => [0, 0, 0b01110, 0b10000, 0b01110, 0b00001, 0b11110],
        't' => [0b01000, 0b01000, 0b11100, 0b01000, 0b01000, 0b01001, 0b00110],
        'x' => [0, 0, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001],
        _ => [0; 7],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_have_round_ends_and_room() {
        let ends = |low, high| {
            let scale = DensityScale::around(low, high);
            (scale.low, scale.high)
        };
        assert_eq!(ends(3.0, 130.0), (2.0, 200.0));
        assert_eq!(ends(50.0, 50.0), (10.0, 200.0));
        assert_eq!(ends(0.0, 50.0), (1.0, 10.0));
        assert_eq!(ends(f64::NAN, f64::INFINITY), (1.0, 10.0));
    }

    #[test]
    fn equal_ratios_are_equal_steps() {
        let scale = DensityScale::around(1.0, 100.0);
        assert_eq!(scale.colour(10.0), shade(&VIRIDIS, 0.5));
        assert_eq!((scale.colour(0.0), scale.colour(1e9)), (scale.colour(1.0), scale.colour(100.0)));
    }

    #[test]
    fn every_character_of_a_legend_has_a_glyph() {
        let text = UNIT.chars().chain("0123456789.".chars()).filter(|c| *c != ' ');
        assert!(text.map(glyph).all(|rows| rows != [0; 7]));
        for width in [1, 40, 1024] {
            let pixels = DensityScale::around(0.2, 7000.0).legend(width);
            assert_eq!(pixels.len(), (width * DensityScale::LEGEND * 3) as usize);
        }
    }
}
