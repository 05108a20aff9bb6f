//! Assembling the output document: meshes, materials, nodes and the lightmaps themselves.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::document::{Document, Object, edit_object};
use super::layout::{drop_extensions, forget_extensions};
use super::materials::{LIGHTMAP_SET, LightmapImage, Materials};
use super::plan::{LitNode, Plan};
use super::primitive::DRACO;
use super::source::{self, Rewritten};
use super::{Baked, ExportError, adaptive, elements, encode_exr, encode_png, encode_preview};
use crate::options::{BakeOptions, Quantity, Toggle, Topology};
use crate::scene::Placement;

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
    let exr = encode_exr(baked.lightmap)?;
    let mut writer = Writer {
        baked,
        plan: &plan,
        document: Document::open(&baked.scene.source),
        materials: Materials::new(lightmap_image(baked)?, plan.unlit_materials.clone()),
        rewritten: Rewritten::default(),
    };
    forget_earlier_bake(&mut writer.document.root);
    for node in &plan.nodes {
        write_node(&mut writer, node)?;
    }
    let mut document = writer.document;
    forget_unused_draco(&mut document.root);
    let view = document.add_view(exr);
    let elements = match baked.options.elements {
        Toggle::On => elements::write(&mut document, baked.facets),
        Toggle::Off => None,
    };
    let mut extension = json!({
        "version": 1,
        "lightmaps": [{
            "bufferView": view,
            "mimeType": "image/x-exr",
            "width": baked.lightmap.width,
            "height": baked.lightmap.height,
            "quantity": baked.options.quantity,
            "includes": includes(baked.options.quantity),
        }],
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

/// The preview where there is to be one. Else the image for `MOZ_lightmap`, whose texels are irradiance by definition: radiance is scaled by π,
/// and radiosity cannot be told as irradiance at all, so there the file has no image.
fn lightmap_image(baked: &Baked) -> Result<Option<LightmapImage>, ExportError> {
    if let Some(form) = baked.options.preview {
        let sent_out = baked.preview.ok_or(ExportError::Mismatch { what: "a preview's texels" })?;
        let png = encode_preview(sent_out, form)?;
        let intensity = f64::from(png.scale);
        return Ok(Some(LightmapImage { png: png.bytes, intensity, preview: Some(form) }));
    }
    let factor = match baked.options.quantity {
        Quantity::Irradiance => 1.0,
        Quantity::Radiance => PI,
        Quantity::Radiosity => return Ok(None),
    };
    let png = encode_png(baked.lightmap)?;
    Ok(Some(LightmapImage { png: png.bytes, intensity: f64::from(png.scale) * factor, preview: None }))
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
        "padding": baked.atlas.padding,
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

/// Writes a lit node's mesh and marks the node.
fn write_node(writer: &mut Writer, node: &LitNode) -> Result<(), ExportError> {
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
    let rest = match writer.baked.options.topology {
        Topology::Source => placements,
        Topology::Adaptive => adaptive::rewrite(writer, &node.placements, &mut primitives)?,
    };
    source::rewrite(writer, &rest, &mut primitives)?;
    mesh.insert("primitives".into(), primitives.into());

    let document = &mut writer.document;
    let index = if node.in_place {
        let slot = document.entry("meshes", node.mesh).ok_or(missing("mesh", node.mesh))?;
        *slot = mesh;
        node.mesh
    } else {
        document.push("meshes", mesh.into())
    };
    let slot = document.entry("nodes", node.node).ok_or(missing("node", node.node))?;
    slot.insert("mesh".into(), index.into());
    edit_object(slot, "extensions", |extensions| {
        extensions.insert(COBAKE_LIGHTMAP.into(), json!({"lightmap": 0, "texCoord": LIGHTMAP_SET}));
    });
    Ok(())
}
