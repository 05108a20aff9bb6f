//! Where a kept layout has too little room between its parts.
//!
//! Our own charts keep apart; a layout from elsewhere keeps the distance that its maker chose. Texels that lookups
//! from two of its islands touch show the light of one on the other.

use std::collections::HashMap;

use super::footprint::spans;
use super::{Atlas, Block};
use crate::authored::Authored;
use crate::geom::disjoint::root;
use crate::scene::Scene;
use crate::surface::Surface;

/// The texels that lookups from more than one island touch.
#[must_use]
pub fn shared_texels(
    (surfaces, blocks): (&[Surface], &[Block]),
    (authored, scene): (&Authored, &Scene),
    atlas: &Atlas,
) -> u64 {
    if blocks.is_empty() {
        return 0;
    }
    let members: Vec<usize> = blocks.iter().flat_map(|b| b.members.iter().map(|m| m.surface)).collect();
    let island = islands(&members, surfaces, (authored, scene));
    // 0 nobody, 1 more than one, else the island's number and 2.
    let mut owner = vec![0_u32; atlas.width as usize * atlas.height as usize];
    for &surface in &members {
        let own = island[surface] as u32 + 2;
        for chart in atlas.charts_of(surface) {
            for triangle in surfaces[surface].regions.iter().flat_map(|region| &region.triangles) {
                for span in spans(triangle.map(|p| chart.texel(p)), 1.0, (0, i64::from(atlas.height))) {
                    for x in span.first.max(0)..=span.last.min(i64::from(atlas.width) - 1) {
                        let at = &mut owner[span.y as usize * atlas.width as usize + x as usize];
                        *at = if *at == 0 || *at == own { own } else { 1 };
                    }
                }
            }
        }
    }
    owner.iter().filter(|&&at| at == 1).count() as u64
}

/// For each surface the island that it lies on: the members that share an edge both in the scene and in the layout
/// are on one.
fn islands(members: &[usize], surfaces: &[Surface], (authored, scene): (&Authored, &Scene)) -> Vec<usize> {
    let mut island: Vec<usize> = (0..surfaces.len()).collect();
    // Only looked up, so the hash's order has no say.
    let mut owner: HashMap<[[u64; 5]; 2], usize> = HashMap::new();
    for &surface in members {
        for &triangle in &surfaces[surface].source_triangles {
            let Some(uv) = authored.coordinates().get(triangle).copied().flatten() else { continue };
            let Some(points) = scene.triangles.get(triangle).map(|t| scene.corners(t)) else { continue };
            let corner = |k: usize| {
                // −0 is 0.
                let ([x, y, z], [u, v]) = ((points[k] + 0.0).to_array(), (uv[k] + 0.0).to_array());
                [x, y, z, u, v].map(f64::to_bits)
            };
            for k in 0..3 {
                let (from, to) = (corner(k), corner((k + 1) % 3));
                let other = *owner.entry([from.min(to), from.max(to)]).or_insert(surface);
                let (a, b) = (root(&mut island, surface), root(&mut island, other));
                island[a.max(b)] = a.min(b);
            }
        }
    }
    (0..surfaces.len()).map(|surface| root(&mut island, surface)).collect()
}
