//! The node hierarchy: which scene, which nodes, where each stands in the world.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::document::{Document, Node, follow};
use super::warning::Warnings;
use super::{ImportError, Item};

/// Below this determinant, relative to its columns' lengths, a matrix counts as flat.
const FLAT: f64 = 1e-12;

/// A node of the scene with its place in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedNode {
    /// Index into the document's `nodes`.
    pub(super) index: usize,
    /// From the node's own coordinates to the world's.
    pub(super) world: DAffine3,
}

/// The nodes of a scene, depth first, a node before its children.
///
/// `scene` chooses the scene; without it the document's default counts, else its first scene, else
/// (a document without scenes) every node that is no other node's child.
pub(super) fn traverse(
    document: &Document,
    scene: Option<usize>,
    warnings: &mut Warnings,
) -> Result<Vec<PlacedNode>, ImportError> {
    let parents = parents(document)?;
    refuse_cycles(document, &parents)?;
    let (roots, scene) = roots(document, scene, &parents)?;

    let mut reached = vec![false; document.nodes.len()];
    let mut stack: Vec<(usize, DAffine3)> =
        roots.iter().rev().map(|&node| (node, DAffine3::IDENTITY)).collect();
    let mut placed = Vec::new();
    while let Some((index, parent)) = stack.pop() {
        let node = follow(&document.nodes, index, "node", || Item::new("scene", scene, None))?;
        if std::mem::replace(reached.get_mut(index).unwrap_or(&mut false), true) {
            let other = parents.get(index).copied().flatten();
            let other =
                other.map_or_else(|| Item::new("scene", scene, None), |parent| document.node_item(parent));
            return Err(ImportError::TwoParents { node: document.node_item(index), other });
        }
        let world = parent * local(document, index, node, warnings)?;
        // By the specification a scale of zero on all three axes hides a node and all below it.
        if world.matrix3 == DMat3::ZERO {
            warnings.about(document.node_item(index), "hidden by its scale of zero, and so is all below it");
            continue;
        }
        placed.push(PlacedNode { index, world });
        stack.extend(node.children.iter().rev().map(|&child| (child, world)));
    }
    Ok(placed)
}

/// Whether `world` gives its contents area and a place.
pub(super) fn is_invertible(world: &DAffine3) -> bool {
    let m = world.matrix3;
    let scale = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    world.is_finite() && scale > 0.0 && m.determinant().abs() > FLAT * scale
}

/// Each node's parent.
fn parents(document: &Document) -> Result<Vec<Option<usize>>, ImportError> {
    let mut parents = vec![None; document.nodes.len()];
    for (index, node) in document.nodes.iter().enumerate() {
        for &child in &node.children {
            follow(&document.nodes, child, "node", || document.node_item(index))?;
            let Some(slot) = parents.get_mut(child) else { continue };
            if let Some(first) = slot.replace(index) {
                let (node, other) = (document.node_item(child), document.node_item(first));
                return Err(ImportError::TwoParents { node, other });
            }
        }
    }
    Ok(parents)
}

/// Follows each chain of parents once; a chain that meets itself is a cycle.
fn refuse_cycles(document: &Document, parents: &[Option<usize>]) -> Result<(), ImportError> {
    // The walk (counted from 1) that first came by; 0 where none has yet.
    let mut walks = vec![0; parents.len()];
    for start in 0..parents.len() {
        let mut next = Some(start);
        while let Some(node) = next
            && let Some(walk) = walks.get_mut(node)
        {
            if *walk == start + 1 {
                return Err(ImportError::Cycle { node: document.node_item(node) });
            }
            if *walk != 0 {
                break;
            }
            *walk = start + 1;
            next = parents.get(node).copied().flatten();
        }
    }
    Ok(())
}

/// The roots to start from, and the scene's index for messages.
fn roots(
    document: &Document,
    scene: Option<usize>,
    parents: &[Option<usize>],
) -> Result<(Vec<usize>, usize), ImportError> {
    let chosen = scene.or(document.scene);
    match (chosen, document.scenes.get(chosen.unwrap_or(0))) {
        (_, Some(entry)) => Ok((entry.nodes.clone(), chosen.unwrap_or(0))),
        (Some(asked), None) => Err(ImportError::NoSuchScene { asked, count: document.scenes.len() }),
        (None, None) => {
            let is_root = |&node: &usize| parents.get(node).copied().flatten().is_none();
            Ok(((0..document.nodes.len()).filter(is_root).collect(), 0))
        }
    }
}

/// A node's own transform.
fn local(
    document: &Document,
    index: usize,
    node: &Node,
    warnings: &mut Warnings,
) -> Result<DAffine3, ImportError> {
    if let Some(m) = &node.matrix {
        if [m[3], m[7], m[11]] != [0.0; 3] || m[15] != 1.0 {
            warnings.about(document.node_item(index), "the matrix is no affine one; its last row is ignored");
        }
        let column = |at: usize| DVec3::new(m[at], m[at + 1], m[at + 2]);
        return Ok(DAffine3 {
            matrix3: DMat3::from_cols(column(0), column(4), column(8)),
            translation: column(12),
        });
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    if !(length.is_finite() && length > 0.0) {
        return Err(ImportError::Transform { node: document.node_item(index) });
    }
    Ok(DAffine3::from_scale_rotation_translation(
        DVec3::from_array(node.scale.unwrap_or([1.0; 3])),
        rotation / length,
        DVec3::from_array(node.translation.unwrap_or([0.0; 3])),
    ))
}
