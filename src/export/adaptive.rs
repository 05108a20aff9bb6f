//! placeholder
use super::ExportError;
use super::writer::Writer;
use crate::scene::Placement;
use serde_json::Value;
pub(super) fn rewrite<'a>(
    writer: &mut Writer<'a>,
    placements: &[usize],
    _: &mut [Value],
) -> Result<Vec<&'a Placement>, ExportError> {
    Ok(placements.iter().filter_map(|&p| writer.baked.scene.placements.get(p)).collect())
}
