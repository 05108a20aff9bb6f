//! A baked file, ready to be asked what light falls on a point of its surfaces.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use serde_json::Value;

use super::CompareError;
use super::hidden::is_inside_a_solid;
use super::triangle::{nearest, point};
use crate::export::{COBAKE_LIGHTMAP, LIGHTMAP_SET, decode_exr};
use crate::geom::Bounds;
use crate::geom::triangle::area_normal;
use crate::options::Quantity;
use crate::picture::sample;
use crate::raster::Lightmap;
use crate::scene::{ImportOptions, Scene, load};
use crate::trace::Tracer;

/// A point belongs to a triangle that is at most this share of the scene's longest side away.
const TOLERANCE: f64 = 1e-3;

/// A point belongs to a triangle whose normal has at least this cosine to its own.
const LEAST_COSINE: f64 = 0.9;

/// Radiosity is divided by no smaller reflectance than this to find the irradiance.
const LEAST_REFLECTANCE: f64 = 1e-6;

/// A file that a bake wrote: its scene and its lightmaps.
pub struct BakedScene {
    path: PathBuf,
    scene: Scene,
    tracer: Tracer,
    /// Of each triangle, unit length; zero where it has no area.
    normals: Vec<DVec3>,
    /// Of each triangle's corners, where it has some.
    coordinates: Vec<Option<[DVec2; 3]>>,
    pages: Vec<Page>,
    /// The page of each placement.
    page_of: Vec<Option<usize>>,
    max_reflectance: f64,
    tolerance: f64,
}

struct Page {
    map: Lightmap,
    quantity: Quantity,
    /// Size of the EXR.
    bytes: u64,
}

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Index into the scene's triangles.
    pub triangle: usize,
    /// In the order of the triangle's corners, in `[0, 1]`, summing to 1.
    pub barycentric: [f64; 3],
}

impl BakedScene {
    /// Reads the baked `.glb` or `.gltf` file at `path`; `scene` names the scene in it, by default its own.
    ///
    /// # Errors
    /// Where the file is no scene, holds no lightmap of cobake's, or a damaged one.
    pub fn load(path: &Path, scene: Option<usize>) -> Result<Self, CompareError> {
        let unreadable = |source| CompareError::Scene { path: path.to_owned(), source };
        let scene = load(path, &ImportOptions { scene, ..ImportOptions::default() }).map_err(unreadable)?;
        let extension = scene.source.json.get("extensions").and_then(|e| e.get(COBAKE_LIGHTMAP));
        let lightmaps = extension.and_then(|e| e.get("lightmaps")?.as_array()).filter(|l| !l.is_empty());
        let lightmaps = lightmaps.ok_or_else(|| CompareError::NotBaked { path: path.to_owned() })?;
        let pages = lightmaps.iter().enumerate().map(|(index, entry)| read_page(path, &scene, index, entry));
        let pages: Vec<Page> = pages.collect::<Result<_, _>>()?;
        let limit = extension.and_then(|e| e.get("baked")?.get("maxReflectance")?.as_f64());
        let coordinates = scene.texture_coordinates(LIGHTMAP_SET as u32).map_err(unreadable)?;
        let page_of = scene.placements.iter().map(|placement| page_of_node(&scene, placement.node));
        let page_of: Vec<_> = page_of.map(|page| page.filter(|&page| page < pages.len())).collect();

        let corner = |vertex: u32| scene.vertices.get(vertex as usize).copied().unwrap_or_default();
        let corners: Vec<_> = scene.triangles.iter().map(|t| t.vertices.map(corner)).collect();
        let material = |placement: u32| {
            scene.placements.get(placement as usize).and_then(|p| scene.materials.get(p.material))
        };
        let double_sided =
            scene.triangles.iter().map(|t| material(t.placement).is_some_and(|m| m.double_sided));
        let double_sided = double_sided.collect();
        let bounds = Bounds::of(scene.vertices.iter().copied());
        let baked = Self {
            path: path.to_owned(),
            normals: corners.iter().map(|&t| area_normal(t).normalize_or_zero()).collect(),
            tracer: Tracer::new(corners).with_double_sided(double_sided),
            tolerance: TOLERANCE * (bounds.max - bounds.min).max_element(),
            coordinates,
            pages,
            page_of,
            max_reflectance: limit.unwrap_or(1.0),
            scene,
        };
        if (0..baked.normals.len()).all(|triangle| baked.chart(triangle).is_none()) {
            return Err(CompareError::Unlit { path: path.to_owned() });
        }
        Ok(baked)
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the texels of its first lightmap hold.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.pages.first().map_or(Quantity::Irradiance, |page| page.quantity)
    }

    /// The scene that was baked.
    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Its lightmaps: texels, what they hold and the size of the EXR, bytes.
    pub(crate) fn pages(&self) -> impl ExactSizeIterator<Item = (&Lightmap, Quantity, u64)> {
        self.pages.iter().map(|page| (&page.map, page.quantity, page.bytes))
    }

    /// Its first lightmap.
    pub(super) fn first_page(&self) -> Option<&Lightmap> {
        self.pages.first().map(|page| &page.map)
    }

    /// Its triangles, metres.
    pub(crate) fn triangles(&self) -> &[[DVec3; 3]] {
        self.tracer.triangles()
    }

    /// The page of a triangle, and its corners' coordinates there; `None` where no lightmap lights it.
    pub(crate) fn chart(&self, triangle: usize) -> Option<(usize, [DVec2; 3])> {
        let placement = self.scene.triangles.get(triangle)?.placement as usize;
        let page = self.page_of.get(placement).copied()??;
        let corners = self.coordinates.get(triangle).copied()??;
        corners.iter().all(|corner| corner.is_finite()).then_some((page, corners))
    }

    /// The place nearest to a point, metres, on a triangle that faces as `normal` (unit length) does: at
    /// most a thousandth of the scene's longest side away, the cosine of the normals above 0.9.
    ///
    /// Of equally near triangles it is the first. `None` where there is none.
    #[must_use]
    pub fn locate(&self, position: DVec3, normal: DVec3) -> Option<Place> {
        let mut candidates = Vec::new();
        self.tracer.triangles_in(Bounds::of([position]).grown(self.tolerance), &mut candidates);
        let mut best: Option<(f64, Place)> = None;
        for triangle in candidates.into_iter().map(|candidate| candidate as usize) {
            let (Some(&corners), Some(facing)) = (self.triangles().get(triangle), self.normals.get(triangle))
            else {
                continue;
            };
            if facing.dot(normal) <= LEAST_COSINE {
                continue;
            }
            let barycentric = nearest(corners, position);
            let distance = point(corners, barycentric).distance(position);
            if distance <= self.tolerance && best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, Place { triangle, barycentric }));
            }
        }
        best.map(|(_, place)| place)
    }

    /// Where in space a place lies, metres, and the unit normal there.
    #[must_use]
    pub fn point_at(&self, place: &Place) -> Option<(DVec3, DVec3)> {
        let corners = self.triangles().get(place.triangle)?;
        Some((point(*corners, place.barycentric), *self.normals.get(place.triangle)?))
    }

    /// Whether a place lies inside a solid, where nobody sees it: under a box on a floor, say. Told by the
    /// backs of single-sided surfaces that are seen from there.
    #[must_use]
    pub fn is_hidden(&self, place: &Place) -> bool {
        self.point_at(place).is_some_and(|(point, normal)| is_inside_a_solid(&self.tracer, point, normal))
    }

    /// What the lightmap says of a place, in its own quantity; `None` where there is no lightmap.
    #[must_use]
    pub fn value_at(&self, place: &Place) -> Option<DVec3> {
        self.look_up(place).map(|(value, _)| value)
    }

    /// The irradiance at a place, linear RGB in the scene's units; `None` where there is no lightmap.
    ///
    /// From radiosity it is `(B − π L) / ρ`, which means little where `ρ` is close to 0.
    #[must_use]
    pub fn irradiance_at(&self, place: &Place) -> Option<DVec3> {
        let (value, quantity) = self.look_up(place)?;
        Some(match quantity {
            Quantity::Irradiance => value,
            Quantity::Radiance => value * PI,
            Quantity::Radiosity => {
                let emission = self.scene.emission_at(place.triangle, place.barycentric, 0.0);
                let reflectance = self.scene.reflectance_at(place.triangle, place.barycentric, 0.0);
                let reflectance = reflectance.min(DVec3::splat(self.max_reflectance));
                (value - PI * emission) / reflectance.max(DVec3::splat(LEAST_REFLECTANCE))
            }
        })
    }

    fn look_up(&self, place: &Place) -> Option<(DVec3, Quantity)> {
        let (page, [a, b, c]) = self.chart(place.triangle)?;
        let page = self.pages.get(page)?;
        let [u, v, w] = place.barycentric;
        Some((sample(&page.map, u * a + v * b + w * c), page.quantity))
    }
}

/// Fails where less than half of the points that were looked up in `baked` were found: of figures for
/// the rest nobody should draw conclusions.
pub(super) fn check_matched(baked: &BakedScene, matched: usize, points: usize) -> Result<(), CompareError> {
    if matched == 0 || 2 * matched < points {
        return Err(CompareError::FewMatched { path: baked.path.clone(), matched, points });
    }
    Ok(())
}

fn page_of_node(scene: &Scene, node: usize) -> Option<usize> {
    let node = scene.source.json.get("nodes")?.get(node)?;
    let page = node.get("extensions")?.get(COBAKE_LIGHTMAP)?.get("lightmap")?.as_u64()?;
    usize::try_from(page).ok()
}

fn read_page(path: &Path, scene: &Scene, index: usize, entry: &Value) -> Result<Page, CompareError> {
    let fault = |problem: String| CompareError::Lightmap { path: path.to_owned(), index, problem };
    let quantity = match entry.get("quantity").map(Value::as_str) {
        None | Some(Some("irradiance")) => Quantity::Irradiance,
        Some(Some("radiance")) => Quantity::Radiance,
        Some(Some("radiosity")) => Quantity::Radiosity,
        Some(_) => return Err(fault("holds a quantity that is not known here".to_owned())),
    };
    let bytes = view_of(scene, entry).ok_or_else(|| fault("has no data".to_owned()))?;
    let map =
        decode_exr(bytes).map_err(|source| CompareError::Exr { path: path.to_owned(), index, source })?;
    if map.texels.is_empty() {
        return Err(fault("has no texels".to_owned()));
    }
    Ok(Page { map, quantity, bytes: bytes.len() as u64 })
}

/// The bytes of the bufferView that a lightmap names.
fn view_of<'s>(scene: &'s Scene, entry: &Value) -> Option<&'s [u8]> {
    let number = |value: &Value, key: &str| value.get(key)?.as_u64().and_then(|n| usize::try_from(n).ok());
    let view = scene.source.json.get("bufferViews")?.get(number(entry, "bufferView")?)?;
    let start = number(view, "byteOffset").unwrap_or(0);
    let end = start.checked_add(number(view, "byteLength")?)?;
    scene.source.buffers.get(number(view, "buffer")?)?.get(start..end)
}
