//! Making both sides of a seam agree.
//!
//! Where a surface is cut, or goes on in another one in the same plane, two charts show the same line with
//! texels of their own, and bilinear lookups on either side of it differ. The texels along such a line are
//! changed by the least amount that makes lookups agree (least squares over sample points on the line, each
//! texel being pulled to what it was; after M. Iwanicki, "Lighting Technology of The Last of Us", 2013).
//! Where the sides differ much, one of them shows a shadow's edge that the other cannot: agreeing there
//! would blur the one that is right, so such points are left out.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use serde::Serialize;

use crate::light::luminance;
use crate::surface::Surface;
use crate::unwrap::Atlas;

/// Sample points for each texel of the finer side.
const SAMPLES_A_TEXEL: f64 = 2.0;

/// The pull of the finer side's texels to what they were, in samples; a texel of the coarser side, which
/// shows more of the surface, is pulled as many times more.
const PULL: f64 = 0.02;

/// Sides that differ by more than this fraction of the lighter one are left apart.
const MOST: f64 = 0.2;

/// Sweeps over the texels.
const SWEEPS: usize = 24;

/// Surfaces whose normals differ by less than this (1 − cosine) go on in each other.
const COPLANAR: f64 = 1e-6;

/// Ends of edges closer than this fraction of the scene's size are one.
const SAME_PLACE: f64 = 1e-6;

/// How well the sides agree: root mean square of their difference over all samples that were used, and
/// the mean light there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SeamReport {
    /// Points at which both sides were compared.
    pub samples: u64,
    /// Of these, points at a shadow's edge, where the sides are left apart.
    pub apart: u64,
    /// Root mean square difference before, as a fraction of the mean light there.
    pub before: f64,
    /// The same after.
    pub after: f64,
}

/// A line that two charts show, in the plane of each.
struct Seam {
    /// Indices.
    charts: [usize; 2],
    from: [DVec2; 2],
    to: [DVec2; 2],
}

/// A point on a seam: what it takes of eight texels, four on either side with opposite signs.
struct Tap {
    texels: [u32; 8],
    weights: [f64; 8],
    /// What either side's texels show, against the finer one's.
    areas: [f64; 2],
}

/// Changes texels along seams. `owners` tells to which chart texels belong, by index.
pub(super) fn join(
    surfaces: &[Surface],
    atlas: &Atlas,
    texels: &mut [[f32; 3]],
    owners: &[Option<u32>],
) -> SeamReport {
    let mut report = SeamReport::default();
    let mut taps = Vec::new();
    let mut light = 0.0;
    let value = |texels: &[[f32; 3]], t: u32| DVec3::from_array(texels[t as usize].map(f64::from));
    for seam in seams(surfaces, atlas) {
        for tap in seam.taps(atlas, owners) {
            report.samples += 1;
            let side = |range: std::ops::Range<usize>| -> DVec3 {
                range.map(|k| value(texels, tap.texels[k]) * tap.weights[k].abs()).sum()
            };
            let (a, b) = (side(0..4), side(4..8));
            if luminance((a - b).abs()) > MOST * luminance(a).max(luminance(b)) {
                report.apart += 1;
            } else {
                light += luminance(0.5 * (a + b));
                taps.push(tap);
            }
        }
    }
    if taps.is_empty() {
        return report;
    }
    let mut fit = Fit::new(taps, |t| value(texels, t));
    let mean = light / fit.taps.len() as f64;
    report.before = fit.difference() / mean.max(f64::MIN_POSITIVE);
    fit.solve();
    report.after = fit.difference() / mean.max(f64::MIN_POSITIVE);
    for (&texel, value) in fit.texels.iter().zip(&fit.values) {
        texels[texel as usize] = value.as_vec3().to_array();
    }
    report
}

/// The texels to be changed and the samples that say how.
struct Fit {
    taps: Vec<Tap>,
    residuals: Vec<DVec3>,
    /// Which texels are changed, ascending.
    texels: Vec<u32>,
    values: Vec<DVec3>,
    start: Vec<DVec3>,
    pulls: Vec<f64>,
    /// For each texel its samples and their weights.
    shares: Vec<Vec<(u32, f64)>>,
}

impl Fit {
    fn new(taps: Vec<Tap>, value: impl Fn(u32) -> DVec3) -> Self {
        let mut shares: BTreeMap<u32, (f64, Vec<(u32, f64)>)> = BTreeMap::new();
        for (sample, tap) in taps.iter().enumerate() {
            for (k, (&texel, &weight)) in tap.texels.iter().zip(&tap.weights).enumerate() {
                if weight != 0.0 {
                    let (pull, shares) = shares.entry(texel).or_default();
                    *pull = pull.max(PULL * tap.areas[k / 4]);
                    shares.push((sample as u32, weight));
                }
            }
        }
        let residual =
            |tap: &Tap| tap.texels.iter().zip(tap.weights).map(|(&t, w)| value(t) * w).sum::<DVec3>();
        let residuals = taps.iter().map(residual).collect();
        let (texels, known): (Vec<u32>, Vec<_>) = shares.into_iter().unzip();
        let (pulls, shares) = known.into_iter().unzip();
        let values: Vec<DVec3> = texels.iter().map(|&t| value(t)).collect();
        Self { taps, residuals, texels, start: values.clone(), values, pulls, shares }
    }

    /// Gauss–Seidel; no value becomes negative.
    fn solve(&mut self) {
        for _ in 0..SWEEPS {
            let texels = self.values.iter_mut().zip(&self.start).zip(&self.pulls).zip(&self.shares);
            for (((value, start), &pull), shares) in texels {
                let (mut sum, mut norm) = (pull * (*start - *value), pull);
                for &(sample, weight) in shares {
                    sum -= weight * self.residuals[sample as usize];
                    norm += weight * weight;
                }
                let change = (*value + sum / norm).max(DVec3::ZERO) - *value;
                *value += change;
                for &(sample, weight) in shares {
                    self.residuals[sample as usize] += weight * change;
                }
            }
        }
    }

    /// Root mean square difference of the sides.
    fn difference(&self) -> f64 {
        let sum: f64 = self.residuals.iter().map(|&r| luminance(r.abs()).powi(2)).sum();
        (sum / self.residuals.len() as f64).sqrt()
    }
}

impl Seam {
    /// Samples along the line, where all texels that lookups touch are the chart's own: outlines reach beyond the
    /// surface, and other charts may lie there.
    fn taps(&self, atlas: &Atlas, owners: &[Option<u32>]) -> Vec<Tap> {
        let charts = self.charts.map(|index| &atlas.charts[index]);
        let ends = [0, 1].map(|k| [self.from[k], self.to[k]].map(|p| charts[k].texel(p)));
        let length = ends.iter().map(|[a, b]| a.distance(*b)).fold(0.0, f64::max);
        let areas = charts.map(|c| 1.0 / c.texel_from_plane.matrix2.determinant().abs());
        let least = areas[0].min(areas[1]);
        let areas = areas.map(|area| area / least);
        let count = (SAMPLES_A_TEXEL * length).ceil().clamp(1.0, 65536.0);
        let sample = |k: usize| {
            let t = (k as f64 + 0.5) / count;
            let mut tap = Tap { texels: [0; 8], weights: [0.0; 8], areas };
            for (side, [from, to]) in ends.iter().enumerate() {
                let at = from.lerp(*to, t) - 0.5;
                let low = at.floor();
                let f = at - low;
                let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
                for (k, weight) in weights.into_iter().enumerate().filter(|(_, w)| *w > 1e-6) {
                    let (x, y) = (low.x + (k % 2) as f64, low.y + (k / 2) as f64);
                    if x < 0.0 || y < 0.0 || x >= f64::from(atlas.width) || y >= f64::from(atlas.height) {
                        return None;
                    }
                    let texel = y as usize * atlas.width as usize + x as usize;
                    let owner = owners.get(texel).copied().flatten();
                    if owner.is_none_or(|chart| chart as usize != self.charts[side]) {
                        return None;
                    }
                    tap.texels[4 * side + k] = texel as u32;
                    tap.weights[4 * side + k] = if side == 0 { weight } else { -weight };
                }
            }
            Some(tap)
        };
        (0..count as usize).filter_map(sample).collect()
    }
}

/// All lines that two charts show: cuts, and edges across which one surface goes on in another.
fn seams(surfaces: &[Surface], atlas: &Atlas) -> Vec<Seam> {
    let mut seams = Vec::new();
    for surface in 0..surfaces.len() {
        let indices = atlas.indices_of(surface);
        for a in indices.clone() {
            for b in a + 1..indices.end {
                let outlines = [a, b].map(|chart| &atlas.charts[chart].outline);
                seams.extend(common_edge(outlines[0], outlines[1]).map(|[from, to]| Seam {
                    charts: [a, b],
                    from: [from; 2],
                    to: [to; 2],
                }));
            }
        }
    }
    seams.extend(between_surfaces(surfaces, atlas));
    seams
}

/// The stretch that the edges of two convex outlines share.
fn common_edge(a: &[DVec2], b: &[DVec2]) -> Option<[DVec2; 2]> {
    let edges = |ring: &[DVec2]| -> Vec<[DVec2; 2]> {
        ring.iter().zip(ring.iter().cycle().skip(1)).map(|(&p, &q)| [p, q]).collect()
    };
    for [p, q] in edges(a) {
        let length = p.distance(q);
        let along = (q - p) / length;
        for [r, s] in edges(b) {
            let off = along.perp_dot(r - p).abs().max(along.perp_dot(s - p).abs());
            let (low, high) = (along.dot(s - p).max(0.0), along.dot(r - p).min(length));
            if off <= 1e-9 * length && high - low > 1e-9 * length {
                return Some([p + low * along, p + high * along]);
            }
        }
    }
    None
}

/// An edge of a surface with this index, plane coordinates.
type SurfaceEdge = (usize, [DVec2; 2]);

/// Edges that two surfaces in one plane share whole, where neither is cut.
fn between_surfaces(surfaces: &[Surface], atlas: &Atlas) -> Vec<Seam> {
    let corners = surfaces.iter().flat_map(|s| s.rings.iter().flatten().map(|&p| s.frame.lift(p)));
    let size = crate::geom::Bounds::of(corners.filter(|p| p.is_finite())).diagonal();
    if !(size > 0.0 && size.is_finite()) {
        return Vec::new();
    }
    let key = |p: DVec3| (p / (SAME_PLACE * size)).round().to_array().map(|c| c as i64);
    let mut edges: BTreeMap<[[i64; 3]; 2], Vec<SurfaceEdge>> = BTreeMap::new();
    for (index, surface) in surfaces.iter().enumerate().filter(|(s, _)| atlas.charts_of(*s).len() == 1) {
        for ring in &surface.rings {
            for (&p, &q) in ring.iter().zip(ring.iter().cycle().skip(1)) {
                let (from, to) = (key(surface.frame.lift(p)), key(surface.frame.lift(q)));
                let (ends, edge) = if from <= to { ([from, to], [p, q]) } else { ([to, from], [q, p]) };
                edges.entry(ends).or_default().push((index, edge));
            }
        }
    }
    let joined = edges.into_values().filter_map(|sides| {
        let [(a, first), (b, second)] = sides[..] else { return None };
        let is_smooth = surfaces[a].frame.normal.dot(surfaces[b].frame.normal) > 1.0 - COPLANAR;
        let charts = [atlas.indices_of(a).next()?, atlas.indices_of(b).next()?];
        (a != b && is_smooth).then_some(Seam {
            charts,
            from: [first[0], second[0]],
            to: [first[1], second[1]],
        })
    });
    joined.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine2, DMat2};

    use crate::unwrap::{Chart, PageArea};

    /// Two charts of the unit square, cut at x = ½: one of 4 × 8 texels, one of 2 × 2.
    fn atlas() -> Atlas {
        let chart = |min: DVec2, max: DVec2, count: DVec2, at: DVec2| {
            let scale = DMat2::from_diagonal(count / (max - min));
            Chart {
                surface: 0,
                outline: crate::geom::polygon::rectangle(min, max).to_vec(),
                page: 0,
                texel_from_plane: DAffine2::from_mat2_translation(scale, at + 0.5 - scale * min),
            }
        };
        let half = DVec2::new(0.5, 1.0);
        let charts = vec![
            chart(DVec2::ZERO, half, DVec2::new(4.0, 8.0), DVec2::new(1.0, 1.0)),
            chart(DVec2::new(0.5, 0.0), DVec2::ONE, DVec2::new(2.0, 2.0), DVec2::new(8.0, 1.0)),
        ];
        let pages = vec![PageArea { row: 0, width: 16, height: 16 }];
        Atlas { width: 16, height: 16, pages, texels_per_metre: 8.0, gutter: 2, charts, blocks: vec![] }
    }

    /// The light in texels that belong to the charts `owned`, joined.
    fn joined(
        light: impl Fn(DVec2) -> f64,
        owned: [u32; 2],
    ) -> (Atlas, Vec<[f32; 3]>, Vec<[f32; 3]>, SeamReport) {
        let atlas = atlas();
        let (mut texels, mut owners) = (vec![[0.0_f32; 3]; 256], vec![None; 256]);
        for ((chart, count), own) in atlas.charts.iter().zip([[4, 8], [2, 2]]).zip(owned) {
            let low = chart.texel(chart.outline[0]) - 0.5;
            for (x, y) in (0..=count[1]).flat_map(|y| (0..=count[0]).map(move |x| (x, y))) {
                let at = low + DVec2::new(f64::from(x), f64::from(y));
                let p = chart.texel_from_plane.inverse().transform_point2(at + 0.5);
                let index = at.y as usize * 16 + at.x as usize;
                (texels[index], owners[index]) = ([light(p) as f32; 3], Some(own));
            }
        }
        let before = texels.clone();
        let surface = Surface {
            placement: 0,
            material: 0,
            frame: crate::geom::Frame::new(DVec3::ZERO, DVec3::Z, DVec3::X),
            rings: vec![crate::geom::polygon::rectangle(DVec2::ZERO, DVec2::ONE).to_vec()],
            source_triangles: Vec::new(),
            regions: Vec::new(),
            area: 1.0,
            smooth: None,
            double_sided: false,
        };
        let report = join(&[surface], &atlas, &mut texels, &owners);
        (atlas, before, texels, report)
    }

    #[test]
    fn a_bend_that_one_side_cannot_show_is_agreed_upon() {
        let (_, before, after, report) = joined(|p| 1.0 + 0.1 * (6.0 * p.y).sin(), [0, 1]);
        assert!(report.samples >= 16 && report.apart == 0, "{report:?}");
        assert!(report.before > 0.02 && report.after < 0.2 * report.before, "{report:?}");
        let most = before.iter().zip(&after).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
        assert!(most < 0.25, "{most}");
    }

    #[test]
    fn what_agrees_is_left_alone_and_so_are_edges_of_shadows() {
        let (_, before, after, report) = joined(|p| 1.0 + p.x + p.y, [0, 1]);
        assert!(report.before < 1e-6, "{report:?}");
        assert!(before.iter().zip(&after).all(|(a, b)| (a[0] - b[0]).abs() < 1e-5));
        let (.., report) = joined(|p| if p.y > 0.3 { 1.0 } else { 0.01 }, [0, 1]);
        assert!(report.apart > 0, "{report:?}");
    }

    /// An outline reaches beyond its surface, and texels of another chart may lie there.
    #[test]
    fn other_charts_texels_are_left_alone() {
        let (_, before, after, report) = joined(|p| 1.0 + 0.1 * (6.0 * p.y).sin(), [0, 7]);
        assert_eq!((report.samples, before == after), (0, true));
    }
}
