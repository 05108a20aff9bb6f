//! Where the texels are: charts coloured by their texels per metre, on the page and over the scene.

use glam::DVec2;

use super::scale::DensityScale;
use super::view::View;
use super::{Cell, Colour, INK, Line, MeshDrawing, PictureError, Subject, png};
use crate::geom::Ring;
use crate::geom::polygon::clip_triangle;
use crate::raster::sites;
use crate::unwrap::Chart;

/// Texels of the page that no lookup touches.
const GUTTER: Colour = [24, 24, 28];

/// Small pages are magnified to about this side, pixels.
const PAGE: u32 = 1024;

/// The scale leaves out this share of the area at its coarse end, of the texels at its fine end: charts are as
/// dense as you like where a whole texel is more than they need.
const BEYOND: f64 = 0.005;

/// A border's ends lie this near a chart's outline, metres over the outline's size.
const ON_BORDER: f64 = 1e-9;

/// A convex piece of a surface, shown by one chart.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Index of the chart.
    pub(super) chart: usize,
    /// Counter-clockwise, plane coordinates.
    pub(super) ring: Ring,
}

/// A bake's charts with the colours of their densities.
pub(super) struct Densities<'a> {
    pub(super) subject: Subject<'a>,
    /// Chart by chart; together all surfaces.
    pub(super) pieces: Vec<Piece>,
    /// A colour a chart.
    pub(super) colours: Vec<Colour>,
    pub(super) scale: DensityScale,
}

impl<'a> Densities<'a> {
    pub(super) fn of(subject: Subject<'a>) -> Self {
        let charts = &subject.atlas.charts;
        let mut pieces = Vec::new();
        // Density, area, texels.
        let mut shares: Vec<(f64, f64, f64)> = Vec::with_capacity(charts.len());
        for (index, chart) in charts.iter().enumerate() {
            let triangles = subject.surfaces[chart.surface].regions.iter().flat_map(|r| &r.triangles);
            let rings = triangles.map(|&t| clip_triangle(t, &chart.outline)).filter(|ring| ring.len() > 2);
            let first = pieces.len();
            pieces.extend(rings.map(|ring| Piece { chart: index, ring }));
            let area: f64 = pieces[first..].iter().map(|p| crate::geom::polygon::signed_area(&p.ring)).sum();
            let density = density(chart);
            shares.push((density, area, area * density * density));
        }
        shares.sort_by(|a, b| a.0.total_cmp(&b.0));
        let low = quantile(shares.iter().map(|s| (s.0, s.1)), BEYOND);
        let high = quantile(shares.iter().map(|s| (s.0, s.2)), 1.0 - BEYOND);
        let scale = DensityScale::around(low, high.max(low));
        let colours = charts.iter().map(|chart| scale.colour(density(chart))).collect();
        Self { subject, pieces, colours, scale }
    }

    /// The page: each texel that lookups touch in its chart's colour.
    pub(super) fn page_png(&self) -> Result<Vec<u8>, PictureError> {
        let atlas = self.subject.atlas;
        let times = (PAGE / atlas.width.max(atlas.height).max(1)).max(1);
        let (width, height) = (atlas.width as usize, atlas.height as usize);
        let mut page = vec![GUTTER; width * height];
        for site in sites(self.subject.surfaces, atlas, &|_, _| true) {
            page[site.y as usize * width + site.x as usize] = self.colours[site.chart as usize];
        }
        let row = |y: usize| page[y * width..][..width].iter().flat_map(|texel| vec![*texel; times as usize]);
        let mut pixels: Vec<u8> =
            (0..height * times as usize).flat_map(|y| row(y / times as usize)).flatten().collect();
        let (width, height) = (atlas.width * times, atlas.height * times);
        pixels.extend(self.scale.legend(width));
        png::encode(&pixels, (width, height + DensityScale::LEGEND))
    }

    /// A surface in plan, its charts in their colours and their borders in ink.
    pub(super) fn plan_png(&self, surface: usize) -> Result<Vec<u8>, PictureError> {
        let charts = &self.subject.atlas.charts;
        let mine = self.pieces.iter().filter(|piece| charts[piece.chart].surface == surface);
        let line = |(from, to)| Line { from, to, colour: INK, width: 1.0 };
        let borders = mine.clone().flat_map(|piece| {
            let outline = &charts[piece.chart].outline;
            edges(&piece.ring).filter(move |&edge| edges(outline).any(|side| is_on(side, edge)))
        });
        let rings = self.subject.surfaces[surface].rings.iter().flat_map(|ring| edges(ring));
        let drawing = MeshDrawing {
            lines: borders.chain(rings).map(line).collect(),
            cells: mine
                .map(|piece| Cell { corners: piece.ring.clone(), fill: self.colours[piece.chart] })
                .collect(),
            outline: None,
            ..MeshDrawing::default()
        };
        let (mut pixels, (width, height)) = drawing.pixels();
        pixels.extend(self.scale.legend(width));
        png::encode(&pixels, (width, height + DensityScale::LEGEND))
    }

    /// The whole scene, coloured by density and lit by its lightmap, side by side.
    pub(super) fn scene_png(&self) -> Result<Vec<u8>, PictureError> {
        let (mut pixels, (width, height)) = View::of(self).pixels(self);
        pixels.extend(self.scale.legend(width));
        png::encode(&pixels, (width, height + DensityScale::LEGEND))
    }
}

/// Texels per metre: the geometric mean of those along both axes.
fn density(chart: &Chart) -> f64 {
    chart.texel_from_plane.matrix2.determinant().abs().sqrt()
}

/// The value, of ascending ones with their weights, below which `share` of the weight lies.
fn quantile(values: impl Iterator<Item = (f64, f64)> + Clone, share: f64) -> f64 {
    let mut left = share * values.clone().map(|v| v.1).sum::<f64>();
    let mut last = 0.0;
    for (value, weight) in values {
        last = value;
        left -= weight;
        if left <= 0.0 {
            break;
        }
    }
    last
}

fn edges(ring: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + Clone {
    ring.iter().copied().zip(ring.iter().copied().cycle().skip(1))
}

/// Whether an edge lies on a side of an outline.
fn is_on((from, to): (DVec2, DVec2), edge: (DVec2, DVec2)) -> bool {
    let along = to - from;
    let off = |p: DVec2| along.perp_dot(p - from).abs();
    off(edge.0).max(off(edge.1)) <= ON_BORDER * along.length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_go_by_weight() {
        let values = [(1.0, 1.0), (2.0, 98.0), (3.0, 1.0)];
        let at = |share| quantile(values.into_iter(), share);
        assert_eq!([at(0.005), at(0.02), at(0.5), at(0.995)], [1.0, 2.0, 2.0, 3.0]);
        assert_eq!(quantile(std::iter::empty(), 0.5), 0.0);
    }

    #[test]
    fn borders_lie_on_outlines() {
        let side = (DVec2::ZERO, DVec2::new(4.0, 0.0));
        assert!(is_on(side, (DVec2::new(1.0, 0.0), DVec2::new(2.0, 1e-10))));
        assert!(!is_on(side, (DVec2::new(1.0, 0.0), DVec2::new(2.0, 1e-3))));
    }
}
