//! Rooms made by hand, whose light is known in closed form.
#![allow(dead_code, reason = "each test binary uses a part")]
#![allow(clippy::expect_used, reason = "clippy lets tests expect things, but not what they share")]

use cobake::element::{Facet, MeshOptions, SurfaceAppearance, build};
use cobake::geom::Frame;
use cobake::options::BakeOptions;
use cobake::scene::PunctualLight;
use cobake::solve::{Problem, Solution, solve};
use cobake::surface::{Region, Surface};
use cobake::trace::Tracer;
use glam::{DVec2, DVec3};

/// A flat polygon facing the side from which `corners` run counter-clockwise.
pub(crate) fn polygon(corners: &[DVec3], index: usize) -> Surface {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    let frame = Frame::new(corners[0], normal, corners[1] - corners[0]);
    let ring: Vec<DVec2> = corners.iter().map(|&c| frame.project(c)).collect();
    let triangles: Vec<[DVec2; 3]> = (1..ring.len() - 1).map(|i| [ring[0], ring[i], ring[i + 1]]).collect();
    let area = cobake::geom::polygon::signed_area(&ring);
    let count = triangles.len();
    Surface {
        placement: 0,
        material: 0,
        frame,
        rings: vec![ring.clone()],
        source_triangles: (index..index + count).collect(),
        regions: vec![Region { rings: vec![ring], triangles, area }],
        area,
        smooth: None,
        double_sided: false,
    }
}

/// The six walls of a box from `min` to `max`, facing inward.
pub(crate) fn room(min: DVec3, max: DVec3) -> Vec<Surface> {
    let p =
        |x: usize, y: usize, z: usize| DVec3::new([min.x, max.x][x], [min.y, max.y][y], [min.z, max.z][z]);
    let walls = [
        [p(0, 0, 0), p(1, 0, 0), p(1, 1, 0), p(0, 1, 0)],
        [p(0, 0, 1), p(0, 1, 1), p(1, 1, 1), p(1, 0, 1)],
        [p(0, 0, 0), p(0, 0, 1), p(1, 0, 1), p(1, 0, 0)],
        [p(0, 1, 0), p(1, 1, 0), p(1, 1, 1), p(0, 1, 1)],
        [p(0, 0, 0), p(0, 1, 0), p(0, 1, 1), p(0, 0, 1)],
        [p(1, 0, 0), p(1, 0, 1), p(1, 1, 1), p(1, 1, 0)],
    ];
    walls.iter().enumerate().map(|(i, w)| polygon(w, 2 * i)).collect()
}

/// An icosphere of radius 1 seen from inside.
pub(crate) fn sphere(subdivisions: u32) -> Vec<Surface> {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let v = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ]
    .map(|(x, y, z)| DVec3::new(x, y, z).normalize());
    let faces = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut triangles: Vec<[DVec3; 3]> = faces.iter().map(|f| f.map(|i| v[i])).collect();
    for _ in 0..subdivisions {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = ((a + b).normalize(), (b + c).normalize(), (c + a).normalize());
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    triangles.iter().enumerate().map(|(i, &[a, b, c])| polygon(&[a, c, b], i)).collect()
}

/// All surfaces reflect and emit alike.
pub(crate) struct Uniform {
    pub(crate) reflectance: f64,
    pub(crate) exitance: f64,
}

impl SurfaceAppearance for Uniform {
    fn reflectance(&self, _: usize, _: DVec2, _: DVec2) -> DVec3 {
        DVec3::splat(self.reflectance)
    }
    fn exitance(&self, _: usize, _: DVec2, _: DVec2) -> DVec3 {
        DVec3::splat(self.exitance)
    }
}

/// A scene made by hand.
pub(crate) struct Case<'a> {
    pub(crate) surfaces: &'a [Surface],
    pub(crate) appearance: &'a (dyn SurfaceAppearance + Sync),
    pub(crate) lights: &'a [PunctualLight],
    pub(crate) patch_size: f64,
    pub(crate) threshold: f64,
}

impl Case<'_> {
    pub(crate) fn solve(&self, options: &BakeOptions) -> Solution {
        let triangles: Vec<[DVec3; 3]> = self
            .surfaces
            .iter()
            .flat_map(|s| s.regions[0].triangles.iter().map(|t| t.map(|p| s.frame.lift(p))))
            .collect();
        let double_sided =
            self.surfaces.iter().flat_map(|s| vec![s.double_sided; s.regions[0].triangles.len()]).collect();
        let tracer = Tracer::new(triangles).with_double_sided(double_sided);
        let mesh = MeshOptions {
            patch_size: self.patch_size,
            nudge: 1e-5 * tracer.diagonal(),
            lift: tracer.margin(),
        };
        let facets = build(self.surfaces, self.appearance, mesh);
        let problem = Problem {
            tracer: &tracer,
            surfaces: self.surfaces,
            appearance: self.appearance,
            lights: self.lights,
            options,
            patch_size: self.patch_size,
            threshold: self.threshold,
            indirect_threshold: 2.0 * self.threshold,
            texel: 2.0 * self.threshold,
        };
        solve(&problem, facets, &mut |_| true).expect("nobody cancels")
    }
}

/// `(direct, indirect)` irradiance in the middle of every leaf, with the leaf's area.
pub(crate) fn leaves(facets: &[Facet]) -> Vec<(f64, DVec3, DVec3)> {
    facets
        .iter()
        .flat_map(|f| {
            f.leaves().map(move |leaf| {
                let e = &f.elements[leaf as usize];
                let (direct, indirect) = f.received(leaf, e.centroid);
                (e.area, direct, indirect)
            })
        })
        .collect()
}
