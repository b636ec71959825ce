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
    /// `auto`, with what is said of all jobs.
    Auto(Jobs),
}

/// Jobs that make a set together, as far as they are named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::cli) enum Jobs {
    /// All that the scheduler knows of (`auto`).
    All,
    /// A number of them (`auto/N`).
    Count(u64),
    /// Those with the indices of an array, as its jobs were first submitted (`auto/FIRST-LAST` or `auto/FIRST-LAST:STEP`).
    Array { first: u64, last: u64, step: u64 },
}

impl FromStr for ShardName {
    type Err = String;

    fn from_str(text: &str) -> Result<ShardName, String> {
        let expected = "expected I/N (1/4 to 4/4), auto, auto/N, or auto/FIRST-LAST as in sbatch --array";
        let whole = |text: &str| text.parse().ok().ok_or(expected);
        let number = |text: &str| whole(text).and_then(|n: u64| if n > 0 { Ok(n) } else { Err(expected) });
        Ok(match text.split_once('/') {
            None if text == "auto" => ShardName::Auto(Jobs::All),
            Some(("auto", jobs)) => ShardName::Auto(match jobs.split_once('-') {
                None => Jobs::Count(number(jobs)?),
                Some((first, rest)) => {
                    let (last, step) = rest.split_once(':').unwrap_or((rest, "1"));
                    let (first, last, step) = (whole(first)?, whole(last)?, number(step)?);
                    if first > last || last - first == u64::MAX {
                        return Err(expected.to_owned());
                    }
                    Jobs::Array { first, last, step }
                }
            }),
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
            ShardName::Auto(jobs) => automatic(jobs, |name| env::var(name).ok()?.parse().ok()).map_err(Usage),
        }
    }
}

/// The shard that a job scheduler's variables say. Slurm's arrays may begin anywhere, have steps and be submitted again
/// in part; Kubernetes' indexed jobs begin at 0 and do not say how many there are.
fn automatic(jobs: Jobs, variable: impl Fn(&str) -> Option<u64>) -> Result<Shard, String> {
    if let Some(id) = variable("SLURM_ARRAY_TASK_ID") {
        return match jobs {
            Jobs::Array { first, last, step } => in_array(id, first, last, step),
            Jobs::Count(count) => of_slurm(id, Some(count), variable),
            Jobs::All => of_slurm(id, None, variable),
        };
    }
    let Some(index) = variable("JOB_COMPLETION_INDEX") else {
        return Err(
            "--shard auto needs SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX, and neither is set".to_owned()
        );
    };
    match jobs {
        Jobs::Array { first, last, step } => in_array(index, first, last, step),
        Jobs::Count(count) => in_array(index, 0, count - 1, 1),
        Jobs::All => {
            Err("--shard auto: nothing says how many jobs there are: pass --shard auto/N with their number"
                .to_owned())
        }
    }
}

/// The shard of a job of an array of known indices.
fn in_array(id: u64, first: u64, last: u64, step: u64) -> Result<Shard, String> {
    match id.checked_sub(first) {
        Some(offset) if id <= last && offset % step == 0 => {
            Ok(Shard { index: offset / step + 1, count: (last - first) / step + 1 })
        }
        _ => {
            let step = if step == 1 { String::new() } else { format!(":{step}") };
            Err(format!(
                "this job has the index {id}, which is none of {first}-{last}{step}: pass the indices of the array that \
                 all jobs were first submitted as, as in --shard auto/1-8"
            ))
        }
    }
}

/// The shard of a job of Slurm's, of `count` in all. The variables are those of the array that was submitted, which may be
/// a part of the first one: then they do not say how many shards there are, nor whether the first has the index 0 or 1.
fn of_slurm(id: u64, count: Option<u64>, variable: impl Fn(&str) -> Option<u64>) -> Result<Shard, String> {
    let (least, most) = (variable("SLURM_ARRAY_TASK_MIN"), variable("SLURM_ARRAY_TASK_MAX"));
    let step = variable("SLURM_ARRAY_TASK_STEP").unwrap_or(1).max(1);
    let submitted = variable("SLURM_ARRAY_TASK_COUNT");
    let whole = match (least, most) {
        // An array without gaps, be it with steps.
        (Some(least), Some(most)) if submitted == Some(most.saturating_sub(least) / step + 1) => {
            in_array(id, least, most, step).ok()
        }
        _ => None,
    };
    let remedy =
        "pass the indices of the array that all jobs were first submitted as, as in --shard auto/1-8";
    let Some(count) = count else {
        return whole.ok_or_else(|| {
            format!("--shard auto: the array of this job has gaps, so its indices do not say which shard it is: {remedy}")
        });
    };
    match whole {
        Some(shard) if shard.count == count => return Ok(shard),
        _ => {}
    }
    let least = least.unwrap_or(id).min(id);
    let most = most.unwrap_or(id).max(id);
    match (least, most) {
        (0, most) if most < count => in_array(id, 0, count - 1, 1),
        (1.., most) if most == count => in_array(id, 1, count, 1),
        _ => Err(format!(
            "--shard auto/{count}: the array of this job has the indices {least} to {most}, which do not say whether the \
             first of {count} has the index 0 or 1: {remedy}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read() {
        assert_eq!("2/3".parse(), Ok(ShardName::Given(Shard { index: 2, count: 3 })));
        assert_eq!("auto/8".parse(), Ok(ShardName::Auto(Jobs::Count(8))));
        assert_eq!("auto/1-8".parse(), Ok(ShardName::Auto(Jobs::Array { first: 1, last: 8, step: 1 })));
        assert_eq!("auto/0-28:4".parse(), Ok(ShardName::Auto(Jobs::Array { first: 0, last: 28, step: 4 })));
        for text in
            ["0/3", "4/3", "1", "1/0", "a/b", "auto/0", "auto/8-1", "auto/1-8:0", "auto/-8", "auto/1-"]
        {
            assert!(text.parse::<ShardName>().is_err(), "{text}");
        }
    }

    /// The shard of job `id` of an array with the indices `all`, of which the first and the last are written down.
    fn slurm(jobs: &str, id: u64, all: &[u64], step: u64) -> Result<(u64, u64), String> {
        let Ok(ShardName::Auto(jobs)) = jobs.parse() else { panic!("{jobs}") };
        let variable = |name: &str| match name {
            "SLURM_ARRAY_TASK_ID" => Some(id),
            "SLURM_ARRAY_TASK_MIN" => all.first().copied(),
            "SLURM_ARRAY_TASK_MAX" => all.last().copied(),
            "SLURM_ARRAY_TASK_STEP" => Some(step),
            "SLURM_ARRAY_TASK_COUNT" => Some(all.len() as u64),
            _ => None,
        };
        automatic(jobs, variable).map(|shard| (shard.index, shard.count))
    }

    #[test]
    fn whole_arrays_are_understood_wherever_they_begin() {
        assert_eq!(slurm("auto", 7, &[5, 6, 7, 8], 1), Ok((3, 4)));
        assert_eq!(slurm("auto", 8, &[0, 4, 8, 12], 4), Ok((3, 4)));
        for jobs in ["auto", "auto/8"] {
            assert_eq!(slurm(jobs, 3, &[0, 1, 2, 3, 4, 5, 6, 7], 1), Ok((4, 8)));
            assert_eq!(slurm(jobs, 3, &[1, 2, 3, 4, 5, 6, 7, 8], 1), Ok((3, 8)));
            assert_eq!(slurm(jobs, 12, &[11, 12, 13, 14, 15, 16, 17, 18], 1), Ok((2, 8)));
        }
    }

    /// Jobs that failed are submitted again by themselves, and their shards are what they were.
    #[test]
    fn a_part_of_an_array_has_the_shards_of_the_whole_or_is_asked_for() {
        assert_eq!(slurm("auto/1-8", 3, &[3, 7], 1), Ok((3, 8)));
        assert_eq!(slurm("auto/0-7", 3, &[3, 7], 1), Ok((4, 8)));
        assert_eq!(slurm("auto/0-28:4", 12, &[4, 12], 1), Ok((4, 8)));
        assert_eq!(slurm("auto/8", 3, &[0, 3], 1), Ok((4, 8)));
        assert_eq!(slurm("auto/8", 3, &[3, 8], 1), Ok((3, 8)));
        for (jobs, id, all) in
            [("auto/8", 3, &[3, 7][..]), ("auto", 3, &[3, 7]), ("auto/8", 9, &[9]), ("auto/1-8", 0, &[0, 3])]
        {
            let error = slurm(jobs, id, all, 1).unwrap_err();
            assert!(error.contains("as in --shard auto/1-8") && !error.contains("larger count"), "{error}");
        }
        // Without gaps it may as well be an array of its own.
        assert_eq!(slurm("auto", 4, &[3, 4, 5], 1), Ok((2, 3)));
    }

    #[test]
    fn indexed_jobs_are_understood() {
        let kubernetes = |name: &str| (name == "JOB_COMPLETION_INDEX").then_some(0);
        assert_eq!(automatic(Jobs::Count(9), kubernetes), Ok(Shard { index: 1, count: 9 }));
        assert!(automatic(Jobs::All, kubernetes).unwrap_err().contains("auto/N"));
        assert!(automatic(Jobs::Count(9), |_| None).unwrap_err().contains("neither is set"));
    }
}
