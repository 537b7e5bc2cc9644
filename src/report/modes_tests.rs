//! Modes on the page: of a chain whose frequencies are known, stated in a table and measured as FRFs.

use std::fmt::Write;

use num_complex::Complex64;

use super::{ReportInput, html};
use crate::study::Study;

const MASS: f64 = 0.2;
const STIFFNESS: f64 = 3e5;
const DAMPING: f64 = 12.0;

/// Three equal masses in a row on the ground: frequency [Hz] of mode j, counted from 1 (fixed-free chain).
fn frequency(j: usize) -> f64 {
    let angle = (2.0 * j as f64 - 1.0) * std::f64::consts::PI / 14.0;
    2.0 * (STIFFNESS / MASS).sqrt() * angle.sin() / std::f64::consts::TAU
}

/// Receptances of the three masses over a force on the last, by elimination in place.
fn receptances(f: f64) -> [Complex64; 3] {
    let w = std::f64::consts::TAU * f;
    let k = Complex64::new(STIFFNESS, w * DAMPING);
    let mut a = [[Complex64::default(); 4]; 3];
    for i in 0..3 {
        a[i][i] = k * if i < 2 { 2.0 } else { 1.0 } - w * w * MASS;
        if i > 0 {
            (a[i][i - 1], a[i - 1][i]) = (-k, -k);
        }
    }
    a[2][3] = Complex64::from(1.0);
    for p in 0..3 {
        let pivot = a[p];
        for (_, row) in a.iter_mut().enumerate().filter(|(r, _)| *r != p) {
            let factor = row[p] / pivot[p];
            (0..4).for_each(|c| row[c] -= factor * pivot[c]);
        }
    }
    std::array::from_fn(|i| a[i][3] / a[i][i])
}

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let study = format!(
        "schema = 1\ndataset = \"data\"\n[[body]]\nname = \"m\"\ncount = 3\nmass = \"{MASS} kg\"\nfree = [\"x\"]\n\
         [[connector]]\nname = \"base\"\nfrom = \"ground\"\nto = \"m1\"\n[[connector]]\nname = \"c\"\nchain = \"m\"\n\
         [[effect]]\neffect = \"linear_stiffness\"\nat = [\"base.x\", \"c1-2.x\"]\nk = \"{STIFFNESS} N/m\"\n\
         [[effect]]\neffect = \"viscous\"\nat = [\"base.x\", \"c1-2.x\"]\nc = \"{DAMPING} N s/m\"\n"
    );
    std::fs::write(dir.path().join("study.toml"), study).unwrap();
    let rows: Vec<String> =
        (1..=3).map(|j| format!("{{ mode = {j}, frequency = \"{:.3} Hz\", damping = \"2 %\" }}", 1.01 * frequency(j))).collect();
    let mut toml = format!("schema = 1\n[[test]]\nid = \"table\"\nkind = \"modal\"\nrows = [{}]\n", rows.join(", "));
    for m in 1..=3 {
        let _ = write!(
            toml,
            "[[test]]\nid = \"frf-{m}\"\nkind = \"frf\"\nfile = \"frf-{m}.csv\"\nexcite = \"m3.x\"\nrespond = \"m{m}.x\"\nquantity = \"receptance\"\n\
             noise = \"1 %\"\nchannels = [\n {{ role=\"frequency\", column=\"f\", unit=\"Hz\" }},\n {{ role=\"real\", column=\"re\", unit=\"m/N\" }},\n \
             {{ role=\"imag\", column=\"im\", unit=\"m/N\" }}]\n"
        );
        let mut csv = "f,re,im\n".to_string();
        for line in 10..500 {
            let h = receptances(line as f64)[m - 1];
            // A part in two hundred, in turn up and down.
            let noise = 1.0 + 0.005 * (line as f64 * 12.9898 + m as f64).sin();
            let _ = writeln!(csv, "{line},{:e},{:e}", h.re * noise, h.im * noise);
        }
        std::fs::write(data.join(format!("frf-{m}.csv")), csv).unwrap();
    }
    std::fs::write(data.join("dataset.toml"), toml).unwrap();
    dir
}

#[test]
fn modes_are_identified_held_against_the_model_and_drawn() {
    let dir = folder();
    let study = Study::load(dir.path(), None).unwrap();
    let page = html(&ReportInput { study: &study, system: None, fit: None, diagnosis: None, ladder: None }).unwrap();
    let section = page.split("<section id=\"modes\">").nth(1).and_then(|s| s.split("</section>").next()).expect("the modes have a section");
    for text in
        ["table: stated in a table", "modes identified from frf-1, frf-2, frf-3", "Stabilisation diagram", "Shapes of the model", "MAC"]
    {
        assert!(section.contains(text), "{text}");
    }
    // Each mode once in the table, where it is 1 % off, once with its energy, and once from the FRFs, where it is right and its shape the model's.
    let rows: Vec<Vec<String>> = section
        .split("<tr>")
        .skip(1)
        .map(|r| r.split("<td").skip(1).map(|c| c.split('>').nth(1).unwrap().trim_end_matches("</td").to_string()).collect())
        .filter(|r: &Vec<String>| !r.is_empty())
        .collect();
    assert_eq!(rows.len(), 9, "{rows:?}");
    for row in &rows[3..6] {
        assert!(row[1].starts_with("base.x,c1-2.x 100 %") && row[2].matches('%').count() == 3, "{row:?}");
    }
    for (j, row) in rows[..3].iter().enumerate() {
        let computed: f64 = row[3].parse().unwrap();
        assert!((computed / frequency(j + 1) - 1.0).abs() < 1e-3, "{row:?}");
        assert!(row[4].starts_with("−0.99"), "{row:?}");
    }
    for (j, row) in rows[6..].iter().enumerate() {
        let measured: f64 = row[2].split(' ').next().unwrap().parse().unwrap();
        assert!((measured / frequency(j + 1) - 1.0).abs() < 1e-3, "{row:?} {}", frequency(j + 1));
        let likeness: f64 = row[7].parse().unwrap();
        assert!(likeness > 0.99, "{row:?}");
        assert!(row[1].contains("bending"), "{row:?}");
    }
    assert_eq!(section.matches("undeformed").count(), 3, "one picture a mode");
}
