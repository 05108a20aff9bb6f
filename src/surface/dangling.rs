//! Contact lines that end within a surface are carried on until they divide it.
//!
//! A sheet of paper standing on a desk meets it in one line with two free ends. Left so, the line
//! would separate nothing, and light would be smeared through the sheet. Carrying a line on costs
//! elements where nothing happens, so only long lines are, and only a few of them.

use std::collections::BTreeMap;

use glam::DVec2;

use crate::geom::{Ring, polygon};
use crate::retriangulate::Arrangement;

/// Chains of contact edges shorter than this share of the surface's extent stay as they are.
const SHORTEST_CHAIN: f64 = 0.02;

/// So many ends are carried on in one surface, those of the longest chains.
const MOST_EXTENSIONS: usize = 32;

/// A line that is carried on.
struct FreeEnd {
    end: DVec2,
    /// Unit vector.
    direction: DVec2,
    chain_length: f64,
    vertex: u32,
}

/// The further contact segments, from each free end to the first edge straight ahead.
pub(super) fn extensions(arrangement: &Arrangement, rings: &[Ring], snap: f64) -> Vec<[DVec2; 2]> {
    let (low, high) = rings
        .iter()
        .flatten()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let mut ends = free_ends(arrangement);
    ends.retain(|e| e.chain_length >= SHORTEST_CHAIN * (high - low).length());
    ends.sort_by(|a, b| b.chain_length.total_cmp(&a.chain_length).then(a.vertex.cmp(&b.vertex)));
    let mut further: Vec<[DVec2; 2]> = Vec::new();
    for free in ends.into_iter().filter(|e| polygon::contains(rings, e.end)).take(MOST_EXTENSIONS) {
        let ring_and_contact = arrangement
            .edges
            .iter()
            .map(|e| [arrangement.vertices[e.from as usize], arrangement.vertices[e.to as usize]]);
        let nearest = ring_and_contact
            .chain(further.iter().copied())
            .filter_map(|edge| distance_along(&free, edge))
            .filter(|&t| t > snap)
            .fold(f64::INFINITY, f64::min);
        if nearest.is_finite() {
            further.push([free.end, free.end + free.direction * nearest]);
        }
    }
    further
}

/// How far straight ahead of a free end an edge lies.
fn distance_along(free: &FreeEnd, [a, b]: [DVec2; 2]) -> Option<f64> {
    // Rays through a vertex must not slip between its two edges.
    const SLACK: f64 = 1e-9;
    let (edge, to) = (b - a, a - free.end);
    let turn = free.direction.perp_dot(edge);
    if turn.abs() <= 1e-12 * edge.length() {
        return None;
    }
    let t = to.perp_dot(edge) / turn;
    let s = to.perp_dot(free.direction) / turn;
    ((-SLACK..=1.0 + SLACK).contains(&s) && t > 0.0).then_some(t)
}

fn free_ends(arrangement: &Arrangement) -> Vec<FreeEnd> {
    let mut degree = vec![0_u32; arrangement.vertices.len()];
    for e in &arrangement.edges {
        degree[e.from as usize] += 1;
        degree[e.to as usize] += 1;
    }
    let contacts = || arrangement.edges.iter().filter(|e| e.contact);
    if !contacts().any(|e| degree[e.from as usize] == 1 || degree[e.to as usize] == 1) {
        return Vec::new();
    }
    let mut chain: Vec<u32> = (0..arrangement.vertices.len() as u32).collect();
    for e in contacts() {
        let (a, b) = (root(&mut chain, e.from), root(&mut chain, e.to));
        chain[a.max(b) as usize] = a.min(b);
    }
    let point = |v: u32| arrangement.vertices[v as usize];
    let mut lengths: BTreeMap<u32, f64> = BTreeMap::new();
    for e in contacts() {
        *lengths.entry(root(&mut chain, e.from)).or_default() += point(e.from).distance(point(e.to));
    }
    let mut ends = Vec::new();
    for e in contacts() {
        let chain_length = lengths.get(&root(&mut chain, e.from)).copied().unwrap_or(0.0);
        for (vertex, other) in [(e.from, e.to), (e.to, e.from)] {
            if degree[vertex as usize] == 1
                && let Some(direction) = (point(vertex) - point(other)).try_normalize()
            {
                ends.push(FreeEnd { end: point(vertex), direction, chain_length, vertex });
            }
        }
    }
    ends
}

fn root(chain: &mut [u32], mut v: u32) -> u32 {
    while chain[v as usize] != v {
        chain[v as usize] = chain[chain[v as usize] as usize];
        v = chain[v as usize];
    }
    v
}
