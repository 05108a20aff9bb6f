//! The elements that the light was solved on, for those who want to look at them.
//!
//! `COBAKE_lightmap` names three bufferViews, little endian, an entry for each element: its number of corners (32
//! bits), the state of its Close Objects Buffer (8 bits: 0 never asked, 1 empty, 2 not empty), and one after another
//! all corners in world space (three 32-bit floats each, metres), counter-clockwise seen from the side that is lit.

use serde_json::{Value, json};

use super::document::Document;
use crate::cob::CobState;
use crate::element::Facet;

/// Adds the leaves of `facets` to the document; what the extension says of them, or `None` where there are none.
pub(super) fn write(document: &mut Document, facets: &[Facet]) -> Option<Value> {
    let (mut positions, mut corners, mut states) = (Vec::new(), Vec::new(), Vec::new());
    for facet in facets {
        for leaf in facet.leaves() {
            let hull = facet.hull(leaf);
            corners.extend((hull.len() as u32).to_le_bytes());
            states.push(match facet.elements[leaf as usize].cob.state() {
                CobState::Uninitialized => 0,
                CobState::Empty => 1,
                CobState::NotEmpty => 2,
            });
            let coordinates = hull.iter().flat_map(|corner| corner.as_vec3().to_array());
            positions.extend(coordinates.flat_map(f32::to_le_bytes));
        }
    }
    let count = states.len();
    // glTF allows no empty bufferView.
    (count > 0).then(|| {
        let [positions, corners, states] =
            [positions, corners, states].map(|bytes| json!({"bufferView": document.add_view(bytes)}));
        json!({"count": count, "positions": positions, "corners": corners, "states": states})
    })
}
