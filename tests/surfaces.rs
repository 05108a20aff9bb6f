//! From triangles to surfaces and regions, on hand-made scenes whose surfaces are known.

use cobake::geom::{Bounds, polygon};
use cobake::scene::{Placement, Triangle};
use cobake::surface::{BoxQuery, Geometry, Surface, SurfaceSet, build_surfaces};
use glam::{DMat3, DVec2, DVec3};

/// Areas add up to this share: what snapping and collinear corners may change.
const AREA: f64 = 1e-6;

/// Positions that pass through f32, as all of glTF's do.
const F32: f64 = 1e-6;

/// A scene made by hand: each `add` is a placement with vertices of its own.
#[derive(Default)]
struct Model {
    vertices: Vec<DVec3>,
    triangles: Vec<Triangle>,
    placements: Vec<Placement>,
    double_sided: Vec<bool>,
}

impl Model {
    fn add(&mut self, triangles: &[[DVec3; 3]]) -> &mut Self {
        let (first_triangle, first_vertex) = (self.triangles.len(), self.vertices.len());
        for (i, t) in triangles.iter().enumerate() {
            let source_vertices = [0, 1, 2].map(|k| (3 * i + k) as u32);
            let vertices = source_vertices.map(|k| k + first_vertex as u32);
            self.vertices.extend(t);
            self.triangles.push(Triangle {
                vertices,
                source_vertices,
                placement: self.placements.len() as u32,
            });
        }
        self.placements.push(Placement {
            node: 0,
            mesh: 0,
            primitive: 0,
            material: self.double_sided.len(),
            triangles: first_triangle..self.triangles.len(),
            vertices: first_vertex..self.vertices.len(),
            mirrored: false,
            settings: cobake::scene::NodeSettings::default(),
        });
        self.double_sided.push(false);
        self
    }

    fn map(mut self, f: impl Fn(DVec3) -> DVec3) -> Self {
        self.vertices.iter_mut().for_each(|p| *p = f(*p));
        self
    }

    fn through_f32(self) -> Self {
        self.map(|p| p.as_vec3().as_dvec3())
    }

    fn build(&self) -> SurfaceSet {
        let geometry = Geometry {
            normals: &[],
            vertices: &self.vertices,
            triangles: &self.triangles,
            placements: &self.placements,
            double_sided: self.double_sided.clone(),
            coordinates: &[],
        };
        let set = build_surfaces(&geometry, &EachBox(self));
        self.check(&set);
        set
    }

    fn points(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].vertices.map(|v| self.vertices[v as usize])
    }

    /// What holds for every set of surfaces.
    fn check(&self, set: &SurfaceSet) {
        let mut seen: Vec<usize> =
            set.surfaces.iter().flat_map(|s| s.source_triangles.iter().copied()).collect();
        assert_eq!(seen.len() + set.without_area, self.triangles.len(), "each triangle is somewhere");
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len() + set.without_area, self.triangles.len(), "and only once");
        for s in &set.surfaces {
            let f = s.frame;
            assert!([f.u, f.v, f.normal].iter().all(|a| (a.length() - 1.0).abs() < 1e-9), "{f:?}");
            assert!(f.u.cross(f.v).dot(f.normal) > 1.0 - 1e-9, "{f:?}");
            let drawn: f64 =
                s.source_triangles.iter().map(|&t| cobake::geom::triangle::area(self.points(t))).sum();
            assert!((s.area - drawn).abs() <= 3.0 * AREA * drawn, "area {} of {drawn}", s.area);
            assert!((polygon::area(&s.rings) - s.area).abs() <= AREA * s.area);
            assert!(!s.regions.is_empty());
            let regions: f64 = s.regions.iter().map(|r| r.area).sum();
            assert!((regions - s.area).abs() <= AREA * s.area, "regions {regions} of {}", s.area);
            for r in &s.regions {
                let of = |[a, b, c]: [DVec2; 3]| polygon::orient(a, b, c) / 2.0;
                let triangles: f64 = r.triangles.iter().map(|&t| of(t)).sum();
                assert!(r.area > 0.0);
                assert!((triangles - r.area).abs() <= 1e-5 * s.area, "triangles {triangles} of {}", r.area);
            }
        }
    }
}

/// Looks at every triangle.
struct EachBox<'a>(&'a Model);

impl BoxQuery for EachBox<'_> {
    fn triangles_in(&self, bounds: Bounds, out: &mut Vec<u32>) {
        for t in 0..self.0.triangles.len() {
            if Bounds::of(self.0.points(t)).overlaps(bounds) {
                out.push(t as u32);
            }
        }
    }
}

fn quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Vec<[DVec3; 3]> {
    vec![[a, b, c], [a, c, d]]
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The rectangle from `low` to `high` at height `z`, facing up.
fn floor(low: (f64, f64), high: (f64, f64), z: f64) -> Vec<[DVec3; 3]> {
    quad(v(low.0, low.1, z), v(high.0, low.1, z), v(high.0, high.1, z), v(low.0, high.1, z))
}

/// The six sides of a box, facing outward.
fn cuboid(low: DVec3, high: DVec3) -> Vec<[DVec3; 3]> {
    let p = |i: usize| v([low.x, high.x][i & 1], [low.y, high.y][i >> 1 & 1], [low.z, high.z][i >> 2 & 1]);
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .iter()
        .flat_map(|&[a, b, c, d]| quad(p(a), p(b), p(c), p(d)))
        .collect()
}

/// A wall of `columns` times `rows` cells of two triangles, 4 m wide and 3 m high.
fn wall(columns: usize, rows: usize) -> Vec<[DVec3; 3]> {
    let p = |i: usize, j: usize| v(4.0 * i as f64 / columns as f64, 0.0, 3.0 * j as f64 / rows as f64);
    (0..columns)
        .flat_map(|i| (0..rows).map(move |j| (i, j)))
        .flat_map(|(i, j)| quad(p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1)))
        .collect()
}

fn areas(s: &Surface) -> Vec<f64> {
    let mut areas: Vec<f64> = s.regions.iter().map(|r| r.area).collect();
    areas.sort_by(f64::total_cmp);
    areas
}

fn assert_areas(s: &Surface, expected: &[f64]) {
    let found = areas(s);
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-5 * s.area, "{found:?} against {expected:?}");
    }
}

fn turned() -> DMat3 {
    DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(1.1) * DMat3::from_rotation_y(-0.7)
}

#[test]
fn a_wall_is_one_surface_however_it_is_cut() {
    for transform in [DMat3::IDENTITY, turned()] {
        for far in [0.0, 20.0] {
            let build = |columns, rows| {
                let mut model = Model::default();
                model.add(&wall(columns, rows));
                model.map(|p| transform * p + far).through_f32().build()
            };
            let expected = build(1, 1).surfaces;
            assert_eq!(expected.len(), 1);
            for set in [build(10, 10), build(40, 25), build(1, 1000)] {
                let [s] = &set.surfaces[..] else { panic!("{} surfaces", set.surfaces.len()) };
                assert!((s.frame.origin - expected[0].frame.origin).length() < 10.0 * F32);
                assert!((s.frame.u - expected[0].frame.u).length() < F32);
                assert!((s.frame.normal - expected[0].frame.normal).length() < 10.0 * F32);
                assert_eq!(s.rings.len(), 1);
                assert_eq!(s.rings[0].len(), 4);
                for (p, q) in s.rings[0].iter().zip(&expected[0].rings[0]) {
                    assert!((*p - *q).length() < 10.0 * F32, "{p} {q}");
                }
                assert_eq!(s.regions.len(), 1);
                assert_eq!(s.regions[0].triangles.len(), 2);
            }
        }
    }
}

#[test]
fn the_first_axis_follows_the_longest_edge() {
    let mut model = Model::default();
    model.add(&wall(3, 3));
    let set = model.build();
    let frame = set.surfaces[0].frame;
    assert_eq!(frame.normal, DVec3::NEG_Y);
    assert_eq!(frame.u.x.abs(), 1.0);
    assert_eq!(set.surfaces[0].rings[0][0], DVec2::ZERO);
}

#[test]
fn t_junctions_do_not_divide() {
    let lower = [floor((0.0, 0.0), (3.0, 1.0), 0.0), floor((3.0, 0.0), (4.0, 1.0), 0.0)].concat();
    let upper = [floor((0.0, 1.0), (1.0, 2.0), 0.0), floor((1.0, 1.0), (4.0, 2.0), 0.0)].concat();
    let mut model = Model::default();
    model.add(&[lower, upper].concat());
    let set = model.map(|p| turned() * p).through_f32().build();
    assert_eq!(set.surfaces.len(), 1);
    assert_eq!(set.surfaces[0].rings.len(), 1);
    assert_eq!(set.surfaces[0].rings[0].len(), 4);
}

#[test]
fn a_cuboid_is_six_surfaces() {
    let mut model = Model::default();
    model.add(&cuboid(v(1.0, 2.0, 3.0), v(2.0, 4.0, 6.0)));
    let set = model.build();
    assert_eq!(set.surfaces.len(), 6);
    assert!(set.surfaces.iter().all(|s| s.rings[0].len() == 4 && s.regions.len() == 1));
}

#[test]
fn a_fine_cylinder_does_not_become_one_surface() {
    let count = 100_000;
    let p = |i: usize, z: f64| {
        let (sin, cos) = (std::f64::consts::TAU * i as f64 / f64::from(count)).sin_cos();
        v(cos, sin, z)
    };
    let strip: Vec<_> =
        (0..5_000_usize).flat_map(|i| quad(p(i, 0.0), p(i + 1, 0.0), p(i + 1, 0.5), p(i, 0.5))).collect();
    let mut model = Model::default();
    model.add(&strip);
    let geometry = Geometry {
        normals: &[],
        vertices: &model.vertices,
        triangles: &model.triangles,
        placements: &model.placements,
        double_sided: vec![false],
        coordinates: &[],
    };
    struct Nothing;
    impl BoxQuery for Nothing {
        fn triangles_in(&self, _: Bounds, _: &mut Vec<u32>) {}
    }
    let set = build_surfaces(&geometry, &Nothing);
    // The strip bends by 0.31 radians; what is joined must be flat to a few f32 steps.
    assert!(set.surfaces.len() > 30, "{}", set.surfaces.len());
    for s in &set.surfaces {
        for p in s.source_triangles.iter().flat_map(|&t| model.points(t)) {
            assert!(s.frame.height(p).abs() < 5.0 * F32);
        }
    }
}

#[test]
fn flipped_duplicate_and_empty_triangles_stand_alone() {
    let flat = floor((0.0, 0.0), (1.0, 1.0), 0.0);
    let [first, second] = flat[..] else { panic!() };
    let flipped = [first[0], first[2], first[1]];
    let point = [first[0]; 3];
    let line = [first[0], first[0].lerp(first[1], 0.3), first[1]];
    let mut model = Model::default();
    model.add(&[first, second, flipped, first, second, point, line, [DVec3::NAN; 3]]);
    let set = model.through_f32().build();
    assert_eq!(set.without_area, 3);
    let mut sizes: Vec<usize> = set.surfaces.iter().map(|s| s.source_triangles.len()).collect();
    sizes.sort_unstable();
    assert_eq!(sizes, [1, 2, 2]);
}

/// A strip that winds once and a half round a square well, all in one plane: it lies over itself
/// without using any edge twice.
#[test]
fn a_surface_over_itself_is_taken_apart() {
    let (inner, outer) = (1.0, 2.0);
    let corner = |i: usize, r: f64| {
        let (x, y) = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][i % 4];
        // Wider with each turn, so that no two vertices coincide.
        v(x * (r + 0.01 * i as f64), y * (r + 0.01 * i as f64), 0.0)
    };
    let strip: Vec<_> = (0..6)
        .flat_map(|i| quad(corner(i, inner), corner(i, outer), corner(i + 1, outer), corner(i + 1, inner)))
        .collect();
    let mut model = Model::default();
    model.add(&strip);
    let set = model.build();
    assert_eq!(set.surfaces.len(), 2);
    assert_eq!(set.dropped_contacts, 0);
}

#[test]
fn slivers_have_frames() {
    for transform in [DMat3::IDENTITY, turned()] {
        let mut model = Model::default();
        model.add(&quad(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1e-6, 0.0), v(0.0, 1e-6, 0.0)));
        model.add(&[[v(0.0, 1.0, 0.0), v(1.0, 1.0, 0.0), v(0.5, 1.0 + 1e-6, 0.0)]]);
        let set = model.map(|p| transform * p).build();
        assert_eq!(set.without_area, 0);
        assert_eq!(set.surfaces.len(), 2);
    }
}

#[test]
fn a_hole_is_found() {
    let frame = [
        floor((0.0, 0.0), (3.0, 1.0), 0.0),
        floor((0.0, 2.0), (3.0, 3.0), 0.0),
        floor((0.0, 1.0), (1.0, 2.0), 0.0),
        floor((2.0, 1.0), (3.0, 2.0), 0.0),
    ];
    let mut model = Model::default();
    model.add(&frame.concat());
    let set = model.build();
    assert_eq!(set.surfaces.len(), 1);
    let rings = &set.surfaces[0].rings;
    let mut areas: Vec<f64> = rings.iter().map(|r| polygon::signed_area(r)).collect();
    areas.sort_by(f64::total_cmp);
    assert!((areas[0] + 1.0).abs() < 1e-12 && (areas[1] - 9.0).abs() < 1e-12, "{areas:?}");
    assert!(rings.iter().all(|r| r.len() == 4));
}

#[test]
fn a_box_on_a_floor_divides_it() {
    for scale in [1e-4, 1.0, 1e5] {
        for far in [0.0, 1e6] {
            for (transform, sink) in
                [(DMat3::IDENTITY, 0.0), (turned(), 0.0), (turned(), 3e-7), (turned(), 0.1)]
            {
                let mut model = Model::default();
                model.add(&floor((0.0, 0.0), (4.0, 3.0), 0.0));
                model.add(&cuboid(v(1.0, 1.0, -sink), v(2.0, 1.5, 1.0)));
                let set = model.map(|p| transform * p * scale + far).build();
                assert_areas(&set.surfaces[0], &[0.5 * scale * scale, 11.5 * scale * scale]);
                assert_eq!(set.dropped_contacts, 0);
                assert!(set.surfaces[1..].iter().all(|s| s.regions.len() <= 2));
            }
        }
    }
}

#[test]
fn a_room_is_not_divided_by_its_walls() {
    let mut model = Model::default();
    for side in cuboid(v(0.0, 0.0, 0.0), v(5.0, 4.0, 2.8)).chunks(2) {
        let inward: Vec<[DVec3; 3]> = side.iter().map(|t| [t[0], t[2], t[1]]).collect();
        model.add(&inward);
    }
    let set = model.map(|p| turned() * p).through_f32().build();
    assert_eq!(set.surfaces.len(), 6);
    assert!(set.surfaces.iter().all(|s| s.regions.len() == 1 && s.regions[0].triangles.len() == 2));
}

#[test]
fn a_wall_cut_fine_does_not_cut_the_floor_fine() {
    let mut model = Model::default();
    model.add(&floor((0.0, -2.0), (4.0, 2.0), 0.0));
    model.add(&wall(100, 3));
    let set = model.map(|p| turned() * p).through_f32().build();
    assert_areas(&set.surfaces[0], &[8.0, 8.0]);
    for r in &set.surfaces[0].regions {
        assert_eq!((r.rings.len(), r.rings[0].len(), r.triangles.len()), (1, 4, 2));
    }
}

#[test]
fn a_sheet_standing_on_a_floor_divides_it() {
    let mut model = Model::default();
    model.add(&floor((0.0, 0.0), (4.0, 3.0), 0.0));
    model.add(&quad(v(1.0, 1.0, 0.0), v(1.0, 2.0, 0.0), v(1.0, 2.0, 1.0), v(1.0, 1.0, 1.0)));
    let set = model.build();
    assert_areas(&set.surfaces[0], &[3.0, 9.0]);
}

#[test]
fn a_short_sheet_does_not() {
    let mut model = Model::default();
    model.add(&floor((0.0, 0.0), (4.0, 3.0), 0.0));
    model.add(&quad(v(1.0, 1.0, 0.0), v(1.0, 1.01, 0.0), v(1.0, 1.01, 1.0), v(1.0, 1.0, 1.0)));
    let set = model.build();
    assert_areas(&set.surfaces[0], &[12.0]);
}

#[test]
fn a_book_on_a_desk_divides_it() {
    let mut model = Model::default();
    model.add(&cuboid(v(0.0, 0.0, 0.0), v(1.6, 0.8, 0.72)));
    model.add(&cuboid(v(0.5, 0.2, 0.72), v(0.7, 0.5, 0.75)));
    let set = model.map(|p| turned() * p + 3.0).through_f32().build();
    let top = set.surfaces.iter().find(|s| s.regions.len() > 1).unwrap();
    assert_areas(top, &[0.06, 1.22]);
}

#[test]
fn a_board_cut_into_a_wall_divides_it() {
    let mut model = Model::default();
    model.add(&wall(4, 4));
    model.add(&cuboid(v(1.0, -0.3, 1.0), v(3.0, 0.05, 1.1)));
    let set = model.map(|p| turned() * p).through_f32().build();
    assert_areas(&set.surfaces[0], &[0.2, 11.8]);
}

#[test]
fn boxes_that_pierce_each_other_divide_each_other() {
    let mut model = Model::default();
    model.add(&cuboid(v(0.0, 0.0, 0.0), v(2.0, 2.0, 2.0)));
    model.add(&cuboid(v(0.5, 0.5, 1.0), v(1.5, 1.5, 3.0)));
    let set = model.map(|p| turned() * p).through_f32().build();
    assert_eq!(set.surfaces.len(), 12);
    let mut counts: Vec<usize> = set.surfaces.iter().map(|s| s.regions.len()).collect();
    counts.sort_unstable();
    // One side of the lower box is pierced; four of the upper one are cut through.
    assert_eq!(counts, [1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2]);
}

#[test]
fn a_keyboard_divides_a_desk_into_keys() {
    let mut model = Model::default();
    model.add(&floor((0.0, 0.0), (1.6, 0.8), 0.0));
    for i in 0..20 {
        for j in 0..5 {
            let low = v(0.3 + 0.02 * f64::from(i), 0.3 + 0.02 * f64::from(j), 0.0);
            model.add(&cuboid(low, low + v(0.016, 0.016, 0.01)));
        }
    }
    let set = model.map(|p| turned() * p).through_f32().build();
    assert_eq!(set.surfaces[0].regions.len(), 101);
    let key = 0.016 * 0.016;
    assert!(areas(&set.surfaces[0])[..100].iter().all(|a| (a / key - 1.0).abs() < 1e-3));
}

/// A shelf of books that touch: they share their contact lines, twice over.
#[test]
fn books_side_by_side_divide_a_shelf() {
    let mut model = Model::default();
    model.add(&floor((0.0, 0.0), (1.0, 0.3), 0.0));
    for i in 0..30 {
        let low = v(0.1 + 0.02 * f64::from(i), 0.05, 0.0);
        model.add(&cuboid(low, low + v(0.02, 0.15, 0.2)));
    }
    let set = model.map(|p| turned() * p).through_f32().build();
    assert_eq!(set.surfaces[0].regions.len(), 31);
}

#[test]
fn a_floor_under_a_cut_sphere_is_divided() {
    let mut model = Model::default();
    model.add(&floor((-1.0, -1.0), (1.0, 1.0), 0.0));
    let p = |i: u32, j: u32| {
        let (a, b) =
            (std::f64::consts::TAU * f64::from(i) / 24.0, std::f64::consts::PI * f64::from(j) / 12.0);
        v(a.cos() * b.sin(), a.sin() * b.sin(), b.cos()) * 0.5 + v(0.0, 0.0, 0.2)
    };
    let sphere: Vec<_> = (0..24)
        .flat_map(|i| (0..12).map(move |j| (i, j)))
        .flat_map(|(i, j)| quad(p(i, j), p(i, j + 1), p(i + 1, j + 1), p(i + 1, j)))
        .collect();
    model.add(&sphere);
    let set = model.map(|p| turned() * p).through_f32().build();
    let found = areas(&set.surfaces[0]);
    assert_eq!(found.len(), 2, "{found:?}");
    // A circle of radius 0.46, drawn with 24 corners by a sphere with 12 rings.
    assert!((found[0] - 0.647).abs() < 0.03, "{found:?}");
}

/// Triangles thrown about at random: they pierce each other everywhere.
#[test]
fn random_triangles_keep_their_areas() {
    let mut state = 88_172_645_463_325_252_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    for scale in [1e-4, 1.0, 1e5] {
        for lattice in [0.0, 4.0] {
            let mut model = Model::default();
            for _ in 0..60 {
                let mut point = || {
                    let p = v(random(), random(), random());
                    (if lattice > 0.0 { (p * lattice).round() / lattice } else { p }) * scale
                };
                let t = [point(), point(), point()];
                model.add(&[t]);
                *model.double_sided.last_mut().unwrap() = random() < 0.5;
            }
            let set = model.through_f32().build();
            assert!(set.surfaces.len() > 40);
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mut model = Model::default();
    model.add(&floor((0.0, 0.0), (1.0, 1.0), 0.0));
    for i in 0..40 {
        let low = v(0.02 * f64::from(i), 0.019 * f64::from(i), -0.01);
        model.add(&cuboid(low, low + v(0.05, 0.05, 0.1)));
    }
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        format!("{:?}", pool.install(|| model.build()))
    };
    assert_eq!(with(1), with(8));
}

#[test]
fn nothing_gives_nothing() {
    let set = Model::default().build();
    assert!(set.surfaces.is_empty());
    let mut model = Model::default();
    model.add(&[]);
    model.add(&[[DVec3::ONE; 3]]);
    assert!(model.build().surfaces.is_empty());
}
