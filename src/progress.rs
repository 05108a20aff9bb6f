//! How a bake tells its caller where it is, and learns that it should stop.

/// The stages of a bake, in the order in which they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Stage {
    /// Reading glTF into triangles, materials and lights.
    Import,
    /// Grouping triangles into planar surfaces and building the ray tracer.
    Surfaces,
    /// Shooting light.
    Solve,
    /// Triangulating the adaptive elements.
    Retriangulate,
    /// Laying the charts out in the lightmap.
    Unwrap,
    /// Computing the texels.
    Raster,
    /// Encoding, writing and reading back.
    Export,
}

impl Stage {
    /// A short name for people and for the report's `time` keys: lower case, one word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Import => "import",
            Self::Surfaces => "surfaces",
            Self::Solve => "solve",
            Self::Retriangulate => "retriangulate",
            Self::Unwrap => "unwrap",
            Self::Raster => "raster",
            Self::Export => "export",
        }
    }
}

/// Receives a bake's progress. Called from one thread at a time.
pub trait Progress: Send {
    /// A stage begins.
    fn begin(&mut self, stage: Stage);

    /// `fraction` of the current stage is done, in `[0, 1]`, never falling within a stage.
    fn advance(&mut self, fraction: f64);

    /// Something that the user should know and that did not stop the bake; one sentence.
    fn warn(&mut self, message: &str);

    /// Asked often. `true` makes the bake stop with [`Error::Cancelled`](crate::error::Error::Cancelled)
    /// and leave nothing behind.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Ignores everything and never cancels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&mut self, _: Stage) {}
    fn advance(&mut self, _: f64) {}
    fn warn(&mut self, _: &str) {}
}
