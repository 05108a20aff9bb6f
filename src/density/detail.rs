//! What finer samples tell that coarser ones did not.

use glam::DVec3;

use super::lines::KnownLine;
use crate::raster::PointLight;

/// The mean square of a hat of height 1 over its support.
const HAT: f64 = 1.0 / 3.0;

/// Light at the nodes of a grid of `cells[0] × cells[1]` cells, row by row.
pub(super) struct Grid<'a> {
    pub cells: [usize; 2],
    pub light: &'a [Option<PointLight>],
    /// Lines along which light breaks off, in cells from the first node.
    pub lines: &'a [KnownLine],
}

/// What finer samples tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Change {
    /// In all.
    pub whole: f64,
    /// Beside the known lines: what is left if charts end there.
    pub smooth: f64,
}

/// What is this close to a line, in cells, is on it.
const ON_LINE: f64 = 1e-6;

impl Grid<'_> {
    /// Mean squared error of linear interpolation between nodes `2 × step` cells apart along `axis`, told
    /// from the nodes between them, in the cells from `low` to `high`.
    pub(super) fn energy(&self, axis: usize, step: usize, low: [usize; 2], high: [usize; 2]) -> Change {
        let (mut sum, mut count) = (0.0, 0_u32);
        let (mut broken_sum, mut broken) = (0.0, 0_u32);
        let mut middle = step;
        while middle + step <= self.cells[axis] {
            if middle + step > low[axis] && middle - step < high[axis] {
                for across in low[1 - axis]..=high[1 - axis] {
                    let node = |along: usize| {
                        let at = if axis == 0 { [along, across] } else { [across, along] };
                        self.node(at)
                    };
                    if let (Some(a), Some(b), Some(c)) =
                        (node(middle - step), node(middle), node(middle + step))
                    {
                        let surplus = (b - 0.5 * (a + c)).length_squared() / 3.0;
                        sum += surplus;
                        count += 1;
                        if self.is_broken(axis, [middle - step, middle + step], across) {
                            broken_sum += surplus;
                            broken += 1;
                        }
                    }
                }
            }
            middle += 2 * step;
        }
        let mean = |sum: f64, count: u32| if count == 0 { 0.0 } else { HAT * sum / f64::from(count) };
        Change { whole: mean(sum, count), smooth: mean(sum - broken_sum, count - broken) }
    }

    /// Whether a known line runs between these two nodes of a row or column, or through one of them.
    fn is_broken(&self, axis: usize, [first, last]: [usize; 2], across: usize) -> bool {
        let reaches = |low: f64, high: f64, from: f64, to: f64| low - ON_LINE <= to && from <= high + ON_LINE;
        self.lines.iter().any(|line| {
            line.axis == axis
                && reaches(first as f64, last as f64, line.at, line.at)
                && reaches(across as f64, across as f64, line.from, line.to)
        })
    }

    /// The most light that may be hidden or let through in the cells unseen; `None` where they hold nothing of the
    /// surface.
    pub(super) fn doubtful(&self, low: [usize; 2], high: [usize; 2]) -> Option<f64> {
        let rows = (low[1]..=high[1]).map(|y| y * (self.cells[0] + 1));
        let nodes = rows.flat_map(|row| &self.light[row + low[0]..=row + high[0]]).flatten();
        nodes.map(|light| light.doubtful).reduce(f64::max)
    }

    fn node(&self, [x, y]: [usize; 2]) -> Option<DVec3> {
        self.light[y * (self.cells[0] + 1) + x].map(|l| l.irradiance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(light: impl Fn(f64, f64) -> f64) -> Vec<Option<PointLight>> {
        let at = |k: usize| light((k % 9) as f64 / 8.0, (k / 9) as f64 / 8.0);
        (0..81)
            .map(|k| Some(PointLight { irradiance: DVec3::splat(at(k)), doubtful: 0.0, is_centre: true }))
            .collect()
    }

    /// Linear interpolation of x² at spacing h misses h²/4 in the middle: a surplus that falls fourfold a halving.
    #[test]
    fn a_parabola_loses_a_sixteenth_of_its_energy_a_halving() {
        let light = grid(|x, _| x * x);
        let grid = Grid { cells: [8, 8], light: &light, lines: &[] };
        let coarse = grid.energy(0, 2, [0, 0], [8, 8]).whole;
        assert!((coarse - HAT * (0.25_f64 * 0.25).powi(2)).abs() < 1e-12, "{coarse}");
        assert!((grid.energy(0, 1, [0, 0], [8, 8]).whole - coarse / 16.0).abs() < 1e-12);
        assert_eq!(grid.energy(1, 1, [0, 0], [8, 8]), Change::default());
    }

    #[test]
    fn an_edge_is_where_it_is() {
        let light = grid(|x, _| f64::from(x > 0.7));
        let grid = Grid { cells: [8, 8], light: &light, lines: &[] };
        assert_eq!(grid.energy(0, 1, [0, 0], [4, 4]).whole, 0.0);
        assert!(grid.energy(0, 1, [4, 0], [8, 4]).whole > 0.0);
    }

    /// Between a line and the grid's side light is even; where the line ends, it is not.
    #[test]
    fn what_breaks_at_a_known_line_is_not_beside_it() {
        let light = grid(|x, y| f64::from(x > 0.7 && y < 0.51));
        let line = |to| [KnownLine { axis: 0, at: 5.6, from: 0.0, to }];
        let change =
            |lines: &[KnownLine]| Grid { cells: [8, 8], light: &light, lines }.energy(0, 1, [0, 0], [8, 8]);
        let (known, short, none) = (change(&line(4.0)), change(&line(3.0)), change(&[]));
        assert!(known.whole > 0.0 && known.smooth == 0.0, "{known:?}");
        assert!(short.smooth > 0.0 && short.smooth < short.whole, "{short:?}");
        assert!(none.smooth == none.whole && none.whole == known.whole, "{none:?}");
    }
}
