//! Punctual lights in world space (`KHR_lights_punctual`).
//!
//! A light shines along its node's -Z axis; the node's scale changes neither range nor intensity.
//! Values outside the extension's ranges become the nearest sane ones, with a warning.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::DVec3;

use super::document::{Document, Light, follow};
use super::hierarchy::PlacedNode;
use super::warning::Warnings;
use super::{ImportError, Item, MAX_COORDINATE, PunctualKind, PunctualLight};

/// The inner cone that stands in for one that is not inside the outer: a short fall-off.
const STEEP: f64 = 0.99;

/// The lights of `nodes`, in their order. Lights that cannot shine are left out.
pub(super) fn lights(
    document: &Document,
    nodes: &[PlacedNode],
    warnings: &mut Warnings,
) -> Result<Vec<PunctualLight>, ImportError> {
    let mut lights = Vec::new();
    for node in nodes {
        let Some(reference) = document.nodes.get(node.index).and_then(|node| node.extensions.light.as_ref())
        else {
            continue;
        };
        let from = || document.node_item(node.index);
        let entry = follow(&document.lights, reference.light, "light", from)?;
        let item = Item::new("light", reference.light, entry.name.as_deref());
        lights.extend(light(entry, &item, *node, warnings));
    }
    Ok(lights)
}

fn light(entry: &Light, item: &Item, node: PlacedNode, warnings: &mut Warnings) -> Option<PunctualLight> {
    let colour = DVec3::from_array(entry.color.unwrap_or([1.0; 3]));
    let intensity = colour.max(DVec3::ZERO) * entry.intensity.unwrap_or(1.0);
    if colour.min_element() < 0.0 {
        warnings.about(item, "negative colour, taken as 0");
    }
    if !(intensity.is_finite() && intensity.min_element() >= 0.0) {
        warnings.about(item, "its intensity is negative or not finite, so it is left out");
        return None;
    }
    let position = node.world.translation;
    if !position.is_finite() || position.abs().max_element() > MAX_COORDINATE {
        warnings.about(item, "it is too far away or nowhere, so it is left out");
        return None;
    }
    let direction = node.world.transform_vector3(DVec3::NEG_Z).try_normalize();
    let kind = match (entry.kind.as_str(), direction) {
        ("point", _) => PunctualKind::Point { position, range: range(entry, item, warnings) },
        ("directional", Some(direction)) => PunctualKind::Directional { direction },
        ("spot", Some(direction)) => {
            let range = range(entry, item, warnings);
            let (inner_cone, outer_cone) = cones(entry, item, warnings);
            PunctualKind::Spot { position, direction, range, inner_cone, outer_cone }
        }
        ("directional" | "spot", None) => {
            warnings.about(item, "its node's scale leaves it no direction, so it is left out");
            return None;
        }
        _ => {
            warnings.about(item, "its type is none of point, spot and directional, so it is left out");
            return None;
        }
    };
    Some(PunctualLight { kind, intensity, node: node.index })
}

fn range(entry: &Light, item: &Item, warnings: &mut Warnings) -> f64 {
    match entry.range {
        None => f64::INFINITY,
        Some(range) if range > 0.0 => range,
        Some(_) => {
            warnings.about(item, "its range is not above 0 and counts as unlimited");
            f64::INFINITY
        }
    }
}

/// Inner and outer half angle, `0 <= inner < outer <= pi / 2`.
fn cones(entry: &Light, item: &Item, warnings: &mut Warnings) -> (f64, f64) {
    let spot = entry.spot.as_ref();
    let inner = spot.and_then(|spot| spot.inner_cone_angle).unwrap_or(0.0);
    let outer = spot.and_then(|spot| spot.outer_cone_angle).unwrap_or(FRAC_PI_4);
    let sane_outer = if outer > 0.0 { outer.min(FRAC_PI_2) } else { FRAC_PI_4 };
    // An outer cone of exactly pi / 2, written in single precision, is a little above it.
    if !(outer > 0.0 && outer <= FRAC_PI_2 + 1e-6) {
        let text = format!("its outer cone angle is not between 0 and pi / 2 and counts as {sane_outer:.4}");
        warnings.about(item, text);
    }
    if inner >= 0.0 && inner < sane_outer {
        return (inner, sane_outer);
    }
    let sane_inner = if inner > 0.0 { STEEP * sane_outer } else { 0.0 };
    let text = format!("its inner cone angle is not between 0 and the outer's and counts as {sane_inner:.4}");
    warnings.about(item, text);
    (sane_inner, sane_outer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    fn read(json: &str) -> (Option<PunctualLight>, Vec<String>) {
        let mut warnings = Warnings::default();
        let entry: Light = serde_json::from_str(json).unwrap();
        let node = PlacedNode { index: 7, world: DAffine3::from_scale(DVec3::new(2.0, 3.0, 4.0)) };
        let light = light(&entry, &Item::new("light", 0, None), node, &mut warnings);
        (light, warnings.into_sentences())
    }

    #[test]
    fn defaults_are_the_extensions() {
        let (light, warnings) = read(r#"{"type": "spot", "intensity": 5, "color": [1, 0.5, 0]}"#);
        let expected = PunctualKind::Spot {
            position: DVec3::ZERO,
            direction: DVec3::NEG_Z,
            range: f64::INFINITY,
            inner_cone: 0.0,
            outer_cone: FRAC_PI_4,
        };
        let intensity = DVec3::new(5.0, 2.5, 0.0);
        assert_eq!(light, Some(PunctualLight { kind: expected, intensity, node: 7 }));
        assert!(warnings.is_empty(), "{warnings:?}");
    }

    #[test]
    fn bad_values_warn_and_become_sane() {
        let spot = |inner: f64, outer: f64| {
            let json = format!(
                r#"{{"type": "spot", "spot": {{"innerConeAngle": {inner}, "outerConeAngle": {outer}}}}}"#
            );
            let (light, warnings) = read(&json);
            let Some(PunctualLight { kind: PunctualKind::Spot { inner_cone, outer_cone, .. }, .. }) = light
            else {
                panic!("no spot: {json}")
            };
            (inner_cone, outer_cone, warnings.len())
        };
        assert_eq!(spot(0.5, 0.25), (STEEP * 0.25, 0.25, 1));
        assert_eq!(spot(0.5, 0.5), (STEEP * 0.5, 0.5, 1));
        assert_eq!(spot(-0.5, 0.5), (0.0, 0.5, 1));
        assert_eq!(spot(0.1, 0.0), (0.1, FRAC_PI_4, 1));
        assert_eq!(spot(0.1, 3.0), (0.1, FRAC_PI_2, 1));

        let (light, warnings) = read(r#"{"type": "point", "range": 0}"#);
        let kind = PunctualKind::Point { position: DVec3::ZERO, range: f64::INFINITY };
        assert_eq!((light.unwrap().kind, warnings.len()), (kind, 1));
        for left_out in [r#"{"type": "point", "intensity": -1}"#, r#"{"type": "area"}"#] {
            let (light, warnings) = read(left_out);
            assert!(light.is_none() && warnings.len() == 1, "{left_out}");
        }
    }
}
