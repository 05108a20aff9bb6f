//! A grid of bits.

/// A rectangle of bits, all clear at first.
#[derive(Clone, Debug)]
pub(super) struct BitGrid {
    width: usize,
    height: usize,
    stride: usize,
    words: Vec<u64>,
}

impl BitGrid {
    /// A clear grid.
    pub(super) fn new(width: usize, height: usize) -> Self {
        let stride = width.div_ceil(64);
        Self { width, height, stride, words: vec![0; stride * height] }
    }

    /// Sets the bits from `first` to `last` (both included) of row `y`; what lies outside is left out.
    pub(super) fn set_span(&mut self, y: i64, first: i64, last: i64) {
        let first = first.max(0) as usize;
        let Ok(y) = usize::try_from(y) else { return };
        let Ok(last) = usize::try_from(last.min(self.width as i64 - 1)) else { return };
        if y >= self.height || first > last {
            return;
        }
        let row = &mut self.words[y * self.stride..(y + 1) * self.stride];
        let (low, high) = (first / 64, last / 64);
        for (word, bits) in row.iter_mut().enumerate().take(high + 1).skip(low) {
            let from = if word == low { u64::MAX << (first % 64) } else { u64::MAX };
            let to = if word == high { u64::MAX >> (63 - last % 64) } else { u64::MAX };
            *bits |= from & to;
        }
    }

    /// Sets the bits of `part`, its corner at `(x, y)`, and tells whether all of them were clear
    /// and inside.
    pub(super) fn stamp(&mut self, part: &BitGrid, x: usize, y: usize) -> bool {
        let (shift, offset) = (x % 64, x / 64);
        let mut free = x + part.width <= self.stride * 64 && y + part.height <= self.height;
        for row in 0..part.height.min(self.height.saturating_sub(y)) {
            let source = &part.words[row * part.stride..(row + 1) * part.stride];
            let target = &mut self.words[(y + row) * self.stride..(y + row + 1) * self.stride];
            for (word, &bits) in source.iter().enumerate() {
                let parts = [bits << shift, if shift == 0 { 0 } else { bits >> (64 - shift) }];
                for (k, part) in parts.into_iter().enumerate().filter(|&(_, part)| part != 0) {
                    match target.get_mut(offset + word + k) {
                        Some(into) => {
                            free &= *into & part == 0;
                            *into |= part;
                        }
                        None => free = false,
                    }
                }
            }
        }
        free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_and_stamps_agree_with_single_bits() {
        let mut page = BitGrid::new(200, 3);
        let mut part = BitGrid::new(130, 2);
        part.set_span(0, 0, 129);
        part.set_span(1, 64, 64);
        assert!(page.stamp(&part, 67, 1));
        let set: Vec<_> =
            (0..200).filter(|x| page.words[page.stride + x / 64] >> (x % 64) & 1 == 1).collect();
        assert_eq!(set, (67..197).collect::<Vec<_>>());
        assert_eq!(page.words[2 * page.stride..], [0, 0, 1 << 3, 0], "67 + 64 is bit 3 of word 2");
        assert!(page.clone().stamp(&part, 0, 0), "only bit 64 comes to row 1, and that is clear");
        assert!(!page.clone().stamp(&part, 3, 0), "bit 67 of row 1 is taken");
        assert!(!page.clone().stamp(&part, 0, 2), "the second row falls off the page");
    }

    #[test]
    fn spans_outside_are_left_out() {
        let mut grid = BitGrid::new(70, 2);
        grid.set_span(-1, 0, 10);
        grid.set_span(2, 0, 10);
        grid.set_span(0, 70, 90);
        grid.set_span(0, -9, -1);
        assert!(grid.words.iter().all(|&w| w == 0));
        grid.set_span(0, -5, 500);
        assert_eq!(grid.words[..2], [u64::MAX, 0x3f]);
    }
}
