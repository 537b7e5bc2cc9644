#![no_main]

use misfit::data::uff::UffFile;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| misfit_fuzz::feed(bytes, "uff", |path| {
    if let Ok(file) = UffFile::open(path) {
        for set in 0..file.sets.len() {
            let _ = (file.read(set), file.function_header(set), file.unit_system(set));
        }
    }
}));
