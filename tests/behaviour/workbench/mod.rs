//! The workbench as its readers meet it: over HTTP, and in a browser.

mod beyond;
mod browser;
mod client;
mod devtools;
mod fresh;
mod hostile;
mod reach;
mod work;
