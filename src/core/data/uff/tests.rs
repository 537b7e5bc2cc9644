use super::*;
use crate::data::{DataError, FrfQuantity};
use crate::explain::Explain;
use crate::units::Dimension;
use proptest::prelude::*;
use std::path::Path;

fn open(bytes: &[u8]) -> Result<UffFile, DataError> {
    UffFile::from_bytes(Path::new("a.uff"), bytes.to_vec())
}

fn function(bytes: &[u8]) -> Result<Function, DataError> {
    let file = open(bytes)?;
    match file.read(0)? {
        SetContent::Function(f) => Ok(*f),
        other => panic!("{other:?}"),
    }
}

fn head(ordinate: i64, points: usize, even: bool) -> String {
    let five = "one\ntwo\n01-Jan-20 10:00:00\nfour\nfive\n";
    let dofs = format!("{:5}{:10}{:5}{:10} {:<10}{:10}{:4} {:<10}{:10}{:4}\n", 4, 0, 1, 0, "NONE", 12, -3, "NONE", 7, 3);
    let form = format!("{ordinate:10}{points:10}{:10}{:>13}{:>13}{:>13}\n", i64::from(even), "1.00000E+00", "5.00000E-01", "0.00000E+00");
    let axis = |kind: i64, label: &str, unit: &str| format!("{kind:10}{:5}{:5}{:5} {label:<20} {unit:<20}\n", 0, 0, 0);
    format!(
        "{five}{dofs}{form}{}{}{}{}",
        axis(18, "Frequency", "Hz"),
        axis(12, "Acceleration", "m/s^2"),
        axis(13, "Force", "N"),
        axis(0, "NONE", "NONE")
    )
}

fn ascii(ordinate: i64, points: usize, even: bool, data: &str) -> Vec<u8> {
    format!("    -1\n    58\n{}{data}    -1\n", head(ordinate, points, even)).into_bytes()
}

fn binary(ordinate: i64, points: usize, even: bool, big: bool, bytes: usize, data: &[u8]) -> Vec<u8> {
    let order = if big { 2 } else { 1 };
    let first = format!("    -1\r\n    58b{order:6}{:6}{:12}{bytes:12}{:6}{:6}{:12}{:12}\r\n", 2, 11, 0, 0, 0, 0);
    let text = head(ordinate, points, even).replace('\n', "\r\n");
    [first.as_bytes(), text.as_bytes(), data, b"    -1\r\n"].concat()
}

#[test]
fn every_form_of_ascii_data() {
    let f = function(&ascii(2, 7, true, "  1.00000E+00 -2.00000E+00  3.00000E+00  4.00000E+00  5.00000E+00  6.00000E+00\n  7.00000E+00\n"))
        .unwrap();
    assert_eq!(f.values, Values::Real((1..8).map(|i| if i == 2 { -2.0 } else { f64::from(i) }).collect()));
    assert_eq!(f.abscissa[6], 4.0);
    assert!(f.findings.is_empty(), "{:?}", f.findings);
    assert_eq!(f.header.label(), "12:-Z/7:+Z");
    let f = function(&ascii(4, 2, false, "  1.00000E+00  2.00000000000D+00  3.00000E+00  4.00000000000D+00\n")).unwrap();
    assert_eq!((f.abscissa, f.values), (vec![1.0, 3.0], Values::Real(vec![2.0, 4.0])));
    let f = function(
        &ascii(5, 2, true, "  1.00000E+00  2.00000E+00  3.00000E+00-4.00000E+00\n")
            .iter()
            .map(|b| if *b == b'\n' { b'\n' } else { *b })
            .collect::<Vec<_>>(),
    )
    .unwrap();
    let Values::Complex(h) = &f.values else { panic!() };
    assert_eq!((h[1].re, h[1].im), (3.0, -4.0));
    let f = function(&ascii(6, 1, false, "  1.00000E+00  2.00000000000E+00 -3.00000000000E+00\n")).unwrap();
    let Values::Complex(h) = &f.values else { panic!() };
    assert_eq!((f.abscissa[0], h[0].re, h[0].im), (1.0, 2.0, -3.0));
}

#[test]
fn every_form_of_binary_data() {
    for big in [false, true] {
        let singles = |v: &[f32]| v.iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect::<Vec<u8>>();
        let doubles = |v: &[f64]| v.iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect::<Vec<u8>>();
        let f = function(&binary(2, 3, true, big, 12, &singles(&[1.5, -2.5, 0.1]))).unwrap();
        assert_eq!(f.values, Values::Real(vec![1.5, -2.5, f64::from(0.1f32)]));
        let f = function(&binary(6, 2, true, big, 32, &doubles(&[1.0, 2.0, 3.0, 4.0]))).unwrap();
        assert_eq!(f.values.len(), 2);
        let f = function(&binary(4, 2, false, big, 32, &doubles(&[1.0, 2.0, 3.0, 4.0]))).unwrap();
        assert_eq!((f.abscissa, f.values), (vec![1.0, 3.0], Values::Real(vec![2.0, 4.0])));
        // A double ordinate over a single-precision abscissa.
        let mixed = [singles(&[1.0]), doubles(&[2.0]), singles(&[3.0]), doubles(&[4.0])].concat();
        let f = function(&binary(4, 2, false, big, 24, &mixed)).unwrap();
        assert_eq!((f.abscissa, f.values), (vec![1.0, 3.0], Values::Real(vec![2.0, 4.0])));
        let f = function(&binary(5, 1, false, big, 12, &singles(&[1.0, 2.0, 3.0]))).unwrap();
        assert_eq!((f.abscissa.len(), f.findings.len()), (1, 0));
    }
}

#[test]
fn bytes_that_look_like_a_marker_are_data() {
    let mut data = b"\n    -1\n".to_vec();
    data.extend_from_slice(&1.0f64.to_le_bytes());
    let f = function(&binary(4, 2, true, false, 16, &data)).unwrap();
    let Values::Real(v) = &f.values else { panic!() };
    assert_eq!((v.len(), v[1]), (2, 1.0));
}

#[test]
fn a_header_is_read_as_it_stands() {
    let text = "    -1\n   151\nmodel\n\n    -1\n    -1\n    58\n".to_string()
        + &head(5, 1, true).replace("m/s^2", "(m/s\u{b2})/N")
        + " 1.0 2.0\n    -1\n";
    for bytes in [text.clone().into_bytes(), text.chars().map(|c| c as u8).collect()] {
        let file = open(&bytes).unwrap();
        assert_eq!(file.sets.iter().map(|s| s.number).collect::<Vec<_>>(), [151, 58]);
        let h = file.function_header(1).unwrap();
        assert_eq!(h.ordinate.unit, "(m/s²)/N");
        let (x, y, q) = describe(&h, None);
        assert_eq!(q, Some(FrfQuantity::Accelerance));
        assert_eq!((x.unit.unwrap().dimension, y.unit.unwrap().dimension), (Dimension::FREQUENCY, Dimension::ACCELERANCE));
    }
    // A name that holds the marker, and one of sixteen columns without care for them.
    let text = String::from_utf8(ascii(2, 1, true, " 1.0\n")).unwrap();
    let f = function(text.replace("two", "two    -1").as_bytes()).unwrap();
    assert_eq!(f.header.id[1], "two    -1");
    let free = text
        .replace("   1.00000E+00  5.00000E-01  0.00000E+00\n", " 1.000000000000E+00 5.000000000000E-01 0.0E+00\n")
        .replace("         2         1         1  1.0", "2 1 1  1.0");
    let f = function(free.as_bytes()).unwrap();
    assert_eq!((f.header.ordinate_type, f.header.abscissa_first, f.header.abscissa_step), (2, 1.0, 0.5));
}

#[test]
fn units_of_an_frf() {
    let system = |length: f64, force: f64| UnitSystem {
        code: 9,
        description: String::new(),
        temperature_mode: 0,
        length,
        force,
        temperature: 1.0,
        temperature_offset: 0.0,
    };
    let h = open(&ascii(5, 1, true, " 1.0 2.0\n")).unwrap().function_header(0).unwrap();
    let (_, y, q) = describe(&h, None);
    assert_eq!((q, y.unit.unwrap().factor), (Some(FrfQuantity::Accelerance), 1.0));
    // Labels left out: set 164 says it.
    let bare = String::from_utf8(ascii(5, 1, true, " 1.0 2.0\n"))
        .unwrap()
        .replace("m/s^2", "NONE ")
        .replace("Force                N", "Force                 ");
    let h = open(bare.as_bytes()).unwrap().function_header(0).unwrap();
    assert!(describe(&h, None).1.unit.is_none());
    let (_, y, _) = describe(&h, Some(&system(1e3, 1.0)));
    assert_eq!(y.unit.unwrap().factor, 1e-3);
    let (_, y, _) = describe(&h, Some(&system(1.0 / 0.0254, 1.0 / 4.4482216152605)));
    assert!((y.unit.unwrap().factor / (0.0254 / 4.4482216152605) - 1.0).abs() < 1e-12);
    assert!(describe(&h, Some(&system(7.0, 1.0))).1.unit.is_none());
    // A contradiction is found, not settled.
    let h = open(&ascii(5, 1, true, " 1.0 2.0\n")).unwrap().function_header(0).unwrap();
    let (_, y, _) = describe(&h, Some(&system(1e3, 1.0)));
    assert!(y.unit.is_none() && y.finding.unwrap().text.contains("set 164 implies"));
    // Rotation over moment, and a label that is no unit.
    let turned = String::from_utf8(ascii(5, 1, true, " 1.0 2.0\n"))
        .unwrap()
        .replace("12  -3", "12   5")
        .replace("7   3", "7   6")
        .replace("m/s^2", "rad/s2")
        .replace(" N  ", " N m");
    let h = open(turned.as_bytes()).unwrap().function_header(0).unwrap();
    let (_, y, _) = describe(&h, None);
    assert_eq!((h.label().as_str(), y.unit.map(|u| u.factor)), ("12:+RY/7:+RZ", Some(1.0)), "{:?}", y.finding);
    let odd = String::from_utf8(ascii(5, 1, true, " 1.0 2.0\n")).unwrap().replace("m/s^2", "EU   ");
    assert!(describe(&open(odd.as_bytes()).unwrap().function_header(0).unwrap(), None).1.finding.is_some());
}

#[test]
fn geometry_units_and_shapes() {
    let lines = [
        "    -1",
        "   164",
        "         9USER_DEFINED",
        "  1.00000000000000000D+03  1.00000000000000000D+00  1.00000000000000000D+00",
        " -2.73149999999999960D+02",
        "    -1",
        "    -1",
        "    15",
        "         1         0         0         8-1.00000E+000-2.0000E+000  3.00000E+00",
        "    -1",
        "    -1",
        "  2411",
        "         1         0         0        11",
        "   1.0000000000000000D+00   2.0000000000000000D+00  -3.5000000000000000D+00",
        "    -1",
        "    -1",
        "    82",
        "         3        11         8",
        "line",
        "         1         2         0         4         5         6         7         8",
        "         9        10        11         0",
        "    -1",
        "    -1",
        "  2412",
        "         1        21         1         1         7         2",
        "         0         1         1",
        "        10        11",
        "         2        91         1         1         7         3",
        "         1         2         3",
        "    -1",
    ];
    let text = lines.join("\r\n");
    let file = open(text.as_bytes()).unwrap_or_else(|e| panic!("{e} at {}", e.place()));
    assert_eq!(file.sets.iter().map(|s| s.number).collect::<Vec<_>>(), [164, 15, 2411, 82, 2412]);
    let SetContent::Units(u) = file.read(0).unwrap() else { panic!() };
    assert_eq!((u.code, u.length, u.temperature_offset), (9, 1e3, -273.15));
    let SetContent::Nodes(n) = file.read(1).unwrap() else { panic!() };
    assert_eq!((n[0].colour, n[0].position), (8, [-1.0, -2.0, 3.0]));
    let SetContent::Nodes(n) = file.read(2).unwrap() else { panic!() };
    assert_eq!((n[0].number, n[0].position), (1, [1.0, 2.0, -3.5]));
    let SetContent::Trace(t) = file.read(3).unwrap() else { panic!() };
    assert_eq!((t.declared, t.nodes.len(), t.name.as_str()), (11, 12, "line"));
    let SetContent::Elements(e) = file.read(4).unwrap() else { panic!() };
    assert_eq!((e[0].beam, e[0].nodes.as_slice(), e[1].nodes.as_slice()), (Some([0, 1, 1]), &[10, 11][..], &[1, 2, 3][..]));
}

#[test]
fn nodal_and_analysis_data() {
    let id = "a\nb\nc\nd\ne\n";
    let text = format!(
        "    -1\n    55\n{id}{:10}{:10}{:10}{:10}{:10}{:10}\n{:10}{:10}{:10}{:10}\n{:>13}{:>13}{:>13}{:>13}\n{:10}\n{:>13}{:>13}{:>13}\n    -1\n",
        1,
        2,
        2,
        8,
        2,
        3,
        2,
        4,
        1,
        5,
        "1.25000E+02",
        "1.00000E+00",
        "2.00000E-02",
        "0.00000E+00",
        17,
        "1.00000E+00",
        "-2.00000E+00",
        "0.00000E+00"
    );
    let file = open(text.as_bytes()).unwrap();
    let SetContent::NodalData(d) = file.read(0).unwrap() else { panic!() };
    assert_eq!((d.mode(), d.integers.as_slice(), d.nodes.as_slice()), (Some((125.0, 0.02)), &[1, 5][..], &[17][..]));
    assert_eq!(d.values[0][1].re, -2.0);
    let zero = "  0.00000E+00  1.00000E+01  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00\n";
    let text = format!(
        "    -1\n  2414\n{:10}\nname\n{:10}\n{id}{:10}{:10}{:10}{:10}{:10}{:10}\n{:10}{:10}{:10}{:10}{:10}{:10}{:10}{:10}\n{:10}{:10}\n{zero}{zero}{:10}\n  1.0  2.0  3.0  4.0  5.0  6.0\n    -1\n",
        1, 1, 1, 5, 2, 8, 5, 3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 4
    );
    let file = open(text.as_bytes()).unwrap();
    let SetContent::Analysis(a) = file.read(0).unwrap() else { panic!() };
    let AnalysisValues::At(nodes, values) = &a.values else { panic!() };
    assert_eq!((nodes.as_slice(), values[0][2].im, a.reals[1], a.integers[7]), (&[4][..], 6.0, 10.0, 1));
}

#[test]
fn files_that_lie_are_refused() {
    let case = |bytes: &[u8], message: &str, place: &str| {
        let e = function(bytes).err().unwrap_or_else(|| panic!("no error, {message} expected"));
        assert!(e.to_string().contains(message), "{e}, {message} expected");
        assert!(e.place().contains(place), "{}: {place} expected", e.place());
        assert!(!e.accepted().is_empty());
    };
    let data: Vec<u8> = [1.0f64, 2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let whole = binary(4, 2, true, false, 16, &data);
    assert!(function(&whole).unwrap().findings.is_empty());
    case(&whole[..whole.len() - 20], "the file ends before the set does", "set 58b");
    case(&binary(4, 3, true, false, 24, &data), "3 points of 8 bytes need 24 bytes", "set 58b");
    case(&binary(4, 1, true, false, 8, &data), "a closing line stands after 16", "set 58b");
    case(&binary(4, 2_000_000_000, true, false, 16, &data), "2000000000 points", "set 58b");
    // Points and closing line agree, the count of bytes does not: said, and read.
    let f = function(&binary(4, 2, true, false, 8, &data)).unwrap();
    assert!(f.findings[0].text.contains("names 8 bytes"), "{:?}", f.findings);
    let text_mode: Vec<u8> = [f64::from_le_bytes(*b"\n1234567"), 2.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .flat_map(|b| if b == b'\n' { vec![b'\r', b'\n'] } else { vec![b] })
        .collect();
    case(&binary(4, 2, true, false, 16, &text_mode), "copied as text", "set 58b");
    let good = ascii(2, 2, true, " 1.0 2.0\n");
    case(&good[..good.len() - 7], "no closing line", "set 58");
    case(b"", "no set", "line 1");
    case(b"hello\n", "text that belongs to no set", "line 1");
    case(b"    -1\nabc\n    -1\n", "where the number of a set is expected", "line 2");
    case(&ascii(3, 2, true, " 1.0 2.0\n"), "ordinate data type 3", "line 9");
    case(&ascii(2, 2, true, " 1.0 2,0\n"), "`2,0` is not a number", "line 14");
    // Too few values, or NaN, are findings: the rest of the file stays readable.
    assert!(function(&ascii(2, 9, true, " 1.0 2.0\n")).unwrap().findings[0].text.contains("9 points are declared"));
    assert!(function(&ascii(2, 2, true, " 1.0 NaN\n")).unwrap().findings[0].text.contains("at point 2"));
}

fn sample() -> Vec<u8> {
    let data: Vec<u8> = (0..20).flat_map(|x| f64::from(x).to_le_bytes()).collect();
    let units = b"    -1\n   164\n         9USER_DEFINED\n  1.00000000000000000D+03  1.00000000000000000D+00  1.0D+00\n    -1\n";
    let rest = b"    -1\n  2412\n         1        21         1         1         7         2\n         0         1         1\n        10        11\n    -1\n    -1\n    15\n         1         0         0         8 1.0 2.0 3.0\n    -1\n";
    [units.to_vec(), ascii(5, 2, true, " 1.0 2.0 3.0 -4.0\n"), binary(4, 20, true, false, 160, &data), rest.to_vec()].concat()
}

fn read_all(bytes: &[u8]) {
    if let Ok(file) = open(bytes) {
        for i in 0..file.sets.len() {
            let _ = file.read(i);
            let _ = file.function_header(i).map(|h| describe(&h, file.unit_system(i).ok().flatten().as_ref()));
        }
    }
}

#[test]
fn every_truncation_is_survived_and_seen() {
    let whole = sample();
    assert_eq!(open(&whole).unwrap().sets.len(), 5);
    for n in 0..whole.len() {
        read_all(&whole[..n]);
        // Cut between two sets a file is whole; anywhere else it is not.
        let between = (1..5).any(|k| open(&whole).is_ok_and(|f| f.sets[k].offset.abs_diff(n + 7) <= 2));
        assert!(between || n + 2 >= whole.len() || open(&whole[..n]).is_err() || open(&whole[..n]).is_ok_and(|f| f.sets.len() < 5), "{n}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(crate::data::tests::cases(2000)))]
    #[test]
    fn damage_does_not_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8), cut in any::<prop::sample::Index>(), truncate: bool) {
        let mut bytes = sample();
        for (at, byte) in &flips {
            let i = at.index(bytes.len());
            bytes[i] = *byte;
        }
        if truncate {
            bytes.truncate(cut.index(bytes.len()));
        }
        read_all(&bytes);
    }
}
