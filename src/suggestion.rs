//! Suggestions for names that are not known.

/// Returns the one of `known` that is nearest to `found`, if it is near enough to have been meant.
pub fn closest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let found = found.to_ascii_lowercase();
    let distance = |name: &&str| strsim::osa_distance(&found, name);
    let close = known.into_iter().filter(|name| distance(name) <= 1 + name.len() / 4);
    close.min_by_key(distance).map(str::to_owned)
}
