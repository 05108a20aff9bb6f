//! Whose texels count as more, or as less.

use serde_json::Value;

use crate::options::{BakeOptions, OptionsError};
use crate::scene::Scene;
use crate::surface::Surface;

/// What gets no lightmap still takes a little of the page: as little as there is.
const UNLIT: f64 = 1.0 / 64.0;

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
        let Some(placement) = scene.placements.get(surface.placement) else { return 1.0 };
        if !placement.settings.bake {
            return UNLIT;
        }
        options.node_density.get(&placement.node).copied().unwrap_or(placement.settings.density)
    };
    Ok(surfaces.iter().map(of).collect())
}
