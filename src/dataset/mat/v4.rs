//! MATLAB files of version 4: matrices one after the other, each with a head of twenty bytes.

use super::super::arrays::{Array, Arrays};
use super::super::numbers::{Number, NumberKind};

/// Longest name of a variable.
const MAX_NAME: usize = 256;

/// Head of a matrix.
struct Head {
    number: Number,
    is_full: bool,
    is_complex: bool,
    rows: usize,
    columns: usize,
    name: usize,
}

/// Reads a head; `None` where these bytes are none.
fn head(bytes: &[u8]) -> Option<Head> {
    let words: [[u8; 4]; 5] = bytes.get(..20)?.as_chunks::<4>().0.try_into().ok()?;
    let kind = [u32::from_le_bytes(words[0]), u32::from_be_bytes(words[0])];
    let big_endian = match kind {
        [little, _] if little < 1000 => false,
        [_, big] if (1000..2000).contains(&big) => true,
        _ => return None,
    };
    let word = |i: usize| {
        if big_endian { u32::from_be_bytes(words[i]) } else { u32::from_le_bytes(words[i]) }
    };
    let (kind, digits) = (word(0), |place: u32| word(0) / place % 10);
    let (number, bytes) = match digits(10) {
        0 => (NumberKind::Float, 8),
        1 => (NumberKind::Float, 4),
        2 => (NumberKind::Signed, 4),
        3 => (NumberKind::Signed, 2),
        4 => (NumberKind::Unsigned, 2),
        5 => (NumberKind::Unsigned, 1),
        _ => return None,
    };
    let is_sound = kind / 1000 == u32::from(big_endian) && digits(100) == 0 && digits(1) <= 2 && word(3) <= 1;
    let name = word(4) as usize;
    (is_sound && (2..=MAX_NAME).contains(&name)).then_some(Head {
        number: Number { kind: number, bytes, big_endian },
        is_full: digits(1) == 0,
        is_complex: word(3) == 1,
        rows: word(1) as usize,
        columns: word(2) as usize,
        name,
    })
}

/// Whether a file begins with a head and a name that ends with a zero.
pub(super) fn begins(bytes: &[u8]) -> bool {
    let Some(head) = head(bytes) else { return false };
    let name = bytes.get(20..20 + head.name);
    name.is_some_and(|name| {
        name.last() == Some(&0)
            && name[..head.name - 1].iter().all(|b| b.is_ascii_alphanumeric() || *b == b'_')
    })
}

/// Every real matrix of a file.
pub(super) fn arrays(bytes: &[u8]) -> Result<Arrays, String> {
    if !begins(bytes) {
        return Err("it has no MATLAB header".to_owned());
    }
    let cut = || "it ends in the middle of a variable; copy it again".to_owned();
    let mut found = Arrays { format: "MATLAB file, version 4 (.mat)".to_owned(), ..Arrays::default() };
    let mut rest = bytes;
    while !rest.is_empty() {
        let head = head(rest).ok_or_else(cut)?;
        let name = rest.get(20..20 + head.name).ok_or_else(cut)?;
        let name = String::from_utf8_lossy(name.split(|b| *b == 0).next().unwrap_or_default()).into_owned();
        let count = head.rows.checked_mul(head.columns).ok_or_else(cut)?;
        let size = count.checked_mul(head.number.bytes).ok_or_else(cut)?;
        let all = size.checked_mul(1 + usize::from(head.is_complex)).ok_or_else(cut)?;
        let after = 20 + head.name;
        let data = rest.get(after..after.checked_add(all).ok_or_else(cut)?).ok_or_else(cut)?;
        if head.is_full && !head.is_complex {
            if count > super::super::MAX_VALUES {
                return Err(super::super::too_many(count));
            }
            let (sides, values) = (vec![head.rows, head.columns], head.number.read_all(&data[..size]));
            found.all.push(Array { name, sides, values, unit: None });
        }
        rest = &rest[after + all..];
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_of_both_orders() {
        for big in [false, true] {
            let word = |v: u32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
            let double = |v: f64| if big { v.to_be_bytes() } else { v.to_le_bytes() };
            let mut bytes: Vec<u8> = [if big { 1000 } else { 0 }, 2, 1, 0, 3].map(word).concat();
            bytes.extend(b"ab\0");
            bytes.extend([0.5, 0.25].map(double).concat());
            let found = arrays(&bytes).unwrap().all;
            assert_eq!(
                found,
                [Array { name: "ab".to_owned(), sides: vec![2, 1], values: vec![0.5, 0.25], unit: None }]
            );
            for end in 0..bytes.len() {
                assert!(arrays(&bytes[..end]).is_err());
            }
        }
    }
}
