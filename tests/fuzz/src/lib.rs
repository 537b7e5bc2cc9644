//! What every reader must keep to, whatever the bytes: it answers or refuses, without a panic (libFuzzer sees those and hangs), and takes no
//! more memory than ten times the file.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use misfit::data::inspect::inspect;
use misfit::data::readers::{Wanted, read};

/// Counts what is held and the most that was.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        MOST.fetch_max(HELD.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Ten times the file, and what a reader needs for itself (tables of the decompressors, buffers of threads).
const OWN: usize = 32 << 20;

/// Puts the bytes where the reader of `extension` finds them, lets it look and read, and weighs what it took.
pub fn feed(bytes: &[u8], extension: &str, also: impl FnOnce(&PathBuf)) {
    let path = PathBuf::from(format!("/dev/shm/misfit-fuzz-{}.{extension}", std::process::id()));
    std::fs::write(&path, bytes).expect("/dev/shm takes a file");
    let before = HELD.load(Relaxed);
    MOST.store(before, Relaxed);
    let column = |name: &str, text: bool| Wanted { name: name.into(), text };
    let _ = read(&path, &[column("t", false), column("F", false)], None);
    let _ = read(&path, &[column("n", true)], None);
    let _ = inspect(&path, None);
    also(&path);
    let took = MOST.load(Relaxed) - before;
    assert!(took <= 10 * bytes.len() + OWN, "{took} bytes for a file of {}", bytes.len());
}
