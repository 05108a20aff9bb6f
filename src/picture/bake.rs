//! The pictures of a bake: the page, the scene, and for each large surface its elements, buffers, triangles and charts.

use glam::DVec3;

use super::density::Densities;
use super::{
    Cell, Colour, EMPTY, MeshDrawing, NOT_EMPTY, PictureError, ToneMap, UNINITIALIZED, lightmap_png,
};
use crate::cob::CobState;
use crate::element::{Facet, Side};
use crate::raster::Lightmap;
use crate::retriangulate::{RadiosityMesh, SurfaceMesh};
use crate::surface::Surface;
use crate::unwrap::Atlas;

/// This many surfaces are drawn, the largest first.
const SURFACES: usize = 8;

/// What pictures are made of.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The page.
    pub lightmap: &'a Lightmap,
    /// The surfaces.
    pub surfaces: &'a [Surface],
    /// Their elements.
    pub facets: &'a [Facet],
    /// Their final triangles.
    pub mesh: &'a RadiosityMesh,
    /// Where they lie in the page.
    pub atlas: &'a Atlas,
}

/// A file name and its PNG.
pub type Picture = (String, Vec<u8>);

/// Draws everything:
///
/// - `lightmap.png`, the page, tone-mapped;
/// - `density.png`, the page with every chart coloured by its texels per metre (the geometric mean of those along
///   its axes) on a logarithmic scale from violet (few) to yellow (many), see the legend; what no lookup touches is
///   dark;
/// - `scene.png`, the whole scene from a corner above, without the walls in front: coloured so to the left, lit by
///   the lightmap, tone-mapped, to the right;
/// - for the largest surfaces `surface-N-elements.png` (the paper's figure 5), `surface-N-cob.png` (grey: never
///   asked, blue: empty, orange: not empty), `surface-N-triangles.png` and `surface-N-density.png`, where `N` is the
///   surface's rank by area.
///
/// # Errors
/// [`PictureError::Encode`] if a picture cannot be encoded.
pub fn pictures(subject: Subject) -> Result<Vec<Picture>, PictureError> {
    let densities = Densities::of(subject);
    let mut pictures = vec![
        ("lightmap.png".to_owned(), lightmap_png(subject.lightmap)?),
        ("density.png".to_owned(), densities.page_png()?),
        ("scene.png".to_owned(), densities.scene_png()?),
    ];
    let mut order: Vec<usize> = (0..subject.surfaces.len()).collect();
    order.sort_by(|&a, &b| subject.surfaces[b].area.total_cmp(&subject.surfaces[a].area).then(a.cmp(&b)));
    for (rank, &index) in order.iter().take(SURFACES).enumerate() {
        let facets: Vec<&Facet> =
            subject.facets.iter().filter(|f| f.surface == index && f.side == Side::Front).collect();
        let mesh = &subject.mesh.surfaces[index];
        let tones = ToneMap::for_values(mesh.vertices.iter().map(|v| v.direct + v.indirect));
        let drawings = [
            ("elements", elements(&facets, |f, leaf| tones.colour(light(f, leaf)))),
            ("cob", buffers(&facets)),
            ("triangles", triangles(mesh, &tones)),
        ];
        let name = |what: &str| format!("surface-{}-{what}.png", rank + 1);
        for (what, drawing) in drawings {
            pictures.push((name(what), drawing.png()?));
        }
        pictures.push((name("density"), densities.plan_png(index)?));
    }
    Ok(pictures)
}

fn light(facet: &Facet, leaf: u32) -> DVec3 {
    let (direct, indirect) = facet.received(leaf, facet.elements[leaf as usize].centroid);
    direct + indirect
}

/// The leaves, each filled with its colour.
fn elements(facets: &[&Facet], colour: impl Fn(&Facet, u32) -> Colour) -> MeshDrawing {
    let mut cells = Vec::new();
    for facet in facets {
        for leaf in facet.leaves() {
            let e = &facet.elements[leaf as usize];
            let corners = match &e.cut {
                Some(cut) => cut.hull.clone(),
                None => e.corners().to_vec(),
            };
            cells.push(Cell { corners, fill: colour(facet, leaf) });
        }
    }
    MeshDrawing { cells, ..MeshDrawing::default() }
}

fn buffers(facets: &[&Facet]) -> MeshDrawing {
    let drawing = elements(facets, |facet, leaf| match facet.elements[leaf as usize].cob.state() {
        CobState::Uninitialized => UNINITIALIZED,
        CobState::Empty => EMPTY,
        CobState::NotEmpty => NOT_EMPTY,
    });
    MeshDrawing { legend: vec![UNINITIALIZED, EMPTY, NOT_EMPTY], ..drawing }
}

fn triangles(mesh: &SurfaceMesh, tones: &ToneMap) -> MeshDrawing {
    let cells = mesh
        .triangles
        .iter()
        .map(|t| {
            let corners = t.map(|v| mesh.vertices[v as usize]);
            let mean = corners.iter().map(|v| v.direct + v.indirect).sum::<DVec3>() / 3.0;
            Cell { corners: corners.iter().map(|v| v.position).collect(), fill: tones.colour(mean) }
        })
        .collect();
    MeshDrawing { cells, ..MeshDrawing::default() }
}
