//! Node transforms, straight from the document: the adaptive geometry goes back into node space.

use glam::{DMat4, DQuat, DVec3, DVec4};
use serde_json::Value;

use super::document::index_of;

/// The node-to-world transform of `node`.
///
/// Node trees may not hold cycles; in one that does, the walk ends after as many steps as there
/// are nodes.
pub(super) fn world_from_node(nodes: &[Value], node: usize) -> DMat4 {
    let mut parents = vec![None; nodes.len()];
    for (parent, object) in nodes.iter().enumerate() {
        for child in object.get("children").and_then(Value::as_array).into_iter().flatten() {
            if let Some(slot) = index_of(Some(child)).and_then(|child| parents.get_mut(child)) {
                *slot = Some(parent);
            }
        }
    }
    let mut matrix = DMat4::IDENTITY;
    let mut at = Some(node);
    for _ in 0..nodes.len() {
        let Some(index) = at else { break };
        matrix = nodes.get(index).map_or(DMat4::IDENTITY, local) * matrix;
        at = parents.get(index).copied().flatten();
    }
    matrix
}

/// A node's own transform.
fn local(node: &Value) -> DMat4 {
    if let Some(m) = numbers::<16>(node.get("matrix")) {
        return DMat4::from_cols_array(&m);
    }
    let translation = numbers::<3>(node.get("translation")).map_or(DVec3::ZERO, DVec3::from_array);
    let scale = numbers::<3>(node.get("scale")).map_or(DVec3::ONE, DVec3::from_array);
    let rotation = numbers::<4>(node.get("rotation"))
        .and_then(|r| DVec4::from_array(r).try_normalize())
        .map_or(DQuat::IDENTITY, DQuat::from_vec4);
    DMat4::from_scale_rotation_translation(scale, rotation, translation)
}

fn numbers<const N: usize>(value: Option<&Value>) -> Option<[f64; N]> {
    let list = value?.as_array()?;
    let mut out = [0.0; N];
    if list.len() != N {
        return None;
    }
    for (slot, value) in out.iter_mut().zip(list) {
        *slot = value.as_f64()?;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// The product of three scalings and moves by hand; rounding only.
    const EXACT: f64 = 1e-12;

    #[test]
    fn parents_apply_after_children() {
        let nodes = [
            json!({"translation": [1.0, 2.0, 3.0], "rotation": [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()]}),
            json!({"scale": [2, 2, 2], "children": [0]}),
            json!({"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 10, 1], "children": [1]}),
        ];
        let world = world_from_node(&nodes, 0).transform_point3(DVec3::X);
        assert!((world - DVec3::new(2.0, 6.0, 16.0)).length() < EXACT, "{world}");
    }

    #[test]
    fn cycles_end() {
        let nodes = [json!({"children": [1]}), json!({"children": [0]})];
        assert!(world_from_node(&nodes, 0).is_finite());
    }
}
