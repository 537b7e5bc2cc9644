//! The rules of the house: imports go one way, files stay short.

use std::path::{Path, PathBuf};

fn sources() -> Vec<PathBuf> {
    fn walk(folder: &Path, all: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, all);
            } else if path.extension().is_some_and(|e| e == "rs") {
                all.push(path);
            }
        }
    }
    let mut all = Vec::new();
    walk(&src(), &mut all);
    assert!(all.len() > 50, "the sources are not where they were");
    all
}

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Modules in the order of the flow, as src/core/lib.rs and src/lib.rs list them.
fn order() -> Vec<String> {
    let text = ["core/lib.rs", "lib.rs"].map(|file| std::fs::read_to_string(src().join(file)).unwrap()).join("\n");
    text.lines().filter_map(|l| l.trim().strip_prefix("pub mod ")?.strip_suffix(';')).map(str::to_string).collect()
}

/// Modules that a line of code names as `crate::module` or `crate::{module, ...}`, where `within` is `crate::`.
fn named(text: &str, within: &str) -> Vec<String> {
    let code: String = text.lines().filter(|l| !l.trim_start().starts_with("//")).map(|l| format!("{l}\n")).collect();
    let word = |s: &str| s.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut all = Vec::new();
    for rest in code.split(within).skip(1) {
        match rest.strip_prefix('{') {
            Some(list) => {
                let mut depth = 0;
                let mut start = true;
                for (k, c) in list.char_indices() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => start = true,
                        c if start && !c.is_whitespace() => {
                            all.push(word(&list[k..]));
                            start = false;
                        }
                        _ => {}
                    }
                }
            }
            None => all.push(word(rest)),
        }
    }
    all
}

fn upward(order: &[String], own: &str, text: &str, within: &str) -> Vec<String> {
    let rank = |m: &str| order.iter().position(|o| o == m);
    let own = rank(own);
    named(text, within).into_iter().filter(|m| matches!((own, rank(m)), (Some(a), Some(b)) if b > a)).collect()
}

#[test]
fn imports_go_one_way() {
    let order = order();
    assert!(order.first().is_some_and(|m| m == "explain") && order.last().is_some_and(|m| m == "cli"), "{order:?}");
    let mut wrong = Vec::new();
    for file in sources() {
        let inside = file.strip_prefix(src()).unwrap();
        let own =
            inside.strip_prefix("core").unwrap_or(inside).iter().next().unwrap().to_string_lossy().trim_end_matches(".rs").to_string();
        for module in upward(&order, &own, &std::fs::read_to_string(&file).unwrap(), "crate::") {
            wrong.push(format!("{} imports {module}", inside.display()));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The rooms of `diagnose`, as its mod.rs lists them.
#[test]
fn rooms_of_the_search_import_one_way() {
    let text = std::fs::read_to_string(src().join("core/diagnose/mod.rs")).unwrap();
    let modules = text.lines().filter_map(|l| l.trim_start_matches("pub ").strip_prefix("mod ")?.strip_suffix(';'));
    let order: Vec<String> = modules.map(str::to_string).collect();
    assert_eq!(order, ["error", "trace", "settings", "results", "calibrate", "search"]);
    let mut wrong = Vec::new();
    for file in sources() {
        let Ok(inside) = file.strip_prefix(src().join("core/diagnose")) else { continue };
        let room = inside.iter().next().unwrap().to_string_lossy().trim_end_matches(".rs").to_string();
        let text = std::fs::read_to_string(&file).unwrap();
        for other in upward(&order, &room, &text, "crate::diagnose::") {
            wrong.push(format!("{} imports {other}", inside.display()));
        }
        // What mod.rs exports comes from any room: those below the search name the room.
        let exported = named(&text, "crate::diagnose::").into_iter().filter(|n| n.starts_with(char::is_uppercase) && n != "DiagnoseError");
        wrong.extend(exported.filter(|_| order.contains(&room) && room != "search").map(|n| format!("{} names {n}", inside.display())));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The test above can fail.
#[test]
fn an_upward_import_is_seen() {
    let order: Vec<String> = ["units", "data", "model"].map(String::from).to_vec();
    assert_eq!(upward(&order, "data", "use crate::model::Model;", "crate::"), ["model"]);
    assert_eq!(upward(&order, "data", "use crate::{units::{Unit, data}, model};", "crate::"), ["model"]);
    assert!(upward(&order, "data", "use crate::units::Unit;\n// crate::model\nuse crate::data::x;", "crate::").is_empty());
    assert_eq!(
        upward(&order, "data", "use crate::diagnose::{units::u, model::Model};\nuse crate::model::x;", "crate::diagnose::"),
        ["model"]
    );
}

#[test]
fn no_file_is_longer_than_500_lines() {
    let lines = |f: &PathBuf| std::fs::read_to_string(f).unwrap().lines().count();
    let long: Vec<String> =
        sources().iter().map(|f| (f, lines(f))).filter(|f| f.1 > 500).map(|(f, n)| format!("{}: {n}", f.display())).collect();
    assert!(long.is_empty(), "{long:#?}");
}
