//! `--topology adaptive`: the radiosity mesh in place of the input's triangles.
//!
//! Every lit primitive becomes the triangles of its surfaces, in its node's space, so that nodes and
//! their animations stay as they are. The attributes are `POSITION`, `NORMAL` (flat), `TEXCOORD_1`,
//! `_IRRADIANCE` (direct and indirect irradiance of the vertex, linear RGB, in the scene's units),
//! and the source's texture coordinates, colours and tangents, interpolated. Triangles that lie in several
//! charts are cut along the charts' borders.
//!
//! A node keeps its own triangles where its shape is not its triangles' alone: skins and morph
//! targets; and where its transform cannot be undone (a scale of 0).

use std::collections::BTreeMap;

use glam::{DMat4, DVec2, DVec3};
use serde_json::{Value, json};

use super::ExportError;
use super::cut::ChartedMesh;
use super::document::Object;
use super::interpolation::{Locator, PlaneTriangle, Rows};
use super::pool::{Choice, chart_coordinates};
use super::primitive::{OldSet, insert_coordinates, prepare};
use super::transform::world_from_node;
use super::writer::Writer;
use crate::retriangulate::{MeshVertex, SurfaceMesh};
use crate::scene::Placement;
use crate::surface::Surface;

/// Rows that differ by less, against their own size, are those of one vertex.
const SAME: f32 = 1e-5;

/// The vertex attribute with the solution.
const IRRADIANCE: &str = "_IRRADIANCE";

/// Replaces the geometry of those of a node's `primitives` that the `placements` (indices) name.
///
/// Returns the placements that keep their own triangles; primitives that the `choice` leaves nothing of become null.
pub(super) fn rewrite<'a>(
    writer: &mut Writer<'a>,
    placements: &[usize],
    primitives: &mut [Value],
    choice: Choice,
) -> Result<Vec<&'a Placement>, ExportError> {
    let baked = writer.baked;
    if baked.mesh.surfaces.len() != baked.surfaces.len() {
        return Err(ExportError::Mismatch { what: "meshes of the surfaces" });
    }
    let mut rest = Vec::new();
    for &index in placements {
        let Some(placement) = baked.scene.placements.get(index) else { continue };
        let primitive = primitives.get_mut(placement.primitive).and_then(Value::as_object_mut);
        let surfaces = writer.plan.surfaces_of(index);
        let meshes: Vec<Part> = surfaces.iter().filter_map(|&surface| part(writer, surface)).collect();
        match (node_from_world(writer, placement), primitive) {
            (Some(node_from_world), Some(primitive))
                if !primitive.contains_key("targets")
                    && meshes.iter().any(|p| !p.mesh.triangles.is_empty()) =>
            {
                if !has_any(writer, &meshes, choice)? {
                    primitives[placement.primitive] = Value::Null;
                    continue;
                }
                let place = (placement.mesh, choice.page, OldSet::Yields);
                prepare(&mut writer.document, &mut writer.materials, primitive, place)?;
                let attributes = primitive.get("attributes").and_then(Value::as_object);
                let rows = Rows::read(writer.document.source, attributes, placement.vertices.len())?;
                let mut builder = Builder { node_from_world, rows, ..Builder::default() };
                for part in meshes {
                    builder.add(writer, placement, &part, choice)?;
                }
                builder.write(writer, primitive);
            }
            _ => rest.push(placement),
        }
    }
    Ok(rest)
}

/// Whether any triangle is one of the choice's.
fn has_any(writer: &Writer, parts: &[Part], choice: Choice) -> Result<bool, ExportError> {
    for part in parts.iter().filter(|_| choice.is_part) {
        let charted = ChartedMesh::of(writer.baked, part.index, part.mesh)?;
        let mut charts = (0..charted.mesh.triangles.len()).map(|triangle| charted.chart(triangle));
        if charts.any(|chart| choice.takes(writer.baked.atlas, Some((part.index, chart)))) {
            return Ok(true);
        }
    }
    Ok(!choice.is_part)
}

/// A surface and the solution on it.
struct Part<'a> {
    index: usize,
    surface: &'a Surface,
    mesh: &'a SurfaceMesh,
}

fn part<'a>(writer: &Writer<'a>, index: usize) -> Option<Part<'a>> {
    let (surface, mesh) = (writer.baked.surfaces.get(index)?, writer.baked.mesh.surfaces.get(index)?);
    Some(Part { index, surface, mesh })
}

/// The way back into the node's space, if there is one and the node's shape is its own.
fn node_from_world(writer: &Writer, placement: &Placement) -> Option<DMat4> {
    let nodes = writer.document.source.json.get("nodes")?.as_array()?;
    if nodes.get(placement.node)?.get("skin").is_some() {
        return None;
    }
    let inverse = world_from_node(nodes, placement.node).inverse();
    inverse.is_finite().then_some(inverse)
}

/// Vertices and triangles of one primitive.
#[derive(Default)]
struct Builder {
    node_from_world: DMat4,
    rows: Rows,
    positions: Vec<f32>,
    normals: Vec<f32>,
    coordinates: Vec<f32>,
    irradiance: Vec<f32>,
    values: Vec<f32>,
    triangles: Vec<[u32; 3]>,
}

impl Builder {
    /// Adds a surface's triangles.
    fn add(
        &mut self,
        writer: &Writer,
        placement: &Placement,
        part: &Part,
        choice: Choice,
    ) -> Result<(), ExportError> {
        let mismatch = || ExportError::Mismatch { what: "meshes of the surfaces" };
        // Normals transform with the inverse of the transpose: here that of node from world.
        let normal = self.node_from_world.inverse().transpose().transform_vector3(part.surface.frame.normal);
        let normal = normal.normalize_or(DVec3::Z).as_vec3();
        let locator = (self.rows.width > 0).then(|| locator(writer, part.surface));
        let charted = ChartedMesh::of(writer.baked, part.index, part.mesh)?;
        let mut copies: BTreeMap<(u32, usize), Vec<u32>> = BTreeMap::new();
        for (index, &triangle) in charted.mesh.triangles.iter().enumerate() {
            let chart = charted.chart(index);
            if !choice.takes(writer.baked.atlas, Some((part.index, chart))) {
                continue;
            }
            let mut vertices =
                [MeshVertex { position: DVec2::ZERO, direct: DVec3::ZERO, indirect: DVec3::ZERO }; 3];
            for (slot, corner) in vertices.iter_mut().zip(triangle) {
                *slot = *charted.mesh.vertices.get(corner as usize).ok_or_else(mismatch)?;
            }
            let centre = vertices.iter().map(|v| v.position).sum::<DVec2>() / 3.0;
            let mut out = [0; 3];
            for (slot, (corner, vertex)) in out.iter_mut().zip(triangle.into_iter().zip(&vertices)) {
                let row = locator.as_ref().map(|l| l.interpolate(&self.rows, vertex.position, centre));
                let mut row = row.unwrap_or_default();
                self.rows.settle_tangent(&mut row, normal);
                let known = copies.entry((corner, chart)).or_default();
                *slot = match known.iter().find(|&&copy| self.has_row(copy, &row)) {
                    Some(&copy) => copy,
                    None => {
                        let copy = self.push(writer, part, chart, vertex).ok_or_else(mismatch)?;
                        self.normals.extend(normal.to_array());
                        self.values.extend(row);
                        known.push(copy);
                        copy
                    }
                };
            }
            let [a, b, c] = out;
            self.triangles.push(if placement.mirrored { [a, c, b] } else { [a, b, c] });
        }
        Ok(())
    }

    /// Adds a vertex but for its normal and row and returns its index.
    fn push(&mut self, writer: &Writer, part: &Part, chart: usize, vertex: &MeshVertex) -> Option<u32> {
        let index = u32::try_from(self.positions.len() / 3).ok()?;
        let world = part.surface.frame.lift(vertex.position);
        let local = self.node_from_world.transform_point3(world).as_vec3();
        self.positions.extend(local.to_array());
        self.coordinates.extend(chart_coordinates(writer.baked, (part.index, chart), world));
        self.irradiance.extend((vertex.direct + vertex.indirect).as_vec3().to_array());
        Some(index)
    }

    fn has_row(&self, vertex: u32, row: &[f32]) -> bool {
        let start = vertex as usize * self.rows.width;
        let held = self.values.get(start..start + self.rows.width).unwrap_or_default();
        held.iter().zip(row).all(|(a, b)| (a - b).abs() <= SAME * a.abs().max(1.0))
    }

    /// Puts the geometry on the primitive in place of the old one.
    fn write(self, writer: &mut Writer, primitive: &mut Object) {
        let document = &mut writer.document;
        let count = self.positions.len() / 3;
        let mut attributes = Object::new();
        let position = document.add_floats(&self.positions, 3);
        if let Some(accessor) = document.entry("accessors", position) {
            // glTF demands these of positions.
            let bound = |pick: fn(f32, f32) -> f32, start: f32| {
                let corner = self.positions.chunks_exact(3).fold([start; 3], |m, p| {
                    let mut m = m;
                    m.iter_mut().zip(p).for_each(|(m, &p)| *m = pick(*m, p));
                    m
                });
                json!(corner.map(f64::from))
            };
            accessor.insert("min".into(), bound(f32::min, f32::INFINITY));
            accessor.insert("max".into(), bound(f32::max, f32::NEG_INFINITY));
        }
        attributes.insert("POSITION".into(), position.into());
        attributes.insert("NORMAL".into(), document.add_floats(&self.normals, 3).into());
        let mut start = 0;
        for (name, components) in &self.rows.columns {
            let rows = self.values.chunks_exact(self.rows.width);
            let column: Vec<f32> =
                rows.filter_map(|row| row.get(start..start + components)).flatten().copied().collect();
            attributes.insert(name.clone(), document.add_floats(&column, *components).into());
            start += components;
        }
        attributes.insert(IRRADIANCE.into(), document.add_floats(&self.irradiance, 3).into());
        let coordinates = document.add_floats(&self.coordinates, 2);
        let indices = document.add_triangles(&self.triangles, count);
        primitive.insert("attributes".into(), attributes.into());
        insert_coordinates(primitive, coordinates);
        primitive.insert("indices".into(), indices.into());
        primitive.shift_remove("mode");
    }
}

/// The source's triangles of a surface, ready to be searched.
fn locator(writer: &Writer, surface: &Surface) -> Locator {
    let scene = writer.baked.scene;
    let triangle = |&index: &usize| {
        let triangle = scene.triangles.get(index)?;
        let [a, b, c] = triangle.vertices.map(|vertex| scene.vertices.get(vertex as usize));
        let corners = [*a?, *b?, *c?].map(|world| surface.frame.project(world));
        Some(PlaneTriangle { corners, vertices: triangle.source_vertices })
    };
    Locator::new(surface.source_triangles.iter().filter_map(triangle).collect())
}
