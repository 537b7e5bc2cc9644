//! The page in a browser: what a reader does with mouse and keyboard.

use serde_json::json;

use super::client::Served;
use super::devtools::Browser;
use crate::rig::Rig;

pub const ANSWER: &str = "document.getElementById('answer')?.textContent";

pub fn click(browser: &mut Browser, selector: &str) {
    browser.until(&format!("document.querySelector({selector:?})"), 20);
    browser.eval(&format!("document.querySelector({selector:?}).click()"));
}

/// A button by its words.
pub fn press(browser: &mut Browser, words: &str) {
    let find = format!("[...document.querySelectorAll('button')].find(b => b.textContent.startsWith({words:?}) && b.offsetParent)");
    browser.until(&find, 20);
    browser.eval(&format!("{find}.click()"));
}

#[test]
fn a_reader_finds_adds_undoes_slides_and_saves() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    assert_eq!(browser.eval("location.search"), "", "the token does not stay in the address");
    browser.until("document.querySelectorAll('#view-compare .card').length === 3", 20);
    assert_eq!(browser.eval("document.querySelectorAll('#view-compare .card.sealed').length"), 1, "the held-out test is sealed");
    let text = browser.eval(ANSWER);
    assert!(text.as_str().unwrap().contains("on the fit tests"), "{text}");
    assert_eq!(browser.eval("document.documentElement.scrollWidth <= innerWidth"), true, "no scrolling sideways at 1024 px");

    // By keyboard alone: to the tabs, one to the right, the place, its best candidate, adding it.
    browser.eval("document.getElementById('tab-compare').focus()");
    browser.key("ArrowRight");
    browser.until("document.activeElement.id === 'tab-structure' && !document.getElementById('view-structure').hidden", 5);
    browser.eval("document.getElementById('do-score').focus()");
    browser.key("Enter");
    browser.until("document.querySelectorAll('.candidate').length > 5", 60);
    browser.eval("document.querySelector('.place[aria-label^=c1]').focus()");
    browser.key("Enter");
    browser.until("document.querySelector('#view-structure h2').textContent === 'At c1.x'", 5);
    let coulomb = "[...document.querySelectorAll('.candidate')].find(c => c.textContent.startsWith('coulomb'))";
    browser.eval(&format!("{coulomb}.focus()"));
    browser.key("Enter");
    browser.until("document.querySelectorAll('.pictures svg').length === 2", 10);
    press(&mut browser, "Add coulomb at c1.x");
    browser.until("document.getElementById('model-name').textContent === '+ coulomb at c1.x'", 60);
    browser.until(&format!("{ANSWER}?.startsWith('Added coulomb at c1.x: the error on the fit tests')"), 10);
    assert_eq!(browser.eval("document.getElementById('command').textContent.startsWith('misfit ')"), true);

    // Undo goes back; the other model stays in the tree.
    click(&mut browser, "#undo");
    browser.until("document.getElementById('model-name').textContent === 'the study as it stands'", 10);
    assert_eq!(browser.eval("document.querySelectorAll('.tree .node').length"), 2);
    press(&mut browser, "+ coulomb at c1.x");
    browser.until("document.getElementById('model-name').textContent === '+ coulomb at c1.x'", 10);

    // A slider moves the curve.
    click(&mut browser, "#tab-parameters");
    browser.until("document.querySelector('#view-parameters input[type=range]')", 10);
    let curve = "document.querySelector('#view-parameters .thumb .computed').getAttribute('d')";
    let before = browser.eval(curve);
    browser.eval("{ const s = document.querySelector('#view-parameters input[type=range]'); s.value = 900; s.dispatchEvent(new Event('input', { bubbles: true })); }");
    browser.until(&format!("{curve} !== {before}"), 10);
    browser.until("performance.getEntriesByName('slider').length > 0", 10);
    // The error over all tests follows, and goes back with the values.
    browser.until(&format!("{ANSWER}?.includes(\"These are the sliders' values, not a fit.\")"), 5);
    press(&mut browser, "Put back");
    browser.until(&format!("!{ANSWER}?.includes('sliders')"), 5);
    browser.until(&format!("{curve} === {before}"), 10);

    // Saved by name, found again after a reload.
    click(&mut browser, "#tab-models");
    browser.eval("document.getElementById('save-name').value = 'by-hand'; document.querySelector('form.save').requestSubmit()");
    browser.until(&format!("{ANSWER}?.startsWith('Saved as ')"), 10);
    assert!(rig.read("by-hand.toml").contains("coulomb"));
    browser.call("Page.reload", json!({}));
    browser.until(
        "document.documentElement?.dataset.ready === 'true' && document.getElementById('model-name').textContent === '+ coulomb at c1.x'",
        20,
    );
    assert_eq!(browser.eval("document.getElementById('view-models').hidden"), false, "the view is the same");

    // Large, by plotly, and in the dark.
    click(&mut browser, "#tab-compare");
    click(&mut browser, "#view-compare button.card");
    browser.until("document.querySelectorAll('#large .js-plotly-plot').length === 4", 30);
    browser.call("Emulation.setEmulatedMedia", json!({ "features": [{ "name": "prefers-color-scheme", "value": "dark" }] }));
    let light = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0]";
    browser.until(&format!("{light} < 60"), 5);
    browser.until("document.querySelector('#large .main-svg')?.style.background.match(/\\d+/g)?.map(Number)[0] < 60", 10);

    // Everything that is pressed has a name.
    let nameless = "[...document.querySelectorAll('button, input, select, [role=button], svg[role=img]')].filter(e => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length)).length";
    assert_eq!(browser.eval(nameless), 0);
}

#[test]
fn names_of_files_never_become_markup() {
    let hostile = "<img src=x onerror=document.title='taken'>";
    let rig = Rig::new();
    rig.write("study.toml", &rig.read("study.toml").replacen("schema = 1", &format!("schema = 1\ntitle = \"{hostile}\""), 1));
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1280, 900) else { return };
    browser.go(&served.url);
    browser.until("document.querySelectorAll('#view-compare .card').length === 3", 20);
    assert_eq!(browser.eval("document.title"), format!("{hostile} - misfit"));
    assert_eq!(browser.eval("document.querySelectorAll('img').length"), 0);
    // A name that the study refuses comes back in the error.
    rig.change("study.toml", "from = \"ground\"", &format!("from = \"{hostile}\""));
    browser.call("Page.reload", json!({}));
    browser.until(&format!("{ANSWER}?.includes('<img src=x')"), 20);
    assert_eq!(browser.eval("document.querySelectorAll('img').length"), 0);
    assert_ne!(browser.eval("document.title"), "taken");
    // Nothing can be looked at or computed; a new study can be made.
    let live = "[...document.querySelectorAll('[role=tab], #do-fit, #do-score')].filter(b => !b.disabled).map(b => b.id).join()";
    browser.until(&format!("{live} === 'tab-new'"), 5);
    rig.change("study.toml", &format!("from = \"{hostile}\""), "from = \"ground\"");
    browser.call("Page.reload", json!({}));
    browser.until(&format!("{live}.split(',').length === 8"), 20);
}
