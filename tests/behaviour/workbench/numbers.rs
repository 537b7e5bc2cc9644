//! What the page costs, printed and not held: `cargo test --release --test behaviour -- --ignored --nocapture numbers_of_the_page` on a machine that does
//! nothing else.

use std::path::Path;
use std::time::Instant;

use super::browser::click;
use super::client::Served;
use super::devtools::Browser;

/// Moves of a slider.
const MOVES: usize = 60;

#[test]
#[ignore = "measures"]
fn numbers_of_the_page() {
    for (study, test) in [("08-two-effects", 0), ("01-hidden-effect", 0), ("06-virtual-tensioner", 1)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(study);
        let began = Instant::now();
        let served = Served::start(&path, &["--json"]);
        let Some(mut browser) = Browser::start(1280, 900) else { return };
        let up = began.elapsed().as_secs_f64();
        let began = Instant::now();
        browser.go(&served.url);
        browser.until("document.querySelector('#view-compare .card .computed')", 60);
        let first = began.elapsed().as_secs_f64();
        let bytes = "[...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')]
            .filter(e => !e.name.includes('/api/')).reduce((sum, e) => sum + e.transferSize, 0)";
        let bytes = browser.eval(bytes).as_f64().unwrap();
        click(&mut browser, "#tab-parameters");
        browser.until("document.querySelector('#view-parameters input[type=range]')", 20);
        // Number 0 is all tests.
        let shown = browser.eval(&format!(
            "(() => {{ const s = document.querySelector('#view-parameters select');
                if (s && {test}) {{ s.selectedIndex = {test}; s.dispatchEvent(new Event('change', {{ bubbles: true }})); }}
                return s ? s.selectedOptions[0].textContent : 'all'; }})()"
        ));
        let done = "performance.getEntriesByName('slider').length";
        for k in 0..MOVES {
            let had = browser.eval(done);
            let at = 300 + 400 * (k * 7 % MOVES) / MOVES;
            browser.eval(&format!(
                "{{ const s = document.querySelector('#view-parameters input[type=range]'); s.value = {at}; s.dispatchEvent(new Event('input', {{ bubbles: true }})); }}"
            ));
            browser.until(&format!("{done} > {had}"), 20);
        }
        let times = browser.eval("performance.getEntriesByName('slider').map(e => e.duration)");
        let mut times: Vec<f64> = times.as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect();
        times.sort_by(f64::total_cmp);
        let quantile = |q: f64| times[((times.len() - 1) as f64 * q).round() as usize];
        println!(
            "{study}: server and browser up {up:.2} s, first page {first:.2} s, {:.0} kB of page; slider to curve ({shown}), {} moves: median {:.0} ms, 95 % {:.0} ms; \
             memory {:.0} MB",
            bytes / 1e3,
            times.len(),
            quantile(0.5),
            quantile(0.95),
            served.memory()
        );
    }
}
