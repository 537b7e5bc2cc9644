//! Requests and their answers.
//!
//! | request | answer |
//! |---|---|
//! | `GET /` | the page; with `?token=` it sets the cookie |
//! | `GET /page/FILE` | its files |
//! | `GET /api/studies`, `/api/style`, `/api/effects`, `/api/effects/NAME` | what is served; colours and axes of charts; the library |
//! | `GET /api/studies/S` | title, tests, tree of models, jobs |
//! | `GET /api/studies/S/events` | server-sent events: lines, costs and ends of jobs |
//! | `GET /api/studies/S/models/M` | structure, effects and parameters of a model |
//! | `GET /api/studies/S/runs/R/FILE` | a file of a run |
//! | `POST /api/baskets` | a place for files that are dropped on the page |
//! | `POST /api/baskets/B` | `{name, bytes}`: a file that comes next |
//! | `POST /api/files/B/F` | its bytes |
//! | `POST /api/look` | `{basket, corrections}`: what is found in the files |
//! | `POST /api/new` | `{basket, corrections, name}`: a study in the folder that is served |
//! | `POST /api/studies/S/modes` | `{model, values, test}`: natural modes |
//! | `POST /api/studies/S/compare` | `{model, values, tests, whole, before}`: curves |
//! | `POST /api/studies/S/run` | [`Order`]: a job |
//! | `POST /api/studies/S/stop` | `{job}` |
//! | `POST /api/studies/S/save` | `{model, name}`: a study beside study.toml |
//! | `POST /api/studies/S/open` | `{model}`: the held-out tests are opened |
//!
//! Names in addresses are looked up in lists; none of them becomes a path before it was found there.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::body::{Body, Bytes, to_bytes};
use axum::extract::Request;
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream::unfold;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tokio::sync::broadcast::error::RecvError;

use crate::effect::{LIBRARY, find};
use crate::report::chart;
use crate::study::run::is_run;
use crate::work::{Failure, curves_json, demonstrate, effect_json};

use super::act;
use super::bench::Bench;
use super::curves::{Asked, compare};
use super::order::{Order, VERBS, command, options};
use super::{App, arrive, assets, motion, picture, resume};

/// Bytes of a request's body at most: an order has a few hundred, the values of a thousand sliders 30 kB.
const BODY: usize = 256 << 10;
/// Bytes of a file of a run at most.
const FILE: u64 = 64 << 20;
/// What the page may do: its own scripts and requests, and nothing of elsewhere. Styles inline are plotly's.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// A report holds its scripts in itself: it is opened as a page of no origin, which can ask this server nothing.
const REPORT_POLICY: &str = "sandbox allow-scripts allow-popups; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                             img-src data:; frame-ancestors 'none'";

/// What cannot be answered.
pub(super) struct Refused(StatusCode, Failure);

impl From<Failure> for Refused {
    fn from(failure: Failure) -> Refused {
        Refused(StatusCode::BAD_REQUEST, failure)
    }
}

pub(super) fn refused(status: StatusCode, message: &str, accepted: &str) -> Refused {
    Refused(status, Failure::new("serve", "", message, accepted))
}

pub(super) fn unknown() -> Refused {
    refused(StatusCode::NOT_FOUND, "there is nothing at this address", "an address of the page")
}

pub(super) type Answer = Result<Response, Refused>;

/// Answers a request.
pub async fn answer(app: Arc<App>, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let mut response = match app.guard.refuses(&parts) {
        Some((status, why)) => failed(refused(status, why, "a request of the page that this server has given")),
        None => {
            let opens = app.guard.opens(&parts);
            let path: Vec<&str> = parts.uri.path().split('/').skip(1).collect();
            let found = match parts.method {
                Method::GET => get(&app, &path).await,
                Method::POST => post(&app, &path, body).await,
                _ => Err(refused(StatusCode::METHOD_NOT_ALLOWED, "the method is neither GET nor POST", "GET or POST")),
            };
            let mut response = found.unwrap_or_else(failed);
            if opens && let Ok(cookie) = HeaderValue::from_str(&app.guard.cookie()) {
                response.headers_mut().insert(header::SET_COOKIE, cookie);
            }
            response
        }
    };
    let headers = response.headers_mut();
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(POLICY));
    for (name, value) in [
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "DENY"),
        ("referrer-policy", "no-referrer"),
        ("cross-origin-opener-policy", "same-origin"),
        ("cross-origin-resource-policy", "same-origin"),
        ("cache-control", "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn failed(Refused(status, failure): Refused) -> Response {
    (status, [(header::CONTENT_TYPE, "application/json")], failure.json().to_string()).into_response()
}

pub(super) fn told(value: &Value) -> Answer {
    Ok(([(header::CONTENT_TYPE, "application/json")], value.to_string()).into_response())
}

fn bench(app: &App, id: &str) -> Result<Arc<Bench>, Refused> {
    app.benches().into_iter().find(|b| b.id == id).ok_or_else(unknown)
}

/// Work on a thread of its own, its threads those of the quick pool: what a page waits for does not stand behind a job.
pub(super) async fn quick<T: Send + 'static>(
    app: &Arc<App>,
    work: impl FnOnce() -> Result<T, Refused> + Send + 'static,
) -> Result<T, Refused> {
    let busy = || refused(StatusCode::SERVICE_UNAVAILABLE, "the server is being closed", "to start it again");
    let _permit = app.slots.acquire().await.map_err(|_| busy())?;
    let pool = app.pool.clone();
    let done = tokio::task::spawn_blocking(move || pool.install(work)).await;
    done.unwrap_or_else(|_| {
        Err(refused(StatusCode::INTERNAL_SERVER_ERROR, "the work ended with an error of the program", "another request; please report it"))
    })
}

async fn get(app: &Arc<App>, path: &[&str]) -> Answer {
    match path {
        [""] => page(""),
        ["favicon.ico"] => page("icon.svg"),
        ["page", name] => page(name),
        ["api", "studies"] => {
            let one = |b: &Arc<Bench>| json!({ "id": b.id, "path": b.path.display().to_string(), "options": options(b) });
            let all: Vec<Value> = app.benches().iter().map(one).collect();
            let folder = app.folder.as_ref().map(|f| f.display().to_string());
            told(&json!({ "studies": all, "folder": folder, "version": env!("CARGO_PKG_VERSION") }))
        }
        ["api", "style"] => told(&chart::style()),
        ["api", "effects"] => told(&json!({ "effects": LIBRARY.iter().map(|e| effect_json(e.info())).collect::<Vec<_>>() })),
        ["api", "effects", name] => {
            let effect = find(name).map_err(|e| Refused(StatusCode::NOT_FOUND, e.into()))?;
            let value = quick(app, move || {
                let mut value = effect_json(effect.info());
                if let (Some(d), Some(map)) = (demonstrate(effect), value.as_object_mut()) {
                    map.extend(curves_json(&d));
                }
                Ok(value)
            });
            told(&value.await?)
        }
        ["api", "studies", id] => {
            let bench = bench(app, id)?;
            told(&quick(app, move || state(&bench)).await?)
        }
        ["api", "studies", id, "events"] => Ok(events(&*bench(app, id)?)),
        ["api", "studies", id, "models", model] => {
            let (bench, model) = (bench(app, id)?, model.to_string());
            told(&quick(app, move || described(&bench, &model)).await?)
        }
        ["api", "studies", id, "runs", run, file] => {
            let (bench, run, file) = (bench(app, id)?, run.to_string(), file.to_string());
            quick(app, move || run_file(&bench, &run, &file)).await
        }
        _ => Err(unknown()),
    }
}

fn page(name: &str) -> Answer {
    let (kind, text) = assets::file(name).ok_or_else(unknown)?;
    Ok(([(header::CONTENT_TYPE, kind)], text).into_response())
}

fn state(bench: &Bench) -> Result<Value, Refused> {
    let loaded = bench.loaded()?;
    loaded.refresh();
    let study = &loaded.study;
    let tests: Vec<Value> = loaded.case.plans.iter().map(|(p, s)| json!({ "id": p.id, "kind": p.kind.word(), "split": s })).collect();
    let mut value = loaded.tree();
    value["study"] = json!({
        "id": bench.id, "title": study.title, "file": study.file.display().to_string(), "folder": study.folder.display().to_string(), "runs": loaded.runs().display().to_string(),
        "options": options(bench), "tests": tests, "notes": loaded.case.notes(), "assumptions": study.assumptions,
    });
    // A run under way has no result either.
    if let (Some(run), Some(open)) = (bench.running().and_then(|j| j.run()), value["unfinished"].as_array_mut()) {
        open.retain(|o| o["id"] != *run);
    }
    value["jobs"] = bench.jobs().into();
    Ok(value)
}

/// A model: what it is made of, and its parameters with their intervals.
fn described(bench: &Bench, id: &str) -> Result<Value, Refused> {
    let loaded = bench.loaded()?;
    let model = loaded.model(id)?;
    let system = &model.system;
    let names: BTreeMap<(usize, usize), String> = system.free().into_iter().map(|f| ((f.instance, f.param), f.name)).collect();
    let results = loaded.parameters(id);
    let profiles = loaded.profiles(id);
    let profile = |name: &str| profiles.iter().find(|p| p["name"] == name).cloned();
    let result = |name: &str| results.as_array().and_then(|all| all.iter().find(|p| p["name"] == name)).cloned().unwrap_or(Value::Null);
    let mut parameters = vec![];
    for (i, instance) in system.instances.iter().enumerate() {
        for (p, (info, value)) in instance.effect.info().params.iter().zip(&instance.params).enumerate() {
            let name = names.get(&(i, p)).cloned().unwrap_or_else(|| format!("{}.{}.{}", instance.at, instance.name(), info.name));
            let unit = crate::study::unit_of(system, &loaded.study.dataset, instance, p);
            let r = result(&name);
            let end = |v: f64| if v.is_finite() { Value::from(v) } else { Value::Null };
            parameters.push(json!({
                "key": format!("{i}.{p}"), "name": name, "effect": instance.name(), "at": instance.at, "doc": info.doc, "value": value.value, "free": value.free,
                "min": end(value.min), "max": end(value.max), "positive": info.sign == crate::effect::Sign::Positive,
                "unit": unit.symbol, "factor": unit.difference_to_si(1.0), "std": r["std"], "interval": r["interval"],
                "profile": profile(&name), "identifiable": r["identifiable"], "at_bound": r["at_bound"], "note": r["note"], "printed": r["printed"],
            }));
        }
    }
    let mut value = picture::structure(system);
    value["parameters"] = parameters.into();
    value["scored"] = model.marks.as_ref().map_or(Value::Null, |m| (**m).clone());
    Ok(value)
}

/// A file that lies in the folder of a run; the state of its solver is no concern of a page.
fn run_file(bench: &Bench, run: &str, file: &str) -> Answer {
    let kind = match file.rsplit_once('.').map(|f| f.1) {
        Some("html") => "text/html; charset=utf-8",
        Some("json") => "application/json",
        Some("parquet") => "application/octet-stream",
        _ => "text/plain; charset=utf-8",
    };
    let listed = |folder: &std::path::Path, name: &str| {
        std::fs::read_dir(folder).is_ok_and(|mut all| all.any(|e| e.is_ok_and(|e| e.file_name() == name)))
    };
    let runs = bench.loaded()?.runs();
    // Names are looked for in the listing before they become a path; a link would lead out of the study.
    let no_link = |path: &std::path::Path| std::fs::symlink_metadata(path).is_ok_and(|m| !m.file_type().is_symlink());
    let folder = runs.join(run);
    if !is_run(run)
        || ["checkpoint.json", "fits.journal"].contains(&file)
        || !listed(&runs, run)
        || !no_link(&folder)
        || !listed(&folder, file)
    {
        return Err(unknown());
    }
    let path = folder.join(file);
    if !no_link(&path) || !path.is_file() {
        return Err(unknown());
    }
    let bytes = crate::limits::bytes(&path, FILE).map_err(|e| refused(StatusCode::NOT_FOUND, &e.to_string(), "a file that can be read"))?;
    let mut response = ([(header::CONTENT_TYPE, kind)], bytes).into_response();
    let policy = if kind.starts_with("text/html") { REPORT_POLICY } else { POLICY };
    response.headers_mut().insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(policy));
    Ok(response)
}

fn events(bench: &Bench) -> Response {
    let next = |mut from: tokio::sync::broadcast::Receiver<Arc<str>>| async move {
        let event = match from.recv().await {
            Ok(text) => Event::default().data(&*text),
            // A page that is too slow asks for the whole state.
            Err(RecvError::Lagged(_)) => Event::default().data("{\"type\":\"tree\"}"),
            Err(RecvError::Closed) => return None,
        };
        Some((Ok::<Event, Infallible>(event), from))
    };
    Sse::new(unfold(bench.events.subscribe(), next)).keep_alive(KeepAlive::default()).into_response()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Compared {
    model: String,
    #[serde(default)]
    values: BTreeMap<String, f64>,
    tests: Option<Vec<String>>,
    #[serde(default)]
    whole: bool,
    /// The model before the effect of this one was added, as it was fitted.
    #[serde(default)]
    before: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stopped {
    job: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    model: String,
    name: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Opened {
    model: String,
}

pub(super) fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Refused> {
    serde_json::from_slice(bytes)
        .map_err(|e| refused(StatusCode::BAD_REQUEST, &format!("the body is no such request: {e}"), "the JSON that the page sends"))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Moving {
    model: String,
    #[serde(default)]
    values: BTreeMap<String, f64>,
    test: Option<String>,
}

/// The whole of a short body.
pub(super) async fn short(body: Body) -> Result<Bytes, Refused> {
    let long = |_| refused(StatusCode::PAYLOAD_TOO_LARGE, "the body is cut off, or longer than 256 kB", "a shorter body");
    to_bytes(body, BODY).await.map_err(long)
}

async fn post(app: &Arc<App>, path: &[&str], body: Body) -> Answer {
    let ["api", "studies", id, what] = path else { return arrive::post(app, path, body).await };
    let bench = bench(app, id)?;
    let bytes = short(body).await?;
    match *what {
        "compare" => {
            let asked: Compared = read(&bytes)?;
            told(&quick(app, move || compared(&bench, &asked)).await?)
        }
        "modes" => {
            let asked: Moving = read(&bytes)?;
            let done = quick(app, move || {
                let loaded = bench.loaded()?;
                let system = crate::work::with_values(&loaded.study, &loaded.model(&asked.model)?.system, &asked.values)?;
                Ok(motion::lowest(&loaded.study, &system, asked.test.as_deref())?)
            });
            told(&done.await?)
        }
        "run" => {
            let order: Order = read(&bytes)?;
            let app2 = app.clone();
            told(&quick(app, move || begun(&app2, &bench, order)).await?)
        }
        "stop" => {
            let asked: Stopped = read(&bytes)?;
            let job = bench.job(asked.job).ok_or_else(unknown)?;
            job.stop();
            told(&json!({ "stopped": asked.job }))
        }
        "save" => {
            let asked: Saved = read(&bytes)?;
            let of = app.clone();
            let done = quick(app, move || {
                let (file, mut told) = act::save(&*bench.loaded()?, &asked.model, &asked.name)?;
                told["study"] = of.serves(file).into();
                Ok(told)
            });
            told(&done.await?)
        }
        "open" => {
            let asked: Opened = read(&bytes)?;
            let done = quick(app, move || {
                let opened = act::open(&*bench.loaded()?, &asked.model)?;
                bench.changed();
                Ok(opened)
            });
            told(&done.await?)
        }
        _ => Err(unknown()),
    }
}

fn compared(bench: &Bench, asked: &Compared) -> Result<Value, Refused> {
    let started = std::time::Instant::now();
    let loaded = bench.loaded()?;
    let of = Asked {
        tests: asked.tests.as_ref().map(|t| t.iter().map(String::as_str).collect()),
        whole: asked.whole,
        opened: !loaded.opened().is_empty(),
    };
    // A fit that runs is looked at where it stands.
    let trial = asked.model.strip_prefix("job:").and_then(|id| bench.job(id.parse().ok()?)?.trial());
    let (case, system) = match trial {
        Some(trial) => (loaded.case.clone(), trial),
        None => {
            let (model, system) = if asked.before { loaded.before(&asked.model)? } else { loaded.own(&asked.model)? };
            (model.case.clone(), crate::work::with_values(&loaded.study, &system, &asked.values)?)
        }
    };
    let tests = compare(&loaded.study, &case, &system, &of).map_err(Failure::from)?;
    Ok(json!({ "tests": tests, "seconds": started.elapsed().as_secs_f64() }))
}

/// Begins a job on a thread of its own.
fn begun(app: &Arc<App>, bench: &Arc<Bench>, mut order: Order) -> Result<Value, Refused> {
    if !VERBS.contains(&order.verb.as_str()) {
        return Err(Failure::new("serve", &order.verb, format!("`{}` is no verb of the workbench", order.verb), VERBS.join(", ")).into());
    }
    let loaded = bench.loaded()?;
    // Which run may be gone on with is not the page's to say.
    let resume = order.resume.take();
    if order.verb == "resume" {
        loaded.refresh();
        order = resume::goes_on(&loaded, &resume.unwrap_or_default())?;
    }
    let starts = crate::work::starts(&loaded.study, &loaded.model(&order.model)?.system, &order.values)?;
    let job = bench.enter(&order.verb, &order.model, command(bench, &order, &starts)).map_err(|f| Refused(StatusCode::CONFLICT, f))?;
    let told = json!({ "job": job.id, "command": job.command, "verb": job.verb, "model": job.model });
    let (app, bench) = (app.clone(), bench.clone());
    let thread = std::thread::Builder::new().name(format!("misfit-{}", order.verb));
    let of = job.clone();
    let started = thread.spawn(move || {
        app.working.fetch_add(1, Ordering::SeqCst);
        let work = std::panic::AssertUnwindSafe(|| act::act(&bench, &loaded, &of, &order));
        let done = std::panic::catch_unwind(work)
            .unwrap_or_else(|_| Err(Failure::new("serve", &order.verb, "the program failed here", "please report it")));
        of.end(done);
        bench.changed();
        app.working.fetch_sub(1, Ordering::SeqCst);
    });
    if let Err(e) = started {
        job.end(Err(Failure::new("serve", "thread", e.to_string(), "a machine that can start threads")));
    }
    Ok(told)
}
