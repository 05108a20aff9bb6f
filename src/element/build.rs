//! Laying out facets and splitting their elements.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::facet::{Facet, Side};
use super::sampling::plane_fit;
use super::{Cut, Element, NONE, Shading};
use crate::cob::{Cob, CobLists};
use crate::geom::hull::convex_hull;
use crate::geom::polygon::{area, clip_rectangle, rectangle};
use crate::geom::{Frame, Ring};
use crate::surface::Surface;

/// Finest division of a facet's side: 2^20 cells.
const FINEST: u32 = 1 << 20;

/// Tiles hold up to this many patches a side.
const PATCHES_A_TILE: f64 = 8.0;

/// A part smaller than this fraction of its rectangle is rounding and left out.
const LEAST_SHARE: f64 = 1e-9;

/// How elements are laid out at first.
#[derive(Clone, Copy, Debug)]
pub struct MeshOptions {
    /// Longest side of an initial patch, metres.
    pub patch_size: f64,
    /// How far samples keep from outlines, metres.
    pub nudge: f64,
    /// How far samples are lifted off their surface, metres.
    pub lift: f64,
}

/// What a surface's material does: needed for each element.
pub trait SurfaceAppearance {
    /// Mean reflectance over a rectangle of a surface, in that surface's plane coordinates.
    fn reflectance(&self, surface: usize, min: DVec2, max: DVec2) -> DVec3;
    /// Mean exitance `π L` likewise.
    fn exitance(&self, surface: usize, min: DVec2, max: DVec2) -> DVec3;
}

/// Lays facets over all regions and splits them into patches.
#[must_use]
pub fn build(surfaces: &[Surface], appearance: &dyn SurfaceAppearance, options: MeshOptions) -> Vec<Facet> {
    let mut facets = Vec::new();
    for (index, surface) in surfaces.iter().enumerate() {
        let back = || surface.smooth.as_ref().map(|s| Arc::new(s.flipped(&surface.frame.flipped())));
        let smooth_back = surface.double_sided.then(back).flatten();
        for (region_index, region) in surface.regions.iter().enumerate() {
            for (min, max) in tiles(&region.rings, options.patch_size) {
                let rings = clip_rings(&region.rings, min, max);
                if area(&rings) <= LEAST_SHARE * (max - min).element_product() {
                    continue;
                }
                let sides: &[Side] =
                    if surface.double_sided { &[Side::Front, Side::Back] } else { &[Side::Front] };
                for &side in sides {
                    let smooth = match side {
                        Side::Front => surface.smooth.clone(),
                        Side::Back => smooth_back.clone(),
                    };
                    let (frame, rings) = seen_from(side, surface.frame, &rings);
                    let triangles: Vec<Ring> = region.triangles.iter().map(|t| t.to_vec()).collect();
                    let (_, parts) = seen_from(side, surface.frame, &clip_rings(&triangles, min, max));
                    let exitance = appearance.exitance(index, min, max);
                    let mut facet = Facet {
                        surface: index,
                        region: region_index,
                        side,
                        frame,
                        smooth,
                        rings,
                        parts,
                        exitance,
                        elements: Vec::new(),
                        samples: Vec::new(),
                        cobs: CobLists::default(),
                        lattice: HashMap::new(),
                        nudge: options.nudge,
                        lift: options.lift,
                    };
                    facet.plant(appearance);
                    facet.split_to(options.patch_size, appearance);
                    facets.push(facet);
                }
            }
        }
    }
    facets
}

/// The frame and rings as seen from a side.
fn seen_from(side: Side, frame: Frame, rings: &[Ring]) -> (Frame, Vec<Ring>) {
    match side {
        Side::Front => (frame, rings.to_vec()),
        Side::Back => {
            let mirrored = rings.iter().map(|r| r.iter().rev().map(|p| DVec2::new(p.x, -p.y)).collect());
            (frame.flipped(), mirrored.collect())
        }
    }
}

/// Rectangles that cover the rings' extent, at most [`PATCHES_A_TILE`] patches a side and not too slender.
fn tiles(rings: &[Ring], patch_size: f64) -> Vec<(DVec2, DVec2)> {
    let (min, max) = rings
        .iter()
        .flatten()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
    let extent = max - min;
    let longest = (2.0 * extent.min_element()).max(patch_size).min(PATCHES_A_TILE * patch_size);
    let count = (extent / longest - 1e-9).ceil().max(DVec2::ONE).as_uvec2();
    let step = extent / count.as_dvec2();
    let corner = |i: u32, j: u32| {
        let at = min + step * DVec2::new(i.into(), j.into());
        DVec2::new(if i == count.x { max.x } else { at.x }, if j == count.y { max.y } else { at.y })
    };
    (0..count.y).flat_map(|j| (0..count.x).map(move |i| (corner(i, j), corner(i + 1, j + 1)))).collect()
}

fn clip_rings(rings: &[Ring], min: DVec2, max: DVec2) -> Vec<Ring> {
    rings.iter().map(|r| clip_rectangle(r, min, max)).filter(|r| r.len() >= 3).collect()
}

/// Area and centroid of rings together.
fn area_and_centroid(rings: &[Ring]) -> (f64, DVec2) {
    let Some(&origin) = rings.iter().flatten().next() else { return (0.0, DVec2::ZERO) };
    let (mut twice_area, mut moment) = (0.0, DVec2::ZERO);
    for ring in rings {
        for i in 0..ring.len() {
            let (a, b) = (ring[i] - origin, ring[(i + 1) % ring.len()] - origin);
            let cross = a.perp_dot(b);
            twice_area += cross;
            moment += (a + b) * cross;
        }
    }
    (twice_area / 2.0, origin + moment / (3.0 * twice_area))
}

impl Facet {
    fn plant(&mut self, appearance: &dyn SurfaceAppearance) {
        let (min, max) = self
            .rings
            .iter()
            .flatten()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        let (rings, parts) = (self.rings.clone(), self.parts.clone());
        self.add_element(NONE, (min, max), [0, 0, FINEST, FINEST], (&rings, &parts), appearance);
    }

    fn split_to(&mut self, patch_size: f64, appearance: &dyn SurfaceAppearance) {
        let mut next = 0;
        while next < self.elements.len() {
            if self.elements[next].size() > patch_size * (1.0 + 1e-9) {
                self.split(next as u32, appearance);
            }
            next += 1;
        }
    }

    /// Splits a leaf into halves along its longer side, or into quarters where it is about square.
    ///
    /// Whether there are parts now: an element at the finest division stays whole.
    pub fn split(&mut self, element: u32, appearance: &dyn SurfaceAppearance) -> bool {
        let e = &self.elements[element as usize];
        let size = e.max - e.min;
        let columns = if size.x > 0.7 * size.y { 2 } else { 1 };
        let rows = if size.y > 0.7 * size.x { 2 } else { 1 };
        self.split_into(element, [columns, rows], appearance)
    }

    /// Splits a leaf into that many columns and rows, each 1 or 2. Returns as [`split`](Self::split).
    pub fn split_into(
        &mut self,
        element: u32,
        [columns, rows]: [u32; 2],
        appearance: &dyn SurfaceAppearance,
    ) -> bool {
        let e = &self.elements[element as usize];
        if !e.is_leaf() {
            return true;
        }
        let [x0, y0, x1, y1] = e.cell;
        if (columns == 2 && x1 - x0 < 2) || (rows == 2 && y1 - y0 < 2) {
            return false;
        }
        let (min, max) = (e.min, e.max);
        let full = [rectangle(min, max).to_vec()];
        let (rings, parts) = match &e.cut {
            Some(cut) => (cut.rings.clone(), cut.parts.clone()),
            None => (full.to_vec(), full.to_vec()),
        };
        let mut children = [NONE; 4];
        let mut count = 0;
        for row in 0..rows {
            for column in 0..columns {
                let cell = [
                    x0 + (x1 - x0) / columns * column,
                    y0 + (y1 - y0) / rows * row,
                    x0 + (x1 - x0) / columns * (column + 1),
                    y0 + (y1 - y0) / rows * (row + 1),
                ];
                let at = |i: u32, n: u32, lo: f64, hi: f64| {
                    if i == n { hi } else { lo + (hi - lo) * f64::from(i) / f64::from(n) }
                };
                let corner = |i, j| DVec2::new(at(i, columns, min.x, max.x), at(j, rows, min.y, max.y));
                let rectangle = (corner(column, row), corner(column + 1, row + 1));
                if let Some(child) = self.add_element(element, rectangle, cell, (&rings, &parts), appearance)
                {
                    children[count] = child;
                    count += 1;
                }
            }
        }
        self.elements[element as usize].children = children;
        count > 0
    }

    fn add_element(
        &mut self,
        parent: u32,
        (min, max): (DVec2, DVec2),
        cell: [u32; 4],
        (rings, parts): (&[Ring], &[Ring]),
        appearance: &dyn SurfaceAppearance,
    ) -> Option<u32> {
        let rings = clip_rings(rings, min, max);
        let (area, centroid) = area_and_centroid(&rings);
        let full_area = (max - min).element_product();
        if area.is_nan() || area <= LEAST_SHARE * full_area {
            return None;
        }
        let corners = rectangle(min, max);
        let [x0, y0, x1, y1] = cell;
        let keys = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        let is_full = area >= full_area * (1.0 - LEAST_SHARE);
        let parts = if is_full { Vec::new() } else { clip_rings(parts, min, max) };
        let samples: [u32; 4] = std::array::from_fn(|k| {
            if is_full {
                self.corner_sample(keys[k], corners[k], 0.5 * (min + max))
            } else {
                self.nearest_sample(&parts, corners[k], centroid)
            }
        });
        let cut = (!is_full).then(|| {
            let positions = samples.map(|s| self.samples[s as usize].position);
            Box::new(Cut {
                hull: convex_hull(parts.iter().flatten().copied().collect()),
                corners_from_samples: plane_fit(positions, min, max),
                parts,
                rings,
            })
        });
        let (low, high) = (self.from_surface_plane(min), self.from_surface_plane(max));
        let reflectance = appearance.reflectance(self.surface, low.min(high), low.max(high));
        self.elements.push(Element {
            parent,
            children: [NONE; 4],
            min,
            max,
            cell,
            area,
            centroid,
            cut,
            samples,
            reflectance,
            cob: Cob::UNINITIALIZED,
            direct: Shading::default(),
            indirect: Shading::default(),
            is_uneven: false,
            is_enclosed: false,
            overhang: None,
        });
        Some((self.elements.len() - 1) as u32)
    }
}
