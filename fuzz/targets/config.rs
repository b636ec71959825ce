#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| spectroll_fuzz::config(text));
