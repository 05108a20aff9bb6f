//! Progressive refinement among patches.
//!
//! Patches are few and coarse; they shoot and receive until little is left unshot (Cohen,
//! Chen, Wallace, Greenberg, "A Progressive Refinement Approach to Fast Radiosity Image
//! Generation", 1988). What pairs exchange is in [`exchange`](super::exchange). What the
//! patches reflect in the end is gathered by the elements, in [`gather`](mod@super::gather).

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::exchange::Exchange;
use super::gather::References;
use super::hot::{HotSpots, reflected};
use super::locate::FacetLocator;
use crate::element::{Element, Facet, Shading, Side};
use crate::light::luminance;
use crate::trace::Tracer;

/// What emitters sent is scaled by no more than this to close the energy balance.
const MOST_SCALING: f64 = 2.0;

/// After a round of gathering light is scaled by no more than this to bring it to balance.
const MOST_SETTLING: f64 = 2.0;

/// A gain by less than this share of the tolerance may be the rays' own error.
const GAIN_BY_CHANCE: f64 = 1.0 / 3.0;

/// Changes are followed until this fraction of them is left,
const LEFT_UNSETTLED: f64 = 0.01;

/// or they were reflected so many times.
const MOST_REFLECTIONS: u32 = 24;

/// A patch: an element that shoots.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Index of its facet.
    pub facet: u32,
    /// Index of its element there.
    pub element: u32,
    /// Square metres; of a screen, what stops light.
    pub area: f64,
    /// Diffuse reflectance.
    pub reflectance: DVec3,
    /// Irradiance straight from emitters.
    pub direct: DVec3,
    /// Irradiance reflected at least once.
    pub indirect: DVec3,
    pub(super) unshot: DVec3,
}

/// Power per channel: where the light went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// By emitters and lights.
    pub emitted: DVec3,
    /// By surfaces, fronts and backs.
    pub absorbed: DVec3,
    /// Out of the scene.
    pub escaped: DVec3,
    /// Still waiting when the solver stopped.
    pub unshot: DVec3,
}

/// The patches and what they exchange.
pub struct Patches {
    /// All patches, in the order of facets.
    pub patches: Vec<Patch>,
    exchange: Exchange,
    /// Where the light went.
    pub energy: Energy,
    /// Reflected shots so far.
    pub shots: u64,
}

impl Patches {
    /// Makes patches from the facets' elements that are largest but no larger than `patch_size`.
    #[must_use]
    pub fn new(facets: &[Facet], patch_size: f64, locator: &FacetLocator, tracer: &Tracer) -> Self {
        let mut patches = Vec::new();
        for (index, facet) in facets.iter().enumerate() {
            let mut stack = vec![0];
            while let Some(element) = stack.pop() {
                let e = &facet.elements[element as usize];
                if e.size() > patch_size * (1.0 + 1e-9) && !e.is_leaf() {
                    stack.extend(e.children().collect::<Vec<_>>().into_iter().rev());
                } else {
                    patches.push(Patch::new(index as u32, element, e));
                }
            }
        }
        let exchange = Exchange::new(facets, &mut patches, locator, tracer, patch_size * patch_size);
        Self { patches, exchange, energy: Energy::default(), shots: 0 }
    }

    /// Rays that were cast to know what patches exchange.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.exchange.rays
    }

    /// For each facet its patches' elements, with the standard deviation of the luminance that a ray from there
    /// meets as a fraction of the light there, or what of `references` is nearest.
    /// What `hot` spots reflect beyond their cap does not count.
    #[must_use]
    pub fn receivers(&self, facets: &[Facet], references: References, hot: &HotSpots) -> Vec<Vec<Receiver>> {
        let is_hot = hot.leaves(facets);
        let moments: Vec<(f64, f64)> =
            self.patches.par_iter().map(|p| reflected_moments(facets, p, &is_hot, hot.cap)).collect();
        let mut receivers = vec![Vec::new(); facets.len()];
        for (index, patch) in self.patches.iter().enumerate() {
            let (mut mean, mut square) = (0.0, 0.0);
            for (other, g) in self.exchange.received(index) {
                let share = g / patch.area;
                mean += share * moments[other].0;
                square += share * moments[other].1;
            }
            let deviation = (square - mean * mean).max(0.0).sqrt();
            let light = references.nearest(luminance(patch.direct + patch.indirect));
            let contrast = if light > 0.0 { deviation / light } else { 0.0 };
            let size = facets[patch.facet as usize].elements[patch.element as usize].size();
            receivers[patch.facet as usize].push(Receiver {
                element: patch.element,
                contrast,
                reach: REACH * size,
                idle: 1,
            });
        }
        receivers
    }

    /// Area-weighted mean luminance of what patches reflect.
    #[must_use]
    pub fn mean_reflected(&self) -> f64 {
        let area: f64 = self.patches.iter().map(|p| p.area).sum();
        let power = |p: &Patch| p.area * luminance(p.reflectance * (p.direct + p.indirect));
        self.patches.iter().map(power).sum::<f64>() / area
    }

    /// Takes in what glowing surfaces sent straight to each patch, scaled so that as much arrives as was
    /// sent and neither escaped nor met a back.
    pub fn receive_from_surfaces(&mut self, facets: &[Facet], received: &[DVec3]) {
        let (mut emitted, mut escaped, mut onto_backs) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for (index, patch) in self.patches.iter().enumerate() {
            let power = facets[patch.facet as usize].exitance * patch.area;
            let losses = self.exchange.losses(index);
            emitted += power;
            escaped += power * losses.0;
            onto_backs += power * losses.1;
        }
        let arriving: DVec3 = self.patches.iter().zip(received).map(|(p, &e)| e * p.area).sum();
        let expected = emitted - escaped - onto_backs;
        let scale = DVec3::select(arriving.cmpgt(DVec3::ZERO), expected / arriving, DVec3::ONE)
            .clamp(DVec3::splat(1.0 / MOST_SCALING), DVec3::splat(MOST_SCALING));
        tracing::debug!(%emitted, %escaped, %onto_backs, %arriving, "from surfaces");
        self.energy.emitted += emitted;
        self.energy.escaped += escaped;
        self.energy.absorbed += onto_backs;
        self.receive(received, scale);
    }

    /// Takes in what punctual lights sent to each patch. Only what meets a surface counts as emitted: a
    /// directional light sends without end.
    pub fn receive_from_lights(&mut self, received: &[DVec3]) {
        self.energy.emitted += self.patches.iter().zip(received).map(|(p, &e)| e * p.area).sum::<DVec3>();
        self.receive(received, DVec3::ONE);
    }

    fn receive(&mut self, received: &[DVec3], scale: DVec3) {
        for (patch, &e) in self.patches.iter_mut().zip(received) {
            let e = e * scale;
            patch.direct += e;
            patch.unshot += patch.reflectance * e;
            self.energy.absorbed += (DVec3::ONE - patch.reflectance) * e * patch.area;
        }
    }

    /// What the energy balance made of the direct light in all, against what the mesh `received`.
    #[must_use]
    pub fn direct_scale(&self, received: &[DVec3]) -> DVec3 {
        let (mut balanced, mut plain) = (DVec3::ZERO, DVec3::ZERO);
        for (patch, &received) in self.patches.iter().zip(received) {
            balanced += patch.direct * patch.area;
            plain += received * patch.area;
        }
        DVec3::select(plain.cmpgt(DVec3::ZERO), balanced / plain, DVec3::ONE)
    }

    /// Area-weighted mean luminance of what arrives, direct and indirect.
    #[must_use]
    pub fn mean_irradiance(&self) -> f64 {
        let (sum, area) = self.patches.iter().fold((0.0, 0.0), |(sum, area), p| {
            (sum + p.area * luminance(p.direct + p.indirect), area + p.area)
        });
        if area > 0.0 { sum / area } else { 0.0 }
    }

    /// Power that waits to be shot.
    #[must_use]
    pub fn unshot_power(&self) -> DVec3 {
        self.patches.iter().map(|p| p.unshot * p.area).sum()
    }

    /// The patches with the most unshot power shoot all of it: the strongest, and as they are met those that have
    /// at least half as much. Whether any had some.
    ///
    /// Looking for the very strongest before each shot costs more than its shot is worth.
    pub fn shoot(&mut self) -> bool {
        let power = |p: &Patch| (p.unshot * p.area).element_sum();
        let most = self.patches.iter().map(power).fold(0.0, f64::max);
        if most <= 0.0 {
            return false;
        }
        for shooter in 0..self.patches.len() {
            if power(&self.patches[shooter]) >= 0.5 * most {
                self.shoot_all_of(shooter);
            }
        }
        true
    }

    fn shoot_all_of(&mut self, shooter: usize) {
        let patch = &mut self.patches[shooter];
        let radiosity = std::mem::take(&mut patch.unshot);
        let shot = radiosity * patch.area;
        let mut absorbed = DVec3::ZERO;
        for (receiver, g) in self.exchange.received(shooter) {
            let receiver = &mut self.patches[receiver];
            let arrived = radiosity * g;
            let reflected = arrived * receiver.reflectance;
            receiver.indirect += arrived / receiver.area;
            receiver.unshot += reflected / receiver.area;
            absorbed += arrived - reflected;
        }
        let (escaping, onto_backs) = self.exchange.losses(shooter);
        self.energy.absorbed += absorbed + shot * onto_backs;
        self.energy.escaped += shot * escaping;
        self.shots += 1;
    }

    /// Brings the elements' reflected light closer to balance after a round of gathering, before which the elements
    /// had `before` of it: by facet and element.
    ///
    /// A round carries light on by one reflection only. What it changed will be reflected, too, and again: the
    /// patches tell how much of that arrives where, coarsely, and the elements' light is scaled so that each patch
    /// has it (a two-grid iteration: Brandt, "Multi-Level Adaptive Solutions to Boundary-Value Problems", 1977).
    /// What changed in narrow gaps does not come out of them and is left out, as is a loss of less than
    /// the round's `tolerance`, a fraction of the light: patches lose no light, interpolation does, and a loss carried
    /// on would grow.
    pub fn settle(&self, before: &[Vec<Shading>], tolerance: f64, facets: &mut [Facet]) {
        let open: Vec<OpenLight> = self
            .patches
            .par_iter()
            .map(|p| OpenLight::of(&facets[p.facet as usize], p.element, &before[p.facet as usize]))
            .collect();
        let changes = open
            .iter()
            .zip(&self.patches)
            .map(|(open, patch)| {
                let gain = (open.change - GAIN_BY_CHANCE * tolerance * open.light).max(DVec3::ZERO);
                let loss = (-open.change - tolerance * open.light).max(DVec3::ZERO);
                (gain - loss) / patch.area
            })
            .collect();
        for ((patch, open), more) in self.patches.iter().zip(&open).zip(self.all_that_follows(changes)) {
            let more = more * open.area;
            let scale = DVec3::select(open.light.cmpgt(DVec3::ZERO), 1.0 + more / open.light, DVec3::ONE);
            let scale = scale.clamp(DVec3::splat(1.0 / MOST_SETTLING), DVec3::splat(MOST_SETTLING));
            facets[patch.facet as usize].scale_open_indirect(patch.element, scale);
        }
    }

    /// What arrives at each patch when all reflect `changes` of their irradiance, once and again.
    fn all_that_follows(&self, changes: Vec<DVec3>) -> Vec<DVec3> {
        let power = |changes: &[DVec3]| -> f64 {
            let of = |(p, c): (&Patch, &DVec3)| p.area * c.abs().element_sum();
            self.patches.iter().zip(changes).map(of).sum()
        };
        let enough = LEFT_UNSETTLED * power(&changes);
        let (mut sum, mut now) = (vec![DVec3::ZERO; changes.len()], changes);
        for _ in 0..MOST_REFLECTIONS {
            // Factors are symmetric but for the remainders, which are close to 1: a patch gathers what others send.
            now = self
                .patches
                .par_iter()
                .enumerate()
                .map(|(i, patch)| {
                    let arriving = |(j, g): (usize, f64)| self.patches[j].reflectance * now[j] * g;
                    self.exchange.received(i).map(arriving).sum::<DVec3>() / patch.area
                })
                .collect();
            sum.iter_mut().zip(&now).for_each(|(sum, now)| *sum += *now);
            if power(&now) <= enough {
                break;
            }
        }
        sum
    }

    /// Writes what patches received by reflection into their elements, continuous where it was constant: a
    /// corner takes the mean of the patches of its region that meet there, no more than `grain` metres apart.
    pub fn spread_indirect(&self, facets: &mut [Facet], grain: f64) {
        let key = |facet: &Facet, corner: DVec2| {
            let cell = (facet.frame.lift(corner) / grain).round().as_i64vec3();
            (facet.surface, facet.region, facet.side == Side::Front, cell.to_array())
        };
        let mut sums: HashMap<_, (DVec3, f64)> = HashMap::new();
        for patch in &self.patches {
            let facet = &facets[patch.facet as usize];
            for corner in facet.elements[patch.element as usize].corners() {
                let (sum, weight) = sums.entry(key(facet, corner)).or_default();
                *sum += patch.indirect * patch.area;
                *weight += patch.area;
            }
        }
        for patch in &self.patches {
            let facet = &mut facets[patch.facet as usize];
            let corners = facet.elements[patch.element as usize].corners();
            let means =
                corners.map(|c| sums.get(&key(facet, c)).map_or(patch.indirect, |(sum, w)| *sum / *w));
            facet.elements[patch.element as usize].indirect = Shading { corners: means, bulge: DVec3::ZERO };
        }
    }
}

/// A patch's element that gathers.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Index in its facet.
    pub element: u32,
    /// Standard deviation of the luminance that a ray meets, as a fraction of the light there.
    pub contrast: f64,
    /// What is nearer than this is too near for patches to tell what it reflects, metres.
    pub reach: f64,
    /// In how many rounds of late its light did not change.
    pub idle: u32,
}

/// Patches tell little of what is nearer than this fraction of their size.
const REACH: f64 = 0.25;

/// Reflected light on what of a patch does not lie in narrow gaps.
struct OpenLight {
    /// Square metres.
    area: f64,
    /// Power.
    light: DVec3,
    /// By how much it was less before.
    change: DVec3,
}

impl OpenLight {
    fn of(facet: &Facet, element: u32, before: &[Shading]) -> Self {
        let mut open = Self { area: 0.0, light: DVec3::ZERO, change: DVec3::ZERO };
        for leaf in facet.leaves_of(element).into_iter().filter(|&l| !facet.is_enclosed(l)) {
            let e = &facet.elements[leaf as usize];
            let (_, light) = facet.mean(leaf);
            open.area += e.area;
            open.light += e.area * light;
            open.change += e.area * (light - facet.indirect_before(before, leaf, e.centroid));
        }
        open
    }
}

/// Mean and mean square of the luminance that a patch reflects; hot leaves count as no more than `cap`.
fn reflected_moments(facets: &[Facet], patch: &Patch, is_hot: &[Vec<bool>], cap: f64) -> (f64, f64) {
    let facet = &facets[patch.facet as usize];
    let (mut sum, mut squares, mut area) = (0.0, 0.0, 0.0);
    for leaf in facet.leaves_of(patch.element) {
        let e = &facet.elements[leaf as usize];
        let reflected = reflected(facet, leaf);
        let reflected =
            if is_hot[patch.facet as usize][leaf as usize] { reflected.min(cap) } else { reflected };
        sum += e.area * reflected;
        squares += e.area * reflected * reflected;
        area += e.area;
    }
    if area > 0.0 { (sum / area, squares / area) } else { (0.0, 0.0) }
}

impl Patch {
    fn new(facet: u32, element: u32, e: &Element) -> Self {
        Self {
            facet,
            element,
            area: e.area,
            reflectance: e.reflectance,
            direct: DVec3::ZERO,
            indirect: DVec3::ZERO,
            unshot: DVec3::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two halves that see each other: 1/2 + 1/8 + 1/32 + … comes to the other, half of that back.
    #[test]
    fn changes_are_followed_to_their_end() {
        let patch = Patch {
            facet: 0,
            element: 0,
            area: 1.0,
            reflectance: DVec3::splat(0.5),
            direct: DVec3::ZERO,
            indirect: DVec3::ZERO,
            unshot: DVec3::ZERO,
        };
        let patches = Patches {
            patches: vec![patch.clone(), patch],
            exchange: Exchange::face_to_face(),
            energy: Energy::default(),
            shots: 0,
        };
        let [own, other] = patches.all_that_follows(vec![DVec3::ONE, DVec3::ZERO])[..] else { panic!() };
        assert!((own.x - 1.0 / 3.0).abs() < 0.01 && (other.x - 2.0 / 3.0).abs() < 0.01, "{own} {other}");
    }
}
