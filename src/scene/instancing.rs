//! `EXT_mesh_gpu_instancing`: each instance becomes a node of its own, with light of its own.
//!
//! The node keeps its place, name and children; its mesh goes to new children, one an instance. Attributes
//! of instances other than their transforms have no place on nodes and are left out.

use serde_json::{Value, json};

use super::accessor::{Accessors, Role};
use super::document::Document;
use super::{ImportError, Item};

const NAME: &str = "EXT_mesh_gpu_instancing";

/// More instances are refused.
const MOST_INSTANCES: usize = 1 << 20;

/// A child's transform, by the names of the attributes and of the node's properties.
const TRANSFORMS: [(&str, &str, Role); 3] = [
    ("TRANSLATION", "translation", Role::TRANSLATION),
    ("ROTATION", "rotation", Role::ROTATION),
    ("SCALE", "scale", Role::SCALE),
];

/// Replaces the instances in `json`, of which `document` is the typed form. Returns whether there were any.
///
/// # Errors
/// Names accessors that cannot be read or differ in length, and more instances than can be baked.
pub(super) fn expand(
    json: &mut Value,
    document: &Document,
    buffers: &[Vec<u8>],
) -> Result<bool, ImportError> {
    let accessors = Accessors { document, buffers };
    let mut added: Vec<Value> = Vec::new();
    let count = document.nodes.len();
    for (index, node) in document.nodes.iter().enumerate() {
        let (Some(instancing), Some(mesh)) = (&node.extensions.instancing, node.mesh) else { continue };
        let item = || document.node_item(index);
        let instances = transforms(accessors, instancing, &item)?;
        if added.len() + instances.len() > MOST_INSTANCES {
            return Err(ImportError::TooLarge { what: "instances", limit: MOST_INSTANCES });
        }
        let Some(entry) = json.pointer_mut(&format!("/nodes/{index}")).and_then(Value::as_object_mut) else {
            continue;
        };
        entry.shift_remove("mesh");
        let carried = ["skin", "weights"].map(|key| (key, entry.shift_remove(key)));
        let first = count + added.len();
        for (number, mut instance) in instances.into_iter().enumerate() {
            if let Some(object) = instance.as_object_mut() {
                if let Some(name) = &node.name {
                    object.insert("name".into(), format!("{name}.{number}").into());
                }
                object.insert("mesh".into(), mesh.into());
                for (key, value) in &carried {
                    if let Some(value) = value {
                        object.insert((*key).into(), value.clone());
                    }
                }
            }
            added.push(instance);
        }
        if count + added.len() > first {
            let children = entry.entry("children").or_insert_with(|| json!([]));
            if let Some(children) = children.as_array_mut() {
                children.extend((first..count + added.len()).map(Value::from));
            }
        }
        if let Some(extensions) = entry.get_mut("extensions").and_then(Value::as_object_mut) {
            extensions.shift_remove(NAME);
            if extensions.is_empty() {
                entry.shift_remove("extensions");
            }
        }
    }
    let any = !added.is_empty();
    if let Some(nodes) = json.get_mut("nodes").and_then(Value::as_array_mut) {
        nodes.extend(added);
    }
    super::extension::forget(json, &[NAME]);
    Ok(any)
}

/// Each instance's transform, as the node that it becomes.
fn transforms(
    accessors: Accessors<'_>,
    instancing: &super::document::Instancing,
    item: &impl Fn() -> Item,
) -> Result<Vec<Value>, ImportError> {
    let mut nodes: Option<Vec<Value>> = None;
    for (attribute, property, role) in &TRANSFORMS {
        let Some(&accessor) = instancing.attributes.get(*attribute) else { continue };
        let numbers = accessors.read(accessor, role, item)?;
        let nodes = nodes.get_or_insert_with(|| vec![json!({}); numbers.len().min(MOST_INSTANCES + 1)]);
        if nodes.len() != numbers.len() && nodes.len() <= MOST_INSTANCES {
            let attribute = (*attribute).to_owned();
            let (count, instances) = (numbers.len(), nodes.len());
            return Err(ImportError::InstanceLength { node: item(), attribute, count, instances });
        }
        if *attribute == "ROTATION" {
            let unit = |q: [f64; 4]| {
                let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
                if length > 0.0 { q.map(|x| x / length) } else { q }
            };
            set(nodes, property, numbers.arrays::<4>().map(|q| json!(unit(q))));
        } else {
            set(nodes, property, numbers.arrays::<3>().map(|v| json!(v)));
        }
    }
    // Without a transform the extension says nothing of how many there are.
    Ok(nodes.unwrap_or_else(|| vec![json!({})]))
}

fn set(nodes: &mut [Value], property: &str, values: impl Iterator<Item = Value>) {
    for (node, value) in nodes.iter_mut().zip(values) {
        if let Some(node) = node.as_object_mut() {
            node.insert(property.into(), value);
        }
    }
}
