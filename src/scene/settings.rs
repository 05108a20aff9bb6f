//! What nodes say of their own bake, and which of them move.
//!
//! `"extras": {"cobake": {"bake": false, "density": 2, "cast": false}}` on a node counts for it and for all below
//! it, until one of those says otherwise. A node moves where an animation turns, shifts or scales it or one above
//! it, where it is skinned, and where its mesh has morph targets.

use serde_json::Value;

use super::document::Document;
use super::hierarchy::PlacedNode;
use super::warning::Warnings;
use super::{ImportError, Item};

/// Texels a metre may be as many times as many as this, or as few.
const MOST_DENSITY: f64 = 64.0;

/// How a node's mesh takes part in a bake.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NodeSettings {
    /// Whether it gets a lightmap. Default: yes.
    pub bake: bool,
    /// How many times as many texels a metre as else lie on it, `[1/64, 64]`. Default: 1.
    pub density: f64,
    /// Whether it stands in the way of light. What does not sends no reflected light out either. Default: yes.
    pub cast: bool,
    /// Whether it moves, so that no lightmap can hold for it. Default: no.
    pub is_dynamic: bool,
}

impl Default for NodeSettings {
    fn default() -> Self {
        Self { bake: true, density: 1.0, cast: true, is_dynamic: false }
    }
}

/// The settings of each of the document's nodes; of those not in `nodes` the defaults.
///
/// # Errors
/// Names a node with a setting of the wrong type or out of its range.
pub(super) fn of_nodes(
    json: &Value,
    document: &Document,
    nodes: &[PlacedNode],
    warnings: &mut Warnings,
) -> Result<Vec<NodeSettings>, ImportError> {
    let moved = moved_by_animation(json, document.nodes.len());
    // What each node takes over from above: nodes come before their children.
    let mut inherited = vec![NodeSettings::default(); document.nodes.len()];
    let mut settings = inherited.clone();
    for node in nodes {
        let Some(entry) = document.nodes.get(node.index) else { continue };
        let mut own = inherited.get(node.index).copied().unwrap_or_default();
        let extras = json.pointer(&format!("/nodes/{}/extras/cobake", node.index));
        read(extras, &mut own, || document.node_item(node.index), warnings)?;
        let Motion { place, shape } = moved.get(node.index).copied().unwrap_or_default();
        own.is_dynamic |= place;
        for &child in &entry.children {
            if let Some(slot) = inherited.get_mut(child) {
                *slot = own;
            }
        }
        let mesh = entry.mesh.and_then(|mesh| document.meshes.get(mesh));
        let morphs = mesh.is_some_and(|mesh| mesh.primitives.iter().any(|p| !p.targets.is_empty()));
        own.is_dynamic |= shape || morphs || entry.skin.is_some();
        if let Some(slot) = settings.get_mut(node.index) {
            *slot = own;
        }
    }
    Ok(settings)
}

fn read(
    extras: Option<&Value>,
    settings: &mut NodeSettings,
    item: impl Fn() -> Item,
    warnings: &mut Warnings,
) -> Result<(), ImportError> {
    let Some(extras) = extras else { return Ok(()) };
    let refuse = |key: &str, value: &Value, expected| {
        let (key, value) = (super::item::shown(key), super::item::shown(&value.to_string()));
        Err(ImportError::Setting { node: item(), key, value, expected })
    };
    let Some(object) = extras.as_object() else { return refuse("", extras, "an object") };
    for (key, value) in object {
        match (key.as_str(), value.as_bool(), value.as_f64()) {
            ("bake", Some(bake), _) => settings.bake = bake,
            ("cast", Some(cast), _) => settings.cast = cast,
            ("density", _, Some(density)) if (1.0 / MOST_DENSITY..=MOST_DENSITY).contains(&density) => {
                settings.density = density;
            }
            ("bake" | "cast", _, _) => return refuse(key, value, "true or false"),
            ("density", _, _) => return refuse(key, value, "a number from 1/64 to 64"),
            _ => warnings.about(
                item(),
                format!(
                    "extras.cobake has no setting \"{}\"; there are bake, density and cast",
                    super::item::shown(key)
                ),
            ),
        }
    }
    Ok(())
}

/// What an animation changes of a node.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// Its transform, and so all below it.
    place: bool,
    /// Its mesh's shape.
    shape: bool,
}

/// What the document's animations change. Read leniently: a bake needs nothing else of them.
fn moved_by_animation(json: &Value, count: usize) -> Vec<Motion> {
    let mut moved = vec![Motion::default(); count];
    let channels = list(json, "animations").flat_map(|animation| list(animation, "channels"));
    for channel in channels {
        let Some(target) = channel.get("target") else { continue };
        let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer").and_then(Value::as_str);
        let (node, path) = match pointer.and_then(|pointer| pointer.strip_prefix("/nodes/")?.split_once('/'))
        {
            Some((node, path)) => (node.parse().ok(), path),
            None => {
                let node = target.get("node").and_then(Value::as_u64);
                (
                    node.map(|node| node as usize),
                    target.get("path").and_then(Value::as_str).unwrap_or_default(),
                )
            }
        };
        let Some(motion) = node.and_then(|node: usize| moved.get_mut(node)) else { continue };
        motion.place |= matches!(path, "translation" | "rotation" | "scale");
        motion.shape |= path.starts_with("weights");
    }
    moved
}

/// A list's entries; none where there is no list.
fn list<'v>(value: &'v Value, key: &str) -> impl Iterator<Item = &'v Value> + use<'v> {
    value.get(key).and_then(Value::as_array).into_iter().flatten()
}
