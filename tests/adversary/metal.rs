//! The text as naga writes it for Metal, compiled by a C++ compiler that may do what it likes: `g++ -Ofast`, with fused
//! operations and approximate roots.

use std::fs;
use std::path::Path;
use std::process::Command;

use naga::back::msl;
use spectroll::{Arithmetic, Recipe, ShaderVariant, Stream};

use super::{buffers, engine, expected, words};

/// What stands for the headers of Metal.
const HEADER: &str = include_str!("metal_stdlib.hpp");

/// Whether there is a compiler.
pub(crate) fn has_compiler() -> bool {
    Command::new("g++").arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Text for Metal, with a main function around it that runs threads one after another.
fn program(text: &str, names: &[&str], threads: u64) -> String {
    let module = naga::front::wgsl::parse_str(text).expect("it is WGSL");
    let flags = naga::valid::ValidationFlags::all();
    let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
    let info = validator.validate(&module).expect("it is valid");
    let options = msl::Options { fake_missing_bindings: true, ..Default::default() };
    let (metal, _) = msl::write_string(&module, &info, &options, &Default::default()).expect("it is written");
    // An array without a length is one of 1 here, of which an optimiser would make use.
    let metal: String = metal
        .lines()
        .map(|line| match line.starts_with("typedef ") {
            true => line.replace("[1];", "[1 << 28];") + "\n",
            false => line.to_owned() + "\n",
        })
        .collect();
    let entry = &metal[metal.find("kernel void main_(").expect("it has an entry point")..];
    let head = &entry["kernel void main_(".len()..entry.find(") {").expect("its head ends")];
    let argument = |parameter: &str| {
        let declared = parameter.split("[[").next().expect("a split has a first part").trim();
        let words: Vec<&str> = declared.split_whitespace().collect();
        let (name, ty) = (words[words.len() - 1], words[1].trim_end_matches('&'));
        // Where a function has a variable of the same name, the buffer's has a number behind it.
        let is_same = |other: &&str| {
            let rest = name.strip_prefix(*other).map(|rest| rest.trim_start_matches('_'));
            rest.is_some_and(|rest| rest.bytes().all(|byte| byte.is_ascii_digit()))
        };
        match names.iter().position(is_same) {
            Some(at) => format!("*({ty}*)buffers[{at}].data()"),
            None if name == "_buffer_sizes" => "sizes".to_owned(),
            None => "metal::uint3(i, 0, 0)".to_owned(),
        }
    };
    let arguments: Vec<_> = head.split("\n,").map(argument).collect();
    let sizes = match arguments.iter().any(|argument| argument == "sizes") {
        true => {
            "_mslBufferSizes sizes; uint* words = (uint*)&sizes;
            for (unsigned i = 0; i < sizeof sizes / 4; i++) words[i] = 1u << 30;"
        }
        false => "",
    };
    format!(
        "{metal}
        int main(int, char** paths) {{
            read_buffers(paths[1]);
            {sizes}
            for (uint i = 0; i < {threads}; i++) main_({});
            write_buffers(paths[2]);
        }}",
        arguments.join(", ")
    )
}

/// Number of draws that differ from the CPU's, with a compiler's options. Each quantity is a row of 32-bit values.
pub(crate) fn differing(
    recipe: &Recipe,
    arithmetic: Arithmetic,
    options: &str,
    count: u64,
    folder: &Path,
) -> u64 {
    let variant = ShaderVariant { arithmetic, ..ShaderVariant::default() };
    let shader = recipe.compute_shader(variant).expect("it has few bands");
    let bindings: Vec<u32> = shader.bindings().iter().map(|binding| binding.binding).collect();
    let module = naga::front::wgsl::parse_str(shader.text()).expect("it is WGSL");
    let name = |binding: &u32| {
        let mut variables = module.global_variables.iter().map(|(_, variable)| variable);
        let bound =
            |variable: &&naga::GlobalVariable| variable.binding.is_some_and(|b| b.binding == *binding);
        variables.find(bound).and_then(|variable| variable.name.as_deref()).expect("it has a name")
    };
    let names: Vec<&str> = bindings.iter().map(name).collect();
    let (stream, threads) = (Stream::named(20_261_126, "metal"), count);
    fs::create_dir_all(folder.join("simd")).expect("a folder");
    fs::write(folder.join("metal_stdlib"), HEADER).expect("a file");
    fs::write(folder.join("simd/simd.h"), "").expect("a file");
    fs::write(folder.join("draw.cpp"), program(shader.text(), &names, threads)).expect("a file");
    let mut bytes = Vec::new();
    for words in buffers(&shader, stream, 0, count, &bindings) {
        bytes.extend((words.len() as u32).to_ne_bytes());
        bytes.extend(bytemuck::cast_slice::<u32, u8>(&words));
    }
    fs::write(folder.join("in"), bytes).expect("a file");
    let compiled = Command::new("g++")
        .args("-std=c++17 -w -fsingle-precision-constant -I. draw.cpp -o draw".split(' '))
        .args(options.split(' '))
        .current_dir(folder)
        .output()
        .expect("g++ runs");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let ran =
        Command::new(folder.join("draw")).args(["in", "out"]).current_dir(folder).status().expect("it runs");
    assert!(ran.success(), "{ran}");
    let out = fs::read(folder.join("out")).expect("it wrote");
    let out: Vec<u32> = words(&out).collect();
    let mut differs = vec![false; count as usize];
    let mut at = 0;
    let expected = expected(&engine(), recipe, stream, 0, count);
    for binding in shader.bindings() {
        let words = (shader.bytes(binding.role, count) / 4) as usize;
        let found = &out[at..at + words];
        at += words;
        let spectroll::BindingRole::Output(quantity) = binding.role else { continue };
        let number =
            recipe.formats().iter().position(|format| format.quantity == quantity).expect("it is asked for");
        let row = recipe.formats()[number].stride();
        for (i, (a, b)) in found.chunks(row).zip(expected[number].chunks(row)).enumerate() {
            differs[i] |= a != b;
        }
    }
    differs.into_iter().filter(|&differs| differs).count() as u64
}
