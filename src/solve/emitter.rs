//! What shoots first: glowing surfaces and punctual lights.

mod rays;

use std::f64::consts::PI;

use glam::DVec3;

use super::form_factor::{SurfacePoint, signed_point_to_polygon};
use super::umbra::Occluder;
use super::visible::{ConvexParts, Workspace, visible_form_factor};
use crate::geom::hull::convex_hull;
use crate::geom::{Bounds, Frame, Slab};
use crate::light::luminance;
use crate::scene::{PunctualKind, PunctualLight};
use crate::surface::SmoothNormals;
use crate::trace::shaft::Shaft;
use crate::trace::{FanStack, Tracer};

use rays::{Ray, grid_points};
pub use rays::{RayGrid, seen_by_rays};
pub(super) use rays::{fan_area, point_in_fan};

/// How hard to look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Precision {
    /// Up to this many occluders are subtracted exactly; beyond, rays are counted.
    pub exact_occluders: usize,
    /// Rays that stand in for the exact visibility.
    pub rays: RayGrid,
}

impl Precision {
    /// For emitters: few, strong, and seen in every shadow's edge.
    pub const EMITTER: Self = Self { exact_occluders: 32, rays: RayGrid::Fine };
    /// For small places that reflect much.
    pub const HOT_SPOT: Self = Self { exact_occluders: 0, rays: RayGrid::Coarse };
    /// For emitters seen from several points of one texel.
    pub const TEXEL: Self = Self { exact_occluders: 32, rays: RayGrid::Medium };
}

/// A glowing planar polygon of uniform radiance, one side of it.
#[derive(Clone, Debug)]
pub struct AreaEmitter {
    parts: Vec<Vec<DVec3>>,
    /// The convex hull, world space: for shafts.
    hull: Vec<DVec3>,
    frame: Frame,
    /// Exitance `π L`.
    exitance: DVec3,
    /// Square metres.
    area: f64,
    /// Square of the hull's diameter, square metres.
    diameter_squared: f64,
    /// By grid: points and the share of the area that each stands for.
    grids: [Vec<(DVec3, f64)>; 3],
}

/// Something that light comes from.
#[derive(Clone, Debug)]
pub enum Emitter {
    /// A glowing polygon.
    Area(AreaEmitter),
    /// A point, spot or directional light.
    Punctual(PunctualLight),
}

/// What stands between a receiver and an emitter.
#[derive(Clone, Copy, Debug)]
pub enum Between<'a> {
    /// Nothing: the shaft is empty.
    Nothing,
    /// These convex polygons at most.
    Polygons(&'a [Occluder<'a>]),
}

impl<'a> Between<'a> {
    /// These polygons, or nothing where there are none.
    #[must_use]
    pub fn of(polygons: &'a [Occluder<'a>]) -> Self {
        if polygons.is_empty() { Self::Nothing } else { Self::Polygons(polygons) }
    }
}

/// How much was evaluated which way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Evaluated without asking for visibility: the shaft was empty.
    pub unoccluded: u64,
    /// Occluders subtracted exactly.
    pub exact: u64,
    /// Visibility counted by rays.
    pub by_rays: u64,
    /// Rays cast.
    pub rays: u64,
}

impl Effort {
    /// Adds another's counts.
    pub fn add(&mut self, other: Self) {
        self.unoccluded += other.unoccluded;
        self.exact += other.exact;
        self.by_rays += other.by_rays;
        self.rays += other.rays;
    }
}

/// Memory and counters for evaluating emitters.
pub struct Evaluation {
    workspace: Workspace,
    stack: FanStack,
    rays: Vec<Ray>,
    precision: Precision,
    /// What was done so far.
    pub effort: Effort,
}

impl Evaluation {
    /// Nothing done yet.
    #[must_use]
    pub fn new(precision: Precision) -> Self {
        let (workspace, stack) = (Workspace::default(), FanStack::default());
        Self { workspace, stack, rays: Vec::new(), precision, effort: Effort::default() }
    }
}

impl AreaEmitter {
    /// A polygon of `area` in `frame`, whose normal is the emitting side, with exitance `π L`.
    ///
    /// `parts` are the polygon as convex ones in world space, counter-clockwise seen from the emitting side.
    #[must_use]
    pub fn new(frame: Frame, parts: Vec<Vec<DVec3>>, area: f64, exitance: DVec3) -> Self {
        let corners = parts.iter().flatten().map(|&p| frame.project(p)).collect();
        let hull: Vec<DVec3> = convex_hull(corners).into_iter().map(|p| frame.lift(p)).collect();
        let grids = RayGrid::ALL.map(|grid| grid_points(&parts, grid));
        let distances = hull.iter().flat_map(|p| hull.iter().map(|q| q.distance_squared(*p)));
        let diameter_squared = distances.fold(0.0, f64::max);
        Self { parts, hull, frame, exitance, area, diameter_squared, grids }
    }

    /// Its plane: the normal is the emitting side's.
    #[must_use]
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// `π L`.
    #[must_use]
    pub fn exitance(&self) -> DVec3 {
        self.exitance
    }

    /// The power that leaves it.
    #[must_use]
    pub fn power(&self) -> DVec3 {
        self.exitance * self.area
    }

    /// The form factor from `receiver` with nothing between, in `[0, 1]`.
    #[must_use]
    pub fn unoccluded(&self, receiver: SurfacePoint) -> f64 {
        if self.frame.height(receiver.position) <= 0.0 {
            return 0.0;
        }
        self.parts.iter().map(|p| signed_point_to_polygon(receiver, p)).sum::<f64>().clamp(0.0, 1.0)
    }

    /// As [`Emitter::is_behind_from`].
    fn is_behind_from(&self, lowest: DVec3, corners: &[DVec3], normal: DVec3, margin: f64) -> bool {
        self.hull.iter().all(|&q| normal.dot(q - lowest) <= margin)
            || corners.iter().all(|&p| self.frame.height(p) <= margin)
    }

    fn visible(
        &self,
        receiver: SurfacePoint,
        tracer: &Tracer,
        between: &[Occluder],
        e: &mut Evaluation,
    ) -> f64 {
        let solid = between.iter().filter(|occluder| !occluder.is_screen);
        if solid.clone().count() <= e.precision.exact_occluders {
            let parts = ConvexParts {
                parts: &self.parts,
                normal: self.frame.normal,
                origin: self.frame.origin,
                margin: tracer.margin() * 0.5,
            };
            let has_screens = between.iter().any(|occluder| occluder.is_screen);
            let occluders = solid.map(|occluder| occluder.corners);
            if let Some(f) = visible_form_factor(receiver, parts, occluders, &mut e.workspace) {
                if has_screens && f > 0.0 {
                    e.effort.by_rays += 1;
                    return f * self.share_through_screens(receiver, tracer, e);
                }
                e.effort.exact += 1;
                return f;
            }
        }
        e.effort.by_rays += 1;
        let unoccluded = self.unoccluded(receiver);
        if unoccluded == 0.0 { 0.0 } else { unoccluded * self.fraction_by_rays(receiver, tracer, e) }
    }
}

impl Emitter {
    /// The irradiance that it gives to `receiver`, past what stands `between`.
    ///
    /// `receiver.position` must be off its surface by [`Tracer::margin`].
    pub fn irradiance(
        &self,
        receiver: SurfacePoint,
        tracer: &Tracer,
        between: Between,
        evaluation: &mut Evaluation,
    ) -> DVec3 {
        match (self, between) {
            (Self::Area(area), Between::Nothing) => {
                evaluation.effort.unoccluded += 1;
                area.exitance * area.unoccluded(receiver)
            }
            (Self::Area(area), Between::Polygons(polygons)) => {
                area.exitance * area.visible(receiver, tracer, polygons, evaluation)
            }
            (Self::Punctual(light), between) => {
                let irradiance = punctual_irradiance(light, receiver);
                match between {
                    Between::Polygons(_) if irradiance != DVec3::ZERO => {
                        evaluation.effort.by_rays += 1;
                        evaluation.effort.rays += 1;
                        let to = self.toward(receiver.position, tracer.diagonal());
                        irradiance * tracer.sight(receiver.position, to).arriving()
                    }
                    _ => {
                        evaluation.effort.unoccluded += 1;
                        irradiance
                    }
                }
            }
        }
    }

    /// The power that it shoots; for punctual lights an upper bound's order of magnitude over a scene
    /// of the given diagonal, which serves to order them only.
    #[must_use]
    pub fn power(&self, diagonal: f64) -> DVec3 {
        match self {
            Self::Area(area) => area.power(),
            Self::Punctual(light) => match light.kind {
                PunctualKind::Directional { .. } => light.intensity * diagonal * diagonal,
                PunctualKind::Point { .. } => light.intensity * 4.0 * PI,
                PunctualKind::Spot { outer_cone, .. } => {
                    light.intensity * 2.0 * PI * (1.0 - outer_cone.cos())
                }
            },
        }
    }

    /// No place in `block` receives more luminance from it than this; `diagonal` is the scene's.
    #[must_use]
    pub fn at_most(&self, block: Bounds, diagonal: f64) -> f64 {
        match self {
            Self::Area(area) => {
                let centre = self.centre(block.centre(), diagonal);
                let nearest = (block.distance(centre) - area.diameter_squared.sqrt()).max(0.0);
                let form_factor = area.area / (PI * nearest * nearest);
                luminance(area.exitance) * form_factor.min(1.0)
            }
            Self::Punctual(_) => f64::INFINITY,
        }
    }

    /// No place in `block` is nearer to it than this, metres.
    #[must_use]
    pub fn distance(&self, block: Bounds) -> f64 {
        let own = match self {
            Self::Area(area) => Bounds::of(area.hull.iter().copied()),
            Self::Punctual(light) => match light.kind {
                PunctualKind::Point { position, .. } | PunctualKind::Spot { position, .. } => {
                    Bounds::of([position])
                }
                PunctualKind::Directional { .. } => return f64::INFINITY,
            },
        };
        (own.min - block.max).max(block.min - own.max).max(DVec3::ZERO).length()
    }

    /// The shaft from where light is received to the emitter.
    #[must_use]
    pub fn shaft(&self, receiver: &Slab, tracer: &Tracer) -> Shaft {
        let margin = tracer.margin() * 0.5;
        let shooter = match self {
            Self::Area(area) => Slab::flat(area.hull.clone()),
            Self::Punctual(light) => match light.kind {
                PunctualKind::Point { position, .. } | PunctualKind::Spot { position, .. } => {
                    Slab::flat(vec![position])
                }
                PunctualKind::Directional { direction } => {
                    receiver.moved(direction * (-2.0 * tracer.diagonal()))
                }
            },
        };
        Shaft::between_slabs(receiver, &shooter, margin)
    }

    /// The triangles that reach into the shaft from `receiver`, over a plane that may be drawn with smooth normals,
    /// ascending. `inherited` holds what reaches into a shaft that contains this one: the parent's, handed down.
    #[must_use]
    pub fn between(
        &self,
        receiver: &Slab,
        (plane, smooth): (&Frame, Option<&SmoothNormals>),
        tracer: &Tracer,
        inherited: Option<&[u32]>,
    ) -> Vec<u32> {
        let mut between = Vec::new();
        match inherited {
            None => self.shaft(receiver, tracer).gather(tracer, &mut between),
            Some([]) => {}
            Some(list) => self.shaft(receiver, tracer).filter(tracer, list, &mut between),
        }
        if let Some(smooth) = smooth {
            smooth.settle_own(self.reaches_behind(plane), &mut between);
        }
        between
    }

    /// Points that together hide the whole emitter from `at` when each is hidden by the same convex occluder.
    pub(crate) fn corners_seen_from(&self, at: DVec3, diagonal: f64, out: &mut Vec<DVec3>) {
        out.clear();
        match self {
            Self::Area(area) => out.extend(&area.hull),
            Self::Punctual(_) => out.push(self.toward(at, diagonal)),
        }
    }

    /// Whether none of its light can reach a receiving place in a plane that faces along `normal`, or is drawn with
    /// `smooth` normals.
    #[must_use]
    pub fn is_behind(
        &self,
        receiver: &Slab,
        normal: DVec3,
        smooth: Option<&SmoothNormals>,
        margin: f64,
    ) -> bool {
        let corners = receiver.corners();
        let Some(&first) = corners.first() else { return true };
        let Some(smooth) = smooth else { return self.is_behind_from(first, corners, normal, margin) };
        let is_behind = |normal: &DVec3| {
            let lowest = corners.iter().min_by(|a, b| normal.dot(**a).total_cmp(&normal.dot(**b)));
            self.is_behind_from(*lowest.unwrap_or(&first), corners, *normal, margin)
        };
        !smooth.normals().is_empty() && smooth.normals().iter().all(is_behind)
    }

    /// Whether none of its light can reach places with these corners that face along `normal`, of which `lowest` is
    /// the one that lies farthest back.
    fn is_behind_from(&self, lowest: DVec3, corners: &[DVec3], normal: DVec3, margin: f64) -> bool {
        match self {
            Self::Area(area) => area.is_behind_from(lowest, corners, normal, margin),
            Self::Punctual(light) => match light.kind {
                PunctualKind::Directional { direction } => normal.dot(direction) >= 0.0,
                PunctualKind::Point { position, .. } | PunctualKind::Spot { position, .. } => {
                    normal.dot(position - lowest) <= margin
                }
            },
        }
    }

    /// Whether some of its light comes from behind a plane.
    fn reaches_behind(&self, plane: &Frame) -> bool {
        match self {
            Self::Area(area) => area.hull.iter().any(|&q| plane.height(q) < 0.0),
            Self::Punctual(light) => match light.kind {
                PunctualKind::Directional { direction } => plane.normal.dot(direction) > 0.0,
                PunctualKind::Point { position, .. } | PunctualKind::Spot { position, .. } => {
                    plane.height(position) < 0.0
                }
            },
        }
    }

    /// Centre, for the paper's point-to-point estimate; the direction's far end for a directional light.
    #[must_use]
    pub fn centre(&self, at: DVec3, diagonal: f64) -> DVec3 {
        match self {
            Self::Area(area) => area.hull.iter().sum::<DVec3>() / area.hull.len().max(1) as f64,
            Self::Punctual(_) => self.toward(at, diagonal),
        }
    }

    /// The area polygon's normal and area; `None` for punctual lights.
    #[must_use]
    pub fn facing(&self) -> Option<(DVec3, f64, DVec3)> {
        match self {
            Self::Area(area) => Some((area.frame.normal, area.area, area.exitance)),
            Self::Punctual(_) => None,
        }
    }

    /// How wide it is where it is narrowest, about, metres; `None` for punctual lights.
    #[must_use]
    pub fn width(&self) -> Option<f64> {
        match self {
            Self::Area(area) => {
                let bounds = Bounds::of(area.hull.iter().copied());
                Some(area.area / bounds.diagonal())
            }
            Self::Punctual(_) => None,
        }
    }

    /// Where a shadow ray from `at` to a punctual light ends.
    fn toward(&self, at: DVec3, diagonal: f64) -> DVec3 {
        match self {
            Self::Area(area) => area.frame.origin,
            Self::Punctual(light) => match light.kind {
                PunctualKind::Point { position, .. } | PunctualKind::Spot { position, .. } => position,
                PunctualKind::Directional { direction } => at - direction * (2.0 * diagonal),
            },
        }
    }
}

/// `E = I cos θ / r²` with range and cone as `KHR_lights_punctual` defines them; `E = lux cos θ` for directional lights.
fn punctual_irradiance(light: &PunctualLight, receiver: SurfacePoint) -> DVec3 {
    let (position, range, cone) = match light.kind {
        PunctualKind::Directional { direction } => {
            return light.intensity * (-direction.dot(receiver.normal)).max(0.0);
        }
        PunctualKind::Point { position, range } => (position, range, None),
        PunctualKind::Spot { position, direction, range, inner_cone, outer_cone } => {
            (position, range, Some((direction, inner_cone, outer_cone)))
        }
    };
    let to_light = position - receiver.position;
    let square = to_light.length_squared();
    let distance = square.sqrt();
    let cosine = receiver.normal.dot(to_light) / distance;
    if cosine.is_nan() || cosine <= 0.0 {
        return DVec3::ZERO;
    }
    let mut factor = cosine / square;
    if range.is_finite() {
        factor *= (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0);
    }
    if let Some((direction, inner, outer)) = cone {
        let scale = 1.0 / (inner.cos() - outer.cos()).max(0.001);
        let t = ((-direction.dot(to_light) / distance - outer.cos()) * scale).clamp(0.0, 1.0);
        factor *= t * t;
    }
    light.intensity * factor
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn floor_point(x: f64) -> SurfacePoint {
        SurfacePoint { position: DVec3::new(x, 0.0, 0.0), normal: DVec3::Z }
    }

    fn lamp() -> AreaEmitter {
        let frame = Frame::new(DVec3::new(0.0, 0.0, 2.0), -DVec3::Z, DVec3::X);
        let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
        let ring = corners.map(|(x, y)| frame.lift(DVec2::new(x, y))).to_vec();
        AreaEmitter::new(frame, vec![ring], 1.0, DVec3::ONE)
    }

    /// Exact clipping and kernel-weighted rays are two methods for the same number.
    #[test]
    fn rays_agree_with_the_exact_visibility() {
        let blocker = [DVec3::new(-0.4, -3.0, 1.0), DVec3::new(0.1, 3.0, 1.0), DVec3::new(-3.0, 0.0, 1.2)];
        let tracer = Tracer::new(vec![blocker]);
        let lamp = lamp();
        let mut e = Evaluation::new(Precision::EMITTER);
        for x in [-0.6, 0.0, 0.3, 0.6] {
            let occluder = Occluder { corners: &blocker, is_screen: false };
            let exact = lamp.visible(floor_point(x), &tracer, &[occluder], &mut e);
            let rays =
                lamp.unoccluded(floor_point(x)) * lamp.fraction_by_rays(floor_point(x), &tracer, &mut e);
            // 64 rays resolve the edge to an eighth of the lamp's side.
            assert!((exact - rays).abs() < 0.1 * lamp.unoccluded(floor_point(x)), "{x}: {exact} {rays}");
        }
        assert!(e.effort.rays > 0 && e.effort.exact == 4);
    }

    #[test]
    fn distances_are_between_the_nearest_places() {
        let block = Bounds { min: DVec3::new(0.8, -1.0, 0.0), max: DVec3::new(2.0, 1.0, 1.6) };
        // 0.3 to the side of the lamp's edge and 0.4 below it.
        assert!((Emitter::Area(lamp()).distance(block) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn punctual_lights_follow_their_laws() {
        let light = |kind| PunctualLight { kind, intensity: DVec3::splat(8.0), node: 0 };
        let position = DVec3::new(0.0, 0.0, 2.0);
        let e = |kind, x| punctual_irradiance(&light(kind), floor_point(x)).x;
        let point = PunctualKind::Point { position, range: f64::INFINITY };
        assert!((e(point, 0.0) - 2.0).abs() < 1e-12);
        assert!((e(point, 2.0) - 8.0 * 0.5_f64.sqrt() / 8.0).abs() < 1e-12);
        assert!(e(PunctualKind::Point { position, range: 2.0 }, 0.1) == 0.0, "out of range");
        let spot = PunctualKind::Spot {
            position,
            direction: -DVec3::Z,
            range: f64::INFINITY,
            inner_cone: 0.3,
            outer_cone: 0.6,
        };
        assert!((e(spot, 0.0) - 2.0).abs() < 1e-12);
        assert!(e(spot, 2.0) == 0.0, "45 degrees is outside of the cone");
        let half_way = 2.0 * f64::tan(0.45);
        assert!(e(spot, half_way) > 0.0 && e(spot, half_way) < e(point, half_way));
        let sun = PunctualKind::Directional { direction: DVec3::new(0.6, 0.0, -0.8) };
        assert!((e(sun, 5.0) - 6.4).abs() < 1e-12);
    }
}
