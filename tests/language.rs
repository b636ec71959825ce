//! The first sentence of every doc comment in `src/` stands alone, since lists of items show it without its item:
//! a noun phrase or a verb in the third person, not a clause such as "What it holds" or "The same for rows".

mod sources;

use sources::sources;

/// Openings that leave a sentence incomplete without the name of its item.
const OPENINGS: [&str; 11] =
    ["What", "How", "That of", "Those of", "The same", "Whose", "Which", "So many", "Why", "When", "Where"];

/// Traits that `clap` derives, making help texts of the doc comments of such items, their fields and their variants.
const HELP: [&str; 4] = ["Args", "Parser", "Subcommand", "ValueEnum"];

/// First paragraph of a doc comment, and the item below it.
#[derive(Debug, PartialEq)]
struct Doc {
    /// Number of its first line, from 1.
    line: usize,
    paragraph: String,
    item: String,
    is_help: bool,
}

/// Text of a line of a doc comment, and whether that is a module's.
fn doc_text(line: &str) -> Option<(&str, bool)> {
    let line = line.trim_start();
    match (line.strip_prefix("//!"), line.strip_prefix("///")) {
        (Some(text), _) => Some((text.trim(), true)),
        (_, Some(text)) if !text.starts_with('/') => Some((text.trim(), false)),
        _ => None,
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty())
}

/// Whether a line of a doc comment ends the paragraph before it.
fn ends_paragraph(text: &str) -> bool {
    text.is_empty() || ["```", "- ", "# ", "| "].iter().any(|start| text.starts_with(start))
}

/// Lines of the item that follows line `after`, without attributes, up to its body or its end.
fn item(lines: &[&str], after: usize) -> String {
    let mut item = String::new();
    let is_code = |line: &&&str| !line.trim_start().starts_with("#[") && !line.trim_start().starts_with("//");
    for line in lines[after..].iter().filter(is_code).take(12) {
        item += line;
        item.push(' ');
        if line.ends_with(['{', ';', ',', '}']) && item.matches('(').count() <= item.matches(')').count() {
            break;
        }
    }
    item
}

/// Every doc comment of a file.
fn docs(text: &str) -> Vec<Doc> {
    let lines: Vec<&str> = text.lines().collect();
    let is_clap = |line: &str| line.starts_with("#[derive(") && words(line).any(|word| HELP.contains(&word));
    // Attributes at the margin belong to the item that follows them, and it to the lines that are indented after it.
    let (mut attributes_are_clap, mut item_is_clap) = (false, false);
    let mut found = Vec::new();
    let mut number = 0;
    while number < lines.len() {
        let line = lines[number];
        let Some((_, is_module)) = doc_text(line) else {
            match line.chars().next() {
                Some('#') => attributes_are_clap |= is_clap(line),
                Some('a'..='z') => item_is_clap = std::mem::take(&mut attributes_are_clap),
                _ => {}
            }
            number += 1;
            continue;
        };
        let of_comment = |line: &&&str| doc_text(line).is_some_and(|(_, of_module)| of_module == is_module);
        let length = lines[number..].iter().take_while(of_comment).count();
        let texts =
            lines[number..number + length].iter().map(|line| doc_text(line).expect("they are docs").0);
        let paragraph: Vec<&str> = texts
            .enumerate()
            .take_while(|(n, text)| *n == 0 || !ends_paragraph(text))
            .map(|(_, t)| t)
            .collect();
        let below = &lines[number + length..];
        let attributes = below.iter().take_while(|line| line.trim_start().starts_with("#["));
        let is_indented = line.starts_with(' ');
        found.push(Doc {
            line: number + 1,
            paragraph: paragraph.join(" "),
            item: item(&lines, number + length),
            is_help: (is_indented && item_is_clap) || attributes.into_iter().any(|line| is_clap(line)),
        });
        number += length;
    }
    found
}

/// Says what is wrong with the first sentence of a doc comment. "Whether ..." is how the field writes of a `bool`, and
/// right for nothing else. A help text needs no full stop, since `clap` prints none.
fn complaint(doc: &Doc) -> Option<String> {
    let sentence = doc.paragraph.split_inclusive(". ").next().unwrap_or_default().trim();
    let opens_with = |opening: &str| {
        sentence.strip_prefix(opening).is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()))
    };
    let says = match doc.item.contains("fn ") {
        true => doc.item.rsplit_once("->").map_or("", |(_, returned)| returned),
        false => &doc.item,
    };
    let is_bool = words(says).any(|word| word == "bool");
    if let Some(opening) = OPENINGS.iter().find(|opening| opens_with(opening)) {
        return Some(format!("opens with {opening:?}: {sentence}"));
    }
    if opens_with("Whether") && !is_bool {
        return Some(format!("opens with \"Whether\", and is of no bool: {sentence}"));
    }
    (!doc.is_help && !doc.paragraph.trim_end_matches(')').ends_with(['.', ':', '?']))
        .then(|| format!("is no sentence before its first empty line: {sentence}"))
}

#[test]
fn first_sentences_stand_alone() {
    let files = sources();
    let (mut count, mut wrong) = (0, Vec::new());
    for (name, text) in &files {
        let docs = docs(text);
        count += docs.len();
        let name = name.display();
        wrong.extend(docs.iter().filter_map(|doc| Some(format!("{name}:{}: {}", doc.line, complaint(doc)?))));
    }
    assert!(count > files.len(), "{count} doc comments in {} files: are they still found?", files.len());
    assert!(wrong.is_empty(), "{} of {count} doc comments:\n{}", wrong.len(), wrong.join("\n"));
}

/// The complaints about a text, each with its line.
fn complaints(text: &str) -> Vec<(usize, String)> {
    docs(text).iter().filter_map(|doc| Some((doc.line, complaint(doc)?))).collect()
}

#[test]
fn clauses_and_fragments_are_found() {
    for opening in OPENINGS {
        let found = complaints(&format!("    /// {opening} rows.\n    pub rows: u64,\n"));
        assert_eq!(found, [(1, format!("opens with {opening:?}: {opening} rows."))]);
    }
    let bad = [
        ("/// Number of rows\npub rows: u64,", "is no sentence before its first empty line: Number of rows"),
        ("//! Rows\n//!\n//! of a table.", "is no sentence before its first empty line: Rows"),
        ("/// Whether rows\n/// are left.\nfn left(a: bool) {", "and is of no bool: Whether rows are left."),
        ("/// What it is. More.\n#[serde(skip)]\npub x: u64,", "opens with \"What\": What it is."),
        (
            "#[derive(Args)]\nstruct A {\n    /// How many rows\n    rows: u64,",
            "opens with \"How\": How many rows",
        ),
    ];
    for (text, message) in bad {
        let found = complaints(text);
        assert!(found.len() == 1 && found[0].1.ends_with(message), "{text}\n{found:?}");
    }
}

#[test]
fn sentences_are_left_alone() {
    let good = [
        "/// Number of rows.\npub rows: u64,",
        "/// Rows of a table,\n/// in order:\n///\n/// - a row;\nfn rows() {",
        "/// Whether rows are left.\npub(crate) fn is_left(\n    &self,\n    rows: u64,\n) -> bool {",
        "/// Whether rows are left.\n#[serde(default)]\nleft: bool,",
        "/// Whatever comes.\nfn next() {",
        "#[derive(Args)]\nstruct A {\n    /// Number of rows [default: all]\n    rows: u64,\n}",
        "/// Draw rows\n#[derive(Args)]\nstruct A {",
        "#[derive(Clone, ValueEnum)]\npub(crate) enum A {\n    /// The first row\n    First,\n}",
        "/// Rows. (The last has none.)\nfn rows() {",
        "// What is no doc comment\n//// nor this\nfn f() {",
    ];
    for text in good {
        assert_eq!(complaints(text), [], "{text}");
    }
}
