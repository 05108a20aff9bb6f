//! Comparisons as tables for people.

use std::path::Path;

use cobake::compare::{PairFigures, ReferenceFigures, SetFigures};

/// The figures of a comparison with reference points, a row a set.
pub(crate) fn reference(baked: &Path, points: &Path, figures: &ReferenceFigures) -> String {
    let heads =
        ["set", "points", "mean", "rms", "corrected", "bias", "p50", "p95", "p99", "mean abs", "noise"];
    let mut rows = vec![heads.map(str::to_owned)];
    rows.extend(figures.sets().map(|(name, set)| row(name, set)));
    let mut text = format!("irradiance of {} against {}, errors in %\n", baked.display(), points.display());
    text += &aligned(&rows);
    text += &format!("{} points lie on no lit surface\n", figures.unmatched);
    text += "rms, bias, mean abs, noise: of the set's mean; corrected: rms without the reference's noise; p: of the point's own light\n";
    text
}

fn row(name: &str, set: &SetFigures) -> [String; 11] {
    let errors = [set.rrmse, set.rrmse_corr, set.bias, set.p50, set.p95, set.p99, set.mare, set.floor];
    let mut cells = vec![name.to_owned(), set.n.to_string(), format!("{:.4}", set.mean_ref)];
    cells.extend(errors.map(percent));
    let mut cells = cells.into_iter();
    std::array::from_fn(|_| cells.next().unwrap_or_default())
}

/// The figures of a comparison of two bakes; `scale` is the heat map's, where one was drawn.
pub(crate) fn pair(a: &Path, b: &Path, figures: &PairFigures, scale: Option<f64>) -> String {
    let quantity = figures.quantity.name();
    let flip = &figures.flip;
    let rows = [
        ["points", &figures.points.to_string(), "spread evenly over A's surfaces"],
        ["unmatched", &figures.unmatched.to_string(), "points that lie on no lit surface of B, left out"],
        ["hidden", &figures.hidden.to_string(), "points inside solids, left out too"],
        ["mean of A", &format!("{:.4}", figures.mean_a), quantity],
        ["mean of B", &format!("{:.4}", figures.mean_b), ""],
        ["relL2 %", &percent(figures.rel_l2), "of A's root mean square"],
        ["bias %", &percent(figures.bias), "of A's mean"],
        ["p50 %", &percent(figures.p50), "of the point's own light in A"],
        ["p95 %", &percent(figures.p95), ""],
        ["p99 %", &percent(figures.p99), ""],
        ["FLIP mean", &format!("{:.4}", flip.mean), "0 looks alike, 1 does not"],
        ["FLIP p95", &format!("{:.4}", flip.p95), ""],
        ["FLIP max", &format!("{:.4}", flip.max), ""],
        ["texels", &flip.texels.to_string(), "of A's page, compared by FLIP"],
    ]
    .map(|cells| cells.map(str::to_owned));
    let mut text = format!("A  {}\nB  {}\n", a.display(), b.display());
    text += &aligned(&rows);
    if let Some(scale) = scale {
        text += &format!(
            "heat map: black is 0, pale yellow {} % of the texel's own light in A, or more\n",
            percent(scale)
        );
    }
    text
}

fn percent(fraction: f64) -> String {
    format!("{:.2}", 100.0 * fraction)
}

/// Columns two spaces apart: the first to the left, numbers to the right, a last column of words to the left.
pub(crate) fn aligned<const N: usize>(rows: &[[String; N]]) -> String {
    let width = |column: usize| rows.iter().filter_map(|row| Some(row.get(column)?.chars().count())).max();
    let widths: Vec<usize> = (0..N).map(|column| width(column).unwrap_or(0)).collect();
    let has_words = N == 3;
    let line = |row: &[String; N]| {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            if column == 0 || (has_words && column + 1 == N) {
                format!("{cell:<width$}")
            } else {
                format!("{cell:>width$}")
            }
        });
        format!("  {}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_below_each_other() {
        let rows = [["a", "1.00", "of all"], ["long", "12.00", ""]].map(|row| row.map(str::to_owned));
        assert_eq!(aligned(&rows), "  a      1.00  of all\n  long  12.00\n");
    }
}
