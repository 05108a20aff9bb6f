//! Sampling the light, finer where it needs it.
//!
//! Every surface begins with a grid of tiles. A tile's four quarters are each a candidate for a tile of
//! half the spacing; those go first whose finest samples change most for a sample more. Light that
//! something between an emitter and a quarter may hide or let through unseen between the samples counts
//! as such a change, until these are as close as texels of one density would be.

use std::sync::Arc;

use glam::{DAffine2, DMat2, DVec2, Vec3};
use rayon::prelude::*;

use super::detail::Grid;
use super::lines::{KnownLine, known_lines};
use super::{Cell, DensityOptions, Energy, LEVELS, SurfaceSurvey};
use crate::geom::polygon::rectangle;
use crate::raster::{CloserLook, Lighting, PointLight, Shadowing};
use crate::surface::Surface;
use crate::unwrap::Chart;

/// Cells along a tile's side, at most.
const TILE: usize = 8;

/// The first samples lie this many uniform texels apart.
const FIRST_SPACING: f64 = 4.0;

/// Shadows that fall between samples are looked for until these are this many uniform texels apart.
const BLIND_SPACING: f64 = 1.0;

/// The mean squared error that light in doubt is taken to hide, as a fraction of its square.
const DOUBT: f64 = 0.02;

/// Outlines are known lines if they hang over a surface no higher than this many uniform texels.
const LINE_REACH: f64 = 0.5;

/// Samples for each texel, at most: the cheaper they are the more,
const MOST_SAMPLES: f64 = 2.5;
/// and never fewer;
const LEAST_SAMPLES: f64 = 1.2;
/// between these so many for each emitter that they have to ask.
const SAMPLES_BY_EMITTERS: f64 = 10.0;

/// However few texels there are, so many samples are taken: a scene has to be looked at to be cut well.
const FEWEST_SAMPLES: f64 = 50_000.0;

/// How often it is decided anew where to look closer.
const ROUNDS: u32 = 10;

/// Samples are never closer than this many uniform texels.
const LEAST_SPACING: f64 = 1.0 / 64.0;

/// From one halving to the next the error falls at least by this: light that breaks,
const SLOWEST: f64 = 0.5;
/// and at most by this: light that bends.
const FASTEST: f64 = 1.0 / 16.0;

/// The surveys of all surfaces, in order.
pub(super) struct Surveys {
    pub surfaces: Vec<SurfaceSurvey>,
    pub samples: u64,
    /// The error that one sample more would find, about: squared irradiance times area.
    pub price: f64,
}

/// A rectangle of a surface, how finely it was looked at, and what was found.
struct Quarter {
    surface: usize,
    min: DVec2,
    max: DVec2,
    /// What is known of its tile, and which of the four it is, column and row.
    found: Arc<Found>,
    at: [usize; 2],
    /// Cells of the tile that it is a quarter of; also those of its own tile.
    cells: [usize; 2],
    /// Halvings so far, for either axis.
    levels: [usize; 2],
    energy: Energy,
    /// The same beside the known lines, and these.
    smooth: Energy,
    lines: Arc<[KnownLine]>,
    /// Mean squared error that shadows between the samples may hide.
    doubt: f64,
}

/// What a tile's samples told.
struct Found {
    /// Where they lie in the surface, for the finer tiles that share them.
    light: Vec<Option<Vec3>>,
    shadowing: Option<Shadowing>,
}

/// Looks at the light on all surfaces.
pub(super) fn survey(lighting: &Lighting, options: DensityOptions) -> Surveys {
    let surfaces = lighting.surfaces();
    let roots: Vec<Root> = surfaces.iter().map(|s| Root::of(s, options.uniform_texel)).collect();
    let lines = known_lines(surfaces, lighting.tracer(), LINE_REACH * options.uniform_texel);
    let blind_spacing = BLIND_SPACING * options.uniform_texel;
    let tiles: Vec<Tile> =
        roots.iter().enumerate().flat_map(|(k, root)| root.tiles(k, blind_spacing, &lines[k])).collect();
    let mut samples = 0;
    let mut look = |tiles: &[Tile]| -> Vec<Quarter> {
        samples += tiles.iter().map(Tile::samples).sum::<u64>();
        tiles.par_iter().map(|tile| tile.look(lighting)).collect::<Vec<_>>().into_iter().flatten().collect()
    };
    let mut quarters = look(&tiles);
    let by_cost = SAMPLES_BY_EMITTERS / (1 + lighting.emitters()) as f64;
    let budget = (by_cost.clamp(LEAST_SAMPLES, MOST_SAMPLES) * options.texels).max(FEWEST_SAMPLES) as u64;
    let mut left = budget;

    let mut price = 0.0;
    for round in 0..ROUNDS {
        let share = left / u64::from(ROUNDS - round);
        let is_candidate = |q: &Quarter| {
            q.worth() > 0.0
                && q.levels[0].max(q.levels[1]) + 1 < LEVELS
                && q.spacing().max_element() > LEAST_SPACING * options.uniform_texel
        };
        let (mut candidates, rest): (Vec<_>, Vec<_>) = quarters.into_iter().partition(is_candidate);
        quarters = rest;
        candidates.sort_by(|a, b| b.worth().total_cmp(&a.worth()));
        let affordable = affordable(&candidates, share);
        quarters.extend(candidates.split_off(affordable));
        price = candidates.last().map_or(price, Quarter::worth);
        let tiles: Vec<Tile> = candidates.iter().map(|q| q.tile(blind_spacing)).collect();
        left = left.saturating_sub(tiles.iter().map(Tile::samples).sum());
        quarters.extend(look(&tiles));
    }

    let mut found: Vec<SurfaceSurvey> = roots.iter().map(Root::survey).collect();
    for quarter in quarters {
        found[quarter.surface].cells.push(quarter.cell());
    }
    for survey in &mut found {
        survey.cells.sort_by(|a, b| a.min.y.total_cmp(&b.min.y).then(a.min.x.total_cmp(&b.min.x)));
    }
    tracing::debug!(samples, budget, cells = found.iter().map(|s| s.cells.len()).sum::<usize>(), "survey");
    Surveys { surfaces: found, samples, price }
}

/// How many of `quarters`, from the first, can be looked into with so many samples.
fn affordable(quarters: &[Quarter], samples: u64) -> usize {
    let mut sum = 0;
    quarters
        .iter()
        .take_while(|q| {
            sum += self::samples(q.cells);
            sum <= samples
        })
        .count()
}

/// A surface's first tiles.
struct Root {
    min: DVec2,
    max: DVec2,
    tiles: [usize; 2],
    cells: [usize; 2],
}

impl Root {
    fn of(surface: &Surface, uniform_texel: f64) -> Self {
        let (min, max) = surface.extent();
        let (mut tiles, mut cells) = ([1; 2], [2; 2]);
        for axis in 0..2 {
            let wanted = ((max - min)[axis] / (FIRST_SPACING * uniform_texel)).ceil();
            let wanted = if wanted.is_finite() { wanted.clamp(1.0, 4096.0) as usize } else { 1 };
            cells[axis] = wanted.next_power_of_two().clamp(2, TILE);
            tiles[axis] = wanted.div_ceil(TILE);
        }
        Self { min, max, tiles, cells }
    }

    fn tile_size(&self) -> DVec2 {
        (self.max - self.min) / DVec2::new(self.tiles[0] as f64, self.tiles[1] as f64)
    }

    fn tiles(&self, surface: usize, blind_spacing: f64, lines: &[KnownLine]) -> Vec<Tile> {
        let size = self.tile_size();
        if !size.is_finite() || size.min_element() <= 0.0 {
            return Vec::new();
        }
        let tile = |k: usize| {
            let at = DVec2::new((k % self.tiles[0]) as f64, (k / self.tiles[0]) as f64);
            let (min, max) = (self.min + at * size, self.min + (at + 1.0) * size);
            let (cells, levels) = (self.cells, self.cells.map(|c| c.ilog2() as usize));
            let lines = lines.iter().filter(|line| line.crosses(min, max)).copied().collect();
            Tile { surface, min, max, cells, levels, blind_spacing, lines, coarser: None }
        };
        (0..self.tiles[0] * self.tiles[1]).map(tile).collect()
    }

    fn survey(&self) -> SurfaceSurvey {
        SurfaceSurvey { min: self.min, max: self.max, base: self.tile_size(), cells: Vec::new() }
    }
}

/// Samples that a tile of so many cells takes.
fn samples(cells: [usize; 2]) -> u64 {
    ((cells[0] + 1) * (cells[1] + 1)) as u64
}

/// A grid of samples to be taken.
struct Tile {
    surface: usize,
    min: DVec2,
    max: DVec2,
    cells: [usize; 2],
    levels: [usize; 2],
    /// Shadows may hide between samples farther apart than this, metres.
    blind_spacing: f64,
    /// The known lines through it, or through the larger one that it is a part of.
    lines: Arc<[KnownLine]>,
    /// What it is looked at closer for, if there were coarser samples.
    coarser: Option<Coarser>,
}

/// What coarser samples told of a tile.
struct Coarser {
    energy: Energy,
    smooth: Energy,
    /// The tile that it is a quarter of.
    found: Arc<Found>,
    /// Which quarter of that.
    at: [usize; 2],
}

impl Tile {
    fn samples(&self) -> u64 {
        samples(self.cells)
    }

    /// Takes the samples.
    fn look(&self, lighting: &Lighting) -> Vec<Quarter> {
        let cells = DVec2::new(self.cells[0] as f64, self.cells[1] as f64);
        let scale = cells / (self.max - self.min);
        let chart = Chart {
            surface: self.surface,
            outline: rectangle(self.min, self.max).to_vec(),
            page: 0,
            texel_from_plane: DAffine2::from_mat2_translation(
                DMat2::from_diagonal(scale),
                DVec2::splat(0.5) - scale * self.min,
            ),
        };
        let size = (self.cells[0] as u32 + 1, self.cells[1] as u32 + 1);
        let look = match &self.coarser {
            None => lighting.at_centres(&chart, size, None),
            Some(coarser) => {
                let columns = self.cells[0] + 1;
                let nodes = 0..self.samples() as usize;
                let known: Vec<_> = nodes.map(|k| self.known(coarser, [k % columns, k / columns])).collect();
                let closer = CloserLook { light: &known, shadowing: coarser.found.shadowing.as_ref() };
                lighting.at_centres(&chart, size, Some(&closer))
            }
        };
        let centre =
            |light: &Option<PointLight>| light.and_then(|l| l.is_centre.then(|| l.irradiance.as_vec3()));
        let found = Found { light: look.light.iter().map(centre).collect(), shadowing: look.shadowing };
        let found = Arc::new(found);
        let lines: Vec<KnownLine> = self.lines.iter().filter_map(|line| self.in_cells(line, scale)).collect();
        let grid = Grid { cells: self.cells, light: &look.light, lines: &lines };
        (0..4).filter_map(|k| self.quarter(&grid, &found, [k % 2, k / 2])).collect()
    }

    /// A line that runs through it, in cells from the first node.
    fn in_cells(&self, line: &KnownLine, scale: DVec2) -> Option<KnownLine> {
        let cells = |axis: usize, p: f64| (p - self.min[axis]) * scale[axis];
        let KnownLine { axis, at, from, to } = *line;
        let (at, from, to) = (cells(axis, at), cells(1 - axis, from), cells(1 - axis, to));
        line.crosses(self.min, self.max).then_some(KnownLine { axis, at, from, to })
    }

    /// The light at a node that the coarser samples had, too. Whether something hides between them is no longer
    /// told by these.
    fn known(&self, coarser: &Coarser, [x, y]: [usize; 2]) -> Option<PointLight> {
        if x % 2 == 1 || y % 2 == 1 {
            return None;
        }
        let [column, row] = [0, 1].map(|axis| (coarser.at[axis] * self.cells[axis] + [x, y][axis]) / 2);
        let light = coarser.found.light[row * (self.cells[0] + 1) + column]?;
        Some(PointLight { irradiance: light.as_dvec3(), doubtful: 0.0, is_centre: true })
    }

    /// One of the four quarters; `None` where nothing of the surface lies in it.
    fn quarter(&self, grid: &Grid, found: &Arc<Found>, at: [usize; 2]) -> Option<Quarter> {
        let half = self.cells.map(|c| c / 2);
        let low = [at[0] * half[0], at[1] * half[1]];
        let high = [low[0] + half[0], low[1] + half[1]];
        let doubtful = grid.doubtful(low, high)?;
        let (mut energy, mut smooth) =
            self.coarser.as_ref().map(|c| (c.energy, c.smooth)).unwrap_or_default();
        for axis in 0..2 {
            // Coarser halvings are known from the tile that this one is a quarter of.
            let steps = if self.coarser.is_some() { 1 } else { self.levels[axis] };
            for step in 0..steps {
                let change = grid.energy(axis, 1 << step, low, high);
                energy[axis][self.levels[axis] - 1 - step] = change.whole as f32;
                smooth[axis][self.levels[axis] - 1 - step] = change.smooth as f32;
            }
        }
        let middle = 0.5 * (self.min + self.max);
        let pick = |low: DVec2, high: DVec2| {
            DVec2::new(if at[0] == 0 { low.x } else { high.x }, if at[1] == 0 { low.y } else { high.y })
        };
        let (min, max) = (pick(self.min, middle), pick(middle, self.max));
        let (surface, cells, levels) = (self.surface, self.cells, self.levels);
        let (found, lines) = (Arc::clone(found), Arc::clone(&self.lines));
        let mut quarter =
            Quarter { surface, min, max, found, at, cells, levels, energy, smooth, lines, doubt: 0.0 };
        if quarter.spacing().max_element() > self.blind_spacing {
            quarter.doubt = DOUBT * doubtful * doubtful;
        }
        Some(quarter)
    }
}

impl Quarter {
    fn size(&self) -> DVec2 {
        self.max - self.min
    }

    /// Between samples, metres.
    fn spacing(&self) -> DVec2 {
        2.0 * self.size() / DVec2::new(self.cells[0] as f64, self.cells[1] as f64)
    }

    /// The tile that looks closer.
    fn tile(&self, blind_spacing: f64) -> Tile {
        let Self { surface, min, max, at, cells, levels, energy, smooth, .. } = *self;
        let lines = Arc::clone(&self.lines);
        let coarser = Some(Coarser { energy, smooth, found: Arc::clone(&self.found), at });
        Tile { surface, min, max, cells, levels: levels.map(|l| l + 1), blind_spacing, lines, coarser }
    }

    /// What the last halving changed, and what may be hidden, for each sample that another one takes.
    fn worth(&self) -> f64 {
        let last = |axis: usize| f64::from(self.energy[axis][self.levels[axis] - 1]);
        self.size().element_product() * (last(0) + last(1) + self.doubt) / samples(self.cells) as f64
    }

    /// What was found, and what follows from it about finer halvings.
    fn cell(&self) -> Cell {
        let [energy, smooth] = [&self.energy, &self.smooth].map(|found| self.continued(found));
        let lines = Arc::clone(&self.lines);
        Cell { min: self.min, max: self.max, energy, smooth, lines, levels: self.levels }
    }

    /// What halvings changed, and will.
    fn continued(&self, found: &Energy) -> Energy {
        let mut energy = *found;
        let next = [0, 1].map(|axis| {
            let (row, level) = (&found[axis], self.levels[axis]);
            let last = f64::from(row[level - 1]);
            let before = level.checked_sub(2).map_or(0.0, |l| f64::from(row[l]));
            let ratio = if before > 0.0 { (last / before).clamp(FASTEST, SLOWEST) } else { 0.5 * SLOWEST };
            (ratio * last, ratio)
        });
        // Which way an edge runs is known no finer than it was looked at.
        let (most, ratio) = if next[0].0 > next[1].0 { next[0] } else { next[1] };
        for (row, &level) in energy.iter_mut().zip(&self.levels) {
            let mut value = most;
            for slot in row.iter_mut().skip(level) {
                *slot = value as f32;
                value *= ratio;
            }
        }
        energy
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of light that grows by one a metre along x, and by a hundred along y.
    fn samples_of(tile: &Tile) -> Vec<Option<Vec3>> {
        let [columns, rows] = tile.cells.map(|c| c + 1);
        let cell = (tile.max - tile.min) / DVec2::new(tile.cells[0] as f64, tile.cells[1] as f64);
        let at = |k: usize| tile.min + cell * DVec2::new((k % columns) as f64, (k / columns) as f64);
        (0..columns * rows).map(|k| Some(Vec3::splat(at(k).dot(DVec2::new(1.0, 100.0)) as f32))).collect()
    }

    #[test]
    fn nodes_that_a_tile_shares_with_the_coarser_one_are_handed_down() {
        let tile = |min, max, levels| Tile {
            surface: 0,
            min,
            max,
            cells: [8, 4],
            levels,
            blind_spacing: 1.0,
            lines: Arc::new([]),
            coarser: None,
        };
        let whole = tile(DVec2::new(2.0, 1.0), DVec2::new(18.0, 9.0), [3, 2]);
        let found = Arc::new(Found { light: samples_of(&whole), shadowing: None });
        let half = 0.5 * (whole.max - whole.min);
        for at in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let min = whole.min + half * DVec2::new(at[0] as f64, at[1] as f64);
            let quarter = tile(min, min + half, [4, 3]);
            let coarser = Coarser {
                energy: Energy::default(),
                smooth: Energy::default(),
                found: Arc::clone(&found),
                at,
            };
            let expected = samples_of(&quarter);
            let mut count = 0;
            for (k, expected) in expected.iter().enumerate() {
                let known = quarter.known(&coarser, [k % 9, k / 9]);
                count += usize::from(known.is_some());
                assert!(known.is_none_or(|l| Some(l.irradiance.as_vec3()) == *expected), "{at:?}, node {k}");
            }
            assert_eq!(count, 5 * 3, "every other node along either axis");
        }
    }
}
