//! An emitter seen along a few rays, where what hides it is too much to be cut away, or it too small.

use std::f64::consts::PI;

use glam::DVec3;

use super::{AreaEmitter, Evaluation};
use crate::solve::form_factor::SurfacePoint;
use crate::trace::{FAN, Tracer};

/// A grid of points on an emitter, to which rays go; each part of one that is no single polygon has its share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayGrid {
    /// Two a side.
    Coarse,
    /// Four a side.
    Medium,
    /// Eight a side.
    Fine,
}

impl RayGrid {
    pub(super) const ALL: [Self; 3] = [Self::Coarse, Self::Medium, Self::Fine];

    fn points_a_side(self) -> u32 {
        2 << self as u32
    }
}

/// A shadow ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    /// Where it ends.
    to: DVec3,
    /// Of the form factor, what it stands for.
    part: f64,
    /// Number of what it ends at.
    emitter: u32,
}

/// What is this many of its diameters away is far.
const FAR: f64 = 5.0;

impl Evaluation {
    /// Tells `give` the ray and the share of its light, above 0, that nothing stops on the way to `receiver`, of all
    /// its rays.
    fn see_along_rays(&mut self, receiver: SurfacePoint, tracer: &Tracer, mut give: impl FnMut(Ray, f64)) {
        for rays in self.rays.chunks(FAN) {
            let mut to = [DVec3::ZERO; FAN];
            to.iter_mut().zip(rays).for_each(|(to, ray)| *to = ray.to);
            let arriving = tracer.arriving_all(receiver.position, &to[..rays.len()], &mut self.stack);
            for (ray, arriving) in rays.iter().zip(arriving).filter(|(_, arriving)| *arriving > 0.0) {
                give(*ray, arriving);
            }
        }
        self.effort.rays += self.rays.len() as u64;
    }
}

impl AreaEmitter {
    /// The kernel-weighted fraction of sample points in sight.
    pub(super) fn fraction_by_rays(
        &self,
        receiver: SurfacePoint,
        tracer: &Tracer,
        e: &mut Evaluation,
    ) -> f64 {
        e.rays.clear();
        let grid = e.precision.rays;
        self.aim(receiver, tracer.margin(), grid, |to, part| e.rays.push(Ray { to, part, emitter: 0 }));
        let all: f64 = e.rays.iter().map(|ray| ray.part).sum();
        let mut seen = 0.0;
        e.see_along_rays(receiver, tracer, |ray, arriving| seen += ray.part * arriving);
        if all > 0.0 { seen / all } else { 0.0 }
    }

    /// Of the light that solid triangles do not stop, the kernel-weighted share that screens let through.
    pub(super) fn share_through_screens(
        &self,
        receiver: SurfacePoint,
        tracer: &Tracer,
        e: &mut Evaluation,
    ) -> f64 {
        let (mut unblocked, mut through) = (0.0, 0.0);
        self.aim(receiver, tracer.margin(), RayGrid::Fine, |to, part| {
            e.effort.rays += 1;
            let sight = tracer.sight(receiver.position, to);
            if !sight.is_blocked {
                unblocked += part;
                through += part * sight.let_through;
            }
        });
        if unblocked > 0.0 { through / unblocked } else { 1.0 }
    }

    /// What the form factor from `receiver` would be if all of it were at `q`.
    fn kernel(&self, receiver: SurfacePoint, q: DVec3) -> f64 {
        let d = q - receiver.position;
        let square = d.length_squared();
        let cosines = receiver.normal.dot(d).max(0.0) * (-self.frame.normal.dot(d)).max(0.0);
        self.area * cosines / (PI * square * square)
    }

    /// Gives points all over it, lifted by `margin`, and what each is told to be of the form factor at `receiver`,
    /// but those that cannot shine there.
    fn aim(&self, receiver: SurfacePoint, margin: f64, grid: RayGrid, mut give: impl FnMut(DVec3, f64)) {
        let lift = self.frame.normal * margin;
        for &(q, share) in &self.grids[grid as usize] {
            let part = share * self.kernel(receiver, q);
            if part > 0.0 {
                give(q + lift, part);
            }
        }
    }

    /// Whether it is so far away that few points tell its form factor to a hundredth.
    fn is_far(&self, from: DVec3) -> bool {
        let nearest = self.hull.iter().map(|q| q.distance_squared(from)).fold(f64::INFINITY, f64::min);
        nearest > FAR * FAR * self.diameter_squared
    }
}

/// Points all over convex `parts`, and the share of their area that each stands for.
pub(super) fn grid_points(parts: &[Vec<DVec3>], grid: RayGrid) -> Vec<(DVec3, f64)> {
    let whole: f64 = parts.iter().map(|p| fan_area(p)).sum();
    let most = grid.points_a_side();
    let mut points = Vec::new();
    for part in parts {
        let share = fan_area(part) / whole;
        let side = ((f64::from(most) * share.sqrt()).ceil() as u32).clamp(1, most);
        points.extend((0..side * side).map(|k| {
            let u = (f64::from(k % side) + 0.5) / f64::from(side);
            let v = (f64::from(k / side) + 0.5) / f64::from(side);
            (point_in_fan(part, u, v), share / f64::from(side * side))
        }));
    }
    points
}

/// What `receiver` sees of all `emitters` that matter, as form factors by the emitters' numbers in ascending order,
/// visibility counted by a few rays each. With nothing between, those that are left out would give no more than
/// `negligible` if they shone with the exitance beside them.
pub fn seen_by_rays<'t>(
    emitters: impl Iterator<Item = (&'t AreaEmitter, f64)>,
    receiver: SurfacePoint,
    tracer: &Tracer,
    negligible: f64,
    e: &mut Evaluation,
    seen: &mut Vec<(u32, f32)>,
) {
    let SurfacePoint { position, normal } = receiver;
    e.rays.clear();
    for ((emitter, exitance), number) in emitters.zip(0..) {
        if emitter.is_behind_from(position, &[position], normal, 0.0) {
            continue;
        }
        let first = e.rays.len();
        let mut push = |to, part| e.rays.push(Ray { to, part, emitter: number });
        emitter.aim(receiver, tracer.margin(), e.precision.rays, &mut push);
        let told: f64 = e.rays[first..].iter().map(|ray| ray.part).sum();
        let form_factor = if emitter.is_far(receiver.position) { told } else { emitter.unoccluded(receiver) };
        if exitance * form_factor > negligible {
            e.rays[first..].iter_mut().for_each(|ray| ray.part *= form_factor / told);
        } else {
            e.rays.truncate(first);
        }
    }
    seen.clear();
    e.see_along_rays(receiver, tracer, |ray, arriving| {
        let form_factor = (ray.part * arriving) as f32;
        match seen.last_mut() {
            Some((emitter, sum)) if *emitter == ray.emitter => *sum += form_factor,
            _ => seen.push((ray.emitter, form_factor)),
        }
    });
}

pub(in crate::solve) fn fan_area(part: &[DVec3]) -> f64 {
    (1..part.len().saturating_sub(1))
        .map(|i| crate::geom::triangle::area([part[0], part[i], part[i + 1]]))
        .sum()
}

/// Maps the unit square onto a convex polygon, area for area.
pub(in crate::solve) fn point_in_fan(part: &[DVec3], u: f64, v: f64) -> DVec3 {
    let mut target = u * fan_area(part);
    let last = part.len() - 2;
    for i in 1..=last {
        let area = crate::geom::triangle::area([part[0], part[i], part[i + 1]]);
        if target <= area || i == last {
            let s = if area > 0.0 { (target / area).clamp(0.0, 1.0) } else { 0.5 };
            let r = v.sqrt();
            return part[0].lerp(part[i].lerp(part[i + 1], s), r);
        }
        target -= area;
    }
    part[0]
}
