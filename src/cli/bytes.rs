//! Amounts of data as people type them.

/// What may stand behind the number; case does not matter.
const UNITS: [(&str, f64); 8] = [
    ("", 1.0),
    ("b", 1.0),
    ("kb", 1e3),
    ("kib", 1024.0),
    ("mb", 1e6),
    ("mib", 1024.0 * 1024.0),
    ("gb", 1e9),
    ("gib", 1024.0 * 1024.0 * 1024.0),
];

/// The number of bytes that `text` means, such as `4MiB`, `1.5 MB` or `65536`; a fraction of a byte is dropped.
pub(crate) fn parse(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let unit = unit.trim().to_ascii_lowercase();
    let factor = UNITS.iter().find(|(name, _)| *name == unit).map(|&(_, factor)| factor);
    match (number.parse::<f64>(), factor) {
        // A cast from floating point saturates; what is too much is refused with the other options.
        (Ok(number), Some(factor)) => Ok((number * factor) as u64),
        _ => Err("give a number of bytes, or a number with KB, KiB, MB, MiB, GB or GiB".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn units_of_a_thousand_and_of_1024() {
        for (text, bytes) in [
            ("65536", 65536),
            ("17b", 17),
            ("64KiB", 65536),
            ("64kb", 64000),
            ("4MiB", 4 << 20),
            ("1.5 MB", 1_500_000),
            (" 0.25mib ", 1 << 18),
            ("1GiB", 1 << 30),
            ("0", 0),
        ] {
            assert_eq!(parse(text), Ok(bytes), "{text:?}");
        }
    }

    #[test]
    fn what_is_no_amount_is_refused() {
        for text in ["", "MiB", "4M", "4MiBs", "-1", "1e6", "1.2.3KB", "four", "NaN", "0x10"] {
            assert!(parse(text).is_err(), "{text:?}");
        }
    }
}
