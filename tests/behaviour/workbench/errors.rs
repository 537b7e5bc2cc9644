//! What readers have stumbled over: laws over what was just added, errors out of sight, and what a page says of work that has ended.

use serde_json::json;

use super::browser::{ANSWER, click, press};
use super::client::{Served, error as error_of};
use super::devtools::Browser;
use crate::rig::{Rig, loop_csv, misfit};

/// A rig whose dry friction grows with the interference `i`: 0.5 N at 0.1 mm, 1.5 N at 0.3 mm, 2.5 N at 0.5 mm.
pub fn friction_that_grows() -> Rig {
    let rig = Rig::new();
    let toml = rig.read("data/dataset.toml");
    let (mut tests, mut parts) = (String::new(), toml.split("[[test]]"));
    tests += parts.next().unwrap();
    for (part, (f, i)) in parts.zip([(1, 0.1), (2, 0.3), (5, 0.5)]) {
        rig.write(&format!("data/loop{f}.csv"), &loop_csv(f64::from(f), |_, v| 5.0 * i * v.signum()));
        tests += &format!("[[test]]{}", part.replace("i = \"0.3 mm\"", &format!("i = \"{i} mm\"")));
    }
    rig.write("data/dataset.toml", &tests);
    rig.change("study.toml", "split = { select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"] }\n", "");
    rig
}

#[test]
fn a_law_is_added_over_what_was_added_before() {
    let rig = friction_that_grows();
    let served = Served::start(rig.folder(), &["--json"]);
    let added = served.run(&json!({ "verb": "add", "model": "study", "effect": "coulomb", "at": "c1.x" }));
    let friction = added["result"]["model"].as_str().unwrap_or_else(|| panic!("{added}")).to_string();
    let scored = served.run(&json!({ "verb": "score", "model": friction }));
    let all = scored["result"]["candidates"].as_array().unwrap_or_else(|| panic!("{scored}"));
    let law = all.iter().find(|c| c["effect"] == "linear_law" && c["of"] == "coulomb.f over i").unwrap_or_else(|| panic!("{scored}"));
    let target = &law["target"];
    let order = json!({ "verb": "add", "model": friction, "effect": "linear_law", "at": law["at"], "set": law["set"], "of": target["of"],
                        "condition": target["condition"], "reference": target["reference"] });
    let done = served.run(&order);
    let with = done["result"]["model"].as_str().unwrap_or_else(|| panic!("{done}"));
    let node = |id: &str| served.state()["models"].as_array().unwrap().iter().find(|m| m["id"] == id).unwrap().clone();
    let error = |id: &str| node(id)["errors"]["fit"]["error"].as_f64().unwrap();
    assert!(error(with) < 0.3 * error(&friction), "{} {}", error(with), error(&friction));
    // Beside another, and in a server that reads the run from its folder.
    let other = json!({ "verb": "add", "model": friction, "effect": "interference_law", "at": law["at"], "of": target["of"],
                        "condition": target["condition"], "reference": target["reference"] });
    let mut both = order;
    both["other"] = other;
    let pair = served.run(&both);
    assert!(pair["result"]["beside"].is_string(), "{pair}");
    let again = Served::start(rig.folder(), &["--json"]);
    again.state();
    let errors = [served, again].map(|s| error_of(&s.compare(with, &json!({})), "loop-1Hz"));
    assert!((errors[0] / errors[1] - 1.0).abs() < 1e-6, "{errors:?}");
}

#[test]
fn the_command_of_an_addition_does_what_the_page_does_and_changes_no_record() {
    let rig = Rig::hiding(|x, v| 1.5 * v.signum() + 8.0 * x.powi(3));
    let served = Served::start(rig.folder(), &["--json"]);
    let own = rig.read("study.toml");
    let mut model = "study".to_string();
    for effect in ["coulomb", "cubic_stiffness"] {
        let begun = served.post("run", &json!({ "verb": "add", "model": model, "effect": effect, "at": "c1.x" })).json();
        let ended = served.wait(&begun["job"]);
        let record = |name: &str, file: &str| rig.read(&if name == "study" { file.into() } else { format!("runs/{name}/{file}") });
        let before = record(&model, "study.toml");
        let words: Vec<&str> = begun["command"].as_str().unwrap().split(' ').skip(1).chain(["--json"]).collect();
        let ran = misfit(&words);
        assert_eq!(ran.code, 0, "{words:?}: {}", ran.stdout);
        assert_eq!(record(&model, "study.toml"), before, "{words:?}");
        model = ended["result"]["model"].as_str().unwrap_or_else(|| panic!("{ended}")).to_string();
        let of_page: serde_json::Value = serde_json::from_str(&record(&model, "result.json")).unwrap();
        let costs = [&of_page, &ran.json()].map(|r| r["after"]["cost"].as_f64().unwrap());
        assert!((costs[0] / costs[1] - 1.0).abs() < 1e-4, "{costs:?}");
        assert!(std::fs::read_to_string(ran.json()["run"].as_str().unwrap().to_string() + "/study.toml").unwrap().contains(effect));
    }
    assert_eq!(rig.read("study.toml"), own);
}

/// Whether an element is seen whole in the window.
fn in_sight(selector: &str) -> String {
    format!("(r => r.height > 0 && r.top >= 0 && r.bottom <= innerHeight)(document.querySelector({selector:?}).getBoundingClientRect())")
}

#[test]
fn an_error_is_seen_where_the_reader_is_each_time() {
    let rig = Rig::new();
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 420) else { return };
    browser.go(&served.url);
    click(&mut browser, "#tab-models");
    browser.until("document.querySelector('input.format')", 10);
    // A format that is none fails before the page knows the number of its job.
    for _ in 0..4 {
        browser.eval("for (const i of document.querySelectorAll('input.format')) { i.checked = true; i.value = 'xlsx'; }");
        browser.eval("document.querySelector('main').scrollTop = 1e6");
        press(&mut browser, "Export");
        browser.until(&format!("{ANSWER}?.includes('there is no format `xlsx`')"), 10);
        assert!(
            browser.eval("document.querySelector('main').scrollTop").as_f64().unwrap() > 60.0,
            "the line that answers would be out of sight"
        );
        assert_eq!(browser.eval(&in_sight("#answer")), true);
        browser.until("document.querySelector('.job h2').textContent.startsWith('export: failed')", 5);
        assert_eq!(browser.eval("document.querySelector('.job .line').textContent.includes('there is no format `xlsx`')"), true);
    }
}

#[test]
fn the_time_of_a_job_is_that_of_its_end() {
    let rig = Rig::new();
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    click(&mut browser, "#do-score");
    browser.until("/^score: done after .* s$/.test(document.querySelector('.job h2')?.textContent)", 60);
    let job = served.state()["jobs"][0].clone();
    let told = browser.eval("parseFloat(document.querySelector('.job h2').textContent.split('after ')[1])").as_f64().unwrap();
    let (took, lines) = (job["ended"]["seconds"].as_f64().unwrap(), job["lines"].as_array().unwrap());
    assert!((told - took).abs() < 0.06, "{told} {took}");
    let last: f64 = lines.last().unwrap().as_str().unwrap().split(" s:").next().unwrap().parse().unwrap();
    assert!(took >= last - 0.05, "the last line was said at {last} s, the end was at {took} s");
}

#[test]
fn nothing_of_another_study_stays_beside_one_that_cannot_be_read() {
    let (good, bad) = (Rig::new(), Rig::new());
    std::fs::remove_file(bad.path("data/loop1.csv")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (name, rig) in [("a-good", &good), ("measured/b-bad", &bad)] {
        std::fs::create_dir_all(folder.path().join(name).join("data")).unwrap();
        for file in ["study.toml", "data/dataset.toml", "data/loop1.csv", "data/loop2.csv", "data/loop5.csv"] {
            // The one that is missing stays missing.
            let _ = std::fs::copy(rig.path(file), folder.path().join(name).join(file));
        }
    }
    let served = Served::start(folder.path(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    browser.until("document.querySelectorAll('.tree .node').length === 1", 20);
    let names = browser.eval("[...document.getElementById('study').options].map(o => o.textContent).join()");
    assert_eq!(names, "a-good,measured/b-bad", "each is named by its way from the folder");
    let choose = |browser: &mut Browser, id: &str| {
        browser.eval(&format!("{{ const s = document.getElementById('study'); s.value = {id:?}; s.dispatchEvent(new Event('change')); }}"))
    };
    choose(&mut browser, "b-bad");
    browser.until(&format!("{ANSWER}?.includes('loop1.csv')"), 20);
    assert_eq!(browser.eval("document.querySelectorAll('.tree .node').length"), 0, "no model of the study before");
    assert_eq!(browser.eval("document.getElementById('model-name').textContent"), "");
    // What the foot shows says the same.
    let line = browser.eval("document.getElementById('command').textContent").as_str().unwrap().to_string();
    let words: Vec<&str> = line.split(' ').skip(1).chain(["--json"]).collect();
    assert!(words[1].ends_with("b-bad"), "{line}");
    assert!(misfit(&words).stdout.contains("loop1.csv"), "{line}");
    choose(&mut browser, "a-good");
    browser.until(
        "document.querySelectorAll('.tree .node').length === 1 && document.querySelectorAll('#view-compare .card').length === 3",
        20,
    );
}

#[test]
fn a_chart_that_was_drawn_behind_another_tab_fits_its_frame() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    browser.until("document.querySelectorAll('#view-compare button.card').length === 2", 20);
    click(&mut browser, "#view-compare button.card");
    let plots = "[...document.querySelectorAll('#large .js-plotly-plot')]";
    browser.until(&format!("{plots}.length === 4"), 30);
    click(&mut browser, "#do-score");
    browser.until("document.querySelector('.candidate')", 60);
    press(&mut browser, "coulomb");
    press(&mut browser, "Add coulomb at c1.x");
    browser.until("document.getElementById('model-name').textContent === '+ coulomb at c1.x'", 60);
    browser.until(&format!("{plots}.length === 4 && {plots}.every(p => p.querySelector('.main-svg'))"), 30);
    assert_eq!(browser.eval("document.getElementById('view-compare').hidden"), true, "they are drawn while nobody sees them");
    click(&mut browser, "#tab-compare");
    browser.until(
        &format!("{plots}.every(p => Math.abs(p.querySelector('.main-svg').getBoundingClientRect().width - p.clientWidth) < 2)"),
        10,
    );
}

fn virtual_tensioner() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/06-virtual-tensioner")
}

#[test]
fn at_1024_pixels_no_column_is_cut_off() {
    let served = Served::start(&virtual_tensioner(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    click(&mut browser, "#tab-parameters");
    browser.until("document.querySelectorAll('#view-parameters tbody tr').length > 10", 20);
    let whole = "(t => t.scrollWidth <= t.clientWidth)(document.querySelector('#view-parameters .scroll'))";
    assert_eq!(browser.eval(whole), true, "the table of parameters");
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let served = Served::start(rig.folder(), &["--json"]);
    browser.go(&served.url);
    click(&mut browser, "#do-score");
    browser.until("document.querySelectorAll('.candidate').length > 5", 60);
    let verdicts = "[...document.querySelectorAll('.candidate')].every(c => (v => /^(worth a refit|too little)$/.test(v.textContent) && v.getBoundingClientRect().width > 0)(c.lastChild) && c.scrollWidth <= c.clientWidth)";
    assert_eq!(browser.eval(verdicts), true, "the verdict of every candidate");
}

#[test]
fn a_mode_leaves_the_ground_where_it_is_and_stays_in_its_frame() {
    let served = Served::start(&virtual_tensioner(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    // Without motion a shape stands at its largest.
    browser.call("Emulation.setEmulatedMedia", json!({ "features": [{ "name": "prefers-reduced-motion", "value": "reduce" }] }));
    browser.go(&served.url);
    click(&mut browser, "#tab-structure");
    click(&mut browser, "#show-modes");
    browser.until("document.querySelector('.structure .rest')", 30);
    let ends = |lines: &str| {
        format!(
            "[...document.querySelectorAll({lines:?})].map(l => {{ const p = l.getPointAtLength(l.getTotalLength()).matrixTransform(l.getScreenCTM()); return [p.x, p.y]; }})"
        )
    };
    for name in ["device", "shelf"] {
        let foot = format!("{}[0]", ends(&format!(".structure .place[aria-label^={name}] path")));
        let stays = format!("(([x, y]) => {}.some(r => Math.hypot(r[0] - x, r[1] - y) < 0.5))({foot})", ends(".structure .rest path"));
        assert_eq!(browser.eval(&stays), true, "the foot of `{name}` stands on the ground");
    }
    let inside = "(f => [...document.querySelectorAll('.structure .part, .structure .spot')].every(p => (r => r.top >= f.top && r.bottom <= f.bottom && r.left >= f.left && r.right <= f.right)(p.getBoundingClientRect())))(document.querySelector('#view-structure .scroll').getBoundingClientRect())";
    assert_eq!(browser.eval(inside), true, "what moves stays in the frame");
}

#[test]
fn where_nothing_is_worth_adding_the_page_says_so_and_colours_nothing() {
    let rig = Rig::new();
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    click(&mut browser, "#do-score");
    browser.until("document.querySelectorAll('.candidate').length > 5", 60);
    browser.until(&format!("{ANSWER}?.startsWith('Nothing is worth a refit: no effect may gain as much as it costs.')"), 5);
    // The fit that the scores are about is told; it is no model of the tree.
    let job = served.state()["jobs"][0]["ended"]["result"]["errors"]["fit"].clone();
    let error = browser.eval(&format!("parseFloat({ANSWER}.split('whose error is ')[1])")).as_f64().unwrap();
    assert!((error / 100.0 / job["error"].as_f64().unwrap() - 1.0).abs() < 0.01, "{error} {job}");
    assert!(job["error"].as_f64().unwrap() < 1.2 * job["floor"].as_f64().unwrap(), "{job}");
    let legend = browser.eval("document.querySelector('#view-structure .legend').textContent").to_string();
    assert!(legend.contains("no place is coloured") && !legend.contains('%'), "{legend}");
    assert_eq!(browser.eval("document.querySelectorAll('#view-structure .ramp').length"), 0);
    let hot = "[...document.querySelectorAll('.structure .place')].filter(p => p.style.getPropertyValue('--heat') !== '0%').length";
    assert_eq!(browser.eval(hot), 0);
}

#[test]
fn a_bar_goes_from_the_floor_to_a_hundred_times_it() {
    // The first test agrees with the model to within the noise, the second does not by far.
    let rig = Rig::new();
    rig.change("study.toml", "15 N/mm", "20 N/mm").change("study.toml", "0.3 N s/mm", "0.1 N s/mm");
    rig.write("data/loop2.csv", &loop_csv(2.0, |_, v| 0.3 * v.signum()));
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    browser.until("document.querySelectorAll('#view-compare button.card').length === 2", 20);
    let bars = "[...document.querySelectorAll('#view-compare button.card .bar')].map(b => parseFloat(getComputedStyle(b, '::after').width) / b.clientWidth)";
    let drawn: Vec<f64> = serde_json::from_value(browser.eval(bars)).unwrap();
    for (part, test) in drawn.iter().zip(served.compare("study", &json!({}))) {
        let ratio = test["error"].as_f64().unwrap() / test["floor"].as_f64().unwrap();
        assert!((part - (ratio.max(1.0).log10() / 2.0)).abs() < 0.02, "{part} of the bar at {ratio} times the floor");
    }
    assert!(drawn[0] < 0.1 && drawn[1] > 0.4, "{drawn:?}");
}
