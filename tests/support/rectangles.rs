//! Form factors of rectangles in closed form, by another way than the solver's: the catalogue's (Howell,
//! *A Catalog of Radiation Heat Transfer Configuration Factors*), four corners instead of four edges.
#![allow(dead_code, reason = "each test binary uses a part")]

use std::f64::consts::TAU;

use glam::DVec3;

/// The rectangle `low..high`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rectangle {
    pub(crate) low: (f64, f64),
    pub(crate) high: (f64, f64),
}

impl Rectangle {
    pub(crate) fn new(low: (f64, f64), high: (f64, f64)) -> Self {
        Self { low, high }
    }

    /// What a figure's corner values add up to.
    fn corners(self, f: impl Fn(f64, f64) -> f64) -> f64 {
        let (a, b) = (self.low, self.high);
        f(b.0, b.1) - f(a.0, b.1) - f(b.0, a.1) + f(a.0, a.1)
    }

    fn meet(self, other: Self) -> Option<Self> {
        let low = (self.low.0.max(other.low.0), self.low.1.max(other.low.1));
        let high = (self.high.0.min(other.high.0), self.high.1.min(other.high.1));
        (low.0 < high.0 && low.1 < high.1).then_some(Self { low, high })
    }

    fn moved(self, by: (f64, f64)) -> Self {
        Self { low: (self.low.0 + by.0, self.low.1 + by.1), high: (self.high.0 + by.0, self.high.1 + by.1) }
    }

    fn scaled(self, by: f64) -> Self {
        Self { low: (self.low.0 * by, self.low.1 * by), high: (self.high.0 * by, self.high.1 * by) }
    }
}

/// B-3: from a point below a parallel rectangle, `height` above it; the point is the origin.
pub(crate) fn parallel(rectangle: Rectangle, height: f64) -> f64 {
    rectangle.corners(|x, y| {
        let (x, y) = (x / height, y / height);
        let (rx, ry) = (x.hypot(1.0), y.hypot(1.0));
        (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / TAU
    })
}

/// B-4: from a point on a floor to a rectangle on a wall at `distance`: `0` along the wall, `1` upward.
pub(crate) fn perpendicular(rectangle: Rectangle, distance: f64) -> f64 {
    rectangle.corners(|along, upward| {
        let slant = upward.hypot(distance);
        // The part that no corner below adds: what is infinitely high, less what lies above.
        -(distance / slant * (along / slant).atan()) / TAU
    })
}

/// A parallel emitter behind a parallel blocker: the emitter less the blocker's shadow on its plane.
pub(crate) struct Shaded {
    pub(crate) emitter: Rectangle,
    pub(crate) emitter_height: f64,
    pub(crate) blocker: Rectangle,
    pub(crate) blocker_height: f64,
}

impl Shaded {
    /// What the point `(x, y, 0)`, facing up, sees of the emitter.
    pub(crate) fn form_factor(&self, x: f64, y: f64) -> f64 {
        let emitter = self.emitter.moved((-x, -y));
        let shadow = self.blocker.moved((-x, -y)).scaled(self.emitter_height / self.blocker_height);
        let hidden = emitter.meet(shadow).map_or(0.0, |h| parallel(h, self.emitter_height));
        parallel(emitter, self.emitter_height) - hidden
    }
}

/// A horizontal emitter above boxes, by brute force: the midpoint rule over the emitter, a ray for each.
pub(crate) struct Boxes<'a> {
    pub(crate) emitter: Rectangle,
    pub(crate) height: f64,
    pub(crate) boxes: &'a [(DVec3, DVec3)],
}

/// Cells along the emitter's side.
const CELLS: u32 = 60;

impl Boxes<'_> {
    /// What `point`, facing `normal`, sees of the emitter.
    pub(crate) fn form_factor(&self, point: DVec3, normal: DVec3) -> f64 {
        let (low, high) = (self.emitter.low, self.emitter.high);
        let size = ((high.0 - low.0) / f64::from(CELLS), (high.1 - low.1) / f64::from(CELLS));
        let mut sum = 0.0;
        for k in 0..CELLS * CELLS {
            let (i, j) = (f64::from(k % CELLS) + 0.5, f64::from(k / CELLS) + 0.5);
            let way = DVec3::new(low.0 + i * size.0, low.1 + j * size.1, self.height) - point;
            let cosines = normal.dot(way) * way.z;
            if cosines > 0.0 && way.z > 0.0 && !self.boxes.iter().any(|b| crosses(*b, point, way)) {
                sum += cosines / way.length_squared().powi(2);
            }
        }
        sum * size.0 * size.1 / std::f64::consts::PI
    }
}

/// Whether the segment from `point` along `way` passes through the box's inside.
fn crosses((low, high): (DVec3, DVec3), point: DVec3, way: DVec3) -> bool {
    let (a, b) = ((low - point) / way, (high - point) / way);
    let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(1.0));
    leave - enter > 1e-9
}
