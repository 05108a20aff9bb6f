//! Whose texels count as more, or as less.

use serde_json::Value;

use crate::options::{BakeOptions, OptionsError};
use crate::scene::Scene;
use crate::surface::Surface;

/// For each surface how many times as dense as else its texels lie: what its node was given.
///
/// # Errors
/// A node that the document does not have; a typing error would go unseen.
pub(super) fn of_surfaces(
    scene: &Scene,
    surfaces: &[Surface],
    options: &BakeOptions,
) -> Result<Vec<f64>, OptionsError> {
    let nodes = scene.source.json.get("nodes").and_then(Value::as_array).map_or(0, Vec::len);
    if let Some((&node, _)) = options.node_density.range(nodes..).next() {
        let range = "given to nodes that the document has; this is the index of none";
        return Err(OptionsError { option: "node-density", value: node as f64, range });
    }
    let of = |surface: &Surface| {
        let node = scene.placements.get(surface.placement).map(|placement| placement.node);
        node.and_then(|node| options.node_density.get(&node)).copied().unwrap_or(1.0)
    };
    Ok(surfaces.iter().map(of).collect())
}
