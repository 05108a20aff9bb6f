//! Cutting surfaces into parts of one spacing each.
//!
//! A part costs its error (squared error times area) and a price for each texel that its chart takes with
//! the gap beside it. A part is cut in two where that makes it cheaper; whether it does is asked from the
//! finest cuts upward, since one cut may pay only together with the next.

use glam::DVec2;
use rayon::prelude::*;

use super::lines::KnownLine;
use super::survey::Surveys;
use super::{Cell, DensityOptions, LEVELS, SurfaceSurvey};
use crate::geom::polygon::{clip_triangle, rectangle, signed_area};
use crate::surface::Surface;
use crate::unwrap::Part;

/// Cuts that are tried along each side of a part, at most.
const CUTS: usize = 24;

/// Known lines that are tried along each side, at most.
const KNOWN_CUTS: usize = 12;

/// Other cuts that come closer to a known line than this fraction of the way between two of them are left out.
const LEAST_APART: f64 = 0.02;

/// Cuts into cuts.
const DEEPEST: u32 = 24;

/// What a chart costs beside its texels, in texels: the vertices that cutting adds.
const CHART: f64 = 12.0;

/// Spacings that are tried within a halving.
const STEPS: usize = 2;

/// Spacings that are tried in all.
const SPACINGS: usize = STEPS * LEVELS;

/// Trees are cut as would pay at this fraction of the expected price.
const SPARE: f64 = 0.2;

/// No texel is longer than this many times its width: along an edge that is all but parallel to an axis light
/// is not quite even.
const MOST_SLENDER: f64 = 16.0;

/// Rectangles of more cells than this are cut side by side.
const PARALLEL_CELLS: usize = 256;

/// Searches for the price that fills the page.
const TRIES: u32 = 30;

/// All surfaces' parts, together of as many texels as the options allow.
pub(super) fn cut(surfaces: &[Surface], surveys: &Surveys, options: DensityOptions) -> Vec<Part> {
    let most = surveys.surfaces.iter().map(total_error).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut price = SPARE * surveys.price.clamp(1e-16 * most, most);
    let mut leaves;
    loop {
        // At a lower price than will be paid there are more cuts than needed.
        let forest = Forest::new(surveys, options, price);
        (price, leaves) = forest.within(options.texels, (1e-16 * most, most));
        if price >= forest.price || price <= 1e-15 * most {
            break;
        }
        // With more cuts texels go farther, and the price will be higher than that.
        price *= 0.5;
    }
    let parts = leaves.into_iter().zip(surfaces).enumerate();
    parts.flat_map(|(index, (leaves, surface))| parts_of(index, surface, &leaves)).collect()
}

/// The trees of all surfaces.
struct Forest<'a> {
    surveys: &'a Surveys,
    options: DensityOptions,
    /// Cuts were made that pay at this price.
    price: f64,
    trees: Vec<Tree>,
}

impl<'a> Forest<'a> {
    fn new(surveys: &'a Surveys, options: DensityOptions, price: f64) -> Self {
        let tree = |survey| Cutter::new(survey, price, options).tree();
        Self { surveys, options, price, trees: surveys.surfaces.par_iter().map(tree).collect() }
    }

    /// The cheapest leaves at a price.
    fn pruned(&self, price: f64) -> Vec<Vec<Leaf>> {
        let of = |(tree, survey): (&Tree, _)| tree.pruned(&Cutter::new(survey, price, self.options));
        self.trees.par_iter().zip(&self.surveys.surfaces).map(of).collect()
    }

    /// The leaves that take at most so many texels, and nearly as many, and their price.
    fn within(&self, texels: f64, (least, most): (f64, f64)) -> (f64, Vec<Vec<Leaf>>) {
        let (mut low, mut high) = (least.ln(), most.ln());
        let mut best = None;
        let mut middle = (self.price / SPARE).ln().clamp(low, high);
        for attempt in 0..TRIES {
            let leaves = self.pruned(middle.exp());
            let taken = leaves.iter().flatten().map(|l| l.texels).sum::<f64>();
            tracing::debug!(price = middle.exp(), taken, "cut");
            if taken <= texels {
                high = middle;
                best = Some(leaves);
                if taken > 0.985 * texels {
                    break;
                }
            } else {
                low = middle;
            }
            // Texels go with about the -0.6th power of the price.
            let towards = middle + 1.7 * (taken / (0.992 * texels)).ln();
            // Where they jump with the price, guesses creep; halving does not.
            let is_useful = attempt % 3 != 2 && towards > low && towards < high;
            middle = if is_useful { towards } else { 0.5 * (low + high) };
        }
        (high.exp(), best.unwrap_or_else(|| self.pruned(most)))
    }
}

fn total_error(survey: &SurfaceSurvey) -> f64 {
    let of = |cell: &Cell| {
        let energy: f32 = cell.energy.iter().flatten().sum();
        (cell.max - cell.min).element_product() * f64::from(energy)
    };
    survey.cells.iter().map(of).sum()
}

/// The leaves that hold something of the surface, as parts.
///
/// What nobody sees was not surveyed. A leaf of which that is the most takes no more texels for it than were counted.
fn parts_of(index: usize, surface: &Surface, leaves: &[Leaf]) -> Vec<Part> {
    let is_whole = leaves.len() == 1;
    let part = |leaf: &Leaf| {
        let outline = rectangle(leaf.min, leaf.max).to_vec();
        let (mut area, mut low, mut high) = (0.0, DVec2::INFINITY, DVec2::NEG_INFINITY);
        for &triangle in surface.regions.iter().flat_map(|r| &r.triangles) {
            let ring = clip_triangle(triangle, &outline);
            area += signed_area(&ring).abs();
            (low, high) = ring.iter().fold((low, high), |(low, high), &p| (low.min(p), high.max(p)));
        }
        let weight = leaf.count / (high - low).max(leaf.spacing * leaf.count);
        (is_whole || area > 0.0).then_some(Part { surface: index, outline, weight })
    };
    leaves.iter().filter_map(part).collect()
}

/// A part of a surface that is not cut further.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    min: DVec2,
    max: DVec2,
    spacing: DVec2,
    /// Texels along either axis.
    count: DVec2,
    /// That its chart takes, with the gap beside it.
    texels: f64,
    /// Error and price.
    cost: f64,
}

/// A rectangle and how it may be cut.
struct Tree {
    min: DVec2,
    max: DVec2,
    sum: Sum,
    cut: Option<Box<[Tree; 2]>>,
}

impl Tree {
    /// The cheapest leaves that the cuts allow.
    fn pruned(&self, cutter: &Cutter) -> Vec<Leaf> {
        let mut leaves = Vec::new();
        self.prune(cutter, &mut leaves);
        leaves
    }

    /// Adds the cheapest leaves and returns what they cost.
    fn prune(&self, cutter: &Cutter, leaves: &mut Vec<Leaf>) -> f64 {
        let whole = cutter.leaf((self.min, self.max), &self.sum);
        let before = leaves.len();
        let of_sides =
            self.cut.as_ref().map(|sides| sides.iter().map(|s| s.prune(cutter, leaves)).sum::<f64>());
        match of_sides {
            Some(cost) if cost < whole.cost => cost,
            _ => {
                leaves.truncate(before);
                leaves.push(whole);
                whole.cost
            }
        }
    }
}

/// The spacings of a rectangle along one axis.
struct Choices {
    /// The error at each,
    error: [f64; SPACINGS],
    /// and the texels that it takes.
    texels: [f64; SPACINGS],
    /// The widest and the narrowest that may be.
    first: usize,
    last: usize,
}

struct Cutter<'a> {
    survey: &'a SurfaceSurvey,
    price: f64,
    options: DensityOptions,
    /// The spacings that are tried, for either axis, metres.
    spacings: [[f64; SPACINGS]; 2],
}

impl<'a> Cutter<'a> {
    fn new(survey: &'a SurfaceSurvey, price: f64, options: DensityOptions) -> Self {
        let of = |base: f64| std::array::from_fn(|step| base * (-(step as f64) / STEPS as f64).exp2());
        Self { survey, price, options, spacings: survey.base.to_array().map(of) }
    }

    fn tree(&self) -> Tree {
        let SurfaceSurvey { min, max, .. } = *self.survey;
        let cells: Vec<&Cell> = self.survey.cells.iter().collect();
        self.grow((min, max), &cells, DEEPEST)
    }

    /// Cuts a rectangle that holds (parts of) `cells` while that may pay.
    fn grow(&self, (min, max): (DVec2, DVec2), cells: &[&Cell], depth: u32) -> Tree {
        let mut tree = Tree { min, max, sum: Sum::of(cells, min, max), cut: None };
        let whole = self.leaf((min, max), &tree.sum);
        let least = self.price * (CHART + self.chart_texels([1.0; 2]));
        if depth == 0 || whole.cost <= 2.0 * least {
            return tree;
        }
        let Some((axis, at)) = self.best_cut((min, max), cells, whole.cost + least) else { return tree };
        let (mut low_max, mut high_min) = (max, min);
        (low_max[axis], high_min[axis]) = (at, at);
        let side =
            |keep: &dyn Fn(&Cell) -> bool| cells.iter().filter(|c| keep(c)).copied().collect::<Vec<_>>();
        let (low, high) = (side(&|c| c.min[axis] < at), side(&|c| c.max[axis] > at));
        let grow_low = || self.grow((min, low_max), &low, depth - 1);
        let grow_high = || self.grow((high_min, max), &high, depth - 1);
        let (low, high) = if cells.len() > PARALLEL_CELLS {
            rayon::join(grow_low, grow_high)
        } else {
            (grow_low(), grow_high())
        };
        tree.cut = Some(Box::new([low, high]));
        tree
    }

    /// The axis and place of the cut after which the two sides, uncut, cost least; `None` if that is `limit` or more.
    fn best_cut(&self, (min, max): (DVec2, DVec2), cells: &[&Cell], limit: f64) -> Option<(usize, f64)> {
        let mut best: Option<(f64, usize, f64)> = None;
        for axis in 0..2 {
            let known = known_lines(axis, (min, max), cells);
            let lines = self.lines(axis, (min[axis], max[axis]), &known);
            if lines.is_empty() {
                continue;
            }
            // What lies between one line and the next, then from either end to each line.
            let mut edges = vec![min[axis]];
            edges.extend(&lines);
            edges.push(max[axis]);
            let mut slabs = vec![Sum::default(); edges.len() - 1];
            for cell in cells {
                let first = edges.partition_point(|&e| e <= cell.min[axis]).max(1) - 1;
                for (slab, edge) in slabs.iter_mut().zip(edges.windows(2)).skip(first) {
                    if edge[0] >= cell.max[axis] {
                        break;
                    }
                    let (mut low, mut high) = (min, max);
                    (low[axis], high[axis]) = (edge[0], edge[1]);
                    slab.add(cell, low, high);
                }
            }
            // What breaks where two of them meet is in neither.
            let mut breaks = vec![Sum::default(); edges.len()];
            for line in &known {
                let at = edges.partition_point(|&e| e < line.at);
                cells.iter().for_each(|cell| breaks[at].add_line(cell, line, (min, max)));
            }
            let mut below = vec![slabs[0]];
            for (slab, at_edge) in slabs.iter().zip(&breaks).skip(1) {
                let sum = below[below.len() - 1].and(at_edge).and(slab);
                below.push(sum);
            }
            let mut above = Sum::default();
            for k in (0..lines.len()).rev() {
                above = slabs[k + 1].and(&breaks[k + 2]).and(&above);
                let (mut low_max, mut high_min) = (max, min);
                (low_max[axis], high_min[axis]) = (lines[k], lines[k]);
                let cost =
                    self.leaf((min, low_max), &below[k]).cost + self.leaf((high_min, max), &above).cost;
                if cost < best.map_or(limit, |b| b.0) {
                    best = Some((cost, axis, lines[k]));
                }
            }
        }
        best.map(|(_, axis, at)| (axis, at))
    }

    /// Where a stretch may be cut: at the `known` lines, and at the surveyed cells' dyadic edges, as fine as leaves not
    /// too many of them.
    fn lines(&self, axis: usize, (low, high): (f64, f64), known: &[KnownLine]) -> Vec<f64> {
        let (origin, base) = (self.survey.min[axis], self.survey.base[axis]);
        let mut step = base;
        while (high - low) / step < 0.5 * CUTS as f64 && step > base * 0.5_f64.powi(LEVELS as i32 - 4) {
            step *= 0.5;
        }
        let step = if (high - low) / step > CUTS as f64 {
            step * ((high - low) / step / CUTS as f64).ceil()
        } else {
            step
        };
        let first = ((low - origin) / step + 0.01).floor() as i64 + 1;
        let last = ((high - origin) / step - 0.01).ceil() as i64 - 1;
        let is_apart = |p: &f64| known.iter().all(|line| (line.at - p).abs() > LEAST_APART * step);
        let dyadic = (first..=last).map(|k| origin + k as f64 * step).filter(is_apart);
        let mut lines: Vec<f64> = dyadic.chain(known.iter().map(|line| line.at)).collect();
        lines.sort_by(f64::total_cmp);
        lines
    }

    /// A rectangle as one part, at its best spacing.
    fn leaf(&self, (min, max): (DVec2, DVec2), sum: &Sum) -> Leaf {
        let none = Leaf { min, max, spacing: max - min, count: DVec2::ONE, texels: 0.0, cost: 0.0 };
        let extent = sum.max - sum.min;
        if !extent.is_finite() || extent.min_element() <= 0.0 {
            return none;
        }
        let [across, down] = [self.choices(0, extent.x, sum), self.choices(1, extent.y, sum)];
        let cost = |[x, y]: [usize; 2]| {
            let (width, height) = (self.spacings[0][x], self.spacings[1][y]);
            let is_slender = (x < across.last && width > MOST_SLENDER * height)
                || (y < down.last && height > MOST_SLENDER * width);
            if is_slender {
                return f64::INFINITY;
            }
            let chart = self.chart_texels([across.texels[x], down.texels[y]]);
            across.error[x] + down.error[y] + self.price * (CHART + chart)
        };
        let least = |best: (f64, [usize; 2]), step: [usize; 2]| {
            let cost = cost(step);
            if cost < best.0 { (cost, step) } else { best }
        };
        let mut best = (f64::INFINITY, [across.first, down.first]);
        for k in 0..=(across.last - across.first).max(down.last - down.first) {
            best = least(best, [(across.first + k).min(across.last), (down.first + k).min(down.last)]);
        }
        for _ in 0..2 {
            let before = best.1;
            let y = before[1];
            best = (across.first..=across.last).fold(best, |best, x| least(best, [x, y]));
            let x = best.1[0];
            best = (down.first..=down.last).fold(best, |best, y| least(best, [x, y]));
            if best.1 == before {
                break;
            }
        }
        let (cost, step) = best;
        let count = DVec2::new(across.texels[step[0]], down.texels[step[1]]);
        Leaf { min, max, spacing: extent / count, count, texels: self.chart_texels(count.to_array()), cost }
    }

    /// The spacings that a rectangle so long along an axis, metres, may have.
    fn choices(&self, axis: usize, extent: f64, sum: &Sum) -> Choices {
        const LAST: usize = SPACINGS - 1;
        let spacings = &self.spacings[axis];
        let mut texels = [0.0; SPACINGS];
        for (texels, spacing) in texels.iter_mut().zip(spacings) {
            // As `round`, which is slow where the processor is not known to have it.
            *texels = f64::from((extent / spacing + 0.5) as u32).max(1.0);
        }
        // No spacing is wider than the part, none narrower than was looked at (an edge that seemed to run along
        // an axis may not), and none so narrow that the chart is longer than the page.
        let first = spacings.partition_point(|&s| s > 1.5 * extent).min(LAST);
        let longest = texels.partition_point(|&t| t <= self.options.longest).saturating_sub(1);
        let last = longest.min(STEPS * sum.levels[axis]).clamp(first, LAST);
        Choices { error: sum.errors(axis), texels, first, last }
    }

    /// Texels that a chart takes with the gap beside it.
    fn chart_texels(&self, [width, height]: [f64; 2]) -> f64 {
        let around = f64::from(1 + self.options.gutter);
        (width + around) * (height + around)
    }
}

/// The error in a rectangle at each spacing.
#[derive(Clone, Copy, Debug)]
struct Sum {
    /// The bounding rectangle of what was summed.
    min: DVec2,
    max: DVec2,
    /// What each halving changes, times area.
    energy: [[f64; LEVELS]; 2],
    /// The most halvings that were looked at.
    levels: [usize; 2],
}

/// The known lines across a rectangle that the most error is due to, one for each place along the axis.
fn known_lines(axis: usize, (min, max): (DVec2, DVec2), cells: &[&Cell]) -> Vec<KnownLine> {
    let mut found: Vec<(f64, KnownLine)> = Vec::new();
    for cell in cells.iter().filter(|cell| !cell.lines.is_empty()) {
        let area = (cell.max.min(max) - cell.min.max(min)).max(DVec2::ZERO).element_product();
        let rows = cell.energy[axis].iter().zip(&cell.smooth[axis]);
        let due = area * rows.map(|(&whole, &smooth)| f64::from(whole - smooth).max(0.0)).sum::<f64>();
        if due == 0.0 {
            continue;
        }
        for line in cell.lines.iter().filter(|line| line.cuts(axis, (min[axis], max[axis]))) {
            let due = due * share(cell, axis, |other| other == line);
            match found.iter_mut().find(|(_, known)| known.at == line.at) {
                Some((sum, _)) => *sum += due,
                None => found.push((due, *line)),
            }
        }
    }
    found.retain(|(due, _)| *due > 0.0);
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.at.total_cmp(&b.1.at)));
    found.truncate(KNOWN_CUTS);
    found.into_iter().map(|(_, line)| line).collect()
}

/// The share of a cell's lines along one axis that are meant; all are thought to be alike.
fn share(cell: &Cell, axis: usize, is_meant: impl Fn(&KnownLine) -> bool) -> f64 {
    let beside = |line: &&KnownLine| {
        line.axis == axis && line.from < cell.max[1 - axis] && line.to > cell.min[1 - axis]
    };
    let (mut all, mut meant) = (0_u32, 0_u32);
    for line in cell.lines.iter().filter(beside) {
        all += 1;
        meant += u32::from(is_meant(line));
    }
    if all == 0 { 1.0 } else { f64::from(meant) / f64::from(all) }
}

impl Default for Sum {
    fn default() -> Self {
        Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY, energy: Default::default(), levels: [0; 2] }
    }
}

impl Sum {
    fn of(cells: &[&Cell], min: DVec2, max: DVec2) -> Self {
        let mut sum = Self::default();
        cells.iter().for_each(|cell| sum.add(cell, min, max));
        sum
    }

    /// Adds what of a cell lies between `min` and `max`.
    fn add(&mut self, cell: &Cell, min: DVec2, max: DVec2) {
        let (low, high) = (cell.min.max(min), cell.max.min(max));
        // Cells beside the rectangle reach into it by rounding errors.
        if (high - low).cmple(1e-6 * (cell.max - cell.min)).any() {
            return;
        }
        let area = (high - low).element_product();
        self.levels = [0, 1].map(|axis| self.levels[axis].max(cell.levels[axis]));
        self.min = self.min.min(low);
        self.max = self.max.max(high);
        for axis in 0..2 {
            let broken = share(cell, axis, |line| line.cuts(axis, (min[axis], max[axis])));
            let rows = cell.energy[axis].iter().zip(&cell.smooth[axis]);
            for (sum, (&whole, &smooth)) in self.energy[axis].iter_mut().zip(rows) {
                *sum += area * (f64::from(smooth) + broken * f64::from(whole - smooth));
            }
        }
    }

    /// Adds what of a cell's error is due to a line, from `min` to `max`.
    fn add_line(&mut self, cell: &Cell, line: &KnownLine, (min, max): (DVec2, DVec2)) {
        let area = (cell.max.min(max) - cell.min.max(min)).max(DVec2::ZERO).element_product();
        let area = area * share(cell, line.axis, |other| other == line);
        let rows = cell.energy[line.axis].iter().zip(&cell.smooth[line.axis]);
        for (sum, (&whole, &smooth)) in self.energy[line.axis].iter_mut().zip(rows) {
            *sum += area * f64::from(whole - smooth);
        }
    }

    fn and(&self, other: &Self) -> Self {
        let mut sum = *self;
        sum.min = sum.min.min(other.min);
        sum.max = sum.max.max(other.max);
        sum.levels = [0, 1].map(|axis| sum.levels[axis].max(other.levels[axis]));
        for (sum, more) in sum.energy.iter_mut().flatten().zip(other.energy.iter().flatten()) {
            *sum += more;
        }
        sum
    }

    /// The error along an axis at each of the spacings that are tried: all that finer halvings would change.
    fn errors(&self, axis: usize) -> [f64; SPACINGS] {
        let mut finer = 0.0;
        let mut errors = [0.0; SPACINGS];
        for (errors, energy) in errors.chunks_exact_mut(STEPS).zip(&self.energy[axis]).rev() {
            let before = finer;
            finer += energy;
            // Half way between two halvings lies the geometric mean.
            errors[0] = finer;
            errors[1] = (finer * before.max(0.25 * finer)).sqrt();
        }
        errors
    }
}
