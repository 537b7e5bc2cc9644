use super::*;
use crate::explain::Explain;
use crate::units::Dimension;
use proptest::prelude::*;
use std::path::Path;

fn file(text: &str) -> TomlFile {
    TomlFile::parse(Path::new("study.toml"), text.to_string(), "study").unwrap()
}

#[test]
fn unknown_key_names_the_nearest_and_its_place() {
    let f = file("schema = 1\n\n[[part]]\nname = \"a\"\n\n  conections = 3\n");
    let part = &f.root().tables("part").unwrap()[0];
    let e = part.only(&["name", "connectors"]).unwrap_err();
    assert_eq!(e.to_string(), "unknown key `conections`, nearest is `connectors`");
    assert_eq!(e.place(), "study.toml, line 6, key part[0].conections");
    assert_eq!(e.accepted(), "the keys name, connectors");
    assert_eq!(e.stage(), "study");
}

#[test]
fn syntax_errors_and_doubled_keys_have_a_line() {
    for (text, line) in [("a = 1\nb = = 2\n", 2), ("a = 1\nb = 2\na = 3\n", 3), ("a = 1\n\n\nb = \"x\n", 4), ("[a]\n[a]\n", 2)] {
        let e = TomlFile::parse(Path::new("x.toml"), text.to_string(), "data").unwrap_err();
        assert_eq!(e.line, line, "{text:?}: {e}");
        assert!(matches!(*e.problem, TomlProblem::Syntax(_)));
    }
    let e = TomlFile::parse(Path::new("x.toml"), "a = 1\nb = 99999999999999999999\n".to_string(), "data").unwrap_err();
    assert_eq!((e.line, e.to_string().contains("64 bits")), (2, true));
}

#[test]
fn wrong_types_say_what_was_found() {
    let f = file("a = 1\nb = [1]\nc = \"x\"\n");
    let r = f.root();
    let e = r.string("a").unwrap_err();
    assert_eq!(e.to_string(), "found the integer 1, where a string is expected");
    assert_eq!(r.get("c").unwrap().integer(0, 3).unwrap_err().line, 3);
    assert_eq!(r.get("a").unwrap().integer(2, 3).unwrap_err().to_string(), "1 is out of range");
    assert_eq!(r.string("d").unwrap_err().to_string(), "required key `d` is missing");
    assert_eq!(r.get("b").unwrap().list().unwrap()[0].table().unwrap_err().key, "b[0]");
    let e = r.quantity("a", Dimension::FORCE).unwrap_err();
    assert!(e.to_string().contains("has no unit") && e.accepted().contains("lbf"), "{e}");
}

#[test]
fn parameters() {
    let f = file(
        "a = \"20 N/mm\"\nb = { start = \"20 N/mm\", min = \"0 N/mm\", max = \"1 kN/mm\", prior = { mean = \"18 N/mm\", sigma = \"10 %\" }, fixed = true }\n\
         c = { start = \"20 N/mm\", min = \"30 N/mm\" }\nd = { start = \"20 N/mm\", min = \"3 N/mm\", max = \"1 N/mm\" }\n\
         e = { start = \"20 mm\" }\nf = { start = \"1 N/mm\", prior = { mean = \"18 N/mm\", sigma = \"0 N/mm\" } }\ng = { strat = \"1 N/mm\" }\n",
    );
    let p = |key: &str| f.root().get(key).unwrap().parameter(Dimension::STIFFNESS, &[]);
    assert_eq!(p("a").unwrap().start.value, 2e4);
    let b = p("b").unwrap();
    assert_eq!((b.min, b.max, b.fixed), (Some(0.0), Some(1e6), true));
    assert_eq!(b.prior, Some(PriorSpec { mean: 18e3, sigma: 1.8e3 }));
    assert_eq!(p("c").unwrap_err().to_string(), "start 20 N/mm is below min 30 N/mm");
    assert_eq!(p("d").unwrap_err().to_string(), "min 3 N/mm is not below max 1 N/mm");
    assert_eq!((p("e").unwrap_err().line, p("e").unwrap_err().key), (5, "e.start".to_string()));
    assert_eq!(p("f").unwrap_err().key, "f.prior.sigma");
    assert!(p("g").unwrap_err().to_string().contains("nearest is `start`"));
}

proptest! {
    #[test]
    fn no_text_panics(text in "(\\PC|\\n){0,80}", toml in "([a-c]|=|\\[|\\]|\\{|\\}|\"|,|\\.|1|\\n| ){0,60}") {
        for t in [text, toml] {
            if let Ok(f) = TomlFile::parse(Path::new("x"), t, "data") {
                for (_, v) in f.root().entries() {
                    let _ = v.parameter(Dimension::FORCE, &[]);
                    let _ = v.spread(None);
                    let _ = v.string();
                }
            }
        }
    }
}
