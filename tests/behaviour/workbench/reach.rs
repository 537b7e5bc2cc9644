//! Whether everybody can read and use the page: axe-core (Deque Systems, MPL 2.0, `axe.min.js` beside this file) finds nothing serious, in light and dark.

use serde_json::json;

use super::browser::{ANSWER, click, press};
use super::client::Served;
use super::devtools::Browser;
use crate::rig::Rig;

const AXE: &str = include_str!("axe.min.js");

/// What axe-core calls serious or critical on the page as it stands, each with its first element.
const SERIOUS: &str = "axe.run(document, { resultTypes: ['violations'] }).then(found => found.violations
    .filter(v => v.impact === 'serious' || v.impact === 'critical')
    .map(v => `${v.id}: ${v.nodes.length}, ${v.nodes[0].html.slice(0, 200)}, ${v.nodes[0].failureSummary}`))";

fn is_in_reach(browser: &mut Browser, view: &str) {
    for (scheme, dark) in [("light", false), ("dark", true)] {
        let features =
            json!([{ "name": "prefers-color-scheme", "value": scheme }, { "name": "prefers-reduced-motion", "value": "reduce" }]);
        browser.call("Emulation.setEmulatedMedia", json!({ "features": features }));
        browser.until(&format!("(getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0] < 60) === {dark}"), 5);
        assert_eq!(browser.eval(SERIOUS), json!([]), "{view}, {scheme}");
    }
}

#[test]
fn nothing_on_the_page_is_out_of_reach() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    browser.eval(AXE);
    browser.until("document.querySelectorAll('#view-compare .card').length === 3", 20);
    is_in_reach(&mut browser, "compare");
    click(&mut browser, "#view-compare button.card");
    browser.until("document.querySelectorAll('#large .js-plotly-plot').length === 4", 30);
    is_in_reach(&mut browser, "a test, large");
    click(&mut browser, "#tab-structure");
    click(&mut browser, "#do-score");
    browser.until("document.querySelectorAll('.candidate').length > 5", 60);
    is_in_reach(&mut browser, "structure");
    let coulomb = "[...document.querySelectorAll('.candidate')].find(c => c.textContent.startsWith('coulomb'))";
    browser.eval(&format!("{coulomb}.click()"));
    browser.until("document.querySelectorAll('.pictures svg').length === 2", 10);
    is_in_reach(&mut browser, "an effect");
    press(&mut browser, "Add coulomb at c1.x");
    browser.until(&format!("{ANSWER}?.startsWith('Added coulomb at c1.x')"), 60);
    for view in ["parameters", "ladder", "models", "new"] {
        click(&mut browser, &format!("#tab-{view}"));
        browser.until(&format!("!document.getElementById('view-{view}').hidden"), 10);
        is_in_reach(&mut browser, view);
    }
    // What is out of reach would be told.
    browser.eval("document.querySelector('main').append(document.createElement('img'))");
    assert!(browser.eval(SERIOUS).to_string().contains("image-alt"));
}
