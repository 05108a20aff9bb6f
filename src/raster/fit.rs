//! Texel values whose bilinear interpolation comes closest to the light.
//!
//! Where a shadow's edge crosses a texel, neither the value in its middle nor the mean over its
//! square is what a bilinear lookup should find there. The texels beside the edge are chosen so
//! that the interpolation's squared error over sample points is least, all other texels being
//! given. The normal equations are solved by Gauss–Seidel sweeps; a weak pull towards the mean
//! over the texel keeps those in place that few samples tell about.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

/// Sweeps over the free texels; each halves the remaining error, about.
const SWEEPS: usize = 12;

/// The pull towards the mean, in samples.
const PULL: f64 = 0.1;

/// Light known at a place of the page.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightSample {
    /// Texels; centres lie at halves.
    pub at: DVec2,
    /// Irradiance.
    pub light: DVec3,
}

/// A texel's value before and after.
#[derive(Clone, Copy, Debug)]
pub(super) struct FitTexel {
    /// Column and row.
    pub cell: [u32; 2],
    /// Irradiance.
    pub value: DVec3,
    /// Whether the fit may change it.
    pub is_free: bool,
}

/// A sample's share of each of the four texels around it.
struct Tap {
    texels: [u32; 4],
    weights: [f64; 4],
    residual: DVec3,
}

/// Changes the free texels' values so that the interpolation fits the samples. No value becomes negative.
pub(super) fn fit(texels: &mut [FitTexel], samples: &[LightSample]) {
    let index: HashMap<[u32; 2], u32> = texels.iter().enumerate().map(|(i, t)| (t.cell, i as u32)).collect();
    let mut taps: Vec<Tap> = samples.iter().filter_map(|s| tap(s, &index)).collect();
    for tap in &mut taps {
        let found: DVec3 =
            tap.texels.iter().zip(tap.weights).map(|(&t, w)| texels[t as usize].value * w).sum();
        tap.residual -= found;
    }
    let mut of_texel: HashMap<u32, Vec<(u32, f64)>> = HashMap::new();
    for (i, tap) in taps.iter().enumerate() {
        for (&t, w) in tap.texels.iter().zip(tap.weights) {
            if texels[t as usize].is_free && w > 0.0 {
                of_texel.entry(t).or_default().push((i as u32, w));
            }
        }
    }
    let mut free: Vec<(u32, Vec<(u32, f64)>)> = of_texel.into_iter().collect();
    free.sort_unstable_by_key(|f| f.0);
    let start: Vec<DVec3> = texels.iter().map(|t| t.value).collect();
    for _ in 0..SWEEPS {
        for (t, shares) in &free {
            let value = &mut texels[*t as usize].value;
            let (mut sum, mut norm) = (PULL * (start[*t as usize] - *value), PULL);
            for &(s, w) in shares {
                sum += w * taps[s as usize].residual;
                norm += w * w;
            }
            let change = (*value + sum / norm).max(DVec3::ZERO) - *value;
            *value += change;
            for &(s, w) in shares {
                taps[s as usize].residual -= w * change;
            }
        }
    }
}

/// The four texels around a sample; `None` where one of them is not of this chart.
fn tap(sample: &LightSample, index: &HashMap<[u32; 2], u32>) -> Option<Tap> {
    let corner = sample.at - 0.5;
    let low = corner.floor().max(DVec2::ZERO);
    let f = (corner - low).clamp(DVec2::ZERO, DVec2::ONE);
    let (x, y) = (low.x as u32, low.y as u32);
    let cells = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]];
    let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
    let mut texels = [0; 4];
    for ((texel, cell), weight) in texels.iter_mut().zip(cells).zip(weights) {
        match index.get(&cell) {
            Some(&t) => *texel = t,
            // A neighbour that the lookup does not touch may be missing; it then points at any texel.
            None if weight < 1e-9 => {}
            None => return None,
        }
    }
    Some(Tap { texels, weights, residual: sample.light })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: &[f64]) -> Vec<FitTexel> {
        (0..2)
            .flat_map(|y| {
                values.iter().enumerate().map(move |(x, &v)| FitTexel {
                    cell: [x as u32, y],
                    value: DVec3::splat(v),
                    is_free: true,
                })
            })
            .collect()
    }

    fn error(texels: &[FitTexel], samples: &[LightSample]) -> f64 {
        let index = texels.iter().enumerate().map(|(i, t)| (t.cell, i as u32)).collect();
        samples
            .iter()
            .filter_map(|s| tap(s, &index))
            .map(|t| {
                let found: f64 =
                    t.texels.iter().zip(t.weights).map(|(&i, w)| texels[i as usize].value.x * w).sum();
                (found - t.residual.x).powi(2)
            })
            .sum()
    }

    fn samples_of(light: impl Fn(f64) -> f64) -> Vec<LightSample> {
        (0..80)
            .flat_map(|i| {
                (0..4).map(move |j| DVec2::new(0.5 + f64::from(i) / 16.0, 0.6 + 0.2 * f64::from(j)))
            })
            .map(|at| LightSample { at, light: DVec3::splat(light(at.x)) })
            .collect()
    }

    /// The fit of a shadow's edge is better than both the middle's value and the mean over the texel.
    #[test]
    fn an_edge_is_met_better_than_by_means() {
        let samples = samples_of(|x| f64::from(x > 2.8));
        let means = [0.0, 0.0, 0.2, 1.0, 1.0, 1.0];
        let mut texels = row(&means);
        let before = error(&texels, &samples);
        fit(&mut texels, &samples);
        let after = error(&texels, &samples);
        assert!(after < 0.9 * before, "{before} {after}");
        assert!(texels.iter().all(|t| t.value.x >= 0.0 && t.value.x < 1.4));
    }

    /// What bilinear interpolation can show is left as it is.
    #[test]
    fn a_linear_light_stays() {
        let samples = samples_of(|x| 1.0 + x);
        let mut texels = row(&[1.5, 2.5, 3.5, 4.5, 5.5, 6.5]);
        fit(&mut texels, &samples);
        for t in &texels {
            assert!((t.value.x - (1.5 + f64::from(t.cell[0]))).abs() < 1e-9);
        }
    }

    #[test]
    fn fixed_texels_are_left_alone() {
        let samples = samples_of(|x| f64::from(x > 2.8));
        let mut texels = row(&[0.0, 0.0, 0.2, 1.0, 1.0, 1.0]);
        texels.iter_mut().for_each(|t| t.is_free = t.cell[0] == 2);
        fit(&mut texels, &samples);
        assert!(
            texels
                .iter()
                .all(|t| t.is_free || t.value.x == [0.0, 0.0, 0.2, 1.0, 1.0, 1.0][t.cell[0] as usize])
        );
    }
}
