#![no_main]

#[path = "../bound.rs"]
mod bound;
#[allow(dead_code, unused_imports, reason = "each target is one of several")]
#[path = "../../tests/hostile/mod.rs"]
mod hostile;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| hostile::model_json(bytes));
