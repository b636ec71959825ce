//! Answers to colours: what stands for each, how many there are of each kind, and the errors.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

use crate::engine::EngineError;

/// Answer to the colour of a draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// A random spectrum of that colour, and the number of candidates that it took.
    Sampled {
        /// Number of candidates, the accepted one included.
        attempts: u32,
    },
    /// The most probable valid spectrum of that colour, since none was found at random.
    Mode,
    /// The most probable valid spectrum of the nearest colour that a spectrum of the model has.
    Nearest {
        /// Largest difference of a response from the one that was asked for.
        distance: f32,
    },
    /// None: spectra of that colour are too rare to be found at random. Zeros.
    Skipped,
    /// None: no spectrum of the model has that colour. Zeros.
    Unreachable,
}

impl Answer {
    /// Number of the kind of answer in data sets: 0 skipped, 1 sampled, 2 mode, 3 nearest, 4 unreachable.
    pub fn code(self) -> u32 {
        match self {
            Answer::Skipped => 0,
            Answer::Sampled { .. } => 1,
            Answer::Mode => 2,
            Answer::Nearest { .. } => 3,
            Answer::Unreachable => 4,
        }
    }

    /// Largest difference of a response from the one that was asked for; 0 where the colour is exact or there is none.
    pub fn distance(self) -> f32 {
        match self {
            Answer::Nearest { distance } => distance,
            _ => 0.0,
        }
    }
}

/// Answer to colours for which no candidate is accepted within the attempts allowed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum HardColours {
    /// The most probable valid spectrum.
    #[default]
    Mode,
    /// Zeros.
    Skip,
    /// An error, at the first of them; also at colours that no spectrum has.
    Error,
}

/// Answer to colours that no spectrum of the model has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UnreachableColours {
    /// Zeros.
    #[default]
    Leave,
    /// The most probable spectrum of the nearest colour that one has, by the largest difference of a response.
    Nearest,
}

/// Numbers of answers of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct AnswerCounts {
    /// Number of colours with a random spectrum.
    pub sampled: u64,
    /// Number of candidates that these took.
    pub attempts: u64,
    /// Number of colours with the most probable spectrum.
    pub mode: u64,
    /// Number of colours with a spectrum of the nearest colour.
    pub nearest: u64,
    /// The largest distance of these.
    pub farthest: f32,
    /// Number of colours without an answer that spectra have.
    pub skipped: u64,
    /// Number of colours without an answer that no spectrum has.
    pub unreachable: u64,
}

impl AnswerCounts {
    pub(super) fn add(&mut self, answers: &[Answer]) {
        for answer in answers {
            match *answer {
                Answer::Sampled { attempts } => {
                    self.sampled += 1;
                    self.attempts += u64::from(attempts);
                }
                Answer::Mode => self.mode += 1,
                Answer::Nearest { distance } => {
                    self.nearest += 1;
                    self.farthest = self.farthest.max(distance);
                }
                Answer::Skipped => self.skipped += 1,
                Answer::Unreachable => self.unreachable += 1,
            }
        }
    }

    /// Number of colours.
    pub fn all(&self) -> u64 {
        self.sampled + self.mode + self.nearest + self.skipped + self.unreachable
    }
}

impl AddAssign for AnswerCounts {
    fn add_assign(&mut self, other: AnswerCounts) {
        self.sampled += other.sampled;
        self.attempts += other.attempts;
        self.mode += other.mode;
        self.nearest += other.nearest;
        self.farthest = self.farthest.max(other.farthest);
        self.skipped += other.skipped;
        self.unreachable += other.unreachable;
    }
}

/// Error returned where a colour is not answered, and that is not to be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum MetamerError {
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error(
        "draw {index}: no spectrum with the responses {colour:?} was found in {attempts} attempts: allow more, or take the \
         most probable spectrum of such colours"
    )]
    Hard { index: u64, colour: Vec<f32>, attempts: u32 },
    #[error(
        "draw {index}: no spectrum of this model has the responses {colour:?}: skip such colours, or take the nearest that one has"
    )]
    Unreachable { index: u64, colour: Vec<f32> },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_counted_by_their_kinds() {
        let mut counts = AnswerCounts::default();
        counts.add(&[Answer::Sampled { attempts: 3 }, Answer::Mode, Answer::Nearest { distance: 0.5 }]);
        counts.add(&[Answer::Sampled { attempts: 4 }, Answer::Skipped, Answer::Unreachable]);
        let once = AnswerCounts {
            sampled: 2,
            attempts: 7,
            mode: 1,
            nearest: 1,
            farthest: 0.5,
            skipped: 1,
            unreachable: 1,
        };
        assert_eq!((counts, counts.all()), (once, 6));
        counts += AnswerCounts { farthest: 0.25, ..once };
        let twice = AnswerCounts {
            sampled: 4,
            attempts: 14,
            mode: 2,
            nearest: 2,
            farthest: 0.5,
            skipped: 2,
            unreachable: 2,
        };
        assert_eq!((counts, counts.all()), (twice, 12));
    }
}
