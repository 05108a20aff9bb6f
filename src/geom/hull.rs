//! Convex hulls in the plane.

use glam::DVec2;

use super::polygon::orient;

/// The convex hull of `points`, counter-clockwise, collinear points left out
/// (Andrew's monotone chain, 1979).
///
/// Fewer than three corners come back where all points lie on a line.
#[must_use]
pub fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = &DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for &p in points {
            while let [.., a, b] = chain[..] {
                if orient(a, b, p) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop(); // It begins the other chain.
        chain
    };
    let mut hull = chain(&mut points.iter());
    hull.extend(chain(&mut points.iter().rev()));
    hull
}

/// Whether a ring is convex and counter-clockwise, up to rounding.
#[must_use]
pub fn is_convex(ring: &[DVec2]) -> bool {
    let n = ring.len();
    let scale = ring.iter().map(|p| (*p - ring[0]).length_squared()).fold(0.0, f64::max);
    n >= 3
        && (0..n).all(|i| orient(ring[i], ring[(i + 1) % n], ring[(i + 2) % n]) > -1e-9 * scale)
        && super::polygon::signed_area(ring) > 0.0
        && (convex_area(ring) - super::polygon::signed_area(ring)).abs() <= 1e-9 * scale
}

fn convex_area(ring: &[DVec2]) -> f64 {
    super::polygon::signed_area(&convex_hull(ring.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_points_inside_and_on_its_edges_has_four_corners() {
        let points = (0..5).flat_map(|x| (0..5).map(move |y| DVec2::new(x.into(), y.into()))).collect();
        let hull = convex_hull(points);
        assert_eq!(hull, [(0, 0), (4, 0), (4, 4), (0, 4)].map(|(x, y)| DVec2::new(x.into(), y.into())));
        assert!(is_convex(&hull));
    }

    #[test]
    fn a_notch_is_not_convex() {
        let ring =
            [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 0.5), (0.0, 2.0)].map(|(x, y)| DVec2::new(x, y));
        assert!(!is_convex(&ring));
    }
}
