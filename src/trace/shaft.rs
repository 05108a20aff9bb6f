//! Shafts: the space between a receiver and a shooter.
//!
//! The shaft between two convex polygons is their convex hull, held as the planes that
//! bound it (Haines and Wallace, "Shaft Culling for Efficient Ray-Cast Radiosity", 1991).
//! What does not reach into it casts no shadow from the one onto the other. Polygons and
//! points in the shaft's surface do not count as inside: a wall's foot along the edge of
//! a floor element hides nothing from it.

use glam::DVec3;

use super::Tracer;
use crate::geom::{Bounds, Slab};

/// A triangle cut by a shaft's planes has fewer corners than this.
const MOST_CORNERS: usize = 20;

/// A half-space `normal · x ≥ offset`.
#[derive(Clone, Copy, Debug)]
struct HalfSpace {
    normal: DVec3,
    offset: f64,
}

/// Planes that are tested together.
const LANES: usize = 4;

/// The same half-spaces drawn in by the margin, for vector registers; all of space where there are none left.
#[derive(Clone, Copy, Debug)]
struct PlaneLanes {
    x: [f64; LANES],
    y: [f64; LANES],
    z: [f64; LANES],
    offset: [f64; LANES],
}

impl PlaneLanes {
    fn new(planes: &[HalfSpace], margin: f64) -> Self {
        let of = |value: fn(&HalfSpace) -> f64, none: f64| {
            std::array::from_fn(|i| planes.get(i).map_or(none, value))
        };
        let mut offset = of(|p| p.offset, f64::NEG_INFINITY);
        offset.iter_mut().for_each(|o| *o += margin);
        Self { x: of(|p| p.normal.x, 0.0), y: of(|p| p.normal.y, 0.0), z: of(|p| p.normal.z, 0.0), offset }
    }
}

/// The work of [`Shaft::filter`], for [`pulp`].
struct Filter<'a> {
    shaft: &'a Shaft,
    triangles: &'a [[DVec3; 3]],
    candidates: &'a [u32],
    out: &'a mut Vec<u32>,
}

impl pulp::NullaryFnOnce for Filter<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for &t in self.candidates {
            if self.shaft.touches(&self.triangles[t as usize]) {
                self.out.push(t);
            }
        }
    }
}

/// The convex hull of a receiver and a shooter, drawn in by a small margin.
#[derive(Clone, Debug)]
pub struct Shaft {
    planes: Vec<HalfSpace>,
    lanes: Vec<PlaneLanes>,
    bounds: Bounds,
    margin: f64,
}

impl Shaft {
    /// The shaft between two convex planar polygons, given by their corners in order.
    ///
    /// `shooter` may be a single point. `margin` (metres) is how deep something must reach in to count.
    #[must_use]
    pub fn between(receiver: &[DVec3], shooter: &[DVec3], margin: f64) -> Self {
        let bounds = Bounds::of(receiver.iter().chain(shooter).copied());
        Self::within(planes_between(receiver, shooter, margin), bounds, margin)
    }

    /// The shaft between two slabs: of planes that the faces tell, so that it may hold a little more than their hull.
    #[must_use]
    pub fn between_slabs(receiver: &Slab, shooter: &Slab, margin: f64) -> Self {
        let (receivers, shooters) = (receiver.faces(), shooter.faces());
        if let ([receiver], [shooter]) = (&receivers[..], &shooters[..]) {
            return Self::between(receiver, shooter, margin);
        }
        let all = || receiver.corners().iter().chain(shooter.corners()).copied();
        let mut planes = Vec::new();
        for (&receiver, &shooter) in receivers.iter().flat_map(|r| shooters.iter().map(move |s| (r, s))) {
            let of_faces = planes_between(receiver, shooter, margin);
            let holding = of_faces.into_iter().filter(|plane| all().all(|p| plane.height(p) >= -margin));
            holding.for_each(|plane| push_new(plane, &mut planes));
        }
        Self::within(planes, Bounds::of(all()), margin)
    }

    fn within(planes: Vec<HalfSpace>, bounds: Bounds, margin: f64) -> Self {
        let lanes = planes.chunks(LANES).map(|planes| PlaneLanes::new(planes, margin)).collect();
        Self { planes, lanes, bounds, margin }
    }

    /// Whether a box may reach into the shaft: never wrongly `false`.
    #[must_use]
    pub fn may_touch(&self, bounds: Bounds) -> bool {
        self.bounds.overlaps(bounds)
            && self.planes.iter().all(|p| {
                let farthest = DVec3::select(p.normal.cmpge(DVec3::ZERO), bounds.max, bounds.min);
                p.normal.dot(farthest) > p.offset + self.margin
            })
    }

    /// Whether a triangle reaches into the shaft.
    #[inline(always)]
    #[must_use]
    pub fn touches(&self, triangle: &[DVec3; 3]) -> bool {
        // Planes that cut the triangle, as bits: the first 64. Without the others it reaches in at least as often.
        let mut cutting = 0_u64;
        let mut is_inside = [true; 3];
        for (index, planes) in self.lanes.iter().enumerate() {
            let is_above = |v: DVec3| {
                std::array::from_fn(|i| {
                    planes.x[i] * v.x + planes.y[i] * v.y + planes.z[i] * v.z > planes.offset[i]
                })
            };
            let above: [[bool; LANES]; 3] =
                [is_above(triangle[0]), is_above(triangle[1]), is_above(triangle[2])];
            let [a, b, c] = above;
            is_inside.iter_mut().zip(above).for_each(|(inside, above)| *inside &= above == [true; LANES]);
            let (mut some, mut all) = (0_u64, 0_u64);
            for i in 0..LANES {
                some |= u64::from(a[i] | b[i] | c[i]) << i;
                all |= u64::from(a[i] & b[i] & c[i]) << i;
            }
            if some != (1 << LANES) - 1 {
                return false;
            }
            let shift = index * LANES;
            cutting |= if shift < 64 { (some & !all) << shift } else { 0 };
        }
        cutting.count_ones() < 2 || is_inside != [false; 3] || self.clips_to_something(triangle, cutting)
    }

    /// Cuts the triangle down by the `cutting` planes; something left means that it reaches in.
    fn clips_to_something(&self, triangle: &[DVec3; 3], mut cutting: u64) -> bool {
        let mut corners = [[DVec3::ZERO; MOST_CORNERS]; 2];
        let mut current = 0;
        corners[0][..3].copy_from_slice(triangle);
        let mut count = 3;
        while cutting != 0 {
            let plane = &self.planes[cutting.trailing_zeros() as usize];
            cutting &= cutting - 1;
            let offset = plane.offset + self.margin;
            let [first, second] = &mut corners;
            let (from, to) = if current == 0 { (first, second) } else { (second, first) };
            let mut kept = 0;
            let (mut a, mut height_a) = (from[count - 1], plane.normal.dot(from[count - 1]) - offset);
            for &b in &from[..count] {
                let height_b = plane.normal.dot(b) - offset;
                if kept + 2 > MOST_CORNERS {
                    return true; // More planes than a shaft has: say yes, which is always safe.
                }
                if (height_a > 0.0) != (height_b > 0.0) {
                    to[kept] = a + (b - a) * (height_a / (height_a - height_b));
                    kept += 1;
                }
                if height_b > 0.0 {
                    to[kept] = b;
                    kept += 1;
                }
                (a, height_a) = (b, height_b);
            }
            if kept == 0 {
                return false;
            }
            current = 1 - current;
            count = kept;
        }
        true
    }

    /// Appends those of `candidates` that reach into the shaft.
    pub fn filter(&self, tracer: &Tracer, candidates: &[u32], out: &mut Vec<u32>) {
        tracer.arch.dispatch(Filter { shaft: self, triangles: tracer.triangles(), candidates, out });
    }

    /// Appends all of the scene's triangles that reach into the shaft, in ascending order.
    pub fn gather(&self, tracer: &Tracer, out: &mut Vec<u32>) {
        let first = out.len();
        tracer.visit(
            |bounds| self.may_touch(bounds),
            |t| {
                if self.touches(&tracer.triangles()[t as usize]) {
                    out.push(t);
                }
            },
        );
        out[first..].sort_unstable();
    }
}

impl HalfSpace {
    fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }
}

/// The planes that bound the hull of two convex planar polygons.
fn planes_between(receiver: &[DVec3], shooter: &[DVec3], margin: f64) -> Vec<HalfSpace> {
    let mut planes = Vec::with_capacity(receiver.len() + shooter.len() + 2);
    add_caps(receiver, shooter, margin, &mut planes);
    add_caps(shooter, receiver, margin, &mut planes);
    add_sides(receiver, shooter, margin, &mut planes);
    add_sides(shooter, receiver, margin, &mut planes);
    planes
}

/// The plane of `polygon` itself bounds the hull where `other` lies wholly on one side of it.
fn add_caps(polygon: &[DVec3], other: &[DVec3], margin: f64, planes: &mut Vec<HalfSpace>) {
    let Some(normal) = normal_of(polygon) else { return };
    let offset = normal.dot(polygon[0]);
    add_supporting(HalfSpace { normal, offset }, other, margin, planes);
}

/// Planes through an edge of `polygon` and a corner of `other` that have all of both on one side.
fn add_sides(polygon: &[DVec3], other: &[DVec3], margin: f64, planes: &mut Vec<HalfSpace>) {
    if polygon.len() < 2 {
        return;
    }
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        for &c in other {
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            let plane = HalfSpace { normal, offset: normal.dot(a) };
            let own = side_of(plane, polygon, margin);
            let others = side_of(plane, other, margin);
            let side = match (own, others) {
                (Side::Mixed, _) | (_, Side::Mixed) => continue,
                (Side::On, s) | (s, Side::On) => s,
                (s, t) if s == t => s,
                _ => continue,
            };
            push_oriented(plane, side, planes);
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Front,
    Behind,
    On,
    Mixed,
}

fn side_of(plane: HalfSpace, points: &[DVec3], margin: f64) -> Side {
    let mut side = Side::On;
    for &p in points {
        let h = plane.height(p);
        let this = if h > margin {
            Side::Front
        } else if h < -margin {
            Side::Behind
        } else {
            continue;
        };
        if side == Side::On {
            side = this;
        } else if side != this {
            return Side::Mixed;
        }
    }
    side
}

fn add_supporting(plane: HalfSpace, others: &[DVec3], margin: f64, planes: &mut Vec<HalfSpace>) {
    push_oriented(plane, side_of(plane, others, margin), planes);
}

fn push_oriented(plane: HalfSpace, side: Side, planes: &mut Vec<HalfSpace>) {
    let oriented = match side {
        Side::Front => plane,
        Side::Behind => HalfSpace { normal: -plane.normal, offset: -plane.offset },
        Side::On | Side::Mixed => return,
    };
    push_new(oriented, planes);
}

/// The same face can come from several corner pairs.
fn push_new(plane: HalfSpace, planes: &mut Vec<HalfSpace>) {
    if !planes.iter().any(|p| p.normal.dot(plane.normal) > 1.0 - 1e-12) {
        planes.push(plane);
    }
}

/// Newell's normal; `None` for a point, a line, or nothing.
fn normal_of(polygon: &[DVec3]) -> Option<DVec3> {
    let &origin = polygon.first()?;
    polygon.windows(2).map(|e| (e[0] - origin).cross(e[1] - origin)).sum::<DVec3>().try_normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARGIN: f64 = 1e-9;

    fn square(z: f64, half: f64) -> [DVec3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x * half, y * half, z))
    }

    fn small_triangle(centre: DVec3, size: f64) -> [DVec3; 3] {
        [
            centre + DVec3::new(size, 0.0, 0.0),
            centre + DVec3::new(-size, size, 0.0),
            centre + DVec3::new(-size, -size, 0.1 * size),
        ]
    }

    /// What hides the shooter from a place above the receiver's plane alone is in the shaft; what lies below is not.
    #[test]
    fn shafts_of_slabs_hold_their_depth() {
        let shooter = Slab::flat(square(2.0, 0.1).to_vec());
        for depth in [0.0, 0.5] {
            let receiver = Slab::thick(square(0.0, 1.0).to_vec(), depth * DVec3::Z);
            let shaft = Shaft::between_slabs(&receiver, &shooter, MARGIN);
            assert_eq!(shaft.touches(&small_triangle(DVec3::new(0.9, 0.0, 0.4), 0.01)), depth > 0.0);
            assert!(shaft.touches(&small_triangle(DVec3::new(0.0, 0.0, 1.0), 0.01)));
            assert!(!shaft.touches(&small_triangle(DVec3::new(0.0, 0.0, -0.1), 0.01)));
            assert!(!shaft.touches(&small_triangle(DVec3::new(0.9, 0.0, 1.5), 0.01)));
        }
    }

    /// A second method: a segment between random points of the polygons that meets the triangle.
    fn some_segment_meets(receiver: [DVec3; 4], shooter: [DVec3; 4], triangle: [DVec3; 3]) -> bool {
        let tracer = Tracer::new(vec![triangle]);
        let grid = |i: u32| f64::from(i) / 12.0;
        let at = |q: [DVec3; 4], u: f64, v: f64| q[0].lerp(q[1], u).lerp(q[3].lerp(q[2], u), v);
        (0..13 * 13 * 13 * 13).any(|k: u32| {
            let (a, b, c, d) = (k % 13, k / 13 % 13, k / 169 % 13, k / 2197);
            tracer.occluded(at(receiver, grid(a), grid(b)), at(shooter, grid(c), grid(d)))
        })
    }

    #[test]
    fn what_blocks_a_segment_is_in_the_shaft() {
        let (receiver, shooter) = (square(0.0, 1.0), square(2.0, 0.3));
        let shaft = Shaft::between(&receiver, &shooter, MARGIN);
        let mut inside = 0;
        for k in 0..40 {
            let t = f64::from(k);
            let centre =
                DVec3::new(1.6 * (t * 0.7).sin(), 1.6 * (t * 1.3).cos(), 0.2 + 1.6 * (t * 0.37).fract());
            let triangle = small_triangle(centre, 0.35);
            if some_segment_meets(receiver, shooter, triangle) {
                assert!(shaft.touches(&triangle), "{centre}");
                assert!(shaft.may_touch(Bounds::of(triangle)), "{centre}");
                inside += 1;
            }
        }
        assert!((5..35).contains(&inside), "the cases must fall on both sides, {inside} inside");
    }

    #[test]
    fn what_stands_beside_it_is_not() {
        let shaft = Shaft::between(&square(0.0, 1.0), &square(2.0, 1.0), MARGIN);
        assert!(!shaft.touches(&small_triangle(DVec3::new(1.5, 0.0, 1.0), 0.4)));
        assert!(!shaft.touches(&small_triangle(DVec3::new(0.0, 0.0, 2.5), 0.4)));
        assert!(shaft.touches(&small_triangle(DVec3::new(1.3, 0.0, 1.0), 0.4)));
    }

    #[test]
    fn a_wall_along_the_edge_hides_nothing() {
        let shaft = Shaft::between(&square(0.0, 1.0), &square(2.0, 1.0), MARGIN);
        let wall = [DVec3::new(1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 0.0, 2.0)];
        assert!(!shaft.touches(&wall));
    }

    #[test]
    fn a_point_makes_a_pyramid() {
        let shaft = Shaft::between(&square(0.0, 1.0), &[DVec3::new(0.0, 0.0, 2.0)], MARGIN);
        assert!(shaft.touches(&small_triangle(DVec3::new(0.0, 0.0, 1.0), 0.1)));
        assert!(!shaft.touches(&small_triangle(DVec3::new(0.8, 0.0, 1.0), 0.1)));
    }
}
