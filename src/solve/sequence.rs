//! Well-distributed points: Sobol's sequence in four dimensions.
//!
//! Direction numbers of Joe and Kuo, "Constructing Sobol sequences with better two-dimensional
//! projections", 2008. Every aligned block of `4^k` points has one point in each cell of a
//! `2^k` by `2^k` grid over the first two dimensions.

/// Direction numbers: the primitive polynomial's inner coefficients, then the first odd numbers.
const DIMENSIONS: [(u32, &[u32]); 3] = [(0, &[1]), (1, &[1, 3]), (1, &[1, 3, 1])];

const DIRECTIONS: [[u32; 32]; 4] = directions();

const fn directions() -> [[u32; 32]; 4] {
    let mut all = [[0; 32]; 4];
    let mut bit = 0;
    while bit < 32 {
        all[0][bit] = 1 << (31 - bit);
        bit += 1;
    }
    let mut dimension = 0;
    while dimension < 3 {
        let (coefficients, first) = DIMENSIONS[dimension];
        let degree = first.len();
        let row = &mut all[dimension + 1];
        let mut i = 0;
        while i < 32 {
            if i < degree {
                row[i] = first[i] << (31 - i);
            } else {
                row[i] = row[i - degree] ^ (row[i - degree] >> degree);
                let mut k = 1;
                while k < degree {
                    if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                        row[i] ^= row[i - k];
                    }
                    k += 1;
                }
            }
            i += 1;
        }
        dimension += 1;
    }
    all
}

/// One dimension of point `index`, in units of `2^-32`.
const fn coordinate(dimension: usize, index: u32) -> u32 {
    let mut value = 0;
    let mut rest = index;
    while rest != 0 {
        value ^= DIRECTIONS[dimension][rest.trailing_zeros() as usize];
        rest &= rest - 1;
    }
    value
}

/// Point `index` of the sequence, each coordinate in `(0, 1)`; `scramble` moves all points alike and keeps
/// their distribution (a digital shift).
#[must_use]
pub fn point(index: u32, scramble: u32) -> [f64; 4] {
    std::array::from_fn(|dimension| {
        let shift = hash(scramble.wrapping_add(dimension as u32));
        (f64::from(coordinate(dimension, index) ^ shift) + 0.5) / 4_294_967_296.0
    })
}

/// Two numbers in `(0, 1)` that nothing in [`point`] of the same `index` and `scramble` is related to.
#[must_use]
pub fn scattered(index: u32, scramble: u32) -> [f64; 2] {
    [1, 2].map(|k| {
        (f64::from(hash(hash(index).wrapping_add(hash(scramble ^ k << 30)))) + 0.5) / 4_294_967_296.0
    })
}

/// Spreads neighbouring numbers over all (Wellons, "Prospecting for hash functions", 2018: lowbias32).
fn hash(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_block_fills_a_grid() {
        for scramble in [0, 7] {
            let mut seen = [false; 256];
            for index in 512..768 {
                let [u, v, ..] = point(index, scramble);
                let cell = (u * 16.0) as usize * 16 + (v * 16.0) as usize;
                assert!(!std::mem::replace(&mut seen[cell], true));
            }
        }
    }

    /// The mean of a product over 4,096 points is far nearer than random points would bring it.
    #[test]
    fn products_are_integrated_well() {
        let mean =
            (0..4096).map(|i| point(i, 3).iter().map(|x| 2.0 * x).product::<f64>()).sum::<f64>() / 4096.0;
        assert!((mean - 1.0).abs() < 2e-3, "{mean}");
    }
}
