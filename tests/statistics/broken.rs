//! The pipeline of a draw once more, from the public pieces, with a place for each fault that a sampler might have.
//! Without a fault its draws are the library's in f64.

use nalgebra::{DMatrix, DVector};
use spectroll::evaluation::statistics::{Scenario, ScenarioDraw};
use spectroll::{Bounds, Distribution, Real, SpectrumKind, Stream, colorimetry, philox};

/// What is wrong with a sampler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// Uniforms have 24 bits.
    Uniforms24,
    /// The two normals of a pair are the same one.
    PairEqual,
    /// The sine comes before the cosine.
    PairSwapped,
    /// Every other attempt repeats the one before.
    AttemptRepeated,
    /// A further attempt takes the words of the next draw.
    AttemptOfNext,
    /// The second block of words is the first.
    BlockReused,
    /// Each value is stored one band late.
    BandShifted,
    /// The basis is one band late, the mean is not.
    BasisShifted,
    /// The first basis vector has the other sign.
    BasisNegated,
    /// The covariance is used where its square root should be.
    CovarianceNotRooted,
    /// The mean of the weights is left out.
    WeightMeanDropped,
    /// Both bounds let 1e-3 more through.
    BoundsLoose,
    /// Both bounds let 1e-3 less through.
    BoundsTight,
    /// A spectrum that is negative throughout passes, since its factor is negative too.
    NegativeTwice,
    /// The LRV leaves out the illuminant.
    LrvWithoutD65,
    /// The two words of the seed are swapped.
    KeySwapped,
    /// The high word of the index is left out.
    IndexHighIgnored,
    /// The number of the stream is left out.
    StreamIgnored,
    /// Centres are chosen by their acceptance and not by its reciprocal.
    OddsNotInverted,
    /// Centres are not drawn towards the mean.
    ShrinkageMissing,
    /// The bandwidth is squared.
    BandwidthSquared,
    /// A further attempt has the centre of the first.
    CentreReused,
    /// What is chosen beside a column of the table is the next but one.
    AliasShifted,
}

pub(crate) struct Pipeline<'a> {
    scenario: &'a Scenario,
    fault: Option<Fault>,
    offset: DVector<f64>,
    /// A column for each normal.
    gain: DMatrix<f64>,
    lrv_weights: Vec<f64>,
    centres: Option<Centres>,
}

/// The normal distributions of a kernel, in the frame of the standard normals.
struct Centres {
    coordinates: Vec<DVector<f64>>,
    bandwidth: f64,
    /// Threshold and alias of each column of the table.
    columns: Vec<[u32; 2]>,
    /// The sums of odds that are not inverted, from 0 to 1.
    wrong: Vec<f64>,
}

impl Centres {
    fn new(scenario: &Scenario, fault: Option<Fault>) -> Option<Centres> {
        let Distribution::Kernel { bandwidth, weights } = scenario.model.distribution() else { return None };
        let parts = scenario.model.parts();
        let k = weights.ncols();
        let shrinkage = match fault {
            Some(Fault::ShrinkageMissing) => 1.0,
            _ => (1.0 - bandwidth * bandwidth).sqrt(),
        };
        // The covariance is diagonal, as that of every fit.
        let coordinate = |i: usize, j: usize| {
            shrinkage * (weights[(i, j)] - parts.weight_mean[j]) / parts.weight_covariance[(j, j)].sqrt()
        };
        let bytes = scenario.recipe().tables();
        let words: Vec<u32> = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
        // After the centres: a word for each column, the alias in its lowest bits.
        let count = weights.nrows().next_power_of_two();
        let columns: Vec<[u32; 2]> = words[weights.nrows() * k.next_multiple_of(4)..][..count]
            .iter()
            .map(|word| [word & !(count as u32 - 1), word & (count as u32 - 1)])
            .collect();
        let mut odds = vec![0.0; weights.nrows()];
        for (column, &[threshold, alias]) in columns.iter().enumerate() {
            let share = f64::from(threshold) / 2f64.powi(32);
            if share > 0.0 {
                odds[column] += share;
            }
            odds[alias as usize] += 1.0 - share;
        }
        let wrong: Vec<f64> = odds
            .iter()
            .scan(0.0, |sum, odds| {
                *sum += odds.recip();
                Some(*sum)
            })
            .collect();
        let total = *wrong.last()?;
        Some(Centres {
            coordinates: (0..weights.nrows()).map(|i| DVector::from_fn(k, |j, _| coordinate(i, j))).collect(),
            bandwidth: if fault == Some(Fault::BandwidthSquared) {
                bandwidth * bandwidth
            } else {
                *bandwidth
            },
            columns,
            wrong: wrong.into_iter().map(|sum| sum / total).collect(),
        })
    }

    fn choose(&self, word: u32, fault: Option<Fault>) -> &DVector<f64> {
        if fault == Some(Fault::OddsNotInverted) {
            let share = (f64::from(word) + 0.5) / 2f64.powi(32);
            return &self.coordinates[self.wrong.partition_point(|sum| *sum < share)];
        }
        let bits = self.columns.len().trailing_zeros();
        let column = word >> (32 - bits);
        let [threshold, alias] = self.columns[column as usize];
        let alias = alias as usize + usize::from(fault == Some(Fault::AliasShifted));
        let chosen = if word << bits < threshold { column as usize } else { alias };
        &self.coordinates[chosen % self.coordinates.len()]
    }
}

impl<'a> Pipeline<'a> {
    pub(crate) fn new(scenario: &'a Scenario, fault: Option<Fault>) -> Pipeline<'a> {
        let (model, parts) = (&scenario.model, scenario.model.parts());
        let mut basis = parts.basis.clone();
        match fault {
            Some(Fault::BasisShifted) => {
                basis = DMatrix::from_fn(basis.nrows(), basis.ncols(), |j, b| {
                    parts.basis[(j, b.saturating_sub(1))]
                });
            }
            Some(Fault::BasisNegated) => basis.row_mut(0).neg_mut(),
            _ => {}
        }
        let factor = match fault {
            Some(Fault::CovarianceNotRooted) => parts.weight_covariance.clone(),
            _ => model.weight_factor(),
        };
        let weight_mean = match fault {
            Some(Fault::WeightMeanDropped) => 0.0 * &parts.weight_mean,
            _ => parts.weight_mean.clone(),
        };
        let grid = model.grid();
        let [_, y, _] = colorimetry::cmf(grid);
        Pipeline {
            scenario,
            fault,
            centres: Centres::new(scenario, fault),
            offset: &parts.mean + basis.tr_mul(&weight_mean),
            gain: basis.tr_mul(&factor) * scenario.scale.sqrt(),
            lrv_weights: match fault {
                Some(Fault::LrvWithoutD65) => y.iter().map(|v| v / y.iter().sum::<f64>()).collect(),
                _ => colorimetry::lrv_weights(grid).expect("the grid is visible"),
            },
        }
    }

    fn has(&self, fault: Fault) -> bool {
        self.fault == Some(fault)
    }

    pub(crate) fn draw(&self, stream: Stream, index: u64) -> ScenarioDraw {
        (0..)
            .find_map(|attempt| Some((self.candidate(stream, index, attempt)?, attempt + 1)))
            .expect("a draw ends")
    }

    fn words(&self, stream: Stream, index: u64, attempt: u32, block: u32) -> [u32; 4] {
        let (index, attempt) = match self.fault {
            Some(Fault::AttemptRepeated) => (index, attempt & !1),
            Some(Fault::AttemptOfNext) => (index + u64::from(attempt), 0),
            _ => (index, attempt),
        };
        let block = if self.has(Fault::BlockReused) { 0 } else { block };
        let high = if self.has(Fault::IndexHighIgnored) { 0 } else { (index >> 32) as u32 };
        let id = if self.has(Fault::StreamIgnored) { 0 } else { stream.id() };
        let (mut key, seed) = ([stream.seed() as u32, 0], stream.seed());
        key[1] = (seed >> 32) as u32;
        if self.has(Fault::KeySwapped) {
            key.reverse();
        }
        let words = philox([index as u32, high, attempt, id << 8 | block], key);
        if self.has(Fault::Uniforms24) { words.map(|w| w & !0xFF | 0x80) } else { words }
    }

    fn normals(&self, [a, b, c, d]: [u32; 4]) -> [f64; 4] {
        let pair = |x, y| {
            let [cosine, sine] = f64::normal_pair(x, y);
            match self.fault {
                Some(Fault::PairEqual) => [cosine, cosine],
                Some(Fault::PairSwapped) => [sine, cosine],
                _ => [cosine, sine],
            }
        };
        let ([p, q], [r, s]) = (pair(a, b), pair(c, d));
        [p, q, r, s]
    }

    fn candidate(&self, stream: Stream, index: u64, attempt: u32) -> Option<Vec<f64>> {
        let k = self.gain.ncols();
        let blocks = 0..k.div_ceil(4) as u32;
        let normals = blocks.flat_map(|block| self.normals(self.words(stream, index, attempt, block)));
        let mut z = DVector::from_iterator(k, normals.take(k));
        if let Some(centres) = &self.centres {
            let attempt = if self.has(Fault::CentreReused) { 0 } else { attempt };
            let word = k.next_multiple_of(2);
            let word = self.words(stream, index, attempt, word as u32 / 4)[word % 4];
            z = centres.choose(word, self.fault) + centres.bandwidth * z;
        }
        let mut base = &self.offset + &self.gain * z;
        if self.has(Fault::BandShifted) {
            base.as_mut_slice().rotate_right(1);
        }
        let margin = match self.fault {
            Some(Fault::BoundsLoose) => 1e-3,
            Some(Fault::BoundsTight) => -1e-3,
            _ => 0.0,
        };
        let limit = if self.scenario.model.kind() == SpectrumKind::Illuminant { f64::INFINITY } else { 1.0 };
        let physical = |s: &DVector<f64>| s.iter().all(|&s| s > -margin && s < limit + margin);
        let Some((target, bounds)) = self.scenario.target else {
            return physical(&base).then(|| base.as_slice().to_vec());
        };
        let lrv: f64 = self.lrv_weights.iter().zip(&base).map(|(w, s)| w * s).sum();
        let factor = if self.has(Fault::NegativeTwice) { target / lrv } else { target / lrv.max(1e-30) };
        let scaled = &base * factor;
        let accepted = match bounds {
            Bounds::Base => physical(&base),
            Bounds::Scaled => physical(&scaled),
            Bounds::Both => physical(&base) && physical(&scaled),
        };
        accepted.then(|| scaled.as_slice().to_vec())
    }
}
