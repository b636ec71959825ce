//! Philox4x32-10: four random words as a pure function of a counter and a key, so any thread can compute any word at
//! once (Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as easy as 1, 2, 3", 2011). GPU twin:
//! `shaders/philox.wgsl`. [`crate::random::stream`] says what the counter holds.

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;

/// Returns four random words of a counter and a key.
pub fn philox(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    philox_in_lanes(counter.map(|word| [word]), key).map(|[word]| word)
}

/// Returns the random words of L counters under one key, word by word: each step is a loop over lanes, for the
/// compiler to vectorise. Words are kept in the low halves of 64 bits, as vector units multiply them; the high halves
/// are neither used nor cleared.
#[inline(always)]
#[allow(clippy::needless_range_loop)] // a lane is an index, of several arrays at once
pub(crate) fn philox_in_lanes<const L: usize>(counters: [[u32; L]; 4], key: [u32; 2]) -> [[u32; L]; 4] {
    let mut c = [[0; L]; 4];
    for (wide, words) in c.iter_mut().zip(&counters) {
        for l in 0..L {
            wide[l] = u64::from(words[l]);
        }
    }
    for round in 0..ROUNDS {
        let [k0, k1] = [0, 1].map(|i| u64::from(key[i].wrapping_add(round.wrapping_mul(WEYL[i]))));
        for l in 0..L {
            let [a, b] = [product(MULTIPLIERS[0], c[0][l]), product(MULTIPLIERS[1], c[2][l])];
            c[0][l] = (b >> 32) ^ c[1][l] ^ k0;
            c[1][l] = b;
            c[2][l] = (a >> 32) ^ c[3][l] ^ k1;
            c[3][l] = a;
        }
    }
    let mut words = [[0; L]; 4];
    for (words, wide) in words.iter_mut().zip(&c) {
        for l in 0..L {
            words[l] = wide[l] as u32;
        }
    }
    words
}

/// Product of the low halves.
#[inline(always)]
fn product(a: u32, b: u64) -> u64 {
    u64::from(a) * u64::from(b as u32)
}

/// The known answers of the Random123 distribution (`kat_vectors`), counter, key and output: shared with the test of
/// the shader.
#[cfg(any(test, feature = "report"))]
pub(crate) const KNOWN_ANSWERS: [([u32; 4], [u32; 2], [u32; 4]); 3] = [
    ([0; 4], [0; 2], [0x6627_E8D5, 0xE169_C58D, 0xBC57_AC4C, 0x9B00_DBD8]),
    ([u32::MAX; 4], [u32::MAX; 2], [0x408F_276D, 0x41C8_3B0E, 0xA20B_C7C6, 0x6D54_51FD]),
    (
        [0x243F_6A88, 0x85A3_08D3, 0x1319_8A2E, 0x0370_7344],
        [0xA409_3822, 0x299F_31D0],
        [0xD16C_FE09, 0x94FD_CCEB, 0x5001_E420, 0x2412_6EA1],
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers() {
        for (counter, key, output) in KNOWN_ANSWERS {
            assert_eq!(philox(counter, key), output);
        }
    }
}
