//! Who is lit, and which mesh each lit node gets.
//!
//! Lightmap coordinates belong to one placement, so every lit node needs a mesh of its own. The first
//! lit user of a mesh keeps it in place, unless a node without light uses it too; others get copies
//! that share all accessors but the new ones.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::cut::Cuts;
use super::document::{Object, index_of};
use super::{Baked, ExportError};
use crate::surface::Surface;
use crate::unwrap::Atlas;

/// A node whose mesh is lit.
#[derive(Clone, Debug)]
pub(super) struct LitNode {
    /// Index into the document's `nodes`.
    pub(super) node: usize,
    /// The source's mesh.
    pub(super) mesh: usize,
    /// Whether the node's mesh stays where it is; else it is added as a copy.
    pub(super) in_place: bool,
    /// Its placements, at most one a primitive.
    pub(super) placements: Vec<usize>,
}

/// What will be written.
#[derive(Debug)]
pub(super) struct Plan {
    /// In scene traversal order.
    pub(super) nodes: Vec<LitNode>,
    /// Materials that a primitive without a lightmap uses.
    pub(super) unlit_materials: BTreeSet<usize>,
    /// The surface of each triangle of the scene.
    pub(super) surface_of: Vec<Option<usize>>,
    /// How triangles are cut.
    pub(super) cuts: Cuts,
    /// The surfaces of each placement.
    surfaces: BTreeMap<usize, Vec<usize>>,
}

impl Plan {
    /// Sorts the placements by node and decides about meshes and materials.
    pub(super) fn new(baked: &Baked) -> Result<Self, ExportError> {
        let surface_of = surface_of(baked)?;
        let mut nodes: Vec<LitNode> = Vec::new();
        let mut by_node = BTreeMap::new();
        for (index, placement) in baked.scene.placements.iter().enumerate() {
            if placement.triangles.is_empty() || !placement.settings.bake {
                continue;
            }
            let slot = *by_node.entry(placement.node).or_insert(nodes.len());
            if slot == nodes.len() {
                let (node, mesh) = (placement.node, placement.mesh);
                nodes.push(LitNode { node, mesh, in_place: false, placements: Vec::new() });
            }
            if let Some(node) = nodes.get_mut(slot) {
                let again = |&other: &usize| {
                    let other = baked.scene.placements.get(other);
                    other.is_some_and(|other| {
                        other.primitive == placement.primitive || other.mesh != placement.mesh
                    })
                };
                if node.placements.iter().any(again) {
                    return Err(ExportError::Mismatch {
                        what: "placements that share a node and a primitive",
                    });
                }
                node.placements.push(index);
            }
        }
        let mut surfaces: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (index, surface) in baked.surfaces.iter().enumerate() {
            surfaces.entry(surface.placement).or_default().push(index);
        }
        let cuts = Cuts::of(baked);
        let mut plan = Self { nodes, unlit_materials: BTreeSet::new(), surface_of, cuts, surfaces };
        plan.assign_meshes(baked, &by_node);
        Ok(plan)
    }

    /// The surfaces of a placement, in order.
    pub(super) fn surfaces_of(&self, placement: usize) -> &[usize] {
        self.surfaces.get(&placement).map_or(&[], Vec::as_slice)
    }

    /// The pages on which a node's surfaces lie, ascending; at least one.
    pub(super) fn pages_of(&self, node: &LitNode, atlas: &Atlas) -> Vec<usize> {
        let surfaces = node.placements.iter().flat_map(|&placement| self.surfaces_of(placement));
        let charts = surfaces.flat_map(|&surface| atlas.charts_of(surface));
        let pages: BTreeSet<usize> = charts.map(|chart| chart.page).collect();
        if pages.is_empty() { vec![0] } else { pages.into_iter().collect() }
    }

    fn assign_meshes(&mut self, baked: &Baked, lit: &BTreeMap<usize, usize>) {
        let source_nodes = baked.scene.source.json.get("nodes").and_then(Value::as_array);
        let mut kept = BTreeSet::new();
        for (index, node) in source_nodes.into_iter().flatten().enumerate() {
            if let (Some(mesh), false) = (index_of(node.get("mesh")), lit.contains_key(&index)) {
                kept.insert(mesh);
            }
        }
        for node in &mut self.nodes {
            node.in_place = kept.insert(node.mesh);
        }
        self.find_unlit_materials(baked);
    }

    /// Materials of all primitives that will still be there and carry no lightmap.
    fn find_unlit_materials(&mut self, baked: &Baked) {
        let moved: BTreeSet<usize> = self.nodes.iter().filter(|n| n.in_place).map(|n| n.mesh).collect();
        let meshes = baked.scene.source.json.get("meshes").and_then(Value::as_array);
        for (index, mesh) in meshes.into_iter().flatten().enumerate() {
            if !moved.contains(&index) {
                self.unlit_materials.extend(materials_of(mesh, &BTreeSet::new()));
            }
        }
        for node in &self.nodes {
            let placements = node.placements.iter().filter_map(|&p| baked.scene.placements.get(p));
            let lit: BTreeSet<usize> = placements.map(|placement| placement.primitive).collect();
            let mesh = meshes.and_then(|list| list.get(node.mesh)).unwrap_or(&Value::Null);
            self.unlit_materials.extend(materials_of(mesh, &lit));
        }
    }
}

/// Materials of a mesh's primitives other than `except`.
fn materials_of(mesh: &Value, except: &BTreeSet<usize>) -> Vec<usize> {
    let primitives = mesh.get("primitives").and_then(Value::as_array).into_iter().flatten().enumerate();
    let others = primitives.filter(|(index, _)| !except.contains(index));
    others.filter_map(|(_, primitive)| primitive.as_object()).flat_map(primitive_materials).collect()
}

/// A primitive's material and those of its variants (`KHR_materials_variants`).
pub(super) fn primitive_materials(primitive: &Object) -> Vec<usize> {
    let variants = primitive.get("extensions").and_then(|e| e.get("KHR_materials_variants")?.get("mappings"));
    let variants = variants.and_then(Value::as_array).into_iter().flatten();
    let variants = variants.filter_map(|mapping| index_of(mapping.get("material")));
    index_of(primitive.get("material")).into_iter().chain(variants).collect()
}

/// Turns the surfaces' lists of triangles round.
fn surface_of(baked: &Baked) -> Result<Vec<Option<usize>>, ExportError> {
    let is_lit = |surface: &Surface| {
        baked.scene.placements.get(surface.placement).is_none_or(|placement| placement.settings.bake)
    };
    let lacks = |(index, surface)| is_lit(surface) && baked.atlas.charts_of(index).is_empty();
    if baked.surfaces.iter().enumerate().any(lacks) {
        return Err(ExportError::Mismatch { what: "charts" });
    }
    let mut surface_of = vec![None; baked.scene.triangles.len()];
    for (index, surface) in baked.surfaces.iter().enumerate() {
        for &triangle in &surface.source_triangles {
            match surface_of.get_mut(triangle) {
                Some(slot) => *slot = Some(index),
                None => return Err(ExportError::Mismatch { what: "surfaces" }),
            }
        }
    }
    Ok(surface_of)
}
