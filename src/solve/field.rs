//! What every point of the scene reflects: the light that rays gather.
//!
//! Rays ask millions of times, so the trees of all facets lie in one array, and a grid over each side of a surface
//! says where to start: mostly at the leaf itself.

use std::collections::HashMap;

use glam::{DVec2, DVec3, UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::hot::HotSpots;
use super::locate::{Descent, FacetLocator, Node};
use super::patches::Receiver;
use crate::element::{Element, Facet, NONE, Side};
use crate::geom::Frame;
use crate::light::luminance;
use crate::surface::Surface;
use crate::trace::{Hit, Tracer};

/// About this many cells stand for each leaf.
const CELLS_A_LEAF: f64 = 4.0;

/// Surfaces face each other across a gap where the cosine between their normals is less than this.
const FACING: f64 = -0.7;

/// Set in the number of a leaf, which is that of its patch; the others number nodes.
const LEAF: u32 = 1 << 31;

/// A cell that several facets share.
const SHARED: u32 = u32::MAX;

/// Reflected radiosity `ρ E` as the elements have it, as smooth as there, but in hot spots no more than a cap.
///
/// What these reflect beyond it would be met by a ray here and none there. They shine as
/// [emitters](super::hot) instead.
pub struct RadiosityField<'a> {
    locator: &'a FacetLocator,
    /// By surface, front then back.
    sides: Vec<SideField>,
    /// By cell of all sides: a node, a leaf or [`SHARED`].
    starts: Vec<u32>,
    nodes: Vec<FieldNode>,
    patches: Vec<FieldPatch>,
    /// By facet: a node or a leaf.
    roots: Vec<u32>,
    /// Of hot leaves, by the number of their patch: what the cap took.
    excess: HashMap<u32, FieldPatch>,
    reading: Reading,
}

/// How what elements received becomes radiosity.
#[derive(Clone, Copy)]
struct Reading {
    /// Of direct light.
    scale: DVec3,
    /// Luminance of what rays read, at most.
    cap: f64,
}

/// A place that a ray met. It is the same in every field of elements that were not split since.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    patch: u32,
    /// Metres from the surface's least corner.
    at: Vec2,
}

/// One side of a surface.
struct SideField {
    /// `y` runs the other way on the back, as in facets.
    frame: Frame,
    /// What all coordinates here are relative to: the least corner, metres.
    min: DVec2,
    cells_per_metre: Vec2,
    /// None where there is no such side.
    cells: UVec2,
    /// Of its cells, among all.
    first: u32,
}

struct FieldNode {
    middle: Vec2,
    /// By quadrant: left or right, plus two for above.
    children: [u32; 4],
}

#[derive(Clone, Copy, Default)]
struct FieldPatch {
    min: Vec2,
    per_size: Vec2,
    corners: [Vec3; 4],
    /// As of [`Shading`](crate::element::Shading).
    bulge: Vec3,
    /// What faces it from no farther than this is in a gap that it does not shine into, metres.
    gap: f32,
}

impl<'a> RadiosityField<'a> {
    /// Takes down what `facets` received, their direct light times `direct_scale`; what `hot` spots reflect beyond
    /// their cap is set apart.
    #[must_use]
    pub fn new(
        locator: &'a FacetLocator,
        surfaces: &[Surface],
        facets: &[Facet],
        hot: &HotSpots,
        direct_scale: DVec3,
    ) -> Self {
        let mut field = Self {
            locator,
            sides: Vec::with_capacity(2 * surfaces.len()),
            starts: Vec::new(),
            nodes: Vec::new(),
            patches: Vec::new(),
            roots: Vec::with_capacity(facets.len()),
            excess: HashMap::new(),
            reading: Reading { scale: direct_scale, cap: hot.cap },
        };
        let trees: Vec<Tree> = facets
            .par_iter()
            .zip(hot.leaves(facets))
            .map(|(facet, is_hot)| Tree::new(facet, &surfaces[facet.surface], &is_hot, field.reading))
            .collect();
        trees.into_iter().for_each(|tree| field.take(tree));
        let mut first = 0;
        for (index, surface) in surfaces.iter().enumerate() {
            let own: Vec<usize> = (first..facets.len()).take_while(|&f| facets[f].surface == index).collect();
            first += own.len();
            for side in [Side::Front, Side::Back] {
                field.add_side(index, surface, side, &own, facets);
            }
        }
        field
    }

    /// Takes down anew what these elements received, by facet; none was split since.
    pub fn renew(&mut self, facets: &[Facet], elements: &[Vec<Receiver>]) {
        let of = |(index, (facet, elements)): (usize, (&Facet, &Vec<Receiver>))| -> Vec<_> {
            let min = self.sides[side_number((index, facet.surface, facet.side))].min;
            let leaves = elements.iter().flat_map(|receiver| facet.leaves_of(receiver.element));
            let read = |leaf: u32| {
                let middle = facet.elements[leaf as usize].centroid - min;
                let number = self.patch_from(self.roots[index], middle.as_vec2());
                let is_hot = self.excess.contains_key(&number);
                (number, self.reading.of((facet, leaf), min, is_hot))
            };
            leaves.map(read).collect()
        };
        let renewed: Vec<_> = facets.par_iter().zip(elements).enumerate().map(of).collect();
        for (number, (patch, excess)) in renewed.into_iter().flatten() {
            self.patches[number as usize] = patch;
            self.excess.extend(excess.map(|excess| (number, excess)));
        }
    }

    fn take(&mut self, tree: Tree) {
        let (nodes, patches) = (self.nodes.len() as u32, self.patches.len() as u32);
        let numbered = |number: u32| number + if number & LEAF == 0 { nodes } else { patches };
        self.roots.push(numbered(tree.root));
        self.nodes.extend(
            tree.nodes.into_iter().map(|node| FieldNode { children: node.children.map(numbered), ..node }),
        );
        self.patches.extend(tree.patches);
        self.excess.extend(tree.excess.into_iter().map(|(patch, excess)| (patch + patches, excess)));
    }

    /// Lays the grid over a side whose `facets` are these among `all`.
    fn add_side(&mut self, index: usize, surface: &Surface, side: Side, facets: &[usize], all: &[Facet]) {
        let (frame, min, extent) = plane_of(surface, side);
        let leaves: usize =
            facets.iter().filter(|&&f| all[f].side == side).map(|&f| all[f].leaves().count()).sum();
        let first = self.starts.len() as u32;
        if leaves == 0 {
            self.sides.push(SideField { frame, min, cells_per_metre: Vec2::ZERO, cells: UVec2::ZERO, first });
            return;
        }
        let wanted = CELLS_A_LEAF * leaves as f64;
        let size = (extent.element_product() / wanted).sqrt();
        let cells = (extent / size).ceil().clamp(DVec2::ONE, DVec2::splat(wanted)).as_uvec2();
        let size = extent / cells.as_dvec2();
        for y in 0..cells.y {
            for x in 0..cells.x {
                let low = size * UVec2::new(x, y).as_dvec2();
                let start = self
                    .only_facet(index, side, (min + low, min + low + size))
                    .map(|facet| self.start_for(self.roots[facet], low.as_vec2(), size.as_vec2()));
                self.starts.push(start.unwrap_or(SHARED));
            }
        }
        self.sides.push(SideField { frame, min, cells_per_metre: (1.0 / size).as_vec2(), cells, first });
    }

    /// The only facet of a side that reaches between these corners, if it is one.
    fn only_facet(&self, surface: usize, side: Side, (low, high): (DVec2, DVec2)) -> Option<usize> {
        match side {
            Side::Front => self.locator.only_front(surface, low, high),
            Side::Back => {
                let (low, high) = (DVec2::new(low.x, -high.y), DVec2::new(high.x, -low.y));
                self.locator.only_front(surface, low, high).map(|front| front + 1)
            }
        }
    }

    /// The last node that holds all of a cell.
    fn start_for(&self, root: u32, low: Vec2, size: Vec2) -> u32 {
        let corners = [low, low + Vec2::new(size.x, 0.0), low + Vec2::new(0.0, size.y), low + size];
        let mut at = root;
        while at & LEAF == 0 {
            let [next, others @ ..] = corners.map(|p| self.nodes[at as usize].child(p));
            if others != [next; 3] {
                break;
            }
            at = next;
        }
        at
    }

    /// Mean radiosity of an element that was set apart.
    #[must_use]
    pub fn mean_excess(&self, index: usize, facet: &Facet, element: u32) -> DVec3 {
        let (mut sum, mut area) = (DVec3::ZERO, 0.0);
        for leaf in facet.leaves_of(element) {
            let e = &facet.elements[leaf as usize];
            let excess = self.excess_patch((index, facet.surface, facet.side), e.centroid);
            sum += e.area * excess.map_or(Vec3::ZERO, FieldPatch::mean).as_dvec3();
            area += e.area;
        }
        (sum / area).max(DVec3::ZERO)
    }

    /// Radiosity that was set apart at a place of a facet, of which index, surface and side are given.
    #[must_use]
    pub fn excess_at(&self, facet: (usize, usize, Side), p: DVec2) -> DVec3 {
        let min = self.sides[side_number(facet)].min;
        let excess = self.excess_patch(facet, p).map_or(Vec3::ZERO, |e| e.at((p - min).as_vec2()));
        excess.as_dvec3().max(DVec3::ZERO)
    }

    fn excess_patch(&self, facet: (usize, usize, Side), p: DVec2) -> Option<&FieldPatch> {
        let p = (p - self.sides[side_number(facet)].min).as_vec2();
        self.excess.get(&self.patch_from(self.roots[facet.0], p))
    }

    /// The patch at `p` under a node or leaf.
    #[inline]
    fn patch_from(&self, mut at: u32, p: Vec2) -> u32 {
        while at & LEAF == 0 {
            at = self.nodes[at as usize].child(p);
        }
        at & !LEAF
    }

    /// Whether a ray met this surface.
    #[must_use]
    pub fn is_of(&self, hit: &Hit, surface: usize) -> bool {
        self.locator.surface_of(hit.triangle) as usize == surface
    }

    /// The radiosity that a ray met at `point`; zero on the back of a single-sided surface.
    #[must_use]
    pub fn radiosity(&self, tracer: &Tracer, hit: &Hit, point: DVec3) -> Vec3 {
        self.patch_met(tracer, hit, point).map_or(Vec3::ZERO, |(_, met)| self.radiosity_met(&met))
    }

    /// What a ray met that shines onto a place with this normal; nothing where it did not leave
    /// [the gap](super::overhang) between the two.
    #[inline]
    #[must_use]
    pub fn met(&self, tracer: &Tracer, (hit, point): (&Hit, DVec3), normal: DVec3) -> Option<Met> {
        let (side, met) = self.patch_met(tracer, hit, point)?;
        let is_in_gap = hit.distance < f64::from(self.patches[met.patch as usize].gap)
            && side.frame.normal.dot(normal) < FACING;
        (!is_in_gap).then_some(met)
    }

    /// The radiosity of what a ray met.
    #[inline]
    #[must_use]
    pub fn radiosity_met(&self, met: &Met) -> Vec3 {
        self.patches[met.patch as usize].at(met.at)
    }

    /// The patch that a ray met, and on which side of its surface.
    #[inline]
    fn patch_met(&self, tracer: &Tracer, hit: &Hit, point: DVec3) -> Option<(&SideField, Met)> {
        let surface = self.locator.surface_of(hit.triangle) as usize;
        let side = self.sides.get(2 * surface + usize::from(hit.from_behind))?;
        if side.cells.x == 0 {
            return None;
        }
        let at = (side.frame.project(point) - side.min).as_vec2();
        let cell = (at * side.cells_per_metre).max(Vec2::ZERO).as_uvec2().min(side.cells - 1);
        let mut start = self.starts[(side.first + cell.y * side.cells.x + cell.x) as usize];
        if start == SHARED {
            let (facet, _) = self.locator.find(tracer, hit, point)?;
            start = self.roots[facet];
        }
        Some((side, Met { patch: self.patch_from(start, at), at }))
    }
}

/// Where a facet's side is among all.
fn side_number((_, surface, side): (usize, usize, Side)) -> usize {
    2 * surface + usize::from(side == Side::Back)
}

/// A side's frame, its least corner there, and its extent.
fn plane_of(surface: &Surface, side: Side) -> (Frame, DVec2, DVec2) {
    let (min, max) = surface.extent();
    let extent = (max - min).max(DVec2::splat(f64::MIN_POSITIVE));
    match side {
        Side::Front => (surface.frame, min, extent),
        Side::Back => {
            let frame = Frame { v: -surface.frame.v, normal: -surface.frame.normal, ..surface.frame };
            (frame, DVec2::new(min.x, -max.y), extent)
        }
    }
}

/// A facet's part of the field, numbered by itself.
struct Tree {
    root: u32,
    nodes: Vec<FieldNode>,
    patches: Vec<FieldPatch>,
    /// Of hot leaves, by the number of their patch: what the cap took.
    excess: Vec<(u32, FieldPatch)>,
}

impl Tree {
    fn new(facet: &Facet, surface: &Surface, is_hot: &[bool], reading: Reading) -> Self {
        let (_, min, _) = plane_of(surface, facet.side);
        let (mut inner, mut leaves) = (0, 0);
        let numbers: Vec<u32> = facet
            .elements
            .iter()
            .map(|e| {
                let count = if e.is_leaf() { &mut leaves } else { &mut inner };
                *count += 1;
                *count - 1 + if e.is_leaf() { LEAF } else { 0 }
            })
            .collect();
        let descent = Descent::new(facet);
        let inner = descent.nodes().iter().filter(|n| n.children != [NONE; 4]);
        let nodes = inner.map(|n: &Node| FieldNode {
            middle: (n.middle - min).as_vec2(),
            children: n.children.map(|c| numbers[c as usize]),
        });
        let nodes = nodes.collect();
        let (mut patches, mut excess) = (Vec::with_capacity(leaves as usize), Vec::new());
        for leaf in facet.leaves() {
            let (patch, beyond) = reading.of((facet, leaf), min, is_hot[leaf as usize]);
            excess.extend(beyond.map(|beyond| (patches.len() as u32, beyond)));
            patches.push(patch);
        }
        Self { root: numbers[0], nodes, patches, excess }
    }
}

impl Reading {
    /// A leaf's patch, relative to `origin`, and what the cap takes of a hot one.
    fn of(
        &self,
        (facet, leaf): (&Facet, u32),
        origin: DVec2,
        is_hot: bool,
    ) -> (FieldPatch, Option<FieldPatch>) {
        let e = &facet.elements[leaf as usize];
        let radiosity = |p| {
            let (direct, indirect) = facet.received(leaf, p);
            e.reflectance * (direct * self.scale + indirect)
        };
        let (corners, middle) = (e.corners().map(radiosity), radiosity(0.5 * (e.min + e.max)));
        let whole = FieldPatch::new(e, origin, corners, middle);
        if !is_hot {
            return (whole, None);
        }
        let cap = |colour| capped(colour, self.cap);
        let cool = FieldPatch::new(e, origin, corners.map(cap), cap(middle));
        (cool, Some(whole.without(&cool)))
    }
}

impl FieldNode {
    #[inline]
    fn child(&self, p: Vec2) -> u32 {
        self.children[usize::from(p.x >= self.middle.x) + 2 * usize::from(p.y >= self.middle.y)]
    }
}

impl FieldPatch {
    fn new(e: &Element, origin: DVec2, corners: [DVec3; 4], middle: DVec3) -> Self {
        Self {
            min: (e.min - origin).as_vec2(),
            per_size: (1.0 / (e.max - e.min)).as_vec2(),
            bulge: (middle - 0.25 * corners.iter().sum::<DVec3>()).as_vec3(),
            corners: corners.map(|c| c.as_vec3()),
            gap: e.overhang.map_or(0.0, |overhang| overhang.reach as f32),
        }
    }

    #[inline]
    fn at(&self, p: Vec2) -> Vec3 {
        let t = ((p - self.min) * self.per_size).clamp(Vec2::ZERO, Vec2::ONE);
        let [a, b, c, d] = self.corners;
        let s = 2.0 * t - 1.0;
        a.lerp(b, t.x).lerp(d.lerp(c, t.x), t.y) + self.bulge * (1.0 - 0.5 * s.length_squared())
    }

    /// What it is more than another of the same place.
    fn without(&self, other: &Self) -> Self {
        let corners = std::array::from_fn(|i| self.corners[i] - other.corners[i]);
        Self { corners, bulge: self.bulge - other.bulge, ..*self }
    }

    fn mean(&self) -> Vec3 {
        0.25 * self.corners.iter().sum::<Vec3>() + self.bulge * (2.0 / 3.0)
    }
}

/// A colour with its luminance brought down to `cap`.
fn capped(colour: DVec3, cap: f64) -> DVec3 {
    let luminance = luminance(colour);
    if luminance > cap { colour * (cap / luminance) } else { colour }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{MeshOptions, Shading, SurfaceAppearance, build};
    use crate::geom::polygon::rectangle;
    use crate::solve::patches::Patches;
    use crate::surface::Region;

    const PATCH: f64 = 0.25;
    const REFLECTANCE: f64 = 0.5;

    struct Grey;

    impl SurfaceAppearance for Grey {
        fn reflectance(&self, _: usize, _: DVec2, _: DVec2) -> DVec3 {
            DVec3::splat(REFLECTANCE)
        }

        fn exitance(&self, _: usize, _: DVec2, _: DVec2) -> DVec3 {
            DVec3::ZERO
        }
    }

    /// A floor of 4 m × 2 m.
    fn floor() -> Surface {
        let ring = rectangle(DVec2::ZERO, DVec2::new(4.0, 2.0));
        let [a, b, c, d] = ring;
        let region = Region { rings: vec![ring.to_vec()], triangles: vec![[a, b, c], [a, c, d]], area: 8.0 };
        Surface {
            placement: 0,
            material: 0,
            frame: Frame::new(DVec3::ZERO, DVec3::Z, DVec3::X),
            rings: region.rings.clone(),
            source_triangles: vec![0, 1],
            regions: vec![region],
            area: 8.0,
            smooth: None,
            double_sided: false,
        }
    }

    /// Where light changed, hot or not, the renewed field is the one that would be made anew, and elsewhere as it was.
    #[test]
    fn renewed_is_as_good_as_new() {
        let surfaces = [floor()];
        let space = surfaces[0].regions[0].triangles.iter().map(|t| t.map(|p| p.extend(0.0))).collect();
        let tracer = Tracer::new(space);
        let options = MeshOptions { patch_size: PATCH, nudge: 1e-6, lift: 1e-6 };
        let mut facets = build(&surfaces, &Grey, options);
        let locator = FacetLocator::new(&surfaces, &facets, 2);
        let mut patches = Patches::new(&facets, PATCH, &locator, &tracer);
        for (k, patch) in patches.patches.iter_mut().enumerate() {
            patch.direct = DVec3::splat(if k == 3 { 500.0 } else { 1.0 });
            let element = &mut facets[patch.facet as usize].elements[patch.element as usize];
            element.direct = Shading { corners: [patch.direct; 4], bulge: DVec3::ZERO };
        }
        let hot = HotSpots::find(&patches, &facets);
        let new =
            |facets: &[Facet]| RadiosityField::new(&locator, &surfaces, facets, &hot, DVec3::splat(0.9));
        let all = |field: &RadiosityField| {
            let number = |k: usize| u32::try_from(k).unwrap();
            let of = |(k, patch): (usize, &FieldPatch)| {
                (patch.corners, patch.bulge, field.excess.get(&number(k)).map(|e| (e.corners, e.bulge)))
            };
            field.patches.iter().enumerate().map(of).collect::<Vec<_>>()
        };
        let mut field = new(&facets);
        let before = all(&field);
        assert_eq!(field.excess.len(), 1);

        let mut changed: Vec<Vec<Receiver>> = facets.iter().map(|_| Vec::new()).collect();
        for k in [3, 4, 40] {
            let patch = &patches.patches[k];
            let corners = [1.0, 2.0, 3.0, 4.0].map(DVec3::splat);
            let element = &mut facets[patch.facet as usize].elements[patch.element as usize];
            element.indirect = Shading { corners, bulge: DVec3::ONE };
            let receiver = Receiver { element: patch.element, contrast: 1.0, reach: 0.0, idle: 0 };
            changed[patch.facet as usize].push(receiver);
        }
        field.renew(&facets, &changed);
        let after = all(&field);
        assert_eq!(after, all(&new(&facets)));
        assert_eq!(after.iter().zip(&before).filter(|(a, b)| a != b).count(), 3);
    }
}
