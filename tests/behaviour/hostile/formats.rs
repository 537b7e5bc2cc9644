//! One loop (t, x, F) in every format that is read: what the mutations of data files begin with.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::io::Write as _;

use polars::prelude::{Column, DataFrame, ParquetCompression, ParquetWriter};

/// A file of data, with what dataset.toml says of it.
pub struct DataSeed {
    pub file: String,
    pub bytes: Vec<u8>,
    /// Columns of time, displacement and force; none: only `new` looks at the file.
    pub columns: Option<[&'static str; 3]>,
}

const N: usize = 240;

fn columns() -> [Vec<f64>; 3] {
    let t: Vec<f64> = (0..N).map(|k| k as f64 / 40.0).collect();
    let x = t.iter().map(|t| 0.5e-3 * (TAU * t).sin()).collect();
    let f =
        t.iter().enumerate().map(|(k, t)| 10.0 * (TAU * t).sin() + 0.3 * (TAU * t).cos() + 0.01 * ((k * 7919 % 101) as f64 - 50.0) / 50.0);
    [t.clone(), x, f.collect()]
}

fn text(separator: char, comma: bool, head: &str) -> Vec<u8> {
    let [t, x, f] = columns();
    let mut out = head.to_string();
    for k in 0..N {
        writeln!(out, "{:.4}{separator}{:.7}{separator}{:.5}", t[k], x[k], f[k]).unwrap();
    }
    let (head, rest) = out.split_at(head.len());
    let rest = if comma { rest.replace('.', ",") } else { rest.to_string() };
    format!("{head}{rest}").into_bytes()
}

fn parquet(compression: ParquetCompression) -> Vec<u8> {
    let [t, x, f] = columns();
    let small: Vec<f32> = f.iter().map(|v| *v as f32).collect();
    let columns = vec![Column::new("t".into(), t), Column::new("x".into(), x), Column::new("F".into(), small)];
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes).with_compression(compression).finish(&mut DataFrame::new(N, columns).unwrap()).unwrap();
    bytes
}

fn tag(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut out = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    out.extend_from_slice(data);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

fn matlab(compressed: bool) -> Vec<u8> {
    let words = |v: &[u32]| v.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let array = |name: &str, class: u32, dims: [u32; 2], rest: &[u8]| {
        tag(14, &[tag(6, &words(&[class, 0])), tag(5, &words(&dims)), tag(1, name.as_bytes()), rest.to_vec()].concat())
    };
    let doubles = |v: &[f64]| tag(9, &v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    let mut out = b"MATLAB 5.0 MAT-file".to_vec();
    out.resize(124, b' ');
    out.extend_from_slice(&[0, 1, b'I', b'M']);
    let mut parts: Vec<Vec<u8>> = ["t", "x", "F"].iter().zip(columns()).map(|(n, v)| array(n, 6, [N as u32, 1], &doubles(&v))).collect();
    let inner = array("", 6, [4, 1], &doubles(&[1.0, 2.0, 3.0, 4.0]));
    parts.push(array("run", 2, [1, 1], &[tag(5, &8u32.to_le_bytes()), tag(1, b"force\0\0\0"), inner.clone()].concat()));
    parts.push(array("c", 1, [1, 1], &inner));
    for part in parts {
        if compressed {
            let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            z.write_all(&part).unwrap();
            let z = z.finish().unwrap();
            out.extend([15u32.to_le_bytes(), (z.len() as u32).to_le_bytes()].concat());
            out.extend(z);
        } else {
            out.extend(part);
        }
    }
    out
}

/// Sets 15 (nodes), 55 (a mode), 164 (units), 58 (a history of displacement and force, an FRF), as text; or the functions as 58b.
fn universal(binary: bool) -> Vec<u8> {
    let [_, x, f] = columns();
    let mut out = String::from(
        "    -1\n   164\n         1  SI: Meter (newton)         2\n  1.00000000000000E+00  1.00000000000000E+00  1.00000000000000E+00\n  2.73150000000000E+02\n    -1\n",
    );
    out += "    -1\n    15\n         1         0         0        11  0.00000E+00  0.00000E+00  0.00000E+00\n         2         0         0        11  1.00000E+00  0.00000E+00  0.00000E+00\n    -1\n";
    out += "    -1\n    55\nmode\nNONE\nNONE\nNONE\nNONE\n         1         2         2         8         2         3\n         2         4         1         1\n  1.00000E+01  1.00000E+00  1.00000E-02  0.00000E+00\n         1\n  1.00000E+00  0.00000E+00  0.00000E+00\n    -1\n";
    let mut bytes = out.into_bytes();
    let head = |kind: i32, complex: bool, n: usize, step: f64, axis: (i32, &str, &str), what: (i32, &str, &str)| {
        let form = if complex { 5 } else { 2 };
        let line = |(code, label, unit): (i32, &str, &str)| format!("{code:10}{:5}{:5}{:5} {label:<20} {unit:<20}\n", 0, 0, 0);
        format!(
            "one\ntwo\n01-Jan-20 10:00:00\nfour\nfive\n{kind:5}{:10}{:5}{:10} {:<10}{:10}{:4} {:<10}{:10}{:4}\n{form:10}{n:10}{:10}{:>13}{step:>13.5e}{:>13}\n{}{}{}{}",
            0,
            1,
            0,
            "NONE",
            2,
            1,
            "NONE",
            2,
            1,
            1,
            "0.00000E+00",
            "0.00000E+00",
            line(axis),
            line(what),
            line((13, "Force", "N")),
            line((0, "NONE", "NONE"))
        )
    };
    let mut frf = Vec::new();
    for k in 1..=60 {
        let f = f64::from(k);
        let (re, im) = (100.0 - f * f, 2.0 * f);
        let square = re * re + im * im;
        frf.extend([re / square, -im / square]);
    }
    let time = (17, "Time", "s");
    for (head, values) in [
        (head(1, false, N, 0.025, time, (8, "Displacement", "m")), &x),
        (head(1, false, N, 0.025, time, (13, "Excitation force", "N")), &f),
        (head(4, true, 60, 1.0, (18, "Frequency", "Hz"), (8, "Displacement", "m")), &frf),
    ] {
        if binary {
            let data: Vec<u8> = values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
            bytes.extend(
                format!("    -1\n    58b{:6}{:6}{:12}{:12}{:6}{:6}{:12}{:12}\n{head}", 1, 2, 11, data.len(), 0, 0, 0, 0).into_bytes(),
            );
            bytes.extend(data);
            bytes.extend(b"\n    -1\n");
        } else {
            bytes.extend(format!("    -1\n    58\n{head}").into_bytes());
            for row in values.chunks(6) {
                bytes.extend(row.iter().map(|v| format!("{v:>13.5e}")).collect::<String>().into_bytes());
                bytes.push(b'\n');
            }
            bytes.extend(b"    -1\n");
        }
    }
    bytes
}

/// Every format; and every file of the folder MISFIT_HOSTILE_SEEDS below 200 kB.
pub fn all() -> Vec<DataSeed> {
    let own = |file: &str, bytes: Vec<u8>, columns: [&'static str; 3]| DataSeed { file: file.into(), bytes, columns: Some(columns) };
    let plain = ["t", "x", "F"];
    let mut all = vec![
        own("a.csv", text(',', false, "t,x,F\n"), plain),
        own("b.txt", text(';', true, "Prüfstand 4\n\nt [s];x [m];F [N]\n"), plain),
        own("c.dat", text('\t', false, "t\tx\tF\ns\tm\tN\n"), plain),
        own("d.parquet", parquet(ParquetCompression::Uncompressed), plain),
        own("e.parquet", parquet(ParquetCompression::Snappy), plain),
        own("f.parquet", parquet(ParquetCompression::Zstd(None)), plain),
        own("l.parquet", parquet(ParquetCompression::Gzip(None)), plain),
        own("m.parquet", parquet(ParquetCompression::Brotli(None)), plain),
        own("n.parquet", parquet(ParquetCompression::Lz4Raw), plain),
        own("g.mat", matlab(false), plain),
        own("h.mat", matlab(true), plain),
        own("i.mat", include_bytes!("../../../src/core/data/readers/mat/v73.mat").to_vec(), ["t", "t", "t"]),
        DataSeed { file: "j.uff".into(), bytes: universal(false), columns: None },
        DataSeed { file: "k.unv".into(), bytes: universal(true), columns: None },
    ];
    if let Ok(folder) = std::env::var("MISFIT_HOSTILE_SEEDS") {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let bytes = std::fs::read(&path).unwrap_or_default();
            if (1..200_000).contains(&bytes.len()) {
                all.push(DataSeed { file: path.file_name().unwrap().to_string_lossy().into(), bytes, columns: None });
            }
        }
    }
    all
}

/// A dataset.toml with one cycle test on the file.
pub fn dataset(seed: &DataSeed) -> Option<String> {
    let [t, x, f] = seed.columns?;
    Some(format!(
        "schema = 1\n[[test]]\nid = \"loop\"\nkind = \"cycle\"\nfile = {:?}\ncontrol = \"displacement\"\nconditions = {{ frequency = \"1 Hz\" }}\nchannels = [\n \
         {{ role=\"time\", column=\"{t}\", unit=\"s\" }},\n {{ role=\"displacement\", at=\"c1.x\", column=\"{x}\", unit=\"m\" }},\n \
         {{ role=\"force\", at=\"c1.x\", column=\"{f}\", unit=\"N\", sigma=\"0.05 N\" }}]\n",
        seed.file
    ))
}
