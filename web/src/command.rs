//! Command lines of the program that make what the page made: what shows that both are one sampler.

use spectroll::{Illuminant, Intensity, Lrv, ProposalKind, RecipeSettings};

use crate::data::Origin;
use crate::fitted::{BUILTIN_COMPONENTS, Fitted};
use crate::settings::{FitSettings, ReadSettings};

/// Draws that are written.
pub(crate) struct Draws<'a> {
    /// Name of the file, `wall.npy`; its ending says the format.
    pub(crate) file: &'a str,
    pub(crate) dtype: &'a str,
    pub(crate) count: u32,
    pub(crate) seed: u64,
}

/// Name of the model file that has to be written first; `None` where the program has the model built in.
pub(crate) fn model_file(fitted: &Fitted) -> Option<String> {
    let components = fitted.settings.components;
    match &fitted.origin {
        Origin::Builtin(_) if components == BUILTIN_COMPONENTS => None,
        Origin::Builtin(name) => Some(format!("{name}-{components}.json")),
        Origin::File(name, _) => {
            let stem = name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
            Some(format!("{stem}.json"))
        }
    }
}

/// Commands that write the draws, a line each.
pub(crate) fn lines(fitted: &Fitted, recipe: &RecipeSettings, draws: &Draws) -> String {
    let mut lines = String::new();
    let file = model_file(fitted);
    if let Some(file) = &file {
        lines += &fit(fitted, file);
        lines.push('\n');
    }
    lines += &sample(fitted, file.as_deref(), recipe, draws);
    lines
}

fn fit(fitted: &Fitted, file: &str) -> String {
    let FitSettings { components, wavelengths, missing, .. } = &fitted.settings;
    let mut line = "spectroll fit".to_owned();
    match &fitted.origin {
        Origin::Builtin(name) => {
            let data = spectroll::Model::builtin_data(name).expect("it is built in");
            data.tables.iter().for_each(|table| word(&mut line, table.name()));
        }
        Origin::File(name, settings) => word(&mut line, &source(name, settings)),
    }
    option(&mut line, "-k", components);
    option(&mut line, "--kind", fitted.kind);
    match (wavelengths.trim(), &fitted.origin) {
        ("", Origin::Builtin("krinov")) => option(&mut line, "--wavelengths", "400:10:650"),
        ("", _) => {}
        (grid, _) => option(&mut line, "--wavelengths", grid),
    }
    if missing != "error" {
        option(&mut line, "--missing", missing);
    }
    if let Origin::File(_, settings) = &fitted.origin {
        for (name, value) in [("--layout", &settings.layout), ("--unit", &settings.unit)] {
            if !value.is_empty() {
                option(&mut line, name, value);
            }
        }
        if let Some(value) = settings.missing_value {
            word(&mut line, &format!("--missing-value={value}"));
        }
        if settings.percent {
            option(&mut line, "--scale", 0.01);
        }
    }
    option(&mut line, "-o", file);
    line
}

/// A file as the program takes it: FILE:ARRAY@WAVELENGTHS.
fn source(name: &str, settings: &ReadSettings) -> String {
    let mut source = name.to_owned();
    for (sign, part) in [(':', settings.array.trim()), ('@', settings.measured_at.trim())] {
        if !part.is_empty() {
            source.push(sign);
            source += part;
        }
    }
    source
}

fn sample(fitted: &Fitted, file: Option<&str>, recipe: &RecipeSettings, draws: &Draws) -> String {
    let mut line = "spectroll sample".to_owned();
    match (file, &fitted.origin) {
        (Some(file), _) => word(&mut line, file),
        (None, Origin::Builtin(name)) => {
            word(&mut line, name);
            let grid = fitted.settings.wavelengths.trim();
            if !grid.is_empty() {
                option(&mut line, "--wavelengths", grid);
            }
        }
        (None, Origin::File(..)) => unreachable!("a model of a file has a file"),
    }
    option(&mut line, "-n", draws.count);
    option(&mut line, "--seed", draws.seed);
    recipe_options(&mut line, recipe);
    if draws.dtype != "f32" {
        option(&mut line, "--dtype", draws.dtype);
    }
    option(&mut line, "-o", draws.file);
    line
}

fn recipe_options(line: &mut String, recipe: &RecipeSettings) {
    let default = RecipeSettings::default();
    if let Some(lrv) = recipe.lrv {
        match lrv {
            Lrv::Fixed(value) => option(line, "--lrv", value),
            Lrv::Uniform(low, high) => option(line, "--lrv", format_args!("{low}..{high}")),
        }
        if recipe.bounds != default.bounds {
            option(line, "--bounds", name(&recipe.bounds));
        }
    }
    if recipe.covariance_scale != 1.0 {
        option(line, "--cov-scale", recipe.covariance_scale);
    }
    match recipe.intensity {
        None => {}
        Some(Intensity::Fixed(value)) => option(line, "--intensity", value),
        Some(Intensity::LogUniform(low, high)) => option(line, "--intensity", format_args!("{low}..{high}")),
        Some(Intensity::Data) => option(line, "--intensity", "data"),
    }
    if recipe.quantities != default.quantities {
        let names: Vec<_> = recipe.quantities.iter().map(|quantity| quantity.name()).collect();
        option(line, "--quantities", names.join(","));
    }
    let light = Illuminant::NAMED.into_iter().find(|(_, light)| *light == recipe.illuminant);
    if let Some((light, _)) = light.filter(|_| recipe.illuminant != default.illuminant) {
        option(line, "--illuminant", light);
    }
    if recipe.proposal != ProposalKind::Auto {
        option(line, "--proposal", name(&recipe.proposal));
    }
}

/// Name of a setting, as data sets and the program's options have it.
fn name(value: &impl serde::Serialize) -> String {
    let text = serde_json::to_string(value).expect("a name is JSON");
    text.trim_matches('"').to_owned()
}

fn option(line: &mut String, name: &str, value: impl std::fmt::Display) {
    line.push(' ');
    line.push_str(name);
    word(line, &value.to_string());
}

/// Appends a word, in quotes where a shell would take it apart, and never such that it looks like an option.
fn word(line: &mut String, word: &str) {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=@+%".contains(c);
    let is_option = word.starts_with('-') && !word.starts_with("--");
    let word = if is_option { format!("./{word}") } else { word.to_owned() };
    line.push(' ');
    if !word.is_empty() && word.chars().all(is_plain) {
        line.push_str(&word);
    } else {
        line.push_str(&format!("'{}'", word.replace('\'', "'\\''")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Data;

    const DRAWS: Draws = Draws { file: "draws.npy", dtype: "f32", count: 1000, seed: 7 };

    #[test]
    fn a_builtin_is_named() {
        let data = Data::builtin("munsell-vrhel").unwrap();
        let recipe = RecipeSettings {
            lrv: Some(Lrv::Uniform(0.2, 0.6)),
            bounds: spectroll::Bounds::Both,
            covariance_scale: 1.5,
            ..RecipeSettings::default()
        };
        let line = lines(&data.fit("{}").unwrap(), &recipe, &DRAWS);
        let expected = "spectroll sample munsell-vrhel -n 1000 --seed 7 --lrv 0.2..0.6 --bounds both --cov-scale 1.5 -o draws.npy";
        assert_eq!(line, expected);
        let fine = data.fit(r#"{"wavelengths":"400:5:700"}"#).unwrap();
        let line = lines(&fine, &RecipeSettings::default(), &Draws { dtype: "f16", ..DRAWS });
        let expected = "spectroll sample munsell-vrhel --wavelengths 400:5:700 -n 1000 --seed 7 --dtype f16 -o draws.npy";
        assert_eq!(line, expected);
        let more = data.fit(r#"{"components":12}"#).unwrap();
        let expected = "spectroll fit munsell vrhel -k 12 --kind reflectance -o munsell-vrhel-12.json\n\
                        spectroll sample munsell-vrhel-12.json -n 1000 --seed 7 -o draws.npy";
        assert_eq!(lines(&more, &RecipeSettings::default(), &DRAWS), expected);
    }

    #[test]
    fn a_file_is_fitted_first_with_the_settings_it_was_read_with() {
        let text = "nm,a,b,c\n400,10,20,30\n410,20,30,35\n420,30,20,10\n";
        let data =
            Data::read("it's mine.csv", text.into(), r#"{"percent":true,"layout":"columns"}"#).unwrap();
        let fit = r#"{"components":1,"kind":"reflectance","wavelengths":"400:10:420","missing":"drop"}"#;
        let expected = "spectroll fit 'it'\\''s mine.csv' -k 1 --kind reflectance --wavelengths 400:10:420 \
                        --missing drop --layout columns --scale 0.01 -o 'it'\\''s mine.json'\n\
                        spectroll sample 'it'\\''s mine.json' -n 1000 --seed 7 -o draws.npy";
        assert_eq!(lines(&data.fit(fit).unwrap(), &RecipeSettings::default(), &DRAWS), expected);
    }

    #[test]
    fn a_name_is_no_option() {
        let mut line = String::new();
        word(&mut line, "-n.csv");
        word(&mut line, "$(x)");
        assert_eq!(line, " ./-n.csv '$(x)'");
    }
}
