#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| misfit_fuzz::feed(bytes, "mat", |_| {}));
