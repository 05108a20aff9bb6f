//! Ray tracing and spatial look-ups. The only module that knows obvhs, and pulp, which
//! compiles the rays' inner loops for each kind of processor.
//!
//! Positions are shifted to the scene's centre in double precision before they are
//! rounded to `f32`, so that a scene a million metres from the origin is traced as
//! well as one at the origin; and scaled, since obvhs 0.4 overlooks what is nearer to a
//! ray's origin than 1e-4 of its units: walls' feet, sheets on desks.

use std::sync::Arc;
use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};

mod fan;
mod screen;
pub mod shaft;

pub use fan::{FAN, Fan, FanStack};
pub use screen::{Screen, Sight};

use crate::geom::Bounds;

/// Rays start and end this fraction of the scene's diagonal short of their surfaces.
///
/// `f32` keeps positions to 6e-8 of the scene; two orders above that no ray meets the surface it left.
pub const RAY_MARGIN: f64 = 4e-6;

/// The scene's diagonal in obvhs's units. The nearest that is seen lies at 1e-4 of one, a thousandth of
/// [`RAY_MARGIN`].
const TRACED_DIAGONAL: f64 = 3e4;

/// A closest hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index of the triangle among those given to [`Tracer::new`].
    pub triangle: usize,
    /// Distance along the ray in units of its direction's length.
    pub distance: f64,
    /// Whether the ray came from behind the triangle.
    pub from_behind: bool,
}

/// Triangles in a form that rays can be traced through.
pub struct Tracer {
    rays: CwBvh,
    boxes: Bvh2,
    /// In the order of `rays.primitive_indices`.
    ordered: Vec<Facing>,
    /// In the order of `boxes.primitive_indices`.
    leaves: Vec<Facing>,
    triangles: Vec<[DVec3; 3]>,
    /// Empty where no triangle is double-sided.
    double_sided: Vec<bool>,
    /// Empty where every triangle is solid.
    screens: Vec<Option<Arc<dyn Screen>>>,
    centre: DVec3,
    /// From metres to obvhs's units.
    scale: f64,
    diagonal: f64,
    /// What the processor can do.
    arch: pulp::Arch,
}

/// A triangle prepared for intersection (Möller and Trumbore 1997).
#[derive(Clone, Copy)]
struct Facing {
    corner: Vec3A,
    edge1: Vec3A,
    edge2: Vec3A,
}

struct Boxed(obvhs::aabb::Aabb);

impl Boundable for Boxed {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        self.0
    }
}

impl Tracer {
    /// Builds the acceleration structures over world-space triangles (metres).
    ///
    /// Degenerate triangles may be among them; no ray hits those.
    #[must_use]
    pub fn new(triangles: Vec<[DVec3; 3]>) -> Self {
        let bounds = Bounds::of(triangles.iter().flatten().copied());
        let centre = if triangles.is_empty() { DVec3::ZERO } else { bounds.centre() };
        let diagonal = bounds.diagonal();
        let scale = if diagonal > 0.0 { TRACED_DIAGONAL / diagonal } else { 1.0 };
        let local = |p: DVec3| ((p - centre) * scale).as_vec3a();
        let boxed: Vec<Boxed> = triangles
            .iter()
            .map(|t| Boxed(obvhs::aabb::Aabb::from_points(&[local(t[0]), local(t[1]), local(t[2])])))
            .collect();
        let mut build_time = Duration::default();
        // The wide tree is made from leaves of one triangle; it gathers up to three itself.
        let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let boxes = build_bvh2(&boxed, params, &mut build_time);
        let rays = bvh2_to_cwbvh(&boxes, 3, true, false);
        let facing = |&i: &u32| {
            let t = triangles[i as usize];
            let corner = local(t[0]);
            Facing { corner, edge1: local(t[1]) - corner, edge2: local(t[2]) - corner }
        };
        let ordered = rays.primitive_indices.iter().map(facing).collect();
        let leaves = boxes.primitive_indices.iter().map(facing).collect();
        let (double_sided, screens) = (Vec::new(), Vec::new());
        let arch = pulp::Arch::new();
        Self { rays, boxes, ordered, leaves, triangles, double_sided, screens, centre, scale, diagonal, arch }
    }

    /// Marks the triangles whose backs are surfaces like their fronts, in the order given to [`new`](Self::new).
    #[must_use]
    pub fn with_double_sided(self, double_sided: Vec<bool>) -> Self {
        Self { double_sided, ..self }
    }

    /// Whether a triangle's back reflects and emits as its front does.
    #[must_use]
    pub fn is_double_sided(&self, triangle: usize) -> bool {
        self.double_sided.get(triangle).copied().unwrap_or(false)
    }

    /// The triangles as they were given.
    #[must_use]
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Whether a hit met a back that is no surface: that of a single-sided triangle.
    #[must_use]
    pub fn met_back(&self, hit: &Hit) -> bool {
        hit.from_behind && !self.is_double_sided(hit.triangle)
    }

    /// The scene's diagonal, metres.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// The distance that rays keep from surfaces, metres.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.diagonal * RAY_MARGIN
    }

    /// Whether a triangle stands between two points; a screen does where it stops half of the light. The caller keeps
    /// both off their own surfaces.
    #[must_use]
    pub fn occluded(&self, from: DVec3, to: DVec3) -> bool {
        if self.has_screens() {
            return self.sight(from, to).arriving() <= 0.5;
        }
        if self.ordered.is_empty() {
            return false;
        }
        let length = (to - from).length();
        let end = (length * self.scale) as f32;
        let ray = Ray::new(self.traced(from), direction_of((to - from) / length), 0.0, end);
        !self.rays.ray_traverse_miss(ray, |ray, id| self.ordered[id].intersect(ray))
    }

    /// The nearest triangle along a ray, a screen as well as a solid one; `direction` need not have unit length.
    #[must_use]
    pub fn closest_hit(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        if self.ordered.is_empty() {
            return None;
        }
        let length = direction.length();
        let ray = Ray::new_inf(self.traced(origin), direction_of(direction / length));
        let mut hit = RayHit::none();
        if !self.rays.ray_traverse(ray, &mut hit, |ray, id| self.ordered[id].intersect(ray)) {
            return None;
        }
        let triangle = self.ordered[hit.primitive_id as usize];
        let normal = triangle.edge1.cross(triangle.edge2);
        Some(Hit {
            triangle: self.rays.primitive_indices[hit.primitive_id as usize] as usize,
            distance: f64::from(hit.t) / (self.scale * length),
            from_behind: normal.dot(ray.direction) > 0.0,
        })
    }

    /// Appends the triangles whose boxes touch `bounds` to `out`, in ascending order.
    pub fn triangles_in(&self, bounds: Bounds, out: &mut Vec<u32>) {
        let first = out.len();
        // Rounding to f32 must not lose a box that touches.
        let slack = self.diagonal * f64::from(f32::EPSILON);
        let query = bounds.grown(slack);
        let query = obvhs::aabb::Aabb::new(self.traced(query.min), self.traced(query.max));
        self.boxes.aabb_traverse(query, |bvh, node| {
            let node = &bvh.nodes[node as usize];
            let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            out.extend(&bvh.primitive_indices[range]);
            true
        });
        out[first..].sort_unstable();
    }

    /// A point in obvhs's units.
    fn traced(&self, p: DVec3) -> Vec3A {
        ((p - self.centre) * self.scale).as_vec3a()
    }

    /// Visits the triangles in every leaf box that `keep` does not refuse; `keep` is asked from the root down.
    fn visit(&self, keep: impl Fn(Bounds) -> bool, mut visit: impl FnMut(u32)) {
        let mut stack = Vec::with_capacity(64);
        if !self.boxes.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(index) = stack.pop() {
            let node = &self.boxes.nodes[index];
            let aabb = node.aabb();
            let world = |p: Vec3A| p.as_dvec3() / self.scale + self.centre;
            let bounds = Bounds { min: world(aabb.min), max: world(aabb.max) };
            if !keep(bounds) {
                continue;
            }
            let first = node.first_index as usize;
            if node.is_leaf() {
                self.boxes.primitive_indices[first..first + node.prim_count as usize]
                    .iter()
                    .for_each(|&t| visit(t));
            } else {
                stack.extend([first + 1, first]);
            }
        }
    }
}

/// Adding zero turns −0 into +0: obvhs 0.4 misses boxes along a negative zero.
fn direction_of(d: DVec3) -> Vec3A {
    d.as_vec3a() + Vec3A::ZERO
}

impl Facing {
    /// Distance along the ray, or infinity. Both sides are hit.
    #[inline(always)]
    fn intersect(&self, ray: &Ray) -> f32 {
        let p = ray.direction.cross(self.edge2);
        let det = self.edge1.dot(p);
        let inverse = 1.0 / det;
        let s = ray.origin - self.corner;
        let u = s.dot(p) * inverse;
        let q = s.cross(self.edge1);
        let v = ray.direction.dot(q) * inverse;
        let t = self.edge2.dot(q) * inverse;
        // NaN from a degenerate triangle fails every comparison.
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= ray.tmin && t <= ray.tmax { t } else { f32::INFINITY }
    }
}

impl crate::surface::BoxQuery for Tracer {
    fn triangles_in(&self, bounds: Bounds, out: &mut Vec<u32>) {
        Tracer::triangles_in(self, bounds, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square_at(z: f64) -> [[DVec3; 3]; 2] {
        let p = |x, y| DVec3::new(x, y, z);
        [[p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0)], [p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]]
    }

    #[test]
    fn segments_through_a_square_are_occluded_far_from_the_origin_too() {
        for offset in [DVec3::ZERO, DVec3::new(1e6, -1e6, 1e6)] {
            let tracer = Tracer::new(square_at(0.5).map(|t| t.map(|p| p + offset)).into_iter().collect());
            let at = |x, y, z| DVec3::new(x, y, z) + offset;
            assert!(tracer.occluded(at(0.3, 0.6, 0.0), at(0.3, 0.6, 1.0)));
            assert!(tracer.occluded(at(0.3, 0.6, 1.0), at(0.3, 0.6, 0.0)));
            assert!(!tracer.occluded(at(0.3, 0.6, 0.0), at(0.3, 0.6, 0.49)));
            assert!(!tracer.occluded(at(1.3, 0.6, 0.0), at(1.3, 0.6, 1.0)));
        }
    }

    /// A ray that starts at a tenth of a thousandth of the scene from a wall meets it.
    #[test]
    fn what_is_very_near_is_met() {
        for size in [1e-3, 1.0, 1e3] {
            let scaled = |z| square_at(z).map(|t| t.map(|p| p * size));
            let tracer = Tracer::new([scaled(0.0), scaled(1.0)].concat());
            let origin = DVec3::new(0.4, 0.7, 2e-5) * size;
            let direction = DVec3::new(0.1, 0.2, -1.0).normalize();
            let hit = tracer.closest_hit(origin, direction).unwrap();
            assert!(hit.distance < 2.2e-5 * size, "{hit:?}");
            assert!(tracer.occluded(origin, origin + direction * size));
        }
    }

    #[test]
    fn hits_know_their_side() {
        let tracer = Tracer::new(square_at(0.5).to_vec());
        let below = tracer.closest_hit(DVec3::new(0.2, 0.7, 0.0), DVec3::Z).unwrap();
        let above = tracer.closest_hit(DVec3::new(0.2, 0.7, 1.0), -DVec3::Z).unwrap();
        assert!(below.from_behind && !above.from_behind);
        assert!((below.distance - 0.5).abs() < 1e-6);
        assert_eq!(below.triangle, 1);
    }

    #[test]
    fn boxes_find_what_touches_them() {
        let tracer = Tracer::new([square_at(0.0), square_at(1.0)].concat());
        let mut out = Vec::new();
        tracer.triangles_in(Bounds::of([DVec3::splat(0.2), DVec3::new(0.9, 0.9, 1.0)]), &mut out);
        assert_eq!(out, [2, 3]);
    }

    #[test]
    fn an_empty_scene_hides_nothing() {
        let tracer = Tracer::new(Vec::new());
        assert!(!tracer.occluded(DVec3::ZERO, DVec3::ONE));
        assert!(tracer.closest_hit(DVec3::ZERO, DVec3::X).is_none());
    }
}
