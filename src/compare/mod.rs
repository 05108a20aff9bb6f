//! How far a bake is from the truth, or from another bake.
//!
//! Both comparisons are made at points of surfaces, so that the atlases do not matter: a point is looked
//! up in a [`BakedScene`] by position and normal ([`BakedScene::locate`]), its lightmap coordinates there
//! are interpolated, and the page is sampled bilinearly, as a renderer does it.
//!
//! - [`with_reference`] takes points whose irradiance is known ([`ReferencePoints`], a NumPy `.npz`) and
//!   gives the errors of each set of points.
//! - [`with_bake`] spreads points evenly over one bake's surfaces and looks them up in another; what a
//!   person would notice is told by [`flip`], over the first bake's page.
//!
//! Nothing here is random: the same files give the same figures at any number of threads.

mod baked;
mod error;
mod figures;
mod flip;
mod heat_map;
mod hidden;
mod npy;
mod npz;
mod page;
mod pair;
mod reference;
mod spread;
mod triangle;

pub use baked::{BakedScene, Place};
pub use error::CompareError;
pub use figures::SetFigures;
pub use flip::{PIXELS_PER_DEGREE, flip};
pub use heat_map::HeatMap;
pub use npy::NpyFault;
pub use page::PageFigures;
pub use pair::{PairComparison, PairFigures, with_bake};
pub use reference::{ReferenceFigures, ReferencePoints, with_reference};
