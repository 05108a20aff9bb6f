//! Many small glowing facets as few emitters.
//!
//! Each emitter is asked everywhere, so a lamp of thousands of triangles would take hours. Beyond a number of
//! facets those that lie together and face alike shine as one polygon: their outline seen from the front, on the
//! plane that touches the foremost of them, so that none of them stands before it, with the power of all. (Light from
//! clusters: Smits, Arvo and Greenberg, "A Clustering Algorithm for Radiosity in Complex Environments", 1994.)

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::emitter::AreaEmitter;
use crate::element::Facet;
use crate::geom::Frame;
use crate::geom::hull::convex_hull;
use crate::geom::polygon::signed_area;
use crate::light::luminance;

/// Up to so many facets shine each for itself; of more, about as many clusters are made.
const MOST_EMITTERS: usize = 256;

/// Places this fraction of the scene's diagonal apart count as much as normals a radian apart.
const REACH: f64 = 1.0 / 16.0;

/// The cosine between a cluster's normal and its facets' is not below this, however many clusters that takes.
const LEAST_COSINE: f64 = 0.5;

/// What shines among the facets, as emitters, in a scene of this diagonal, metres.
pub(super) fn glowing(facets: &[Facet], diagonal: f64) -> Vec<AreaEmitter> {
    let glowing: Vec<&Facet> = facets.iter().filter(|f| f.exitance.max_element() > 0.0).collect();
    if glowing.len() <= MOST_EMITTERS {
        return glowing.into_iter().map(alone).collect();
    }
    let glows: Vec<Glow> = glowing.into_iter().map(Glow::new).collect();
    let reach = (REACH * diagonal).max(f64::MIN_POSITIVE);
    let mut finished = Vec::new();
    let mut open = BinaryHeap::from([Cluster::new(&glows, (0..glows.len()).collect(), reach)]);
    while let Some(cluster) = open.pop() {
        let is_enough = finished.len() + open.len() >= MOST_EMITTERS;
        if cluster.members.len() == 1 || (is_enough && cluster.faces_one_way(&glows)) {
            finished.push(cluster);
        } else {
            open.extend(cluster.halves(&glows, reach));
        }
    }
    finished.sort_by_key(|cluster| cluster.members.first().copied());
    finished.iter().map(|cluster| cluster.emitter(&glows)).collect()
}

/// A facet that shines for itself.
fn alone(facet: &Facet) -> AreaEmitter {
    AreaEmitter::new(facet.frame, facet.parts(0), facet.elements[0].area, facet.exitance)
}

/// A glowing facet.
struct Glow<'a> {
    facet: &'a Facet,
    centre: DVec3,
    power: DVec3,
}

impl<'a> Glow<'a> {
    fn new(facet: &'a Facet) -> Self {
        let root = &facet.elements[0];
        Self { facet, centre: facet.frame.lift(root.centroid), power: facet.exitance * root.area }
    }

    /// Where it is and whither it faces, so that distances are about radians.
    fn features(&self, reach: f64) -> [f64; 6] {
        let (n, c) = (self.facet.frame.normal, self.centre / reach);
        [n.x, n.y, n.z, c.x, c.y, c.z]
    }
}

/// Facets that shine as one.
struct Cluster {
    /// Ascending.
    members: Vec<usize>,
    /// The feature in which they differ most, and its mean.
    cut: (usize, f64),
    /// Their power times the variance of that feature: what halving is good for.
    gain: f64,
}

impl Cluster {
    fn new(glows: &[Glow], members: Vec<usize>, reach: f64) -> Self {
        let (mut power, mut sum, mut squares) = (0.0, [0.0; 6], [0.0; 6]);
        // From the first one's, so that far from the origin no digits are lost.
        let first = members.first().map_or([0.0; 6], |&m| glows[m].features(reach));
        for &member in &members {
            let (weight, features) = (luminance(glows[member].power), glows[member].features(reach));
            power += weight;
            for k in 0..6 {
                let d = features[k] - first[k];
                sum[k] += weight * d;
                squares[k] += weight * d * d;
            }
        }
        let spread = |k: usize| squares[k] - sum[k] * sum[k] / power;
        let widest = (1..6).fold(0, |best, k| if spread(k) > spread(best) { k } else { best });
        Self { members, cut: (widest, first[widest] + sum[widest] / power), gain: spread(widest) }
    }

    /// The members on either side of the cut; half of them each where the cut leaves all on one.
    fn halves(self, glows: &[Glow], reach: f64) -> [Self; 2] {
        let (feature, mean) = self.cut;
        let (low, high): (Vec<_>, Vec<_>) =
            self.members.iter().partition(|&&m| glows[m].features(reach)[feature] < mean);
        let (low, high) = if low.is_empty() || high.is_empty() {
            let (low, high) = self.members.split_at(self.members.len() / 2);
            (low.to_vec(), high.to_vec())
        } else {
            (low, high)
        };
        [low, high].map(|members| Self::new(glows, members, reach))
    }

    /// The mean of its facets' normals by power; not normalized.
    fn normal(&self, glows: &[Glow]) -> DVec3 {
        self.members.iter().map(|&m| glows[m].facet.frame.normal * luminance(glows[m].power)).sum()
    }

    fn faces_one_way(&self, glows: &[Glow]) -> bool {
        let normal = self.normal(glows).normalize_or_zero();
        self.members.iter().all(|&m| glows[m].facet.frame.normal.dot(normal) >= LEAST_COSINE)
    }

    fn emitter(&self, glows: &[Glow]) -> AreaEmitter {
        if let [only] = self.members[..] {
            return alone(glows[only].facet);
        }
        let corners = || self.members.iter().flat_map(|&m| glows[m].facet.parts(0)).flatten();
        let normal = self.normal(glows).normalize_or(DVec3::Z);
        let some = glows[self.members[0]].centre;
        let front = corners().map(|p| (p - some).dot(normal)).fold(0.0, f64::max);
        let frame = Frame::new(some + normal * front, normal, DVec3::ZERO);
        let outline = convex_hull(corners().map(|p| frame.project(p)).collect());
        let area = signed_area(&outline);
        let power: DVec3 = self.members.iter().map(|&m| glows[m].power).sum();
        let corners = outline.into_iter().map(|p| frame.lift(p)).collect();
        AreaEmitter::new(frame, vec![corners], area, power / area)
    }
}

impl Ord for Cluster {
    fn cmp(&self, other: &Self) -> Ordering {
        self.gain.total_cmp(&other.gain).then_with(|| other.members.first().cmp(&self.members.first()))
    }
}

impl PartialOrd for Cluster {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Cluster {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Cluster {}
