//! `--shard`: the part of a data set that one of several processes makes.

use std::env;
use std::str::FromStr;

use spectroll::output::Shard;

use crate::cli::exit::Usage;

/// Shard that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::cli) enum ShardName {
    /// `I/N`.
    Given(Shard),
    /// `auto`, or `auto/N` where the surroundings do not say how many there are.
    Auto(Option<u64>),
}

impl FromStr for ShardName {
    type Err = String;

    fn from_str(text: &str) -> Result<ShardName, String> {
        let expected = "expected I/N (1/4 to 4/4), auto, or auto/N";
        let number = |text: &str| text.parse().ok().filter(|&n: &u64| n > 0).ok_or(expected);
        Ok(match text.split_once('/') {
            None if text == "auto" => ShardName::Auto(None),
            Some(("auto", count)) => ShardName::Auto(Some(number(count)?)),
            Some((index, count)) => {
                let shard = Shard { index: number(index)?, count: number(count)? };
                if shard.index > shard.count {
                    return Err(format!("there is no part {} of {}", shard.index, shard.count));
                }
                ShardName::Given(shard)
            }
            None => return Err(expected.to_owned()),
        })
    }
}

impl ShardName {
    /// Whether the scheduler says which shard it is.
    pub(in crate::cli) fn is_auto(self) -> bool {
        matches!(self, ShardName::Auto(_))
    }

    /// The shard that this process is to make.
    pub(in crate::cli) fn resolve(self) -> Result<Shard, Usage> {
        match self {
            ShardName::Given(shard) => Ok(shard),
            ShardName::Auto(count) => {
                automatic(count, |name| env::var(name).ok()?.parse().ok()).map_err(Usage)
            }
        }
    }
}

/// The shard that a job scheduler's variables say: Slurm's arrays may begin anywhere, Kubernetes' indexed jobs begin
/// at 0 and do not say how many there are.
fn automatic(count: Option<u64>, variable: impl Fn(&str) -> Option<u64>) -> Result<Shard, String> {
    let slurm = || {
        let first = variable("SLURM_ARRAY_TASK_MIN").unwrap_or(0);
        let index = variable("SLURM_ARRAY_TASK_ID")?.checked_sub(first)?;
        Some((index, count.or(variable("SLURM_ARRAY_TASK_COUNT"))))
    };
    let kubernetes = || Some((variable("JOB_COMPLETION_INDEX")?, count));
    let Some((index, count)) = slurm().or_else(kubernetes) else {
        return Err(
            "--shard auto needs SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX, and neither is set".to_owned()
        );
    };
    let Some(count) = count else {
        return Err("nothing says how many shards there are: pass --shard auto/N".to_owned());
    };
    if index >= count {
        return Err(format!(
            "this job has index {index} of {count} shards, counted from 0: pass a larger count"
        ));
    }
    Ok(Shard { index: index + 1, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read() {
        assert_eq!("2/3".parse(), Ok(ShardName::Given(Shard { index: 2, count: 3 })));
        assert_eq!("auto/8".parse(), Ok(ShardName::Auto(Some(8))));
        for text in ["0/3", "4/3", "1", "1/0", "a/b", "auto/0"] {
            assert!(text.parse::<ShardName>().is_err(), "{text}");
        }
    }

    #[test]
    fn schedulers_are_understood() {
        let slurm = |name: &str| match name {
            "SLURM_ARRAY_TASK_ID" => Some(7),
            "SLURM_ARRAY_TASK_MIN" => Some(5),
            "SLURM_ARRAY_TASK_COUNT" => Some(4),
            _ => None,
        };
        assert_eq!(automatic(None, slurm), Ok(Shard { index: 3, count: 4 }));
        let kubernetes = |name: &str| (name == "JOB_COMPLETION_INDEX").then_some(0);
        assert_eq!(automatic(Some(9), kubernetes), Ok(Shard { index: 1, count: 9 }));
        assert!(automatic(None, kubernetes).unwrap_err().contains("auto/N"));
        assert!(automatic(Some(9), |_| None).unwrap_err().contains("neither is set"));
    }
}
