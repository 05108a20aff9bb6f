//! Fills charts' cells up, for mip maps.
//!
//! A texel of a mip map is the mean of a square of the page. Charts that are laid out for mip maps own all
//! squares that lookups inside them touch; what of these the charts do not cover has to look like them.

use rayon::prelude::*;

use crate::raster::{Lightmap, TexelSite, dilate, sites};
use crate::surface::Surface;
use crate::unwrap::Atlas;

/// A rectangle of the page, its far ends not included.
#[derive(Clone, Copy)]
struct Cell {
    x: (u32, u32),
    y: (u32, u32),
}

/// Gives every texel of a chart's cell that the chart does not cover the mean of its neighbours in the cell,
/// outward from the chart; returns how many there are.
pub(super) fn fill_cells(lightmap: &mut Lightmap, surfaces: &[Surface], atlas: &Atlas, mips: u32) -> u64 {
    let sites = sites(surfaces, atlas, &|_, _| true);
    let page = &*lightmap;
    let filled: Vec<(Cell, Vec<[f32; 3]>, u64)> = sites
        .chunk_by(|a, b| a.chart == b.chart)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|of_chart| {
            let cell = cell_of(of_chart, atlas, 1 << mips);
            let size = (cell.x.1 - cell.x.0, cell.y.1 - cell.y.0);
            let mut texels = vec![[0.0; 3]; size.0 as usize * size.1 as usize];
            let mut valid = vec![false; texels.len()];
            for site in of_chart {
                let at = (site.y - cell.y.0) as usize * size.0 as usize + (site.x - cell.x.0) as usize;
                texels[at] = page.texels[site.y as usize * page.width as usize + site.x as usize];
                valid[at] = true;
            }
            let free = texels.len() - of_chart.len();
            dilate(&mut texels, &mut valid, size, size.0 + size.1);
            (cell, texels, free as u64)
        })
        .collect();
    let width = lightmap.width as usize;
    let mut count = 0;
    for (cell, texels, free) in filled {
        let row_length = (cell.x.1 - cell.x.0) as usize;
        for (y, row) in (cell.y.0 as usize..).zip(texels.chunks_exact(row_length)) {
            let start = y * width + cell.x.0 as usize;
            lightmap.texels[start..start + row_length].copy_from_slice(row);
        }
        count += free;
    }
    count
}

/// The cell of the chart with these sites.
fn cell_of(sites: &[TexelSite], atlas: &Atlas, align: u32) -> Cell {
    let range = |at: &dyn Fn(&TexelSite) -> u32, all: u32| {
        let (first, last) = sites.iter().map(at).fold((u32::MAX, 0), |(a, b), k| (a.min(k), b.max(k)));
        let free = atlas.gutter / 2;
        let start = first.saturating_sub(free) / align * align;
        (start, (last + 1 + free).next_multiple_of(align).min(all))
    };
    Cell { x: range(&|s| s.x, atlas.width), y: range(&|s| s.y, atlas.height) }
}
