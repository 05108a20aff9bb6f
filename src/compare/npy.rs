//! NumPy's array format, as far as tables of numbers need it.
//!
//! A magic number, a version, the length of a header, the header (a Python dictionary with the element
//! type `descr`, `fortran_order` and `shape`), then the elements. Reference: "numpy.lib.format",
//! versions 1.0 to 3.0. Booleans, integers and floats of 4 and 8 bytes are read, all as `f64` (integers
//! beyond 2⁵³ are rounded); strings, complex numbers, halves and records are not.

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// Why an array cannot be read. Reads on after the array's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NpyFault {
    /// The bytes are no array.
    #[error("is not in NumPy's array format; write it with numpy.savez_compressed")]
    Format,

    /// Elements of another type.
    #[error("holds elements of type {found}; convert it to float32, float64, an integer type or bool")]
    Type {
        /// The type found, as NumPy writes it.
        found: String,
    },

    /// Fewer bytes than the shape needs.
    #[error("should have {needed} bytes of elements and has {length}; write the file again")]
    Truncated {
        /// Bytes that the shape needs.
        needed: u128,
        /// Bytes there are.
        length: usize,
    },

    /// The archive's entry does not decompress.
    #[error("is damaged ({problem}); copy or write the file again")]
    Damaged {
        /// What the decompressor says.
        problem: String,
    },

    /// More than is read.
    #[error("has {bytes} bytes, and at most {limit} are read; thin the points out")]
    TooLarge {
        /// Bytes it claims.
        bytes: u64,
        /// The most that is read.
        limit: u64,
    },

    /// Another shape than the use needs.
    #[error("has the shape {found:?} and should have {expected:?}; write one row a point")]
    Shape {
        /// The shape found.
        found: Vec<usize>,
        /// The shape that is needed.
        expected: Vec<usize>,
    },

    /// NaN or infinity.
    #[error("has a value that is not a finite number in row {row}; leave that point out")]
    NotFinite {
        /// The row, counted from 0.
        row: usize,
    },
}

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    /// Its lengths, outermost first; empty for a single number.
    pub(super) shape: Vec<usize>,
    /// Its elements, the last index fastest.
    pub(super) values: Vec<f64>,
}

impl Array {
    /// Reads the bytes of a `.npy` file.
    ///
    /// # Errors
    /// See [`NpyFault`].
    pub(super) fn read(bytes: &[u8]) -> Result<Self, NpyFault> {
        let (header, data) = split(bytes).ok_or(NpyFault::Format)?;
        let kind = value(header, "descr").and_then(quoted).ok_or(NpyFault::Format)?;
        let element = Element::parse(kind).ok_or_else(|| NpyFault::Type { found: kind.to_owned() })?;
        let is_fortran = value(header, "fortran_order").ok_or(NpyFault::Format)?.starts_with("True");
        let shape = value(header, "shape").and_then(lengths).ok_or(NpyFault::Format)?;

        let count = shape.iter().fold(1_u128, |n, &length| n.saturating_mul(length as u128));
        let needed = count.saturating_mul(element.size() as u128);
        if (data.len() as u128) < needed {
            return Err(NpyFault::Truncated { needed, length: data.len() });
        }
        let elements = data.chunks_exact(element.size()).take(count as usize);
        let mut values: Vec<f64> = elements.filter_map(|bytes| element.read(bytes)).collect();
        if let (true, &[rows, columns]) = (is_fortran, shape.as_slice()) {
            let transposed = (0..rows * columns).map(|k| values.get((k % columns) * rows + k / columns));
            values = transposed.map(|value| value.copied().unwrap_or_default()).collect();
        }
        Ok(Self { shape, values })
    }

    /// The rows of an array of `count` rows of three; fails for any other shape or what is not finite.
    pub(super) fn triples(&self, count: usize) -> Result<Vec<[f64; 3]>, NpyFault> {
        self.check_shape(&[count, 3])?;
        let rows = self.values.as_chunks::<3>().0;
        match rows.iter().position(|row| row.iter().any(|value| !value.is_finite())) {
            Some(row) => Err(NpyFault::NotFinite { row }),
            None => Ok(rows.to_vec()),
        }
    }

    /// The numbers of an array of `count` numbers; fails for any other shape.
    pub(super) fn numbers(&self, count: usize) -> Result<&[f64], NpyFault> {
        self.check_shape(&[count])?;
        Ok(&self.values)
    }

    fn check_shape(&self, expected: &[usize]) -> Result<(), NpyFault> {
        if self.shape == expected {
            return Ok(());
        }
        Err(NpyFault::Shape { found: self.shape.clone(), expected: expected.to_vec() })
    }
}

/// An element's type and byte order.
#[derive(Clone, Copy, Debug)]
struct Element {
    kind: Kind,
    is_big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bool,
    Signed(usize),
    Unsigned(usize),
    Single,
    Double,
}

impl Element {
    /// Understands `<f4`, `|b1`, `>i8` and their like.
    fn parse(text: &str) -> Option<Self> {
        let order = text.chars().next()?;
        if !"<>|=".contains(order) {
            return None;
        }
        let kind = match text.get(1..)? {
            "b1" => Kind::Bool,
            "f4" => Kind::Single,
            "f8" => Kind::Double,
            other => {
                let size = other.get(1..)?.parse().ok().filter(|size| [1, 2, 4, 8].contains(size))?;
                match other.chars().next()? {
                    'i' => Kind::Signed(size),
                    'u' => Kind::Unsigned(size),
                    _ => return None,
                }
            }
        };
        Some(Self { kind, is_big_endian: order == '>' })
    }

    fn size(self) -> usize {
        match self.kind {
            Kind::Bool => 1,
            Kind::Single => 4,
            Kind::Double => 8,
            Kind::Signed(size) | Kind::Unsigned(size) => size,
        }
    }

    fn read(self, bytes: &[u8]) -> Option<f64> {
        let mut buffer = [0_u8; 8];
        for (slot, &byte) in buffer.iter_mut().zip(bytes) {
            *slot = byte;
        }
        if self.is_big_endian {
            buffer.get_mut(..self.size())?.reverse();
        }
        let unsigned = u64::from_le_bytes(buffer);
        Some(match self.kind {
            Kind::Bool => f64::from(u8::from(unsigned != 0)),
            Kind::Unsigned(_) => unsigned as f64,
            Kind::Signed(size) => {
                let unused = 64 - 8 * size as u32;
                ((unsigned << unused).cast_signed() >> unused) as f64
            }
            Kind::Single => f32::from_le_bytes(*buffer.first_chunk()?).into(),
            Kind::Double => f64::from_le_bytes(buffer),
        })
    }
}

/// The header's text and the bytes after it.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (version, rest) = bytes.strip_prefix(MAGIC)?.split_at_checked(2)?;
    let (length, rest) = match version.first()? {
        1 => rest.split_at_checked(2)?,
        2 | 3 => rest.split_at_checked(4)?,
        _ => return None,
    };
    let length = length.iter().rev().fold(0_usize, |n, &byte| (n << 8) | usize::from(byte));
    let (header, data) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, data))
}

/// What follows `'key':` in a Python dictionary, up to its end.
fn value<'h>(header: &'h str, key: &str) -> Option<&'h str> {
    let (_, after) = header.split_once(&format!("'{key}'"))?;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

/// The string that `text` starts with.
fn quoted(text: &str) -> Option<&str> {
    text.strip_prefix('\'')?.split('\'').next()
}

/// The tuple of lengths that `text` starts with.
fn lengths(text: &str) -> Option<Vec<usize>> {
    let (inside, _) = text.strip_prefix('(')?.split_once(')')?;
    inside.split(',').map(str::trim).filter(|part| !part.is_empty()).map(|part| part.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
    }

    #[test]
    fn types_and_byte_orders_are_read() {
        let read = |descr: &str, data: &[u8]| {
            Array::read(&npy(&header(descr, "False", "(1,)"), data)).map(|array| array.values)
        };
        assert_eq!(read("<f4", &1.5_f32.to_le_bytes()).unwrap(), [1.5]);
        assert_eq!(read(">f8", &(-2.25_f64).to_be_bytes()).unwrap(), [-2.25]);
        assert_eq!(read("<i8", &(-3_i64).to_le_bytes()).unwrap(), [-3.0]);
        assert_eq!(read(">i2", &(-300_i16).to_be_bytes()).unwrap(), [-300.0]);
        assert_eq!(read("|u1", &[200]).unwrap(), [200.0]);
        assert_eq!(read("|b1", &[1]).unwrap(), [1.0]);
        assert_eq!(read("<U271", &[0; 2000]), Err(NpyFault::Type { found: "<U271".to_owned() }));
        assert_eq!(read("<f4", &[0; 3]), Err(NpyFault::Truncated { needed: 4, length: 3 }));
    }

    #[test]
    fn columns_first_becomes_rows_first() {
        let data = [1_u8, 4, 2, 5, 3, 6];
        let array = Array::read(&npy(&header("|u1", "True", "(2, 3)"), &data)).unwrap();
        assert_eq!((array.shape, array.values), (vec![2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    }

    #[test]
    fn what_is_no_array_is_refused() {
        let huge = npy(&header("<f8", "False", "(18446744073709551615, 18446744073709551615)"), &[]);
        assert!(matches!(Array::read(&huge), Err(NpyFault::Truncated { .. })));
        for bytes in [&b""[..], b"\x93NUMPY", b"\x93NUMPY\x01\x00\xff\xff{}", &npy("{}", &[])] {
            assert_eq!(Array::read(bytes), Err(NpyFault::Format));
        }
    }
}
