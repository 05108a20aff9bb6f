//! Lines along which light breaks off, known before it is looked at.
//!
//! Where something hangs closely over a surface, a book beside a book, light ends at its outline within less than a
//! texel. Such a line is where it is, and no samples, however close, tell that as well. Only lines along the
//! surface's axes are of use: charts are rectangles.

use glam::{DVec2, DVec3};

use crate::geom::Bounds;
use crate::surface::Surface;
use crate::trace::Tracer;

/// An edge is parallel to an axis if it does not leave it by more than this fraction of its length.
const PARALLEL: f64 = 1e-4;

/// Lines closer together than this fraction of the surface's extent are one.
const SAME: f64 = 1e-6;

/// Lines of a surface, at most: the longest.
const MOST: usize = 128;

/// A stretch of a line on which one plane coordinate is the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct KnownLine {
    /// Which one.
    pub axis: usize,
    /// Its value, metres.
    pub at: f64,
    /// Least and greatest value of the other.
    pub from: f64,
    pub to: f64,
}

impl KnownLine {
    /// Whether it runs through a rectangle or along its edge.
    pub(super) fn crosses(&self, min: DVec2, max: DVec2) -> bool {
        let Self { axis, at, from, to } = *self;
        min[axis] <= at && at <= max[axis] && from <= max[1 - axis] && to >= min[1 - axis]
    }

    /// Whether it lies between two places along an axis.
    pub(super) fn cuts(&self, axis: usize, (low, high): (f64, f64)) -> bool {
        self.axis == axis && low < self.at && self.at < high
    }
}

/// For each surface the outlines of what is no farther in front of it than `reach` metres.
pub(super) fn known_lines(surfaces: &[Surface], tracer: &Tracer, reach: f64) -> Vec<Vec<KnownLine>> {
    let mut surface_of = vec![u32::MAX; tracer.triangles().len()];
    for (index, surface) in surfaces.iter().enumerate() {
        for &triangle in &surface.source_triangles {
            surface_of[triangle] = index as u32;
        }
    }
    let of = |(index, surface): (usize, &Surface)| {
        let mut lines = Vec::new();
        for other in near(surface, tracer, reach, &surface_of) {
            if other != index {
                outline_over(surface, &surfaces[other], (tracer.margin(), reach), &mut lines);
            }
        }
        merged(lines, surface)
    };
    surfaces.iter().enumerate().map(of).collect()
}

/// The surfaces that may come so near to one, ascending.
fn near(surface: &Surface, tracer: &Tracer, reach: f64, surface_of: &[u32]) -> Vec<usize> {
    let feet = surface.rings.iter().flatten().map(|&p| surface.frame.lift(p));
    let above = surface.frame.normal * reach;
    let mut triangles = Vec::new();
    tracer.triangles_in(Bounds::of(feet.flat_map(|p| [p, p + above])), &mut triangles);
    let mut near: Vec<usize> = triangles
        .iter()
        .map(|&t| surface_of[t as usize])
        .filter(|&s| s != u32::MAX)
        .map(|s| s as usize)
        .collect();
    near.sort_unstable();
    near.dedup();
    near
}

/// Adds the edges of `other` that hang over `surface` and run along its axes.
fn outline_over(surface: &Surface, other: &Surface, (margin, reach): (f64, f64), lines: &mut Vec<KnownLine>) {
    let (low, high) = surface.extent();
    let least = SAME * (high - low);
    let place = |p: &DVec2| -> DVec3 {
        let p = other.frame.lift(*p);
        surface.frame.project(p).extend(surface.frame.height(p))
    };
    for ring in &other.rings {
        for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let (a, b) = (place(a), place(b));
            if a.z.min(b.z) < margin || a.z.max(b.z) > reach {
                continue;
            }
            let (a, b) = (a.truncate(), b.truncate());
            for axis in 0..2 {
                let (at, from, to) =
                    (0.5 * (a[axis] + b[axis]), a[1 - axis].min(b[1 - axis]), a[1 - axis].max(b[1 - axis]));
                let is_parallel = (a[axis] - b[axis]).abs() <= PARALLEL * (to - from);
                let (from, to) = (from.max(low[1 - axis]), to.min(high[1 - axis]));
                let is_inside = at > low[axis] + least[axis] && at < high[axis] - least[axis];
                if is_parallel && is_inside && to > from {
                    lines.push(KnownLine { axis, at, from, to });
                }
            }
        }
    }
}

/// One line in place of several that are the same, in order, and no more than are of use.
fn merged(mut lines: Vec<KnownLine>, surface: &Surface) -> Vec<KnownLine> {
    let (low, high) = surface.extent();
    let least = SAME * (high - low);
    lines.sort_by(|a, b| a.axis.cmp(&b.axis).then(a.at.total_cmp(&b.at)));
    let mut merged: Vec<KnownLine> = Vec::new();
    for line in lines {
        match merged.last_mut() {
            Some(last) if last.axis == line.axis && line.at - last.at <= least[line.axis] => {
                (last.from, last.to) = (last.from.min(line.from), last.to.max(line.to));
            }
            _ => merged.push(line),
        }
    }
    if merged.len() > MOST {
        merged.sort_by(|a, b| (b.to - b.from).total_cmp(&(a.to - a.from)));
        merged.truncate(MOST);
    }
    merged
}
