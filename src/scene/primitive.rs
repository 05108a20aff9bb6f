//! A primitive's vertices and triangles, in the mesh's own coordinates.
//!
//! Lists, strips and fans become lists of corner indices in the order and winding that the
//! specification defines (glTF 2.0, section 3.7.2.1). Points and lines have no area.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::accessor::{Accessors, Numbers, Role};
use super::appearance::Attributes;
use super::document::{Mesh, Primitive, follow};
use super::warning::Warnings;
use super::{ImportError, Item, extension};
use crate::options::Normals;

/// What a placement needs of a primitive.
#[derive(Clone, Debug)]
pub(super) struct Geometry {
    /// Positions in the mesh's coordinates, default morph weights applied.
    pub(super) positions: Vec<DVec3>,
    /// Normals in the mesh's coordinates, one a position, or none at all.
    pub(super) normals: Vec<DVec3>,
    /// Corners as indices into `positions`, all in range.
    pub(super) triangles: Vec<[u32; 3]>,
    /// What varies over it beside the position.
    pub(super) attributes: Arc<Attributes>,
}

/// Reads a mesh's primitives.
pub(super) struct PrimitiveReader<'a> {
    pub(super) accessors: Accessors<'a>,
    /// Which mesh.
    pub(super) mesh: usize,
    /// The mesh.
    pub(super) entry: &'a Mesh,
    /// Whether normals are read.
    pub(super) normals: Normals,
    /// Morph weights that the node sets in place of the mesh's.
    pub(super) weights: Option<&'a [f64]>,
}

#[derive(Clone, Copy)]
enum Topology {
    List,
    Strip,
    Fan,
}

impl PrimitiveReader<'_> {
    /// Reads primitive `index`; `None` (and a warning) where it holds no triangle.
    /// `sets` are the texture coordinate sets that its material needs.
    pub(super) fn read(
        &self,
        index: usize,
        sets: &[u32],
        warnings: &mut Warnings,
    ) -> Result<Option<Geometry>, ImportError> {
        let Some(primitive) = self.entry.primitives.get(index) else { return Ok(None) };
        let item = || self.accessors.document.primitive_item(self.mesh, index);
        let topology = match primitive.mode.unwrap_or(4) {
            0..=3 => {
                warnings.about(item(), "points and lines have no area and are left out");
                return Ok(None);
            }
            4 => Topology::List,
            5 => Topology::Strip,
            6 => Topology::Fan,
            mode => return Err(ImportError::Mode { primitive: item(), mode }),
        };
        let Some(&accessor) = primitive.attributes.get("POSITION") else {
            warnings.about(item(), "it has no POSITION and is left out");
            return Ok(None);
        };
        self.refuse_draco(primitive, accessor)?;

        let mut positions = self.positions(accessor, &item)?;
        self.morph(&mut positions, primitive, &item)?;
        if let Some(vertex) = positions.iter().position(|position| !position.is_finite()) {
            return Err(ImportError::Position { primitive: item(), vertex });
        }
        let corners = self.corners(primitive, positions.len(), &item)?;
        if matches!(topology, Topology::List) && corners.len() % 3 != 0 {
            warnings.about(item(), "its last corners make no whole triangle and are left out");
        }
        let triangles = triangles(topology, &corners);
        if triangles.is_empty() {
            warnings.about(item(), "it holds no triangle and is left out");
            return Ok(None);
        }
        let normals = self.normals(primitive, positions.len(), &item)?;
        let attributes = Arc::new(self.attributes(primitive, positions.len(), sets, &item)?);
        Ok(Some(Geometry { positions, normals, triangles, attributes }))
    }

    /// A compressed primitive that merely says so in `extensionsUsed` may lack its plain data.
    fn refuse_draco(&self, primitive: &Primitive, position: usize) -> Result<(), ImportError> {
        let accessor = self.accessors.document.accessors.get(position);
        let has_data = accessor.is_none_or(|accessor| accessor.buffer_view.is_some());
        if primitive.extensions.draco.is_some() && !has_data {
            return Err(extension::refusal("KHR_draco_mesh_compression"));
        }
        Ok(())
    }

    fn positions(&self, accessor: usize, item: &impl Fn() -> Item) -> Result<Vec<DVec3>, ImportError> {
        let numbers = self.accessors.read(accessor, &Role::POSITION, item)?;
        Ok(numbers.arrays().map(DVec3::from_array).collect())
    }

    fn normals(
        &self,
        primitive: &Primitive,
        count: usize,
        item: &impl Fn() -> Item,
    ) -> Result<Vec<DVec3>, ImportError> {
        let Some(&accessor) = primitive.attributes.get("NORMAL").filter(|_| self.normals == Normals::Shading)
        else {
            return Ok(Vec::new());
        };
        let numbers = self.accessors.read(accessor, &Role::NORMAL, item)?;
        check_length(&numbers, "NORMAL", count, item)?;
        Ok(numbers.arrays().map(DVec3::from_array).collect())
    }

    /// Adds the morph targets' displacements at their default weights.
    fn morph(
        &self,
        positions: &mut [DVec3],
        primitive: &Primitive,
        item: &impl Fn() -> Item,
    ) -> Result<(), ImportError> {
        let weights = self.weights.or(self.entry.weights.as_deref()).unwrap_or_default();
        for (target, &weight) in primitive.targets.iter().zip(weights) {
            let Some(&accessor) = target.get("POSITION").filter(|_| weight != 0.0) else { continue };
            let displacements = self.accessors.read(accessor, &Role::POSITION, item)?;
            check_length(&displacements, "morph target POSITION", positions.len(), item)?;
            for (position, displacement) in positions.iter_mut().zip(displacements.arrays()) {
                *position += weight * DVec3::from_array(displacement);
            }
        }
        Ok(())
    }

    /// The corner list, each index checked.
    fn corners(
        &self,
        primitive: &Primitive,
        count: usize,
        item: &impl Fn() -> Item,
    ) -> Result<Vec<u32>, ImportError> {
        let Some(accessor) = primitive.indices else {
            let end = u32::try_from(count).unwrap_or(u32::MAX);
            return Ok((0..end).collect());
        };
        let numbers = self.accessors.read(accessor, &Role::INDICES, item)?;
        // Indices are read as unsigned integers, which f64 holds exactly.
        let corners: Vec<u32> = numbers.arrays().map(|[index]| index as u32).collect();
        match corners.iter().position(|&index| index as usize >= count) {
            None => Ok(corners),
            Some(position) => {
                let index = corners.get(position).copied().unwrap_or_default();
                Err(ImportError::VertexIndex { primitive: item(), position, index, count })
            }
        }
    }

    fn attributes(
        &self,
        primitive: &Primitive,
        count: usize,
        sets: &[u32],
        item: &impl Fn() -> Item,
    ) -> Result<Attributes, ImportError> {
        let mut texture_coordinates = Vec::new();
        for &set in sets {
            let name = format!("TEXCOORD_{set}");
            let Some(&accessor) = primitive.attributes.get(&name) else { continue };
            let numbers = self.accessors.read(accessor, &Role::TEXCOORD, item)?;
            check_length(&numbers, &name, count, item)?;
            let values = numbers.arrays().map(|[u, v]| Vec2::new(u as f32, v as f32)).collect();
            texture_coordinates.push((set, values));
        }
        let (mut colours, mut alphas) = (None, None);
        if let Some(&accessor) = primitive.attributes.get("COLOR_0") {
            let numbers = self.accessors.read(accessor, &Role::COLOR, item)?;
            check_length(&numbers, "COLOR_0", count, item)?;
            let values: Vec<Vec3> =
                numbers.arrays().map(|[r, g, b]| Vec3::new(r as f32, g as f32, b as f32)).collect();
            // White changes nothing, and most exported vertex colours are white.
            colours = Some(values).filter(|values| values.iter().any(|&colour| colour != Vec3::ONE));
            if numbers.components() == 4 {
                let values: Vec<f32> = numbers.arrays().map(|[_, _, _, alpha]| alpha as f32).collect();
                alphas = Some(values).filter(|values| values.iter().any(|alpha| *alpha < 1.0));
            }
        }
        Ok(Attributes { texture_coordinates, colours, alphas })
    }
}

/// Joints and their weights for each vertex of a skinned primitive; `None` where it has none.
pub(super) type Influences = Vec<[(usize, f64); 4]>;

/// Reads `JOINTS_0` and `WEIGHTS_0`.
pub(super) fn influences(
    accessors: Accessors<'_>,
    primitive: &Primitive,
    item: &impl Fn() -> Item,
) -> Result<Option<Influences>, ImportError> {
    let attribute = |name| primitive.attributes.get(name).copied();
    let (Some(joints), Some(weights)) = (attribute("JOINTS_0"), attribute("WEIGHTS_0")) else {
        return Ok(None);
    };
    let joints = accessors.read(joints, &Role::JOINTS, item)?;
    let weights = accessors.read(weights, &Role::WEIGHTS, item)?;
    check_length(&weights, "WEIGHTS_0", joints.len(), item)?;
    let pairs = joints.arrays::<4>().zip(weights.arrays::<4>());
    let pair = |(joints, weights): ([f64; 4], [f64; 4])| {
        std::array::from_fn(|k| {
            let joint = joints.get(k).copied().unwrap_or_default();
            (joint as usize, weights.get(k).copied().unwrap_or_default())
        })
    };
    Ok(Some(pairs.map(pair).collect()))
}

/// The primitive's material, checked: an index into the document's materials, or `None`.
pub(super) fn material(
    accessors: Accessors<'_>,
    primitive: &Primitive,
    item: impl FnOnce() -> Item,
) -> Result<Option<usize>, ImportError> {
    let Some(index) = primitive.material else { return Ok(None) };
    follow(&accessors.document.materials, index, "material", item)?;
    Ok(Some(index))
}

fn check_length(
    numbers: &Numbers,
    attribute: &str,
    vertices: usize,
    item: &impl Fn() -> Item,
) -> Result<(), ImportError> {
    let count = numbers.len();
    if count == vertices {
        return Ok(());
    }
    let attribute = attribute.to_owned();
    Err(ImportError::AttributeLength { primitive: item(), attribute, count, vertices })
}

fn triangles(topology: Topology, corners: &[u32]) -> Vec<[u32; 3]> {
    match (topology, corners) {
        (Topology::List, _) => corners.as_chunks().0.to_vec(),
        (Topology::Strip, _) => {
            let swap = |(k, [a, b, c]): (usize, [u32; 3])| if k % 2 == 0 { [a, b, c] } else { [a, c, b] };
            runs(corners).enumerate().map(swap).collect()
        }
        (Topology::Fan, [hub, rim @ ..]) => runs(rim).map(|[a, b]| [a, b, *hub]).collect(),
        (Topology::Fan, []) => Vec::new(),
    }
}

/// Each `N` corners that follow one another.
fn runs<const N: usize>(corners: &[u32]) -> impl Iterator<Item = [u32; N]> {
    corners.windows(N).filter_map(|run| run.try_into().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Glossary of the specification: `{v_i, v_{i+(1+i%2)}, v_{i+(2-i%2)}}` for strips.
    #[test]
    fn strips_alternate_and_fans_share_their_first_corner() {
        assert_eq!(triangles(Topology::Strip, &[5, 6, 7, 8, 9]), [[5, 6, 7], [6, 8, 7], [7, 8, 9]]);
        assert_eq!(triangles(Topology::Fan, &[5, 6, 7, 8]), [[6, 7, 5], [7, 8, 5]]);
        assert_eq!(triangles(Topology::List, &[1, 2, 3, 4, 5, 6, 7]), [[1, 2, 3], [4, 5, 6]]);
        for topology in [Topology::List, Topology::Strip, Topology::Fan] {
            assert!(triangles(topology, &[1, 2]).is_empty() && triangles(topology, &[]).is_empty());
        }
    }
}
