//! Options of the linker that make the program smaller: one copy of functions of identical code, which generic code makes many of (two megabytes), relocations in
//! packed form (three), and no table of symbols, which Cargo leaves in a package that has a level of its own.
//!
//! Not every linker knows them, and a C library before glibc 2.36 does not load what is packed: each is tried on an empty program, which must run.

use std::path::PathBuf;
use std::process::{Command, Stdio};

const OPTIONS: [&str; 3] = ["-Wl,--icf=all", "-Wl,-z,pack-relative-relocs", "-Wl,--strip-all"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    for option in OPTIONS.into_iter().filter(|o| works(o).unwrap_or(false)) {
        println!("cargo::rustc-link-arg-bins={option}");
    }
}

/// Whether a program links with it, and runs where it is made for this machine; nothing where that cannot be tried.
fn works(option: &str) -> Option<bool> {
    let var = |name: &str| std::env::var(name).ok().filter(|v| !v.is_empty());
    let folder = PathBuf::from(var("OUT_DIR")?);
    let (source, program) = (folder.join("empty.rs"), folder.join("empty"));
    std::fs::write(&source, "fn main() {}\n").ok()?;
    let mut rustc = Command::new(var("RUSTC")?);
    rustc.arg(&source).arg("-o").arg(&program).args(["--target", &var("TARGET")?, "-C", &format!("link-arg={option}")]);
    rustc.args(var("RUSTC_LINKER").map(|linker| format!("-Clinker={linker}")));
    rustc.args(var("CARGO_ENCODED_RUSTFLAGS").iter().flat_map(|flags| flags.split('\x1f')));
    let succeeds = |command: &mut Command| Some(command.stdout(Stdio::null()).stderr(Stdio::null()).status().ok()?.success());
    Some(succeeds(&mut rustc)? && (var("TARGET") != var("HOST") || succeeds(&mut Command::new(program))?))
}
