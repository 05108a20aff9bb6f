//! Progressive refinement among patches.
//!
//! Patches are few and coarse; they shoot and receive until little is left unshot (Cohen,
//! Chen, Wallace, Greenberg, "A Progressive Refinement Approach to Fast Radiosity Image
//! Generation", 1988). Each pair's exchange factor is found once, when one of the two first
//! shoots, and serves both by reciprocity. What patches send in the end is delivered to the
//! elements by [`deliver`](mod@super::deliver).
//!
//! Exchange factors come from closed forms in few points, so a patch's row does not sum
//! exactly to what leaves it. A fixed set of cosine-distributed rays says which share
//! escapes and which meets backs, and the row is scaled to the rest: no energy is made or
//! lost by quadrature.

use glam::DVec3;
use rayon::prelude::*;

use super::emitter::AreaEmitter;
use super::form_factor::{SurfacePoint, point_to_disk};
use crate::element::{Element, Facet};
use crate::trace::Tracer;

/// Rays that tell what leaves the scene: a square of strata of the hemisphere, this many a side.
const HEMISPHERE_STRATA: u32 = 16;

/// Beyond this many radii of the larger patch, centres stand for patches.
const FAR: f64 = 6.0;

/// Factors below this are found with one shadow ray.
const WEAK_FACTOR: f64 = 2e-4;

/// Factors below this, the larger of a pair's two, are left out; the row's scaling makes up for them.
const NEGLIGIBLE_FACTOR: f64 = 2e-6;

/// A row is scaled by no more than this to close its energy balance.
const MOST_SCALING: f64 = 2.0;

/// A patch: an element that shoots.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Index of its facet.
    pub facet: u32,
    /// Index of its element there.
    pub element: u32,
    /// Its shape.
    shape: AreaEmitter,
    /// Its centre, lifted off the surface.
    pub centre: SurfacePoint,
    /// Four points that stand for its area, lifted.
    points: [DVec3; 4],
    /// From the centre to the farthest corner, metres.
    pub radius: f64,
    /// Square metres.
    pub area: f64,
    /// Diffuse reflectance.
    pub reflectance: DVec3,
    /// Irradiance straight from emitters.
    pub direct: DVec3,
    /// Irradiance reflected at least once.
    pub indirect: DVec3,
    unshot: DVec3,
    /// Shares of what it sends that leave the scene, and that meet backs.
    escaping: f64,
    onto_backs: f64,
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

/// What one patch exchanges with all.
struct Row {
    /// `A_i F_ij`, as the quadrature has it: the same seen from either patch.
    factors: Box<[f32]>,
    /// What the factors are multiplied by so that all of the light arrives that neither escapes nor meets
    /// a back.
    scale: f64,
}

/// The patches and what they exchange.
pub struct Patches {
    /// All patches, in the order of facets.
    pub patches: Vec<Patch>,
    /// `A_i F_ij` for patches `i` that have shot.
    rows: Vec<Option<Row>>,
    /// Where the light went.
    pub energy: Energy,
    /// Reflected shots so far.
    pub shots: u64,
    /// Rays so far.
    pub rays: u64,
}

impl Patches {
    /// Makes patches from the facets' elements that are largest but no larger than `patch_size`.
    #[must_use]
    pub fn new(facets: &[Facet], patch_size: f64, tracer: &Tracer) -> Self {
        let mut patches = Vec::new();
        for (index, facet) in facets.iter().enumerate() {
            let mut stack = vec![0];
            while let Some(element) = stack.pop() {
                let e = &facet.elements[element as usize];
                if e.size() > patch_size * (1.0 + 1e-9) && !e.is_leaf() {
                    stack.extend(e.children().collect::<Vec<_>>().into_iter().rev());
                } else {
                    patches.push(Patch::new(index as u32, facet, element));
                }
            }
        }
        let rays = AtomicCount::default();
        patches.par_iter_mut().for_each(|p| {
            (p.escaping, p.onto_backs) = p.losses(tracer);
            rays.add(u64::from(HEMISPHERE_STRATA * HEMISPHERE_STRATA));
        });
        let rows = (0..patches.len()).map(|_| None).collect();
        Self { patches, rows, energy: Energy::default(), shots: 0, rays: rays.get() }
    }

    /// Takes in what glowing surfaces sent straight to each patch, scaled so that as much arrives as was
    /// sent and neither escaped nor met a back.
    pub fn receive_from_surfaces(&mut self, facets: &[Facet], received: &[DVec3]) {
        let (mut emitted, mut escaped, mut onto_backs) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for patch in &self.patches {
            let power = facets[patch.facet as usize].exitance * patch.area;
            emitted += power;
            escaped += power * patch.escaping;
            onto_backs += power * patch.onto_backs;
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

    /// Area-weighted mean luminance of what arrives, direct and indirect.
    #[must_use]
    pub fn mean_irradiance(&self) -> f64 {
        let (sum, area) = self.patches.iter().fold((0.0, 0.0), |(sum, area), p| {
            (sum + p.area * crate::light::luminance(p.direct + p.indirect), area + p.area)
        });
        if area > 0.0 { sum / area } else { 0.0 }
    }

    /// Power that waits to be shot.
    #[must_use]
    pub fn unshot_power(&self) -> DVec3 {
        self.patches.iter().map(|p| p.unshot * p.area).sum()
    }

    /// The patch with the most unshot power shoots all of it. Its power, or `None` where none is left.
    pub fn shoot(&mut self, tracer: &Tracer) -> Option<DVec3> {
        let power = |p: &Patch| (p.unshot * p.area).element_sum();
        let (shooter, _) = self
            .patches
            .iter()
            .enumerate()
            .map(|(i, p)| (i, power(p)))
            .filter(|&(_, w)| w > 0.0)
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
        if self.rows[shooter].is_none() {
            self.rows[shooter] = Some(self.row(shooter, tracer));
        }
        let row = self.rows[shooter].as_ref()?;
        let patch = &mut self.patches[shooter];
        let shot = std::mem::take(&mut patch.unshot) * patch.area;
        let (escaping, onto_backs) = (patch.escaping, patch.onto_backs);
        let factor = shot / patch.area * row.scale;
        let mut absorbed = DVec3::ZERO;
        for (receiver, &g) in self.patches.iter_mut().zip(&row.factors) {
            if g > 0.0 {
                let arrived = factor * f64::from(g);
                let reflected = arrived * receiver.reflectance;
                receiver.indirect += arrived / receiver.area;
                receiver.unshot += reflected / receiver.area;
                absorbed += arrived - reflected;
            }
        }
        self.energy.absorbed += absorbed + shot * onto_backs;
        self.energy.escaped += shot * escaping;
        self.shots += 1;
        Some(shot)
    }

    /// The exchange factors of one patch with all.
    fn row(&mut self, shooter: usize, tracer: &Tracer) -> Row {
        let rays = AtomicCount::default();
        let (patches, rows) = (&self.patches, &self.rows);
        let factors: Vec<f32> = (0..patches.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|other| match &rows[other] {
                Some(known) => known.factors[shooter],
                None if other == shooter => 0.0,
                None => {
                    let (g, cast) = exchange(&patches[shooter], &patches[other], tracer);
                    rays.add(cast);
                    g as f32
                }
            })
            .collect();
        self.rays += rays.get();
        let patch = &self.patches[shooter];
        let sum = factors.iter().map(|&g| f64::from(g)).sum::<f64>() / patch.area;
        let arriving = 1.0 - patch.escaping - patch.onto_backs;
        let scale = if sum > 0.0 { (arriving / sum).clamp(1.0 / MOST_SCALING, MOST_SCALING) } else { 0.0 };
        Row { factors: factors.into_boxed_slice(), scale }
    }

    /// The irradiance that patch `shooter` gives patch `receiver` for each unit of its radiosity; 0 where
    /// neither has shot.
    #[must_use]
    pub fn factor(&self, shooter: usize, receiver: usize) -> f64 {
        let g = match (&self.rows[shooter], &self.rows[receiver]) {
            (Some(row), _) => f64::from(row.factors[receiver]) * row.scale,
            (None, Some(row)) => f64::from(row.factors[shooter]) * row.scale,
            (None, None) => 0.0,
        };
        g / self.patches[receiver].area
    }
}

/// A counter for parallel loops: integer sums do not depend on the schedule.
#[derive(Default)]
struct AtomicCount(std::sync::atomic::AtomicU64);

impl AtomicCount {
    fn add(&self, n: u64) {
        self.0.fetch_add(n, std::sync::atomic::Ordering::Relaxed);
    }

    fn get(&self) -> u64 {
        self.0.load(std::sync::atomic::Ordering::Relaxed)
    }
}

impl Patch {
    fn new(facet_index: u32, facet: &Facet, element: u32) -> Self {
        let e: &Element = &facet.elements[element as usize];
        let parts = facet.parts(element);
        let centre = facet.centre(element);
        // Gauss's points of a rectangle: 1/√3 of the way to its corners. A concave outline may leave the
        // sample itself only.
        let points = e.samples.map(|s| {
            let sample = &facet.samples[s as usize];
            let inner = e.centroid.lerp(sample.position, 0.577);
            if facet.contains(element, inner) {
                centre.position.lerp(sample.point.position, 0.577)
            } else {
                sample.point.position
            }
        });
        let radius = parts.iter().flatten().map(|p| p.distance(centre.position)).fold(0.0, f64::max);
        Self {
            facet: facet_index,
            element,
            shape: AreaEmitter::new(facet.frame, parts, e.area, DVec3::ONE),
            centre,
            points,
            radius,
            area: e.area,
            reflectance: e.reflectance,
            direct: DVec3::ZERO,
            indirect: DVec3::ZERO,
            unshot: DVec3::ZERO,
            escaping: 0.0,
            onto_backs: 0.0,
        }
    }

    /// Shares of its light that leave the scene and that meet the backs of single-sided surfaces.
    fn losses(&self, tracer: &Tracer) -> (f64, f64) {
        let frame = crate::geom::Frame::new(self.centre.position, self.centre.normal, DVec3::X);
        let (mut escaping, mut behind) = (0_u32, 0_u32);
        for k in 0..HEMISPHERE_STRATA * HEMISPHERE_STRATA {
            let u = (f64::from(k % HEMISPHERE_STRATA) + 0.5) / f64::from(HEMISPHERE_STRATA);
            let v = (f64::from(k / HEMISPHERE_STRATA) + 0.5) / f64::from(HEMISPHERE_STRATA);
            // Neighbouring strata start from different points.
            let point = self.points[((k + 2 * (k / HEMISPHERE_STRATA)) % 4) as usize];
            match tracer.closest_hit(point, frame.cosine_direction(u, v)) {
                None => escaping += 1,
                Some(hit) if tracer.met_back(&hit) => behind += 1,
                Some(_) => {}
            }
        }
        let all = f64::from(HEMISPHERE_STRATA * HEMISPHERE_STRATA);
        (f64::from(escaping) / all, f64::from(behind) / all)
    }
}

/// `A_i F_ij = A_j F_ji` past what stands between, and the number of rays it took.
fn exchange(a: &Patch, b: &Patch, tracer: &Tracer) -> (f64, u64) {
    let d = b.centre.position - a.centre.position;
    let (height_b, height_a) = (a.centre.normal.dot(d), -b.centre.normal.dot(d));
    if height_b <= -b.radius || height_a <= -a.radius {
        return (0.0, 0);
    }
    // The smaller one receives: its few points stand for it better.
    let (receiver, shooter) = if a.area <= b.area { (a, b) } else { (b, a) };
    let distance = d.length();
    if distance > FAR * a.radius.max(b.radius) {
        let f = if shooter.area < 0.01 * distance * distance {
            point_to_disk(receiver.centre, shooter.centre.position, shooter.centre.normal, shooter.area)
        } else {
            shooter.shape.unoccluded(receiver.centre)
        };
        if f < NEGLIGIBLE_FACTOR {
            return (0.0, 0);
        }
        if f < WEAK_FACTOR {
            let hidden = tracer.occluded(receiver.centre.position, shooter.centre.position);
            return (if hidden { 0.0 } else { f * receiver.area }, 1);
        }
        let (seen, rays) = seen_pairs(receiver, shooter, tracer);
        return (f * receiver.area * seen, rays);
    }
    let normal = receiver.centre.normal;
    let f: f64 = receiver
        .points
        .iter()
        .map(|&position| shooter.shape.unoccluded(SurfacePoint { position, normal }))
        .sum::<f64>()
        / 4.0;
    if f <= 0.0 {
        return (0.0, 0);
    }
    let (seen, rays) = seen_pairs(receiver, shooter, tracer);
    (f * receiver.area * seen, rays)
}

/// The kernel-weighted share of point pairs in sight: each point of one with one of the other.
fn seen_pairs(receiver: &Patch, shooter: &Patch, tracer: &Tracer) -> (f64, u64) {
    let (mut seen, mut all, mut rays) = (0.0, 0.0, 0);
    for (i, &p) in receiver.points.iter().enumerate() {
        let q = shooter.points[(i * 3 + 1) % 4];
        let d = q - p;
        let weight = receiver.centre.normal.dot(d).max(0.0) * (-shooter.centre.normal.dot(d)).max(0.0)
            / d.length_squared().powi(2).max(f64::MIN_POSITIVE);
        if weight > 0.0 {
            rays += 1;
            all += weight;
            if !tracer.occluded(p, q) {
                seen += weight;
            }
        }
    }
    (if all > 0.0 { seen / all } else { 1.0 }, rays)
}
