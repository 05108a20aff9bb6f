//! Which surface point each texel stands for.
//!
//! Every texel that a bilinear lookup inside a chart can touch gets a site, so that no lookup
//! mixes in a texel that nobody computed. The site's point is the texel's centre where that lies
//! in an open region of the surface, else the nearest point of one: a region that lies buried
//! under a solid is dark, and must not darken the texels of the open region beside it. All
//! distances are measured in texels.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use crate::geom::Ring;
use crate::geom::polygon::{clip_triangle, nearest_on_segment, orient};
use crate::surface::Surface;
use crate::unwrap::footprint::{Span, spans};
use crate::unwrap::{Atlas, Chart};

/// A point this close to a region's boundary is moved inside by as much, texels. Small against
/// what a texel can show, large against rounding.
const MARGIN: f64 = 1.0 / 64.0;

/// The same at a cut, where something may hang over one side of it.
const CUT_MARGIN: f64 = 1.0 / 256.0;

/// How far from a texel's centre an open region is looked for, texels in each direction.
const OPEN_REACH: f64 = 1.5;

/// Texels that one task works on, about.
const TEXELS_PER_TASK: i64 = 1 << 15;

/// A texel and the surface point that it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelSite {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Index into [`Atlas::charts`].
    pub chart: u32,
    /// Index into the surface's [`regions`](Surface::regions).
    pub region: u32,
    /// A point inside that region, plane coordinates, metres.
    pub point: DVec2,
    /// How `point` relates to the texel's centre.
    pub position: SitePosition,
}

/// How a site's point relates to the texel's centre.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SitePosition {
    /// It is the centre, or where that is on an open region's edge, just inside.
    Centre,
    /// The centre is not in an open region; the point is the nearest that is.
    Moved,
    /// No open region is near; the point lies in a region that is buried.
    Buried,
}

/// The sites of all texels that bilinear lookups inside the charts touch.
///
/// `open_region` tells, for a surface's and a region's index, whether the region can be seen.
/// The sites come chart by chart, within a chart row by row, whatever the number of threads. No
/// two have the same texel. What lies outside the page is left out, as are charts without triangles.
pub fn sites(
    surfaces: &[Surface],
    atlas: &Atlas,
    open_region: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Vec<TexelSite> {
    let prepared: Vec<_> = atlas
        .charts
        .par_iter()
        .map(|chart| prepare(&surfaces[chart.surface], chart, (atlas.width, atlas.height)))
        .collect();
    let tasks: Vec<(usize, Range<i64>)> = prepared
        .iter()
        .enumerate()
        .flat_map(|(index, chart)| bands(&chart.window).map(move |rows| (index, rows)))
        .collect();
    let found: Vec<Vec<TexelSite>> = tasks
        .into_par_iter()
        .map(|(index, rows)| {
            let surface = atlas.charts[index].surface;
            band_sites(&prepared[index], index, rows, &|region| open_region(surface, region))
        })
        .collect();
    let mut sites = Vec::with_capacity(found.iter().map(Vec::len).sum());
    found.into_iter().for_each(|band| sites.extend(band));
    keep_one_per_texel(sites, atlas)
}

/// The sites of one chart alone in a page of `size` texels. See [`sites`].
pub(super) fn chart_sites(
    surface: &Surface,
    chart: &Chart,
    size: (u32, u32),
    is_open: &dyn Fn(usize) -> bool,
) -> Vec<TexelSite> {
    let prepared = prepare(surface, chart, size);
    let rows = prepared.window.min.1..prepared.window.max.1;
    band_sites(&prepared, 0, rows, is_open)
}

/// A chart's triangles in texel space.
struct TexelChart {
    triangles: Vec<TexelTriangle>,
    window: Window,
    plane_from_texel: glam::DAffine2,
}

struct TexelTriangle {
    region: u32,
    /// Counter-clockwise by [`orient`].
    corners: [DVec2; 3],
    /// How far points keep from the edge from corner `i` to the next, texels.
    margins: [f64; 3],
}

/// The texels from `min` up to and without `max`.
#[derive(Clone, Copy, Debug)]
struct Window {
    min: (i64, i64),
    max: (i64, i64),
}

/// The best point so far for a texel.
#[derive(Clone, Copy)]
struct Nearest {
    distance: f64,
    point: DVec2,
    triangle: u32,
}

const NONE_YET: Nearest = Nearest { distance: f64::INFINITY, point: DVec2::ZERO, triangle: 0 };

fn prepare(surface: &Surface, chart: &Chart, size: (u32, u32)) -> TexelChart {
    let mut triangles = Vec::new();
    for (region, r) in surface.regions.iter().enumerate() {
        let outer = boundary_edges(&r.triangles);
        let parts = r.triangles.iter().zip(outer).flat_map(|(&t, outer)| part_of(t, outer, &chart.outline));
        triangles.extend(parts.map(|(t, margins)| {
            let [a, b, c] = t.map(|p| chart.texel(p));
            if orient(a, b, c) >= 0.0 {
                TexelTriangle { region: region as u32, corners: [a, b, c], margins }
            } else {
                let margins = [margins[2], margins[1], margins[0]];
                TexelTriangle { region: region as u32, corners: [a, c, b], margins }
            }
        }));
    }
    let (low, high) = triangles
        .iter()
        .flat_map(|t| t.corners)
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let (low, high) = ((low - 1.5).floor(), (high + 1.5).ceil());
    let min = ((low.x as i64).max(0), (low.y as i64).max(0));
    let max = ((high.x as i64).min(i64::from(size.0)), (high.y as i64).min(i64::from(size.1)));
    let is_empty = min.0 >= max.0 || min.1 >= max.1;
    let window = if is_empty { Window { min: (0, 0), max: (0, 0) } } else { Window { min, max } };
    TexelChart { triangles, window, plane_from_texel: chart.texel_from_plane.inverse() }
}

/// What of a triangle with these outer edges lies in a chart's outline, as triangles with their edges' margins.
fn part_of(triangle: [DVec2; 3], outer: [bool; 3], outline: &Ring) -> Vec<([DVec2; 3], [f64; 3])> {
    let ring = clip_triangle(triangle, outline);
    let own = outer.map(|outer| if outer { MARGIN } else { 0.0 });
    if ring == triangle {
        return vec![(triangle, own)];
    }
    let fan = (2..ring.len()).map(|k| ([0, k - 1, k], [k == 2, true, k + 1 == ring.len()]));
    let margin = |a: DVec2, b: DVec2| {
        let middle = 0.5 * (a + b);
        let near = |&i: &usize| {
            let (from, to) = (triangle[i], triangle[(i + 1) % 3]);
            nearest_on_segment(from, to, middle).distance(middle) < 1e-9 * from.distance(to)
        };
        (0..3).find(near).map_or(CUT_MARGIN, |i| own[i])
    };
    fan.map(|(corners, is_edge)| {
        let t = corners.map(|k| ring[k]);
        let edge = |i: usize| if is_edge[i] { margin(t[i], t[(i + 1) % 3]) } else { 0.0 };
        (t, [0, 1, 2].map(edge))
    })
    .collect()
}

/// Which edges belong to one triangle only; a T-junction's edges count as such, which is harmless.
fn boundary_edges(triangles: &[[DVec2; 3]]) -> Vec<[bool; 3]> {
    let bits = |p: DVec2| (p.x.to_bits(), p.y.to_bits());
    let edge = |t: &[DVec2; 3], i: usize| (bits(t[i]), bits(t[(i + 1) % 3]));
    let mut edges: Vec<_> = triangles.iter().flat_map(|t| [0, 1, 2].map(|i| edge(t, i))).collect();
    edges.sort_unstable();
    let is_outer = |(from, to)| edges.binary_search(&(to, from)).is_err();
    triangles.iter().map(|t| [0, 1, 2].map(|i| is_outer(edge(t, i)))).collect()
}

/// Cuts a window into bands of rows.
fn bands(window: &Window) -> impl Iterator<Item = Range<i64>> + use<> {
    let Window { min, max } = *window;
    let rows = (TEXELS_PER_TASK / (max.0 - min.0).max(1)).max(1);
    let count = max.1 - min.1;
    (0..(count + rows - 1) / rows).map(move |k| {
        let first = min.1 + k * rows;
        first..(first + rows).min(max.1)
    })
}

/// One band of a chart.
struct Band<'a> {
    chart: &'a TexelChart,
    rows: Range<i64>,
    cells: Vec<Nearest>,
}

fn band_sites(
    chart: &TexelChart,
    index: usize,
    rows: Range<i64>,
    is_open: &dyn Fn(usize) -> bool,
) -> Vec<TexelSite> {
    let width = (chart.window.max.0 - chart.window.min.0) as usize;
    let covered = footprint(chart, &rows);
    let mut band = Band { chart, cells: vec![NONE_YET; covered.len()], rows: rows.clone() };
    let open: Vec<bool> = chart.triangles.iter().map(|t| is_open(t.region as usize)).collect();
    for (index, _) in open.iter().enumerate().filter(|&(_, &open)| open) {
        band.visit(index, OPEN_REACH, &covered);
    }
    let missing: Vec<bool> =
        covered.iter().zip(&band.cells).map(|(&covered, c)| covered && c.distance.is_infinite()).collect();
    if missing.contains(&true) {
        for index in 0..chart.triangles.len() {
            band.visit(index, 1.0, &missing);
        }
    }

    let mut sites = Vec::with_capacity(covered.iter().filter(|&&c| c).count());
    for (k, (cell, covered)) in band.cells.iter().zip(covered).enumerate() {
        let Some(triangle) = chart.triangles.get(cell.triangle as usize) else { continue };
        if !covered || cell.distance.is_infinite() {
            continue;
        }
        let position = match (open.get(cell.triangle as usize), cell.distance > 0.0) {
            (Some(true), false) => SitePosition::Centre,
            (Some(true), true) => SitePosition::Moved,
            _ => SitePosition::Buried,
        };
        sites.push(TexelSite {
            x: (chart.window.min.0 + (k % width) as i64) as u32,
            y: (rows.start + (k / width) as i64) as u32,
            chart: index as u32,
            region: triangle.region,
            point: chart.plane_from_texel.transform_point2(inside(triangle, cell.point)),
            position,
        });
    }
    sites
}

/// Which texels of the rows belong to the chart's footprint, row by row.
fn footprint(chart: &TexelChart, rows: &Range<i64>) -> Vec<bool> {
    let Window { min, max } = chart.window;
    let width = (max.0 - min.0) as usize;
    let mut covered = vec![false; width * (rows.end - rows.start) as usize];
    for triangle in &chart.triangles {
        for span in spans(triangle.corners, 1.0, (rows.start, rows.end)) {
            if let Some((row, columns)) = locate(&span, chart, rows) {
                covered[row * width..][columns].fill(true);
            }
        }
    }
    covered
}

/// A span's row and columns within a band; `None` if it lies outside.
fn locate(span: &Span, chart: &TexelChart, rows: &Range<i64>) -> Option<(usize, Range<usize>)> {
    let Window { min, max } = chart.window;
    let (first, last) = (span.first.max(min.0), span.last.min(max.0 - 1));
    let inside = first <= last && rows.contains(&span.y);
    inside.then(|| ((span.y - rows.start) as usize, (first - min.0) as usize..(last - min.0 + 1) as usize))
}

impl Band<'_> {
    /// Offers a triangle's points to the texels within `reach` of it that `wanted` marks.
    fn visit(&mut self, index: usize, reach: f64, wanted: &[bool]) {
        let Some(triangle) = self.chart.triangles.get(index) else { return };
        let Window { min, max } = self.chart.window;
        let width = (max.0 - min.0) as usize;
        for span in spans(triangle.corners, reach, (self.rows.start, self.rows.end)) {
            let Some((row, columns)) = locate(&span, self.chart, &self.rows) else { continue };
            let y = span.y as f64 + 0.5;
            for column in columns {
                let cell = &mut self.cells[row * width + column];
                if !wanted[row * width + column] || cell.distance == 0.0 {
                    continue;
                }
                let centre = DVec2::new((min.0 + column as i64) as f64 + 0.5, y);
                let point = nearest(&triangle.corners, centre);
                let distance = point.distance_squared(centre);
                // The first triangle wins a tie, so the order of the regions decides, not the threads.
                if distance < cell.distance {
                    *cell = Nearest { distance, point, triangle: index as u32 };
                }
            }
        }
    }
}

/// The triangle's point nearest to `p`.
fn nearest(&[a, b, c]: &[DVec2; 3], p: DVec2) -> DVec2 {
    if orient(a, b, p) >= 0.0 && orient(b, c, p) >= 0.0 && orient(c, a, p) >= 0.0 {
        return p;
    }
    let on_edges = [(a, b), (b, c), (c, a)].map(|(from, to)| nearest_on_segment(from, to, p));
    on_edges
        .into_iter()
        .fold(on_edges[0], |best, q| if q.distance_squared(p) < best.distance_squared(p) { q } else { best })
}

/// Moves a point of the triangle off the region's boundary and off cuts, by about their margins.
fn inside(triangle: &TexelTriangle, p: DVec2) -> DVec2 {
    let corners = triangle.corners;
    let edges = [0, 1, 2].map(|i| (corners[i], corners[(i + 1) % 3]));
    let near = |q: DVec2| {
        // Corners are on the boundary even where neither edge of this triangle is.
        edges.iter().zip(triangle.margins).any(|(&(a, b), margin)| {
            nearest_on_segment(a, b, q).distance(q) < 0.5 * margin || a.distance(q) < 0.5 * MARGIN
        })
    };
    if !near(p) {
        return p;
    }
    let mut pushed = p;
    for (&(a, b), margin) in edges.iter().zip(triangle.margins) {
        let along = (b - a).normalize_or_zero();
        let depth = along.perp_dot(pushed - a);
        if depth < margin {
            pushed += (margin - depth) * along.perp();
        }
    }
    let is_in = edges.iter().all(|&(a, b)| orient(a, b, pushed) > 0.0);
    if is_in && !near(pushed) {
        return pushed;
    }
    // A corner, or a triangle thinner than the margin: its middle is inside for certain.
    let to_middle = (corners[0] + corners[1] + corners[2]) / 3.0 - p;
    p + to_middle * (MARGIN / to_middle.length().max(MARGIN))
}

/// Where charts overlap, which no checked atlas does, the nearer site keeps the texel.
fn keep_one_per_texel(mut sites: Vec<TexelSite>, atlas: &Atlas) -> Vec<TexelSite> {
    let width = u64::from(atlas.width);
    let index = |s: &TexelSite| u64::from(s.y) * width + u64::from(s.x);
    let mut taken = vec![0u64; (width * u64::from(atlas.height)).div_ceil(64) as usize];
    let mut is_taken_twice = false;
    for site in &sites {
        let (word, bit) = ((index(site) / 64) as usize, 1u64 << (index(site) % 64));
        if let Some(word) = taken.get_mut(word) {
            is_taken_twice |= *word & bit != 0;
            *word |= bit;
        }
    }
    if !is_taken_twice {
        return sites;
    }
    let distance = |s: &TexelSite| {
        let centre = DVec2::new(f64::from(s.x), f64::from(s.y)) + 0.5;
        atlas.charts.get(s.chart as usize).map_or(f64::INFINITY, |c| c.texel(s.point).distance(centre))
    };
    sites.sort_by(|a, b| {
        index(a).cmp(&index(b)).then(distance(a).total_cmp(&distance(b))).then(a.chart.cmp(&b.chart))
    });
    sites.dedup_by_key(|s| index(s));
    sites.sort_by_key(|s| (s.chart, s.y, s.x));
    sites
}
