//! Averages of a texture over windows of any size: a box-filtered pyramid in linear light.
//!
//! Level by level, each cell holds the mean of up to four cells of the level below. A window is
//! averaged on the finest level on which it meets few cells, each cell weighted by the length and
//! width of the overlap. A window of whole cells is averaged exactly; otherwise the cells at its rim,
//! at most an eighth of its side, count as uniform. (L. Williams, "Pyramidal Parametrics", SIGGRAPH
//! 1983, with a box in place of trilinear interpolation.)

use glam::{DVec2, DVec3, Vec3};

/// Textures are kept at this many texels a side at most; finer detail is averaged when they are read.
const LARGEST_SIDE: usize = 2048;

/// The most cells that one average visits.
const MOST_CELLS: f64 = 64.0;

/// A window that spans so many repetitions of the texture shows its mean.
const MOST_REPETITIONS: f64 = 8.0;

/// What lies beyond a texture's edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wrap {
    /// The texture again.
    Repeat,
    /// The texture mirrored.
    Mirror,
    /// Its edge.
    Clamp,
}

/// A texture at all resolutions, linear RGB.
#[derive(Debug)]
pub(super) struct Pyramid {
    /// Texels of the image.
    width: usize,
    height: usize,
    /// Finest first; the last has a single cell.
    levels: Vec<Level>,
}

#[derive(Debug)]
struct Level {
    /// Texels of the image along a cell's side. Cells at the far edges are cut off there.
    side: usize,
    columns: usize,
    rows: usize,
    cells: Vec<Vec3>,
}

/// A rectangle on a texture, in texels from the upper left corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) centre: DVec2,
    pub(super) size: DVec2,
}

impl Pyramid {
    /// Builds the pyramid of an image of `width` by `height` texels, both at least 1.
    pub(super) fn new(width: usize, height: usize, texel: impl Fn(usize, usize) -> Vec3) -> Self {
        let mut side = 1;
        while width.max(height).div_ceil(side) > LARGEST_SIDE {
            side *= 2;
        }
        let mut level = Level::finest(width, height, side, texel);
        let mut levels = Vec::new();
        while level.columns * level.rows > 1 {
            let next = level.halved(width, height);
            levels.push(std::mem::replace(&mut level, next));
        }
        levels.push(level);
        Self { width, height, levels }
    }

    /// The image's size, texels.
    pub(super) fn size(&self) -> DVec2 {
        DVec2::new(self.width as f64, self.height as f64)
    }

    /// Whether every texel is the same, so that sampling is of no use.
    pub(super) fn is_uniform(&self) -> bool {
        self.levels.first().is_none_or(|level| level.cells.windows(2).all(|pair| pair[0] == pair[1]))
    }

    /// The mean of all texels.
    pub(super) fn mean(&self) -> DVec3 {
        let cell = self.levels.last().and_then(|level| level.cells.first());
        cell.copied().unwrap_or_default().as_dvec3()
    }

    /// The mean over `window`; a window that is not finite sees the mean of all.
    pub(super) fn average(&self, window: Window, wrap: [Wrap; 2]) -> DVec3 {
        let size = window.size.abs().min(MOST_REPETITIONS * self.size());
        let (first, last) = (window.centre - 0.5 * size, window.centre + 0.5 * size);
        if !(first.is_finite() && last.is_finite()) {
            return self.mean();
        }
        let visits = |level: &&Level| {
            let cells = size / level.side as f64 + 1.0;
            cells.x * cells.y <= MOST_CELLS
        };
        let Some(level) = self.levels.iter().find(visits).or(self.levels.last()) else { return DVec3::ZERO };
        let columns = Axis { length: self.width, side: level.side, count: level.columns, wrap: wrap[0] };
        let rows = Axis { length: self.height, side: level.side, count: level.rows, wrap: wrap[1] };

        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for (row, height) in columns_between(rows, first.y, last.y) {
            for (column, width) in columns_between(columns, first.x, last.x) {
                let weight = width * height;
                let cell = level.cells.get(row * level.columns + column).copied().unwrap_or_default();
                sum += weight * cell.as_dvec3();
                total += weight;
            }
        }
        if total > 0.0 { sum / total } else { self.mean() }
    }
}

impl Level {
    fn finest(width: usize, height: usize, side: usize, texel: impl Fn(usize, usize) -> Vec3) -> Self {
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
        let mut cells = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let xs = column * side..((column + 1) * side).min(width);
                let ys = row * side..((row + 1) * side).min(height);
                let count = (xs.len() * ys.len()) as f32;
                let sum: Vec3 =
                    ys.flat_map(|y| xs.clone().map(move |x| (x, y))).map(|(x, y)| texel(x, y)).sum();
                cells.push(sum / count);
            }
        }
        Self { side, columns, rows, cells }
    }

    /// The next level: cells of twice the side.
    fn halved(&self, width: usize, height: usize) -> Self {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        // What a cell covers of the image, which is less at the far edges.
        let span = |cell: usize, length: usize| ((cell + 1) * self.side).min(length) - cell * self.side;
        let mut cells = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let (mut sum, mut total) = (Vec3::ZERO, 0.0);
                for y in 2 * row..(2 * row + 2).min(self.rows) {
                    for x in 2 * column..(2 * column + 2).min(self.columns) {
                        let weight = span(x, width) as f32 * span(y, height) as f32;
                        sum += weight * self.cells.get(y * self.columns + x).copied().unwrap_or_default();
                        total += weight;
                    }
                }
                cells.push(sum / total);
            }
        }
        Self { side: 2 * self.side, columns, rows, cells }
    }
}

/// One axis of a level.
#[derive(Clone, Copy)]
struct Axis {
    /// Texels of the image.
    length: usize,
    /// Texels a cell.
    side: usize,
    /// Cells.
    count: usize,
    wrap: Wrap,
}

/// The cells along `axis` between two texel coordinates, each with the length of its overlap.
fn columns_between(axis: Axis, first: f64, last: f64) -> impl Iterator<Item = (usize, f64)> {
    let length = axis.length as f64;
    // Windows far out are moved near the image, so that steps stay representable.
    let shift = match axis.wrap {
        Wrap::Repeat => (first / length).floor() * length,
        Wrap::Mirror => (first / (2.0 * length)).floor() * 2.0 * length,
        Wrap::Clamp => 0.0,
    };
    let (mut first, mut last) = (first - shift, last - shift);
    if axis.wrap == Wrap::Clamp {
        (first, last) = (first.clamp(-length, 2.0 * length), last.clamp(-length, 2.0 * length));
    }
    // A point is a very narrow window.
    last = last.max(first + 1e-6 * length);
    let mut number = axis.number_at(first);
    let mut at = first;
    std::iter::from_fn(move || {
        if at >= last {
            return None;
        }
        let end = axis.end(number).min(last);
        let cell = (axis.cell(number), (end - at).max(0.0));
        at = at.max(end);
        number += 1;
        Some(cell)
    })
}

impl Axis {
    /// Cells are numbered on through the repetitions; this is the one that contains `x`.
    fn number_at(self, x: f64) -> i64 {
        let (length, side, count) = (self.length as f64, self.side as f64, self.count as i64);
        let cell_of = |x: f64| ((x / side).floor() as i64).clamp(0, count - 1);
        if self.wrap == Wrap::Clamp {
            return cell_of(x);
        }
        let period = (x / length).floor();
        let within = x - period * length;
        let reversed = self.wrap == Wrap::Mirror && period.rem_euclid(2.0) == 1.0;
        let cell = if reversed { count - 1 - cell_of(length - within) } else { cell_of(within) };
        period as i64 * count + cell
    }

    /// The index of cell `number` in the level.
    fn cell(self, number: i64) -> usize {
        let count = self.count as i64;
        let cell = match self.wrap {
            Wrap::Clamp => number.clamp(0, count - 1),
            _ if self.is_reversed(number) => count - 1 - number.rem_euclid(count),
            _ => number.rem_euclid(count),
        };
        cell as usize
    }

    /// Where cell `number` ends, texels.
    fn end(self, number: i64) -> f64 {
        let count = self.count as i64;
        if self.wrap == Wrap::Clamp && number >= count - 1 {
            return f64::INFINITY;
        }
        let cell = self.cell(number);
        let within = if self.is_reversed(number) {
            self.length - cell * self.side
        } else {
            ((cell + 1) * self.side).min(self.length)
        };
        number.div_euclid(count) as f64 * self.length as f64 + within as f64
    }

    fn is_reversed(self, number: i64) -> bool {
        self.wrap == Wrap::Mirror && number.div_euclid(self.count as i64).rem_euclid(2) == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells are single precision.
    const EXACT: f64 = 1e-6;

    /// A texture without symmetry.
    fn texel(x: usize, y: usize) -> Vec3 {
        let hash = (x * 7919 + y * 104_729) % 1009;
        Vec3::new(hash as f32 / 1009.0, x as f32, y as f32)
    }

    /// The same average, texel by texel, on a fine grid of points.
    fn by_points(size: [usize; 2], window: Window, wrap: [Wrap; 2]) -> DVec3 {
        const POINTS: usize = 240;
        let fold = |x: f64, length: usize, wrap| {
            let (x, length) = (x.floor() as i64, length as i64);
            let folded = match wrap {
                Wrap::Repeat => x.rem_euclid(length),
                Wrap::Clamp => x.clamp(0, length - 1),
                Wrap::Mirror => {
                    let x = x.rem_euclid(2 * length);
                    x.min(2 * length - 1 - x)
                }
            };
            folded as usize
        };
        let mut sum = DVec3::ZERO;
        for i in 0..POINTS {
            for j in 0..POINTS {
                let at = DVec2::new(i as f64 + 0.5, j as f64 + 0.5) / POINTS as f64 - 0.5;
                let p = window.centre + at * window.size;
                sum += texel(fold(p.x, size[0], wrap[0]), fold(p.y, size[1], wrap[1])).as_dvec3();
            }
        }
        sum / (POINTS * POINTS) as f64
    }

    #[test]
    fn the_mean_is_that_of_all_texels_whatever_the_size() {
        for (width, height) in [(1, 1), (2, 2), (7, 5), (64, 33), (1, 100)] {
            let pyramid = Pyramid::new(width, height, texel);
            let texels = (0..width * height).map(|i| texel(i % width, i / width).as_dvec3());
            let mean = texels.sum::<DVec3>() / (width * height) as f64;
            let error = (pyramid.mean() - mean).abs().max_element();
            assert!(error < 1e-4, "{width} x {height}: {error}");
        }
    }

    /// Small windows are averaged on the finest level and so exactly, at every wrap mode, on all sides.
    #[test]
    fn small_windows_are_exact() {
        let size = [7, 5];
        let pyramid = Pyramid::new(size[0], size[1], texel);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for centre in [(3.0, 2.0), (0.25, 4.5), (-3.0, 11.0), (16.0, -8.75)] {
                // Sides and centres for which the points of the grid never straddle a texel.
                let window = Window { centre: DVec2::new(centre.0, centre.1), size: DVec2::new(4.0, 2.0) };
                let expected = by_points(size, window, [wrap; 2]);
                let actual = pyramid.average(window, [wrap; 2]);
                let error = (actual - expected).abs().max_element();
                assert!(error < EXACT, "{wrap:?} at {centre:?}: {actual} instead of {expected}");
            }
        }
    }

    /// Whole cells of a coarser level are exact too; 32 by 32 texels are too many for the finest.
    #[test]
    fn large_windows_of_whole_cells_are_exact() {
        let pyramid = Pyramid::new(64, 64, texel);
        let window = Window { centre: DVec2::new(32.0, 16.0), size: DVec2::splat(32.0) };
        let texels = (0..32 * 32).map(|i| texel(16 + i % 32, i / 32).as_dvec3());
        let expected = texels.sum::<DVec3>() / (32.0 * 32.0);
        let error = (pyramid.average(window, [Wrap::Repeat; 2]) - expected).abs().max_element();
        assert!(error < 1e-4, "{error}");
    }

    /// Repeated over many periods, or infinitely large, a window sees the mean; a point sees its texel.
    #[test]
    fn extremes() {
        let pyramid = Pyramid::new(6, 3, texel);
        for wrap in [Wrap::Repeat, Wrap::Mirror] {
            for side in [1e3, 1e30, f64::INFINITY, f64::NAN] {
                let window = Window { centre: DVec2::new(1e6, -5.0), size: DVec2::splat(side) };
                let error = (pyramid.average(window, [wrap; 2]) - pyramid.mean()).abs().max_element();
                assert!(error < 1e-4, "{wrap:?} {side}: {error}");
            }
        }
        for (centre, expected) in
            [((4.5, 2.5), texel(4, 2)), ((-0.5, 0.5), texel(5, 0)), ((6.5, 3.5), texel(0, 0))]
        {
            let point = Window { centre: DVec2::new(centre.0, centre.1), size: DVec2::ZERO };
            let error = (pyramid.average(point, [Wrap::Repeat; 2]) - expected.as_dvec3()).abs().max_element();
            assert!(error < EXACT, "{centre:?}: {error}");
        }
        for centre in [1e300, -1e300, f64::NAN, f64::INFINITY] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                let window = Window { centre: DVec2::splat(centre), size: DVec2::ONE };
                assert!(pyramid.average(window, [wrap; 2]).is_finite(), "{wrap:?} {centre}");
            }
        }
    }

    #[test]
    fn large_images_are_reduced_without_changing_their_mean() {
        let stripes = |x: usize, _: usize| Vec3::splat(if x.is_multiple_of(2) { 0.0 } else { 1.0 });
        let pyramid = Pyramid::new(2 * LARGEST_SIDE, 3, stripes);
        assert_eq!(pyramid.levels[0].side, 2);
        assert!((pyramid.mean() - 0.5).abs().max_element() < EXACT);
        assert!(pyramid.is_uniform());
    }
}
