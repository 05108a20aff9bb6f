//! What patches exchange: form factors counted by rays.
//!
//! Each patch sends well-distributed rays from all of its area, cosine-distributed; the share
//! that meets another patch is its form factor to it (Malley, "A Shading Method for
//! Computer Generated Images", 1988; Maxwell, Bailey and Goldschmidt 1986). A pair's two
//! counts are joined by reciprocity, `A_i F_ij = A_j F_ji`, each weighed by its rays per
//! area; then all are scaled so that both hold at once: reciprocity, and that each patch
//! loses what its own rays lost. So no energy is made or lost, and even light stays even.

use glam::DVec3;
use rayon::prelude::*;

use super::emitter::{fan_area, point_in_fan};
use super::locate::{Descent, FacetLocator};
use super::patches::Patch;
use super::sequence;
use crate::element::{Facet, NONE};
use crate::trace::Tracer;

/// Rays of a patch of full size.
const MOST_RAYS: u32 = 1024;

/// Rays of the smallest patch.
const LEAST_RAYS: u32 = 64;

/// Rounds of scaling; what is left after them is scaled row by row.
const SCALING_ROUNDS: u32 = 12;

/// Factors are scaled by no more than this.
const MOST_SCALING: f64 = 4.0;

/// Form factors between all patches.
pub struct Exchange {
    rows: Vec<Row>,
    /// Rays cast.
    pub rays: u64,
}

/// What one patch sends and receives.
#[derive(Default)]
struct Row {
    /// The patches that it sees, ascending, and `A_i F_ij` as scaled for both.
    factors: Vec<(u32, f32)>,
    /// What the factors are multiplied by when this patch shoots: the scaling's remainder.
    remainder: f64,
    /// Shares of what it sends that leave the scene, and that meet backs.
    escaping: f64,
    onto_backs: f64,
}

/// What the rays of one patch met.
struct Counts {
    rays: u32,
    /// The share of the patch that is there.
    coverage: f64,
    escaping: u32,
    onto_backs: u32,
    /// Patches, ascending, and how often they were met.
    met: Vec<(u32, u32)>,
}

impl Exchange {
    /// Casts the rays of all `patches`, of which one of `full_size` square metres casts the most. The area of a patch
    /// on a screen becomes what of it stops light.
    #[must_use]
    pub fn new(
        facets: &[Facet],
        patches: &mut [Patch],
        locator: &FacetLocator,
        tracer: &Tracer,
        full_size: f64,
    ) -> Self {
        let mut patch_of: Vec<Vec<u32>> = facets.iter().map(|f| vec![NONE; f.elements.len()]).collect();
        for (index, patch) in patches.iter().enumerate() {
            patch_of[patch.facet as usize][patch.element as usize] = index as u32;
        }
        let descents: Vec<Descent> = facets.par_iter().map(Descent::new).collect();
        let target = Target { tracer, locator, patch_of: &patch_of, descents: &descents };
        let counts: Vec<Counts> = patches
            .par_iter()
            .enumerate()
            .map(|(index, patch)| {
                let rays = (f64::from(MOST_RAYS) * (patch.area / full_size)).round();
                let rays = (rays as u32).clamp(LEAST_RAYS, MOST_RAYS);
                target.count(&facets[patch.facet as usize], patch.element, rays, index as u32)
            })
            .collect();
        for (patch, counts) in patches.iter_mut().zip(&counts) {
            patch.area *= counts.coverage;
        }
        let mut rows = joined(patches, &counts);
        scale(&mut rows, patches);
        Self { rows, rays: counts.iter().map(|c| u64::from(c.rays)).sum() }
    }

    /// Two patches of one square metre that see nothing but each other.
    #[cfg(test)]
    pub(super) fn face_to_face() -> Self {
        let row = |to| Row { factors: vec![(to, 1.0)], remainder: 1.0, escaping: 0.0, onto_backs: 0.0 };
        Self { rows: vec![row(1), row(0)], rays: 0 }
    }

    /// The patches that receive from `shooter`, with the power that each receives per unit of its radiosity.
    pub fn received(&self, shooter: usize) -> impl Iterator<Item = (usize, f64)> {
        let row = &self.rows[shooter];
        row.factors.iter().map(move |&(to, g)| (to as usize, f64::from(g) * row.remainder))
    }

    /// Shares of what a patch sends that leave the scene, and that meet the backs of single-sided surfaces.
    #[must_use]
    pub fn losses(&self, patch: usize) -> (f64, f64) {
        (self.rows[patch].escaping, self.rows[patch].onto_backs)
    }
}

/// What rays are cast at.
struct Target<'a> {
    tracer: &'a Tracer,
    locator: &'a FacetLocator,
    patch_of: &'a [Vec<u32>],
    descents: &'a [Descent],
}

impl Target<'_> {
    fn count(&self, facet: &Facet, element: u32, rays: u32, scramble: u32) -> Counts {
        let parts = facet.parts(element);
        let mut met = Vec::with_capacity(rays as usize);
        let (mut escaping, mut onto_backs, mut absent) = (0, 0, 0);
        let has_screens = self.tracer.has_screens();
        let lift = facet.frame.normal * self.tracer.margin();
        for index in 0..rays {
            let [u, v, s, t] = sequence::point(index, scramble.wrapping_mul(4));
            let origin = point_in_parts(&parts, s, t) + lift;
            let direction = facet.frame.cosine_direction(u, v);
            let [chance, own_chance] =
                if has_screens { sequence::scattered(index, scramble) } else { [0.0; 2] };
            if has_screens && self.tracer.own_coverage(origin, facet.frame.normal) <= own_chance {
                absent += 1;
                continue;
            }
            match self.tracer.stopped_by(origin, direction, chance) {
                None => escaping += 1,
                Some(hit) => match self.locator.find(self.tracer, &hit, origin + direction * hit.distance) {
                    None => onto_backs += 1,
                    Some((facet, p)) => {
                        let of = &self.patch_of[facet];
                        let element = self.descents[facet].find(p, |e| of[e as usize] != NONE);
                        met.push(of[element as usize]);
                    }
                },
            }
        }
        met.sort_unstable();
        let met = met.chunk_by(|a, b| a == b).map(|c| (c[0], c.len() as u32)).collect();
        if absent == rays {
            // Hardly anything of it is there; what little there is sends its light away.
            return Counts { rays: 1, coverage: 0.5 / f64::from(rays), escaping: 1, onto_backs, met };
        }
        let present = rays - absent;
        let coverage = f64::from(present) / f64::from(rays);
        Counts { rays: present, coverage, escaping, onto_backs, met }
    }
}

/// Maps the unit square onto convex polygons together, area for area.
fn point_in_parts(parts: &[Vec<DVec3>], s: f64, t: f64) -> DVec3 {
    let whole: f64 = parts.iter().map(|p| fan_area(p)).sum();
    let mut target = s * whole;
    for (index, part) in parts.iter().enumerate() {
        let area = fan_area(part);
        if area > 0.0 && (target <= area || index + 1 == parts.len()) {
            return point_in_fan(part, (target / area).min(1.0), t);
        }
        target -= area;
    }
    parts.iter().flatten().next().copied().unwrap_or_default()
}

/// `A_i F_ij` of all pairs of which one saw the other.
fn joined(patches: &[Patch], counts: &[Counts]) -> Vec<Row> {
    let mut seen: Vec<Vec<(u32, u32)>> = counts.iter().map(|c| c.met.clone()).collect();
    for (from, counts) in counts.iter().enumerate() {
        for &(to, n) in &counts.met {
            seen[to as usize].push((from as u32, n));
        }
    }
    let density = |i: usize| f64::from(counts[i].rays) / patches[i].area;
    seen.into_par_iter()
        .enumerate()
        .map(|(i, mut seen)| {
            seen.sort_unstable();
            let factors = seen.chunk_by(|a, b| a.0 == b.0).map(|pair| {
                let n: u32 = pair.iter().map(|p| p.1).sum();
                let to = pair[0].0;
                (to, (f64::from(n) / (density(i) + density(to as usize))) as f32)
            });
            let share = |n: u32| f64::from(n) / f64::from(counts[i].rays);
            Row {
                factors: factors.collect(),
                remainder: 1.0,
                escaping: share(counts[i].escaping),
                onto_backs: share(counts[i].onto_backs),
            }
        })
        .collect()
}

/// Scales rows and columns alike until each row sums to what its patch does not lose (Sinkhorn's scaling, for a
/// symmetric matrix).
fn scale(rows: &mut [Row], patches: &[Patch]) {
    // Where all is lost, rounding may leave a little less than nothing.
    let arriving = |(row, patch): (&Row, &Patch)| patch.area * (1.0 - row.escaping - row.onto_backs).max(0.0);
    let arriving: Vec<f64> = rows.iter().zip(patches).map(arriving).collect();
    let mut scales = vec![1.0; rows.len()];
    let sum = |row: &Row, scales: &[f64]| -> f64 {
        row.factors.iter().map(|&(to, g)| f64::from(g) * scales[to as usize]).sum()
    };
    for _ in 0..SCALING_ROUNDS {
        scales = rows
            .par_iter()
            .zip(&arriving)
            .enumerate()
            .map(|(i, (row, &arriving))| {
                let sum = scales[i] * sum(row, &scales);
                let factor = if sum > 0.0 { (arriving / sum).sqrt() } else { 1.0 };
                (scales[i] * factor).clamp(1.0 / MOST_SCALING, MOST_SCALING)
            })
            .collect();
    }
    rows.par_iter_mut().zip(&arriving).enumerate().for_each(|(i, (row, &arriving))| {
        let sum = scales[i] * sum(row, &scales);
        row.remainder = if sum > 0.0 { arriving / sum } else { 0.0 };
        row.factors.iter_mut().for_each(|(to, g)| *g *= (scales[i] * scales[*to as usize]) as f32);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(area: f64) -> Patch {
        Patch {
            facet: 0,
            element: 0,
            area,
            reflectance: DVec3::ONE,
            direct: DVec3::ZERO,
            indirect: DVec3::ZERO,
            unshot: DVec3::ZERO,
        }
    }

    fn row(factors: &[(u32, f32)], escaping: f64, onto_backs: f64) -> Row {
        Row { factors: factors.to_vec(), remainder: 1.0, escaping, onto_backs }
    }

    /// Scaled rows hand out what their patches do not lose, and as much one way as the other.
    #[test]
    fn scaling_balances_rows_and_keeps_them_symmetric() {
        let patches = [patch(1.0), patch(2.0), patch(0.5)];
        let mut rows = [
            row(&[(1, 0.4), (2, 0.2)], 0.25, 0.0),
            row(&[(0, 0.4), (2, 0.3)], 0.5, 0.1),
            row(&[(0, 0.2), (1, 0.3)], 0.0, 0.0),
        ];
        scale(&mut rows, &patches);
        for (row, patch) in rows.iter().zip(&patches) {
            let sum: f64 = row.factors.iter().map(|&(_, g)| f64::from(g) * row.remainder).sum();
            let kept = 1.0 - row.escaping - row.onto_backs;
            assert!((sum - patch.area * kept).abs() < 1e-6, "{sum}");
        }
        assert!((rows[0].factors[0].1 - rows[1].factors[0].1).abs() < 1e-6);
    }

    /// 1 − 0.9 − 0.1 is a little less than nothing.
    #[test]
    fn a_patch_that_loses_all_sends_nothing() {
        let patches = [patch(1.0), patch(1.0)];
        let mut rows = [row(&[(1, 0.1)], 0.9, 0.1), row(&[(0, 0.1)], 0.0, 0.5)];
        scale(&mut rows, &patches);
        let sums = rows.each_ref().map(|r| f64::from(r.factors[0].1) * r.remainder);
        assert!(sums.iter().all(|s| s.is_finite()) && sums[0] == 0.0, "{sums:?}");
    }
}
