//! What a baked file holds, in figures.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};
use serde::Serialize;
use serde_json::Value;

use crate::compare::{BakedScene, CompareError};
use crate::export::COBAKE_LIGHTMAP;
use crate::geom::disjoint::root;
use crate::geom::polygon::signed_area;
use crate::geom::triangle::area;
use crate::light;
use crate::options::Quantity;
use crate::raster::Lightmap;

/// What a baked file holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Triangles that the scene places.
    pub triangles: usize,
    /// Vertices that the scene places.
    pub vertices: usize,
    /// Triangles that a lightmap lights.
    pub lit_triangles: usize,
    /// The lightmaps, in the file's order.
    pub pages: Vec<PageInspection>,
    /// How the file was baked, as it says itself; `null` where it does not.
    pub baked: Value,
}

/// What a lightmap holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PageInspection {
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
    /// What a texel is.
    pub quantity: Quantity,
    /// Size of the EXR.
    pub bytes: u64,
    /// Groups of triangles that hang together in the page.
    pub charts: usize,
    /// The area of the charts over the page's, `[0, 1]`.
    pub coverage: f64,
    /// Luminance of the texels that are not black, in the quantity's own unit.
    pub luminance: Range,
    /// Texels a metre: least, mean by area and greatest over the triangles; the square root of area in the page over
    /// area in space.
    pub density: Range,
}

/// How far values reach; all 0 where there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Range {
    /// The least.
    pub least: f64,
    /// The mean.
    pub mean: f64,
    /// The greatest.
    pub greatest: f64,
}

impl Range {
    /// Of values, each with the weight that it has in the mean.
    fn of(values: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let (mut range, mut sum, mut weights) = (None::<(f64, f64)>, 0.0, 0.0);
        for (value, weight) in values {
            let (least, greatest) = range.unwrap_or((value, value));
            range = Some((least.min(value), greatest.max(value)));
            sum += weight * value;
            weights += weight;
        }
        let (least, greatest) = range.unwrap_or_default();
        Self { least, mean: if weights > 0.0 { sum / weights } else { 0.0 }, greatest }
    }
}

/// Looks into the baked file at `path`; `scene` names the scene in it, by default its own.
///
/// # Errors
/// Where the file is no scene, holds no lightmap of cobake's, or a damaged one.
pub fn inspect(path: &Path, scene: Option<usize>) -> Result<Inspection, CompareError> {
    let baked = BakedScene::load(path, scene)?;
    let triangles = baked.triangles();
    let pages = baked.pages().enumerate().map(|(index, page)| inspect_page(&baked, index, page)).collect();
    let json = &baked.scene().source.json;
    let extension = json.get("extensions").and_then(|e| e.get(COBAKE_LIGHTMAP));
    Ok(Inspection {
        triangles: triangles.len(),
        vertices: baked.scene().vertices.len(),
        lit_triangles: (0..triangles.len()).filter(|&t| baked.chart(t).is_some()).count(),
        pages,
        baked: extension.and_then(|e| e.get("baked")).cloned().unwrap_or_default(),
    })
}

fn inspect_page(
    baked: &BakedScene,
    page: usize,
    (map, quantity, bytes): (&Lightmap, Quantity, u64),
) -> PageInspection {
    let size = DVec2::new(map.width.into(), map.height.into());
    let lit = baked.triangles().iter().enumerate().filter_map(|(index, &corners)| {
        let (own, coordinates) = baked.chart(index)?;
        (own == page).then_some((corners, coordinates))
    });
    let lit: Vec<([DVec3; 3], [DVec2; 3])> = lit.collect();
    let texels = |coordinates: &[DVec2; 3]| signed_area(&coordinates.map(|c| c * size)).abs();
    let covered: f64 = lit.iter().map(|(_, coordinates)| texels(coordinates)).sum();
    let densities = lit.iter().filter_map(|(corners, coordinates)| {
        let area = area(*corners);
        (area > 0.0).then(|| ((texels(coordinates) / area).sqrt(), area))
    });
    PageInspection {
        width: map.width,
        height: map.height,
        quantity,
        bytes,
        charts: charts(lit.iter().map(|(_, coordinates)| coordinates)),
        coverage: (covered / (size.x * size.y)).min(1.0),
        luminance: luminance(map),
        density: Range::of(densities),
    }
}

fn luminance(map: &Lightmap) -> Range {
    let values = map.texels.iter().map(|texel| light::luminance(DVec3::from_array(texel.map(f64::from))));
    Range::of(values.filter(|&value| value > 0.0).map(|value| (value, 1.0)))
}

/// How many groups triangles form that share corners in the page.
fn charts<'c>(triangles: impl Iterator<Item = &'c [DVec2; 3]>) -> usize {
    let mut numbers = BTreeMap::new();
    let mut parents: Vec<usize> = Vec::new();
    for corners in triangles {
        let ids = corners.map(|corner| {
            *numbers.entry((corner.x.to_bits(), corner.y.to_bits())).or_insert_with(|| {
                parents.push(parents.len());
                parents.len() - 1
            })
        });
        let [a, b, c] = ids.map(|id| root(&mut parents, id));
        parents[b] = a;
        let c = root(&mut parents, c);
        let a = root(&mut parents, a);
        parents[c] = a;
    }
    parents.iter().enumerate().filter(|&(index, &parent)| index == parent).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_are_what_shares_corners() {
        let [a, b, c, d, e] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (2.0, 2.0)].map(DVec2::from);
        let far = [e, e + DVec2::X, e + DVec2::Y];
        assert_eq!(charts([[a, b, c], [b, d, c], far].iter()), 2);
        assert_eq!(charts([far, [a, b, c], [c, d, e]].iter()), 1, "joined by the last");
        assert_eq!(charts([].iter()), 0);
    }

    #[test]
    fn ranges_weigh() {
        let range = Range::of([(1.0, 3.0), (5.0, 1.0)]);
        assert_eq!(range, Range { least: 1.0, mean: 2.0, greatest: 5.0 });
        assert_eq!(Range::of([]), Range::default());
    }

    #[test]
    fn a_fixture_is_told() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/compare/cornell-64.glb");
        let told = inspect(&path, None).expect("a bake");
        let [page] = told.pages[..] else { panic!("{} pages", told.pages.len()) };
        assert_eq!((page.width, page.height), (64, 64));
        assert!(page.charts > 5 && page.coverage > 0.2 && page.coverage < 1.0, "{page:?}");
        let ordered = |r: Range| 0.0 < r.least && r.least < r.mean && r.mean < r.greatest;
        assert!(ordered(page.luminance) && ordered(page.density), "{page:?}");
        assert!(page.bytes > 1000 && told.lit_triangles <= told.triangles, "{told:?}");
    }
}
