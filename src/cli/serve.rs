//! `misfit serve`: the workbench in a browser.

use std::net::IpAddr;
use std::path::PathBuf;

use serde_json::{Value, json};

use crate::identify::interrupt_flag;
use crate::serve::{Address, Options, serve};
use crate::work::Failure;
use crate::work::terminal::say;

use super::session::threads;
use super::{INTERRUPTED, Outcome, print};

#[derive(clap::Args)]
pub(super) struct Args {
    /// Folder with study.toml, that file, or a folder of studies
    study: PathBuf,
    /// Port [default: any that is free]
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Address to listen at [default: this machine alone]; who opens the page needs the token in either case
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<IpAddr>,
    /// Opens the page in the browser
    #[arg(long)]
    open: bool,
    /// Nothing on stderr; the first line on stdout is the same without it
    #[arg(long)]
    pub json: bool,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Folder of the raw measurement files
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    threads(args.threads)?;
    let stop = interrupt_flag()
        .map_err(|e| Failure::new("cli", "signal", format!("Ctrl-C cannot be watched: {e}"), "a system that allows signal handlers"))?;
    let options = Options { path: args.study.clone(), port: args.port, listen: args.listen, data: args.data.clone(), seed: args.seed };
    let interrupted = serve(&options, &stop, &|address| begun(args, address))?;
    Ok(Outcome { json: Value::Null, text: String::new(), code: if interrupted { INTERRUPTED } else { 0 } })
}

/// Says where the page is: the one object on stdout, a hint for people beside it.
fn begun(args: &Args, address: &Address) {
    // A page whose address nobody could be told can still be stopped.
    let _ = print(true, &json!({ "url": address.url, "port": address.port }), "");
    if !args.json {
        say(&format!("The workbench: {}\nCtrl-C ends it; what runs then keeps its best state.", address.url));
    }
    if args.open {
        open(&address.url);
    }
}

/// Hands the address to the system's browser, without a shell.
fn open(url: &str) {
    let (program, before): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("rundll32", &["url.dll,FileProtocolHandler"]),
        _ => ("xdg-open", &[]),
    };
    let started = std::process::Command::new(program)
        .args(before)
        .arg(url)
        .stdin(std::process::Stdio::null())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn();
    if let Err(e) = started {
        say(&format!("misfit: no browser could be started with {program}: {e}"));
    }
}
