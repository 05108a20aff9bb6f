//! `--topology source`: the input's own triangles with a second set of texture coordinates.
//!
//! Where no vertex has to be split, a primitive keeps its accessors and only `TEXCOORD_1` is new.
//! Where one has, every attribute and morph target is written anew, byte for byte, with the copies
//! at the end; instances whose tables of copies are equal share the result. Strips and fans become
//! lists, since their corners cannot be split.
//!
//! A kept layout has one place for each vertex, so nothing is split there.
//!
//! Triangles of surfaces with several charts are cut along the charts' borders; what is new there is
//! interpolated, see [`super::blend`].

use std::collections::BTreeMap;

use glam::DVec2;
use serde_json::Value;

use super::ExportError;
use super::accessor::{self, Component};
use super::blend::{Blend, Kind, blend};
use super::document::{Document, Object, Target, index_of};
use super::materials::LIGHTMAP_SET;
use super::pool::{Charted, Choice, Pool};
use super::primitive::{OldSet, attribute_maps, insert_coordinates, prepare, set_name};
use super::writer::Writer;
use crate::scene::Placement;

/// glTF's primitive mode of triangle lists.
const TRIANGLES: u64 = 4;

/// Contents and the accessor that holds them.
type Known<T> = Vec<(Vec<T>, usize)>;

/// Accessors that were written anew, so that instances can share them.
#[derive(Debug, Default)]
pub(super) struct Rewritten {
    /// By source accessor and the way to mix: the table of vertices, and the new accessor.
    attributes: BTreeMap<(usize, Kind), Known<Blend>>,
    /// By mesh and primitive: the triangles, and their accessor.
    indices: BTreeMap<(usize, usize), Known<[u32; 3]>>,
}

/// Placements that draw from the same vertices: their attributes and targets are equal.
struct Group<'a> {
    attributes: Option<Value>,
    targets: Option<Value>,
    placements: Vec<&'a Placement>,
}

/// Gives those of a node's `primitives` that `placements` name their lightmap coordinates; those that the `choice`
/// leaves nothing of become null.
pub(super) fn rewrite(
    writer: &mut Writer,
    placements: &[&Placement],
    primitives: &mut [Value],
    choice: Choice,
) -> Result<(), ExportError> {
    for group in group(placements, primitives)? {
        let count = vertex_count(writer, &group)?;
        let (surface_of, cuts) = (&writer.plan.surface_of, &writer.plan.cuts);
        let charted = Charted { baked: writer.baked, surface_of, cuts, choice };
        let kept = kept_layout(writer, &group, count)?;
        let pool = match &kept {
            Some(kept) => charted.uncharted_pool(&group.placements, &kept.coordinates)?,
            None => charted.pool(&group.placements, count)?,
        };
        if pool.corners.iter().all(Vec::is_empty) {
            group.placements.iter().for_each(|p| primitives[p.primitive] = Value::Null);
            continue;
        }
        let kept = kept.and_then(|kept| kept.accessor);
        let coordinates =
            kept.unwrap_or_else(|| writer.document.add_floats(pool.coordinates.as_flattened(), 2));
        let old_set = if kept.is_some() { OldSet::Stays } else { OldSet::Yields };
        for (placement, corners) in group.placements.iter().zip(&pool.corners) {
            if corners.is_empty() {
                primitives[placement.primitive] = Value::Null;
                continue;
            }
            let primitive = primitives.get_mut(placement.primitive).and_then(Value::as_object_mut);
            let primitive = primitive.ok_or_else(|| not_there(placement))?;
            prepare(
                &mut writer.document,
                &mut writer.materials,
                primitive,
                (placement.mesh, choice.page, old_set),
            )?;
            if !pool.unsplit {
                for (attributes, target) in attribute_maps(primitive) {
                    for (name, value) in attributes {
                        if let Some(accessor) = index_of(Some(value)) {
                            let kind = Kind::of(name, target);
                            *value = expand(writer, (accessor, kind), &pool, count)?.into();
                        }
                    }
                }
            }
            insert_coordinates(primitive, coordinates);
            let mode = primitive.get("mode").and_then(Value::as_u64).unwrap_or(TRIANGLES);
            if !pool.unsplit || pool.partial || mode != TRIANGLES {
                let indices = list_of_triangles(writer, placement, corners, pool.vertices.len());
                primitive.insert("indices".into(), indices.into());
                primitive.shift_remove("mode");
            }
        }
    }
    Ok(())
}

/// Sorts placements by the vertices that they draw from.
fn group<'a>(placements: &[&'a Placement], primitives: &[Value]) -> Result<Vec<Group<'a>>, ExportError> {
    let mut groups: Vec<Group> = Vec::new();
    for &placement in placements {
        let primitive = primitives.get(placement.primitive).ok_or_else(|| not_there(placement))?;
        let (attributes, targets) = (primitive.get("attributes"), primitive.get("targets"));
        let same = |g: &&mut Group| {
            g.attributes.as_ref() == attributes
                && g.targets.as_ref() == targets
                && g.placements.first().is_some_and(|first| first.vertices.len() == placement.vertices.len())
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.placements.push(placement),
            None => groups.push(Group {
                attributes: attributes.cloned(),
                targets: targets.cloned(),
                placements: vec![placement],
            }),
        }
    }
    Ok(groups)
}

/// A layout that the input brought.
struct KeptLayout {
    /// Where each vertex lies in its page, texture coordinates.
    coordinates: Vec<[f32; 2]>,
    /// The input's accessor, where it says so already.
    accessor: Option<usize>,
}

/// The layout of a group of `count` vertices, if it is kept: the placements' own, where the atlas puts it.
fn kept_layout(writer: &Writer, group: &Group, count: usize) -> Result<Option<KeptLayout>, ExportError> {
    let baked = writer.baked;
    let triangle = group.placements.first().and_then(|p| baked.scene.triangles.get(p.triangles.start));
    let block = triangle.and_then(|triangle| baked.authored.block_of(triangle.placement as usize));
    let Some(place) = block.and_then(|block| baked.atlas.blocks.get(block)) else { return Ok(None) };
    let mismatch = || ExportError::Mismatch { what: "kept layouts" };
    let attributes = group.attributes.as_ref();
    let accessor = index_of(attributes.and_then(|attributes| attributes.get(set_name(LIGHTMAP_SET))));
    let accessor = accessor.ok_or_else(mismatch)?;
    let elements = accessor::read(writer.document.source, accessor, count)?;
    let page_from_uv = place.page_from_uv(baked.atlas);
    let place = |&[u, v]: &[f32; 2]| {
        let Some(map) = page_from_uv else { return [u, v] };
        let placed = map.transform_point2(DVec2::new(u.into(), v.into())).as_vec2();
        // No triangle has those that are not finite.
        if placed.is_finite() { placed.to_array() } else { [0.0; 2] }
    };
    let coordinates: Vec<[f32; 2]> = elements.floats().as_chunks().0.iter().map(place).collect();
    if coordinates.len() != count {
        return Err(mismatch());
    }
    Ok(Some(KeptLayout { coordinates, accessor: page_from_uv.is_none().then_some(accessor) }))
}

/// The group's number of vertices, the same in the scene and in the document.
fn vertex_count(writer: &Writer, group: &Group) -> Result<usize, ExportError> {
    let held = group.placements.first().map_or(0, |first| first.vertices.len());
    let position = group.attributes.as_ref().and_then(|attributes| index_of(attributes.get("POSITION")));
    let accessor = position.and_then(|position| writer.document.list("accessors").get(position));
    match accessor.and_then(|accessor| index_of(accessor.get("count"))) {
        Some(count) if count == held => Ok(count),
        _ => Err(ExportError::Mismatch { what: "vertices" }),
    }
}

/// The accessor that holds an accessor's elements in the pool's order, mixed where the pool's vertices are.
fn expand(
    writer: &mut Writer,
    (accessor, kind): (usize, Kind),
    pool: &Pool,
    count: usize,
) -> Result<usize, ExportError> {
    // Copies are the same whatever they are of.
    let mixed = pool.vertices.iter().any(|vertex| vertex.original().is_none());
    let kind = if mixed { kind } else { Kind::Choice };
    let known = writer.rewritten.attributes.get(&(accessor, kind));
    let known = known.and_then(|list| list.iter().find(|(vertices, _)| *vertices == pool.vertices));
    if let Some(&(_, made)) = known {
        return Ok(made);
    }
    let source = accessor::read(writer.document.source, accessor, count)?;
    let elements = blend(&source, kind, &pool.vertices);
    let stride = elements.size.next_multiple_of(4);
    let mut bytes = Vec::with_capacity(pool.vertices.len() * stride);
    for element in elements.bytes.chunks_exact(elements.size.max(1)) {
        bytes.extend_from_slice(element);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    let original = writer.document.list("accessors").get(accessor).and_then(Value::as_object);
    let mut description: Object = original.cloned().unwrap_or_default();
    description.shift_remove("sparse");
    description.insert("count".into(), pool.vertices.len().into());
    if elements.component != source.component {
        description.insert("componentType".into(), Component::FLOAT.into());
        description.shift_remove("normalized");
    }
    if !pool.complete && (description.contains_key("min") || description.contains_key("max")) {
        match elements.extremes((0..).take(pool.vertices.len())) {
            Some((min, max)) => {
                description.insert("min".into(), min.into());
                description.insert("max".into(), max.into());
            }
            None => {
                description.shift_remove("min");
                description.shift_remove("max");
            }
        }
    }
    let made = writer.document.add_accessor(description, Target::Vertices(stride), &bytes);
    let known = writer.rewritten.attributes.entry((accessor, kind)).or_default();
    known.push((pool.vertices.clone(), made));
    Ok(made)
}

/// The accessor that holds a placement's triangles.
fn list_of_triangles(
    writer: &mut Writer,
    placement: &Placement,
    corners: &[[u32; 3]],
    vertices: usize,
) -> usize {
    let document: &mut Document = &mut writer.document;
    let list = writer.rewritten.indices.entry((placement.mesh, placement.primitive)).or_default();
    match list.iter().find(|(known, _)| known == corners) {
        Some(&(_, made)) => made,
        None => {
            let made = document.add_triangles(corners, vertices);
            list.push((corners.to_vec(), made));
            made
        }
    }
}

fn not_there(placement: &Placement) -> ExportError {
    ExportError::Malformed {
        list: "mesh",
        index: placement.mesh,
        problem: "lacks a primitive that was baked",
    }
}
