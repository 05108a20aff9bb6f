//! Assembling the output document: meshes, materials, nodes and the lightmaps themselves.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::document::{Document, Object, edit_object};
use super::layout::{drop_extensions, forget_extensions};
use super::materials::{LIGHTMAP_SET, LightmapImage, Materials};
use super::plan::{LitNode, Plan};
use super::pool::Choice;
use super::primitive::DRACO;
use super::source::{self, Rewritten};
use super::{Baked, ExportError, Png, adaptive, elements, encode_exr, encode_png, encode_previews};
use crate::options::{BakeOptions, Quantity, Toggle, Topology};
use crate::scene::Placement;
use crate::unwrap::PageArea;

/// Our own extension: on the root the lightmaps, on nodes which one lights them.
pub(crate) const COBAKE_LIGHTMAP: &str = "COBAKE_lightmap";

/// What is written, and what of it can be shared.
pub(super) struct Writer<'a> {
    /// The results.
    pub(super) baked: &'a Baked<'a>,
    /// Who is lit.
    pub(super) plan: &'a Plan,
    /// The output so far.
    pub(super) document: Document<'a>,
    /// The materials' variants.
    pub(super) materials: Materials,
    /// Accessors written anew.
    pub(super) rewritten: Rewritten,
}

/// Builds the GLB.
pub(super) fn write_document(baked: &Baked) -> Result<Vec<u8>, ExportError> {
    let plan = Plan::new(baked)?;
    let mut writer = Writer {
        baked,
        plan: &plan,
        document: Document::open(&baked.scene.source),
        materials: Materials::new(lightmap_images(baked)?, plan.unlit_materials.clone()),
        rewritten: Rewritten::default(),
    };
    forget_earlier_bake(&mut writer.document.root);
    for node in &plan.nodes {
        write_node(&mut writer, node)?;
    }
    let mut document = writer.document;
    forget_unused_draco(&mut document.root);
    let mut lightmaps = Vec::new();
    for &area in &baked.atlas.pages {
        let page = baked.lightmap.page(area);
        lightmaps.push(json!({
            "bufferView": document.add_view(encode_exr(&page)?),
            "mimeType": "image/x-exr",
            "width": page.width,
            "height": page.height,
            "quantity": baked.options.quantity,
            "includes": includes(baked.options.quantity),
        }));
    }
    let elements = match baked.options.elements {
        Toggle::On => elements::write(&mut document, baked.facets),
        Toggle::Off => None,
    };
    let mut extension = json!({
        "version": 1,
        "lightmaps": lightmaps,
        "baked": provenance(baked),
    });
    if let (Some(elements), Some(extension)) = (elements, extension.as_object_mut()) {
        extension.insert("elements".into(), elements);
    }
    edit_object(&mut document.root, "extensions", |extensions| {
        extensions.insert(COBAKE_LIGHTMAP.into(), extension);
    });
    document.use_extension(COBAKE_LIGHTMAP);
    document.finish()
}

/// Each page's preview where there is to be one. Else the image for `MOZ_lightmap`, whose texels are irradiance by definition: radiance is scaled by π,
/// and radiosity cannot be told as irradiance at all, so there the file has no image.
fn lightmap_images(baked: &Baked) -> Result<Vec<LightmapImage>, ExportError> {
    let areas = &baked.atlas.pages;
    if let Some(form) = baked.options.preview {
        let sent_out = baked.preview.ok_or(ExportError::Mismatch { what: "a preview's texels" })?;
        let image =
            |png: Png| LightmapImage { intensity: f64::from(png.scale), png: png.bytes, preview: Some(form) };
        return Ok(encode_previews(sent_out, areas, form)?.into_iter().map(image).collect());
    }
    let factor = match baked.options.quantity {
        Quantity::Irradiance => 1.0,
        Quantity::Radiance => PI,
        Quantity::Radiosity => return Ok(Vec::new()),
    };
    let image = |area: &PageArea| {
        let png = encode_png(&baked.lightmap.page(*area))?;
        Ok(LightmapImage { png: png.bytes, intensity: f64::from(png.scale) * factor, preview: None })
    };
    areas.iter().map(image).collect()
}

fn includes(quantity: Quantity) -> &'static [&'static str] {
    match quantity {
        Quantity::Irradiance | Quantity::Radiance => &["direct", "indirect"],
        Quantity::Radiosity => &["emission", "direct", "indirect"],
    }
}

/// What made the lightmap. Nothing that differs from run to run: no dates, paths or thread counts.
fn provenance(baked: &Baked) -> Value {
    let BakeOptions { refine, direct, topology, cob_height, .. } = baked.options;
    json!({
        "generator": concat!("cobake ", env!("CARGO_PKG_VERSION")),
        "refine": refine,
        "direct": direct,
        "topology": topology,
        "cobHeight": cob_height,
        "subdivisionThreshold": baked.options.subdivision_threshold,
        "illuminationThreshold": baked.options.illumination_threshold,
        "unshotFraction": baked.options.unshot_fraction,
        "gatherError": baked.options.gather_error,
        "maxReflectance": baked.options.max_reflectance,
        "resolution": baked.options.resolution,
        "density": baked.options.density,
        "mips": baked.options.mips,
        "texelsPerMetre": baked.atlas.texels_per_metre,
        "gutter": baked.atlas.gutter,
    })
}

/// A file that was baked before loses that bake's marks; its data go when nobody refers to them.
fn forget_earlier_bake(root: &mut Object) {
    drop_extensions(root, &[COBAKE_LIGHTMAP]);
    for node in root.get_mut("nodes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(node) = node.as_object_mut() {
            drop_extensions(node, &[COBAKE_LIGHTMAP]);
        }
    }
}

/// Takes Draco out of the lists of extensions if all primitives that used it were rewritten.
fn forget_unused_draco(root: &mut Object) {
    let primitives = root.get("meshes").and_then(Value::as_array).into_iter().flatten();
    let mut primitives = primitives.filter_map(|mesh| mesh.get("primitives")?.as_array()).flatten();
    if !primitives.any(|primitive| primitive.get("extensions").is_some_and(|e| e.get(DRACO).is_some())) {
        forget_extensions(root, &[DRACO]);
    }
}

/// Writes a lit node's mesh and marks the node. What other pages than the first light becomes the meshes of new
/// children, a page each.
fn write_node(writer: &mut Writer, node: &LitNode) -> Result<(), ExportError> {
    let missing = |list, index| ExportError::Malformed { list, index, problem: "is not there" };
    let pages = writer.plan.pages_of(node, writer.baked.atlas);
    let mut written = 0;
    for &page in &pages {
        let choice = Choice { page, is_part: pages.len() > 1, is_first: written == 0 };
        let Some(mesh) = mesh_of_page(writer, node, choice)? else { continue };
        let document = &mut writer.document;
        let index = if node.in_place && choice.is_first {
            let slot = document.entry("meshes", node.mesh).ok_or(missing("mesh", node.mesh))?;
            *slot = mesh;
            node.mesh
        } else {
            document.push("meshes", mesh.into())
        };
        let owner = if choice.is_first { node.node } else { add_child(document, node.node) };
        let slot = document.entry("nodes", owner).ok_or(missing("node", node.node))?;
        slot.insert("mesh".into(), index.into());
        edit_object(slot, "extensions", |extensions| {
            extensions.insert(COBAKE_LIGHTMAP.into(), json!({"lightmap": page, "texCoord": LIGHTMAP_SET}));
        });
        written += 1;
    }
    Ok(())
}

/// The node's mesh with those triangles that one page lights, and with the first also what has no light; `None`
/// where nothing is left.
fn mesh_of_page(writer: &mut Writer, node: &LitNode, choice: Choice) -> Result<Option<Object>, ExportError> {
    let missing = |list, index| ExportError::Malformed { list, index, problem: "is not there" };
    let meshes = writer.baked.scene.source.json.get("meshes");
    let mut mesh =
        meshes.and_then(|list| list.get(node.mesh)?.as_object()).ok_or(missing("mesh", node.mesh))?.clone();
    let mut primitives = match mesh.get_mut("primitives") {
        Some(Value::Array(primitives)) => std::mem::take(primitives),
        _ => return Err(missing("mesh", node.mesh)),
    };
    let placements = node.placements.iter().filter_map(|&index| writer.baked.scene.placements.get(index));
    let placements: Vec<&Placement> = placements.collect();
    if !choice.is_first {
        for (index, primitive) in primitives.iter_mut().enumerate() {
            if placements.iter().all(|placement| placement.primitive != index) {
                *primitive = Value::Null;
            }
        }
    }
    let rest = match writer.baked.options.topology {
        Topology::Source => placements,
        Topology::Adaptive => adaptive::rewrite(writer, &node.placements, &mut primitives, choice)?,
    };
    source::rewrite(writer, &rest, &mut primitives, choice)?;
    primitives.retain(|primitive| !primitive.is_null());
    let is_empty = primitives.is_empty();
    mesh.insert("primitives".into(), primitives.into());
    Ok((!is_empty).then_some(mesh))
}

/// A new child of a node, at its place and of its name, and with its morph targets' weights.
fn add_child(document: &mut Document, parent: usize) -> usize {
    let mut child = Object::new();
    let original = document.list("nodes").get(parent);
    for kept in ["name", "weights"] {
        if let Some(value) = original.and_then(|original| original.get(kept)) {
            child.insert(kept.into(), value.clone());
        }
    }
    let index = document.push("nodes", child.into());
    if let Some(parent) = document.entry("nodes", parent) {
        match parent.get_mut("children") {
            Some(Value::Array(children)) => children.push(index.into()),
            _ => drop(parent.insert("children".into(), json!([index]))),
        }
    }
    index
}
