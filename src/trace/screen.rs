//! Triangles that let light through: what stands in a ray's way, and how much of it goes on.
//!
//! The closed form and the fans treat every triangle as solid; where they meet one that is a screen, the
//! ray is followed here, from triangle to triangle. A scene without screens never comes here.

use std::sync::Arc;

use glam::DVec3;
use obvhs::ray::{Ray, RayHit};

use super::{Facing, Hit, Tracer, direction_of};

/// What is left of a ray below this fraction is followed no further.
const NEGLIGIBLE: f64 = 1e-3;

/// No ray is followed through more screens than this; what is left of it then is stopped.
const MOST_SCREENS: usize = 64;

/// Tells how much of the light a triangle stops.
pub trait Screen: std::fmt::Debug + Send + Sync {
    /// The share of the light, 0 to 1, that does not pass at the point with these weights of the corners.
    fn coverage(&self, barycentric: DVec3) -> f64;
}

/// What stands between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Whether a solid triangle does.
    pub is_blocked: bool,
    /// The share of the light that screens let through; of no meaning where it is blocked.
    pub let_through: f64,
}

impl Sight {
    /// The share of the light that arrives.
    #[must_use]
    pub fn arriving(self) -> f64 {
        if self.is_blocked { 0.0 } else { self.let_through }
    }
}

impl Tracer {
    /// Marks the triangles that are screens, in the order given to [`new`](Self::new); `None` is solid.
    #[must_use]
    pub fn with_screens(self, screens: Vec<Option<Arc<dyn Screen>>>) -> Self {
        let screens = if screens.iter().any(Option::is_some) { screens } else { Vec::new() };
        Self { screens, ..self }
    }

    /// Whether some triangle is a screen.
    #[must_use]
    pub fn has_screens(&self) -> bool {
        !self.screens.is_empty()
    }

    /// Whether a triangle lets light through somewhere.
    #[must_use]
    pub fn is_screen(&self, triangle: usize) -> bool {
        self.screen(triangle).is_some()
    }

    /// How much of the light passes from one point to another. The caller keeps both off their own surfaces.
    #[must_use]
    pub fn sight(&self, from: DVec3, to: DVec3) -> Sight {
        let mut sight = Sight { is_blocked: false, let_through: 1.0 };
        if self.ordered.is_empty() {
            return sight;
        }
        let length = (to - from).length();
        let end = (length * self.scale) as f32;
        let ray = Ray::new(self.traced(from), direction_of((to - from) / length), 0.0, end);
        // What a ray is said not to meet does not end it, so that all screens are asked, each once.
        let is_free = self.rays.ray_traverse_miss(ray, |ray, id| {
            let facing = &self.ordered[id];
            let distance = facing.intersect(ray);
            if distance == f32::INFINITY {
                return distance;
            }
            match self.screen(self.rays.primitive_indices[id] as usize) {
                None => distance,
                Some(screen) => {
                    sight.let_through *= 1.0 - screen.coverage(facing.weights(ray));
                    f32::INFINITY
                }
            }
        });
        sight.is_blocked = !is_free;
        if sight.let_through < NEGLIGIBLE {
            sight.let_through = 0.0;
        }
        sight
    }

    /// Follows a ray along the unit vector `direction` through screens to what stops it. `visit` is told each triangle
    /// and the share of the light that it stops, and says whether to go on.
    pub fn follow(&self, origin: DVec3, direction: DVec3, mut visit: impl FnMut(&Hit, f64) -> bool) {
        if self.ordered.is_empty() {
            return;
        }
        let mut ray = Ray::new_inf(self.traced(origin), direction_of(direction));
        let mut left = 1.0;
        let mut passed: Vec<u32> = Vec::new();
        while left > NEGLIGIBLE {
            let mut hit = RayHit::none();
            let met = self.rays.ray_traverse(ray, &mut hit, |ray, id| {
                let facing = &self.ordered[id];
                let distance = facing.intersect(ray);
                if distance == f32::INFINITY {
                    return distance;
                }
                let triangle = self.rays.primitive_indices[id];
                match self.screen(triangle as usize) {
                    Some(screen)
                        if passed.contains(&triangle) || screen.coverage(facing.weights(ray)) <= 0.0 =>
                    {
                        f32::INFINITY
                    }
                    _ => distance,
                }
            });
            if !met {
                return;
            }
            let facing = &self.ordered[hit.primitive_id as usize];
            let triangle = self.rays.primitive_indices[hit.primitive_id as usize];
            let coverage = match self.screen(triangle as usize) {
                Some(screen) if passed.len() < MOST_SCREENS => screen.coverage(facing.weights(&ray)),
                _ => 1.0,
            };
            let hit_there = Hit {
                triangle: triangle as usize,
                distance: f64::from(hit.t) / self.scale,
                from_behind: facing.edge1.cross(facing.edge2).dot(ray.direction) > 0.0,
            };
            if !visit(&hit_there, left * coverage) {
                return;
            }
            left *= 1.0 - coverage;
            passed.push(triangle);
            ray.tmin = hit.t;
        }
    }

    /// What stops a ray along the unit vector `direction`, if screens stop it as far as a `chance` in `[0, 1)`
    /// lies below their coverage: over evenly spread chances each stops its share.
    #[must_use]
    pub fn stopped_by(&self, origin: DVec3, direction: DVec3, chance: f64) -> Option<Hit> {
        if !self.has_screens() {
            return self.closest_hit(origin, direction);
        }
        let (mut stopped, mut found) = (0.0, None);
        self.follow(origin, direction, |hit, share| {
            stopped += share;
            if stopped > chance {
                found = Some(*hit);
            }
            found.is_none()
        });
        found
    }

    /// The share of the light that the surface just under `position`, which is lifted off it by
    /// [`margin`](Self::margin) along `normal`, stops; 1 where it is no screen.
    #[must_use]
    pub fn own_coverage(&self, position: DVec3, normal: DVec3) -> f64 {
        let mut coverage = None;
        let end = (2.0 * self.margin() * self.scale) as f32;
        let ray = Ray::new(self.traced(position), direction_of(-normal), 0.0, end);
        self.rays.ray_traverse_miss(ray, |ray, id| {
            let facing = &self.ordered[id];
            if facing.intersect(ray) != f32::INFINITY {
                let screen = self.screen(self.rays.primitive_indices[id] as usize);
                let own = screen.map_or(1.0, |screen| screen.coverage(facing.weights(ray)));
                coverage = Some(coverage.map_or(own, |other: f64| other.max(own)));
            }
            f32::INFINITY
        });
        coverage.unwrap_or(1.0)
    }

    pub(super) fn screen(&self, triangle: usize) -> Option<&dyn Screen> {
        self.screens.get(triangle)?.as_deref()
    }
}

impl Facing {
    /// The weights of the corners where the ray crosses the triangle's plane.
    fn weights(&self, ray: &Ray) -> DVec3 {
        let p = ray.direction.cross(self.edge2);
        let inverse = 1.0 / f64::from(self.edge1.dot(p));
        let s = ray.origin - self.corner;
        let u = f64::from(s.dot(p)) * inverse;
        let v = f64::from(ray.direction.dot(s.cross(self.edge1))) * inverse;
        DVec3::new(1.0 - u - v, u, v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{FAN, Fan, FanStack};

    /// Stops all light near the first corner, this share elsewhere.
    #[derive(Debug)]
    struct Veil(f64);

    impl Screen for Veil {
        fn coverage(&self, barycentric: DVec3) -> f64 {
            if barycentric.x > 0.5 { 1.0 } else { self.0 }
        }
    }

    fn triangle_at(z: f64) -> [DVec3; 3] {
        [DVec3::new(0.0, 0.0, z), DVec3::new(1.0, 0.0, z), DVec3::new(0.0, 1.0, z)]
    }

    /// Two veils of 1/4 and 1/2 before a wall.
    fn veiled() -> Tracer {
        let screens: Vec<Option<Arc<dyn Screen>>> =
            vec![Some(Arc::new(Veil(0.25))), Some(Arc::new(Veil(0.5))), None];
        Tracer::new([1.0, 2.0, 3.0].map(triangle_at).to_vec()).with_screens(screens)
    }

    #[test]
    fn what_screens_let_through_is_multiplied() {
        let tracer = veiled();
        let (from, end) = (DVec3::new(0.4, 0.4, 0.0), |z| DVec3::new(0.4, 0.4, z));
        assert_eq!(tracer.sight(from, end(0.9)).arriving(), 1.0);
        assert_eq!(tracer.sight(from, end(1.5)).arriving(), 0.75);
        assert_eq!(tracer.sight(from, end(2.5)).arriving(), 0.375);
        assert!(tracer.sight(from, end(3.5)).is_blocked);
        let thick = DVec3::new(0.1, 0.1, 0.0);
        assert_eq!(tracer.sight(thick, thick + 1.5 * DVec3::Z).arriving(), 0.0);
        let mut stack = FanStack::default();
        let arriving = tracer.arriving_all(from, &[end(0.9), end(2.5), end(3.5)], &mut stack);
        assert_eq!(arriving[..3], [1.0, 0.375, 0.0]);
    }

    #[test]
    fn a_ray_is_shared_out_among_what_stops_it() {
        let tracer = veiled();
        let from = DVec3::new(0.4, 0.4, 0.0);
        let mut followed = Vec::new();
        tracer.follow(from, DVec3::Z, |hit, share| {
            followed.push((hit.triangle, share));
            true
        });
        assert_eq!(followed, [(0, 0.25), (1, 0.375), (2, 0.375)]);
        let mut seen = Vec::new();
        let fans = [Fan::new(&[DVec3::Z; FAN])];
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        tracer.look(from, axes, &fans, &mut FanStack::default(), |hit, _, share| {
            seen.push((hit.triangle, share));
        });
        assert_eq!(seen.len(), 3 * FAN);
        assert_eq!(seen[..3], followed[..]);
        let stopped = |chance| tracer.stopped_by(from, DVec3::Z, chance).map(|hit| hit.triangle);
        assert_eq!([0.1, 0.3, 0.9].map(stopped), [Some(0), Some(1), Some(2)]);
    }

    #[test]
    fn a_surface_knows_its_own_coverage() {
        let tracer = veiled();
        let above = |x: f64, z: f64| DVec3::new(x, 0.1, z + tracer.margin());
        assert_eq!(tracer.own_coverage(above(0.1, 1.0), DVec3::Z), 1.0);
        assert_eq!(tracer.own_coverage(above(0.7, 1.0), DVec3::Z), 0.25);
        assert_eq!(tracer.own_coverage(above(0.7, 3.0), DVec3::Z), 1.0);
    }
}
