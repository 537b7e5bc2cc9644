//! Watching a search: lines of progress and the wish to stop.

use std::sync::atomic::Ordering;

use crate::identify::Monitor;

/// Whether the run was interrupted or its time is over.
pub fn stopped(monitor: &Monitor) -> bool {
    let cancelled = monitor.cancel.as_ref().is_some_and(|f| f.load(Ordering::Relaxed));
    cancelled || monitor.deadline.is_some_and(|d| std::time::Instant::now() >= d)
}
