//! Encodings of text: UTF-8 and UTF-16 by their marks or their zeros, else what the bytes look like.

use std::borrow::Cow;

use chardetng::EncodingDetector;
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

/// Text of a file, and the name of its encoding.
pub(in crate::dataset) fn decode(bytes: &[u8]) -> (Cow<'_, str>, &'static str) {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        return (encoding.decode_without_bom_handling(&bytes[mark..]).0, encoding.name());
    }
    if let Ok(text) = std::str::from_utf8(bytes)
        && !bytes.contains(&0)
    {
        return (Cow::Borrowed(text), UTF_8.name());
    }
    // Without a mark, every other byte of numbers in UTF-16 is zero.
    let zeros = |odd: usize| bytes.iter().take(4096).skip(odd).step_by(2).filter(|b| **b == 0).count();
    let half = bytes.len().min(4096) / 2;
    for (encoding, odd) in [(UTF_16LE, 1), (UTF_16BE, 0)] {
        if half >= 4 && zeros(odd) * 10 >= half * 9 && zeros(1 - odd) * 10 < half {
            return (encoding.decode_without_bom_handling(bytes).0, encoding.name());
        }
    }
    let mut detector = EncodingDetector::new(chardetng::Iso2022JpDetection::Deny);
    // What tells encodings apart is in the headings.
    detector.feed(&bytes[..bytes.len().min(1 << 20)], true);
    let encoding = detector.guess(None, chardetng::Utf8Detection::Allow);
    (encoding.decode_without_bom_handling(bytes).0, encoding.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_are_told_apart() {
        let text = "Wellenlänge;Größe\n400;0,5\n410;0,6\n";
        let utf16 = |big: bool, mark: bool| {
            let units = mark.then_some(0xFEFF).into_iter().chain(text.encode_utf16());
            let pair = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
            units.flat_map(pair).collect::<Vec<u8>>()
        };
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        for (bytes, name) in [
            (text.as_bytes().to_vec(), "UTF-8"),
            ([b"\xEF\xBB\xBF", text.as_bytes()].concat(), "UTF-8"),
            (utf16(false, true), "UTF-16LE"),
            (utf16(true, true), "UTF-16BE"),
            (utf16(false, false), "UTF-16LE"),
            (utf16(true, false), "UTF-16BE"),
            (latin, "windows-1252"),
        ] {
            assert_eq!(decode(&bytes), (Cow::Borrowed(text), name), "{name}");
        }
    }
}
