//! Between stages 1 and 2: whose own `TEXCOORD_1` is a lightmap layout, to be kept.
//!
//! A node's layout is one where every triangle has coordinates in `[0, 1]` and area there, and no two overlap
//! (`fault`, `overlap`). Surfaces then go on only where the layout does, so that each has one affine map from its
//! plane to the layout, and charts are what they always are. If the layouts of all nodes keep clear of each
//! other, as one atlas of the whole scene, they stay in one square; else, as where each mesh fills the square by
//! itself, every node has a square of its own. A square is moved and scaled as one block.

mod fault;
mod map;
mod overlap;

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::DVec2;

use crate::geom::polygon::orient;
use crate::scene::{ImportError, Placement, Scene, Warnings};
use fault::{Fault, MOST_SHARED, fault};
pub(crate) use map::{LEAST_STRETCH, least_stretch, mean_density};
use overlap::overlaps;

/// The set that lightmap layouts live in.
const SET: u32 = 1;

/// The layouts that are kept. The default keeps none.
#[derive(Clone, Debug, Default)]
pub struct Authored {
    /// For each of the scene's triangles its coordinates where they are kept; empty where none are.
    coordinates: Vec<Option<[DVec2; 3]>>,
    /// For each placement the square that its layout lies in, from 0 without gaps.
    block_of: Vec<Option<usize>>,
    /// Lit nodes that keep their layout.
    kept: usize,
    /// Lit nodes that do not.
    others: usize,
    /// Why not, one sentence a reason.
    warnings: Vec<String>,
}

impl Authored {
    /// Judges the layouts of all nodes that get a lightmap.
    ///
    /// # Errors
    /// Names the accessor of texture coordinates that cannot be read.
    pub fn of(scene: &Scene) -> Result<Self, ImportError> {
        let mut coordinates = scene.texture_coordinates(SET)?;
        let (mut kept, mut others) = (Vec::new(), 0);
        let mut warnings = Warnings::default();
        for placements in lit_nodes(scene) {
            let fault = fault(scene, &placements, &coordinates);
            if let Some(fault) = fault {
                let Placement { node, mesh, .. } = *placements[0];
                let (node, mesh) = (scene.item("node", node), scene.item("mesh", mesh));
                warnings.about(format!("{node}, {mesh}{}", fault.detail()), fault.text());
            }
            if fault.is_some_and(Fault::is_fatal) {
                others += 1;
            } else {
                kept.push(placements);
            }
        }
        let mut block_of = vec![None; scene.placements.len()];
        let is_one = keep_clear(&kept, &coordinates);
        for (index, placements) in kept.iter().enumerate() {
            for placement in placements {
                let triangle = scene.triangles.get(placement.triangles.start);
                let slot = triangle.and_then(|t| block_of.get_mut(t.placement as usize));
                slot.into_iter().for_each(|slot| *slot = Some(if is_one { 0 } else { index }));
            }
        }
        for (triangle, slot) in scene.triangles.iter().zip(&mut coordinates) {
            if block_of.get(triangle.placement as usize).copied().flatten().is_none() {
                *slot = None;
            }
        }
        let (kept, warnings) = (kept.len(), warnings.into_sentences());
        Ok(Self { coordinates, block_of, kept, others, warnings })
    }

    /// Why layouts are not kept, one sentence a reason.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// How many squares there are.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.block_of.iter().flatten().max().map_or(0, |last| last + 1)
    }

    /// How many lit nodes keep their layout, and how many do not.
    #[must_use]
    pub fn nodes(&self) -> (usize, usize) {
        (self.kept, self.others)
    }

    /// For each of the scene's triangles its coordinates where they are kept; empty where none are.
    #[must_use]
    pub fn coordinates(&self) -> &[Option<[DVec2; 3]>] {
        &self.coordinates
    }

    /// The square that a placement's layout lies in, if it is kept.
    #[must_use]
    pub fn block_of(&self, placement: usize) -> Option<usize> {
        self.block_of.get(placement).copied().flatten()
    }
}

/// Whether the nodes' layouts are parts of one: none shares more room with others than its own triangles may share.
fn keep_clear(nodes: &[Vec<&Placement>], coordinates: &[Option<[DVec2; 3]>]) -> bool {
    let (mut triangles, mut owners, mut room) = (Vec::new(), Vec::new(), Vec::new());
    for (node, placements) in nodes.iter().enumerate() {
        let own: Vec<[DVec2; 3]> = placements.iter().flat_map(|p| layout(p, coordinates)).collect();
        room.push(MOST_SHARED * area(&own));
        triangles.extend(own);
        owners.resize(triangles.len(), node);
    }
    let end = overlaps(&triangles, |[a, b], area| {
        if owners[a] == owners[b] {
            return ControlFlow::Continue(());
        }
        let mut take = |node: usize| {
            room[node] -= area;
            room[node] < 0.0
        };
        if take(owners[a]) || take(owners[b]) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    end.is_continue()
}

/// The area of triangles in a layout.
fn area(triangles: &[[DVec2; 3]]) -> f64 {
    triangles.iter().map(|&[a, b, c]| orient(a, b, c).abs() / 2.0).sum()
}

/// The placements of each node that gets a lightmap, at least one each, in the order of the nodes' first.
fn lit_nodes(scene: &Scene) -> Vec<Vec<&Placement>> {
    let mut slots = BTreeMap::new();
    let mut nodes: Vec<Vec<&Placement>> = Vec::new();
    for placement in scene.placements.iter().filter(|p| p.settings.bake && !p.triangles.is_empty()) {
        let slot = *slots.entry(placement.node).or_insert(nodes.len());
        match nodes.get_mut(slot) {
            Some(own) => own.push(placement),
            None => nodes.push(vec![placement]),
        }
    }
    nodes
}

/// The coordinates of a placement's triangles that have some.
fn layout<'a>(
    placement: &Placement,
    coordinates: &'a [Option<[DVec2; 3]>],
) -> impl Iterator<Item = [DVec2; 3]> + 'a {
    coordinates.get(placement.triangles.clone()).unwrap_or_default().iter().copied().flatten()
}
