//! Stage 2: coplanar connected triangles of one material become one planar polygon.

//!
//! In order: a placement's triangles get shared vertices (`weld`, `facet`), coplanar neighbours are
//! grouped (`group`) and outlined (`outline`, `boundary`); then triangles that meet or cut a surface
//! are found (`contact`) and cut it into regions (`dangling`, `region`). What is drawn as curved keeps its normals
//! (`smooth`).

mod boundary;
mod build;
mod contact;
mod dangling;
mod facet;
mod group;
mod layout;
mod outline;
mod region;
mod smooth;
mod weld;

use std::sync::Arc;

use glam::{DVec2, DVec3};

pub use build::build_surfaces;
pub use contact::BoxQuery;
pub use smooth::{SmoothNormals, SmoothPlace};

use crate::geom::{Frame, Ring};
use crate::scene::{Placement, Scene, Triangle};

/// What of a scene makes surfaces.
#[derive(Clone, Debug)]
pub struct Geometry<'a> {
    /// World-space positions, metres.
    pub vertices: &'a [DVec3],
    /// Unit normals that the vertices are drawn with, as [`Scene::normals`]; none at all where facets are lit.
    pub normals: &'a [DVec3],
    /// All triangles.
    pub triangles: &'a [Triangle],
    /// Which of them belong together.
    pub placements: &'a [Placement],
    /// For each material whether both sides reflect.
    pub double_sided: Vec<bool>,
    /// Texture coordinates of the triangles that keep their own: surfaces go on only where these do. Empty where no
    /// triangle does.
    pub coordinates: &'a [Option<[DVec2; 3]>],
}

impl<'a> From<&'a Scene> for Geometry<'a> {
    fn from(scene: &'a Scene) -> Self {
        Self {
            vertices: &scene.vertices,
            normals: &scene.normals,
            triangles: &scene.triangles,
            placements: &scene.placements,
            double_sided: scene.materials.iter().map(|m| m.double_sided).collect(),
            coordinates: &[],
        }
    }
}

/// A scene's surfaces.
#[derive(Clone, Debug, Default)]
pub struct SurfaceSet {
    /// In the order of their placements, within one in the order of their first triangles.
    pub surfaces: Vec<Surface>,
    /// Triangles in no surface: those without area, and those with a position that is not finite.
    pub without_area: usize,
    /// Contact lines that could not be used; light may leak along them.
    pub dropped_contacts: usize,
}

/// A maximal connected coplanar group of one placement's triangles.
///
/// Its number of elements, and its chart, do not depend on how it was triangulated.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Index into [`Scene::placements`](crate::scene::Scene::placements).
    pub placement: usize,
    /// Index into [`Scene::materials`](crate::scene::Scene::materials).
    pub material: usize,
    /// The plane; the first axis follows the outline's longest edge.
    pub frame: Frame,
    /// The outline and holes, collinear corners removed; plane coordinates, metres.
    pub rings: Vec<Ring>,
    /// Its triangles as indices into [`Scene::triangles`](crate::scene::Scene::triangles).
    pub source_triangles: Vec<usize>,
    /// The parts into which contact edges cut it; at least one, together the whole.
    pub regions: Vec<Region>,
    /// Area, square metres, above 0.
    pub area: f64,
    /// The normals that it is lit by; `None` where these are the plane's.
    pub smooth: Option<Arc<SmoothNormals>>,
    /// Whether the back is a surface like the front (material `doubleSided`).
    pub double_sided: bool,
}

/// A part of a surface bounded by its outline and by contact edges: lines on which another
/// polygon meets or cuts the surface. Radiosity is continuous inside a region and may jump
/// between regions.
#[derive(Clone, Debug)]
pub struct Region {
    /// Outer rings and holes; plane coordinates of the surface's frame.
    pub rings: Vec<Ring>,
    /// The same polygon as triangles, counter-clockwise, few of them.
    pub triangles: Vec<[DVec2; 3]>,
    /// Area, square metres, above 0.
    pub area: f64,
}

impl Surface {
    /// The least and the greatest corner of the outline, plane coordinates.
    #[must_use]
    pub fn extent(&self) -> (DVec2, DVec2) {
        self.rings
            .iter()
            .flatten()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)))
    }
}
