//! The point of a triangle in space that is nearest to another point.

use glam::DVec3;

/// Barycentric coordinates of the point of `[a, b, c]` nearest to `p`, in `[0, 1]`, summing to 1.
///
/// Christer Ericson, "Real-Time Collision Detection", 2005, section 5.1.5: the regions of the corners,
/// then of the edges, then the inside. The triangle must have an area.
pub(super) fn nearest([a, b, c]: [DVec3; 3], p: DVec3) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let along = |corner: DVec3| (ab.dot(p - corner), ac.dot(p - corner));
    let (d1, d2) = along(a);
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = along(b);
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let (d5, d6) = along(c);
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

/// The point with barycentric coordinates `weights`.
pub(super) fn point([a, b, c]: [DVec3; 3], weights: [f64; 3]) -> DVec3 {
    weights[0] * a + weights[1] * b + weights[2] * c
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No point of a fine grid over the triangle may be nearer.
    #[test]
    fn nothing_is_nearer() {
        const STEPS: i32 = 40;
        let triangle = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(3.0, 0.5, 0.0), DVec3::new(1.0, 2.0, 1.0)];
        for k in 0..343 {
            let p = DVec3::new(f64::from(k % 7), f64::from(k / 7 % 7), f64::from(k / 49)) - 2.0;
            let weights = nearest(triangle, p);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(weights.iter().all(|w| (-1e-12..=1.0 + 1e-12).contains(w)), "{weights:?}");
            let found = point(triangle, weights).distance(p);
            for i in 0..=STEPS {
                for j in 0..=STEPS - i {
                    let (u, v) = (f64::from(i) / f64::from(STEPS), f64::from(j) / f64::from(STEPS));
                    assert!(point(triangle, [1.0 - u - v, u, v]).distance(p) >= found - 1e-12);
                }
            }
        }
    }
}
