//! Choice of one of many by one random word, with integer odds, so that every engine chooses the same. GPU twin:
//! `shaders/alias.wgsl`, which reads the table from a buffer.
//!
//! Walker's alias method, by Vose's construction ("A linear algorithm for generating random numbers with a given
//! distribution", 1991), on integers: the word's top bits choose a column, and the rest choose between the column and
//! its alias. A choice is made with exactly `odds` in 2^32.

/// Alias table of odds that sum to 2^32.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Alias {
    /// 2^bits columns; at least 2, since a shift by 32 bits is no shift.
    pub(crate) bits: u32,
    pub(crate) columns: Vec<Column>,
}

/// Column of the table: chooses itself where the rest of the word, shifted to the top, is below the threshold, and
/// its alias elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Column {
    pub(crate) threshold: u32,
    pub(crate) alias: u32,
}

impl Alias {
    pub(crate) fn new(odds: &[u32]) -> Alias {
        let bits = odds.len().next_power_of_two().trailing_zeros().max(1);
        let room = 1u32 << (32 - bits);
        let mut left = odds.to_vec();
        left.resize(1 << bits, 0);
        let mut columns: Vec<_> = (0..left.len() as u32).map(|c| Column { threshold: 0, alias: c }).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..left.len()).partition(|&column| left[column] < room);
        // A small column is filled up by a large one, which may become small by it. The sums match, so both run out
        // together, but for columns that are full by themselves.
        while let (Some(poor), Some(&rich)) = (small.pop(), large.last()) {
            columns[poor] = Column { threshold: left[poor] << bits, alias: rich as u32 };
            left[rich] -= room - left[poor];
            if left[rich] < room {
                large.pop();
                small.push(rich);
            }
        }
        Alias { bits, columns }
    }

    /// The columns, a word each: as many of a threshold's low bits are zero as an alias has.
    pub(crate) fn packed(&self) -> Vec<u32> {
        self.columns.iter().map(|column| column.threshold | column.alias).collect()
    }

    /// Returns the number that a word chooses.
    #[inline(always)]
    pub(crate) fn choose(&self, word: u32) -> u32 {
        let column = word >> (32 - self.bits);
        let Column { threshold, alias } = self.columns[column as usize];
        // No branch: half of the time it would be mispredicted.
        let own = u32::from(word << self.bits < threshold).wrapping_neg();
        column & own | alias & !own
    }
}

#[cfg(test)]
impl Alias {
    /// Number of all 2^32 words that choose each column, by choosing: in each column the words below a threshold
    /// choose one number, and all others another.
    pub(crate) fn shares(&self) -> Vec<u64> {
        let room = 1u64 << (32 - self.bits);
        let mut shares = vec![0; self.columns.len()];
        for column in 0..self.columns.len() as u64 {
            let choose = |word: u64| self.choose((column * room + word) as u32);
            let (mut low, mut high) = (0, room); // the threshold is between the two
            while low < high {
                let middle = (low + high) / 2;
                if choose(middle) == column as u32 { low = middle + 1 } else { high = middle }
            }
            shares[column as usize] += low;
            if low < room {
                shares[choose(room - 1) as usize] += room - low;
                assert_eq!(choose(low), choose(room - 1));
            }
        }
        shares
    }
}

/// Returns odds that sum to 2^32, in proportion to weights: rounded up, so that nothing is left out, and the factor
/// of at least 1 by which rounding raised each. The last number is the odds that a weight of 1 would have got.
pub(crate) fn odds(weights: &[f64]) -> (Vec<u32>, Vec<f64>, f64) {
    const WORDS: f64 = 4_294_967_296.0;
    let total: f64 = weights.iter().sum();
    let scale = (WORDS - weights.len() as f64 - 1.0) / total;
    let mut odds: Vec<u64> = weights.iter().map(|w| (w * scale).ceil() as u64).collect();
    let largest = (0..odds.len()).max_by_key(|&i| odds[i]).expect("there are weights");
    odds[largest] += WORDS as u64 - odds.iter().sum::<u64>();
    let unit = odds.iter().zip(weights).map(|(&o, w)| o as f64 / w).fold(f64::INFINITY, f64::min);
    let excess = odds.iter().zip(weights).map(|(&o, w)| o as f64 / (w * unit)).collect();
    (odds.into_iter().map(|o| o.min(u64::from(u32::MAX)) as u32).collect(), excess, unit)
}

/// Returns odds that sum to 2^32, in proportion to weights, each rounded up or down: up where that changes it least. What
/// has no weight, and next to what has less than 2^-33 of all, gets none.
pub(crate) fn nearest_odds(weights: &[f64]) -> Vec<u32> {
    const WORDS: u64 = 1 << 32;
    let scale = WORDS as f64 / weights.iter().sum::<f64>();
    let exact: Vec<f64> = weights.iter().map(|weight| weight * scale).collect();
    let mut odds: Vec<u64> = exact.iter().map(|odds| *odds as u64).collect();
    let mut by_rest: Vec<usize> = (0..odds.len()).filter(|&i| weights[i] > 0.0).collect();
    by_rest.sort_by(|&a, &b| (exact[b] - exact[b].floor()).total_cmp(&(exact[a] - exact[a].floor())));
    let left = WORDS.saturating_sub(odds.iter().sum());
    by_rest.iter().cycle().take(left as usize).for_each(|&i| odds[i] += 1);
    // One that has them all is chosen by what is left over too.
    odds.into_iter().map(|odds| odds.min(u64::from(u32::MAX)) as u32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_has_exactly_its_odds() {
        for count in [2, 3, 4, 5, 1000, 1023, 1024] {
            let weights: Vec<f64> = (0..count).map(|i| (f64::from(i) * 7.7).sin().powi(8) + 1e-13).collect();
            let (odds, excess, unit) = odds(&weights);
            assert_eq!(odds.iter().map(|&o| u64::from(o)).sum::<u64>(), 1 << 32);
            for ((&odds, excess), weight) in odds.iter().zip(&excess).zip(&weights) {
                assert!(
                    odds >= 1
                        && *excess >= 1.0
                        && (f64::from(odds) / excess / unit / weight - 1.0).abs() < 1e-12
                );
            }
            let shares = Alias::new(&odds).shares();
            assert!(
                shares.iter().zip(odds.iter().chain(std::iter::repeat(&0))).all(|(&s, &o)| s == u64::from(o))
            );
        }
    }

    #[test]
    fn nearest_odds_are_within_a_word_of_exact_ones() {
        for count in [2, 3, 1000, 1024, 1 << 16] {
            let weights: Vec<f64> = (1..=count).map(|i| (f64::from(i) * 7.7).sin().max(0.0)).collect();
            let odds = nearest_odds(&weights);
            let total: f64 = weights.iter().sum();
            assert_eq!(odds.iter().map(|&o| u64::from(o)).sum::<u64>(), 1 << 32);
            for (&odds, weight) in odds.iter().zip(&weights) {
                let exact = weight / total * 2f64.powi(32);
                assert!(
                    (f64::from(odds) - exact).abs() < 1.0 && (*weight > 0.0 || odds == 0),
                    "{odds} {exact}"
                );
            }
            let shares = Alias::new(&odds).shares();
            assert!(
                shares.iter().zip(odds.iter().chain(std::iter::repeat(&0))).all(|(&s, &o)| s == u64::from(o))
            );
        }
        // The rest falls to the larger parts.
        assert_eq!(nearest_odds(&[1.0, 1.0, 1.0]), [1_431_655_766, 1_431_655_765, 1_431_655_765]);
        assert_eq!(nearest_odds(&[1.0, 1e-12]), [u32::MAX, 0]);
    }

    #[test]
    fn a_packed_column_has_both_of_its_numbers() {
        for count in [1, 2, 3, 1000, 1025] {
            let weights: Vec<f64> = (0..count).map(|i| (f64::from(i) * 7.7).sin().abs()).collect();
            let alias = Alias::new(&nearest_odds(&weights));
            let low = (1u32 << alias.bits) - 1;
            for (column, packed) in alias.columns.iter().zip(alias.packed()) {
                assert_eq!((packed & !low, packed & low), (column.threshold, column.alias));
            }
        }
    }

    #[test]
    fn one_choice_is_no_choice() {
        for odds in [odds(&[0.25]).0, nearest_odds(&[0.25]), nearest_odds(&[1.0, 0.0])] {
            let alias = Alias::new(&odds);
            assert!([0, 1, 1 << 31, u32::MAX].iter().all(|&word| alias.choose(word) == 0));
        }
    }
}
