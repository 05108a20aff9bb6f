//! The whole scene from a corner above it, as a doll's house: without perspective, and without the walls that
//! stand between us and the room.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::bilinear::sample;
use super::canvas::{Canvas, SAMPLES};
use super::density::Densities;
use super::{INK, ToneMap, WHITE};
use crate::geom::Bounds;
use crate::surface::Surface;
use crate::trace::Tracer;

/// The width of either half, pixels.
const WIDTH: u32 = 900;
/// The greatest height, over the width.
const TALLEST: f64 = 1.5;
/// Pixels between the halves.
const GAP: u32 = 12;
/// Pixels across for which the best corner is looked for.
const PROBE: u32 = 96;
/// From the scene's middle towards the viewer; the signs of `x` and `z` tell the corner. glTF's `y` is up.
const TOWARDS: DVec3 = DVec3::new(0.55, 0.75, 0.8);
/// Surfaces with no more than this share of the scene's area on our side of them are its shell, and looked through
/// where something is to be seen behind them: walls' outer faces, double-sided walls, roofs.
const SHELL: f64 = 0.05;
/// What lies this near a surface's plane is on neither side of it, over the surface's size.
const ON_PLANE: f64 = 1e-3;
/// What each sample of a picture shows.
pub(super) struct View {
    width: u32,
    height: u32,
    seen: Vec<Option<Seen>>,
}

/// A place that a ray met.
#[derive(Clone, Copy)]
struct Seen {
    chart: usize,
    texel: DVec2,
}

/// The scene in pieces that can be looked at.
struct House<'a> {
    densities: &'a Densities<'a>,
    triangles: Vec<[DVec3; 3]>,
    /// The chart of each triangle.
    charts: Vec<usize>,
    /// For each surface, from the front and from behind, whether it is the scene's shell.
    shell: Vec<[bool; 2]>,
}

/// Those triangles of a house that are not looked through.
struct Facing {
    tracer: Tracer,
    charts: Vec<usize>,
}

impl View {
    /// Looks at the scene from the corner that shows the most charts.
    pub(super) fn of(densities: &Densities) -> Self {
        let house = House::of(densities);
        let corners = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        let towards = |(x, z)| TOWARDS * DVec3::new(x, 1.0, z);
        let shown = |&(x, z): &(f64, f64)| {
            let view = house.look(towards((x, z)), PROBE);
            let mut charts: Vec<usize> = view.seen.iter().flatten().map(|seen| seen.chart).collect();
            charts.sort_unstable();
            charts.dedup();
            charts.len()
        };
        // Of equally good corners `max_by_key` gives the last.
        let best = corners.into_iter().rev().max_by_key(shown).unwrap_or((1.0, 1.0));
        house.look(towards(best), WIDTH * SAMPLES)
    }

    /// Density to the left, light to the right: RGB rows, width and height.
    pub(super) fn pixels(&self, densities: &Densities) -> (Vec<u8>, (u32, u32)) {
        let page = densities.subject.lightmap;
        let size = DVec2::new(page.width.into(), page.height.into());
        let light = |seen: &Seen| sample(page, seen.texel / size);
        let tones = ToneMap::for_values(self.seen.iter().flatten().map(light));
        let at = |x: u32, y: u32| {
            let place = (x < self.width && y < self.height).then_some((y * self.width + x) as usize);
            place.and_then(|place| self.seen[place])
        };
        let chart = |x, y| at(x, y).map(|seen| seen.chart);
        let left = self.width + GAP * SAMPLES;
        let canvas = Canvas::sampled((left + self.width) / SAMPLES, self.height / SAMPLES, |x, y| {
            if x >= left {
                return at(x - left, y).map_or(WHITE, |seen| tones.colour(light(&seen)));
            }
            let Some(seen) = at(x, y) else { return WHITE };
            let is_border =
                [(x + 1, y), (x, y + 1)].into_iter().any(|(x, y)| chart(x, y) != Some(seen.chart));
            if is_border { INK } else { densities.colours[seen.chart] }
        });
        (canvas.into_pixels(), ((left + self.width) / SAMPLES, self.height / SAMPLES))
    }
}

impl<'a> House<'a> {
    fn of(densities: &'a Densities<'a>) -> Self {
        let subject = densities.subject;
        let (mut triangles, mut charts) = (Vec::new(), Vec::new());
        for piece in &densities.pieces {
            let frame = &subject.surfaces[subject.atlas.charts[piece.chart].surface].frame;
            for k in 2..piece.ring.len() {
                triangles.push([0, k - 1, k].map(|corner| frame.lift(piece.ring[corner])));
                charts.push(piece.chart);
            }
        }
        Self { densities, triangles, charts, shell: shell(subject.surfaces) }
    }

    /// The triangles that show a viewer `towards` whom they lie a side that is a surface, with the shell or without.
    fn facing(&self, towards: DVec3, with_shell: bool) -> Facing {
        let subject = self.densities.subject;
        let shows = |chart: usize| {
            let index = subject.atlas.charts[chart].surface;
            let surface = &subject.surfaces[index];
            let from_behind = surface.frame.normal.dot(towards) <= 0.0;
            let is_shell = self.shell[index][usize::from(from_behind)];
            (surface.double_sided || !from_behind) && (with_shell || !is_shell)
        };
        let kept = self.triangles.iter().zip(&self.charts).filter(|(_, chart)| shows(**chart));
        let (triangles, charts) = kept.unzip();
        Facing { tracer: Tracer::new(triangles), charts }
    }

    /// Casts a ray for each sample of a picture `width` samples wide.
    fn look(&self, towards: DVec3, width: u32) -> View {
        let towards = towards.normalize();
        let right = DVec3::Y.cross(towards).normalize();
        let up = towards.cross(right);
        let bounds = Bounds::of(self.triangles.iter().flatten().copied());
        let (min, max, centre) = (bounds.min, bounds.max, bounds.centre());
        // Half the box's silhouette.
        let half = |axis: DVec3| 0.5 * axis.abs().dot(max - min);
        let extent = DVec2::new(half(right), half(up));
        if !(extent.x > 0.0 && extent.y > 0.0) {
            return View { width: SAMPLES, height: SAMPLES, seen: vec![None; (SAMPLES * SAMPLES) as usize] };
        }
        let aspect = (extent.y / extent.x).min(TALLEST);
        let height = ((f64::from(width) * aspect) as u32 / SAMPLES).max(1) * SAMPLES;
        let back = bounds.diagonal();
        let (inside, all) = (self.facing(towards, false), self.facing(towards, true));
        let step = (2.0 * extent.x / f64::from(width)).max(2.0 * extent.y / f64::from(height));
        let atlas = self.densities.subject.atlas;
        let seen = (0..width * height)
            .into_par_iter()
            .map(|index| {
                let (x, y) = (f64::from(index % width) + 0.5, f64::from(index / width) + 0.5);
                let (x, y) = (x - 0.5 * f64::from(width), 0.5 * f64::from(height) - y);
                let origin = centre + step * (x * right + y * up) + back * towards;
                let (chart, place) = inside.meet(origin, -towards).or_else(|| all.meet(origin, -towards))?;
                let of = &atlas.charts[chart];
                let frame = &self.densities.subject.surfaces[of.surface].frame;
                Some(Seen { chart, texel: of.texel(frame.project(place)) })
            })
            .collect();
        View { width, height, seen }
    }
}

impl Facing {
    /// The chart that a ray meets, and where.
    fn meet(&self, origin: DVec3, direction: DVec3) -> Option<(usize, DVec3)> {
        let hit = self.tracer.closest_hit(origin, direction)?;
        Some((self.charts[hit.triangle], origin + hit.distance * direction))
    }
}

/// For each surface whether hardly anything but the outermost shell lies in front of it, and whether behind it.
fn shell(surfaces: &[Surface]) -> Vec<[bool; 2]> {
    let middles: Vec<DVec3> = surfaces
        .iter()
        .map(|surface| {
            let (min, max) = surface.extent();
            surface.frame.lift(0.5 * (min + max))
        })
        .collect();
    let mut areas: Vec<f64> = surfaces.iter().map(|s| s.area).collect();
    let least = SHELL * areas.iter().sum::<f64>();
    let peel = |areas: &[f64]| -> Vec<[bool; 2]> {
        let of = |surface: &Surface| {
            let in_plane = ON_PLANE * surface.area.sqrt();
            let mut sides = [0.0; 2];
            for (middle, area) in middles.iter().zip(areas) {
                let height = surface.frame.height(*middle);
                if height.abs() > in_plane {
                    sides[usize::from(height < 0.0)] += area;
                }
            }
            sides.map(|area| area <= least)
        };
        surfaces.par_iter().map(of).collect()
    };
    let outermost = peel(&areas);
    areas.iter_mut().zip(outermost).filter(|(_, [in_front, _])| *in_front).for_each(|(area, _)| *area = 0.0);
    peel(&areas)
}
