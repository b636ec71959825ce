#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| spectroll_fuzz::table("parquet", bytes));
