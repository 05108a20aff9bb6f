//! How much of an emitter a point sees, exactly.
//!
//! Each occluding convex polygon is cut to what lies between the point and the emitter's
//! plane; what remains is a convex polygon whose shadow pyramid, with its tip in the
//! point, is subtracted from the emitter's convex parts. What is left of the emitter
//! is a set of convex polygons, and Lambert's closed form is summed over them: penumbrae
//! without noise. The idea is that of Nishita and Nakamae, "Continuous Tone Representation
//! of Three-Dimensional Objects Taking Account of Shadows and Interreflection", 1985.
//!
//! The cost grows with the number of occluders; callers keep the list short with a
//! [`Shaft`](crate::trace::shaft::Shaft) and fall back to rays where it is long.

use glam::DVec3;

use super::form_factor::{SurfacePoint, signed_point_to_polygon};

/// Corners that a convex part may have after cutting; more than this many cuts at one
/// part's edges do not occur with the few occluders that are subtracted exactly.
const MOST_CORNERS: usize = 12;

/// An edge that is seen under a smaller angle has no direction to speak of.
const SHORT: f64 = 1e-12;

/// A convex polygon of few corners, relative to the receiving point.
#[derive(Clone, Copy)]
struct Part {
    corners: [DVec3; MOST_CORNERS],
    count: usize,
}

/// Polygons whose memory is kept when they are dropped: a part is large, and mostly empty.
#[derive(Default)]
struct Parts {
    parts: Vec<Part>,
    count: usize,
}

impl Parts {
    fn clear(&mut self) {
        self.count = 0;
    }

    fn is_empty(&self) -> bool {
        self.count == 0
    }

    fn as_slice(&self) -> &[Part] {
        &self.parts[..self.count]
    }

    /// Where the next part may be put; it counts once it is [kept](Self::keep).
    fn next(&mut self) -> &mut Part {
        if self.count == self.parts.len() {
            self.parts.push(Part::EMPTY);
        }
        &mut self.parts[self.count]
    }

    /// Keeps what was put into the next part, unless that has no area.
    fn keep(&mut self) {
        if self.parts[self.count].count >= 3 {
            self.count += 1;
        }
    }

    /// Moves a part out, whose place the last one takes.
    fn take(&mut self, index: usize, to: &mut Part) {
        to.copy_from(&self.parts[index]);
        self.count -= 1;
        let (before, last) = self.parts.split_at_mut(self.count);
        if let Some(part) = before.get_mut(index) {
            part.copy_from(&last[0]);
        }
    }
}

/// Memory that is kept between calls.
#[derive(Default)]
pub struct Workspace {
    parts: Parts,
    scratch: [Part; 5],
}

/// The emitter that [`visible_form_factor`] looks at: convex parts in one plane.
#[derive(Clone, Copy, Debug)]
pub struct ConvexParts<'a> {
    /// World-space corners of each part, counter-clockwise seen from the emitting side.
    pub parts: &'a [Vec<DVec3>],
    /// The emitting side's unit normal.
    pub normal: DVec3,
    /// A point of the plane.
    pub origin: DVec3,
    /// What comes no farther in front of the plane than this hides nothing, metres: the emitter's own
    /// surroundings in its plane.
    pub margin: f64,
}

/// The form factor from `receiver` to the visible part of `emitter`.
///
/// `occluders`, convex polygons, must hold everything that reaches into the space between the two;
/// more do no harm. `None` when the cutting got out of hand: count rays instead.
pub fn visible_form_factor<'t>(
    receiver: SurfacePoint,
    emitter: ConvexParts,
    occluders: impl Iterator<Item = &'t [DVec3]>,
    workspace: &mut Workspace,
) -> Option<f64> {
    let x = receiver.position;
    let plane_offset = emitter.normal.dot(emitter.origin - x);
    if plane_offset >= 0.0 {
        return Some(0.0); // behind the emitter
    }
    let near_side = plane_offset + emitter.margin.min(-0.5 * plane_offset);
    let Workspace { parts, scratch } = workspace;
    let [whole, above, near, halves @ ..] = scratch;
    parts.clear();
    for part in emitter.parts {
        whole.fill(part.iter().map(|&v| v - x))?;
        whole.cut(receiver.normal, 0.0, parts.next())?;
        parts.keep();
    }
    let around = match parts.as_slice() {
        [part] => Pyramid::over(part),
        _ => Pyramid::EMPTY,
    };
    for occluder in occluders {
        if parts.is_empty() {
            return Some(0.0);
        }
        whole.fill(occluder.iter().map(|&v| v - x))?;
        if around.sides().iter().any(|&side| whole.side_of(side) == Side::Outside) {
            continue;
        }
        // What casts a shadow is above the horizon and on this side of the emitter's plane.
        let shade = whole.within(receiver.normal, 0.0, above)?.within(emitter.normal, near_side, near)?;
        if shade.count >= 3 && !is_flat(shade) {
            subtract(&Pyramid::over(shade), parts, halves)?;
        }
    }
    let seen_from_x = SurfacePoint { position: DVec3::ZERO, normal: receiver.normal };
    let sum: f64 = parts.as_slice().iter().map(|p| signed_point_to_polygon(seen_from_x, p.corners())).sum();
    Some(sum.clamp(0.0, 1.0))
}

/// Removes from all parts what lies in the pyramid.
fn subtract(pyramid: &Pyramid, parts: &mut Parts, [rest, inside]: &mut [Part; 2]) -> Option<()> {
    let (mut rest, mut inside) = (rest, inside);
    // From the last: what takes the place of one that is taken has had its turn, or lies outside.
    for index in (0..parts.count).rev() {
        let part = &parts.parts[index];
        let mut cutting = 0_u32;
        let is_outside = pyramid.sides().iter().enumerate().any(|(k, &side)| {
            let of = part.side_of(side);
            cutting |= u32::from(of == Side::Both) << k;
            of == Side::Outside
        });
        if is_outside {
            continue;
        }
        parts.take(index, rest);
        while cutting != 0 && rest.count >= 3 {
            rest.split(pyramid.sides[cutting.trailing_zeros() as usize], parts.next(), inside)?;
            parts.keep();
            std::mem::swap(&mut rest, &mut inside);
            cutting &= cutting - 1;
        }
    }
    Some(())
}

/// The planes through the origin and a polygon's edges, by normals that point inwards.
struct Pyramid {
    sides: [DVec3; MOST_CORNERS],
    count: usize,
}

impl Pyramid {
    /// Without sides: all of space.
    const EMPTY: Self = Self { sides: [DVec3::ZERO; MOST_CORNERS], count: 0 };

    fn over(polygon: &Part) -> Self {
        let mut pyramid = Self::EMPTY;
        let inner = polygon.corners().iter().sum::<DVec3>();
        for (i, a) in polygon.corners().iter().enumerate() {
            let b = polygon.corners[if i + 1 == polygon.count { 0 } else { i + 1 }];
            let side = a.cross(b);
            // A side seen edge-on, or an edge too short to matter, bounds nothing.
            if side.length_squared() > SHORT * SHORT * a.length_squared() * b.length_squared() {
                pyramid.sides[pyramid.count] = if side.dot(inner) >= 0.0 { side } else { -side };
                pyramid.count += 1;
            }
        }
        pyramid
    }

    fn sides(&self) -> &[DVec3] {
        &self.sides[..self.count]
    }
}

/// Where a polygon lies.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Outside,
    Inside,
    Both,
}

/// Whether the origin lies in the polygon's plane, so that its pyramid has no volume.
fn is_flat(shade: &Part) -> bool {
    let inner = shade.corners().iter().sum::<DVec3>();
    let normal = (shade.corners[1] - shade.corners[0]).cross(shade.corners[2] - shade.corners[0]);
    normal.dot(inner).abs() <= 1e-12 * normal.length() * inner.length()
}

impl Default for Part {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Part {
    const EMPTY: Self = Self { corners: [DVec3::ZERO; MOST_CORNERS], count: 0 };

    /// Takes on these corners; `None` where they are too many.
    fn fill(&mut self, corners: impl Iterator<Item = DVec3>) -> Option<()> {
        self.count = 0;
        corners.into_iter().try_for_each(|corner| self.push(corner))
    }

    fn push(&mut self, corner: DVec3) -> Option<()> {
        *self.corners.get_mut(self.count)? = corner;
        self.count += 1;
        Some(())
    }

    fn copy_from(&mut self, other: &Self) {
        self.corners[..other.count].copy_from_slice(other.corners());
        self.count = other.count;
    }

    fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// On which side of a plane through the origin, whose normal points inwards, it lies.
    fn side_of(&self, side: DVec3) -> Side {
        let (mut is_inside, mut is_outside) = (true, true);
        for corner in self.corners() {
            let height = corner.dot(side);
            is_inside &= height >= 0.0;
            is_outside &= height <= 0.0;
        }
        match (is_outside, is_inside) {
            (true, _) => Side::Outside,
            (false, true) => Side::Inside,
            (false, false) => Side::Both,
        }
    }

    /// What of it lies where `normal · p ≥ offset`: itself, or cut in `room`. `None` as for [`Self::cut`].
    fn within<'p>(&'p self, normal: DVec3, offset: f64, room: &'p mut Self) -> Option<&'p Self> {
        if self.corners().iter().all(|c| normal.dot(*c) >= offset) {
            return Some(self);
        }
        self.cut(normal, offset, room)?;
        Some(room)
    }

    /// Divides it along a plane through the origin. `None` where a half has too many corners.
    fn split(&self, side: DVec3, outside: &mut Self, inside: &mut Self) -> Option<()> {
        (outside.count, inside.count) = (0, 0);
        let Some(&last) = self.corners().last() else { return Some(()) };
        let (mut a, mut height_a) = (last, side.dot(last));
        for &b in self.corners() {
            let height_b = side.dot(b);
            if height_a * height_b < 0.0 {
                let crossing = a.lerp(b, height_a / (height_a - height_b));
                outside.push(crossing)?;
                inside.push(crossing)?;
            }
            if height_b <= 0.0 {
                outside.push(b)?;
            }
            if height_b >= 0.0 {
                inside.push(b)?;
            }
            (a, height_a) = (b, height_b);
        }
        Some(())
    }

    /// Puts the part of this polygon where `normal · p ≥ offset` into `out`; `None` where it has too many corners.
    fn cut(&self, normal: DVec3, offset: f64, out: &mut Self) -> Option<()> {
        out.count = 0;
        let Some(&last) = self.corners().last() else { return Some(()) };
        let (mut a, mut height_a) = (last, normal.dot(last) - offset);
        for &b in self.corners() {
            let height_b = normal.dot(b) - offset;
            if (height_a >= 0.0) != (height_b >= 0.0) {
                out.push(a.lerp(b, height_a / (height_a - height_b)))?;
            }
            if height_b >= 0.0 {
                out.push(b)?;
            }
            (a, height_a) = (b, height_b);
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::form_factor::point_to_polygon;
    use super::*;

    /// Cutting and summing differ from the one closed form by rounding only.
    const EXACT: f64 = 1e-12;

    fn ceiling(z: f64, half: f64) -> Vec<DVec3> {
        [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(x, y)| DVec3::new(x * half, y * half, z))
            .to_vec()
    }

    fn looking_up(parts: &[Vec<DVec3>]) -> ConvexParts<'_> {
        ConvexParts { parts, normal: -DVec3::Z, origin: parts[0][0], margin: 1e-9 }
    }

    fn polygons(triangles: &[[DVec3; 3]]) -> impl Iterator<Item = &[DVec3]> {
        triangles.iter().map(<[DVec3; 3]>::as_slice)
    }

    fn at(x: f64, y: f64) -> SurfacePoint {
        SurfacePoint { position: DVec3::new(x, y, 0.0), normal: DVec3::Z }
    }

    fn as_triangles(quad: &[DVec3]) -> [[DVec3; 3]; 2] {
        [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    }

    /// A square blocker halfway up hides the square twice its size as seen from straight below,
    /// and from beside exactly the rectangle that its projection covers.
    #[test]
    fn a_blocker_hides_its_projection() {
        let parts = [ceiling(2.0, 1.0)];
        let blocker = as_triangles(&ceiling(1.0, 0.3));
        let mut workspace = Workspace::default();
        for (x, y) in [(0.0, 0.0), (0.4, 0.1), (0.9, -0.7), (2.5, 0.0)] {
            let receiver = at(x, y);
            let actual =
                visible_form_factor(receiver, looking_up(&parts), polygons(&blocker), &mut workspace)
                    .unwrap();
            // The shadow of the blocker on the ceiling's plane, intersected with the ceiling.
            let (low_x, high_x) = ((2.0 * -0.3 - x).max(-1.0), (2.0 * 0.3 - x).min(1.0));
            let (low_y, high_y) = ((2.0 * -0.3 - y).max(-1.0), (2.0 * 0.3 - y).min(1.0));
            let hidden = if low_x < high_x && low_y < high_y {
                let c = |x, y| DVec3::new(x, y, 2.0);
                point_to_polygon(
                    receiver,
                    &[c(low_x, low_y), c(low_x, high_y), c(high_x, high_y), c(high_x, low_y)],
                )
            } else {
                0.0
            };
            let expected = point_to_polygon(receiver, &parts[0]) - hidden;
            assert!((actual - expected).abs() < EXACT, "({x}, {y}): {actual} != {expected}");
        }
    }

    /// A second method: midpoint sampling of the emitter with shadow rays.
    #[test]
    fn overlapping_occluders_count_once() {
        let parts = [ceiling(2.0, 1.0)];
        let occluders: Vec<[DVec3; 3]> = (0..6)
            .map(|k| {
                let t = f64::from(k);
                let c = DVec3::new(0.7 * (t * 1.1).sin(), 0.7 * (t * 2.3).cos(), 0.5 + 0.2 * t);
                [c + DVec3::X * 0.5, c + DVec3::new(-0.3, 0.4, 0.1), c - DVec3::new(0.2, 0.5, 0.1)]
            })
            .collect();
        let tracer = crate::trace::Tracer::new(occluders.clone());
        let mut workspace = Workspace::default();
        for (x, y) in [(0.0, 0.0), (0.8, 0.3), (-0.5, -0.9)] {
            let receiver = at(x, y);
            let exact =
                visible_form_factor(receiver, looking_up(&parts), polygons(&occluders), &mut workspace)
                    .unwrap();
            let (mut sum, cells) = (0.0, 300);
            for k in 0..cells * cells {
                let cell = |i: i32| (f64::from(i) + 0.5) / f64::from(cells) * 2.0 - 1.0;
                let q = DVec3::new(cell(k % cells), cell(k / cells), 2.0);
                if !tracer.occluded(receiver.position, q) {
                    let d = q - receiver.position;
                    sum += d.z * d.z / d.length_squared().powi(2);
                }
            }
            let sampled = sum * 4.0 / f64::from(cells * cells) / std::f64::consts::PI;
            assert!((exact - sampled).abs() < 2e-3 * exact.max(0.1), "({x}, {y}): {exact} {sampled}");
        }
    }

    #[test]
    fn what_stands_behind_the_emitter_or_below_the_horizon_hides_nothing() {
        let parts = [ceiling(2.0, 1.0)];
        let whole = point_to_polygon(at(0.0, 0.0), &parts[0]);
        let mut workspace = Workspace::default();
        for z in [2.5, -0.5] {
            let occluders = as_triangles(&ceiling(z, 3.0));
            let actual =
                visible_form_factor(at(0.0, 0.0), looking_up(&parts), polygons(&occluders), &mut workspace);
            assert!((actual.unwrap() - whole).abs() < EXACT);
        }
    }

    /// The ceiling around a lamp that is let into it, up to rounding.
    #[test]
    fn what_lies_in_the_emitters_plane_hides_nothing() {
        let parts = [ceiling(2.0, 1.0)];
        let receiver = SurfacePoint { position: DVec3::new(3.0, 0.0, 1.9), normal: -DVec3::X };
        let whole = point_to_polygon(receiver, &parts[0]);
        let c = |x, y| DVec3::new(x, y, 2.0 - 1e-12);
        let around = [[c(1.0, -3.0), c(3.0, 3.0), c(3.0, -3.0)], [c(1.0, -3.0), c(1.0, 3.0), c(3.0, 3.0)]];
        // The lamp's own triangles are among them when a shaft has no cap.
        let own = [[c(-1.0, -1.0), c(-1.0, 1.0), c(1.0, 1.0)], [c(-1.0, -1.0), c(1.0, 1.0), c(1.0, -1.0)]];
        let around = [around, own].concat();
        let mut workspace = Workspace::default();
        let seen = visible_form_factor(receiver, looking_up(&parts), polygons(&around), &mut workspace);
        assert!((seen.unwrap() - whole).abs() < EXACT && whole > 0.0);
    }

    /// A wall that passes through the emitter's plane shades on this side of it only.
    #[test]
    fn an_occluder_through_the_emitter_is_cut_at_its_plane() {
        let parts = [ceiling(2.0, 1.0)];
        let wall = [DVec3::new(0.0, -9.0, 1.0), DVec3::new(0.0, 9.0, 1.0), DVec3::new(0.0, 0.0, 40.0)];
        let mut workspace = Workspace::default();
        let seen = visible_form_factor(at(-0.5, 0.0), looking_up(&parts), polygons(&[wall]), &mut workspace);
        let c = |x, y| DVec3::new(x, y, 2.0);
        let left = point_to_polygon(at(-0.5, 0.0), &[c(-1.0, -1.0), c(-1.0, 1.0), c(0.0, 1.0), c(0.0, -1.0)]);
        let low = visible_form_factor(at(-0.5, 0.0), looking_up(&parts), polygons(&[]), &mut workspace);
        assert!(seen.unwrap() >= left - EXACT && seen.unwrap() < low.unwrap() - 0.01);
    }
}
