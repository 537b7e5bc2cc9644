use super::*;
use crate::explain::Explain;
use polars::prelude::{Column as Series_, DataFrame, ParquetWriter};
use proptest::prelude::*;

fn number(name: &str) -> Wanted {
    Wanted { name: name.to_string(), text: false }
}

fn read_bytes(name: &str, bytes: &[u8], wanted: &[Wanted]) -> Result<Columns, DataError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path, wanted, None)
}

fn csv(text: &str) -> Result<Columns, DataError> {
    read_bytes("a.csv", text.as_bytes(), &[number("t"), number("F [N]")])
}

#[test]
fn csv_forms_that_are_legal() {
    let expected = vec![Column::Numbers(vec![0.0, 1.5]), Column::Numbers(vec![-3e-3, 4.0])];
    for text in [
        "t,x,F [N]\n0,a,-3e-3\n1.5,b,4\n",
        "t,x,F [N]\n0,a,-3e-3\n1.5,b,4",
        "t,x,F [N]\r\n0,a,-3e-3\r\n1.5,b,4\r\n",
        "\u{feff}t,x,F [N]\n0,a,-3e-3\n1.5,b,4\n\n",
        "F [N],x,x,t\n-3e-3,,,0\n4.0,,,1.5\n",
        "t, x, F [N]\n0, a, -3e-3\n1.5, b, 4\n",
        "\"t\",\"x, y\",\"F [N]\"\n0,\"a, b\",-3e-3\n1.5,b,4\n",
        "t,x,F [N]\r\n0,a,-3e-3\r\n1.5,b,4",
    ] {
        assert_eq!(csv(text).unwrap_or_else(|e| panic!("{text:?}: {e}")).columns, expected, "{text:?}");
    }
}

#[test]
fn text_of_other_programs() {
    let expected = vec![Column::Numbers(vec![0.0, 1.5]), Column::Numbers(vec![-3e-3, 4.0])];
    for text in [
        "t;F [N]\n0;-0,003\n1,5;4\n",
        "t\tF [N]\r\n0\t-3e-3\r\n1.5\t4\r\n",
        "# written by the rig\n# 12.3.2024\nt,F [N]\n0,-3e-3\n1.5,4\n",
        "Test 12, run 3\nOperator: N.N.\n\nt;F [N]\n0,0;-0,003\n1,5;4,0\n",
        "t,F [N]\ns,N\n0,-3e-3\n1.5,4\n",
        "t   F [N]\n0   -3e-3\n1.5   4\n",
        "% t F\nF [N]   t\n  -3e-3   0\n  4     1.5\n",
        "t [s],F\n0,-3e-3\n1.5,4\n",
    ] {
        let wanted = [number("t"), number(if text.contains("t [s],F\n") { "F" } else { "F [N]" })];
        let c = read_bytes("a.txt", text.as_bytes(), &wanted).unwrap_or_else(|e| panic!("{text:?}: {e} at {}", e.place()));
        assert_eq!(c.columns, expected, "{text:?}");
    }
    let c = read_bytes("a.csv", "Zeit (s);Kraft (kN);Weg (\u{b5}m)\n0;1;2\n".as_bytes(), &[number("Kraft"), number("Weg")]).unwrap();
    assert_eq!(c.units, [Some("kN".to_string()), Some("\u{b5}m".to_string())]);
    let c = read_bytes("a.csv", b"t;x\ns;\xb5m\n0;1\n", &[number("x")]).unwrap();
    assert_eq!(c.units, [Some("\u{b5}m".to_string())]);
    // The errors keep the lines of the file.
    let e = read_bytes("a.txt", b"# one\n# two\nt;x\ns;mm\n0;1\n1;x\n", &[number("x")]).unwrap_err();
    assert!(e.place().ends_with("line 6, column `x`"), "{}", e.place());
}

#[test]
fn csv_errors_name_the_place() {
    let case = |text: &str, message: &str, place: &str| {
        let e = csv(text).unwrap_err();
        assert!(e.to_string().contains(message), "{text:?}: {e}");
        assert!(e.place().ends_with(place), "{text:?}: {}", e.place());
        assert!(!e.accepted().is_empty());
    };
    case("", "the file is empty", "a.csv");
    case("\n\n", "the file is empty", "a.csv");
    case("t,F [N]\n", "no rows", "a.csv");
    case("t,F [N]", "no rows", "a.csv");
    case("t,F[N]\n0,1\n", "no column `F [N]`, nearest is `F[N]`; the file has `t`, `F[N]`", "a.csv");
    case("t,F [N],t\n0,1,2\n", "`t` stands twice", "a.csv");
    case("t;F [N]\n0,5;1.5\n", "decimal commas and decimal points", "a.csv");
    case("t;F [N]\n0,5;1,5\n0,5;1,5\n0,5;1,5\n0,5;1,5\n0,5;1,5\n0,7;1.234\n", "`1.234` has a decimal point", "line 7, column `F [N]`");
    case("t,F [N]\n0,5,1,5\n", "4 cells, where the header has 2", "line 2");
    case("a;t,F [N];b\n1;2,3;4\n", "no column `t`", "a.csv");
    case("0.0,1.0\n0.1,1.0\n", "the first line holds numbers", "a.csv");
    case("t,F [N]\n0,1\n1,x7\n", "`x7` is not a number", "line 3, column `F [N]`");
    case("t,F [N]\n0,1\n1,\n", "an empty cell", "line 3, column `F [N]`");
    case("t,F [N]\n0,1\n1, \n", "an empty cell", "line 3, column `F [N]`");
    case("t,F [N]\n0,1\n1,NaN\n2,3\n", "not a finite", "line 3, column `F [N]`");
    case("t,F [N]\n0,-inf\n1,2\n", "not a finite", "line 2, column `F [N]`");
    case("t,F [N]\n0,1e999\n1,2\n", "not a finite", "line 2, column `F [N]`");
    case("t,F [N]\n0,1\n\n1,2\n", "blank line", "line 3");
    case("t,F [N]\n0,1,5\n1,2\n", "3 cells, where the header has 2", "line 2");
    case("t,F [N]\n0,1\n1,2\n2", "stops in the middle", "line 4");
    case("t,F [N]\n0,1\n1,\"2\n", "quote is not closed", "a.csv");
    case("t\tF [N]\r\n0\t-3e-3\r\n1.5\t\"\r\n", "quote is not closed", "a.csv");
    let e = read_bytes("a.csv", b"t,F [N]\n0,1\n1,\xff\xfe\n", &[number("t")]).unwrap_err();
    assert!(matches!(e, DataError::NotText { line: 3, .. }), "{e:?}");
    assert!(matches!(read_bytes("a.xls", b"x", &[]).unwrap_err(), DataError::NoReader { .. }));
}

fn parquet_bytes() -> Vec<u8> {
    let t: Vec<f64> = (0..300).map(|i| i as f64 * 0.01).collect();
    let f: Vec<f32> = (0..300).map(|i| (i as f32 * 0.3).sin()).collect();
    let n: Vec<Option<i64>> = (0..300).map(|i| (i != 7).then_some(i)).collect();
    let s: Vec<String> = (0..300).map(|i| format!("row {i}")).collect();
    let mut frame = DataFrame::new(
        300,
        vec![Series_::new("t".into(), t), Series_::new("F [N]".into(), f), Series_::new("n".into(), n), Series_::new("s".into(), s)],
    )
    .unwrap();
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes).finish(&mut frame).unwrap();
    bytes
}

#[test]
fn parquet() {
    let bytes = parquet_bytes();
    let c = read_bytes("a.parquet", &bytes, &[number("F [N]"), number("t")]).unwrap();
    assert_eq!(c.len(), 300);
    let Column::Numbers(t) = &c.columns[1] else { panic!() };
    assert_eq!(t[299], 2.99);
    let e = read_bytes("a.parquet", &bytes, &[number("n")]).unwrap_err();
    assert!(e.place().ends_with("row 8, column `n`"), "{}", e.place());
    let c = read_bytes("a.parquet", &bytes, &[number("F")]).unwrap();
    assert_eq!(c.len(), 300);
    let e = read_bytes("a.parquet", &bytes, &[number("G")]).unwrap_err();
    assert!(matches!(e, DataError::MissingColumn { .. }), "{e:?}");
    let e = read_bytes("a.parquet", &bytes, &[number("s")]).unwrap_err();
    assert!(e.to_string().contains("not numbers"), "{e}");
    for cut in [0, 1, 4, 100, bytes.len() / 2, bytes.len() - 1] {
        assert!(read_bytes("a.parquet", &bytes[..cut], &[number("t")]).is_err(), "{cut}");
    }
}

/// polars takes memory for as many row groups as the footer claims, and an allocation that fails ends the process.
#[test]
fn a_footer_that_claims_more_than_it_holds_is_refused() {
    // FileMetaData: version 1, then field 4 (row groups), a list of 2^31 - 1 structs; and lists within lists without an end.
    let endless = [vec![0x15, 0x02, 0x19, 0xfc, 0xff, 0xff, 0xff, 0xff, 0x07], vec![0x19; 200_000]];
    for footer in endless {
        let mut bytes = b"PAR1".to_vec();
        bytes.extend(&footer);
        bytes.extend((footer.len() as u32).to_le_bytes());
        bytes.extend(b"PAR1");
        let e = read_bytes("a.parquet", &bytes, &[number("t")]).unwrap_err();
        assert!(e.to_string().contains("claims more than it holds"), "{e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(crate::data::tests::cases(300)))]
    #[test]
    fn damaged_files_do_not_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut in any::<prop::sample::Index>(), truncate: bool) {
        let text = "t,x,F [N]\r\n0,a,-3e-3\r\n1.5,b,4\r\n2.5,\"b\",4\r\n";
        for (name, bytes) in [("a.csv", text.as_bytes().to_vec()), ("a.parquet", parquet_bytes())] {
            let mut bytes = bytes;
            for (at, byte) in &flips {
                let i = at.index(bytes.len());
                bytes[i] = *byte;
            }
            if truncate {
                bytes.truncate(cut.index(bytes.len()));
            }
            let _ = read_bytes(name, &bytes, &[number("t"), number("F [N]"), Wanted { name: "n".into(), text: true }]);
            let _ = read_bytes(name, &bytes, &[number("t"), number("F [N]")]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(crate::data::tests::cases(3000)))]
    #[test]
    fn damaged_text_does_not_panic(which in 0usize..5, flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<bool>()), 1..8), cut in any::<prop::sample::Index>(), truncate: bool) {
        let samples: [&[u8]; 5] = [
            b"t;F [N]\n0;-0,003\n1,5;4\n2,5;4,5\n",
            b"t\tF [N]\r\n0\t-3e-3\r\n1.5\t4\r\n",
            b"# rig\nTest 12, run 3\n\nt;F [N]\ns;kN\n0,0;-0,003\n1,5;4,0\n",
            b"t   F [N]\n0   -3e-3\n1.5   4\n",
            b"\xef\xbb\xbft,\"F [N]\"\n0,\"1\"\n1.5,4\n",
        ];
        let mut bytes = samples[which].to_vec();
        let last = bytes[..bytes.len() - 1].iter().rposition(|b| *b == b'\n').map_or(0, |k| k + 1);
        let row = bytes[last..].to_vec();
        bytes.extend(row.repeat(200));
        for (at, byte, insert) in &flips {
            let i = at.index(bytes.len());
            if *insert { bytes.insert(i, *byte) } else { bytes[i] = *byte }
        }
        if truncate {
            bytes.truncate(cut.index(bytes.len()));
        }
        let path = Path::new("a.txt");
        if !bytes.is_empty() {
            let wanted = [number("t"), number("F")];
            let whole = csv::read(path, bytes.as_slice(), &wanted);
            // Read in parts of some bytes, the head in one, a file says the same.
            for size in [1, 7, 64] {
                match (&whole, csv::parts(path, bytes.as_slice(), &wanted, (3 * bytes.len()).div_ceil(4).max(600), size)) {
                    (Ok(a), Ok(b)) => prop_assert_eq!(a, &b),
                    (Err(_), Err(_)) => {}
                    (a, b) => prop_assert!(false, "whole {:?}, parts of {} {:?}", a, size, b),
                }
            }
            let _ = dialect::find(path, &bytes);
        }
    }
}

/// A complex column as NumPy writes it is asked for by its parts, and offered by them.
#[test]
fn complex_text_is_read_by_its_parts() {
    let dir = tempfile::tempdir().unwrap();
    let file = |text: &str| {
        let path = dir.path().join("h.csv");
        std::fs::write(&path, text).unwrap();
        path
    };
    let parts = [number("f"), number("real(H)"), number("imag(H)")];
    for text in ["f,H [m/N]\n1,(1+2j)\n2,(-3e-01-4j)\n", "f;H\n1;1,0+2,0i\n2;-0,3-4,0i\n"] {
        let path = file(text);
        let expected = [vec![1.0, 2.0], vec![1.0, -0.3], vec![2.0, -4.0]].map(Column::Numbers);
        assert_eq!(read(&path, &parts, None).unwrap().columns, expected, "{text}");
        let offered: Vec<String> = names(&path).unwrap().into_iter().map(|n| n.0).collect();
        assert_eq!(offered, ["f", "real(H)", "imag(H)"], "{text}");
    }
    let path = file("f,H [m/N]\n1,(1+2j)\n2,(3+4k)\n");
    let error = read(&path, &parts, None).unwrap_err().to_string();
    assert!(error.contains("(3+4k)") && error.contains("(1+2j)"), "{error}");
    let error = read(&path, &[number("f"), number("H")], None).unwrap_err().to_string();
    assert!(error.contains("real(H)"), "{error}");
    assert_eq!(names(&path).unwrap()[1].1.as_deref(), Some("m/N"));
    // A header that is `real(H)` as it stands is a column of its own.
    let path = file("f,real(H),imag(H)\n1,5,6\n2,7,8\n");
    let expected = [vec![1.0, 2.0], vec![5.0, 7.0], vec![6.0, 8.0]].map(Column::Numbers);
    assert_eq!(read(&path, &parts, None).unwrap().columns, expected);
}

#[test]
fn what_is_no_text_is_refused_before_it_is_held() {
    let refused = |bytes: &[u8], message: &str, place: &str| {
        let e = read_bytes("a.csv", bytes, &[number("t")]).unwrap_err();
        assert!(e.to_string().contains(message) && e.place().ends_with(place) && !e.accepted().is_empty(), "{e}, {}", e.place());
    };
    refused(&[0; 1000], "a byte of 0", "a.csv, line 1");
    refused(b"t,x\n0,1\n\0\0", "a byte of 0", "a.csv, line 3");
    // A line that does not end, and blank lines that go on, are not held to the end of the file.
    let long = |rest: u8, size: usize| [b"t,x\n0,1\n".as_slice(), &vec![rest; size]].concat();
    refused(&long(b'1', 17 << 20), "no row ends within 16 MB", "a.csv, line 3");
    refused(&long(b'\n', 70 << 20), "no row ends within 16 MB", "a.csv, line 3");
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    std::fs::write(&path, [0; 1000]).unwrap();
    assert!(names(&path).unwrap_err().to_string().contains("a byte of 0"));
}

#[test]
fn a_text_beyond_the_bound_is_refused_unread() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    // Nothing but its length is on the disk.
    std::fs::File::create(&path).unwrap().set_len(33 << 30).unwrap();
    for e in [read(&path, &[number("t")], None).unwrap_err(), names(&path).unwrap_err()] {
        assert!(e.to_string().contains("longer than 32768 MB") && e.place().ends_with("a.csv") && e.accepted().contains("32 GB"), "{e}");
    }
}

/// Two rows of a moment and of a number, written by pyarrow.
#[test]
fn moments_of_parquet_are_named_and_refused() {
    let bytes = include_bytes!("moments.parquet");
    let e = read_bytes("a.parquet", bytes, &[number("t")]).unwrap_err();
    assert!(e.to_string().contains("`t`") && e.to_string().contains("dates or times"), "{e}");
    assert_eq!(read_bytes("a.parquet", bytes, &[number("F")]).unwrap().columns[0], Column::Numbers(vec![1.0, 2.0]));
}
