//! Tells the program which commit it is built from, where that is known; a build never fails for want of it.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let here = env!("CARGO_MANIFEST_DIR");
    // Unpacked from an archive inside of somebody else's repository, the commit would be theirs.
    let Some(top) = git(here, &["rev-parse", "--show-toplevel"]) else { return };
    if Path::new(&top).canonicalize().ok() != Path::new(here).canonicalize().ok() {
        return;
    }
    let Some(commit) = git(here, &["rev-parse", "--short=12", "HEAD"]) else { return };
    println!("cargo:rustc-env=SPECTROLL_COMMIT={commit}");
    if let Some(log) = git(here, &["rev-parse", "--git-path", "logs/HEAD"]) {
        let log = Path::new(here).join(log);
        if log.exists() {
            println!("cargo:rerun-if-changed={}", log.display());
        }
    }
}

/// What git prints, where there is git and it succeeds.
fn git(folder: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(folder).args(arguments).output().ok()?;
    let text = output.status.success().then(|| String::from_utf8(output.stdout).ok())??;
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}
