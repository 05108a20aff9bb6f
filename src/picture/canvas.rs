//! Pixels to draw on, with antialiasing by 2 × 2 samples a pixel.

use glam::DVec2;

use super::Colour;

/// Samples a pixel in each direction.
pub(super) const SAMPLES: u32 = 2;

/// A picture in the making. Coordinates are pixels, `(0, 0)` the top left corner, `y` downward.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    width: u32,
    height: u32,
    samples: Vec<Colour>,
}

impl Canvas {
    /// A canvas of one colour.
    pub(super) fn new(width: u32, height: u32, paper: Colour) -> Self {
        let count = (width * SAMPLES) as usize * (height * SAMPLES) as usize;
        Self { width, height, samples: vec![paper; count] }
    }

    /// A canvas whose samples are what `colour` says of their columns and rows.
    pub(super) fn sampled(width: u32, height: u32, colour: impl Fn(u32, u32) -> Colour) -> Self {
        let (columns, rows) = (width * SAMPLES, height * SAMPLES);
        let samples = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        Self { width, height, samples: samples.map(|(x, y)| colour(x, y)).collect() }
    }

    /// Fills a polygon by the even-odd rule. Samples on an edge shared by two polygons go to one of them.
    pub(super) fn fill(&mut self, polygon: &[DVec2], colour: Colour) {
        let (low, high) = polygon
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.y), high.max(p.y)));
        let scale = f64::from(SAMPLES);
        let mut crossings = Vec::new();
        for row in range(low * scale, high * scale, self.height * SAMPLES) {
            let y = (f64::from(row) + 0.5) / scale;
            crossings.clear();
            for (i, &a) in polygon.iter().enumerate() {
                let b = polygon[(i + 1) % polygon.len()];
                if (a.y > y) != (b.y > y) {
                    crossings.push(scale * (a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y)));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let columns = range(pair[0], pair[1], self.width * SAMPLES);
                let start = row as usize * (self.width * SAMPLES) as usize;
                let span = start + columns.start as usize..start + columns.end as usize;
                if let Some(samples) = self.samples.get_mut(span) {
                    samples.fill(colour);
                }
            }
        }
    }

    /// Draws a line `width` pixels wide.
    pub(super) fn line(&mut self, (from, to): (DVec2, DVec2), width: f64, colour: Colour) {
        let along = (to - from).try_normalize().unwrap_or(DVec2::X) * 0.5 * width;
        let across = along.perp();
        self.fill(
            &[from - along - across, to + along - across, to + along + across, from - along + across],
            colour,
        );
    }

    /// The pixels as 8-bit RGB rows: the mean of each pixel's samples.
    pub(super) fn into_pixels(self) -> Vec<u8> {
        let stride = (self.width * SAMPLES) as usize;
        let step = SAMPLES as usize;
        let mut bytes = Vec::with_capacity(self.width as usize * self.height as usize * 3);
        for rows in self.samples.chunks_exact(stride * step) {
            for x in (0..stride).step_by(step) {
                let samples = (0..step * step).filter_map(|k| rows.get((k / step) * stride + x + k % step));
                let sum = samples.fold([0u32; 3], |sum, sample| {
                    [0, 1, 2].map(|channel| sum[channel] + u32::from(sample[channel]))
                });
                bytes.extend(sum.map(|s| ((s + SAMPLES) / (SAMPLES * SAMPLES)) as u8));
            }
        }
        bytes
    }
}

/// The samples whose centres lie from `low` up to and without `high`, of `count`.
fn range(low: f64, high: f64, count: u32) -> std::ops::Range<u32> {
    // `as` saturates, and takes NaN to 0.
    let first = (low - 0.5).ceil().max(0.0) as u32;
    let end = (high - 0.5).ceil().max(0.0) as u32;
    first.min(count)..end.min(count).max(first.min(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a pixel covered is half the colour; neighbours share no sample and leave no gap.
    #[test]
    fn coverage_is_the_share() {
        let mut canvas = Canvas::new(4, 2, [0; 3]);
        let rectangle = |x0: f64, x1: f64| {
            [DVec2::new(x0, 0.0), DVec2::new(x1, 0.0), DVec2::new(x1, 2.0), DVec2::new(x0, 2.0)]
        };
        canvas.fill(&rectangle(0.5, 1.5), [200; 3]);
        canvas.fill(&rectangle(1.5, 3.0), [100; 3]);
        let row: Vec<u8> = canvas.into_pixels().into_iter().step_by(3).take(4).collect();
        assert_eq!(row, [100, 150, 100, 0]);
    }

    #[test]
    fn odd_polygons_do_no_harm() {
        let mut canvas = Canvas::new(3, 3, [7; 3]);
        canvas.fill(&[], [1; 3]);
        canvas.fill(&[DVec2::NAN, DVec2::ONE, DVec2::INFINITY], [1; 3]);
        canvas.line((DVec2::new(-1e300, 1.0), DVec2::new(1e300, f64::NAN)), 1.0, [1; 3]);
        assert_eq!(canvas.into_pixels().len(), 27);
    }
}
