//! The workbench as its readers meet it: over HTTP, and in a browser.

mod beyond;
mod browser;
mod client;
mod devtools;
mod errors;
mod foot;
mod fresh;
mod hostile;
mod numbers;
mod reach;
mod work;
