//! Rays that go out from one point together.
//!
//! Sixteen at a time go down the tree: a node's box is fetched once and tested against all of
//! them in vector registers, and what depends on the common origin alone is computed once a
//! triangle (Wald, Slusallek, Benthin and Wagner, "Interactive Rendering with Coherent Ray
//! Tracing", 2001). It pays when their directions are alike.

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use pulp::NullaryFnOnce;

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
    x: [f32; FAN],
    y: [f32; FAN],
    z: [f32; FAN],
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
    fn turned(&self, axes: [Vec3A; 3]) -> Self {
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
    /// Distance in obvhs's units; what lies beyond is not met.
    distance: [f32; FAN],
    /// Index in the tree's order, or [`NOTHING`].
    triangle: [u32; FAN],
    /// Positive for rays that came from in front.
    facing: [f32; FAN],
}

/// Boxes yet to be looked into, with the distance at which the first ray enters: kept between fans so that their
/// memory is.
#[derive(Debug, Default)]
pub struct FanStack(Vec<(u32, f32)>);

/// The work of [`Tracer::look`], for [`pulp`] to compile for each kind of processor.
struct Look<'a, V> {
    tracer: &'a Tracer,
    origin: DVec3,
    axes: [Vec3A; 3],
    fans: &'a [Fan],
    stack: &'a mut FanStack,
    visit: V,
}

impl<V: FnMut(&Hit, DVec3, f64)> NullaryFnOnce for Look<'_, V> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let origin = self.tracer.traced(self.origin);
        for fan in self.fans {
            let fan = fan.turned(self.axes);
            let mut met = Met::nothing_within([f32::MAX; FAN]);
            self.tracer.meet(origin, &fan, self.stack, &mut met, |_| {});
            for ray in (0..FAN).filter(|&ray| met.triangle[ray] != NOTHING) {
                let hit = Hit {
                    triangle: self.tracer.boxes.primitive_indices[met.triangle[ray] as usize] as usize,
                    distance: f64::from(met.distance[ray]) / self.tracer.scale,
                    from_behind: met.facing[ray] < 0.0,
                };
                let at = |hit: &Hit| self.origin + fan.direction(ray) * hit.distance;
                if self.tracer.is_screen(hit.triangle) {
                    let visit = &mut self.visit;
                    self.tracer.follow(self.origin, fan.direction(ray), |hit, share| {
                        visit(hit, at(hit), share);
                        true
                    });
                } else {
                    (self.visit)(&hit, at(&hit), 1.0);
                }
            }
        }
    }
}

/// The work of [`Tracer::arriving_all`], likewise.
struct Shadows<'a> {
    tracer: &'a Tracer,
    from: DVec3,
    to: &'a [DVec3],
    stack: &'a mut FanStack,
}

impl NullaryFnOnce for Shadows<'_> {
    type Output = [f64; FAN];

    #[inline(always)]
    fn call(self) -> [f64; FAN] {
        let origin = self.tracer.traced(self.from);
        let mut fan = Fan { x: [1.0; FAN], y: [1.0; FAN], z: [1.0; FAN] };
        // Rays that are not asked for end before they begin.
        let mut lengths = [-1.0; FAN];
        for (ray, to) in self.to.iter().enumerate() {
            let way = self.tracer.traced(*to) - origin;
            // Nor does anything stand on no way at all.
            if let Some(direction) = way.try_normalize() {
                (fan.x[ray], fan.y[ray], fan.z[ray]) = (direction.x, direction.y, direction.z);
                lengths[ray] = way.length();
            }
        }
        let mut met = Met::nothing_within(lengths);
        // One hit is enough: such a ray looks no further.
        self.tracer.meet(origin, &fan, self.stack, &mut met, |met| {
            for ray in 0..FAN {
                met.distance[ray] = if met.triangle[ray] == NOTHING { met.distance[ray] } else { -1.0 };
            }
        });
        std::array::from_fn(|ray| {
            if met.triangle[ray] == NOTHING {
                1.0
            } else if self.tracer.has_screens() {
                self.tracer.sight(self.from, self.to[ray]).arriving()
            } else {
                0.0
            }
        })
    }
}

impl Tracer {
    /// Tells `visit` the nearest triangle that each ray from `origin` meets, if any, the point where, and the share
    /// of the light that it stops: less than 1 for a screen, which is followed by what stands behind it. The
    /// directions of `fans` are in a frame with these unit `axes`.
    pub fn look(
        &self,
        origin: DVec3,
        axes: [DVec3; 3],
        fans: &[Fan],
        stack: &mut FanStack,
        visit: impl FnMut(&Hit, DVec3, f64),
    ) {
        let axes = axes.map(|a| a.as_vec3a());
        self.arch.dispatch(Look { tracer: self, origin, axes, fans, stack, visit });
    }

    /// For each of at most [`FAN`] points `to` the share of the light that arrives there from `from`: 0 or 1, or
    /// what screens between them let through. The caller keeps all off their own surfaces.
    #[must_use]
    pub fn arriving_all(&self, from: DVec3, to: &[DVec3], stack: &mut FanStack) -> [f64; FAN] {
        self.arch.dispatch(Shadows { tracer: self, from, to, stack })
    }

    /// Goes through the boxes that a ray enters nearer than what it met; `met_some` is called after a leaf's
    /// triangles.
    #[inline(always)]
    fn meet(
        &self,
        origin: Vec3A,
        fan: &Fan,
        FanStack(stack): &mut FanStack,
        met: &mut Met,
        met_some: impl Fn(&mut Met),
    ) {
        let nodes = &self.boxes.nodes[..];
        let inverse = Fan { x: inverses(&fan.x), y: inverses(&fan.y), z: inverses(&fan.z) };
        stack.clear();
        let mut farthest = f32::MAX;
        let mut next = (!nodes.is_empty()).then_some(0);
        while let Some(index) = next.take() {
            let node = &nodes[index as usize];
            if node.is_leaf() {
                for triangle in node.first_index..node.first_index + node.prim_count {
                    self.leaves[triangle as usize].meet(triangle, origin, fan, met);
                }
                met_some(met);
                farthest = reduce(met.distance, larger);
            } else {
                let children = [node.first_index, node.first_index + 1];
                let a = entry(nodes[children[0] as usize].aabb(), origin, &inverse, &met.distance);
                let b = entry(nodes[children[1] as usize].aabb(), origin, &inverse, &met.distance);
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
    }
}

impl Met {
    #[inline(always)]
    fn nothing_within(distance: [f32; FAN]) -> Self {
        Self { distance, triangle: [NOTHING; FAN], facing: [0.0; FAN] }
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
            let is_hit =
                (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance >= 0.0) & (distance < met.distance[i]);
            met.distance[i] = if is_hit { distance } else { met.distance[i] };
            met.triangle[i] = if is_hit { index } else { met.triangle[i] };
            met.facing[i] = if is_hit { facing } else { met.facing[i] };
        }
    }
}

/// Where the first ray enters a box before its `distance`; infinite where none does.
#[inline(always)]
fn entry(aabb: &Aabb, origin: Vec3A, inverse: &Fan, distance: &[f32; FAN]) -> f32 {
    let (low, high) = (aabb.min - origin, aabb.max - origin);
    let mut entries = [f32::INFINITY; FAN];
    for i in 0..FAN {
        let (ax, bx) = (low.x * inverse.x[i], high.x * inverse.x[i]);
        let (ay, by) = (low.y * inverse.y[i], high.y * inverse.y[i]);
        let (az, bz) = (low.z * inverse.z[i], high.z * inverse.z[i]);
        let near = larger(larger(smaller(ax, bx), smaller(ay, by)), larger(smaller(az, bz), 0.0));
        let far = smaller(smaller(larger(ax, bx), larger(ay, by)), smaller(larger(az, bz), distance[i]));
        entries[i] = if near <= far * BOX_SLACK { near } else { f32::INFINITY };
    }
    reduce(entries, smaller)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles at all places, turned all ways.
    fn clutter() -> Tracer {
        let triangles = (0..300).map(|i| {
            let [a, b, c, d] = crate::solve::sequence::point(i, 1);
            let corner = DVec3::new(a, b, c) * 4.0;
            let axis = DVec3::new(b - 0.5, c - 0.5, d - 0.5);
            [corner, corner + axis.any_orthonormal_vector() * d, corner + axis * 2.0]
        });
        Tracer::new(triangles.collect())
    }

    fn directions() -> Vec<DVec3> {
        let some = (0..256).map(|i| {
            let [a, b, c, _] = crate::solve::sequence::point(i, 2);
            (DVec3::new(a, b, c) - 0.5).normalize()
        });
        some.chain([DVec3::X, -DVec3::Y, DVec3::Z, DVec3::new(0.0, -0.6, 0.8)].repeat(4)).collect()
    }

    #[test]
    fn fans_meet_what_single_rays_meet() {
        let tracer = clutter();
        let mut stack = FanStack::default();
        for origin in [DVec3::splat(2.0), DVec3::new(-1.0, 0.3, 1.7), DVec3::new(0.5, 3.5, 2.0)] {
            let directions = directions();
            let fans: Vec<Fan> = directions.chunks_exact(FAN).map(Fan::new).collect();
            let (mut by_fans, mut singly) = (Vec::new(), Vec::new());
            let axes = [DVec3::X, DVec3::Y, DVec3::Z];
            tracer.look(origin, axes, &fans, &mut stack, |hit, _, _| by_fans.push(*hit));
            for fan in &fans {
                singly.extend((0..FAN).filter_map(|ray| tracer.closest_hit(origin, fan.direction(ray))));
            }
            assert!(singly.len() > 20);
            assert_eq!(by_fans.len(), singly.len());
            for (a, b) in by_fans.iter().zip(&singly) {
                assert_eq!((a.triangle, a.from_behind), (b.triangle, b.from_behind));
                assert!((a.distance - b.distance).abs() < 1e-4 * b.distance, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn fans_of_shadow_rays_agree_with_single_ones() {
        let tracer = clutter();
        let mut stack = FanStack::default();
        let from = DVec3::splat(1.5);
        let to: Vec<DVec3> = directions().iter().map(|d| from + 1.2 * d).collect();
        let mut occluded = 0;
        for to in to.chunks(FAN - 3) {
            let all = tracer.arriving_all(from, to, &mut stack).map(|share| share == 0.0);
            for (ray, to) in to.iter().enumerate() {
                assert_eq!(all[ray], tracer.occluded(from, *to));
                occluded += usize::from(all[ray]);
            }
            assert!(all[to.len()..].iter().all(|hit| !hit));
        }
        assert!(occluded > 20);
        assert_eq!(tracer.arriving_all(from, &[from, DVec3::NAN], &mut stack), [1.0; FAN]);
    }
}
