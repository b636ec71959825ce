//! NumPy and Numba beside the engines: a process each, which draws on request and hands over what it drew, so that its
//! errors are measured as those of engines are.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde::{Deserialize, Serialize};

use super::engines::Values;
use super::estimate::Moments;
use super::{Bench, ReportError};
use crate::model::Model;

/// The program of the peers.
const SCRIPT: &str = include_str!("../../../scripts/peers.py");

/// Names of the peers, and of their Python modules.
pub(super) const PEERS: [(&str, &str); 2] = [("NumPy", "numpy"), ("Numba", "numba")];

/// Facts about a peer.
#[derive(Clone, Debug, Serialize)]
pub struct PeerFacts {
    /// Name.
    pub name: String,
    /// Version of its module.
    pub version: String,
    /// Version of Python.
    pub python: String,
    /// Number of threads that it draws with.
    pub threads: u32,
}

impl PeerFacts {
    /// Describes it in one line.
    pub fn description(&self) -> String {
        let threads =
            if self.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", self.threads) };
        format!("{} {} ({threads}), Python {}", self.name, self.version, self.python)
    }
}

/// First line that a peer writes.
#[derive(Deserialize)]
#[serde(untagged)]
enum Greeting {
    Ready { version: String, python: String, threads: u32, first_draw: f64 },
    Missing { error: String },
}

/// A process that draws.
pub(super) struct Peer {
    pub(super) facts: PeerFacts,
    /// Time from the loaded modules to the first draw, seconds: what Numba compiles in.
    pub(super) first_draw: f64,
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    bytes: Vec<u8>,
    /// The folder of the script and the model, gone with the process.
    _folder: tempfile::TempDir,
}

/// Header of a part of an answer.
#[derive(Debug, PartialEq)]
enum Header {
    Rows(usize),
    End { seconds: f64, candidates: f64 },
}

impl Header {
    fn parse(line: &str) -> Option<Header> {
        let mut words = line.split_whitespace();
        let rows = words.next()?.parse().ok()?;
        if rows > 0 {
            return words.next().is_none().then_some(Header::Rows(rows));
        }
        let mut number = || words.next()?.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
        Some(Header::End { seconds: number()?, candidates: number()? })
    }
}

impl Peer {
    /// Starts a peer for a model; where it cannot draw, the reason.
    pub(super) fn start(python: &str, (name, module): (&str, &str), model: &Model) -> Result<Peer, String> {
        let folder = tempfile::tempdir().map_err(|e| format!("{name}: no temporary folder: {e}"))?;
        let [script, file] = ["peers.py", "model.json"].map(|name| folder.path().join(name));
        let written = std::fs::write(&script, SCRIPT).and_then(|()| std::fs::write(&file, model.to_json()));
        written.map_err(|e| format!("{name}: cannot write to {}: {e}", folder.path().display()))?;
        let mut command = Command::new(python);
        command.args([script.as_os_str(), file.as_os_str(), module.as_ref()]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().map_err(|e| format!("{name}: cannot start {python:?}: {e}"))?;
        let requests = child.stdin.take().expect("it is piped");
        let mut answers = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut line = String::new();
        let read = answers.read_line(&mut line);
        let greeting = read.ok().and_then(|_| serde_json::from_str(&line).ok());
        let (facts, first_draw) = match greeting {
            Some(Greeting::Ready { version, python, threads, first_draw }) => {
                (PeerFacts { name: name.to_owned(), version, python, threads }, first_draw)
            }
            failed => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(match failed {
                    Some(Greeting::Missing { error }) => format!("{name}: {python:?} says: {error}"),
                    _ => format!("{name}: {python:?} does not run its script"),
                });
            }
        };
        Ok(Peer { facts, first_draw, child, requests, answers, bytes: Vec::new(), _folder: folder })
    }

    /// Draws from a seed. Returns the seconds that the drawing took and the sums of the draws, or what failed.
    pub(super) fn draw<'m>(
        &mut self,
        bench: &Bench,
        model: &'m Model,
        (draws, seed): (u64, u32),
    ) -> Result<Result<(f64, Moments<'m>), String>, ReportError> {
        let mut moments = Moments::new(model);
        let failed = |what: &str| Ok(Err(format!("{}: {what}", self.facts.name)));
        if writeln!(self.requests, "{draws} {seed}").is_err() {
            return failed("it ended early");
        }
        loop {
            bench.agenda.beat()?;
            let mut line = String::new();
            let read = self.answers.read_line(&mut line);
            match Header::parse(&line).filter(|_| read.is_ok()) {
                Some(Header::Rows(rows)) => {
                    self.bytes.resize(rows * model.bands() * size_of::<f32>(), 0);
                    if self.answers.read_exact(&mut self.bytes).is_err() {
                        return failed("it ended early");
                    }
                    let values: Vec<f32> =
                        self.bytes.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
                    moments.add(Values::Single(&values));
                }
                Some(Header::End { seconds, candidates }) if moments.draws == draws => {
                    moments.attempts = candidates;
                    return Ok(Ok((seconds, moments)));
                }
                _ => return failed("its answer is not understood"),
            }
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_python_is_named() {
        let model = Model::builtin("granada").unwrap();
        let Err(reason) = Peer::start("/no/such/python", PEERS[0], &model) else { panic!("it started") };
        assert!(reason.starts_with("NumPy: cannot start \"/no/such/python\": "), "{reason}");
    }

    /// Any program that writes no greeting.
    #[cfg(unix)]
    #[test]
    fn a_program_that_is_no_python_is_named() {
        let model = Model::builtin("granada").unwrap();
        let Err(reason) = Peer::start("true", PEERS[1], &model) else { panic!("it started") };
        assert_eq!(reason, "Numba: \"true\" does not run its script");
    }

    #[test]
    fn greetings_and_headers_are_read() {
        let missing: Greeting = serde_json::from_str(r#"{"error": "No module named 'numba'"}"#).unwrap();
        assert!(matches!(missing, Greeting::Missing { error } if error == "No module named 'numba'"));
        assert_eq!(Header::parse("262144\n"), Some(Header::Rows(262_144)));
        let end = Header::End { seconds: 0.5, candidates: 1354.0 };
        assert_eq!(Header::parse("0 0.5 1354\n"), Some(end));
        for wrong in ["", "rows", "-1", "5 5", "0", "0 nan 5", "0 1.0", "0 0.0 0"] {
            assert_eq!(Header::parse(wrong), None, "{wrong:?}");
        }
    }
}
