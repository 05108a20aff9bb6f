//! Direct light in texels: closed form, and rays or cutting only where a shadow's edge falls.
//!
//! A surface's texels are halved into ever smaller blocks. For each block and emitter, what
//! stands in the shaft between them is handed down from the larger block and filtered. An
//! empty shaft means closed form for all of the block's texels; one occluder that hides
//! everything, zero; only small blocks that a shadow's edge crosses ask for visibility,
//! and those take several points a texel.

use glam::{DVec2, DVec3};

use crate::geom::Frame;
use crate::geom::polygon::contains;
use crate::light::luminance;
use crate::solve::emitter::{Between, Effort, Emitter, Evaluation, Precision};
use crate::solve::form_factor::SurfacePoint;
use crate::solve::umbra::Occluders;
use crate::surface::Surface;
use crate::trace::Tracer;

/// Blocks of no more texels than this are not halved further.
const SMALL_BLOCK: usize = 8;

/// Blocks of more texels than this are worked on side by side.
const PARALLEL_BLOCK: usize = 4096;

/// Light that changes by less than this fraction within a small block is taken once a texel.
const SMOOTH: f64 = 0.15;

/// Where in a texel light is evaluated when a shadow's edge crosses it, in texels from the middle.
const SUPERSAMPLES: [(f64, f64); 4] = [(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)];

/// A texel that receives direct light.
#[derive(Clone, Copy, Debug)]
pub(super) struct LitTexel {
    /// Its index among the sites.
    pub site: usize,
    /// Region of the surface.
    pub region: u32,
    /// Where it is evaluated, plane coordinates.
    pub point: DVec2,
    /// What arrives.
    pub direct: DVec3,
}

/// What all surfaces' texels need.
pub(super) struct DirectLight<'a> {
    /// The scene's triangles.
    pub tracer: &'a Tracer,
    /// Their convex outlines.
    pub occluders: &'a Occluders,
    /// What shines.
    pub emitters: &'a [Emitter],
}

impl DirectLight<'_> {
    /// Adds what all emitters send to `texels` of one surface. `texel` holds the plane steps from one texel to
    /// the next, right and down, metres.
    pub(super) fn shine(&self, surface: &Surface, texel: [DVec2; 2], texels: &mut [LitTexel]) -> Effort {
        let mut effort = Effort::default();
        for emitter in self.emitters {
            let work = Shining { light: self, surface, texel, emitter };
            let (min, max) = extent(texels);
            effort.add(work.shine_on(texels, (min, max), None));
        }
        effort
    }
}

/// One emitter shining on one surface.
struct Shining<'a> {
    light: &'a DirectLight<'a>,
    surface: &'a Surface,
    texel: [DVec2; 2],
    emitter: &'a Emitter,
}

fn extent(texels: &[LitTexel]) -> (DVec2, DVec2) {
    texels
        .iter()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), t| (lo.min(t.point), hi.max(t.point)))
}

impl Shining<'_> {
    fn shine_on(&self, texels: &mut [LitTexel], extent: (DVec2, DVec2), inherited: Option<&[u32]>) -> Effort {
        let tracer = self.light.tracer;
        let frame = &self.surface.frame;
        if texels.is_empty() {
            return Effort::default();
        }
        let hull = self.block(extent);
        if self.emitter.is_behind(&hull, frame.normal, tracer.margin()) {
            return Effort::default();
        }
        let mut between = Vec::new();
        if inherited.is_none_or(|list| !list.is_empty()) {
            let shaft = self.emitter.shaft(&hull, tracer);
            match inherited {
                None => shaft.gather(tracer, &mut between),
                Some(list) => shaft.filter(tracer, list, &mut between),
            }
        }
        if between.is_empty() {
            return self.evaluate(texels, |this, t, e| this.irradiance(t.point, Between::Nothing, e));
        }
        if self.light.occluders.one_hides(&hull, self.emitter, tracer, &between) {
            return Effort::default();
        }
        if texels.len() <= SMALL_BLOCK {
            return self.shadow_edge(texels, &self.light.occluders.polygons(tracer, &between));
        }
        let (min, max) = extent;
        let axis = usize::from(max.y - min.y > max.x - min.x);
        let middle = 0.5 * (min[axis] + max[axis]);
        let cut = partition(texels, |t| t.point[axis] < middle);
        let parallel = texels.len() > PARALLEL_BLOCK;
        let (low, high) = texels.split_at_mut(cut);
        if low.is_empty() || high.is_empty() {
            // All in one place along the longer axis: they cannot be told apart.
            let all = if low.is_empty() { high } else { low };
            return self.shadow_edge(all, &self.light.occluders.polygons(tracer, &between));
        }
        let (low_extent, high_extent) = (self::extent(low), self::extent(high));
        let work_low = |low| self.shine_on(low, low_extent, Some(&between));
        let work_high = |high| self.shine_on(high, high_extent, Some(&between));
        let (mut effort, other) = if parallel {
            rayon::join(|| work_low(low), || work_high(high))
        } else {
            (work_low(low), work_high(high))
        };
        effort.add(other);
        effort
    }

    /// The corners in space of the block that texels with points in this extent cover.
    fn block(&self, (min, max): (DVec2, DVec2)) -> [DVec3; 4] {
        let reach = 0.25 * (self.texel[0].abs() + self.texel[1].abs());
        let least = DVec2::splat(self.light.tracer.margin());
        let (low, high) = self.surface.extent();
        let (min, max) = ((min - reach).max(low) - least, (max + reach).min(high) + least);
        let frame: &Frame = &self.surface.frame;
        [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)].map(|p| frame.lift(p))
    }

    fn evaluate(
        &self,
        texels: &mut [LitTexel],
        light: impl Fn(&Self, &LitTexel, &mut Evaluation) -> DVec3,
    ) -> Effort {
        let mut evaluation = Evaluation::new(Precision::TEXEL);
        for texel in texels {
            texel.direct += light(self, texel, &mut evaluation);
        }
        evaluation.effort
    }

    /// A small block in which shadow may fall: one point a texel where the light changes little from texel
    /// to texel, several where it changes much.
    fn shadow_edge(&self, texels: &mut [LitTexel], between: &[&[DVec3]]) -> Effort {
        let mut evaluation = Evaluation::new(Precision::TEXEL);
        let once: Vec<DVec3> = texels
            .iter()
            .map(|t| self.irradiance(t.point, Between::Polygons(between), &mut evaluation))
            .collect();
        let (least, most) = once
            .iter()
            .map(|&e| luminance(e))
            .fold((f64::INFINITY, 0.0_f64), |(lo, hi), e| (lo.min(e), hi.max(e)));
        let is_smooth = texels.len() > 1 && most - least <= SMOOTH * most;
        for (texel, once) in texels.iter_mut().zip(once) {
            let light = if is_smooth { once } else { self.supersampled(texel, between, &mut evaluation) };
            texel.direct += light;
        }
        evaluation.effort
    }

    fn irradiance(&self, point: DVec2, between: Between, evaluation: &mut Evaluation) -> DVec3 {
        let frame = &self.surface.frame;
        let position = frame.lift(point) + frame.normal * self.light.tracer.margin();
        let receiver = SurfacePoint { position, normal: frame.normal };
        self.emitter.irradiance(receiver, self.light.tracer, between, evaluation)
    }

    /// The mean over points of the texel that lie in its region; the texel's own point where none does.
    fn supersampled(&self, texel: &LitTexel, between: &[&[DVec3]], evaluation: &mut Evaluation) -> DVec3 {
        let rings = self.surface.regions.get(texel.region as usize).map_or(&[][..], |r| &r.rings);
        let (mut sum, mut count) = (DVec3::ZERO, 0);
        for (x, y) in SUPERSAMPLES {
            let point = texel.point + x * self.texel[0] + y * self.texel[1];
            if contains(rings, point) {
                sum += self.irradiance(point, Between::Polygons(between), evaluation);
                count += 1;
            }
        }
        if count == 0 {
            return self.irradiance(texel.point, Between::Polygons(between), evaluation);
        }
        sum / f64::from(count)
    }
}

/// Moves what satisfies `first` to the front; how many do.
fn partition<T>(items: &mut [T], first: impl Fn(&T) -> bool) -> usize {
    let mut count = 0;
    for i in 0..items.len() {
        if first(&items[i]) {
            items.swap(i, count);
            count += 1;
        }
    }
    count
}
