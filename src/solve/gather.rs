//! Reflected light is gathered where elements receive.
//!
//! The light that a place receives from all others is the mean of what rays meet that leave it
//! cosine-distributed (the "final gathering" of Reichert, "A Two-Pass Radiosity Method to
//! Transmitting and Specularly Reflecting Surfaces", 1992; Lischinski, Tampieri and Greenberg
//! 1993 call it the local pass). The rays of a place are well distributed and their number
//! follows from how much what they meet varies; all of a facet's places look in the same
//! directions, so that what is left of the error is smooth. Elements are split where the light
//! in their middle, or under what stands close over them, is not what their samples say: a
//! posteriori, as the gradient policy does for direct light.
//!
//! It costs the same in scenes of ten and of ten thousand surfaces, and where light is even it
//! is exact, in corners and under contacts, too.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::budget::{Contrasts, Leniency, Round, level_for};
use super::contact::{Covered, Nearby};
use super::direct::DirectPass;
use super::emitter::{Evaluation, Precision, seen_by_rays};
use super::field::RadiosityField;
use super::form_factor::SurfacePoint;
use super::hemisphere::{Directions, Level};
use super::hot::HotSpot;
use super::overhang::{CLOSE, Overhang};
use super::patches::Receiver;
use super::sight::{Place, Sight, Sights};
use crate::element::{Facet, Shading};
use crate::geom::Frame;
use crate::light::luminance;
use crate::options::Refine;
use crate::trace::{FanStack, Hit};

/// In the dark, errors are measured by this fraction of the scene's mean light,
const LEAST_REFERENCE: f64 = 0.5;

/// and where it is bright by no more than this many times as much.
const MOST_REFERENCE: f64 = 3.0;

/// Where surfaces are nearer than the element is large, this share of the difference between the samples and
/// the middle counts as error: the interpolation of an edge can be right in the middle by chance.
const NEAR_SHARE: f64 = 0.05;

/// Light that changes this many times more along one axis than along the other changes along that one.
const CLEARLY: f64 = 2.0;

/// No element becomes this many times longer than wide by being split across.
const MOST_SLENDER: f64 = 32.0;

/// An element that is smaller than the square root of the tolerance times this, in distances to what it sees, is not
/// asked about its middle: light curves with the square of that (Ward, Rubinstein and Clear 1988).
const FLAT: f64 = 1.34;

/// Where direct light alone is this many times the scene's mean light, a small error is as much light as a large one
/// elsewhere,
const BRIGHT: f64 = 10.0;

/// and elements are split down to this fraction of the threshold.
const LEAST_WHERE_BRIGHT: f64 = 1.0 / 16.0;

/// A hot spot that gives less than this fraction of the light is left out.
const HOT_NEGLIGIBLE: f64 = 2e-5;

/// A place of which more than this share of the rays meets something within the receiver's reach is in a gap.
const ENCLOSED: f64 = 0.75;

/// Where light goes to and fro, an error counts as many times as it is reflected, but no more than the inverse of this.
const LEAST_KEPT: f64 = 0.1;

/// Rounds in a row in which light in a gap may stay as it is before it counts as settled: it comes to one side by
/// way of the other.
const PATIENCE: u32 = 2;

/// Least and most light that errors are measured by.
#[derive(Clone, Copy, Debug)]
pub struct References {
    least: f64,
    most: f64,
}

/// Those of a scene with this mean light.
#[must_use]
pub fn references(typical: f64) -> References {
    References { least: LEAST_REFERENCE * typical, most: MOST_REFERENCE * typical }
}

impl References {
    /// What an error is measured by where there is so much light.
    #[must_use]
    pub fn nearest(&self, light: f64) -> f64 {
        light.max(self.least).min(self.most)
    }
}

/// What gathering took.
#[derive(Clone, Copy, Debug, Default)]
pub struct GatherCounts {
    /// Places that gathered.
    pub places: u64,
    /// Splits for the sake of reflected light.
    pub splits: u64,
    /// Rays.
    pub rays: u64,
    /// Places by contrast.
    pub contrasts: Contrasts,
}

impl GatherCounts {
    /// Adds another round's counts.
    pub fn add(&mut self, other: &Self) {
        self.places += other.places;
        self.splits += other.splits;
        self.rays += other.rays;
        self.contrasts.add_all(&other.contrasts);
    }
}

/// What is gathered.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// What rays read.
    pub field: &'a RadiosityField<'a>,
    /// What is too bright and too small for them.
    pub hot_spots: &'a [HotSpot],
    /// Luminance of reflected radiosity up to which rays read it from the field.
    pub cap: f64,
    /// Where all places look.
    pub directions: &'a Directions,
}

/// Gathers what `source` reflects, in place of the reflected light that there was. `receivers` holds the elements
/// to begin with, by facet; the others keep what they have. Places that are among the `sights`, by facet, too, do
/// not look again; the others are added to them.
///
/// Returns, by facet, the elements in narrow gaps, too, whose light has not settled: that changed by more than a
/// fraction `unsettled` of it, now or in the round before.
pub fn gather(
    pass: &DirectPass,
    source: Source,
    receivers: &[Vec<Receiver>],
    (round, unsettled): (Round, f64),
    sights: Option<&mut [Sights]>,
    facets: &mut [Facet],
) -> (GatherCounts, Vec<Vec<Receiver>>) {
    let sights: Vec<Option<&mut Sights>> = match sights {
        Some(sights) => sights.iter_mut().map(Some).collect(),
        None => facets.iter().map(|_| None).collect(),
    };
    let counts: Vec<(GatherCounts, Vec<Receiver>)> = facets
        .par_iter_mut()
        .zip(receivers)
        .zip(sights)
        .map(|((facet, receivers), sights)| {
            if receivers.is_empty() {
                return (GatherCounts::default(), Vec::new());
            }
            let mut gathering = Gathering {
                pass,
                source,
                round,
                contrast: 0.0,
                level: Level::LEAST,
                receiver: Receiver { element: 0, contrast: 0.0, reach: 0.0, idle: 0 },
                unsettled,
                enclosed: Vec::new(),
                sights,
                stack: FanStack::default(),
                spare: Sight::default(),
                nearby: Nearby::default(),
                evaluation: Evaluation::new(Precision::HOT_SPOT),
                places: vec![None; facet.samples.len()],
                facet,
                counts: GatherCounts::default(),
            };
            for receiver in receivers {
                gathering.receiver = *receiver;
                gathering.receive(receiver.element);
            }
            gathering.counts.rays += gathering.evaluation.effort.rays;
            (gathering.counts, gathering.enclosed)
        })
        .collect();
    let mut total = GatherCounts::default();
    counts.iter().for_each(|(c, _)| total.add(c));
    (total, counts.into_iter().map(|(_, enclosed)| enclosed).collect())
}

/// One facet gathering.
struct Gathering<'a> {
    pass: &'a DirectPass<'a>,
    source: Source<'a>,
    round: Round,
    /// What an error counts for the element at hand: the contrast of what it sees, and how many of the directions
    /// its places take for that.
    contrast: f64,
    level: Level,
    /// Where the elements at hand began.
    receiver: Receiver,
    /// Elements in narrow gaps whose light changed by more than this fraction of it.
    unsettled: f64,
    enclosed: Vec<Receiver>,
    /// What places saw that are asked again, if it is kept.
    sights: Option<&'a mut Sights>,
    stack: FanStack,
    /// Memory for what a place sees.
    spare: Sight,
    nearby: Nearby,
    /// For hot spots.
    evaluation: Evaluation,
    facet: &'a mut Facet,
    /// What the samples have gathered.
    places: Vec<Option<Gathered>>,
    counts: GatherCounts,
}

/// What a place gathered.
#[derive(Clone, Copy, Debug)]
struct Gathered {
    irradiance: DVec3,
    /// Harmonic mean distance of what the rays met, metres.
    distance: f64,
    /// Whether most of the rays met something near.
    is_enclosed: bool,
}

impl Gathering<'_> {
    fn receive(&mut self, element: u32) {
        let e = &self.facet.elements[element as usize];
        let size = e.size();
        self.contrast = self.receiver.contrast / self.leniency(element).noise;
        self.level = level_for(self.contrast, self.round.noise);
        if size <= self.least(element) {
            if self.round.splits() {
                let overhang = Overhang::over(self.pass.tracer, self.facet, element);
                self.facet.elements[element as usize].overhang = overhang;
            }
            let e = &self.facet.elements[element as usize];
            let place = e.overhang.map_or(e.centroid, |overhang| overhang.open);
            let gathered = self.again(Place::Element(element), self.facet.receiving(place));
            let shading = Shading { corners: [gathered.irradiance; 4], bulge: DVec3::ZERO };
            self.keep(element, shading, gathered.is_enclosed);
            return;
        }
        if e.is_uneven {
            return self.receive_in_parts(element);
        }
        let samples = e.samples;
        let places = samples.map(|sample| self.sample(sample));
        let values = places.map(|p| p.irradiance);
        let mut shading = self.facet.elements[element as usize].flat(values);
        let nearest = places.iter().map(|p| p.distance).fold(f64::INFINITY, f64::min);
        let (mut middle, mut is_uneven) = (None, false);
        if self.round.splits() && self.may_split(element) {
            if size > FLAT * self.round.tolerance.sqrt() * nearest {
                let gathered = self.at(self.facet.centre(element));
                is_uneven = self.is_missed_in_the_middle(element, &shading, values, gathered);
                shading = self.facet.elements[element as usize].shading(values, gathered.irradiance);
                middle = Some(gathered);
            }
            is_uneven = is_uneven || self.is_missed_nearby(element, &shading);
        }
        if is_uneven && self.part(element, values) {
            self.places.resize(self.facet.samples.len(), None);
            if let Some(middle) = middle {
                self.hand_down(element, middle);
            }
            self.facet.elements[element as usize].is_uneven = true;
            self.receive_in_parts(element);
        } else {
            let is_enclosed = places.iter().chain(&middle).any(|p| p.is_enclosed);
            self.keep(element, shading, is_enclosed);
        }
    }

    /// Takes down what an element received.
    fn keep(&mut self, element: u32, shading: Shading, is_enclosed: bool) {
        let e = &mut self.facet.elements[element as usize];
        e.is_enclosed = is_enclosed;
        let before = std::mem::replace(&mut e.indirect, shading);
        if is_enclosed {
            let idle = if self.changes(element, &shading, &before) { 0 } else { self.receiver.idle + 1 };
            if idle < PATIENCE {
                self.enclosed.push(Receiver { element, idle, ..self.receiver });
            }
        }
    }

    fn changes(&self, element: u32, shading: &Shading, before: &Shading) -> bool {
        let (direct, _) = self.facet.received(element, self.facet.elements[element as usize].centroid);
        let places = [(0.5, 0.5), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        places.into_iter().map(DVec2::from).any(|t| {
            let (now, before) = (shading.at(t), before.at(t));
            let light = luminance(direct + now).max(LEAST_REFERENCE * self.pass.typical);
            luminance((now - before).abs()) > self.unsettled * light
        })
    }

    fn receive_in_parts(&mut self, element: u32) {
        let e = &mut self.facet.elements[element as usize];
        e.indirect = Shading::default();
        e.is_enclosed = false;
        for child in self.facet.elements[element as usize].children() {
            self.receive(child);
        }
    }

    /// Whether the samples' `shading` is not what the middle gathered.
    fn is_missed_in_the_middle(
        &self,
        element: u32,
        shading: &Shading,
        values: [DVec3; 4],
        middle: Gathered,
    ) -> bool {
        let e = &self.facet.elements[element as usize];
        let mut error = luminance((shading.at(e.place(e.centroid)) - middle.irradiance).abs());
        if middle.distance < e.size() {
            let differences = values.iter().map(|v| luminance((*v - middle.irradiance).abs()));
            error = differences.map(|d| NEAR_SHARE * d).fold(error, f64::max);
        }
        // Light that dies away in a gap is convex: interpolation adds to it at every reflection anew.
        let kept = if middle.is_enclosed { (1.0 - luminance(e.reflectance)).max(LEAST_KEPT) } else { 1.0 };
        error > kept * self.tolerated(element, e.centroid, middle.irradiance)
    }

    /// Whether something stands close over the element, or on it, where its light is not what `shading` says.
    fn is_missed_nearby(&mut self, element: u32, shading: &Shading) -> bool {
        let tracer = self.pass.tracer;
        self.nearby.look(tracer, self.facet, element);
        let covered = self.nearby.most_covered(tracer, self.facet, element);
        if let Some(Covered { place, height }) = covered {
            // What is gathered in a gap is the light that it was thought to have. It is dark there.
            let is_close = height < CLOSE * self.facet.elements[element as usize].size();
            let light = if is_close { DVec3::ZERO } else { self.at(self.facet.receiving(place)).irradiance };
            if self.is_missed_at(place, element, shading, light) {
                return true;
            }
        }
        let field = self.source.field;
        let reflected = |hit: &Hit, at| luminance(field.radiosity(tracer, hit, at).as_dvec3());
        let foot = self.nearby.brightest_foot(tracer, self.facet, element, reflected);
        foot.is_some_and(|foot| {
            let e = &self.facet.elements[element as usize];
            foot.gives > self.tolerated(element, foot.place, shading.at(e.place(foot.place))) && {
                let light = self.at(self.facet.receiving(foot.place)).irradiance;
                self.is_missed_at(foot.place, element, shading, light)
            }
        })
    }

    /// Whether `shading` is not the light that was `gathered` at a place of an element.
    fn is_missed_at(&self, p: DVec2, element: u32, shading: &Shading, gathered: DVec3) -> bool {
        let shading = shading.at(self.facet.elements[element as usize].place(p));
        luminance((shading - gathered).abs()) > self.tolerated(element, p, gathered)
    }

    /// The error that is tolerated at a place of an element.
    fn tolerated(&self, element: u32, p: DVec2, gathered: DVec3) -> f64 {
        let (direct, _) = self.facet.received(element, p);
        let light = references(self.pass.typical).nearest(luminance(direct + gathered));
        self.leniency(element).tolerance * self.round.tolerance * light
    }

    /// An error that was asked for holds everywhere.
    fn leniency(&self, element: u32) -> Leniency {
        match self.pass.options.gather_error {
            Some(_) => Leniency::NONE,
            None => Leniency::for_size(self.facet.elements[element as usize].size() / self.pass.patch_size),
        }
    }

    /// An element no larger than this is not split, metres.
    fn least(&self, element: u32) -> f64 {
        let (direct, _) = self.facet.received(element, self.facet.elements[element as usize].centroid);
        let is_bright = luminance(direct) > BRIGHT * self.pass.typical;
        self.pass.indirect_threshold * if is_bright { LEAST_WHERE_BRIGHT } else { 1.0 }
    }

    fn may_split(&self, element: u32) -> bool {
        match self.pass.options.refine {
            Refine::Gradient | Refine::CobGradient => true,
            Refine::None | Refine::Uniform | Refine::Cob => !self.facet.elements[element as usize].is_leaf(),
        }
    }

    /// Whether the element has parts now.
    ///
    /// A leaf is split across the direction in which the light in its corners changes most: slender parts follow
    /// the light along walls' feet.
    fn part(&mut self, element: u32, samples: [DVec3; 4]) -> bool {
        let e = &self.facet.elements[element as usize];
        if !e.is_leaf() {
            return true;
        }
        let size = e.max - e.min;
        let [a, b, c, d] = e.corner_values(samples).map(luminance);
        let change = DVec2::new((b + c - a - d).abs(), (c + d - a - b).abs());
        let least = self.least(element);
        let clearly = |axis: usize| e.cut.is_none() && change[axis] > CLEARLY * change[1 - axis];
        let along = [0, 1].map(|axis| {
            let is_large = size[axis] > least && size[axis] * MOST_SLENDER > size[1 - axis];
            is_large && (clearly(axis) || (!clearly(1 - axis) && size[axis] > 0.7 * size[1 - axis]))
        });
        if along == [false, false] {
            return false;
        }
        let split = self.facet.split_into(element, along.map(|a| 1 + u32::from(a)), self.pass.appearance);
        if split {
            self.counts.splits += 1;
            return true;
        }
        false
    }

    /// What the middle gathered serves the parts that meet there.
    fn hand_down(&mut self, element: u32, middle: Gathered) {
        let e = &self.facet.elements[element as usize];
        let near = 1e-3 * e.size();
        for child in e.children() {
            for sample in self.facet.elements[child as usize].samples {
                if self.facet.samples[sample as usize].position.distance(e.centroid) < near {
                    self.places[sample as usize] = Some(middle);
                }
            }
        }
    }

    fn sample(&mut self, sample: u32) -> Gathered {
        if let Some(known) = self.places[sample as usize] {
            return known;
        }
        let gathered = self.again(Place::Sample(sample), self.facet.samples[sample as usize].point);
        self.places[sample as usize] = Some(gathered);
        gathered
    }

    /// What a place gathers that may have been asked before.
    fn again(&mut self, place: Place, point: SurfacePoint) -> Gathered {
        let Some(sights) = &self.sights else { return self.at(point) };
        if let Some(sight) = sights.get(&place) {
            self.counts.places += 1;
            return self.gathered(sight, point);
        }
        // Hot spots may lie in gaps, too, and shine when light has come there.
        let sight = self.look(point, self.source.cap);
        let gathered = self.gathered(&sight, point);
        if let Some(sights) = &mut self.sights {
            sights.insert(place, sight);
        }
        gathered
    }

    fn at(&mut self, point: SurfacePoint) -> Gathered {
        let sight = self.look(point, 0.0);
        let gathered = self.gathered(&sight, point);
        self.spare = sight;
        gathered
    }

    fn gathered(&self, sight: &Sight, point: SurfacePoint) -> Gathered {
        let Source { field, hot_spots, .. } = self.source;
        let Sight { distance, is_enclosed, .. } = *sight;
        Gathered { irradiance: sight.irradiance(point.position, field, hot_spots), distance, is_enclosed }
    }

    /// What is seen at a place, hot spots as if none shone less than with `least_exitance`.
    fn look(&mut self, point: SurfacePoint, least_exitance: f64) -> Sight {
        let tracer = self.pass.tracer;
        let fans = self.source.directions.fans(self.level);
        let smooth = self.facet.smooth.as_deref();
        let Frame { u, v, normal, .. } = match smooth {
            None => self.facet.frame,
            Some(_) => Frame::new(point.position, point.normal, self.facet.frame.u),
        };
        let (mut nearness, mut near) = (0.0, 0_u32);
        let (reach, surface) = (self.receiver.reach, self.facet.surface);
        let field = self.source.field;
        let Sight { mut met, mut hot, .. } = std::mem::take(&mut self.spare);
        met.clear();
        tracer.look(point.position, [u, v, normal], fans, &mut self.stack, |hit, at, share| {
            met.extend(field.met(tracer, (hit, at), normal).map(|met| (met, share as f32)));
            if smooth.is_some() && field.is_of(hit, surface) {
                return; // a facet of a hollow: so near that it would tell nothing of what else is about
            }
            nearness += share / hit.distance.max(tracer.margin());
            near += u32::from(hit.distance < reach);
        });
        let shining = |s: &HotSpot| s.emitter.exitance().max_element().max(least_exitance);
        let spots = self.source.hot_spots.iter().map(|s| (&s.emitter, shining(s)));
        let negligible = HOT_NEGLIGIBLE * LEAST_REFERENCE * self.pass.typical;
        seen_by_rays(spots, point, tracer, negligible, &mut self.evaluation, &mut hot);
        let rays = self.level.rays() as f64;
        self.counts.places += 1;
        self.counts.contrasts.add(self.contrast, 1);
        self.counts.rays += self.level.rays() as u64;
        let is_enclosed = f64::from(near) > ENCLOSED * rays;
        Sight { met, hot, rays, distance: rays / nearness, is_enclosed }
    }
}
