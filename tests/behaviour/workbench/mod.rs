//! The workbench as its readers meet it: over HTTP, and in a browser.

mod browser;
mod client;
mod devtools;
mod hostile;
mod work;
