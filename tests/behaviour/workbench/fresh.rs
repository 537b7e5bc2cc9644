//! A study from files that are dropped on the page.

use serde_json::{Value, json};

use super::browser::{ANSWER, click, press};
use super::client::Served;
use super::devtools::Browser;
use crate::new::loop_text;
use crate::rig::{Rig, misfit};

/// Drops files on the page as a reader does.
fn drop_files(browser: &mut Browser, files: &[(&str, String)]) {
    let list = files.iter().map(|(name, text)| format!("d.items.add(new File([{}], {}));", json!(text), json!(name))).collect::<String>();
    browser.until("document.querySelector('.drop')", 20);
    browser.eval(&format!(
        "{{ const d = new DataTransfer(); {list} document.querySelector('.drop').dispatchEvent(new DragEvent('drop', {{ dataTransfer: d, bubbles: true, cancelable: true }})); }}"
    ));
}

/// Sets a field as a reader does.
fn set(browser: &mut Browser, selector: &str, value: &str) {
    browser.until(&format!("document.querySelector({selector:?})"), 10);
    browser.eval(&format!(
        "{{ const f = document.querySelector({selector:?}); f.value = {value:?}; f.dispatchEvent(new Event('change', {{ bubbles: true }})); }}"
    ));
}

#[test]
fn files_that_are_dropped_are_corrected_by_eye_and_become_a_study() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    browser.until(&format!("{ANSWER}.startsWith('There is no study in this folder yet')"), 10);
    // The second file does not say the unit of its force.
    let bare = loop_text(2.0).replacen(" [N]", "", 1);
    drop_files(&mut browser, &[("loop 1.txt", loop_text(1.0)), ("<img src=x>.txt", bare), ("notes.md", "no data".into())]);
    browser.until("document.querySelectorAll('#view-new .file').length === 2", 30);
    assert_eq!(browser.eval("document.querySelectorAll('#view-new img').length"), 0, "a name of a file is text");
    let first = "document.querySelector('#view-new .file')";
    let text = browser.eval(&format!("{first}.textContent")).to_string();
    assert!(text.contains("10 cycles of 1") && text.contains("2000 samples"), "{text}");
    assert_eq!(browser.eval("document.querySelectorAll('#view-new .thumb.record').length"), 4, "two records a file");
    assert_eq!(browser.eval("document.querySelectorAll('#view-new .thumb.loop path').length"), 2);
    let page = browser.eval("document.getElementById('view-new').textContent").to_string();
    assert!(page.contains("Left out") && page.contains("notes.md") && page.contains("Still wrong"), "{page}");
    assert!(!page.contains("misfit-dropped"), "the reader knows the files by their names: {page}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "looking writes nothing");

    // The start-up is corrected, the unit given.
    let shaded = browser.eval("document.querySelector('.startup')?.getAttribute('width')");
    set(&mut browser, "#new-0-0-start", "4");
    browser.until(&format!("document.querySelector('.startup').getAttribute('width') !== {shaded}"), 10);
    set(&mut browser, "#new-1-0-unit-2", "N");
    browser.until("!document.querySelector('#view-new .note')", 10);
    // A word that is no role is refused, and what stood before stays.
    click(&mut browser, "#new-0-ok");
    press(&mut browser, "Write the study");
    assert_eq!(browser.eval("document.querySelector('#new-name:invalid') !== null"), true, "it needs a name");
    browser.eval("{ const n = document.getElementById('new-name'); n.value = 'mount-A'; n.dispatchEvent(new Event('input')); }");
    press(&mut browser, "Write the study");
    browser.until("document.getElementById('ask').open && document.getElementById('ask-text').textContent.includes('<img src=x>.txt')", 10);
    click(&mut browser, "#ask-yes");
    browser.until(&format!("{ANSWER}.startsWith('Written: ')"), 20);
    browser.until("document.querySelectorAll('#view-compare .card').length === 2", 20);
    let dataset = std::fs::read_to_string(folder.path().join("mount-A/data/dataset.toml")).unwrap();
    assert!(dataset.contains("discard_cycles = 4   # start-up, of 10 cycles"), "{dataset}");
    assert_eq!(dataset.matches("unit = \"N\"").count(), 2, "{dataset}");
    assert!(!folder.path().join("mount-A/data/notes.md").exists());
    let fit = misfit(&["fit", &folder.path().join("mount-A").display().to_string(), "--json"]);
    assert_eq!(fit.code, 0, "{}", fit.stderr);
    assert_eq!(browser.eval("document.getElementById('study').value"), "mount-A");
    assert_eq!(browser.eval("document.getElementById('command').textContent.startsWith('misfit new ')"), true);
}

fn json_of(served: &Served, path: &str, body: &Value) -> (u16, Value) {
    let answer = served.send(path, "application/json", &body.to_string());
    (answer.status, answer.json())
}

#[test]
fn files_and_names_stay_inside_what_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), &["--json"]);
    let basket = json_of(&served, "/api/baskets", &json!({})).1["basket"].as_u64().unwrap();
    let announce = |name: &str, bytes: u64| json_of(&served, &format!("/api/baskets/{basket}"), &json!({ "name": name, "bytes": bytes }));
    for name in ["../a.csv", "/etc/a.csv", "a\\b.csv", ".a.csv", ""] {
        assert_eq!(announce(name, 10).0, 400, "{name}");
    }
    assert_eq!(announce("a.csv", 1 << 40).0, 400, "larger than is taken");
    let text = loop_text(1.0);
    assert_eq!(announce("a.txt", text.len() as u64), (200, json!({ "file": 0 })));
    let file = format!("/api/files/{basket}/0");
    assert_eq!(served.send(&file, "application/json", &text).status, 415);
    assert_eq!(served.send(&file, "application/octet-stream", &format!("{text} and more")).status, 400, "longer than announced");
    assert_eq!(served.send(&file, "application/octet-stream", &text[1..]).status, 400, "shorter than announced");
    let looked = json!({ "basket": basket });
    assert_eq!(json_of(&served, "/api/look", &looked).0, 400, "nothing has come whole");
    assert_eq!(served.send(&file, "application/octet-stream", &text).status, 200);
    let (status, found) = json_of(&served, "/api/look", &looked);
    assert_eq!((status, found["files"][0]["items"][0]["cycles"].as_u64()), (200, Some(10)), "{found}");
    let wrong = json!({ "basket": basket, "corrections": [{ "file": "a.txt", "item": 0, "columns": { "Kraft": { "role": "colour" } } }] });
    let refused = json_of(&served, "/api/look", &wrong);
    assert_eq!((refused.0, refused.1["error"]["where"].as_str()), (400, Some("a.txt")), "{}", refused.1);
    for other in [format!("/api/files/{basket}/7"), "/api/files/99/0".into(), "/api/files/x/y".into()] {
        assert!(matches!(served.send(&other, "application/octet-stream", "abc").status, 400 | 404), "{other}");
    }
    for name in ["", "..", "../out", "a/b", "a b", ".a", "näme"] {
        assert_eq!(json_of(&served, "/api/new", &json!({ "basket": basket, "name": name })).0, 400, "{name}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was written");
    let corrections = json!([{ "file": "a.txt", "item": 0, "start_up": 2 }]);
    let written = json_of(&served, "/api/new", &json!({ "basket": basket, "corrections": corrections, "name": "one" }));
    assert_eq!((written.0, written.1["study"].as_str()), (200, Some("one")), "{}", written.1);
    assert!(written.1["command"].as_str().unwrap().ends_with(r#" --correct '[{"file":"a.txt","item":0,"start_up":2}]'"#), "{}", written.1);
    assert_eq!(json_of(&served, "/api/new", &json!({ "basket": basket, "name": "one" })).0, 400, "nothing is written over");
    assert_eq!(served.get("/api/studies/one").json()["study"]["tests"].as_array().unwrap().len(), 1);
    // Where one study is served, there is no place beside it.
    let rig = Rig::new();
    let single = Served::start(rig.folder(), &["--json"]);
    let basket = json_of(&single, "/api/baskets", &json!({})).1["basket"].as_u64().unwrap();
    let refused = json_of(&single, "/api/new", &json!({ "basket": basket, "name": "two" }));
    assert_eq!(refused.0, 400);
    assert!(refused.1["error"]["accepted"].as_str().unwrap().contains("misfit serve FOLDER"), "{}", refused.1);
}
