//! Every command of the README and of `docs/` runs.
//!
//! A document is read from top to bottom, in a temporary folder of its own:
//!
//! - of a block of `sh`, the lines that start `spectroll` are run, one after the other, and must succeed;
//! - a block of `toml` or `csv` is written to the file that its first line names, as in `# mine.csv`;
//! - a block of `python` is run, and may look at the files that the commands before it left, but for those that import
//!   the package of this project: `python/tests` runs these;
//! - blocks of `rust` are doctests, of a page that `src/lib.rs` includes, and those of `wgsl` and `text` are left alone.
//!
//! Commands are run as they stand, but for their size: [`lowered`] says how. Lines of other programs are left alone if
//! they are [`KNOWN`], and an error if they are not; so is any syntax of the shell that is more than words, a
//! continued line, a comment and a `>` at the end.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use rayon::prelude::*;

/// Programs whose lines are not run here, since they compile, install or need a cluster.
const KNOWN: [&str; 4] = ["cargo", "make", "pip", "sbatch"];

/// The most draws that a command makes here.
const MOST_DRAWS: f64 = 1e4;

/// The most scenes.
const MOST_SCENES: u64 = 4;

/// The only task of a Slurm array job, for `--shard auto`.
const SLURM: [(&str, &str); 4] = [
    ("SLURM_ARRAY_TASK_ID", "1"),
    ("SLURM_ARRAY_TASK_MIN", "1"),
    ("SLURM_ARRAY_TASK_MAX", "1"),
    ("SLURM_ARRAY_TASK_COUNT", "1"),
];

/// Something that a document has its reader do.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    /// Run `spectroll` with these arguments, with its standard output in a file where one is named.
    Run { arguments: Vec<String>, output: Option<String> },
    /// Run another program.
    Leave(Vec<String>),
    /// Make a file.
    Write { name: String, text: String },
    /// Run this in Python.
    Python(String),
}

/// A fenced block: the line of its fence, its language, and its text.
struct Block<'a> {
    line: usize,
    language: &'a str,
    text: String,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README and the documents beside it.
fn documents() -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join("docs")).expect("the documents are there");
    let paths = entries.map(|entry| entry.expect("it can be read").path());
    let mut documents: Vec<_> =
        paths.filter(|path| path.extension().is_some_and(|extension| extension == "md")).collect();
    documents.sort();
    documents.insert(0, root().join("README.md"));
    documents
}

fn blocks(text: &str) -> Result<Vec<Block<'_>>, String> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in (1..).zip(text.lines()) {
        match (line.strip_prefix("```"), &mut open) {
            (Some(language), None) => open = Some(Block { line: number, language, text: String::new() }),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some(block)) => {
                block.text += line;
                block.text.push('\n');
            }
            (None, None) if line.trim_start().starts_with("```") => {
                return Err(format!("{number}: an indented block is not read here"));
            }
            (None, None) => {}
        }
    }
    match open {
        Some(block) => Err(format!("{}: the block does not end", block.line)),
        None => Ok(blocks),
    }
}

/// Whether a line of Python imports the package of this project.
fn imports_the_package(line: &str) -> bool {
    (line.starts_with("import ") || line.starts_with("from ")) && line.contains("spectroll")
}

/// The steps of a document, each with its line.
fn steps(text: &str) -> Result<Vec<(usize, Step)>, String> {
    let mut steps = Vec::new();
    for Block { line, language, text } in blocks(text)? {
        match language {
            "sh" => steps.extend(commands(line + 1, &text)?),
            "toml" | "csv" => {
                let name = text.strip_prefix("# ").and_then(|rest| rest.split([':', '\n']).next());
                let name = name.filter(|name| name.ends_with(&format!(".{language}")) && !name.contains('/'));
                let name =
                    name.ok_or(format!("{line}: the first line must name the file, as in `# a.{language}`"))?;
                steps.push((line, Step::Write { name: name.to_owned(), text: text.clone() }));
            }
            "python" if text.lines().any(imports_the_package) => {}
            "python" => steps.push((line, Step::Python(text))),
            "rust" | "wgsl" | "text" => {}
            other => return Err(format!("{line}: a block of {other:?} is not known here")),
        }
    }
    Ok(steps)
}

/// The commands of a block whose first line has this number.
fn commands(first: usize, text: &str) -> Result<Vec<(usize, Step)>, String> {
    let mut commands = Vec::new();
    let mut lines = (first..).zip(text.lines());
    while let Some((number, line)) = lines.next() {
        let mut command = line.to_owned();
        while let Some(start) = command.strip_suffix('\\') {
            let (_, next) = lines.next().ok_or(format!("{number}: the line does not go on"))?;
            command = format!("{start} {next}");
        }
        if let Some(step) = command_of(&command).map_err(|reason| format!("{number}: {reason}"))? {
            commands.push((number, step));
        }
    }
    Ok(commands)
}

/// The command of a line; none of a comment or an empty line.
fn command_of(line: &str) -> Result<Option<Step>, String> {
    let words = line.split_whitespace().take_while(|word| !word.starts_with('#'));
    let mut words: Vec<String> = words.map(str::to_owned).collect();
    // What pip installs is tested with the wheel, by `scripts/wheel.sh`.
    if words.is_empty() || words[0] == "pip" {
        return Ok(None);
    }
    let output = match words.iter().position(|word| word == ">") {
        Some(at) if at + 2 == words.len() => words.drain(at..).nth(1),
        Some(_) => return Err("one file must follow >, and end the line".to_owned()),
        None => None,
    };
    if let Some(word) = words.iter().find(|word| word.contains(|c| "'\"`$|&;<>()*?~\\".contains(c))) {
        return Err(format!("{word:?} is syntax of the shell that is not read here"));
    }
    let program = words.remove(0);
    match program.as_str() {
        "spectroll" => Ok(Some(Step::Run { arguments: words, output })),
        known if KNOWN.contains(&known) => Ok(Some(Step::Leave([vec![program], words].concat()))),
        other => Err(format!("{other:?} is not a program that is known here")),
    }
}

/// The arguments with counts above 10^4 draws lowered to that, ranges of scenes to the first 4 of them, and scene files
/// that are drawn whole to their first 4 scenes. A report takes a minute, and `tests/report.rs` makes one: here `--help`
/// after its arguments tells whether they are understood.
fn lowered(arguments: &[String]) -> Vec<String> {
    let mut arguments = arguments.to_vec();
    for i in 1..arguments.len() {
        match arguments[i - 1].as_str() {
            "-n" | "--count" if count(&arguments[i]).is_some_and(|count| count > MOST_DRAWS) => {
                arguments[i] = MOST_DRAWS.to_string();
            }
            "--scenes" => arguments[i] = fewer(&arguments[i]).unwrap_or_else(|| arguments[i].clone()),
            _ => {}
        }
    }
    let has = |flag: &str| arguments.iter().any(|argument| argument == flag);
    match arguments.first().map(String::as_str) {
        Some("scene") if (has("-o") || has("--preview")) && !has("--scenes") => {
            arguments.extend(["--scenes".to_owned(), format!("0..{MOST_SCENES}")]);
        }
        Some("report") => arguments.push("--help".to_owned()),
        _ => {}
    }
    arguments
}

/// A count as the program reads it: 1000000, 1_000_000, 1e6, 1M.
fn count(text: &str) -> Option<f64> {
    let (digits, unit) = match text.char_indices().last()? {
        (end, 'k') => (&text[..end], 1e3),
        (end, 'M') => (&text[..end], 1e6),
        (end, 'G') => (&text[..end], 1e9),
        _ => (text, 1.0),
    };
    Some(unit * digits.replace('_', "").parse::<f64>().ok()?)
}

/// A range of scenes, cut after the fourth.
fn fewer(range: &str) -> Option<String> {
    let (first, end) = range.split_once("..")?;
    let (first, end): (u64, u64) = (first.parse().ok()?, end.parse().ok()?);
    Some(format!("{first}..{}", end.min(first + MOST_SCENES)))
}

/// Does a step in a folder.
fn take(step: &Step, folder: &Path) -> Result<(), String> {
    match step {
        Step::Run { arguments, output } => run(&lowered(arguments), output.as_deref(), folder),
        Step::Leave(words) => left(words),
        Step::Write { name, text } => fs::write(folder.join(name), text).map_err(|e| format!("{name}: {e}")),
        Step::Python(code) => {
            let python = env::var("SPECTROLL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
            finish(Command::new(python).args(["-W", "error", "-c", code]).current_dir(folder), "Python")
                .map(drop)
        }
    }
}

fn run(arguments: &[String], output: Option<&str>, folder: &Path) -> Result<(), String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_spectroll"));
    command.args(arguments).current_dir(folder);
    // Of Kubernetes where the number of jobs is given, as only it needs it.
    match arguments.iter().any(|argument| argument.starts_with("auto/")) {
        true => command.env("JOB_COMPLETION_INDEX", "0"),
        false => command.envs(SLURM),
    };
    let written = finish(&mut command, &format!("spectroll {}", arguments.join(" ")))?;
    output.map_or(Ok(()), |name| fs::write(folder.join(name), written).map_err(|e| format!("{name}: {e}")))
}

/// What a command that must succeed writes to its standard output.
fn finish(command: &mut Command, name: &str) -> Result<Vec<u8>, String> {
    let done = command.output().map_err(|e| format!("{name}: {e}"))?;
    let errors = String::from_utf8_lossy(&done.stderr);
    if done.status.success() {
        Ok(done.stdout)
    } else {
        Err(format!("{name}: {}, {}", done.status, errors.trim()))
    }
}

/// Of what is not run, at least the targets of make and the examples are there.
fn left(words: &[String]) -> Result<(), String> {
    let after = |word: &str| words.iter().skip_while(|other| *other != word).nth(1);
    let is_there = match words[0].as_str() {
        "make" => {
            let makefile = fs::read_to_string(root().join("Makefile")).map_err(|e| e.to_string())?;
            // What has a `=` sets a variable.
            words[1..]
                .iter()
                .filter(|word| !word.contains('='))
                .all(|target| makefile.lines().any(|line| line.starts_with(&format!("{target}:"))))
        }
        _ => after("--example").is_none_or(|name| root().join(format!("examples/{name}.rs")).exists()),
    };
    if is_there { Ok(()) } else { Err(format!("there is nothing to do for `{}`", words.join(" "))) }
}

/// What goes wrong in a document, each with its place.
fn failures(document: &Path) -> Vec<String> {
    let name = document.strip_prefix(root()).unwrap_or(document).display();
    let text = fs::read_to_string(document).expect("it can be read");
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    match steps(&text) {
        Ok(steps) => {
            let failed = |(line, step): &(usize, Step)| {
                Some(format!("{name}:{line}: {}", take(step, folder.path()).err()?))
            };
            steps.iter().filter_map(failed).collect()
        }
        Err(reason) => vec![format!("{name}:{reason}")],
    }
}

#[test]
fn every_command_of_the_documents_runs() {
    let failures: Vec<_> = documents().par_iter().flat_map_iter(|document| failures(document)).collect();
    assert!(failures.is_empty(), "{} commands fail:\n{}", failures.len(), failures.join("\n"));
}

/// Rust in a page that no doctest reads would rot.
#[test]
fn every_page_with_rust_is_a_doctest() {
    let library = fs::read_to_string(root().join("src/lib.rs")).expect("it can be read");
    for document in documents() {
        let text = fs::read_to_string(&document).expect("it can be read");
        let path = document.strip_prefix(root()).expect("it is in the project").display().to_string();
        let has_rust =
            blocks(&text).expect("its blocks are sound").iter().any(|block| block.language == "rust");
        let is_included = library.contains(&format!("include_str!(\"../{path}\")"));
        assert_eq!(has_rust, is_included, "{path}");
    }
}

/// One for the scientist, the trainer of models and the renderer's author.
#[test]
fn quick_starts_have_at_most_five_lines() {
    let readme = fs::read_to_string(root().join("README.md")).expect("it can be read");
    let section = readme.split("\n## Quick start\n").nth(1).and_then(|rest| rest.split("\n## ").next());
    let blocks = blocks(section.expect("there is such a section")).expect("its blocks are sound");
    let starts: Vec<_> = blocks.iter().filter(|block| block.language == "sh").collect();
    assert_eq!(starts.len(), 3);
    for start in starts {
        let commands = commands(1, &start.text).expect("they are understood");
        let ours = commands.iter().filter(|(_, step)| matches!(step, Step::Run { .. })).count();
        assert!(start.text.lines().count() <= 5 && ours >= 3, "{}", start.text);
    }
}

#[test]
fn lines_are_read_as_a_shell_would() {
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let run = |text: &str, output: Option<&str>| Step::Run {
        arguments: words(text),
        output: output.map(str::to_owned),
    };
    let text = "#!/bin/bash\n#SBATCH --array=1-64\n\nspectroll models # all of them\nspectroll sample m.json \\\n  -n 5 -o - > m.csv\n\
                cargo run --example embed";
    let expected = [
        (4, run("models", None)),
        (5, run("sample m.json -n 5 -o -", Some("m.csv"))),
        (7, Step::Leave(words("cargo run --example embed"))),
    ];
    assert_eq!(commands(1, text), Ok(expected.to_vec()));
    for (line, reason) in [
        ("rm -r all", "\"rm\" is not a program"),
        ("spectroll models | head", "\"|\" is syntax"),
        ("spectroll sample $MODEL", "\"$MODEL\" is syntax"),
        ("spectroll models > a b", "one file must follow"),
        ("spectroll models \\", "does not go on"),
    ] {
        let error = commands(3, line).unwrap_err();
        assert!(error.starts_with("3: ") && error.contains(reason), "{line}: {error}");
    }
}

#[test]
fn blocks_of_unknown_languages_and_files_without_a_name_are_errors() {
    let file = Step::Write { name: "a.toml".to_owned(), text: "# a.toml: a file\nx = 1\n".to_owned() };
    assert_eq!(steps("A\n```toml\n# a.toml: a file\nx = 1\n```\n"), Ok(vec![(2, file)]));
    for (text, reason) in [
        ("```toml\nx = 1\n```\n", "1: the first line must name the file"),
        ("```csv\n# ../a.csv\n```\n", "1: the first line must name the file"),
        ("```console\nls\n```\n", "1: a block of \"console\""),
        ("```\nls\n```\n", "1: a block of \"\""),
        ("- ```sh\n  ```sh\n", "2: an indented block"),
        ("```sh\nmake demo\n", "1: the block does not end"),
    ] {
        let error = steps(text).unwrap_err();
        assert!(error.starts_with(reason), "{text}: {error}");
    }
}

#[test]
fn large_runs_become_small() {
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    for (given, expected) in [
        ("sample m -n 1e9 -o a", "sample m -n 10000 -o a"),
        ("sample m -n 1_000_000 -o a", "sample m -n 10000 -o a"),
        ("sample m -n 2G -o a", "sample m -n 10000 -o a"),
        ("sample m -n 1k -o a", "sample m -n 1k -o a"),
        ("scene a.toml -o a", "scene a.toml -o a --scenes 0..4"),
        ("scene a.toml --scenes 10..100 -o a", "scene a.toml --scenes 10..14 -o a"),
        ("scene a.toml --dry-run", "scene a.toml --dry-run"),
        ("report m -o a --quick", "report m -o a --quick --help"),
    ] {
        assert_eq!(lowered(&words(given)), words(expected));
    }
}

/// A document whose commands fail is found out, by its line.
#[test]
fn what_fails_is_placed() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let document = folder.path().join("a.md");
    let text =
        "```sh\nspectroll inspect granada\nspectroll inspect no-such-model\nmake no-such-target\n```\n";
    fs::write(&document, text).expect("it can be written");
    let failures = failures(&document);
    assert_eq!(failures.len(), 2, "{failures:?}");
    assert!(failures[0].contains("a.md:3: spectroll inspect no-such-model: "), "{failures:?}");
    assert!(failures[1].contains("a.md:4: there is nothing to do for `make no-such-target`"), "{failures:?}");
}
