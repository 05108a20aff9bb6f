//! A finished bake in one paragraph, for the person who watched it.

use std::path::Path;

use cobake::report::Report;

/// What was baked, into what, and what it cost.
pub(crate) fn paragraph(output: &Path, report: &Report) -> String {
    let Report { scene, elements, lightmap, texels, time, .. } = report;
    let pages = match lightmap.pages.len() {
        0 | 1 => String::new(),
        count => format!("{count} pages of at most "),
    };
    let mut text = format!(
        "baked {} triangles in {} surfaces into {}: {pages}{} × {} texels, {} of them covered; ",
        scene.triangles,
        scene.surfaces,
        output.display(),
        lightmap.width,
        lightmap.height,
        texels.covered,
    );
    text += &format!(
        "{} elements became {} in {} shots and {} rays; {:.1} s",
        elements.initial, elements.at_end, report.shots, report.rays, time.total.wall_seconds,
    );
    if let Some(seconds) = time.total.cpu_seconds {
        text += &format!(", {seconds:.1} s of CPU time");
    }
    if let Some(bytes) = report.peak_memory_bytes {
        text += &format!(", {} MiB at most", bytes.div_ceil(1 << 20));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_costs_are_left_out() {
        let mut report = Report::default();
        report.time.total.wall_seconds = 1.26;
        report.scene.triangles = 522;
        let text = paragraph(Path::new("out.glb"), &report);
        assert!(text.starts_with("baked 522 triangles"), "{text}");
        assert!(text.ends_with("1.3 s"), "{text}");

        report.time.total.cpu_seconds = Some(2.0);
        report.peak_memory_bytes = Some(1);
        let text = paragraph(Path::new("out.glb"), &report);
        assert!(text.ends_with("1.3 s, 2.0 s of CPU time, 1 MiB at most"), "{text}");
    }
}
