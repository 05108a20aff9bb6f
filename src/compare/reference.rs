//! A bake against points whose irradiance is known.

use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::baked::check_matched;
use super::figures::{Measured, SetFigures};
use super::npz::Archive;
use super::{BakedScene, CompareError};

/// Points with irradiance, most often from a path tracer.
#[derive(Clone, Debug)]
pub struct ReferencePoints {
    path: PathBuf,
    points: Vec<ReferencePoint>,
}

#[derive(Clone, Copy, Debug)]
struct ReferencePoint {
    position: DVec3,
    normal: DVec3,
    irradiance: DVec3,
    standard_error: DVec3,
    set: Set,
    /// Inside a solid, where nobody sees it.
    is_buried: bool,
}

/// How a point was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    Uniform,
    Contact,
    Detail,
    /// A set that has no figures here.
    Other,
}

impl ReferencePoints {
    /// Reads the NumPy archive at `path`: arrays of one row a point, numbers of any type.
    ///
    /// | array | holds |
    /// |---|---|
    /// | `P`, `N` | position, metres, and unit geometric normal, (n, 3), in world space |
    /// | `E`, `E_se` | irradiance, linear Rec. 709 RGB in the scene's units, and its standard error, (n, 3) |
    /// | `set` | 0 uniform by area, 1 near a contact, 2 near a contact in strong light; others are left out |
    /// | `buried` | not 0 for points inside solids, which are left out |
    ///
    /// Other arrays are not looked at.
    ///
    /// # Errors
    /// Names the file, and the array that is missing or cannot be read.
    pub fn load(path: &Path) -> Result<Self, CompareError> {
        let mut archive = Archive::open(path)?;
        let positions = archive.array("P")?;
        let count = positions.shape.first().copied().unwrap_or(0);
        let positions = positions.triples(count).map_err(|fault| archive.fault("P", fault))?;
        let mut triples = |name: &'static str| -> Result<Vec<[f64; 3]>, CompareError> {
            archive.array(name)?.triples(count).map_err(|fault| archive.fault(name, fault))
        };
        let (normals, irradiance, errors) = (triples("N")?, triples("E")?, triples("E_se")?);
        let mut numbers = |name: &'static str| -> Result<Vec<f64>, CompareError> {
            let array = archive.array(name)?;
            array.numbers(count).map(<[f64]>::to_vec).map_err(|fault| archive.fault(name, fault))
        };
        let (sets, buried) = (numbers("set")?, numbers("buried")?);
        let vectors = positions.iter().zip(&normals).zip(irradiance.iter().zip(&errors));
        let points = vectors.zip(sets.iter().zip(&buried)).map(|(((p, n), (e, se)), (&set, &buried))| {
            ReferencePoint {
                position: DVec3::from_array(*p),
                normal: DVec3::from_array(*n),
                irradiance: DVec3::from_array(*e),
                standard_error: DVec3::from_array(*se),
                set: Set::from(set),
                is_buried: buried != 0.0,
            }
        });
        Ok(Self { points: points.collect(), path: archive.path().to_owned() })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl From<f64> for Set {
    fn from(number: f64) -> Self {
        match number {
            0.0 => Self::Uniform,
            1.0 => Self::Contact,
            2.0 => Self::Detail,
            _ => Self::Other,
        }
    }
}

/// The errors of each set of points; `None` where a set has no point that was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReferenceFigures {
    /// Points, not buried, that lie on no surface of the bake that has a lightmap. They count in no set.
    pub unmatched: usize,
    /// Points spread evenly over all surfaces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uniform: Option<SetFigures>,
    /// Points close to another surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<SetFigures>,
    /// Points close to another surface, in strong light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detail: Option<SetFigures>,
}

impl ReferenceFigures {
    /// The sets that have points, with their names.
    pub fn sets(&self) -> impl Iterator<Item = (&'static str, &SetFigures)> {
        let sets = [("uniform", &self.uniform), ("contact", &self.contact), ("detail", &self.detail)];
        sets.into_iter().filter_map(|(name, figures)| Some((name, figures.as_ref()?)))
    }

    /// The largest `rrmse_corr` of a set, and the set.
    #[must_use]
    pub fn worst(&self) -> Option<(&'static str, f64)> {
        self.sets().map(|(name, set)| (name, set.rrmse_corr)).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Compares a bake's irradiance with the points'.
///
/// # Errors
/// [`CompareError::FewMatched`] where most points do not lie on the bake's surfaces.
pub fn with_reference(
    baked: &BakedScene,
    reference: &ReferencePoints,
) -> Result<ReferenceFigures, CompareError> {
    let seen: Vec<&ReferencePoint> = reference.points.iter().filter(|point| !point.is_buried).collect();
    let measure = |point: &&ReferencePoint| {
        let place = baked.locate(point.position, point.normal)?;
        let value = baked.irradiance_at(&place).filter(|value| value.is_finite())?;
        let (reference, standard_error) = (point.irradiance, point.standard_error);
        Some((point.set, Measured { value, reference, standard_error }))
    };
    let measured: Vec<Option<(Set, Measured)>> = seen.par_iter().map(measure).collect();
    let matched: Vec<(Set, Measured)> = measured.into_iter().flatten().collect();
    check_matched(baked, matched.len(), seen.len())?;
    let of = |asked: Set| {
        let points: Vec<Measured> =
            matched.iter().filter(|(set, _)| *set == asked).map(|(_, point)| *point).collect();
        SetFigures::of(&points)
    };
    Ok(ReferenceFigures {
        unmatched: seen.len() - matched.len(),
        uniform: of(Set::Uniform),
        contact: of(Set::Contact),
        detail: of(Set::Detail),
    })
}
