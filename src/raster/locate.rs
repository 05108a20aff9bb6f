//! Which triangle of a surface's mesh lies under a point.

use glam::{DVec2, DVec3};

use crate::geom::polygon::{nearest_on_segment, orient};
use crate::retriangulate::{MeshVertex, SurfaceMesh};

/// A grid of buckets over a surface's triangles, about one triangle a bucket.
pub struct TriangleLocator<'a> {
    mesh: &'a SurfaceMesh,
    min: DVec2,
    scale: DVec2,
    columns: usize,
    rows: usize,
    /// Start of each bucket in `entries`, one more than there are buckets.
    starts: Vec<u32>,
    entries: Vec<u32>,
}

/// A grid has at most this many buckets a side.
const MOST_BUCKETS: f64 = 1024.0;

impl<'a> TriangleLocator<'a> {
    /// Sorts the triangles into buckets.
    #[must_use]
    pub fn new(mesh: &'a SurfaceMesh) -> Self {
        let (min, max) = mesh
            .vertices
            .iter()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), v| (lo.min(v.position), hi.max(v.position)));
        let extent = (max - min).max(DVec2::splat(f64::MIN_POSITIVE));
        let per_side = (mesh.triangles.len() as f64 / extent.element_product()).sqrt();
        let count = (extent * per_side).clamp(DVec2::ONE, DVec2::splat(MOST_BUCKETS)).floor();
        let mut locator = Self {
            mesh,
            min,
            scale: count / extent,
            columns: count.x as usize,
            rows: count.y as usize,
            starts: Vec::new(),
            entries: Vec::new(),
        };
        if mesh.triangles.is_empty() {
            (locator.columns, locator.rows) = (0, 0);
        }
        locator.fill();
        locator
    }

    fn fill(&mut self) {
        let mut counts = vec![0_u32; self.columns * self.rows + 1];
        self.for_each_entry(|bucket, _| counts[bucket + 1] += 1);
        for i in 1..counts.len() {
            counts[i] += counts[i - 1];
        }
        self.starts.clone_from(&counts);
        let mut entries = vec![0; counts.last().map_or(0, |&n| n as usize)];
        self.for_each_entry(|bucket, triangle| {
            entries[counts[bucket] as usize] = triangle;
            counts[bucket] += 1;
        });
        self.entries = entries;
    }

    fn for_each_entry(&self, mut visit: impl FnMut(usize, u32)) {
        for (index, triangle) in self.mesh.triangles.iter().enumerate() {
            let corners = triangle.map(|v| self.mesh.vertices[v as usize].position);
            let (x0, y0) = self.bucket(corners[0].min(corners[1]).min(corners[2]));
            let (x1, y1) = self.bucket(corners[0].max(corners[1]).max(corners[2]));
            for y in y0..=y1 {
                for x in x0..=x1 {
                    visit(y * self.columns + x, index as u32);
                }
            }
        }
    }

    fn bucket(&self, p: DVec2) -> (usize, usize) {
        let cell = ((p - self.min) * self.scale).max(DVec2::ZERO);
        ((cell.x as usize).min(self.columns - 1), (cell.y as usize).min(self.rows - 1))
    }

    /// Direct and indirect irradiance at `p`, interpolated in the triangle of `region` that contains it, or in
    /// the nearest one in its bucket where rounding left it outside of all. Black where there is no triangle.
    #[must_use]
    pub fn light_at(&self, p: DVec2, region: u32) -> (DVec3, DVec3) {
        if self.columns == 0 {
            return (DVec3::ZERO, DVec3::ZERO);
        }
        let (x, y) = self.bucket(p);
        let bucket = y * self.columns + x;
        let range = self.starts[bucket] as usize..self.starts[bucket + 1] as usize;
        let mut best = (f64::INFINITY, (DVec3::ZERO, DVec3::ZERO));
        for &t in &self.entries[range] {
            let corners = self.mesh.triangles[t as usize].map(|v| self.mesh.vertices[v as usize]);
            // A triangle of another region serves only where its own has none here.
            let handicap = if self.mesh.regions[t as usize] == region { 0.0 } else { 1e30 };
            let (distance, light) = interpolate(corners, p);
            if distance + handicap < best.0 {
                best = (distance + handicap, light);
                if best.0 == 0.0 {
                    break;
                }
            }
        }
        best.1
    }
}

/// The squared distance of `p` from the triangle, and the light in the point of it nearest to `p`.
fn interpolate(corners: [MeshVertex; 3], p: DVec2) -> (f64, (DVec3, DVec3)) {
    let [a, b, c] = corners.map(|v| v.position);
    let whole = orient(a, b, c);
    let weigh = |q: DVec2| {
        let w = [orient(q, b, c), orient(a, q, c), orient(a, b, q)].map(|w| (w / whole).clamp(0.0, 1.0));
        let sum: f64 = w.iter().sum();
        let mix = |of: fn(&MeshVertex) -> DVec3| {
            corners.iter().zip(w).map(|(v, w)| of(v) * (w / sum)).sum::<DVec3>()
        };
        (mix(|v| v.direct), mix(|v| v.indirect))
    };
    let inside = [(a, b), (b, c), (c, a)].iter().all(|&(s, e)| orient(s, e, p) >= 0.0);
    if inside && whole > 0.0 {
        return (0.0, weigh(p));
    }
    let feet = [(a, b), (b, c), (c, a)].map(|(s, e)| nearest_on_segment(s, e, p));
    let nearest = feet.into_iter().min_by(|q, r| q.distance_squared(p).total_cmp(&r.distance_squared(p)));
    let foot = nearest.unwrap_or(a);
    let light = if whole > 0.0 { weigh(foot) } else { (corners[0].direct, corners[0].indirect) };
    (foot.distance_squared(p).max(f64::MIN_POSITIVE), light)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fan over a square whose light is linear in the position.
    fn linear_square() -> SurfaceMesh {
        let corner = |x: f64, y: f64| MeshVertex {
            position: DVec2::new(x, y),
            direct: DVec3::splat(1.0 + x),
            indirect: DVec3::splat(2.0 - y),
        };
        SurfaceMesh {
            vertices: vec![corner(0.0, 0.0), corner(4.0, 0.0), corner(4.0, 4.0), corner(0.0, 4.0), corner(1.0, 2.0)],
            triangles: vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
            regions: vec![0; 4],
        }
    }

    #[test]
    fn linear_light_is_interpolated_exactly() {
        let mesh = linear_square();
        let locator = TriangleLocator::new(&mesh);
        for k in 0..100 {
            let p = DVec2::new(f64::from(k % 10) * 0.44, f64::from(k / 10) * 0.44);
            let (direct, indirect) = locator.light_at(p, 0);
            assert!((direct.x - (1.0 + p.x)).abs() < 1e-12 && (indirect.x - (2.0 - p.y)).abs() < 1e-12, "{p}");
        }
    }

    #[test]
    fn a_point_outside_takes_the_nearest_edge() {
        let mesh = linear_square();
        let (direct, _) = TriangleLocator::new(&mesh).light_at(DVec2::new(5.0, 1.0), 0);
        assert!((direct.x - 5.0).abs() < 1e-12);
    }

    #[test]
    fn an_empty_mesh_is_black() {
        let mesh = SurfaceMesh::default();
        assert_eq!(TriangleLocator::new(&mesh).light_at(DVec2::ZERO, 0), (DVec3::ZERO, DVec3::ZERO));
    }
}
