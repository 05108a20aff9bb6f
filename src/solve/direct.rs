//! Emitters and lights shoot; elements receive, and split where their shadows fall.
//!
//! For each element and shooter: what stands in the shaft between them is handed down from
//! the parent element and filtered. Nothing there: closed form without a ray. One occluder
//! that hides everything: nothing arrives. Else the visible part of the emitter is found
//! sample by sample. Before that, the refinement policies say whether the element's parts
//! shall receive in its place:
//!
//! - the Close Objects Buffer, a priori, as in the paper: the shot is strong (eq. 1) and
//!   something close may shade the element;
//! - gradient, a posteriori: the value in the middle differs from the interpolation.

use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::prelude::*;

use super::emitter::{Between, Effort, Emitter, Evaluation, Precision};
use super::form_factor::point_to_disk;
use super::umbra::Occluders;
use crate::cob::{Cob, CobState, Prism, prism_height};
use crate::element::{Facet, NONE, SurfaceAppearance};
use crate::geom::Bounds;
use crate::light::luminance;
use crate::options::{BakeOptions, Refine, Toggle};
use crate::trace::Tracer;

/// A value in an element's middle that differs from the interpolation by more than this fraction of the
/// light there calls for a split.
const GRADIENT_TOLERANCE: f64 = 0.04;

/// The share of an emitter's power that an element may make or lose by interpolation.
const MISPLACED_POWER: f64 = 5e-5;

/// Elements that misplace power are split down to this fraction of the threshold.
const LEAST_OF_THRESHOLD: f64 = 1.0 / 32.0;

/// Reflectance below which the paper's criterion would no longer see a shot that the lightmap still holds.
const LEAST_REFLECTANCE: f64 = 0.1;

/// What the direct pass needs to know.
pub struct DirectPass<'a> {
    /// The scene's triangles.
    pub tracer: &'a Tracer,
    /// Their convex outlines.
    pub occluders: &'a Occluders,
    /// Reflectances of new elements.
    pub appearance: &'a (dyn SurfaceAppearance + Sync),
    /// The caller's options.
    pub options: &'a BakeOptions,
    /// Elements no larger than this are not split for direct light, metres.
    pub threshold: f64,
    /// The same for reflected light.
    pub indirect_threshold: f64,
    /// Longest side of a patch, metres.
    pub patch_size: f64,
    /// Mean irradiance that the emitters would give if they shone evenly: what counts as dim.
    pub typical: f64,
}

/// What a shot did.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShotCounts {
    /// Splits by the Close Objects Buffer.
    pub cob_splits: u64,
    /// Splits by the gradient.
    pub gradient_splits: u64,
    /// Splits by the uniform policy.
    pub uniform_splits: u64,
    /// Splits that did not happen since no close object touches the shaft.
    pub saved_by_shaft: u64,
    /// Splits that did not happen since one occluder hides everything.
    pub saved_by_umbra: u64,
    /// Time spent in Close Objects Buffers, summed over threads.
    pub cob_time: Duration,
    /// Evaluations and rays.
    pub effort: Effort,
}

impl ShotCounts {
    /// Adds another shot's counts.
    pub fn add(&mut self, other: &Self) {
        self.cob_splits += other.cob_splits;
        self.gradient_splits += other.gradient_splits;
        self.uniform_splits += other.uniform_splits;
        self.saved_by_shaft += other.saved_by_shaft;
        self.saved_by_umbra += other.saved_by_umbra;
        self.cob_time += other.cob_time;
        self.effort.add(other.effort);
    }
}

impl DirectPass<'_> {
    /// Lets one emitter shoot onto all facets.
    pub fn shoot(&self, emitter: &Emitter, facets: &mut [Facet]) -> ShotCounts {
        let counts: Vec<ShotCounts> = facets
            .par_iter_mut()
            .map(|facet| {
                let mut receiving = Receiving::new(self, emitter, facet);
                receiving.receive(0, None);
                receiving.counts.effort = receiving.evaluation.effort;
                receiving.counts
            })
            .collect();
        let mut total = ShotCounts::default();
        counts.iter().for_each(|c| total.add(c));
        total
    }
}

/// One facet receiving one shot.
struct Receiving<'a> {
    pass: &'a DirectPass<'a>,
    emitter: &'a Emitter,
    facet: &'a mut Facet,
    /// The shot's irradiance in each sample that was asked for.
    values: Vec<Option<DVec3>>,
    /// The same in the middle of the element at hand, where a policy asked for it.
    middle: Option<DVec3>,
    evaluation: Evaluation,
    counts: ShotCounts,
}

impl<'a> Receiving<'a> {
    fn new(pass: &'a DirectPass<'a>, emitter: &'a Emitter, facet: &'a mut Facet) -> Self {
        let values = vec![None; facet.samples.len()];
        Self {
            pass,
            emitter,
            facet,
            values,
            middle: None,
            evaluation: Evaluation::new(Precision::EMITTER),
            counts: ShotCounts::default(),
        }
    }

    /// `inherited` holds what stands in the parent's shaft.
    fn receive(&mut self, element: u32, inherited: Option<&[u32]>) {
        let tracer = self.pass.tracer;
        let (slab, smooth) = (self.facet.slab(element), self.facet.smooth.as_deref());
        if self.emitter.is_behind(&slab, self.facet.frame.normal, smooth, tracer.margin()) {
            return;
        }
        let between = self.emitter.between(&slab, (&self.facet.frame, smooth), tracer, inherited);
        let is_umbra = self.pass.options.umbra_test == Toggle::On
            && !between.is_empty()
            && self.pass.occluders.one_hides(slab.corners(), self.emitter, tracer, &between);
        if !self.facet.elements[element as usize].is_leaf() {
            if !is_umbra {
                self.receive_in_parts(element, &between);
            }
            return;
        }
        self.middle = None;
        if self.should_split(element, &between, is_umbra) && self.facet.split(element, self.pass.appearance) {
            self.values.resize(self.facet.samples.len(), None);
            self.receive_in_parts(element, &between);
        } else if !is_umbra {
            let values = self.facet.elements[element as usize].samples.map(|s| self.value(s, &between));
            let e = &mut self.facet.elements[element as usize];
            let shading = match self.middle {
                Some(middle) => e.shading(values, middle),
                None => e.flat(values),
            };
            e.direct.add(&shading);
        }
    }

    fn receive_in_parts(&mut self, element: u32, between: &[u32]) {
        for child in self.facet.elements[element as usize].children {
            if child != NONE {
                self.receive(child, Some(between));
            }
        }
    }

    fn should_split(&mut self, element: u32, between: &[u32], is_umbra: bool) -> bool {
        let options = self.pass.options;
        let size = self.facet.elements[element as usize].size();
        if size <= self.pass.threshold {
            let follows_gradient = matches!(options.refine, Refine::Gradient | Refine::CobGradient);
            let may = follows_gradient && !is_umbra && size > self.pass.threshold * LEAST_OF_THRESHOLD;
            let misplaces = may && self.misplaces_power(element, between);
            self.counts.gradient_splits += u64::from(misplaces);
            return misplaces;
        }
        match options.refine {
            Refine::None => return false,
            Refine::Uniform => {
                self.counts.uniform_splits += 1;
                return true;
            }
            Refine::Cob | Refine::CobGradient => {
                if self.close_shadow(element, between) {
                    if is_umbra {
                        self.counts.saved_by_umbra += 1;
                    } else {
                        self.counts.cob_splits += 1;
                        return true;
                    }
                }
            }
            Refine::Gradient => {}
        }
        if options.refine == Refine::Cob || is_umbra || !self.gradient_is_steep(element, between) {
            return false;
        }
        self.counts.gradient_splits += 1;
        true
    }

    /// The paper's criterion: a strong shot, and something close that may shade it.
    fn close_shadow(&mut self, element: u32, between: &[u32]) -> bool {
        if !self.is_strong(element) {
            return false;
        }
        let begin = Instant::now();
        let cob = self.cob(element);
        let entries = self.facet.cobs.entries(cob);
        // Both lists ascend.
        let counts = self.pass.options.shaft_test == Toggle::Off
            || entries.iter().any(|t| between.binary_search(t).is_ok());
        let is_empty = entries.is_empty();
        self.counts.cob_time += begin.elapsed();
        if !is_empty && !counts {
            self.counts.saved_by_shaft += 1;
        }
        !is_empty && counts
    }

    /// Eq. 1: `M` times the shooter's radiosity against a fraction of the receiver's own.
    fn is_strong(&self, element: u32) -> bool {
        let e = &self.facet.elements[element as usize];
        let centre = self.facet.centre(element);
        let diagonal = self.pass.tracer.diagonal();
        let arriving = match self.emitter.facing() {
            Some((normal, area, exitance)) => {
                exitance * point_to_disk(centre, self.emitter.centre(centre.position, diagonal), normal, area)
            }
            None => self.emitter.irradiance(
                centre,
                self.pass.tracer,
                Between::Nothing,
                &mut Evaluation::new(Precision::EMITTER),
            ),
        };
        let reflectance = e.reflectance.max(DVec3::splat(LEAST_REFLECTANCE));
        let (direct, indirect) = self.facet.received(element, e.centroid);
        let present = self.facet.exitance + reflectance * (direct + indirect);
        (reflectance * arriving).element_sum()
            > self.pass.options.illumination_threshold * present.element_sum()
    }

    /// The element's buffer, filled if it was not.
    fn cob(&mut self, element: u32) -> Cob {
        let e = &self.facet.elements[element as usize];
        if e.cob.state() != CobState::Uninitialized {
            return e.cob;
        }
        let parent =
            if e.parent == NONE { Cob::UNINITIALIZED } else { self.facet.elements[e.parent as usize].cob };
        let height = prism_height(self.pass.options.cob_height, e.size());
        let tracer = self.pass.tracer;
        let prism =
            Prism::over(&self.facet.hull(element), self.facet.frame.normal, height, tracer.margin() * 0.5);
        let cob = self.facet.cobs.fill(&prism, parent, tracer);
        self.facet.elements[element as usize].cob = cob;
        cob
    }

    fn gradient_is_steep(&mut self, element: u32, between: &[u32]) -> bool {
        let arriving = self.arriving(element, between);
        let e = &self.facet.elements[element as usize];
        let (direct, _) = self.facet.received(element, e.centroid);
        let light = luminance(direct) + luminance(arriving.middle.max(arriving.interpolated));
        let light = light.max(self.pass.typical);
        arriving.error() > GRADIENT_TOLERANCE * light
            || (!between.is_empty() && arriving.spread > SHADOW_SPREAD * light)
    }

    /// Whether the interpolation makes or loses a notable share of all that the emitter sends: close to a
    /// small strong emitter light changes within less than a texel, and what it reflects must still be right.
    fn misplaces_power(&mut self, element: u32, between: &[u32]) -> bool {
        let error = self.arriving(element, between).error();
        let power = luminance(self.emitter.power(self.pass.tracer.diagonal()));
        error * self.facet.elements[element as usize].area > MISPLACED_POWER * power
    }

    fn arriving(&mut self, element: u32, between: &[u32]) -> Arriving {
        let samples = self.facet.elements[element as usize].samples;
        let values = samples.map(|s| self.value(s, between));
        let middle = self.evaluate(self.facet.centre(element), between);
        let e = &self.facet.elements[element as usize];
        let interpolated = e.flat(values).at(e.place(e.centroid));
        self.middle = Some(middle);
        let spread = values.iter().map(|&v| luminance((v - middle).abs())).fold(0.0, f64::max);
        let block = Bounds::of(self.facet.hull(element));
        let is_near = self.emitter.distance(block) < e.size();
        Arriving { middle, interpolated, spread, is_near }
    }

    fn value(&mut self, sample: u32, between: &[u32]) -> DVec3 {
        if let Some(value) = self.values[sample as usize] {
            return value;
        }
        let value = self.evaluate(self.facet.samples[sample as usize].point, between);
        self.values[sample as usize] = Some(value);
        value
    }

    fn evaluate(&mut self, point: super::form_factor::SurfacePoint, between: &[u32]) -> DVec3 {
        let polygons = self.pass.occluders.polygons(self.pass.tracer, between);
        self.emitter.irradiance(point, self.pass.tracer, Between::of(&polygons), &mut self.evaluation)
    }
}

/// A shot's irradiance in an element.
struct Arriving {
    /// In the middle.
    middle: DVec3,
    /// What the samples' interpolation says of the middle.
    interpolated: DVec3,
    /// The most by which a sample's luminance differs from the middle's.
    spread: f64,
    /// Whether the emitter is nearer than the element is large.
    is_near: bool,
}

impl Arriving {
    fn error(&self) -> f64 {
        let missed = luminance((self.middle - self.interpolated).abs());
        if self.is_near { missed.max(NEAR_SHARE * self.spread) } else { missed }
    }
}

/// Where the emitter is nearer than the element is large, this share of the difference between the samples and the
/// middle counts as error: light may fall off within less than the element, and be half-way down in the middle by
/// chance, as under the rim of a lamp that hangs a finger below the ceiling.
const NEAR_SHARE: f64 = 0.05;

/// Where occluders are about, corners may differ from the middle by this fraction of the light before the
/// element is split: the interpolation of a shadow's edge can be right in the middle by chance.
const SHADOW_SPREAD: f64 = 0.25;

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the light of two corners and none at the others is right in the middle whatever lies between.
    #[test]
    fn near_an_emitter_a_middle_that_is_right_is_not_believed() {
        let [half, spread] = [DVec3::splat(50.0), DVec3::splat(50.0)];
        let of = |is_near| Arriving { middle: half, interpolated: half, spread: luminance(spread), is_near };
        assert!(of(false).error() < 1e-9);
        assert!(of(true).error() > GRADIENT_TOLERANCE * luminance(half));
    }
}
