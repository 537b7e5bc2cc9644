//! Requests about files that are dropped on the page, and the study that is made of them.

use std::io::Write;
use std::sync::Arc;

use axum::body::Body;
use axum::http::StatusCode;
use futures_util::StreamExt;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::work::new::Correction;

use super::App;
use super::api::{Answer, quick, read, refused, short, told, unknown};
use super::fresh::folder;
use super::order::quoted;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Announced {
    name: String,
    bytes: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Looked {
    basket: u64,
    #[serde(default)]
    corrections: Vec<Correction>,
    /// Of a study that is written.
    #[serde(default)]
    name: String,
}

/// Takes a file as it comes, no byte more than was announced.
async fn file(app: &App, basket: u64, file: usize, body: Body) -> Answer {
    let (path, bytes) = app.baskets.place(basket, file)?;
    let cannot =
        |e: std::io::Error| refused(StatusCode::BAD_REQUEST, &format!("the file cannot be kept: {e}"), "space for temporary files");
    let mut kept = std::fs::File::create(&path).map_err(cannot)?;
    let (mut stream, mut come) = (body.into_data_stream(), 0u64);
    while let Some(chunk) = stream.next().await {
        let chunk = chunk.map_err(|_| refused(StatusCode::BAD_REQUEST, "the file is cut off", "the whole file"))?;
        come += chunk.len() as u64;
        if come > bytes {
            break;
        }
        kept.write_all(&chunk).map_err(cannot)?;
    }
    if come != bytes {
        return Err(refused(StatusCode::BAD_REQUEST, "the file is not as long as was announced", "the file that was announced"));
    }
    told(&app.baskets.came(basket, file)?)
}

/// Requests about files that are dropped on the page.
async fn study(app: &Arc<App>, what: &str, body: Body) -> Answer {
    let bytes = short(body).await?;
    if what == "baskets" {
        return told(&app.baskets.open()?);
    }
    let asked: Looked = read(&bytes)?;
    let app2 = app.clone();
    if what == "look" {
        return told(&quick(app, move || Ok(app2.baskets.look(asked.basket, &asked.corrections)?)).await?);
    }
    let written = quick(app, move || {
        let dir = folder(app2.folder.as_deref(), &asked.name)?;
        let mut written = app2.baskets.write(asked.basket, &asked.corrections, &dir)?;
        written["study"] = app2.serves(dir.clone()).into();
        let files = written["files"].as_array().map(|f| f.iter().filter_map(Value::as_str).map(quoted).collect::<Vec<_>>().join(" "));
        let mut line = format!("misfit new {} --from {}", quoted(&dir.display().to_string()), files.unwrap_or_default());
        if !asked.corrections.is_empty() {
            line += &format!(" --correct {}", quoted(&json!(asked.corrections).to_string()));
        }
        written["command"] = line.into();
        Ok(written)
    });
    told(&written.await?)
}

/// Answers `/api/baskets`, `/api/baskets/B`, `/api/files/B/F`, `/api/look` and `/api/new`.
pub async fn post(app: &Arc<App>, path: &[&str], body: Body) -> Answer {
    let number = |text: &str| text.parse::<u64>().map_err(|_| unknown());
    match path {
        ["api", what @ ("baskets" | "look" | "new")] => study(app, what, body).await,
        ["api", "baskets", basket] => {
            let asked: Announced = read(&short(body).await?)?;
            told(&app.baskets.announce(number(basket)?, &asked.name, asked.bytes)?)
        }
        ["api", "files", basket, k] => file(app, number(basket)?, number(k)? as usize, body).await,
        _ => Err(unknown()),
    }
}
