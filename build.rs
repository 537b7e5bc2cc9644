//! Has the linker keep one copy of functions of identical code (`--icf=all`), which generic code makes many of: two megabytes of the program. GNU's ld does not know that,
//! and an unknown option would break the build, so that it is tried on an empty program first.

use std::path::PathBuf;
use std::process::{Command, Stdio};

const FOLD: &str = "-Wl,--icf=all";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if folds().unwrap_or(false) {
        println!("cargo::rustc-link-arg-bins={FOLD}");
    }
}

/// Whether a program links with it; nothing where that cannot be tried.
fn folds() -> Option<bool> {
    let var = |name: &str| std::env::var(name).ok().filter(|v| !v.is_empty());
    let folder = PathBuf::from(var("OUT_DIR")?);
    let (source, program) = (folder.join("empty.rs"), folder.join("empty"));
    std::fs::write(&source, "fn main() {}\n").ok()?;
    let mut rustc = Command::new(var("RUSTC")?);
    rustc.arg(&source).arg("-o").arg(&program).args(["--target", &var("TARGET")?, "-C", &format!("link-arg={FOLD}")]);
    rustc.args(var("RUSTC_LINKER").map(|linker| format!("-Clinker={linker}")));
    rustc.args(var("CARGO_ENCODED_RUSTFLAGS").iter().flat_map(|flags| flags.split('\x1f')));
    Some(rustc.stdout(Stdio::null()).stderr(Stdio::null()).status().ok()?.success())
}
