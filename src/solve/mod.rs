//! Stage 4: light is shot until little is left.
//!
//! In the order of progressive refinement: glowing surfaces shoot, strongest first, then
//! punctual lights, both onto elements that split where their shadows fall ([`direct`]).
//! Then patches shoot what they reflect among each other ([`patches`]), the one with the
//! most unshot power first, until the unshot power is a small fraction of the emitted; and
//! what all reflect in the end is gathered by the elements ([`mod@gather`]).

pub mod budget;
mod cluster;
pub mod contact;
pub mod direct;
pub mod emitter;
pub mod exchange;
pub mod field;
pub mod form_factor;
pub mod gather;
pub mod hemisphere;
pub mod hot;
pub mod locate;
pub mod overhang;
pub mod patches;
pub mod sequence;
pub mod sight;
pub mod umbra;
pub mod visible;

use glam::DVec3;

use crate::element::{Facet, Shading, SurfaceAppearance};
use crate::light::luminance;
use crate::options::BakeOptions;
use crate::scene::PunctualLight;
use crate::surface::Surface;
use crate::trace::Tracer;
use budget::{COARSEST, MUCH_FINER, Round, affordable_error};
use direct::{DirectPass, ShotCounts};
use emitter::Emitter;
use field::RadiosityField;
use gather::{GatherCounts, Source, gather, references};
use hemisphere::Directions;
use hot::HotSpots;
use locate::FacetLocator;
use patches::{Energy, Patches, Receiver};
use sight::{Sights, sights};
use umbra::Occluders;

/// Light in narrow gaps is followed for so many reflections at most,
const MOST_SWEEPS: u32 = 24;

/// or until none changes it by more than this fraction,
const UNSETTLED: f64 = 0.0025;

/// and at first everywhere.
const ANY: f64 = -1.0;

/// What the solver works on.
pub struct Problem<'a> {
    /// The scene's triangles.
    pub tracer: &'a Tracer,
    /// The surfaces that the facets lie on.
    pub surfaces: &'a [Surface],
    /// Reflectances of new elements.
    pub appearance: &'a (dyn SurfaceAppearance + Sync),
    /// Lights without extent.
    pub lights: &'a [PunctualLight],
    /// The caller's options.
    pub options: &'a BakeOptions,
    /// Longest side of a patch, metres.
    pub patch_size: f64,
    /// Elements no larger than this are not split for direct light, metres.
    pub threshold: f64,
    /// The same for reflected light.
    pub indirect_threshold: f64,
    /// A texel's side if all were alike, metres.
    pub texel: f64,
}

/// Light in balance.
pub struct Solution {
    /// Facets with what their elements received.
    pub facets: Vec<Facet>,
    /// What shot first, in the order in which it did.
    pub emitters: Vec<Emitter>,
    /// Convex outlines of what occludes.
    pub occluders: Occluders,
    /// Mean luminance of the irradiance on all facets.
    pub typical: f64,
    /// Where the light went.
    pub energy: Energy,
    /// Shots by emitters, lights and patches.
    pub shots: u64,
    /// Rays of all kinds.
    pub rays: u64,
    /// What the direct pass did.
    pub direct: ShotCounts,
    /// What gathering reflected light did.
    pub gathering: GatherCounts,
    /// The error that its rays were to leave, as a fraction of the light.
    pub gather_error: f64,
}

/// Solves for the light on `facets`.
///
/// `progress` is told the fraction done and says whether to go on; `None` when it said stop.
pub fn solve(
    problem: &Problem,
    mut facets: Vec<Facet>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Option<Solution> {
    let tracer = problem.tracer;
    let (glowing, lights) = emitters(problem, &facets);
    let occluders = Occluders::new(problem.surfaces, tracer.triangles().len());
    let mut pass = DirectPass {
        tracer,
        occluders: &occluders,
        appearance: problem.appearance,
        options: problem.options,
        threshold: problem.threshold,
        indirect_threshold: problem.indirect_threshold,
        patch_size: problem.patch_size,
        typical: typical_irradiance(&glowing, &lights, &facets, tracer.diagonal()),
    };
    let mut direct = ShotCounts::default();
    let locator = FacetLocator::new(problem.surfaces, &facets, tracer.triangles().len());
    let mut patches = Patches::new(&facets, problem.patch_size, &locator, tracer);
    let count = glowing.len() + lights.len();
    let mut before = mean_direct(&patches, &facets);
    for (i, emitter) in glowing.iter().chain(&lights).enumerate() {
        if i == glowing.len() {
            let after = mean_direct(&patches, &facets);
            patches.receive_from_surfaces(&facets, &after);
            before = after;
        }
        direct.add(&pass.shoot(emitter, &mut facets));
        if !progress(0.4 * (i + 1) as f64 / count as f64) {
            return None;
        }
    }
    tracing::debug!(?direct, "direct light");
    let after = mean_direct(&patches, &facets);
    if lights.is_empty() {
        patches.receive_from_surfaces(&facets, &after);
    } else {
        let received: Vec<DVec3> = after.iter().zip(&before).map(|(a, b)| *a - *b).collect();
        patches.receive_from_lights(&received);
    }
    shoot_patches(&mut patches, problem, progress)?;
    tracing::debug!(shots = patches.shots, rays = patches.rays(), patches = patches.patches.len(), "patches");
    pass.typical = patches.mean_irradiance();
    let (gathering, gather_error) = if patches.shots == 0 {
        (GatherCounts::default(), problem.options.gather_error.unwrap_or(COARSEST))
    } else {
        gather_reflected(
            &pass,
            &patches,
            (&locator, problem.surfaces, problem.texel),
            &after,
            &mut facets,
            progress,
        )?
    };
    let emitters: Vec<Emitter> = glowing.into_iter().chain(lights).collect();
    Some(Solution {
        facets,
        typical: patches.mean_irradiance(),
        energy: patches.energy,
        shots: emitters.len() as u64 + patches.shots,
        rays: patches.rays() + direct.effort.rays + gathering.rays,
        emitters,
        occluders,
        direct,
        gathering,
        gather_error,
    })
}

/// Lets all elements gather what the patches reflect in the end, in a few rounds, of which each reads what the one
/// before wrote; after the first, light is followed into narrow gaps, and after all but the last it is brought to
/// balance by the patches. `None` when told to stop. `received` is the
/// direct light of the patches as the mesh has it. Returns the error that the rays were to leave, too.
fn gather_reflected(
    pass: &DirectPass,
    patches: &Patches,
    (locator, surfaces, texel): (&FacetLocator, &[Surface], f64),
    received: &[DVec3],
    facets: &mut [Facet],
    progress: &mut dyn FnMut(f64) -> bool,
) -> Option<(GatherCounts, f64)> {
    patches.spread_indirect(facets, pass.tracer.diagonal() * 1e-6);
    let direct_scale = patches.direct_scale(received);
    let hot = HotSpots::find(patches, facets);
    let receivers = patches.receivers(facets, references(pass.typical), &hot);
    let directions = Directions::prepare();
    let mut counts = GatherCounts::default();
    let area: f64 = surfaces.iter().map(|s| s.area).sum();
    let texels = area / texel.powi(2);
    let field_of = |facets: &[Facet]| RadiosityField::new(locator, surfaces, facets, &hot, direct_scale);
    let gather_from = |receivers: &[Vec<Receiver>],
                       round: (Round, f64),
                       (field, seen): (&RadiosityField, Option<&mut [Sights]>),
                       facets: &mut [Facet]| {
        let hot_spots = hot.shining(field, facets);
        let source = Source { field, hot_spots: &hot_spots, cap: hot.cap, directions: &directions };
        let (own, unsettled) = gather(pass, source, receivers, round, seen, facets);
        tracing::debug!(?round, places = own.places, rays = own.rays, "gathered");
        (own, unsettled)
    };
    let mut gaps_are_dark = false;
    let mut approach = |round: Round, done: f64, facets: &mut [Facet]| {
        let before = shadings(facets);
        let field = field_of(facets);
        let (own, mut gaps) = gather_from(&receivers, (round, ANY), (&field, None), facets);
        counts.add(&own);
        if !std::mem::replace(&mut gaps_are_dark, true) {
            // What patches say of narrow gaps may be off by any amount. Light comes in from outside.
            darken(&gaps, facets);
        }
        let (mut field, mut seen) = (field_of(facets), sights(&gaps));
        for _ in 0..MOST_SWEEPS {
            let round = (Round::in_gaps(round), UNSETTLED);
            let (own, left) = gather_from(&gaps, round, (&field, seen.as_deref_mut()), facets);
            counts.add(&own);
            field.renew(facets, &gaps);
            gaps = left;
            if gaps.iter().all(Vec::is_empty) {
                break;
            }
        }
        patches.settle(&before, round.tolerance, facets);
        progress(done).then_some(own.contrasts)
    };
    let error = match pass.options.gather_error {
        Some(error) => {
            approach(Round::first(error), 0.8, facets)?;
            error
        }
        None => {
            let mut round = Round::first(COARSEST);
            let mut error = affordable_error(&approach(round, 0.75, facets)?, round, texels);
            if error < MUCH_FINER * COARSEST {
                round = Round::first(error);
                error = affordable_error(&approach(round, 0.8, facets)?, round, texels);
            }
            error
        }
    };
    tracing::debug!(error, "affordable");
    let field = field_of(facets);
    counts.add(&gather_from(&receivers, (Round::last(error), ANY), (&field, None), facets).0);
    if !progress(1.0) {
        return None;
    }
    Some((counts, error))
}

/// The reflected light that elements hold themselves, by facet and element.
fn shadings(facets: &[Facet]) -> Vec<Vec<Shading>> {
    facets.iter().map(|f| f.elements.iter().map(|e| e.indirect).collect()).collect()
}

/// Takes the reflected light of elements away.
fn darken(elements: &[Vec<Receiver>], facets: &mut [Facet]) {
    for (facet, receivers) in facets.iter_mut().zip(elements) {
        for receiver in receivers {
            facet.elements[receiver.element as usize].indirect = Shading::default();
        }
    }
}

/// Glowing regions, in clusters where they are many, and punctual lights, each the strongest first; ties keep the
/// scene's order.
fn emitters(problem: &Problem, facets: &[Facet]) -> (Vec<Emitter>, Vec<Emitter>) {
    let diagonal = problem.tracer.diagonal();
    let mut glowing: Vec<Emitter> =
        cluster::glowing(facets, diagonal).into_iter().map(Emitter::Area).collect();
    let mut lights: Vec<Emitter> = problem.lights.iter().map(|&l| Emitter::Punctual(l)).collect();
    let power = |e: &Emitter| luminance(e.power(diagonal));
    for list in [&mut glowing, &mut lights] {
        list.sort_by(|a, b| power(b).total_cmp(&power(a)));
    }
    (glowing, lights)
}

/// The mean irradiance if all power fell evenly onto all facets.
fn typical_irradiance(glowing: &[Emitter], lights: &[Emitter], facets: &[Facet], diagonal: f64) -> f64 {
    let area: f64 = facets.iter().map(|f| f.elements[0].area).sum();
    let power: f64 = glowing.iter().map(|e| luminance(e.power(diagonal))).sum();
    let from_lights: f64 = lights
        .iter()
        .map(|e| match e.facing() {
            Some(_) => 0.0,
            None => luminance(e.power(diagonal)).min(luminance(e.power(area.sqrt()))),
        })
        .sum();
    0.25 * (power + from_lights) / area.max(f64::MIN_POSITIVE)
}

/// Direct irradiance of each patch as its elements have it.
fn mean_direct(patches: &Patches, facets: &[Facet]) -> Vec<DVec3> {
    patches.patches.iter().map(|p| facets[p.facet as usize].mean(p.element).0).collect()
}

/// Shots until the unshot power is small; `None` when told to stop.
fn shoot_patches(
    patches: &mut Patches,
    problem: &Problem,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Option<()> {
    let at_first = patches.unshot_power().element_sum();
    let enough = patches.energy.emitted.element_sum() * problem.options.unshot_fraction;
    loop {
        patches.energy.unshot = patches.unshot_power();
        let left = patches.energy.unshot.element_sum();
        if left <= enough {
            return Some(());
        }
        // The logarithm falls evenly, since each round of shots absorbs about the same share.
        let done = (at_first / left).ln() / (at_first / enough).ln();
        if !progress(0.4 + 0.3 * done.clamp(0.0, 1.0)) {
            return None;
        }
        if !patches.shoot() {
            return Some(());
        }
    }
}
