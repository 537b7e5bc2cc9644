//! The workbench: one page in a browser, over studies of this machine. Everything it does is a call of the functions that the verbs call; a
//! model of its tree is a run in `runs/`, so that a page that is opened again finds what another has made.
//!
//! The server answers requests on one thread; what takes time stands on threads of its own (`api::quick`, jobs).

mod act;
mod api;
mod arrive;
mod assets;
mod bench;
mod curves;
mod door;
mod guard;
mod found;
mod fresh;
mod job;
mod motion;
mod order;
mod picture;
mod resume;

use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use axum::Router;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

use crate::work::Failure;

use bench::Bench;
use door::Door;
use fresh::Baskets;
use guard::Guard;

/// Studies of a folder at most.
const STUDIES: usize = 500;
/// Requests that are computed at once; others wait.
const AT_ONCE: usize = 8;
/// Time that jobs have to keep their best state when the server ends.
const ENDING: Duration = Duration::from_secs(60);

/// What is served, and where.
#[derive(Clone, Debug)]
pub struct Options {
    /// A study, or a folder of studies.
    pub path: PathBuf,
    /// Port; 0 for any that is free.
    pub port: u16,
    /// Address to listen at; none: this machine alone.
    pub listen: Option<IpAddr>,
    /// Folder of the raw measurement files.
    pub data: Option<PathBuf>,
    /// Seed of everything random.
    pub seed: u64,
}

/// Where the page is.
#[derive(Clone, Debug)]
pub struct Address {
    /// Address with its token.
    pub url: String,
    /// Port.
    pub port: u16,
}

struct App {
    guard: Guard,
    benches: RwLock<Vec<Arc<Bench>>>,
    /// Folder that new studies are written into; none where one study is served.
    folder: Option<PathBuf>,
    baskets: Baskets,
    options: Options,
    pool: Arc<rayon::ThreadPool>,
    slots: Semaphore,
    working: AtomicUsize,
}

impl App {
    /// The studies that are served.
    fn benches(&self) -> Vec<Arc<Bench>> {
        // Studies are only ever appended, each as a whole.
        self.benches.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Serves a study that was written just now; its name in addresses.
    fn serves(&self, path: PathBuf) -> String {
        let mut all = self.benches.write().unwrap_or_else(PoisonError::into_inner);
        let bench = one(path, &all, &self.options);
        all.push(bench.clone());
        bench.id.clone()
    }
}

/// Serves until `stop` is set; `ready` is told the address first. Whether a job was interrupted.
///
/// # Errors
/// Where there is no study, and where nothing can be listened at.
pub fn serve(options: &Options, stop: &AtomicBool, ready: &dyn Fn(&Address)) -> Result<bool, Failure> {
    let benches: Vec<Arc<Bench>> = studies(options)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().max_blocking_threads(2 * AT_ONCE).build();
    let cannot = |place: &str, e: std::io::Error| Failure::new("serve", place, e.to_string(), "a port that is free; --port 0 takes any");
    let runtime = runtime.map_err(|e| cannot("runtime", e))?;
    // What is computed for a page has threads of its own beside those of a job: the system shares the cores between them.
    let pool = rayon::ThreadPoolBuilder::new().thread_name(|k| format!("misfit-page-{k}")).build();
    let pool = Arc::new(pool.map_err(|e| Failure::new("serve", "threads", e.to_string(), "a machine that can start threads"))?);
    let ip = options.listen.unwrap_or(IpAddr::V4(Ipv4Addr::LOCALHOST));
    runtime.block_on(async {
        let place = format!("{ip}:{}", options.port);
        let listener = TcpListener::bind((ip, options.port)).await.map_err(|e| cannot(&place, e))?;
        let port = listener.local_addr().map_err(|e| cannot(&place, e))?.port();
        let guard = Guard::new(ip, port);
        ready(&Address { url: guard.url(), port });
        let folder = Some(options.path.clone()).filter(|p| p.is_dir() && !is_study(p));
        let (slots, working) = (Semaphore::new(AT_ONCE), AtomicUsize::new(0));
        let (benches, options) = (RwLock::new(benches), options.clone());
        let app = Arc::new(App { guard, benches, folder, baskets: Baskets::default(), options, pool, slots, working });
        begin_reading(&app);
        let served = app.clone();
        let router = Router::new().fallback(move |request| api::answer(served.clone(), request));
        let serving = async move { axum::serve(Door::new(listener), router).await };
        let stopping = async {
            while !stop.load(Ordering::Relaxed) {
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        };
        tokio::select! {
            ended = serving => ended.map_err(|e| cannot(&place, e))?,
            () = stopping => {}
        }
        Ok(ended(&app).await)
    })
}

/// Stops the jobs and waits for them to keep what they have.
async fn ended(app: &App) -> bool {
    let running: Vec<_> = app.benches().iter().filter_map(|b| b.running()).collect();
    running.iter().for_each(|j| j.stop());
    let until = tokio::time::Instant::now() + ENDING;
    while app.working.load(Ordering::SeqCst) > 0 && tokio::time::Instant::now() < until {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    !running.is_empty()
}

/// A single study is read while the browser still opens.
fn begin_reading(app: &Arc<App>) {
    if let [only] = app.benches().as_slice() {
        let only = only.clone();
        // What cannot be read is said when the page asks for it.
        let _ = std::thread::Builder::new().spawn(move || only.loaded().map(|_| ()));
    }
}

/// The studies that are served: the one that is named, or those in a folder and in its folders.
fn studies(options: &Options) -> Result<Vec<Arc<Bench>>, Failure> {
    let path = &options.path;
    let mut found: Vec<PathBuf> = vec![];
    if is_study(path) {
        found.push(path.clone());
    } else {
        for first in folders(path) {
            if is_study(&first) {
                found.push(first);
            } else {
                found.extend(folders(&first).into_iter().filter(|p| is_study(p.as_path())));
            }
        }
    }
    let mut found: Vec<PathBuf> = found.into_iter().flat_map(|p| [vec![p.clone()], saved(&p)].concat()).collect();
    found.truncate(STUDIES);
    // A folder without a study is served too: the first study can be made on the page.
    if found.is_empty() && !path.is_dir() {
        return Err(Failure::new(
            "serve",
            path.display().to_string(),
            "there is no such folder or file",
            "a folder with study.toml, that file, or a folder of such folders",
        ));
    }
    let mut all: Vec<Arc<Bench>> = vec![];
    for p in found {
        all.push(one(p, &all, options));
    }
    Ok(all)
}

fn is_study(path: &Path) -> bool {
    path.is_file() || path.join("study.toml").is_file()
}

/// Studies that were saved beside the study of a folder: files of other names that name a dataset.
fn saved(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return vec![] };
    let names_dataset = |path: &Path| {
        let table = crate::limits::text(path).ok().and_then(|t| t.parse::<toml::Table>().ok());
        table.is_some_and(|t| t.get("dataset").is_some_and(toml::Value::is_str))
    };
    let toml = |path: &PathBuf| path.extension().is_some_and(|e| e == "toml") && path.file_name().is_some_and(|n| n != "study.toml");
    let mut all: Vec<PathBuf> = entries.filter_map(Result::ok).map(|e| e.path()).filter(toml).filter(|p| names_dataset(p)).collect();
    all.sort();
    all
}

/// A study under a name of its own in addresses.
fn one(path: PathBuf, others: &[Arc<Bench>], options: &Options) -> Arc<Bench> {
    let whole = path.canonicalize().unwrap_or_else(|_| path.clone());
    let folder = whole.file_name().is_some_and(|n| n == "study.toml").then(|| whole.parent().map(Path::to_path_buf)).flatten();
    let name = folder.unwrap_or(whole).file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' };
    let mut id: String = name.chars().map(plain).take(60).collect();
    while id.is_empty() || others.iter().any(|o| o.id == id) {
        id += "-2";
    }
    Arc::new(Bench::new(id, path, options.data.clone(), options.seed))
}

fn folders(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(path) else { return vec![] };
    let mut all: Vec<PathBuf> = entries.filter_map(Result::ok).map(|e| e.path()).filter(|p| p.is_dir()).collect();
    all.sort();
    all
}
