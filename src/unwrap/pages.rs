//! Several pages: which charts go where, and the sheet that the pages make.
//!
//! What belongs to one group (a node) stays on one page unless the pages would be filled too unevenly; then the group
//! is continued on another page, in its charts' order, so that a surface's charts stay together. All pages are as
//! dense as the one that has least room.

use super::layout::{density_of_texels, sized};
use super::pack::{Gutter, LARGEST_SIDE, Page};
use super::shape::Shape;
use super::{Atlas, PageArea, Room, UnwrapError, UnwrapOptions, fill, lay_out};

/// The share of a page that charts with their gaps fill, about.
const FILLED: f64 = 0.95;

/// Groups stay whole where no page then gets more than this many times its share of the charts.
const UNEVEN: f64 = 1.1;

/// Lays `shapes` out on as few pages as hold them, at most `options.pages`; those of one group, an entry of `groups`
/// for each shape, together where they can.
pub(super) fn lay_out_on_pages(
    shapes: &[Shape],
    groups: &[usize],
    options: &UnwrapOptions,
    gutter: Gutter,
) -> Result<Atlas, UnwrapError> {
    let most = options.pages.max(1).min(shapes.len().max(1) as u32);
    let mut found = None;
    for count in pages_needed(shapes, options, gutter, most)..=most {
        let atlas = if count == 1 {
            lay_out(shapes, options, gutter)
        } else {
            on_pages(shapes, &divide(shapes, groups, options, gutter, count), options, gutter)
        };
        match atlas {
            Ok(atlas) => return Ok(atlas),
            Err(error) => found = Some(error),
        }
    }
    found.map_or_else(|| lay_out(shapes, options, gutter), Err)
}

/// The fewest pages that may hold the shapes at the density that they are to have.
fn pages_needed(shapes: &[Shape], options: &UnwrapOptions, gutter: Gutter, most: u32) -> u32 {
    let limit = options.most.unwrap_or(f64::INFINITY);
    let (side, density) = match options.room {
        Room::Square(side) => (side, limit),
        Room::Density(density) => (LARGEST_SIDE, density.min(limit)),
        Room::Texels(texels) => (LARGEST_SIDE, density_of_texels(shapes, texels, gutter, limit.min(1e9))),
    };
    let texels: f64 = cell_areas(shapes, density, gutter).iter().sum();
    let pages = (texels / f64::from(side).powi(2)).ceil();
    if pages.is_finite() { (pages as u32).clamp(1, most) } else { most }
}

/// What each shape takes with its gap, texels; infinite where it is too long for any page.
fn cell_areas(shapes: &[Shape], density: f64, gutter: Gutter) -> Vec<f64> {
    let page = Page { width: LARGEST_SIDE, height: LARGEST_SIDE, gutter };
    let area = |shape: &Shape| {
        sized(std::slice::from_ref(shape), density).map_or(f64::INFINITY, |charts| page.cell_area(&charts[0]))
    };
    shapes.iter().map(area).collect()
}

/// The shapes of each page, ascending; no page is empty.
fn divide(
    shapes: &[Shape],
    groups: &[usize],
    options: &UnwrapOptions,
    gutter: Gutter,
    count: u32,
) -> Vec<Vec<usize>> {
    let limit = options.most.unwrap_or(f64::INFINITY).min(1e9);
    let density = match options.room {
        Room::Square(side) => {
            let texels = FILLED * f64::from(side).powi(2) * f64::from(count);
            density_of_texels(shapes, texels, gutter, limit)
        }
        Room::Density(density) => density.min(limit),
        Room::Texels(texels) => density_of_texels(shapes, texels, gutter, limit),
    };
    let areas = cell_areas(shapes, density, gutter);
    let share = areas.iter().sum::<f64>() / f64::from(count);
    let mut members: Vec<(usize, f64, Vec<usize>)> = Vec::new();
    let mut order: Vec<usize> = (0..shapes.len()).collect();
    order.sort_by_key(|&shape| groups[shape]);
    for shape in order {
        match members.last_mut().filter(|(group, ..)| *group == groups[shape]) {
            Some((_, area, list)) => {
                *area += areas[shape];
                list.push(shape);
            }
            None => members.push((groups[shape], areas[shape], vec![shape])),
        }
    }
    // The sort is stable: the same input gives the same pages.
    members.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut pages: Vec<(f64, Vec<usize>)> = vec![(0.0, Vec::new()); count as usize];
    for (_, area, list) in members {
        let mut page = emptiest(&pages);
        let is_whole = pages[page].0 + area <= UNEVEN * share;
        for shape in list {
            if !is_whole && pages[page].0 + 0.5 * areas[shape] > share {
                page = emptiest(&pages);
            }
            pages[page].0 += areas[shape];
            pages[page].1.push(shape);
        }
    }
    let mut pages: Vec<Vec<usize>> =
        pages.into_iter().map(|(_, list)| list).filter(|l| !l.is_empty()).collect();
    pages.iter_mut().for_each(|list| list.sort_unstable());
    pages
}

fn emptiest(pages: &[(f64, Vec<usize>)]) -> usize {
    (0..pages.len()).min_by(|&a, &b| pages[a].0.total_cmp(&pages[b].0)).unwrap_or(0)
}

/// Lays each page's shapes out, at one density.
fn on_pages(
    shapes: &[Shape],
    division: &[Vec<usize>],
    options: &UnwrapOptions,
    gutter: Gutter,
) -> Result<Atlas, UnwrapError> {
    let own: Vec<Vec<Shape>> =
        division.iter().map(|list| list.iter().map(|&shape| shapes[shape].clone()).collect()).collect();
    let limit = options.most.unwrap_or(f64::INFINITY);
    let atlases: Result<Vec<Atlas>, UnwrapError> = match options.room {
        Room::Square(side) => {
            let side = side.min(LARGEST_SIDE) / gutter.align * gutter.align;
            let page = Page { width: side, height: side, gutter };
            let too_small = || UnwrapError::TooSmall { charts: shapes.len(), gutter: gutter.gap, side };
            let fill = |own: &Vec<Shape>, most: f64| fill(own, page, most).ok_or_else(too_small);
            let layouts: Vec<_> = own.iter().map(|own| fill(own, limit)).collect::<Result<_, _>>()?;
            let least = layouts.iter().map(|l| l.texels_per_metre).fold(limit, f64::min);
            let atlas = |(own, layout): (&Vec<Shape>, super::layout::Layout)| {
                let layout = if layout.texels_per_metre > least { fill(own, least)? } else { layout };
                layout.atlas(own, page).ok_or_else(too_small)
            };
            own.iter().zip(layouts).map(atlas).collect()
        }
        Room::Density(_) => own.iter().map(|own| lay_out(own, options, gutter)).collect(),
        Room::Texels(texels) => {
            let density = density_of_texels(shapes, texels, gutter, limit.min(1e9));
            let options = UnwrapOptions { room: Room::Density(density), ..*options };
            own.iter().map(|own| lay_out(own, &options, gutter)).collect()
        }
    };
    Ok(sheet(atlases?, (shapes, division), gutter))
}

/// Puts pages one below another, so far apart that no chart's gap reaches the next page.
fn sheet(atlases: Vec<Atlas>, (shapes, division): (&[Shape], &[Vec<usize>]), gutter: Gutter) -> Atlas {
    let gap = gutter.gap.next_multiple_of(gutter.align);
    let mut sheet = Atlas {
        width: 0,
        height: 0,
        texels_per_metre: 0.0,
        gutter: gutter.gap,
        pages: vec![],
        charts: vec![],
        blocks: vec![],
    };
    let (mut charts, mut squares, mut area) = (Vec::new(), 0.0, 0.0);
    for (page, (atlas, list)) in atlases.into_iter().zip(division).enumerate() {
        let row = if page == 0 { 0 } else { (sheet.height + gap).next_multiple_of(gutter.align) };
        sheet.pages.push(PageArea { row, width: atlas.width, height: atlas.height });
        (sheet.width, sheet.height) = (sheet.width.max(atlas.width), row + atlas.height);
        let own: f64 = list.iter().map(|&shape| shapes[shape].area).sum();
        squares += own * atlas.texels_per_metre.powi(2);
        area += own;
        for (mut chart, &shape) in atlas.charts.into_iter().zip(list) {
            chart.page = page;
            chart.texel_from_plane.translation.y += f64::from(row);
            charts.push((shape, chart));
        }
    }
    charts.sort_by_key(|&(shape, _)| shape);
    sheet.charts = charts.into_iter().map(|(_, chart)| chart).collect();
    let mean: f64 = squares / area;
    sheet.texels_per_metre = if mean.is_finite() { mean.sqrt() } else { 1.0 };
    sheet
}
