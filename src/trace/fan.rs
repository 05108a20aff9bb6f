//! Rays that go out from one point together.
//!
//! Sixteen at a time go down the tree: a node's box is fetched once and tested against all of
//! them in vector registers, and what depends on the common origin alone is computed once a
//! triangle (Wald, Slusallek, Benthin and Wagner, "Interactive Rendering with Coherent Ray
//! Tracing", 2001). It pays when their directions are alike.

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;

use super::{Facing, Hit, Tracer};

/// Rays in a fan.
pub const FAN: usize = 16;

/// A box counts as hit where it is missed by rounding (Ize, "Robust BVH Ray Traversal", 2013).
const BOX_SLACK: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Marks a ray that met nothing.
const NOTHING: u32 = u32::MAX;

/// Unit vectors, by axis and ray.
#[derive(Clone, Copy, Debug)]
pub struct Fan {
    pub x: [f32; FAN],
    pub y: [f32; FAN],
    pub z: [f32; FAN],
}

impl Fan {
    /// Takes down `FAN` unit vectors.
    #[must_use]
    pub fn new(directions: &[DVec3]) -> Self {
        let along = |axis: DVec3| std::array::from_fn(|ray| directions[ray].dot(axis) as f32);
        Self { x: along(DVec3::X), y: along(DVec3::Y), z: along(DVec3::Z) }
    }

    /// Direction of one ray.
    #[inline]
    #[must_use]
    pub fn direction(&self, ray: usize) -> DVec3 {
        DVec3::new(self.x[ray].into(), self.y[ray].into(), self.z[ray].into())
    }

    /// The same directions in a frame with these axes.
    #[inline(always)]
    #[must_use]
    pub fn turned(&self, axes: [Vec3A; 3]) -> Self {
        let mut turned = *self;
        for i in 0..FAN {
            let (x, y, z) = (self.x[i], self.y[i], self.z[i]);
            turned.x[i] = x * axes[0].x + y * axes[1].x + z * axes[2].x;
            turned.y[i] = x * axes[0].y + y * axes[1].y + z * axes[2].y;
            turned.z[i] = x * axes[0].z + y * axes[1].z + z * axes[2].z;
        }
        turned
    }
}

/// What the rays of a fan met so far.
struct Met {
    /// Distance in obvhs's units.
    distance: [f32; FAN],
    /// Index in the tree's order, or [`NOTHING`].
    triangle: [u32; FAN],
    /// Positive for rays that came from in front.
    facing: [f32; FAN],
}

/// Boxes yet to be looked into, with the distance at which the first ray enters.
#[derive(Debug, Default)]
pub struct FanStack(Vec<(u32, f32)>);

impl Tracer {
    /// The nearest triangle along each ray of a `fan` from `origin`.
    #[inline(always)]
    #[must_use]
    pub fn closest_hits(&self, origin: DVec3, fan: &Fan, stack: &mut FanStack) -> [Option<Hit>; FAN] {
        let met = self.meet(self.traced(origin), fan, stack);
        std::array::from_fn(|ray| {
            let triangle = met.triangle[ray];
            (triangle != NOTHING).then(|| Hit {
                triangle: self.boxes.primitive_indices[triangle as usize] as usize,
                distance: f64::from(met.distance[ray]) / self.scale,
                from_behind: met.facing[ray] < 0.0,
            })
        })
    }

    #[inline(always)]
    fn meet(&self, origin: Vec3A, fan: &Fan, FanStack(stack): &mut FanStack) -> Met {
        let mut met = Met { distance: [f32::MAX; FAN], triangle: [NOTHING; FAN], facing: [0.0; FAN] };
        let nodes = &self.boxes.nodes[..];
        let [ix, iy, iz] = [inverses(&fan.x), inverses(&fan.y), inverses(&fan.z)];
        let entry = |aabb: &Aabb, distance: &[f32; FAN]| {
            let (low, high) = (aabb.min - origin, aabb.max - origin);
            let mut entries = [f32::INFINITY; FAN];
            for i in 0..FAN {
                let (ax, bx) = (low.x * ix[i], high.x * ix[i]);
                let (ay, by) = (low.y * iy[i], high.y * iy[i]);
                let (az, bz) = (low.z * iz[i], high.z * iz[i]);
                let near = larger(larger(smaller(ax, bx), smaller(ay, by)), larger(smaller(az, bz), 0.0));
                let far = smaller(smaller(larger(ax, bx), larger(ay, by)), smaller(larger(az, bz), distance[i]));
                entries[i] = if near <= far * BOX_SLACK { near } else { f32::INFINITY };
            }
            reduce(entries, smaller)
        };
        stack.clear();
        let mut farthest = f32::MAX;
        let mut next = (!nodes.is_empty()).then_some(0);
        while let Some(index) = next.take() {
            let node = &nodes[index as usize];
            if node.is_leaf() {
                for triangle in node.first_index..node.first_index + node.prim_count {
                    self.leaves[triangle as usize].meet(triangle, origin, fan, &mut met);
                }
                farthest = reduce(met.distance, larger);
            } else {
                let children = [node.first_index, node.first_index + 1];
                let [a, b] = children.map(|c| entry(nodes[c as usize].aabb(), &met.distance));
                let (near, far) = if a <= b { (0, 1) } else { (1, 0) };
                let entries = [a, b];
                if entries[near] < f32::INFINITY {
                    next = Some(children[near]);
                    if entries[far] < f32::INFINITY {
                        stack.push((children[far], entries[far]));
                    }
                    continue;
                }
            }
            while let Some((index, entry)) = stack.pop() {
                if entry <= farthest {
                    next = Some(index);
                    break;
                }
            }
        }
        met
    }
}

impl Facing {
    /// Möller and Trumbore 1997, with all that the direction has no part in taken out.
    #[inline(always)]
    fn meet(&self, index: u32, origin: Vec3A, fan: &Fan, met: &mut Met) {
        let s = origin - self.corner;
        let back = self.edge2.cross(self.edge1);
        let of_u = self.edge2.cross(s);
        let of_v = s.cross(self.edge1);
        let height = self.edge2.dot(of_v);
        for i in 0..FAN {
            let dot = |v: Vec3A| fan.x[i] * v.x + fan.y[i] * v.y + fan.z[i] * v.z;
            let facing = dot(back);
            let inverse = 1.0 / facing;
            let (u, v, distance) = (dot(of_u) * inverse, dot(of_v) * inverse, height * inverse);
            // NaN from a degenerate triangle fails every comparison.
            let is_hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance >= 0.0) & (distance < met.distance[i]);
            met.distance[i] = if is_hit { distance } else { met.distance[i] };
            met.triangle[i] = if is_hit { index } else { met.triangle[i] };
            met.facing[i] = if is_hit { facing } else { met.facing[i] };
        }
    }
}

/// One over each, but never infinite: no box that touches the origin makes NaN of it.
#[inline(always)]
fn inverses(of: &[f32; FAN]) -> [f32; FAN] {
    let mut inverses = [0.0; FAN];
    for i in 0..FAN {
        let is_small = of[i].abs() < 1e-30;
        inverses[i] = 1.0 / if is_small { 1e-30 } else { of[i] };
    }
    inverses
}

// Those of the standard library care for NaN, which costs an instruction or two.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn reduce(mut values: [f32; FAN], pick: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = FAN / 2;
    while half > 0 {
        for i in 0..half {
            values[i] = pick(values[i], values[i + half]);
        }
        half /= 2;
    }
    values[0]
}
