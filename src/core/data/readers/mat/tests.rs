use super::*;
use proptest::prelude::*;
use std::io::Write;

fn tag(kind: u32, data: &[u8], big: bool) -> Vec<u8> {
    let word = |n: u32| if big { n.to_be_bytes() } else { n.to_le_bytes() };
    let mut out = [word(kind), word(data.len() as u32)].concat();
    out.extend_from_slice(data);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

fn matrix(name: &str, class: u32, dims: [u32; 2], rest: &[u8], big: bool) -> Vec<u8> {
    let words = |v: &[u32]| v.iter().flat_map(|n| if big { n.to_be_bytes() } else { n.to_le_bytes() }).collect::<Vec<u8>>();
    let inner = [tag(6, &words(&[class, 0]), big), tag(5, &words(&dims), big), tag(1, name.as_bytes(), big), rest.to_vec()].concat();
    tag(14, &inner, big)
}

fn doubles(v: &[f64], big: bool) -> Vec<u8> {
    let bytes: Vec<u8> = v.iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect();
    tag(9, &bytes, big)
}

fn file(big: bool, compressed: bool) -> Vec<u8> {
    let mut out = b"MATLAB 5.0 MAT-file".to_vec();
    out.resize(124, b' ');
    out.extend_from_slice(if big { &[1, 0] } else { &[0, 1] });
    out.extend_from_slice(if big { b"MI" } else { b"IM" });
    let t = matrix("t", 6, [4, 1], &doubles(&[0.0, 0.1, 0.2, 0.3], big), big);
    let m = matrix("M", 6, [4, 2], &doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], big), big);
    let shorts: Vec<u8> = [1i16, -2, 3, -4].iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect();
    let force = matrix("", 10, [1, 4], &tag(3, &shorts, big), big);
    let width = tag(5, &if big { 8u32.to_be_bytes() } else { 8u32.to_le_bytes() }, big);
    let run = matrix("run", 2, [1, 1], &[width, tag(1, b"force\0\0\0", big), force].concat(), big);
    let inner = matrix("", 1, [1, 1], &matrix("", 6, [1, 1], &doubles(&[1.0], big), big), big);
    let cell = matrix("c", 1, [1, 1], &inner, big);
    for part in [t, m, run, cell] {
        if compressed {
            let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            z.write_all(&part).unwrap();
            let z = z.finish().unwrap();
            let word = |n: u32| if big { n.to_be_bytes() } else { n.to_le_bytes() };
            out.extend([word(15), word(z.len() as u32)].concat());
            out.extend(z);
        } else {
            out.extend(part);
        }
    }
    out
}

fn get(bytes: &[u8], names: &[&str]) -> Result<Columns, DataError> {
    let wanted: Vec<Wanted> = names.iter().map(|n| Wanted { name: n.to_string(), text: false }).collect();
    read(Path::new("a.mat"), bytes, &wanted)
}

#[test]
fn vectors_matrices_and_structures() {
    for (big, compressed) in [(false, false), (true, false), (false, true)] {
        let c = get(&file(big, compressed), &["t", "run.force", "M(:,2)"]).unwrap();
        let column = |k: usize| match &c.columns[k] {
            Column::Numbers(v) => v.clone(),
            Column::Text(_) => panic!(),
        };
        assert_eq!((column(0), column(1), column(2)), (vec![0.0, 0.1, 0.2, 0.3], vec![1.0, -2.0, 3.0, -4.0], vec![5.0, 6.0, 7.0, 8.0]));
        let names: Vec<String> = list(Path::new("a.mat"), &file(big, compressed)).unwrap().into_iter().map(|l| l.name).collect();
        assert_eq!(names, ["t", "M", "run.force", "c{1}{1}"]);
    }
}

/// Written by h5py 3 in MATLAB's conventions (`v73.py` beside it): the same variables, a complex vector, text and an empty array.
const V73: &[u8] = include_bytes!("v73.mat");

#[test]
fn version_7_3() {
    let c = get(V73, &["t", "run.force", "M(:,2)", "run.deep.x"]).unwrap();
    let column = |k: usize| match &c.columns[k] {
        Column::Numbers(v) => v.clone(),
        Column::Text(_) => panic!(),
    };
    assert_eq!((column(0), column(1), column(2)), (vec![0.0, 0.1, 0.2, 0.3], vec![1.0, -2.0, 3.0, -4.0], vec![5.0, 6.0, 7.0, 8.0]));
    assert_eq!(column(3), [0.5, 1.5, 2.5, 3.5]);
    let mut listed = list(Path::new("a.mat"), V73).unwrap();
    listed.sort_by(|a, b| a.name.cmp(&b.name));
    let listed: Vec<_> = listed.iter().map(|l| (l.name.as_str(), l.class, l.numeric)).collect();
    let numeric = |name| (name, "numeric array", true);
    let expected = [
        numeric("M"),
        ("c{1}", "numeric array", true),
        ("label", "text", false),
        ("none", "numeric array", false),
        numeric("run.deep.x"),
        numeric("run.force"),
        numeric("t"),
        ("z", "complex array", true),
    ];
    assert_eq!(listed, expected);
    let e = |name: &str| get(V73, &[name]).unwrap_err().to_string();
    assert!(e("M").contains("a matrix of 4 x 2"), "{}", e("M"));
    assert!(e("z").contains("complex") && e("c").contains("a cell array") && e("label").contains("is a text"), "{} {}", e("z"), e("label"));
    assert!(e("run.forse").contains("nearest is `run.force`"));
    for n in (0..V73.len()).step_by(7) {
        assert!(get(&V73[..n], &["t", "M(:,2)"]).is_err(), "{n}");
    }
}

#[test]
fn what_is_no_column_is_said() {
    let e = |names: &[&str]| get(&file(false, false), names).unwrap_err().to_string();
    assert!(e(&["c"]).contains("`c` is a cell array"));
    assert!(e(&["M"]).contains("a matrix of 4 x 2"));
    assert!(e(&["M(:,3)"]).contains("column 3 of 2"));
    assert!(e(&["run.forse"]).contains("nearest is `run.force`"));
    assert!(e(&["q"]).contains("no column `q`"));
    let hdf = [b"MATLAB 7.3 MAT-file".as_slice(), &[0; 600]].concat();
    assert!(get(&hdf, &["t"]).unwrap_err().to_string().contains("a damaged MATLAB file of version 7.3"));
    assert!(get(&[0; 300], &["t"]).unwrap_err().to_string().contains("not a MATLAB file"));
    // A variable that inflates without end.
    let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    z.write_all(&vec![0; INFLATED + 100]).unwrap();
    let z = z.finish().unwrap();
    let bomb = [&file(false, false)[..128], &15u32.to_le_bytes(), &(z.len() as u32).to_le_bytes(), &z].concat();
    assert!(get(&bomb, &["t"]).unwrap_err().to_string().contains("inflates beyond"));
}

/// Two complex numbers in a column: as version 5 stores them.
fn complex_file() -> Vec<u8> {
    let parts = [doubles(&[1.0, 3.0], false), doubles(&[2.0, -4.0], false)].concat();
    [&file(false, false)[..128], &matrix("H", 6 | 0x0800, [2, 1], &parts, false)].concat()
}

fn numbers(c: &Columns, k: usize) -> Vec<f64> {
    match &c.columns[k] {
        Column::Numbers(v) => v.clone(),
        Column::Text(_) => panic!(),
    }
}

#[test]
fn complex_numbers_are_read_by_their_parts() {
    for (bytes, name) in [(complex_file(), "H"), (V73.to_vec(), "z")] {
        let [re, im] = ["real", "imag"].map(|part| format!("{part}({name})"));
        let c = get(&bytes, &[&re, &im]).unwrap();
        assert_eq!((numbers(&c, 0), numbers(&c, 1)), (vec![1.0, 3.0], vec![2.0, -4.0]), "{name}");
        let found = names(Path::new("a.mat"), &bytes).unwrap();
        assert!(found.contains(&re) && found.contains(&im) && !found.contains(&name.to_string()), "{found:?}");
        let e = get(&bytes, &[name]).unwrap_err();
        assert!(crate::explain::Explain::accepted(&e).contains(&re), "{e}");
    }
    assert!(get(&file(false, false), &["imag(t)"]).unwrap_err().to_string().contains("real"));
}

/// A file of these variables alone.
fn of(variables: &[Vec<u8>], big: bool) -> Vec<u8> {
    [&file(big, false)[..128], &variables.concat()].concat()
}

/// The elements of an array of structures: names of fields of eight characters, then the fields of one after another.
fn structures(name: &str, dims: [u32; 2], fields: &[&str], values: &[Vec<u8>], big: bool) -> Vec<u8> {
    let width = tag(5, &if big { 8u32.to_be_bytes() } else { 8u32.to_le_bytes() }, big);
    let named: Vec<u8> = fields.iter().flat_map(|f| f.bytes().chain(std::iter::repeat(0)).take(8)).collect();
    matrix(name, 2, dims, &[width, tag(1, &named, big), values.concat()].concat(), big)
}

#[test]
fn a_file_without_vectors_says_what_it_holds() {
    let e = |bytes: &[u8]| names(Path::new("a.mat"), bytes).unwrap_err().to_string();
    let text = matrix("", 4, [1, 2], &tag(16, b"ab", false), false);
    let cell = of(&[matrix("runs", 1, [1, 2], &[text.clone(), text.clone()].concat(), false)], false);
    assert!(e(&cell).contains("`runs{1}`: text of 1 x 2"), "{}", e(&cell));
    let all = of(&[structures("runs", [1, 2], &["note"], &[text.clone(), text], false)], false);
    assert!(e(&all).contains("`runs(2).note`: text of 1 x 2"), "{}", e(&all));
    // Nothing is put aside for what the dimensions promise and the file does not hold.
    let none = of(&[structures("runs", [1 << 15, 1 << 15], &[], &[], false)], false);
    assert!(e(&none).contains("no vector of numbers"), "{}", e(&none));
    let short = of(&[matrix("runs", 1, [1 << 15, 1 << 15], &[], false)], false);
    assert!(e(&short).contains("damaged"), "{}", e(&short));
}

#[test]
fn cells_and_arrays_of_structures_are_read_by_matlabs_names() {
    for big in [false, true] {
        let vector = |v: &[f64]| matrix("", 6, [v.len() as u32, 1], &doubles(v, big), big);
        let (a, b, c) = (vector(&[1.0, 2.0]), vector(&[3.0, 4.0]), vector(&[5.0, 6.0]));
        let square = matrix("", 6, [2, 2], &doubles(&[1.0, 2.0, 7.0, 8.0], big), big);
        let within = matrix("", 1, [1, 1], &c, big);
        let bytes = of(
            &[
                matrix("c", 1, [1, 3], &[a.clone(), b.clone(), within].concat(), big),
                structures("runs", [1, 2], &["time", "force"], &[a.clone(), b.clone(), a.clone(), c.clone()], big),
                structures("one", [1, 1], &["M", "parts"], &[square, matrix("", 1, [1, 1], &b, big)], big),
            ],
            big,
        );
        let expected = [
            "c{1}",
            "c{2}",
            "c{3}{1}",
            "runs(1).time",
            "runs(1).force",
            "runs(2).time",
            "runs(2).force",
            "one.M(:,1)",
            "one.M(:,2)",
            "one.parts{1}",
        ];
        assert_eq!(names(Path::new("a.mat"), &bytes).unwrap(), expected);
        let found = get(&bytes, &["c{2}", "c{3}{1}", "runs(2).force", "one.M(:,2)", "one.parts{1}"]).unwrap();
        let all: Vec<Vec<f64>> = (0..5).map(|k| numbers(&found, k)).collect();
        assert_eq!(all, [[3.0, 4.0], [5.0, 6.0], [5.0, 6.0], [7.0, 8.0], [3.0, 4.0]]);
        let e = |name: &str| get(&bytes, &[name]).unwrap_err().to_string();
        assert!(
            e("c").contains("`c` is a cell array") && e("runs").contains("`runs` is an array of structures"),
            "{} {}",
            e("c"),
            e("runs")
        );
        assert!(e("runs(3).force").contains("no column `runs(3).force`"), "{}", e("runs(3).force"));
        for n in 0..bytes.len() {
            let _ = get(&bytes[..n], &["c{3}{1}", "runs(2).force"]);
        }
    }
}

/// Written by the same script: cells in cells, a structure in a cell, an array of structures, a cell that holds itself, a reference to nothing.
const V73_CELLS: &[u8] = include_bytes!("v73-cells.mat");

#[test]
fn cells_and_arrays_of_structures_of_version_7_3_are_read_by_matlabs_names() {
    let mut named = names(Path::new("a.mat"), V73_CELLS).unwrap();
    named.sort();
    let expected =
        ["c{1}", "c{2}{1}", "c{3}", "one.parts{1}", "one.parts{2}.x", "runs(1).force", "runs(1).time", "runs(2).force", "runs(2).time"];
    assert_eq!(named, expected);
    let found = get(V73_CELLS, &["c{1}", "c{2}{1}", "c{3}", "runs(1).force", "runs(2).force", "one.parts{2}.x"]).unwrap();
    let all: Vec<Vec<f64>> = (0..6).map(|k| numbers(&found, k)).collect();
    assert_eq!(all, [[1.0, 2.0], [5.0, 6.0], [3.0, 4.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]);
    let e = |name: &str| get(V73_CELLS, &[name]).unwrap_err().to_string();
    assert!(e("c").contains("`c` is a cell array") && e("runs").contains("`runs` is an array of structures"), "{} {}", e("c"), e("runs"));
    assert!(e("c{4}").contains("`c{4}` is a text"), "{}", e("c{4}"));
    assert!(e("void{1}").contains("`void{1}` is an object"), "{}", e("void{1}"));
    assert!(e("runs(3).force").contains("no column `runs(3).force`"), "{}", e("runs(3).force"));
    for n in (0..V73_CELLS.len()).step_by(11) {
        assert!(get(&V73_CELLS[..n], &["c{1}", "runs(2).force"]).is_err(), "{n}");
    }
}

fn version_4(big: bool) -> Vec<u8> {
    let word = |n: u32| if big { n.to_be_bytes() } else { n.to_le_bytes() };
    let order = if big { 1000 } else { 0 };
    let variable = |name: &str, form: u32, dims: [u32; 2], complex: u32, numbers: Vec<u8>| {
        let head = [order + form, dims[0], dims[1], complex, name.len() as u32 + 1].map(word).concat();
        [head, name.as_bytes().to_vec(), vec![0], numbers].concat()
    };
    let doubles = |v: &[f64]| v.iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect::<Vec<u8>>();
    let shorts = |v: &[i16]| v.iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect::<Vec<u8>>();
    [
        variable("t", 0, [4, 1], 0, doubles(&[0.0, 0.1, 0.2, 0.3])),
        variable("F", 30, [1, 4], 0, shorts(&[1, -2, 3, -4])),
        variable("note", 51, [1, 2], 0, b"ab".to_vec()),
        variable("H", 0, [2, 1], 1, doubles(&[1.0, 3.0, 2.0, -4.0])),
    ]
    .concat()
}

#[test]
fn version_4_is_read() {
    for big in [false, true] {
        let c = get(&version_4(big), &["t", "F"]).unwrap();
        assert_eq!((numbers(&c, 0), numbers(&c, 1)), (vec![0.0, 0.1, 0.2, 0.3], vec![1.0, -2.0, 3.0, -4.0]));
        assert_eq!(numbers(&get(&version_4(big), &["imag(H)"]).unwrap(), 0), [2.0, -4.0]);
        assert_eq!(names(Path::new("a.mat"), &version_4(big)).unwrap(), ["t", "F", "real(H)", "imag(H)"]);
        for n in 0..version_4(big).len() {
            let _ = get(&version_4(big)[..n], &["t", "imag(H)"]);
        }
    }
}

#[test]
fn every_truncation_is_survived() {
    for compressed in [false, true] {
        let whole = file(false, compressed);
        for n in 0..whole.len() {
            let _ = get(&whole[..n], &["t", "run.force"]);
            let _ = list(Path::new("a.mat"), &whole[..n]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(crate::data::tests::cases(2000)))]
    #[test]
    fn damage_does_not_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8), compressed: bool, big: bool, newer: bool) {
        let mut bytes = match (newer, big) {
            (true, true) => V73_CELLS.to_vec(),
            (true, false) => V73.to_vec(),
            _ => file(big, compressed),
        };
        for (at, byte) in &flips {
            let i = at.index(bytes.len());
            bytes[i] = *byte;
        }
        let _ = get(&bytes, &["t", "run.force", "M(:,2)"]);
        let _ = get(&bytes, &["c{2}{1}", "runs(2).force"]);
        let _ = list(Path::new("a.mat"), &bytes);
    }
}
