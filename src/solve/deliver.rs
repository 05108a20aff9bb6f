//! What the patches send in the end reaches the elements.
//!
//! Each patch delivers all that it reflected, twice: first its mean, to learn how light varies over the
//! patches, then what its elements received. A weak delivery was
//! found well enough when the patches exchanged light, and the receiving patch keeps it. A
//! strong one is evaluated anew in the receiver's samples: closed form times visibility,
//! with the parts of a near shooter sending each their own radiosity, and the parts of a
//! near receiver receiving in its place. So elements arise only where light changes within
//! them.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::direct::DirectPass;
use super::emitter::{Between, Effort, Evaluation, Precision};
use super::form_factor::{SurfacePoint, point_to_disk};
use super::patches::Patches;
use super::shooters::{Reflected, Shooter, Shooters};
use crate::element::{Facet, NONE, Side};
use crate::light::luminance;
use crate::options::Refine;

/// A delivery whose change across the receiving patch is below this fraction of the light there is weak.
const WEAK: f64 = 4e-4;

/// The error in an element's middle that a delivery may leave, as a fraction of the light there.
const TOLERANCE: f64 = 8e-4;

/// The same for a first delivery, which only shows the second how light varies over the shooters.
const FIRST_TOLERANCE: f64 = 5e-3;

/// Where something stands between, this share of the difference between samples counts as error: the
/// interpolation of a shadow's edge can be right in the middle by chance.
const SHADOW_SHARE: f64 = 0.2;

/// What delivering took.
#[derive(Clone, Copy, Debug, Default)]
pub struct DeliveryCounts {
    /// Pairs that kept what the patches had exchanged.
    pub weak: u64,
    /// Elements that received a strong delivery.
    pub strong: u64,
    /// Splits for the sake of indirect light.
    pub splits: u64,
    /// Evaluations and rays.
    pub effort: Effort,
}

impl DeliveryCounts {
    /// Adds another delivery's counts.
    pub fn add(&mut self, other: &Self) {
        self.weak += other.weak;
        self.strong += other.strong;
        self.splits += other.splits;
        self.effort.add(other.effort);
    }
}

/// Delivers what all shooters send to all facets, in place of what was delivered before.
pub fn deliver(
    pass: &DirectPass,
    patches: &Patches,
    shooters: &Shooters,
    facets: &mut [Facet],
) -> DeliveryCounts {
    let tolerance = match shooters.reflected() {
        Reflected::ByPatch => FIRST_TOLERANCE,
        Reflected::ByElement => TOLERANCE,
    };
    // Patches come in the order of facets, so each facet's are consecutive.
    let mut first_of_facet = vec![0; facets.len() + 1];
    for patch in &patches.patches {
        first_of_facet[patch.facet as usize + 1] += 1;
    }
    for i in 1..first_of_facet.len() {
        first_of_facet[i] += first_of_facet[i - 1];
    }
    let typical = patches.mean_irradiance();
    let counts: Vec<DeliveryCounts> = facets
        .par_iter_mut()
        .enumerate()
        .map(|(index, facet)| {
            for element in &mut facet.elements {
                element.indirect = [DVec3::ZERO; 4];
            }
            let mut delivery = Delivery {
                pass,
                shooters,
                values: vec![(NONE, DVec3::ZERO); facet.samples.len()],
                facet,
                typical,
                tolerance,
                reference: typical,
                evaluation: Evaluation::new(Precision::REFLECTOR),
                counts: DeliveryCounts::default(),
            };
            delivery.receive_all(patches, first_of_facet[index]..first_of_facet[index + 1]);
            delivery.counts.effort = delivery.evaluation.effort;
            delivery.counts
        })
        .collect();
    let mut total = DeliveryCounts::default();
    counts.iter().for_each(|c| total.add(c));
    total
}

struct Delivery<'a> {
    pass: &'a DirectPass<'a>,
    shooters: &'a Shooters,
    facet: &'a mut Facet,
    /// The last shooter asked in each sample, and its irradiance there.
    values: Vec<(u32, DVec3)>,
    typical: f64,
    tolerance: f64,
    /// What errors are measured by in the present patch.
    reference: f64,
    evaluation: Evaluation,
    counts: DeliveryCounts,
}

impl Delivery<'_> {
    fn receive_all(&mut self, patches: &Patches, own: std::ops::Range<usize>) {
        let mut kept = vec![DVec3::ZERO; own.len()];
        for (sender, patch) in patches.patches.iter().enumerate() {
            let root = self.shooters.of_patch(sender);
            let shooter = &self.shooters.all[root as usize];
            if luminance(shooter.radiosity) <= 0.0 {
                continue;
            }
            for (receiver, kept) in own.clone().zip(&mut kept) {
                let to = &patches.patches[receiver];
                let d = patch.centre.position - to.centre.position;
                if to.centre.normal.dot(d) <= -patch.radius
                    || -patch.centre.normal.dot(d) <= -to.radius
                    || receiver == sender
                {
                    continue;
                }
                self.reference = self.typical.max(luminance(to.direct + to.indirect));
                let known = patches.factor(sender, receiver);
                let distance = d.length();
                let most = (patch.area / (std::f64::consts::PI * distance * distance)).min(1.0).max(known);
                let change = (2.0 * to.radius / distance).min(1.0);
                if to.radius <= self.pass.indirect_threshold
                    || luminance(shooter.radiosity) * most * change < WEAK * self.reference
                {
                    *kept += shooter.radiosity * known;
                    self.counts.weak += 1;
                } else {
                    self.receive(to.element, root, None);
                }
            }
        }
        for (receiver, kept) in own.zip(kept) {
            let element = &mut self.facet.elements[patches.patches[receiver].element as usize];
            element.kept = kept;
        }
    }

    /// `inherited` holds what stands between the element's parent or the shooter's parent.
    fn receive(&mut self, element: u32, shooter: u32, inherited: Option<&[u32]>) {
        let tracer = self.pass.tracer;
        let s = &self.shooters.all[shooter as usize];
        if luminance(s.radiosity) <= 0.0 {
            return;
        }
        let hull = self.facet.hull(element);
        let emitter = &s.emitter;
        if emitter.is_behind(&hull, self.facet.frame.normal, tracer.margin()) {
            return;
        }
        let between = emitter.between(&hull, tracer, inherited);
        if !between.is_empty() && self.pass.occluders.one_hides(&hull, emitter, tracer, &between) {
            return;
        }
        let e = &self.facet.elements[element as usize];
        let centre = self.facet.centre(element);
        let to_shooter = s.centre - centre.position;
        let half = 0.5 * (e.max - e.min).length();
        let distance = to_shooter.length();
        let gap = (distance - half - s.radius).max(0.15 * distance);
        let near = (half / gap).min(1.0);
        let factor = if s.area < 0.01 * gap * gap {
            point_to_disk(centre, s.centre, s.normal, s.area)
        } else {
            emitter.form_factor(centre)
        };
        let most = factor.max(s.most_factor(&hull, self.facet.frame.normal, gap));
        if s.spread * factor > self.tolerance * self.reference && !s.is_leaf() {
            for part in s.parts {
                if part != NONE {
                    self.receive(element, part, Some(&between));
                }
            }
            return;
        }
        let polygons = self.pass.occluders.polygons(tracer, &between);
        let standing = Between::of(&polygons);
        let change = if between.is_empty() { 0.5 * near * near } else { near.max(0.2) };
        let allowed = self.tolerance * self.reference;
        if luminance(s.radiosity) * most * change > allowed
            && self.error_in_middle(element, shooter, standing) > allowed
            && self.part(element)
        {
            for child in self.facet.elements[element as usize].children {
                if child != NONE {
                    self.receive(child, shooter, Some(&between));
                }
            }
            return;
        }
        self.take(element, shooter, standing);
    }

    /// How far the interpolation of what arrives in the samples is from what arrives in the middle; where
    /// something stands between, not less than a share of how much the samples differ.
    fn error_in_middle(&mut self, element: u32, shooter: u32, between: Between) -> f64 {
        let samples = self.facet.elements[element as usize].samples;
        let values = samples.map(|sample| self.value(sample, shooter, between));
        let middle = self.evaluate(self.facet.centre(element), shooter, between);
        let e = &self.facet.elements[element as usize];
        let interpolated = e.interpolate(&e.corner_values(values), e.centroid);
        let error = luminance((interpolated - middle).abs());
        if matches!(between, Between::Nothing) {
            return error;
        }
        values.iter().map(|v| SHADOW_SHARE * luminance((*v - middle).abs())).fold(error, f64::max)
    }

    /// Whether the element has parts now.
    fn part(&mut self, element: u32) -> bool {
        let e = &self.facet.elements[element as usize];
        if !e.is_leaf() {
            return true;
        }
        let may = match self.pass.options.refine {
            Refine::None | Refine::Uniform | Refine::Cob => false,
            Refine::Gradient | Refine::CobGradient => e.size() > self.pass.indirect_threshold,
        };
        if may && self.facet.split(element, self.pass.appearance) {
            self.values.resize(self.facet.samples.len(), (NONE, DVec3::ZERO));
            self.counts.splits += 1;
            return true;
        }
        false
    }

    fn take(&mut self, element: u32, shooter: u32, between: Between) {
        self.counts.strong += 1;
        let samples = self.facet.elements[element as usize].samples;
        let values = samples.map(|sample| self.value(sample, shooter, between));
        let e = &mut self.facet.elements[element as usize];
        let corners = e.corner_values(values);
        for (sum, value) in e.indirect.iter_mut().zip(corners) {
            *sum += value;
        }
    }

    fn value(&mut self, sample: u32, shooter: u32, between: Between) -> DVec3 {
        let (known, value) = self.values[sample as usize];
        if known == shooter {
            return value;
        }
        let value = self.evaluate(self.facet.samples[sample as usize].point, shooter, between);
        self.values[sample as usize] = (shooter, value);
        value
    }

    fn evaluate(&mut self, point: SurfacePoint, shooter: u32, between: Between) -> DVec3 {
        let s: &Shooter = &self.shooters.all[shooter as usize];
        s.emitter.irradiance(point, self.pass.tracer, between, &mut self.evaluation)
    }
}

/// Spreads what patches kept over their corners: a corner takes the mean of the patches of its region that
/// meet there, so that the light is continuous where it was constant.
pub fn spread_kept(patches: &Patches, facets: &mut [Facet], grain: f64) {
    let key = |facet: &Facet, corner: DVec2| {
        let cell = (facet.frame.lift(corner) / grain).round().as_i64vec3();
        (facet.surface, facet.region, facet.side == Side::Front, cell.to_array())
    };
    let mut sums: HashMap<_, (DVec3, f64)> = HashMap::new();
    for patch in &patches.patches {
        let facet = &facets[patch.facet as usize];
        let e = &facet.elements[patch.element as usize];
        for corner in e.corners() {
            let (sum, weight) = sums.entry(key(facet, corner)).or_default();
            *sum += e.kept * e.area;
            *weight += e.area;
        }
    }
    for patch in &patches.patches {
        let facet = &mut facets[patch.facet as usize];
        let at = facet.elements[patch.element as usize].corners().map(|c| key(facet, c));
        let e = &mut facet.elements[patch.element as usize];
        for (value, key) in e.indirect.iter_mut().zip(at) {
            if let Some(&(sum, weight)) = sums.get(&key) {
                *value += sum / weight;
            }
        }
    }
}
