//! One record of a loop in every format that is read is one settled loop.

use std::fmt::Write as _;
use std::path::Path;

use misfit::data::{Dataset, Record, SettledLoop};
use polars::prelude::{Column, DataFrame, ParquetWriter};

/// The record as it stands in the repository; `tests/formats/make.py` wrote it, and `loop.mat` from the same numbers.
const TEXT: &str = include_str!("../formats/loop.csv");

/// Time, displacement and force of every row, as the text has them.
fn rows() -> Vec<[&'static str; 3]> {
    TEXT.lines().skip(1).map(|l| l.split(',').collect::<Vec<_>>().try_into().unwrap()).collect()
}

/// The same as numbers.
fn columns() -> [Vec<f64>; 3] {
    [0, 1, 2].map(|c| rows().iter().map(|r| r[c].parse().unwrap()).collect())
}

/// A file in the folder, and what dataset.toml says of its time and of its other columns.
struct Form {
    file: &'static str,
    bytes: Vec<u8>,
    time: &'static str,
    columns: [&'static str; 2],
    /// Largest difference of a point of the mean cycle, of the largest: what the format has lost of time or value.
    within: f64,
}

fn parquet() -> Vec<u8> {
    let [t, x, f] = columns();
    let all = [("t", t), ("x", x), ("F", f)].map(|(name, values)| Column::new(name.into(), values));
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes).finish(&mut DataFrame::new(rows().len(), all.to_vec()).unwrap()).unwrap();
    bytes
}

/// A structure `run` with a vector per field, version 5.
fn matlab() -> Vec<u8> {
    let tag = |kind: u32, data: &[u8]| {
        let mut out = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        out.extend_from_slice(data);
        out.resize(out.len().next_multiple_of(8), 0);
        out
    };
    let words = |v: &[u32]| v.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let array = |name: &str, class: u32, dims: [u32; 2], rest: &[u8]| {
        tag(14, &[tag(6, &words(&[class, 0])), tag(5, &words(&dims)), tag(1, name.as_bytes()), rest.to_vec()].concat())
    };
    let vector = |v: &Vec<f64>| array("", 6, [v.len() as u32, 1], &tag(9, &v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>()));
    let names: Vec<u8> = ["t", "x", "F"].iter().flat_map(|n| n.bytes().chain(std::iter::repeat(0)).take(8)).collect();
    let fields: Vec<u8> = columns().iter().flat_map(vector).collect();
    let mut out = b"MATLAB 5.0 MAT-file".to_vec();
    out.resize(124, b' ');
    out.extend_from_slice(&[0, 1, b'I', b'M']);
    out.extend(array("run", 2, [1, 1], &[tag(5, &8u32.to_le_bytes()), tag(1, &names), fields].concat()));
    out
}

/// Two functions over time, of displacement in mm and of force in N, in numbers of eight bytes: as text, or the data as 58b.
fn universal(binary: bool) -> Vec<u8> {
    let [t, x, f] = columns();
    let mut bytes = Vec::new();
    for (values, what) in [(&x, (8, "Displacement", "mm")), (&f, (13, "Excitation force", "N"))] {
        let line = |(code, label, unit): (i32, &str, &str)| format!("{code:10}{:5}{:5}{:5} {label:<20} {unit:<20}\n", 0, 0, 0);
        let head = format!(
            "one\ntwo\n01-Jan-20 10:00:00\nfour\nfive\n{:5}{:10}{:5}{:10} {:<10}{:10}{:4} {:<10}{:10}{:4}\n{:10}{:10}{:10}{:>13}{:>13.5e}{:>13}\n{}{}{}{}",
            1,
            0,
            1,
            0,
            "NONE",
            2,
            1,
            "NONE",
            2,
            1,
            4,
            values.len(),
            1,
            "0.00000E+00",
            t[1],
            "0.00000E+00",
            line((17, "Time", "s")),
            line(what),
            line((0, "NONE", "NONE")),
            line((0, "NONE", "NONE"))
        );
        if binary {
            let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            let first = format!("    -1\n    58b{:6}{:6}{:12}{:12}{:6}{:6}{:12}{:12}\n{head}", 1, 2, 11, data.len(), 0, 0, 0, 0);
            bytes.extend([first.as_bytes(), &data, b"\n    -1\n"].concat());
        } else {
            let mut text = format!("    -1\n    58\n{head}");
            for row in values.chunks(4) {
                row.iter().for_each(|v| write!(text, "{v:>20.11e}").unwrap());
                text.push('\n');
            }
            bytes.extend((text + "    -1\n").into_bytes());
        }
    }
    bytes
}

fn forms() -> Vec<Form> {
    let table =
        |head: &str, row: &dyn Fn(&[&str; 3]) -> String| (head.to_string() + &rows().iter().map(row).collect::<String>()).into_bytes();
    let stamp = |t: &str| {
        let (whole, fraction) = t.split_once('.').unwrap();
        format!("2025-11-14 19:15:{:02}.{fraction}", whole.parse::<u32>().unwrap() + 10)
    };
    let plain = |file, bytes| Form { file, bytes, time: "t", columns: ["x", "F"], within: 0.0 };
    vec![
        plain("loop.csv", TEXT.into()),
        plain("comma.txt", table("t;x;F\n", &|r| format!("{}\n", r.join(";").replace('.', ",")))),
        plain("tab.dat", table("t\tx\tF\ns\tmm\tN\n", &|r| format!("{}\n", r.join("\t")))),
        plain("loop.parquet", parquet()),
        Form { file: "v5.mat", bytes: matlab(), time: "run.t", columns: ["run.x", "run.F"], within: 0.0 },
        Form {
            file: "v73.mat",
            bytes: include_bytes!("../formats/loop.mat").to_vec(),
            time: "run.t",
            columns: ["run.x", "run.F"],
            within: 0.0,
        },
        Form { file: "text.uff", bytes: universal(false), time: "time", columns: ["#1", "#2"], within: 0.0 },
        Form { file: "binary.uff", bytes: universal(true), time: "time", columns: ["#1", "#2"], within: 0.0 },
        // Seconds since midnight have four digits less than those since the start.
        Form { within: 1e-11, ..plain("stamps.csv", table("t,x,F\n", &|r| format!("{},{},{}\n", stamp(r[0]), r[1], r[2]))) },
        // The line through stamps that are rounded to 0.1 ms lies within a hundredth of that of where the samples were taken.
        Form {
            within: 1e-4,
            ..plain("rounded.csv", table("t,x,F\n", &|r| format!("{:.4},{},{}\n", r[0].parse::<f64>().unwrap(), r[1], r[2])))
        },
    ]
}

fn settled(folder: &Path, form: &Form) -> SettledLoop {
    std::fs::write(folder.join(form.file), &form.bytes).unwrap();
    let toml = format!(
        "schema = 1\n[[test]]\nid = \"loop\"\nkind = \"cycle\"\nfile = {:?}\ncontrol = \"displacement\"\nconditions = {{ frequency = \"1 Hz\" }}\nchannels = [\n \
         {{ role=\"time\", column={:?}, unit=\"s\" }},\n {{ role=\"displacement\", at=\"c1.x\", column={:?}, unit=\"mm\" }},\n \
         {{ role=\"force\", at=\"c1.x\", column={:?}, unit=\"N\" }}]\n",
        form.file, form.time, form.columns[0], form.columns[1]
    );
    let path = folder.join("dataset.toml");
    std::fs::write(&path, toml).unwrap();
    let dataset = Dataset::load(&path, None).unwrap_or_else(|e| panic!("{}: {e}", form.file));
    let Record::Cycle(record) = &dataset.tests[0].record else { panic!("{}", form.file) };
    record.settled().unwrap_or_else(|e| panic!("{}: {e}", form.file))
}

#[test]
fn one_record_in_every_format_is_one_settled_loop() {
    let folder = tempfile::tempdir().unwrap();
    let all: Vec<(Form, SettledLoop)> = forms().into_iter().map(|f| (settled(folder.path(), &f), f)).map(|(s, f)| (f, s)).collect();
    let first = &all[0].1;
    assert_eq!((first.n, first.cycles), (128, 6), "{:?}", first.notes);
    for (form, other) in &all[1..] {
        assert_eq!((other.n, other.cycles), (first.n, first.cycles), "{}", form.file);
        for (a, b) in first.channels.iter().zip(&other.channels) {
            let largest = a.mean.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let apart = a.mean.iter().zip(&b.mean).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart <= form.within * largest, "{}: {} differs by {:.2e} of {largest}", form.file, a.role.word(), apart / largest);
            assert!(
                (b.sigma_sample / a.sigma_sample - 1.0).abs() <= 1e3 * form.within,
                "{}: {} {}",
                form.file,
                a.sigma_sample,
                b.sigma_sample
            );
        }
        let area = |l: &SettledLoop| l.energy(None).unwrap().dissipated.value;
        assert!((area(other) / area(first) - 1.0).abs() <= 10.0 * form.within, "{}: {} J, {} J", form.file, area(other), area(first));
    }
}
