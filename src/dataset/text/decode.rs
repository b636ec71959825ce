//! Encodings of text: UTF-8 and UTF-16 by their marks or their zeros, else what the bytes look like.

use std::borrow::Cow;

/// Text of a file, and the name of its encoding.
pub(in crate::dataset) fn decode(bytes: &[u8]) -> (Cow<'_, str>, &'static str) {
    if let Some(rest) = bytes.strip_prefix(b"\xEF\xBB\xBF") {
        return (String::from_utf8_lossy(rest), "UTF-8");
    }
    for (mark, name, word) in UTF_16 {
        if let Some(rest) = bytes.strip_prefix(&mark) {
            return (utf_16(rest, word), name);
        }
    }
    if let Ok(text) = std::str::from_utf8(bytes)
        && !bytes.contains(&0)
    {
        return (Cow::Borrowed(text), "UTF-8");
    }
    // Without a mark, every other byte of numbers in UTF-16 is zero.
    let zeros = |odd: usize| bytes.iter().take(4096).skip(odd).step_by(2).filter(|b| **b == 0).count();
    let half = bytes.len().min(4096) / 2;
    for ((_, name, word), odd) in UTF_16.into_iter().zip([1, 0]) {
        if half >= 4 && zeros(odd) * 10 >= half * 9 && zeros(1 - odd) * 10 < half {
            return (utf_16(bytes, word), name);
        }
    }
    guess(bytes)
}

/// Mark, name and order of the bytes of each form of UTF-16.
type Utf16 = ([u8; 2], &'static str, fn([u8; 2]) -> u16);
const UTF_16: [Utf16; 2] =
    [([0xFF, 0xFE], "UTF-16LE", u16::from_le_bytes), ([0xFE, 0xFF], "UTF-16BE", u16::from_be_bytes)];

fn utf_16(bytes: &[u8], word: fn([u8; 2]) -> u16) -> Cow<'_, str> {
    let units: Vec<u16> = bytes.chunks_exact(2).map(|pair| word([pair[0], pair[1]])).collect();
    Cow::Owned(String::from_utf16_lossy(&units))
}

/// Text in the encoding that its bytes look like: what tells encodings apart is in the headings.
#[cfg(feature = "encodings")]
fn guess(bytes: &[u8]) -> (Cow<'_, str>, &'static str) {
    let mut detector = chardetng::EncodingDetector::new(chardetng::Iso2022JpDetection::Deny);
    detector.feed(&bytes[..bytes.len().min(1 << 20)], true);
    let encoding = detector.guess(None, chardetng::Utf8Detection::Allow);
    (encoding.decode_without_bom_handling(bytes).0, encoding.name())
}

/// Latin-1, whose characters have the numbers of Unicode.
#[cfg(not(feature = "encodings"))]
fn guess(bytes: &[u8]) -> (Cow<'_, str>, &'static str) {
    (bytes.iter().map(|&byte| char::from(byte)).collect(), "ISO-8859-1")
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
            (latin, if cfg!(feature = "encodings") { "windows-1252" } else { "ISO-8859-1" }),
        ] {
            assert_eq!(decode(&bytes), (Cow::Borrowed(text), name), "{name}");
        }
    }
}
