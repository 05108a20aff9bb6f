//! Points inside solids, where nobody sees what a lightmap says.
//!
//! The floor under a box is lit by nothing, and bakers fill it as suits its neighbours. From there one
//! sees the backs of the box's single-sided faces.

use glam::DVec3;

use crate::geom::Frame;
use crate::trace::Tracer;

/// Directions looked along.
const DIRECTIONS: u32 = 16;

/// Whether more than half of what is seen from a point, metres, of a surface with unit `normal` is backs
/// that are no surface.
pub(super) fn is_inside_a_solid(tracer: &Tracer, point: DVec3, normal: DVec3) -> bool {
    // The golden spiral: evenly spread for any number of directions.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let from = point + normal * tracer.margin();
    let frame = Frame::new(from, normal, DVec3::ZERO);
    let sees_back = |k: &u32| {
        let k = f64::from(*k);
        let direction = frame.cosine_direction(GOLDEN * k, (k + 0.5) / f64::from(DIRECTIONS));
        tracer.closest_hit(from, direction).is_some_and(|hit| tracer.met_back(&hit))
    };
    2 * (0..DIRECTIONS).filter(sees_back).count() > DIRECTIONS as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tent of two triangles over the floor, its faces to the outside.
    #[test]
    fn under_a_tent_is_inside_and_beside_it_is_not() {
        let [a, b, c, d] = [(-1.0, -9.0), (1.0, -9.0), (1.0, 9.0), (-1.0, 9.0)];
        let ground = |(x, y)| DVec3::new(x, y, 0.0);
        let ridge = |y| DVec3::new(0.0, y, 1.0);
        let tent = vec![
            [ground(b), ground(c), ridge(9.0)],
            [ground(b), ridge(9.0), ridge(-9.0)],
            [ground(d), ground(a), ridge(-9.0)],
            [ground(d), ridge(-9.0), ridge(9.0)],
        ];
        let single = Tracer::new(tent.clone());
        assert!(is_inside_a_solid(&single, DVec3::ZERO, DVec3::Z));
        assert!(!is_inside_a_solid(&single, DVec3::X * 1.5, DVec3::Z));
        let double = Tracer::new(tent).with_double_sided(vec![true; 4]);
        assert!(!is_inside_a_solid(&double, DVec3::ZERO, DVec3::Z));
    }
}
