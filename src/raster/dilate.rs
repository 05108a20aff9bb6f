//! Fills the texels around the charts.
//!
//! No lookup inside a chart touches them, but coarser mip levels, block compression and a graphics
//! card's rounded weights do.

use rayon::prelude::*;

/// Gives invalid texels the mean of their valid neighbours among the eight around, `passes` times.
///
/// `texels` and `valid` are row by row, `size` is width and height. A texel filled in one pass is
/// valid from the next on. Passes after which nothing is left to fill are skipped; does nothing if
/// the lengths do not agree. The result does not depend on the number of threads.
pub fn dilate(texels: &mut [[f32; 3]], valid: &mut [bool], size: (u32, u32), passes: u32) {
    let (width, height) = (size.0 as usize, size.1 as usize);
    if width == 0 || width.checked_mul(height) != Some(texels.len()) || valid.len() != texels.len() {
        return;
    }
    for _ in 0..passes {
        let filled: Vec<Vec<(usize, [f32; 3])>> = (0..height)
            .into_par_iter()
            .map(|y| {
                let rows = y.saturating_sub(1)..(y + 2).min(height);
                let texel =
                    |x| Some((y * width + x, mean_of_valid(texels, valid, width, (x, rows.clone()))?));
                (0..width).filter(|x| !valid[y * width + x]).filter_map(texel).collect()
            })
            .collect();
        if filled.iter().all(Vec::is_empty) {
            return;
        }
        for (index, value) in filled.into_iter().flatten() {
            texels[index] = value;
            valid[index] = true;
        }
    }
}

/// The mean of the valid texels in three columns around `x` of the rows.
fn mean_of_valid(
    texels: &[[f32; 3]],
    valid: &[bool],
    width: usize,
    (x, rows): (usize, std::ops::Range<usize>),
) -> Option<[f32; 3]> {
    let mut sum = [0.0f32; 3];
    let mut count = 0u8;
    for row in rows {
        let columns = row * width + x.saturating_sub(1)..row * width + (x + 2).min(width);
        for (texel, _) in texels[columns.clone()].iter().zip(&valid[columns]).filter(|&(_, &valid)| valid) {
            sum.iter_mut().zip(texel).for_each(|(sum, channel)| *sum += channel);
            count += 1;
        }
    }
    (count > 0).then(|| sum.map(|s| s / f32::from(count)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLACK: [f32; 3] = [0.0; 3];

    /// A single texel grows by one ring a pass and keeps its value.
    #[test]
    fn grows_by_rings() {
        let (mut texels, mut valid) = (vec![BLACK; 49], vec![false; 49]);
        texels[24] = [1.0, 2.0, 3.0];
        valid[24] = true;
        dilate(&mut texels, &mut valid, (7, 7), 2);
        assert_eq!(valid.iter().filter(|&&v| v).count(), 25);
        assert!((0..49).all(|i| texels[i] == if valid[i] { [1.0, 2.0, 3.0] } else { BLACK }));
        dilate(&mut texels, &mut valid, (7, 7), 100);
        assert!(valid.iter().all(|&v| v));
    }

    /// What was valid stays; between two values lies their mean.
    #[test]
    fn means_of_neighbours() {
        let mut texels = vec![[1.0; 3], [9.0; 3], [3.0; 3]];
        let mut valid = vec![true, false, true];
        dilate(&mut texels, &mut valid, (3, 1), 1);
        assert_eq!(texels, [[1.0; 3], [2.0; 3], [3.0; 3]]);
    }

    #[test]
    fn nothing_valid_stays_as_it_was() {
        let (mut texels, mut valid) = (vec![[5.0; 3]; 6], vec![false; 6]);
        dilate(&mut texels, &mut valid, (3, 2), 3);
        dilate(&mut texels, &mut valid, (4, 2), 3);
        assert_eq!((texels, valid), (vec![[5.0; 3]; 6], vec![false; 6]));
    }
}
