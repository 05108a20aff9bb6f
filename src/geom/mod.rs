//! Geometry that several stages share: frames, boxes, planar polygons.
pub mod bounds;
pub mod disjoint;
pub mod frame;
pub mod hull;
pub mod polygon;
pub mod slab;
pub mod triangle;
pub mod triangle_grid;

pub use bounds::Bounds;
pub use frame::Frame;
pub use polygon::Ring;
pub use slab::Slab;
pub use triangle_grid::TriangleGrid;
