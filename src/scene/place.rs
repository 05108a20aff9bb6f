//! Puts the nodes' meshes into the world: placements, vertices, triangles.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::accessor::{Accessors, Role};
use super::appearance::Attributes;
use super::document::{Document, Node, follow};
use super::hierarchy::{PlacedNode, is_invertible};
use super::primitive::{Geometry, PrimitiveReader, influences, material};
use super::warning::Warnings;
use super::{ImportError, Item, MAX_COORDINATE, MAX_COUNT, NodeSettings, Placement, Triangle};
use crate::geom::triangle::area_normal;
use crate::options::{Dynamic, Normals};

/// A triangle counts as without area where its height is below this share of its longest edge.
const FLAT: f64 = 1e-12;

/// The geometry of a scene.
#[derive(Debug, Default)]
pub(super) struct Placed {
    pub(super) vertices: Vec<DVec3>,
    /// One a vertex, zero where there is none; none at all where they are not read.
    pub(super) normals: Vec<DVec3>,
    pub(super) triangles: Vec<Triangle>,
    pub(super) placements: Vec<Placement>,
    /// One entry a placement.
    pub(super) attributes: Vec<Arc<Attributes>>,
}

/// Places the meshes of `nodes`. `sets` gives the texture coordinate sets of a material,
/// whose index is the number of the document's materials for the default one.
pub(super) fn place(
    accessors: Accessors<'_>,
    nodes: &[PlacedNode],
    settings: &[NodeSettings],
    (dynamic, normals): (Dynamic, Normals),
    sets: &dyn Fn(usize) -> Vec<u32>,
    warnings: &mut Warnings,
) -> Result<Placed, ImportError> {
    let worlds = nodes.iter().map(|node| (node.index, node.world)).collect();
    let (cache, placed) = (BTreeMap::new(), Placed::default());
    let mut placer =
        Placer { accessors, worlds, sets, cache, placed, dynamic, normals, left_out: false, warnings };
    for node in nodes {
        let settings = settings.get(node.index).copied().unwrap_or_default();
        placer.node(*node, settings)?;
    }
    let Placer { placed, left_out, .. } = placer;
    let is_lit = placed.placements.iter().any(|placement| placement.settings.bake);
    match (placed.triangles.is_empty() && !left_out, is_lit) {
        (true, _) => Err(ImportError::NoTriangles),
        (false, false) => Err(ImportError::NothingToLight),
        (false, true) => Ok(placed),
    }
}

struct Placer<'a> {
    accessors: Accessors<'a>,
    worlds: BTreeMap<usize, DAffine3>,
    sets: &'a dyn Fn(usize) -> Vec<u32>,
    /// Primitives read before, by mesh and primitive.
    cache: BTreeMap<(usize, usize), Option<Arc<Geometry>>>,
    placed: Placed,
    dynamic: Dynamic,
    normals: Normals,
    /// Whether something was left out because it moves.
    left_out: bool,
    warnings: &'a mut Warnings,
}

/// A primitive on a node.
struct Spot<'a> {
    node: PlacedNode,
    entry: &'a Node,
    mesh: usize,
    primitive: usize,
    settings: NodeSettings,
}

impl<'a> Placer<'a> {
    fn node(&mut self, node: PlacedNode, mut settings: NodeSettings) -> Result<(), ImportError> {
        let document = self.accessors.document;
        let item = || document.node_item(node.index);
        let Some(entry) = document.nodes.get(node.index) else { return Ok(()) };
        let Some(mesh) = entry.mesh else { return Ok(()) };
        let primitives = &follow(&document.meshes, mesh, "mesh", item)?.primitives;
        if settings.is_dynamic && self.dynamic == Dynamic::Ignore {
            self.left_out = true;
            self.warnings.about(
                item(),
                "it moves (animation, skin or morph targets) and is left out; --dynamic cast bakes the shadow of its \
                 rest pose",
            );
            return Ok(());
        }
        if settings.is_dynamic {
            settings.bake = false;
            self.warnings.about(
                item(),
                "it moves (animation, skin or morph targets), so it gets no lightmap; its rest pose throws shadows",
            );
        }
        if entry.skin.is_none() && !is_invertible(&node.world) {
            return Err(ImportError::Transform { node: item() });
        }
        for primitive in 0..primitives.len() {
            self.primitive(&Spot { node, entry, mesh, primitive, settings })?;
        }
        Ok(())
    }

    fn primitive(&mut self, spot: &Spot<'a>) -> Result<(), ImportError> {
        let document = self.accessors.document;
        let item = || document.primitive_item(spot.mesh, spot.primitive);
        let Some(primitive) =
            document.meshes.get(spot.mesh).and_then(|mesh| mesh.primitives.get(spot.primitive))
        else {
            return Ok(());
        };
        let material = material(self.accessors, primitive, item)?.unwrap_or(document.materials.len());
        let Some(geometry) = self.geometry(spot, material)? else { return Ok(()) };

        let (vertices, triangles) = (self.placed.vertices.len(), self.placed.triangles.len());
        refuse_excess("vertices", vertices, geometry.positions.len())?;
        refuse_excess("triangles", triangles, geometry.triangles.len())?;
        let (world, mirrored) = self.world_positions(spot, &geometry)?;
        let inside = |v: &DVec3| v.abs().max_element() <= MAX_COORDINATE;
        if !world.iter().all(inside) {
            return Err(ImportError::TooFar { node: document.node_item(spot.node.index) });
        }

        // Both counts are at most MAX_COUNT, which u32 holds.
        let (base, placement) = (vertices as u32, self.placed.placements.len() as u32);
        let mut flat = 0_usize;
        for &source in &geometry.triangles {
            let [a, b, c] = source;
            let source_vertices = if mirrored { [a, c, b] } else { source };
            let corners = source_vertices.map(|k| world.get(k as usize).copied().unwrap_or_default());
            flat += usize::from(is_flat(corners));
            let vertices = source_vertices.map(|k| base + k);
            self.placed.triangles.push(Triangle { vertices, source_vertices, placement });
        }
        if flat > 0 {
            let subject = format!("{} ({flat} of {})", item(), geometry.triangles.len());
            self.warnings.about(subject, "triangles without area, which receive no light");
        }
        if self.normals == Normals::Shading {
            self.placed.normals.extend(world_normals(spot, &geometry));
        }
        self.placed.vertices.extend(world);
        self.placed.attributes.push(Arc::clone(&geometry.attributes));
        self.placed.placements.push(Placement {
            node: spot.node.index,
            mesh: spot.mesh,
            primitive: spot.primitive,
            material,
            triangles: triangles..self.placed.triangles.len(),
            vertices: vertices..self.placed.vertices.len(),
            mirrored,
            settings: spot.settings,
        });
        Ok(())
    }

    /// The primitive's geometry, read once for all nodes that do not morph it their own way.
    fn geometry(&mut self, spot: &Spot<'a>, material: usize) -> Result<Option<Arc<Geometry>>, ImportError> {
        let key = (spot.mesh, spot.primitive);
        let own_weights = spot.entry.weights.as_deref();
        if own_weights.is_none()
            && let Some(known) = self.cache.get(&key)
        {
            return Ok(known.clone());
        }
        let document = self.accessors.document;
        let Some(entry) = document.meshes.get(spot.mesh) else { return Ok(None) };
        let reader = PrimitiveReader {
            accessors: self.accessors,
            mesh: spot.mesh,
            entry,
            normals: self.normals,
            weights: own_weights,
        };
        let sets = (self.sets)(material);
        let geometry = reader.read(spot.primitive, &sets, self.warnings)?.map(Arc::new);
        if let Some(geometry) = &geometry {
            let has = |set| geometry.attributes.texture_coordinates.iter().any(|(known, _)| *known == set);
            if let Some(missing) = sets.iter().find(|set| !has(**set)) {
                let text = format!("it lacks TEXCOORD_{missing}, so its texture counts by its mean");
                self.warnings.about(document.primitive_item(spot.mesh, spot.primitive), text);
            }
        }
        if own_weights.is_none() {
            self.cache.insert(key, geometry.clone());
        }
        Ok(geometry)
    }

    /// World-space positions, and whether the transform mirrors.
    fn world_positions(
        &self,
        spot: &Spot<'a>,
        geometry: &Geometry,
    ) -> Result<(Vec<DVec3>, bool), ImportError> {
        if let Some(skin) = spot.entry.skin
            && let Some(matrices) = self.skin_matrices(spot, skin, geometry.positions.len())?
        {
            let mirrored = matrices.first().is_some_and(|m| m.matrix3.determinant() < 0.0);
            let pairs = geometry.positions.iter().zip(&matrices);
            return Ok((pairs.map(|(p, m)| m.transform_point3(*p)).collect(), mirrored));
        }
        let world = spot.node.world;
        if !is_invertible(&world) {
            return Err(ImportError::Transform { node: self.accessors.document.node_item(spot.node.index) });
        }
        let positions = geometry.positions.iter().map(|p| world.transform_point3(*p)).collect();
        Ok((positions, world.matrix3.determinant() < 0.0))
    }

    /// Each vertex's matrix in the joints' rest pose; by the specification the node's own transform
    /// has no say. `None` where the primitive has no joints.
    fn skin_matrices(
        &self,
        spot: &Spot<'a>,
        skin: usize,
        vertices: usize,
    ) -> Result<Option<Vec<DAffine3>>, ImportError> {
        let document = self.accessors.document;
        let entry = follow(&document.skins, skin, "skin", || document.node_item(spot.node.index))?;
        let item = || document.primitive_item(spot.mesh, spot.primitive);
        let Some(primitive) =
            document.meshes.get(spot.mesh).and_then(|mesh| mesh.primitives.get(spot.primitive))
        else {
            return Ok(None);
        };
        let Some(influences) = influences(self.accessors, primitive, &item)? else { return Ok(None) };
        if influences.len() != vertices {
            let (attribute, count) = ("JOINTS_0".to_owned(), influences.len());
            return Err(ImportError::AttributeLength { primitive: item(), attribute, count, vertices });
        }
        let joints = self.joint_matrices(skin, entry)?;
        let sum = |pairs: &[(usize, f64); 4]| {
            let mut sum = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
            let total: f64 = pairs.iter().map(|(_, weight)| weight).sum();
            if total.is_nan() || total <= 0.0 {
                return Ok(spot.node.world); // a vertex that no joint moves
            }
            for &(joint, weight) in pairs.iter().filter(|(_, weight)| *weight != 0.0) {
                let matrix = joints.get(joint).ok_or_else(|| ImportError::Reference {
                    from: item(),
                    kind: "joint",
                    index: joint,
                    count: joints.len(),
                })?;
                let share = weight / total;
                sum.matrix3 += share * matrix.matrix3;
                sum.translation += share * matrix.translation;
            }
            Ok(sum)
        };
        influences.iter().map(sum).collect::<Result<_, _>>().map(Some)
    }

    /// From bind space to the world, joint by joint.
    fn joint_matrices(
        &self,
        index: usize,
        skin: &super::document::Skin,
    ) -> Result<Vec<DAffine3>, ImportError> {
        let document = self.accessors.document;
        let item = || Item::new("skin", index, skin.name.as_deref());
        let mut inverse_binds = Vec::new();
        if let Some(accessor) = skin.inverse_bind_matrices {
            let numbers = self.accessors.read(accessor, &Role::MATRICES, item)?;
            inverse_binds.extend(numbers.arrays::<16>().map(|m| DAffine3 {
                matrix3: DMat3::from_cols(
                    DVec3::new(m[0], m[1], m[2]),
                    DVec3::new(m[4], m[5], m[6]),
                    DVec3::new(m[8], m[9], m[10]),
                ),
                translation: DVec3::new(m[12], m[13], m[14]),
            }));
        }
        let mut matrices = Vec::with_capacity(skin.joints.len());
        for (k, &joint) in skin.joints.iter().enumerate() {
            follow(&document.nodes, joint, "node", item)?;
            // A joint outside the scene has no place in it; its mesh then stays in bind space.
            let world = self.worlds.get(&joint).copied().unwrap_or(DAffine3::IDENTITY);
            matrices.push(world * inverse_binds.get(k).copied().unwrap_or(DAffine3::IDENTITY));
        }
        Ok(matrices)
    }
}

/// One a vertex: unit length, or zero where there is none or where the mesh moves.
///
/// The transform's inverse transpose keeps them on the side that the winding shows, mirrored or not.
fn world_normals(spot: &Spot, geometry: &Geometry) -> Vec<DVec3> {
    if geometry.normals.is_empty() || spot.settings.is_dynamic {
        return vec![DVec3::ZERO; geometry.positions.len()];
    }
    let to_world = spot.node.world.matrix3.inverse().transpose();
    geometry.normals.iter().map(|&normal| (to_world * normal).normalize_or_zero()).collect()
}

fn refuse_excess(what: &'static str, present: usize, more: usize) -> Result<(), ImportError> {
    if present.saturating_add(more) > MAX_COUNT {
        return Err(ImportError::TooLarge { what, limit: MAX_COUNT });
    }
    Ok(())
}

fn is_flat(corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners;
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    area_normal(corners).length() <= FLAT * longest
}

/// The materials that placed triangles show, as indices into the scene's materials.
pub(super) fn materials_in_use(document: &Document, placed: &Placed) -> Vec<bool> {
    let mut used = vec![false; document.materials.len() + 1];
    for placement in &placed.placements {
        if let Some(slot) = used.get_mut(placement.material) {
            *slot = true;
        }
    }
    used
}
