//! Kept layouts: surfaces that are moved and scaled together, as the input laid them out.

use glam::{DAffine2, DMat2, DVec2};

use super::pack::{Gutter, LARGEST_SIDE, STEP};
use super::shape::Shape;
use super::{Atlas, BlockPlace, Chart, PageArea, Room, UnwrapError, UnwrapOptions};
use crate::authored::{Authored, LEAST_STRETCH, least_stretch, mean_density};
use crate::geom::polygon::{orient, rectangle};
use crate::scene::Scene;
use crate::surface::Surface;

/// Surfaces whose places in the unit square the input gives.
#[derive(Clone, Debug, Default)]
pub struct Block {
    /// The surfaces.
    pub members: Vec<Member>,
    /// How much denser than others its texels lie, above 0.
    pub weight: f64,
}

/// A surface of a [`Block`].
#[derive(Clone, Copy, Debug)]
pub struct Member {
    /// Index into the surfaces.
    pub surface: usize,
    /// Takes plane coordinates (metres) to the layout's; can be inverted.
    pub uv_from_plane: DAffine2,
}

/// The layouts that are kept, as blocks of the scene's `surfaces`, which were made with them; all of weight 1.
#[must_use]
pub fn blocks(authored: &Authored, surfaces: &[Surface], scene: &Scene) -> Vec<Block> {
    let mut blocks = vec![Block { members: Vec::new(), weight: 1.0 }; authored.blocks()];
    let corners = |triangle: usize| {
        let uv = authored.coordinates().get(triangle).copied().flatten()?;
        Some((scene.corners(scene.triangles.get(triangle)?), uv))
    };
    let mut triangles_of = vec![Vec::new(); blocks.len()];
    for (index, triangle) in scene.triangles.iter().enumerate() {
        if let Some(block) = authored.block_of(triangle.placement as usize) {
            triangles_of[block].push(index);
        }
    }
    let density: Vec<f64> =
        triangles_of.iter().map(|own| mean_density(own.iter().filter_map(|&t| corners(t)))).collect();
    for (surface, of) in surfaces.iter().enumerate() {
        let Some(block) = authored.block_of(of.placement) else { continue };
        let own = of.source_triangles.iter().filter_map(|&triangle| corners(triangle));
        let pairs = own.flat_map(|(points, uv)| [0, 1, 2].map(|k| (of.frame.project(points[k]), uv[k])));
        let uv_from_plane = uv_from_plane(&pairs.collect::<Vec<_>>(), density[block]);
        blocks[block].members.push(Member { surface, uv_from_plane });
    }
    blocks
}

/// The map that takes points of a plane to their coordinates, by least squares; it can be inverted.
///
/// Slivers, whose coordinates say nothing about the direction across them, get the layout's mean `density` there.
fn uv_from_plane(corners: &[(DVec2, DVec2)], density: f64) -> DAffine2 {
    let count = corners.len().max(1) as f64;
    let (point, uv) = corners.iter().fold((DVec2::ZERO, DVec2::ZERO), |(p, q), c| (p + c.0, q + c.1));
    let (point, uv) = (point / count, uv / count);
    let outer = |a: DVec2, b: DVec2| DMat2::from_cols(a * b.x, a * b.y);
    let (mut spread, mut common) = (DMat2::ZERO, DMat2::ZERO);
    for &(p, q) in corners {
        spread += outer(p - point, p - point);
        common += outer(q - uv, p - point);
    }
    let fitted = common * spread.inverse();
    let is_map = fitted.is_finite() && least_stretch(fitted) > LEAST_STRETCH * density;
    let matrix = if is_map { fitted } else { DMat2::from_diagonal(DVec2::splat(density)) };
    DAffine2::from_mat2_translation(matrix, uv - matrix * point)
}

impl Block {
    /// Its triangles in the layout.
    fn triangles<'a>(&'a self, surfaces: &'a [Surface]) -> impl Iterator<Item = [DVec2; 3]> + 'a {
        self.members.iter().flat_map(|member| {
            let triangles = surfaces[member.surface].regions.iter().flat_map(|region| &region.triangles);
            triangles.map(|t| t.map(|p| member.uv_from_plane.transform_point2(p)))
        })
    }

    /// Metres that the layout's unit stands for, by area.
    fn metres(&self, surfaces: &[Surface]) -> f64 {
        let area: f64 = self.members.iter().map(|member| surfaces[member.surface].area).sum();
        let covered: f64 = self.triangles(surfaces).map(|[a, b, c]| orient(a, b, c).abs() / 2.0).sum();
        let metres = (area / covered).sqrt();
        if metres.is_finite() && metres > 0.0 { metres } else { 1.0 }
    }

    /// All of it as one shape to be packed: the layout, scaled so that it is as dense as the surfaces themselves.
    pub(super) fn shape(&self, surfaces: &[Surface]) -> Shape {
        let metres = self.metres(surfaces);
        let triangles: Vec<_> = self.triangles(surfaces).map(|t| t.map(|p| metres * p)).collect();
        Shape::of_triangles(triangles, DVec2::splat(self.weight))
    }

    /// The charts of its surfaces where its own is `chart`, and the place of the layout.
    pub(super) fn charts(&self, surfaces: &[Surface], chart: &Chart) -> (BlockPlace, Vec<Chart>) {
        let scale = DMat2::from_diagonal(DVec2::splat(self.metres(surfaces)));
        let texel_from_uv = chart.texel_from_plane * DAffine2::from_mat2(scale);
        let place = BlockPlace { page: chart.page, texel_from_uv };
        (place, self.charts_at(surfaces, place))
    }

    fn charts_at(&self, surfaces: &[Surface], place: BlockPlace) -> Vec<Chart> {
        let chart = |member: &Member| {
            let (min, max) = surfaces[member.surface].extent();
            Chart {
                surface: member.surface,
                outline: rectangle(min, max).to_vec(),
                page: place.page,
                texel_from_plane: place.texel_from_uv * member.uv_from_plane,
            }
        };
        self.members.iter().map(chart).collect()
    }

    /// A page that is the layout's unit square.
    pub(super) fn page(
        &self,
        surfaces: &[Surface],
        options: &UnwrapOptions,
        gutter: Gutter,
    ) -> Result<Atlas, UnwrapError> {
        let metres = self.metres(surfaces);
        let in_steps =
            |side: f64, round: fn(f64) -> f64| f64::from(STEP) * round(side / f64::from(STEP)).max(1.0);
        let side = match options.room {
            Room::Square(side) => f64::from(side),
            Room::Density(density) => in_steps(density * metres, f64::ceil),
            Room::Texels(texels) => in_steps(texels.sqrt(), f64::round),
        };
        if side > f64::from(LARGEST_SIDE) {
            let (charts, texels_per_metre) = (self.members.len(), side / metres);
            return Err(UnwrapError::TooLarge { charts, texels_per_metre, side: LARGEST_SIDE });
        }
        let page = PageArea { row: 0, width: side as u32, height: side as u32 };
        let texel_from_uv = DAffine2::from_scale(DVec2::splat(side));
        let place = BlockPlace { page: 0, texel_from_uv };
        Ok(Atlas {
            width: page.width,
            height: page.height,
            pages: vec![page],
            texels_per_metre: side / metres,
            gutter: gutter.gap,
            charts: self.charts_at(surfaces, place),
            blocks: vec![place],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_found_again_and_slivers_get_one_that_can_be_inverted() {
        let map = DAffine2::from_mat2_translation(
            DMat2::from_cols(DVec2::new(0.1, 0.02), DVec2::new(0.03, -0.2)),
            DVec2::new(0.4, 0.5),
        );
        let points = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.5, 1.5)].map(DVec2::from);
        let found = uv_from_plane(&points.map(|p| (p, map.transform_point2(p))), 0.1);
        assert!(found.abs_diff_eq(map, 1e-12), "{found:?}");
        // A triangle that is a line in the layout keeps its place and gets area.
        let line = uv_from_plane(&[points[0], points[1], points[2]].map(|p| (p, DVec2::new(p.x, p.x))), 0.1);
        assert!((line.matrix2.determinant() - 0.01).abs() < 1e-12, "{line:?}");
        let middle = (points[0] + points[1] + points[2]) / 3.0;
        assert!(line.transform_point2(middle).distance(DVec2::splat(middle.x)) < 1e-12);
        assert!(uv_from_plane(&[], 0.1).is_finite());
    }
}
