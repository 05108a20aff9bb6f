//! The page that fills a number of bytes and is not a byte over.
//!
//! What a page takes in the file is known only once it is encoded. So pages are made of about as many
//! texels as should fit, and the number is corrected by what the last ones took. The light is neither
//! solved nor surveyed again for that.

use crate::error::Error;
use crate::options::Quantity;
use crate::progress::Stage;
use crate::report::Recorder;
use crate::unwrap::Room;

use super::enter;
use super::page::{Page, PageMaker};
use super::written::Written;

/// Bytes that a texel takes in the EXR, about, gaps counted.
const EXR_A_TEXEL: f64 = 2.7;

/// Bytes that a texel takes in the PNG, about.
const PNG_A_TEXEL: f64 = 1.1;

/// Bytes that there are for any page: headers, and tables of the compression.
const HEADERS: f64 = 700.0;

/// A page has at least this many texels, whatever the budget: what follows from its density needs one.
const FEWEST: f64 = 256.0;

/// More texels than this are not aimed at: pages have sides of 16384 texels at most.
const MOST: f64 = 0.9 * 16384.0 * 16384.0;

/// The share of the budget that is aimed at; a page of as many texels may take some per cent more or less.
const AIM: f64 = 0.97;

/// The share that ends the search.
const ENOUGH: f64 = 0.93;

/// The share below which the search goes on a little longer.
const POOR: f64 = 0.9;

/// Pages that are made, usually at most,
const ROUNDS: usize = 4;
/// and in any case.
const MOST_ROUNDS: usize = 7;

/// How many texels fit into so many bytes, about.
pub(super) fn texels_for(bytes: u64, quantity: Quantity) -> f64 {
    let a_texel = match quantity {
        Quantity::Radiosity => EXR_A_TEXEL,
        Quantity::Irradiance | Quantity::Radiance => EXR_A_TEXEL + PNG_A_TEXEL,
    };
    ((AIM * bytes as f64 - HEADERS) / a_texel).clamp(FEWEST, MOST)
}

/// The fullest page found that takes at most `budget` bytes.
pub(super) fn within(maker: &PageMaker, budget: u64, recorder: &mut Recorder) -> Result<Page, Error> {
    let padding = maker.options().padding;
    let mut rays = 0;
    let mut best = search(maker, (budget, padding), &mut rays, recorder)?;
    if best.is_none() && padding.is_none() {
        // Many small charts are mostly gaps.
        best = search(maker, (budget, Some(0)), &mut rays, recorder)?;
    }
    let mut page = match best {
        Some(page) => page,
        None => {
            let page = maker.least_page(recorder)?;
            let least = bytes_of(maker, &page, recorder)?;
            rays += page.texels.effort.rays;
            if least > budget {
                return Err(Error::Budget { budget, least });
            }
            page
        }
    };
    page.texels.effort.rays = rays;
    Ok(page)
}

/// The fullest page found with that padding; counts the `rays` that all took.
fn search(
    maker: &PageMaker,
    (budget, padding): (u64, Option<u32>),
    rays: &mut u64,
    recorder: &mut Recorder,
) -> Result<Option<Page>, Error> {
    let first = texels_for(budget, maker.options().quantity);
    let mut search = Search { budget: budget as f64, first, tries: Vec::new() };
    let mut best: Option<(u64, Page)> = None;
    while let Some(texels) = search.next() {
        let page = maker.page_of(Room::Texels(texels), padding, recorder)?;
        let bytes = bytes_of(maker, &page, recorder)?;
        *rays += page.texels.effort.rays;
        // Charts that do not want the texels that there are for them will not want more.
        let grown = |side: u32| f64::from(side + page.atlas.gutter);
        let made = grown(page.atlas.width) * grown(page.atlas.height);
        let is_sated = made < POOR * texels;
        tracing::debug!(texels, made, bytes, budget, "budget");
        search.tries.push(Try { texels, bytes: bytes as f64, is_sated });
        if bytes <= budget && best.as_ref().is_none_or(|(most, _)| bytes > *most) {
            best = Some((bytes, page));
        }
    }
    Ok(best.map(|(_, page)| page))
}

fn bytes_of(maker: &PageMaker, page: &Page, recorder: &mut Recorder) -> Result<u64, Error> {
    enter(recorder, Stage::Export)?;
    Ok(Written::of(page, maker.options())?.sum())
}

/// A page that was made.
#[derive(Clone, Copy, Debug)]
struct Try {
    /// That were asked for.
    texels: f64,
    /// That it takes.
    bytes: f64,
    /// Whether the charts took fewer texels than they were offered.
    is_sated: bool,
}

struct Search {
    budget: f64,
    /// Texels of the first page.
    first: f64,
    tries: Vec<Try>,
}

impl Search {
    /// How many texels to try next; `None` where another page is not worth it.
    fn next(&self) -> Option<f64> {
        let Some(last) = self.tries.last() else { return Some(self.first) };
        let fits = |t: &&Try| t.bytes <= self.budget;
        let under = self.tries.iter().filter(fits).max_by(|a, b| a.bytes.total_cmp(&b.bytes));
        let over = self.tries.iter().filter(|t| !fits(t)).min_by(|a, b| a.texels.total_cmp(&b.texels));
        let share = under.map_or(0.0, |t| t.bytes / self.budget);
        let rounds = if share < POOR { MOST_ROUNDS } else { ROUNDS };
        if share >= ENOUGH || under.is_some_and(|t| t.is_sated) || self.tries.len() >= rounds {
            return None;
        }
        let aim = AIM * self.budget;
        let next = match (under, over) {
            // Between two pages, bytes go with texels.
            (Some(u), Some(o)) => {
                u.texels + (o.texels - u.texels) * ((aim - u.bytes) / (o.bytes - u.bytes)).clamp(0.02, 0.98)
            }
            _ => {
                let factor = (aim - HEADERS).max(1.0) / (last.bytes - HEADERS).max(1.0);
                last.texels * factor.clamp(0.1, 10.0)
            }
        };
        let next = next.clamp(1.0, MOST);
        // The same page would come out.
        let is_new = self.tries.iter().all(|t| (next / t.texels - 1.0).abs() > 1e-3);
        let is_stuck = matches!(self.tries[..], [.., a, b] if a.bytes == b.bytes);
        (is_new && !is_stuck).then_some(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Searches a budget where `bytes` tells what a page of so many texels takes; the best and the rounds.
    fn search(budget: f64, bytes: impl Fn(f64) -> f64) -> (f64, usize) {
        let mut search =
            Search { budget, first: texels_for(budget as u64, Quantity::Irradiance), tries: vec![] };
        while let Some(texels) = search.next() {
            search.tries.push(Try { texels, bytes: bytes(texels), is_sated: false });
        }
        let fitting = search.tries.iter().map(|t| t.bytes).filter(|&b| b <= budget);
        (fitting.fold(0.0, f64::max), search.tries.len())
    }

    #[test]
    fn budgets_are_met_in_few_rounds_whatever_a_texel_takes() {
        for budget in [1e4, 1e5, 1e6, 1e7] {
            for a_texel in [0.5, 2.0, 4.0, 9.0, 14.0] {
                let (best, rounds) = search(budget, |texels| 500.0 + a_texel * texels.powf(0.98));
                assert!(
                    best >= POOR * budget && rounds <= ROUNDS,
                    "{best} of {budget} in {rounds}: {a_texel}"
                );
                // Compression does not go smoothly.
                let uneven = |texels: f64| 500.0 + a_texel * texels * (1.0 + 0.02 * (texels * 0.37).sin());
                let (best, rounds) = search(budget, uneven);
                assert!(best >= POOR * budget && rounds <= MOST_ROUNDS, "{best} of {budget} in {rounds}");
            }
        }
    }

    #[test]
    fn what_never_fits_is_given_up() {
        let (best, rounds) = search(1000.0, |texels| 5000.0 + texels.max(100.0));
        assert!(best == 0.0 && rounds <= MOST_ROUNDS, "{best} in {rounds}");
    }
}
