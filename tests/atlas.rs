//! Charts keep apart, and every texel that a lookup can touch has a site of its own surface.

use std::collections::BTreeMap;

use cobake::geom::{Frame, polygon};
use cobake::raster::{SitePosition, TexelSite, sites};
use cobake::surface::{Region, Surface};
use cobake::unwrap::{Atlas, Room, UnwrapError, UnwrapOptions, whole};
use glam::{DVec2, DVec3};

/// Texel coordinates are sums of few f64 of at most 2^14.
const ROUNDING: f64 = 1e-9;

/// Weights of a lookup below this are rounding, not light.
const NO_WEIGHT: f64 = 1e-4;

/// Sites are moved this far off a region's edge at most, texels (twice the documented margin: corners).
const MARGIN: f64 = 2.0 / 64.0;

/// Numbers that look random and are the same on every run (Marsaglia's xorshift, 2003).
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}

fn region(triangles: Vec<[DVec2; 3]>, ring: Vec<DVec2>) -> Region {
    let area = polygon::signed_area(&ring);
    Region { rings: vec![ring], triangles, area }
}

fn surface(ring: Vec<DVec2>, regions: Vec<Region>) -> Surface {
    Surface {
        placement: 0,
        material: 0,
        frame: Frame::new(DVec3::ZERO, DVec3::Z, DVec3::X),
        area: regions.iter().map(|r| r.area).sum(),
        rings: vec![ring],
        source_triangles: Vec::new(),
        regions,
        smooth: None,
        double_sided: false,
    }
}

/// A polygon that corner `from` sees all of.
fn star(corners: &[(f64, f64)], from: usize) -> Surface {
    let ring: Vec<DVec2> = corners.iter().map(|&(x, y)| DVec2::new(x - 3.0, y + 7.0)).collect();
    let n = ring.len();
    let triangles =
        (1..n - 1).map(|k| [ring[from], ring[(from + k) % n], ring[(from + k + 1) % n]]).collect();
    surface(ring.clone(), vec![region(triangles, ring)])
}

fn rectangle(w: f64, h: f64) -> Surface {
    star(&[(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)], 0)
}

/// An L: `thick` is the arms' width.
fn angle(w: f64, h: f64, thick: f64) -> Surface {
    star(&[(0.0, 0.0), (w, 0.0), (w, thick), (thick, thick), (thick, h), (0.0, h)], 3)
}

/// The same L cut by a contact edge whose end is a T-junction, so that its parts share no corner.
fn cut_angle(w: f64, h: f64, thick: f64) -> Surface {
    let ring = angle(w, h, thick).rings.remove(0);
    let (half, p) = (DVec2::new(thick / 2.0, 0.0), DVec2::new(0.0, thick));
    let lower = [ring[0], ring[1], ring[2], ring[0] + p];
    let upper = [ring[0] + half + p, ring[3], ring[4], ring[5] + half];
    let rest = [ring[0] + p, ring[0] + p + half, ring[5] + half, ring[5]];
    let part = |q: [DVec2; 4]| region(vec![[q[0], q[1], q[2]], [q[0], q[2], q[3]]], q.to_vec());
    surface(ring, vec![part(lower), part(upper), part(rest)])
}

/// Walls, strips of a millimetre, Ls, triangles, needles.
fn furniture(count: usize, seed: u64) -> Vec<Surface> {
    let mut r = Random(seed);
    (0..count)
        .map(|i| {
            let (w, h) = (r.between(0.02, 1.5), r.between(0.02, 1.0));
            match i % 8 {
                0 => rectangle(3.0 * w, 2.0 * h),
                1 | 2 => rectangle(w, 0.001),
                3 => angle(2.0 * w, 2.0 * h, 0.3 * w.min(h)),
                4 => cut_angle(2.0 * w, 2.0 * h, 0.3 * w.min(h)),
                5 => star(&[(0.0, 0.0), (w, 0.0), (r.between(0.0, w), h)], 0),
                6 => star(&[(0.0, 0.0), (w, 0.0), (w * 0.5, 1e-7)], 0),
                _ => rectangle(0.3 * w, h),
            }
        })
        .collect()
}

/// One chart a surface.
fn unwrap(surfaces: &[Surface], options: &UnwrapOptions) -> Result<Atlas, UnwrapError> {
    cobake::unwrap::unwrap(surfaces, &whole(surfaces), options)
}

fn at_size(side: u32) -> UnwrapOptions {
    UnwrapOptions::new(Room::Square(side))
}

fn all_open(_: usize, _: usize) -> bool {
    true
}

/// Points of a surface: corners, edges and inner points of its triangles.
fn points(surface: &Surface) -> impl Iterator<Item = DVec2> + '_ {
    const STEPS: u32 = 12;
    let triangles = surface.regions.iter().flat_map(|r| &r.triangles);
    triangles.flat_map(|&[a, b, c]| {
        (0..=STEPS).flat_map(move |i| {
            (0..=STEPS - i).map(move |j| {
                let (u, v) = (f64::from(i) / f64::from(STEPS), f64::from(j) / f64::from(STEPS));
                a + u * (b - a) + v * (c - a)
            })
        })
    })
}

/// The texels that have weight in a bilinear lookup at `p`.
fn touched(p: DVec2) -> impl Iterator<Item = (i64, i64)> {
    let (base, f) = ((p - 0.5).floor(), (p - 0.5) - (p - 0.5).floor());
    [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().filter_map(move |(dx, dy)| {
        let weight = if dx == 0 { 1.0 - f.x } else { f.x } * if dy == 0 { 1.0 - f.y } else { f.y };
        (weight > NO_WEIGHT).then_some((base.x as i64 + dx, base.y as i64 + dy))
    })
}

fn owners(sites: &[TexelSite]) -> BTreeMap<(i64, i64), u32> {
    let map: BTreeMap<_, _> = sites.iter().map(|s| ((i64::from(s.x), i64::from(s.y)), s.chart)).collect();
    assert_eq!(map.len(), sites.len(), "no texel has two sites");
    map
}

fn assert_sound(surfaces: &[Surface], atlas: &Atlas) {
    assert_eq!(atlas.charts.len(), surfaces.len());
    let owner = owners(&sites(surfaces, atlas, &all_open));
    for (index, (surface, chart)) in surfaces.iter().zip(&atlas.charts).enumerate() {
        for p in points(surface) {
            for texel in touched(chart.texel(p)) {
                assert_eq!(owner.get(&texel), Some(&(index as u32)), "surface {index}, texel {texel:?}");
            }
        }
        let m = chart.texel_from_plane.matrix2;
        assert!(
            m.x_axis.min_element().abs().min(m.x_axis.max_element().abs()) < ROUNDING,
            "axes stay axes: {m}"
        );
        let (low, high) = surface.extent();
        let texels = (chart.texel(high) - chart.texel(low)).abs();
        assert!((texels - texels.round()).abs().max_element() < ROUNDING, "whole texels: {texels}");
        let wanted = (high - low) * atlas.texels_per_metre;
        let got = if m.x_axis.x == 0.0 { DVec2::new(texels.y, texels.x) } else { texels };
        assert!((got - wanted.max(DVec2::ONE)).abs().max_element() <= 0.5 + ROUNDING, "{got} for {wanted}");
    }
    let gap = i64::from(atlas.gutter);
    for (&(x, y), surface) in &owner {
        assert!(x < i64::from(atlas.width) && y < i64::from(atlas.height));
        for dy in -gap..=gap {
            for dx in -gap..=gap {
                let other = owner.get(&(x + dx, y + dy)).unwrap_or(surface);
                assert_eq!(other, surface, "at {x}, {y} and {dx}, {dy} from there");
            }
        }
    }
}

#[test]
fn charts_keep_apart_on_a_page_of_given_size() {
    for (seed, side) in [(1, 64), (2, 128), (3, 200), (4, 256)] {
        let surfaces = furniture(48, seed);
        let atlas = unwrap(&surfaces, &at_size(side)).unwrap();
        assert_eq!(atlas.gutter, 1);
        assert!(atlas.width.min(atlas.height) > side * 7 / 8 && atlas.width.max(atlas.height) <= side);
        assert_sound(&surfaces, &atlas);
    }
}

#[test]
fn charts_keep_apart_at_a_given_density() {
    let surfaces = furniture(40, 5);
    for (texels_per_metre, padding) in [(1e-9, 2), (8.0, 0), (20.0, 3)] {
        let options =
            UnwrapOptions { padding: Some(padding), ..UnwrapOptions::new(Room::Density(texels_per_metre)) };
        let atlas = unwrap(&surfaces, &options).unwrap();
        assert_eq!((atlas.width % 4, atlas.height % 4), (0, 0));
        assert_eq!((atlas.texels_per_metre, atlas.gutter), (texels_per_metre, 2 * padding));
        assert_sound(&surfaces, &atlas);
    }
}

/// A page that the charts do not need is not written: what no chart reaches is cut off.
#[test]
fn pages_are_cropped_to_their_charts() {
    // Four squares of at most 10 texels in a page of 256.
    let few: Vec<_> = (0..4).map(|_| rectangle(1.0, 1.0)).collect();
    let atlas = unwrap(&few, &UnwrapOptions { most: Some(10.0), ..at_size(256) }).unwrap();
    assert_sound(&few, &atlas);
    assert_eq!((atlas.texels_per_metre, atlas.width, atlas.height), (10.0, 24, 24));
    // One of 3 : 1 fills a page's width and not its height.
    let wide = [rectangle(3.0, 1.0)];
    let atlas = unwrap(&wide, &at_size(256)).unwrap();
    assert_sound(&wide, &atlas);
    let (long, short) = (atlas.width.max(atlas.height), atlas.width.min(atlas.height));
    assert_eq!((long, short), (256, 88), "85 and one texels, in fours");
}

/// Where only the density is given the page takes any shape, and hardly more texels than the charts and the gaps between them.
#[test]
fn the_least_page_is_small() {
    let mut r = Random(9);
    let surfaces: Vec<_> = (0..200).map(|_| rectangle(r.between(0.1, 2.0), r.between(0.1, 1.0))).collect();
    for texels in [3_000.0, 30_000.0, 300_000.0] {
        let atlas = unwrap(&surfaces, &UnwrapOptions::new(Room::Texels(texels))).unwrap();
        assert_sound(&surfaces, &atlas);
        assert_eq!((atlas.width % 4, atlas.height % 4), (0, 0));
        let page = f64::from(atlas.width) * f64::from(atlas.height);
        assert!(page < 1.15 * texels && page > 0.75 * texels, "{page} for {texels}");
    }
    // Fewer texels than one a chart there cannot be.
    let atlas = unwrap(&surfaces, &UnwrapOptions::new(Room::Texels(1.0))).unwrap();
    assert!(atlas.width * atlas.height <= 48 * 48, "200 charts of 3 × 3 with the gaps between them");
    assert_sound(&surfaces, &atlas);
}

/// Rectangles fill a page well: what a rectangle packer is for.
#[test]
fn rectangles_fill_the_page() {
    let mut r = Random(6);
    let surfaces: Vec<_> = (0..400).map(|_| rectangle(r.between(0.1, 2.0), r.between(0.1, 1.0))).collect();
    let atlas = unwrap(&surfaces, &at_size(512)).unwrap();
    let reserved: f64 = atlas
        .charts
        .iter()
        .zip(&surfaces)
        .map(|(chart, s)| {
            let (low, high) = s.extent();
            let texels = (chart.texel(high) - chart.texel(low)).abs() + 3.0;
            texels.x * texels.y
        })
        .sum();
    assert!(reserved > 0.92 * 514.0 * 514.0, "{reserved}");
}

/// Big Ls lie in each other's arms; their bounding rectangles alone would be larger than the page.
#[cfg(feature = "xatlas")]
#[test]
fn angles_nest() {
    let surfaces: Vec<_> = (0..12).map(|_| angle(1.0, 1.2, 0.2)).collect();
    let atlas = unwrap(&surfaces, &at_size(256)).unwrap();
    assert_sound(&surfaces, &atlas);
    let bounds = 12.0 * 1.2 * atlas.texels_per_metre.powi(2);
    assert!(bounds > 1.1 * 256.0 * 256.0, "{bounds}");
}

#[test]
fn the_same_input_gives_the_same_atlas_and_sites_at_any_thread_count() {
    let surfaces = furniture(60, 7);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let atlas = unwrap(&surfaces, &at_size(256)).unwrap();
            let sites = sites(&surfaces, &atlas, &all_open);
            (atlas.charts, sites)
        })
    };
    let (one, five) = (run(1), run(5));
    assert!(one == five);
    assert!(one == run(1));
}

#[test]
fn sites_lie_inside_their_region_as_near_as_can_be() {
    let surfaces = furniture(56, 8);
    let atlas = unwrap(&surfaces, &at_size(300)).unwrap();
    let (mut centred, mut moved) = (0, 0);
    for site in sites(&surfaces, &atlas, &all_open) {
        let (surface, chart) = (&surfaces[site.chart as usize], &atlas.charts[site.chart as usize]);
        let region = &surface.regions[site.region as usize];
        assert!(polygon::contains(&region.rings, site.point), "{site:?}");
        let centre = DVec2::new(f64::from(site.x), f64::from(site.y)) + 0.5;
        let distance = chart.texel(site.point).distance(centre);
        let nearest = points(surface).map(|p| chart.texel(p).distance(centre)).fold(f64::INFINITY, f64::min);
        assert!(distance <= nearest + MARGIN, "{site:?}: {distance} from the centre, {nearest} is possible");
        match site.position {
            SitePosition::Centre => centred += 1,
            SitePosition::Moved => moved += 1,
            SitePosition::Buried => panic!("nothing is buried: {site:?}"),
        }
        assert!(site.position != SitePosition::Centre || distance <= MARGIN, "{site:?}");
    }
    assert!(centred > 20_000 && moved > 500, "both kinds occur: {centred}, {moved}");
}

/// A floor of which the right half is under a cupboard: texels at the border are lit as the left
/// half is, and texels far under it say that they are buried.
#[test]
fn buried_regions_give_way_to_open_ones() {
    let strip = |x: f64| [(x, 0.0), (x + 2.0, 0.0), (x + 2.0, 3.0), (x, 3.0)].map(DVec2::from).to_vec();
    let halves = [strip(0.0), strip(2.0)].map(|q| region(vec![[q[0], q[1], q[2]], [q[0], q[2], q[3]]], q));
    let ring = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)].map(DVec2::from).to_vec();
    let floor = surface(ring, halves.to_vec());
    let floors = [floor];
    let atlas = unwrap(&floors, &UnwrapOptions::new(Room::Density(10.25))).unwrap();
    let chart = &atlas.charts[0];
    let mut counts = [0; 3];
    for site in sites(&floors, &atlas, &|_, region| region == 0) {
        let centre = DVec2::new(f64::from(site.x), f64::from(site.y)) + 0.5;
        let x = chart.texel_from_plane.inverse().transform_point2(centre).x;
        let texels_under = (x - 2.0) * 10.25;
        let expected = match site.position {
            SitePosition::Buried => site.region == 1 && texels_under > 1.4,
            SitePosition::Moved => site.region == 0 && (0.0..1.6).contains(&texels_under),
            SitePosition::Centre => site.region == 0 && texels_under < ROUNDING,
        };
        assert!(expected, "{site:?}, {texels_under} texels under the cupboard");
        counts[site.position as usize] += 1;
    }
    assert!(counts.iter().all(|&c| c > 20), "all kinds occur: {counts:?}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let many: Vec<_> = (0..300).map(|_| rectangle(1.0, 1.0)).collect();
    let padded = UnwrapOptions { padding: Some(1), ..at_size(32) };
    assert_eq!(
        unwrap(&many, &padded).err(),
        Some(UnwrapError::TooSmall { charts: 300, gutter: 2, side: 32 })
    );
    let huge = UnwrapOptions::new(Room::Density(1e5));
    assert!(matches!(unwrap(&many, &huge), Err(UnwrapError::TooLarge { charts: 300, .. })));
}

/// What is too much for the largest page, or for the one asked for, goes to several; groups stay whole where they can.
#[test]
fn several_pages_hold_what_one_does_not() {
    let floors: Vec<_> = (0..4).map(|_| rectangle(8.0, 10.0)).collect();
    let dense = UnwrapOptions::new(Room::Density(1000.0));
    assert!(matches!(unwrap(&floors, &dense), Err(UnwrapError::TooLarge { charts: 4, .. })));
    let atlas = unwrap(&floors, &UnwrapOptions { pages: 8, ..dense }).unwrap();
    assert_eq!(atlas.pages.len(), 2, "no more than needed");
    assert!(atlas.charts.iter().all(|chart| chart.texel_from_plane.matrix2.determinant().abs() == 1e6));

    let mut many: Vec<_> = (0..300).map(|_| rectangle(1.0, 1.0)).collect();
    many.iter_mut().enumerate().for_each(|(index, surface)| surface.placement = index % 10);
    let options = UnwrapOptions { padding: Some(1), pages: 5, ..at_size(32) };
    let atlas = unwrap(&many, &options).unwrap();
    assert_eq!(atlas.pages.len(), 5);
    assert_sound(&many, &atlas);
    for chart in &atlas.charts {
        let page = atlas.pages[chart.page];
        assert!(page.width <= 32 && page.height <= 32);
        for p in points(&many[chart.surface]) {
            let texel = chart.texel(p) - DVec2::new(0.0, page.row.into());
            assert!(texel.cmpge(DVec2::ZERO).all(), "{texel}");
            assert!(texel.x <= page.width.into() && texel.y <= page.height.into(), "{texel}");
        }
    }
    let split = (0..10).filter(|placement| {
        let mut pages =
            atlas.charts.iter().filter(|c| many[c.surface].placement == *placement).map(|c| c.page);
        let first = pages.next();
        pages.any(|page| Some(page) != first)
    });
    assert_eq!(split.count(), 0, "two of ten groups on each of five pages");
}

/// Without padding asked for, crowded charts give up the gaps between them before they are refused.
#[test]
fn crowded_charts_do_without_gaps() {
    let many: Vec<_> = (0..200).map(|_| rectangle(1.0, 1.0)).collect();
    let atlas = unwrap(&many, &at_size(32)).unwrap();
    assert_eq!(atlas.gutter, 0);
    assert_sound(&many, &atlas);
}

#[test]
fn degenerate_input_gets_a_chart() {
    let none = unwrap(&[], &at_size(64)).unwrap();
    assert_eq!((none.width, none.height, none.charts.len()), (4, 4, 0));
    assert!(sites(&[], &none, &all_open).is_empty());
    let mut odd = vec![rectangle(1e-12, 1e-12), rectangle(1.0, 1.0), rectangle(1e7, 1e-3)];
    odd.push(surface(Vec::new(), Vec::new()));
    odd.push(star(&[(0.0, 0.0), (f64::NAN, 0.0), (1.0, f64::INFINITY)], 0));
    let atlas = unwrap(&odd, &at_size(64)).unwrap();
    assert_eq!(atlas.charts.len(), odd.len());
    assert!(atlas.charts.iter().all(|c| c.texel_from_plane.inverse().is_finite()));
    let sites = sites(&odd, &atlas, &all_open);
    assert!((0..3).all(|k| sites.iter().any(|s| s.chart == k)));
    assert!(sites.iter().all(|s| s.chart < 3 && s.point.is_finite()));
}
