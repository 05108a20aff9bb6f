//! Texture coordinates of a set that no material may need: a lightmap's.

use glam::DVec2;

use super::accessor::{Accessors, Role};
use super::document::Document;
use super::{ImportError, Scene};

impl Scene {
    /// The texture coordinates of set `set` at the corners of each of [`Scene::triangles`], in their order.
    ///
    /// `None` for triangles whose primitive has no such set. Origin top left, as glTF has it.
    ///
    /// # Errors
    /// Names the accessor that cannot be read.
    pub fn texture_coordinates(&self, set: u32) -> Result<Vec<Option<[DVec2; 3]>>, ImportError> {
        let document = Document::read(&self.source.json)?;
        let accessors = Accessors { document: &document, buffers: &self.source.buffers };
        let name = format!("TEXCOORD_{set}");
        let mut corners = vec![None; self.triangles.len()];
        for placement in &self.placements {
            let entry =
                document.meshes.get(placement.mesh).and_then(|m| m.primitives.get(placement.primitive));
            let Some(&accessor) = entry.and_then(|primitive| primitive.attributes.get(&name)) else {
                continue;
            };
            let item = || document.primitive_item(placement.mesh, placement.primitive);
            let values: Vec<DVec2> =
                accessors.read(accessor, &Role::TEXCOORD, item)?.arrays().map(DVec2::from_array).collect();
            let range = placement.triangles.clone();
            let (Some(slots), Some(triangles)) = (corners.get_mut(range.clone()), self.triangles.get(range))
            else {
                continue;
            };
            for (slot, triangle) in slots.iter_mut().zip(triangles) {
                let [a, b, c] = triangle.source_vertices.map(|vertex| values.get(vertex as usize).copied());
                *slot = a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]);
            }
        }
        Ok(corners)
    }
}
