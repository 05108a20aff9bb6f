//! Point-to-polygon form factors in closed form.
//!
//! Seen from a small surface element at `x` with unit normal `n`, a diffuse
//! polygon with corners `v_0 … v_{k-1}` fills the fraction
//!
//! ```text
//!            1   k-1                  r_{i+1} × r_i
//! F(x → P) = ──   Σ   β_i  ( n · ───────────────── )      r_i = v_i − x
//!            2π  i=0              | r_{i+1} × r_i |
//! ```
//!
//! of the element's cosine-weighted hemisphere, where `β_i` is the angle between
//! `r_i` and `r_{i+1}`. The sum runs over edges only, so the cost does not depend
//! on distance and nothing is sampled near contact, where area sampling fails.
//! Occlusion is not included: see [`visible`](super::visible).
//!
//! References:
//! - J. H. Lambert, *Photometria*, 1760 (the edge sum).
//! - D. R. Baum, H. E. Rushmeier, J. M. Winget, "Improving Radiosity Solutions
//!   Through the Use of Analytically Determined Form-Factors", SIGGRAPH 1989.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::geom::Frame;
use crate::surface::SmoothNormals;

/// A point on a surface together with the side it faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position in world space, metres.
    pub position: DVec3,
    /// Outward normal, unit length.
    pub normal: DVec3,
}

impl SurfacePoint {
    /// Where light is received for place `p` of a plane, or of the curved surface that `smooth` tells of, `lift`
    /// metres off it.
    #[must_use]
    pub fn receiving(plane: &Frame, smooth: Option<&SmoothNormals>, p: DVec2, lift: f64) -> Self {
        let foot = plane.lift(p);
        let (position, normal) = match smooth {
            None => (foot, plane.normal),
            Some(smooth) => smooth.at(p).above(foot),
        };
        Self { position: position + normal * lift, normal }
    }
}

/// The unoccluded form factor from `receiver` to `polygon`, in `[0, 1]`.
///
/// `polygon` is planar, in world space, counter-clockwise seen from its emitting side;
/// seen from behind it counts as 0. What lies below the receiver's horizon is cut away.
/// A degenerate polygon gives 0, never NaN.
#[must_use]
pub fn point_to_polygon(receiver: SurfacePoint, polygon: &[DVec3]) -> f64 {
    (edge_sum(receiver, polygon) / TAU).clamp(0.0, 1.0)
}

/// Like [`point_to_polygon`], for one convex part of an emitter whose parts are summed: without the clamp.
pub(crate) fn signed_point_to_polygon(receiver: SurfacePoint, polygon: &[DVec3]) -> f64 {
    edge_sum(receiver, polygon) / TAU
}

/// The point-to-disk estimate with the polygon's area and centre, clamped to `[0, 1]`: for bounds and
/// for shooters much smaller than their distance, never near contact.
#[must_use]
pub fn point_to_disk(receiver: SurfacePoint, centre: DVec3, normal: DVec3, area: f64) -> f64 {
    let d = centre - receiver.position;
    let square = d.length_squared();
    let cosines = receiver.normal.dot(d) * -normal.dot(d);
    if cosines <= 0.0 || receiver.normal.dot(d) <= 0.0 {
        return 0.0;
    }
    // Adding the disk's own r² / π keeps the estimate below one at contact.
    cosines / square * area / (PI * square + area)
}

/// Walks the edges, cutting them at the horizon; where the polygon dips below, the two cuts are joined.
fn edge_sum(receiver: SurfacePoint, polygon: &[DVec3]) -> f64 {
    let n = receiver.normal;
    let Some(&last) = polygon.last() else { return 0.0 };
    let mut previous = last - receiver.position;
    let mut previous_height = n.dot(previous);
    let (mut first_entry, mut open_exit) = (None, None);
    let mut sum = 0.0;
    for &corner in polygon {
        let current = corner - receiver.position;
        let height = n.dot(current);
        match (previous_height >= 0.0, height >= 0.0) {
            (true, true) => sum += edge_term(previous, current, n),
            (true, false) => {
                let cut = previous.lerp(current, previous_height / (previous_height - height));
                sum += edge_term(previous, cut, n);
                open_exit = Some(cut);
            }
            (false, true) => {
                let cut = previous.lerp(current, previous_height / (previous_height - height));
                match open_exit.take() {
                    Some(exit) => sum += edge_term(exit, cut, n),
                    None => first_entry = Some(cut),
                }
                sum += edge_term(cut, current, n);
            }
            (false, false) => {}
        }
        (previous, previous_height) = (current, height);
    }
    if let (Some(exit), Some(entry)) = (open_exit, first_entry) {
        sum += edge_term(exit, entry, n);
    }
    sum
}

/// Edge `a → b`'s share of the sum, `β (n · unit(b × a))`, seen from the origin.
fn edge_term(a: DVec3, b: DVec3, normal: DVec3) -> f64 {
    let cross = b.cross(a);
    let length = cross.length();
    if length == 0.0 {
        return 0.0; // the edge points at the receiver and spans no angle
    }
    // atan2 keeps full precision where acos(dot) loses half its digits: small β.
    let angle = length.atan2(a.dot(b));
    angle * normal.dot(cross) / length
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed-form agreement is limited by rounding only.
    const EXACT: f64 = 1e-12;
    /// The catalogue's numbers have six digits.
    const SIX_DIGITS: f64 = 1e-6;
    /// ACCURACY.md's numbers have five digits.
    const FIVE_DIGITS: f64 = 1e-5;

    fn facing_up() -> SurfacePoint {
        SurfacePoint { position: DVec3::ZERO, normal: DVec3::Z }
    }

    /// The mean of `f` over the unit square by Gauss–Legendre quadrature, exact to rounding for smooth `f`.
    fn mean_over_unit_square(f: impl Fn(f64, f64) -> f64) -> f64 {
        const NODES: [(f64, f64); 5] = [
            (0.0, 0.568_888_888_888_888_9),
            (-0.538_469_310_105_683, 0.478_628_670_499_366_47),
            (0.538_469_310_105_683, 0.478_628_670_499_366_47),
            (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
            (0.906_179_845_938_664, 0.236_926_885_056_189_08),
        ];
        const CELLS: u32 = 40;
        let points =
            |c: u32| NODES.map(|(x, w)| ((f64::from(c) + 0.5 + 0.5 * x) / f64::from(CELLS), w / 2.0));
        let mut sum = 0.0;
        for (i, j) in (0..CELLS * CELLS).map(|k| (k % CELLS, k / CELLS)) {
            for (x, wx) in points(i) {
                for (y, wy) in points(j) {
                    sum += wx * wy * f(x, y);
                }
            }
        }
        sum / f64::from(CELLS * CELLS)
    }

    /// Closed form 1 of ACCURACY.md: unit squares face to face and at a right angle.
    #[test]
    fn unit_squares_match_the_catalogue() {
        for (distance, expected) in [(1.0, 0.199_825), (0.1, 0.826_995), (2.0, 0.068_590)] {
            let corner = |x, y| DVec3::new(x, y, distance);
            let above = [corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0), corner(1.0, 0.0)];
            let mean = mean_over_unit_square(|x, y| {
                point_to_polygon(SurfacePoint { position: DVec3::new(x, y, 0.0), normal: DVec3::Z }, &above)
            });
            assert!((mean - expected).abs() < SIX_DIGITS, "distance {distance}: {mean}");
        }
        let wall = wall_at_origin();
        let mean = mean_over_unit_square(|x, y| {
            point_to_polygon(SurfacePoint { position: DVec3::new(x, y, 0.0), normal: DVec3::Z }, &wall)
        });
        assert!((mean - 0.200_044).abs() < FIVE_DIGITS, "perpendicular: {mean}");
    }

    /// The unit wall `x = 0`, standing on the floor's edge, facing `+x`.
    fn wall_at_origin() -> [DVec3; 4] {
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(y, z)| DVec3::new(0.0, y, z))
    }

    /// Closed form 2: a point on the floor at distance `d` from the middle of a unit wall's foot.
    #[test]
    fn a_point_before_a_wall_matches_the_table() {
        let table = [
            (1.0, 0.07109),
            (0.5, 0.19014),
            (0.2, 0.35042),
            (0.1, 0.42254),
            (0.05, 0.46091),
            (0.02, 0.48432),
            (0.01, 0.49216),
        ];
        for (d, expected) in table {
            let receiver = SurfacePoint { position: DVec3::new(d, 0.5, 0.0), normal: DVec3::Z };
            let actual = point_to_polygon(receiver, &wall_at_origin());
            assert!((actual - expected).abs() < FIVE_DIGITS, "d = {d}: {actual}");
        }
    }

    /// Inside a closed box every direction meets a wall: the factors sum to one wherever the
    /// receiver sits and whichever way it faces.
    #[test]
    fn closed_box_sums_to_one() {
        let axes =
            [(DVec3::X, DVec3::Y, DVec3::Z), (DVec3::Y, DVec3::Z, DVec3::X), (DVec3::Z, DVec3::X, DVec3::Y)];
        for i in 0..257 {
            let t = f64::from(i);
            let normal = DVec3::new((1.7 * t).sin(), (2.3 * t).cos(), (0.9 * t).sin()).normalize();
            for offset in [0.0, 0.5, 0.99] {
                let position = offset * DVec3::new(normal.y, -normal.x, normal.z);
                let receiver = SurfacePoint { position, normal };
                let mut sum = 0.0;
                for (u, v, w) in axes {
                    for side in [1.0, -1.0] {
                        let (u, v, w) = (u, v * -side, w * side);
                        sum += point_to_polygon(receiver, &[w - u - v, w + u - v, w + u + v, w - u + v]);
                    }
                }
                assert!((sum - 1.0).abs() < EXACT, "{receiver:?}: sum {sum}");
            }
        }
    }

    /// Closed form 1: `A_i F_ij = A_j F_ji` for two skew rectangles of unlike size.
    #[test]
    fn reciprocity_holds() {
        let (a, b) = (0.7, 1.9);
        let lower = |x: f64, y: f64| DVec3::new(a * x, y, 0.0);
        let upper = |x: f64, y: f64| DVec3::new(0.4 + b * x, 0.3 + y, 1.1 + 0.5 * b * x);
        let upper_normal = DVec3::new(0.5, 0.0, -1.0).normalize();
        let upper_area = b * 1.25_f64.sqrt();
        let ring = |f: &dyn Fn(f64, f64) -> DVec3, turn: bool| {
            let mut r = [f(0.0, 0.0), f(1.0, 0.0), f(1.0, 1.0), f(0.0, 1.0)];
            if turn {
                r.reverse();
            }
            r
        };
        let from_lower = mean_over_unit_square(|x, y| {
            point_to_polygon(SurfacePoint { position: lower(x, y), normal: DVec3::Z }, &ring(&upper, true))
        });
        let from_upper = mean_over_unit_square(|x, y| {
            point_to_polygon(
                SurfacePoint { position: upper(x, y), normal: upper_normal },
                &ring(&lower, false),
            )
        });
        assert!((a * from_lower - upper_area * from_upper).abs() < 1e-9, "{from_lower} {from_upper}");
    }

    /// Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, B-3:
    /// a rectangle parallel to the element, one corner straight above it.
    #[test]
    fn parallel_rectangle_matches_catalogue() {
        let (x, y) = (0.7_f64, 1.9_f64); // sides over height
        let (rx, ry) = (x.hypot(1.0), y.hypot(1.0));
        let expected = (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / TAU;
        let corner = |x, y| DVec3::new(x, y, 1.0);
        let above = [corner(0.0, 0.0), corner(0.0, y), corner(x, y), corner(x, 0.0)];
        let actual = point_to_polygon(facing_up(), &above);
        assert!((actual - expected).abs() < EXACT, "{actual} != {expected}");
    }

    #[test]
    fn facing_away_or_degenerate_gives_zero() {
        let front = [(-1.0, -1.0), (0.0, 1.0), (1.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
        let back = [front[0], front[2], front[1]];
        assert!(point_to_polygon(facing_up(), &front) > 0.1);
        assert!(point_to_polygon(facing_up(), &back) == 0.0);
        for degenerate in [[DVec3::Z; 3], [DVec3::Z, DVec3::Z * 2.0, DVec3::Z * 3.0], [DVec3::ZERO; 3]] {
            assert!(point_to_polygon(facing_up(), &degenerate) == 0.0, "{degenerate:?}");
        }
    }

    #[test]
    fn the_disk_estimate_agrees_far_away() {
        let corner = |x, y| DVec3::new(2.0 + x, y, 9.0);
        let ring = [corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0), corner(1.0, 0.0)];
        let exact = point_to_polygon(facing_up(), &ring);
        let estimate = point_to_disk(facing_up(), corner(0.5, 0.5), -DVec3::Z, 1.0);
        assert!((estimate / exact - 1.0).abs() < 0.02, "{estimate} {exact}");
    }
}
