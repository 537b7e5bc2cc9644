use super::*;
use crate::study::CoefficientOf;

#[test]
fn an_effect_is_appended_and_nothing_else_changes() {
    for text in [ONE.to_string(), ONE.trim_end().to_string(), ONE.replace('\n', "\r\n")] {
        let folder = Folder::one(&text);
        let study = folder.load().unwrap();
        let instance = study.instance("film", "c1.x", &[("f", 1.25), ("v0", 0.4e-3)], None).unwrap();
        let after = study.write_effect(&instance).unwrap();
        let written = folder.text();
        assert!(written.starts_with(&text), "{written}");
        let block = written[text.len()..].replace('\r', "");
        let expected = "[[effect]]\neffect = \"film\"\nat = \"c1.x\"\nf = { start = \"1.25 N\", min = \"0 N\" }\nv0 = { start = \"0.4 mm/s\", min = \"0 mm/s\" }\nd = \"0 mm\"\n";
        assert_eq!(block.trim_start(), expected);
        // One kind of line ending, that of the file.
        let ends = if text.contains("\r\n") { written.matches('\n').count() } else { 0 };
        assert_eq!(written.matches("\r\n").count(), ends);
        assert_eq!(essence(&after), essence(&folder.load().unwrap()));
        assert_eq!(after.system.instances.len(), 3);
    }
}

#[test]
fn a_write_that_fails_leaves_the_file() {
    let folder = Folder::one(ONE);
    let study = folder.load().unwrap();
    let coulomb = study.instance("coulomb", "c1.x", &[("f", 1.0)], None).unwrap();
    // Edited meanwhile, and broken.
    let broken = ONE.replace("[[connector]]", "[[conector]]");
    std::fs::write(folder.file(), &broken).unwrap();
    let e = study.write_effect(&coulomb).unwrap_err();
    assert!(e.to_string().contains("nearest is `connector`"), "{e}");
    assert_eq!(folder.text(), broken);
    // A value that no study may have.
    std::fs::write(folder.file(), ONE).unwrap();
    let negative = study.instance("coulomb", "c1.x", &[("f", -1.0)], None).unwrap();
    assert!(study.write_effect(&negative).is_err());
    let endless = study.instance("coulomb", "c1.x", &[("f", f64::NAN)], None).unwrap();
    assert!(study.write_effect(&endless).is_err());
    assert_eq!(folder.text(), ONE);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "no temporary file is left: {left:?}");
    // A list of effects cannot be appended to.
    let inline = "effect = [{ effect = \"viscous\", at = \"c1.x\", c = \"1 N s/mm\" }, { effect = \"linear_stiffness\", at = \"c1.x\", k = \"1 N/mm\" }]\n";
    let inline = ONE.split("[[effect]]").next().unwrap().replacen("[[body]]", &format!("{inline}[[body]]"), 1);
    std::fs::write(folder.file(), &inline).unwrap();
    let e = folder.load().unwrap().write_effect(&coulomb).unwrap_err();
    assert!(e.accepted().contains("[[effect]] of its own"), "{e}");
    assert_eq!(folder.text(), inline);
    // Another effect was added by hand: what was decided on is no longer what is there.
    let edited = format!("{ONE}[[effect]]\neffect = \"coulomb\"\nat = \"c1.x\"\nf = \"1 N\"\n");
    std::fs::write(folder.file(), &edited).unwrap();
    assert!(study.write_effect(&coulomb).unwrap_err().to_string().contains("no longer those that were read"));
    assert_eq!(folder.text(), edited);
}

#[cfg(unix)]
#[test]
fn permissions_and_links_survive() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::one(ONE);
    let real = folder.path().join("real.toml");
    std::fs::rename(folder.file(), &real).unwrap();
    std::fs::set_permissions(&real, std::fs::Permissions::from_mode(0o664)).unwrap();
    std::os::unix::fs::symlink(&real, folder.file()).unwrap();
    let study = folder.load().unwrap();
    study.write_effect(&study.instance("coulomb", "c1.x", &[("f", 1.0)], None).unwrap()).unwrap();
    assert_eq!(std::fs::metadata(&real).unwrap().permissions().mode() & 0o777, 0o664);
    assert!(std::fs::symlink_metadata(folder.file()).unwrap().is_symlink());
    assert!(std::fs::read_to_string(&real).unwrap().contains("coulomb"));
}

const EVERYTHING: &str = r#"
[[effect]]
effect = "coulomb"
at = "c1.x"
f = { start = "2 N", max = "9 N", prior = { mean = "3 N", sigma = "10 %" } }
vr = { start = "0.01 mm/s", free = true }
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.31 lbf s/in", fixed = true }
[[effect]]
effect = "interference_law"
at = "c1.x"
of = "viscous#2.c"
condition = "i"
reference = "0.3 mm"
a = { start = "0.276 1/mm", min = "0 1/mm" }
[[effect]]
effect = "backlash"
at = ["c1.x"]
g = "10.1 um"
f_close = "0.2 N"
[[effect]]
effect = "delay"
at = "*.force"
tau = "-1.3 ms"
[[order]]
order = ["c1.x.viscous.c", "c1.x.viscous#3.c"]
gap = "0.01 N s/mm"
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.2 N s/mm" }
[[prediction]]
case = "design \"A\""
quantity = "W_s"
W_s_reading = "product"
at = "c1.x"
control = "displacement"
amplitude = "0.4 mm"
mean = "0.1 mm"
conditions = { frequency = "1 Hz", i = "0.4 mm +- 0.02 mm" }
reference = "74 mJ"
[[prediction]]
case = "line"
quantity = "accelerance"
excite = "end.x"
respond = "end.x"
frequency = "120 Hz"
excitation = "0.1 N"
"#;

#[test]
fn a_whole_study_reads_back_as_it_was() {
    let settings = "title = \"t\"\nassumptions = [\"rigid\", \"a \\\"b\\\"\"]\nfit = { loss = \"cauchy\", starts = 3, max_iterations = 7 }\n\
        search = { effects = [\"film\"], places = [\"c1.x\"], max_added = 2 }\n";
    let folder = Folder::one(&(ONE.replacen("[[body]]", &format!("{settings}[[body]]"), 1) + EVERYTHING));
    let study = folder.load().unwrap();
    let out = folder.path().join("runs/a/result");
    let file = study.save(&study.system, &out).unwrap();
    let again = Study::load(&out, None).unwrap();
    let written = std::fs::read_to_string(&file).unwrap();
    assert_eq!(essence(&study), essence(&again), "{written}");
    assert!(written.contains("\ndataset = \"../../../data\"\n"), "{written}");
    // The study with its runs may be moved.
    let elsewhere = tempfile::tempdir().unwrap();
    let moved = elsewhere.path().join("moved");
    std::fs::rename(folder.path(), &moved).unwrap();
    assert_eq!(essence(&study), essence(&Study::load(&moved.join("runs/a/result"), None).unwrap()));
    std::fs::rename(&moved, folder.path()).unwrap();
    let e = study.save(&study.system, folder.path()).unwrap_err();
    assert!(e.to_string().contains("the study's own file"), "{e}");
    let chain = Folder::chain(CHAIN).load().unwrap();
    let text = chain.with_values(&chain.system, &chain.folder);
    assert_eq!(essence(&chain), essence(&read(&text, &chain.dataset).unwrap()), "{text}");
}

#[test]
fn a_ladders_result_has_its_values_and_effects() {
    let folder = Folder::one(ONE);
    let study = folder.load().unwrap();
    let mut system = study.system.clone();
    system.instances.remove(1);
    system.instances[0].params[0].value = 20_123.456_789_012_345;
    system.instances.push(study.instance("elastic_slip", "c1.x", &[("f", 1.0 / 3.0), ("d", 1.7e-5)], None).unwrap());
    // Pushed by a search that knows SI only: no unit for printing.
    system.instances.push(study.instance("coulomb", "c1.x", &[("f", 0.1 + 0.2)], None).unwrap());
    system.instances[2].params[0].unit = (String::new(), 1.0);
    let result = Study::load(&study.save(&system, &folder.path().join("out")).unwrap(), None).unwrap();
    let values = |s: &crate::model::System| s.instances.iter().flat_map(|i| i.params.iter().map(|p| p.value)).collect::<Vec<_>>();
    for (written, read) in values(&system).iter().zip(values(&result.system)) {
        assert!((written - read).abs() <= 1e-15 * written.abs(), "{written} {read}");
    }
    assert_eq!(result.system.instances[2].params[0].unit.0, "N");
    assert_eq!(folder.text(), ONE, "the engineer's own study is not touched");
}

#[test]
fn a_coefficient_is_written_with_its_target() {
    let folder = Folder::one(ONE);
    let study = folder.load().unwrap();
    let of = CoefficientOf { of: Some("viscous.c".into()), condition: "i".into(), reference: 0.3e-3 };
    let law = study.instance("interference_law", "c1.x", &[("a", 276.0)], Some(&of)).unwrap();
    let after = study.write_effect(&law).unwrap();
    assert_eq!(after.system.instances[2].target, law.target);
    let text = folder.text();
    assert!(text.contains("of = \"viscous.c\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = { start = \"0.276 1/mm\" }"), "{text}");
}
