use super::*;
use crate::geom::{Ring, polygon};

/// The share of a region's area that may be lost or gained.
const AREA: f64 = 1e-6;

/// xorshift64*: the same numbers on every run (Marsaglia 2003; Vigna 2016).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// In `[0, 1)`.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn point(&mut self, scale: f64) -> DVec2 {
        DVec2::new(self.unit(), self.unit()) * scale
    }
}

fn rectangle(low: DVec2, high: DVec2) -> Ring {
    vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
}

fn corners(t: &Triangulation, triangle: [u32; 3]) -> [DVec2; 3] {
    triangle.map(|i| t.vertices[i as usize])
}

fn area_of(t: &Triangulation) -> f64 {
    t.triangles.iter().map(|&tri| corners(t, tri)).map(|[a, b, c]| polygon::orient(a, b, c) / 2.0).sum()
}

/// Areas agree, all triangles turn left, and each edge either has two triangles or lies on the rings:
/// an edge with a vertex inside it would have one.
fn check(rings: &[Ring], t: &Triangulation) {
    let expected = polygon::area(rings);
    assert!((area_of(t) - expected).abs() <= AREA * expected, "{} != {expected}", area_of(t));
    let mut edges: Vec<(u32, u32)> = Vec::new();
    for &tri in &t.triangles {
        let [a, b, c] = corners(t, tri);
        assert!(polygon::orient(a, b, c) >= 0.0, "clockwise");
        edges.extend([(tri[0], tri[1]), (tri[1], tri[2]), (tri[2], tri[0])]);
    }
    edges.sort_unstable();
    assert!(edges.windows(2).all(|e| e[0] != e[1]), "an edge used twice in one direction");
    let extent = rings.iter().flatten().fold(0.0_f64, |m, p| m.max(p.abs().max_element()));
    for &(a, b) in edges.iter().filter(|&&(a, b)| edges.binary_search(&(b, a)).is_err()) {
        let middle = t.vertices[a as usize].midpoint(t.vertices[b as usize]);
        let distance = rings
            .iter()
            .flat_map(|r| {
                (0..r.len()).map(|i| polygon::nearest_on_segment(r[i], r[(i + 1) % r.len()], middle))
            })
            .fold(f64::INFINITY, |m, foot| m.min(foot.distance(middle)));
        assert!(distance <= 1e-9 * extent, "edge {a}-{b} has one triangle and lies {distance} off the rings");
    }
}

#[test]
fn a_rectangle_is_two_triangles() {
    let rings = [rectangle(DVec2::ZERO, DVec2::new(2.0, 1.0))];
    let t = triangulate(PlanarRegion { rings: &rings, points: &[], snap: 1e-9 });
    assert_eq!((t.vertices.len(), t.triangles.len(), t.dropped), (4, 2, 0));
    check(&rings, &t);
}

#[test]
fn a_grid_with_a_hole_conforms() {
    let mut hole = rectangle(DVec2::splat(0.31), DVec2::splat(0.69));
    hole.reverse();
    let rings = [rectangle(DVec2::ZERO, DVec2::ONE), hole];
    let points: Vec<DVec2> =
        (0..=16).flat_map(|i| (0..=16).map(move |j| DVec2::new(f64::from(i), f64::from(j)) / 16.0)).collect();
    let t = triangulate(PlanarRegion { rings: &rings, points: &points, snap: 1e-6 });
    check(&rings, &t);
    assert_eq!(t.dropped, 0);
    let in_hole = points.iter().filter(|p| (**p - 0.5).abs().max_element() < 0.19).count();
    assert_eq!(
        t.vertices.len(),
        points.len() - in_hole + 4,
        "each point inside is a vertex, none in the hole"
    );
    let again = triangulate(PlanarRegion { rings: &rings, points: &points, snap: 1e-6 });
    assert_eq!(t, again);
}

#[test]
fn points_near_the_boundary_enter_it() {
    let rings = [rectangle(DVec2::ZERO, DVec2::ONE)];
    for offset in [0.0, 1e-17, 1e-13, 1e-12, 1e-9, 9e-7] {
        let points =
            [(0.5, offset), (0.5, -offset), (1.0 - offset, 0.25), (0.25, 1.0 + offset)].map(DVec2::from);
        let t = triangulate(PlanarRegion { rings: &rings, points: &points, snap: 1e-6 });
        check(&rings, &t);
        assert_eq!(t.vertices.len(), 7, "offset {offset}");
        assert!(t.vertices.iter().all(|p| p.x.min(p.y).min(1.0 - p.x).min(1.0 - p.y).abs() < 1e-15));
    }
}

#[test]
fn neighbours_that_get_each_others_points_conform() {
    let left = [rectangle(DVec2::ZERO, DVec2::new(0.3, 1.0))];
    let right = [rectangle(DVec2::new(0.3, 0.0), DVec2::ONE)];
    let points: Vec<DVec2> = (0..=10).map(|i| DVec2::new(0.3, 0.1 * f64::from(i))).collect();
    let on_line = |rings: &[Ring]| {
        let t = triangulate(PlanarRegion { rings, points: &points, snap: 1e-9 });
        check(rings, &t);
        t.vertices.iter().filter(|p| (p.x - 0.3).abs() < 1e-12).count()
    };
    assert_eq!((on_line(&left), on_line(&right)), (11, 11));
}

#[test]
fn touching_rings_keep_their_area() {
    let (a, b, c, d) = (DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y);
    let shared_edge = vec![vec![a, b, c], vec![a, c, d]];
    let shared_corner = vec![rectangle(a, c), rectangle(c, c * 2.0)];
    let hole_at_corner = vec![rectangle(a, c), vec![a, DVec2::new(0.2, 0.5), DVec2::new(0.5, 0.2)]];
    for rings in [shared_edge, shared_corner, hole_at_corner] {
        let t = triangulate(PlanarRegion { rings: &rings, points: &[DVec2::splat(0.6)], snap: 1e-9 });
        check(&rings, &t);
        assert_eq!(t.dropped, 0);
    }
}

#[test]
fn slivers_keep_their_area() {
    for thickness in [1e-3, 1e-6, 1e-9] {
        let rings = [rectangle(DVec2::ZERO, DVec2::new(1.0, thickness))];
        let points = [DVec2::new(0.5, 0.5 * thickness), DVec2::new(0.7, 0.0)];
        let t = triangulate(PlanarRegion { rings: &rings, points: &points, snap: 1e-6 });
        check(&rings, &t);
    }
}

#[test]
fn nonsense_gives_nothing() {
    let nan = DVec2::NAN;
    let bad: [&[Ring]; 6] = [
        &[],
        &[vec![]],
        &[vec![nan, nan, nan]],
        &[vec![DVec2::ZERO; 4]],
        &[vec![DVec2::ZERO, DVec2::X, DVec2::X * 2.0]],
        &[vec![DVec2::splat(1e300), DVec2::X, DVec2::Y]],
    ];
    for rings in bad {
        let t = triangulate(PlanarRegion { rings, points: &[nan, DVec2::ONE, DVec2::ZERO], snap: f64::NAN });
        assert!(t.triangles.is_empty() && t.vertices.is_empty(), "{rings:?}");
    }
}

/// From a hotel room's lamp: where the triangle is thinner than `snap`, the contact's end bent the
/// contact back across the edge that it had just been cut at, round after round.
#[test]
fn a_contact_through_a_thin_end_is_not_refused() {
    let thin: Ring = [(0.0, 0.0), (0.0712330711561611, 0.0), (1.987575342401771e-5, 0.0007879813019743255)]
        .map(DVec2::from)
        .to_vec();
    let contact = [(0.07060140499410199, 8.30700267458516e-5), (0.07060952567074526, 0.0)].map(DVec2::from);
    let rings = [thin];
    let input = PlaneInput { rings: &rings, contacts: &[contact], points: &[], snap: 1.212278079181119e-5 };
    let result = subdivide(arrange(input));
    assert_eq!(result.dropped, 0);
    let area: f64 =
        result.faces.iter().map(|f| result.triangle(f)).map(|[a, b, c]| polygon::orient(a, b, c) / 2.0).sum();
    assert!((area / polygon::area(&rings) - 1.0).abs() < AREA);
}

/// A star around the origin with `corners` corners, radii between 0.3 and 1.
fn star(random: &mut Random, corners: usize) -> Ring {
    (0..corners)
        .map(|i| {
            let angle = std::f64::consts::TAU * (i as f64 + 0.8 * random.unit()) / corners as f64;
            DVec2::from_angle(angle) * (0.3 + 0.7 * random.unit())
        })
        .collect()
}

#[test]
fn random_regions_conform() {
    for seed in 1..400_u64 {
        let mut random = Random(seed * 0x9E37_79B9);
        let scale = 10.0_f64.powi(random.below(10) as i32 - 4);
        let offset = [0.0, 1.0, 100.0][random.below(3)];
        let shift = random.point(scale * offset);
        let count = 3 + random.below(20);
        let ring: Ring = star(&mut random, count).into_iter().map(|p| p * scale + shift).collect();
        let edges: Vec<[DVec2; 2]> = (0..count).map(|i| [ring[i], ring[(i + 1) % count]]).collect();
        let mut points = Vec::new();
        for _ in 0..random.below(120) {
            let [a, b] = edges[random.below(count)];
            let tiny = [0.0, 1e-16, 1e-12, 1e-9, 1e-7, 1e-6][random.below(6)] * scale;
            let p = match random.below(6) {
                0 => a.lerp(b, random.unit()) + (random.point(2.0) - 1.0) * tiny,
                1 => a + (random.point(2.0) - 1.0) * tiny,
                2 => points.get(random.below(points.len() + 1)).copied().unwrap_or(a),
                3 => DVec2::new(f64::from(random.below(9) as u32) * 0.25 - 1.0, 0.0) * scale + shift,
                _ => (random.point(2.4) - 1.2) * scale + shift,
            };
            points.push(p);
        }
        let snap = [0.0, 1e-9, 1e-6, 1e-3][random.below(4)] * scale;
        let rings = [ring];
        let t = triangulate(PlanarRegion { rings: &rings, points: &points, snap });
        check(&rings, &t);
        assert_eq!(t.dropped, 0, "seed {seed}");
        for p in points.iter().filter(|p| polygon::contains(&rings, **p)) {
            let nearest = t.vertices.iter().map(|v| v.distance(*p)).fold(f64::INFINITY, f64::min);
            assert!(
                nearest <= 2.0 * snap + 1e-10 * scale,
                "seed {seed}: {p} is no vertex, nearest {nearest}"
            );
        }
    }
}

/// Rings that cross themselves and each other have no area to keep; they must only not upset anything.
#[test]
fn random_rubbish_never_panics() {
    for seed in 1..400_u64 {
        let mut random = Random(seed * 0x51_7C_C1_B7);
        let scale = 10.0_f64.powi(random.below(10) as i32 - 4);
        let lattice = 1.0 + random.below(9) as f64;
        let mut rings: Vec<Ring> = Vec::new();
        for _ in 0..1 + random.below(3) {
            let count = 3 + random.below(9);
            let on_lattice = random.below(2) == 0;
            let ring = (0..count)
                .map(|_| {
                    let p = random.point(1.0);
                    (if on_lattice { (p * lattice).round() / lattice } else { p }) * scale
                })
                .collect();
            rings.push(ring);
        }
        let points: Vec<DVec2> = (0..random.below(60))
            .map(|_| (random.point(1.2) * lattice * 2.0).round() / lattice / 2.0 * scale)
            .collect();
        let contacts: Vec<[DVec2; 2]> = (0..random.below(20))
            .map(|_| [random.point(1.2) * scale, (random.point(1.0) * lattice).round() / lattice * scale])
            .collect();
        let snap = [0.0, 1e-9, 1e-6, 1e-3, 1e-1][random.below(5)] * scale;
        let input = PlaneInput { rings: &rings, contacts: &contacts, points: &points, snap };
        let first = subdivide(arrange(input));
        let second = subdivide(arrange(input));
        assert_eq!((&first.vertices, &first.faces), (&second.vertices, &second.faces));
        for (id, face) in (0..).zip(&first.faces) {
            for neighbour in face.neighbours.into_iter().flatten() {
                assert!(
                    first.faces[neighbour as usize].neighbours.contains(&Some(id)),
                    "one-sided neighbours"
                );
            }
        }
    }
}
