//! Keys of channels that say how they are read, and records as loggers leave them.

use super::tests::{Folder, error};
use crate::data::{DataError, Dataset, Record, Role, TimeRecord};
use crate::explain::Explain;
use std::f64::consts::TAU;

fn toml(kind: &str, more: &str, time: &str, x: &str, force: &str) -> String {
    format!(
        "schema = 1\n[[test]]\nid = \"t\"\nkind = \"{kind}\"\nfile = \"t.csv\"\ncontrol = \"displacement\"\n{more}\nchannels = [\n \
         {{ role=\"time\", {time} }},\n {{ role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\"{x} }},\n \
         {{ role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\", sigma=\"0.1 N\"{force} }}]\n"
    )
}

const TIME: &str = "column=\"t\", unit=\"s\"";

/// Cycles of 1 Hz at 100 samples, with a mean of 2 N and 0.1 mm; the amplitude of cycle `c` is `amplitude(c)`.
fn csv(cycles: usize, stamp: impl Fn(usize) -> String, amplitude: impl Fn(usize) -> f64) -> String {
    let row = |i: usize| {
        let (t, a) = (i as f64 * 0.01, amplitude(i / 100));
        format!("{},{:.8},{:.8}\n", stamp(i), a * (TAU * t).sin() + 0.1, 8.0 * a * (TAU * t + 0.3).sin() + 2.0)
    };
    "t,x,F\n".to_string() + &(0..cycles * 100).map(row).collect::<String>()
}

fn plain(i: usize) -> String {
    format!("{:.4}", i as f64 * 0.01)
}

fn load(toml: &str, csv: &str) -> Result<Dataset, DataError> {
    Folder::new(toml).with("t.csv", csv).load()
}

fn record(toml: &str, csv: &str) -> TimeRecord {
    let mut data = load(toml, csv).unwrap_or_else(|e| panic!("{e} {}", e.place()));
    match data.tests.remove(0).record {
        Record::Cycle(r) | Record::Transient(r) => r,
        other => panic!("{other:?}"),
    }
}

fn said(record: &TimeRecord, about: &str, what: &str) {
    let mut notes = record.notes.clone();
    notes.extend(record.settled().map(|s| s.notes).unwrap_or_default());
    let count = notes.iter().filter(|n| n.about == about && n.text.contains(what)).count();
    assert_eq!(count, 1, "{about}, {what}: {notes:?}");
}

#[test]
fn a_channel_is_scaled_turned_shifted_and_centred_and_it_is_said() {
    let file = csv(6, plain, |_| 0.4);
    let bare = record(&toml("cycle", "", TIME, "", ""), &file);
    let read = record(&toml("cycle", "", TIME, ", centre = true", ", scale = -2, offset = \"3 N\""), &file);
    let of = |r: &TimeRecord, role: Role| r.channels.iter().find(|c| c.role == role).unwrap().values.clone();
    for (a, b) in of(&bare, Role::Force).iter().zip(of(&read, Role::Force)) {
        assert!((b - (3.0 - 2.0 * a)).abs() < 1e-12);
    }
    for (a, b) in of(&bare, Role::Displacement).iter().zip(of(&read, Role::Displacement)) {
        assert!((b - (a - 1e-4)).abs() < 1e-10, "{a} {b}");
    }
    said(&read, "force at c1.x", "multiplied by -2, 3 N added");
    said(&read, "displacement at c1.x", "centred: its mean of 0.1 mm");
    said(&record(&toml("cycle", "", TIME, "", ", scale = -1"), &file), "force at c1.x", "turned");
    // A declared sigma is that of what is used.
    assert_eq!(read.channels.iter().find(|c| c.role == Role::Force).unwrap().sigma, Some(0.1));
    let whole = record(&toml("transient", "", TIME, ", centre = true", ""), &file);
    assert!(of(&whole, Role::Displacement).iter().sum::<f64>().abs() < 1e-12);
}

#[test]
fn a_window_and_a_range_of_cycles_keep_what_they_say() {
    let file = csv(10, plain, |_| 0.4);
    let r = record(&toml("cycle", "", &format!("{TIME}, from = \"2 s\", to = \"5.995 s\""), "", ""), &file);
    assert_eq!((r.time.len(), r.time[0], r.channels[0].values.len()), (400, 2.0, 400));
    said(&r, "time", "keep 400 of 1000 samples");
    let r = record(&toml("cycle", "conditions = { frequency = \"1 Hz\" }\ncycles = \"3-8\"", TIME, "", ""), &file);
    let settled = r.settled().unwrap();
    assert_eq!((settled.cycles, settled.left_out), (6, 2));
    // A file without a column of time.
    let rate = record(&toml("cycle", "", "rate = \"100 Hz\", from = \"1 s\"", "", ""), &file);
    assert!((rate.settled().unwrap().frequency - 1.0).abs() < 1e-6 && rate.time.len() == 900);
}

#[test]
fn what_a_channel_does_not_take_is_refused_with_its_line() {
    let file = csv(6, plain, |_| 0.4);
    let cases = [
        (toml("cycle", "", TIME, "", ", scale = 0"), "a scale of 0", 11),
        (toml("cycle", "", TIME, "", ", offset = \"3 mm\""), "", 11),
        (toml("cycle", "", TIME, "", ", offset = \"3 N\", centre = true"), "offset and centre", 11),
        (toml("cycle", "", TIME, "", ", from = \"1 s\""), "`from` on a channel of role force", 11),
        (toml("cycle", "", &format!("{TIME}, scale = 2"), "", ""), "`scale` on a channel of role time", 9),
        (toml("cycle", "", &format!("{TIME}, from = \"3 s\", to = \"2 s\""), "", ""), "a window from 3 s to 2 s", 9),
        (toml("cycle", "", &format!("{TIME}, rate = \"100 Hz\""), "", ""), "given by its rate", 9),
        (toml("cycle", "", "rate = \"0 Hz\"", "", ""), "a rate of 0 Hz", 9),
        (toml("cycle", "cycles = \"8-3\"", TIME, "", ""), "`8-3` is no range of cycles", 7),
        (toml("cycle", "cycles = \"1-3\"\ndiscard_cycles = 1", TIME, "", ""), "both stand there", 8),
    ];
    for (text, message, line) in &cases {
        error(text, &[("t.csv", &file)], message, *line);
    }
    for unit in ["-N", "-1 N", "N/-m"] {
        let text = toml("cycle", "", TIME, "", "").replace("unit=\"N\"", &format!("unit=\"{unit}\""));
        error(&text, &[("t.csv", &file)], "a sign is no part of a unit", 11);
    }
    let empty = load(&toml("cycle", "", &format!("{TIME}, from = \"70 s\""), "", ""), &file).unwrap_err();
    assert!(empty.accepted().contains("0 s to 5.99 s") && empty.place().contains("t.csv"), "{} {}", empty.place(), empty.accepted());
    let beyond = load(&toml("cycle", "cycles = \"3-9\"", TIME, "", ""), &file).unwrap_err();
    assert!(beyond.to_string().contains("up to 9") && beyond.accepted().contains('6'), "{beyond} {}", beyond.accepted());
}

#[test]
fn a_run_up_is_left_out_as_a_run_down_is_and_said_once() {
    let file = csv(10, plain, |c| 0.4 * [0.2, 0.5, 0.8, 1.0, 1.0, 1.0, 1.0, 1.0, 0.7, 0.3][c]);
    let r = record(&toml("cycle", "", TIME, "", ""), &file);
    let settled = r.settled().unwrap();
    assert_eq!((settled.cycles, settled.left_out), (5, 3));
    said(&r, "displacement at c1.x", "runs up: the first 3 of 9 cycles");
    let force = settled.channels.iter().find(|c| c.role == Role::Force).unwrap();
    assert!((force.mean.iter().fold(0.0f64, |m, v| m.max(*v)) - 5.2).abs() < 1e-2);
    // Discarded cycles are counted from the start of the record.
    let r = record(&toml("cycle", "discard_cycles = 2", TIME, "", ""), &file);
    assert_eq!((r.settled().unwrap().cycles, r.settled().unwrap().left_out), (5, 3));
}

#[test]
fn rounded_time_is_uniform_and_a_gap_is_refused_with_its_row() {
    let rate = 333.0;
    let rounded = |i: usize| format!("{:.3}", i as f64 / rate);
    let text = csv(10, rounded, |_| 0.4);
    let r = record(&toml("transient", "", TIME, "", ""), &text);
    assert!(r.time.iter().enumerate().all(|(i, t)| (t - i as f64 / rate).abs() < 2e-4));
    said(&r, "time", "stamps rounded to 0.001 s; taken as sampled uniformly at 33");
    assert!(r.history().motion("c1.x").is_ok());
    let gap = csv(10, |i| format!("{:.3}", (i + if i > 500 { 20 } else { 0 }) as f64 / rate), |_| 0.4);
    let e = load(&toml("transient", "", TIME, "", ""), &gap).unwrap_err();
    assert!(e.to_string().contains("not sampled uniformly") && e.place().contains("line 503"), "{e} {}", e.place());
    // A window before the gap is fine.
    record(&toml("transient", "", &format!("{TIME}, to = \"1.4 s\""), "", ""), &gap);
}

#[test]
fn date_and_time_are_read_in_seconds_from_the_first_row() {
    // Over midnight, with and without a fraction.
    let stamp = |i: usize| {
        let ms = 59_000 + 10 * i;
        let (day, minute) = if ms < 60_000 { (14, "23:59") } else { (15, "00:00") };
        let s = ms % 60_000;
        let fraction = if s.is_multiple_of(1000) { String::new() } else { format!(".{:03}000", s % 1000) };
        format!("2025-11-{day} {minute}:{:02}{fraction}", s / 1000)
    };
    let r = record(&toml("cycle", "", TIME, "", ""), &csv(6, stamp, |_| 0.4));
    assert!((r.settled().unwrap().frequency - 1.0).abs() < 1e-6);
    assert!(r.time[0] == 0.0 && (r.time[599] - 5.99).abs() < 1e-9);
    let wrong = toml("cycle", "", "column=\"t\", unit=\"ms\"", "", "");
    let e = load(&wrong, &csv(6, stamp, |_| 0.4)).unwrap_err();
    assert!(e.to_string().contains("the file says `s`"), "{e}");
    let bad = csv(6, |i| if i == 7 { "yesterday".into() } else { stamp(i) }, |_| 0.4);
    let e = load(&toml("cycle", "", TIME, "", ""), &bad).unwrap_err();
    assert!(e.to_string().contains("`yesterday` is not a date and time") && e.place().contains("line 9"), "{e} {}", e.place());
}

#[test]
fn a_number_beyond_any_that_is_reckoned_with_has_its_place() {
    let file = csv(6, plain, |_| 0.4);
    let mut lines: Vec<&str> = file.lines().collect();
    lines[6] = "0.0500,0.1,1e308";
    let e = load(&toml("cycle", "", TIME, "", ""), &lines.join("\n")).unwrap_err();
    assert!(e.place().ends_with("t.csv, line 7, test t, channel force at c1.x"), "{}", e.place());
    assert!(e.to_string().contains("1e308 N") && e.accepted().contains("1e50"), "{e}, {}", e.accepted());
    // A factor, a condition: the key.
    for (force, more, line, said) in [
        (", scale = 1e300", "", 11, "1e300"),
        (", scale = 1e-320", "", 11, "1e-320"),
        (", offset = \"1e300 N\"", "", 11, "1e300"),
        ("", "conditions = { frequency = \"1e300 Hz\" }", 7, "1e300"),
    ] {
        let e = load(&toml("cycle", more, TIME, "", force), &file).unwrap_err();
        assert!(e.to_string().len() < 200 && e.to_string().contains(said), "{e}");
        assert!(e.place().contains(&format!("dataset.toml, line {line}")), "{}", e.place());
    }
}

#[test]
#[cfg(unix)]
fn what_is_there_and_is_no_file_is_said_to_be_none() {
    let dir = tempfile::tempdir().unwrap();
    let pipe = |name: &str| assert!(std::process::Command::new("mkfifo").arg(dir.path().join(name)).status().unwrap().success());
    std::fs::write(dir.path().join("dataset.toml"), toml("cycle", "", TIME, "", "")).unwrap();
    pipe("t.csv");
    let e = Dataset::load(dir.path(), None).unwrap_err();
    assert!(e.to_string().contains("it is no regular file") && e.place().ends_with("t.csv"), "{e}, {}", e.place());
    std::fs::remove_file(dir.path().join("dataset.toml")).unwrap();
    pipe("dataset.toml");
    let e = Dataset::load(dir.path(), None).unwrap_err();
    assert!(e.to_string().contains("it is no regular file") && e.place().ends_with("dataset.toml"), "{e}, {}", e.place());
}

#[test]
fn a_transient_that_nothing_drives_is_said_to_have_no_drive() {
    let undriven = toml("transient", "", TIME, "", "").replace("control = \"displacement\"\n", "");
    let e = load(&undriven, &csv(6, plain, |_| 0.4)).unwrap_err();
    assert!(e.to_string().contains("nothing drives this test"), "{e}");
    assert!(e.accepted().contains("control = ") && e.accepted().contains("input = true"), "{}", e.accepted());
}

#[test]
fn stamps_of_any_number_of_decimals_are_one_sampling() {
    // At 3004.8 Hz four decimals are a third of a step, five a thirtieth.
    let rate = 3004.8;
    let file = |digits: usize| {
        let row = |i: usize| {
            let (t, p) = (i as f64 / rate, TAU * i as f64 / rate);
            format!("{t:.digits$},{:.8},{:.8}\n", 0.4 * p.sin(), 8.0 * (p + 0.3).sin())
        };
        "t,x,F\n".to_string() + &(0..15_024).map(row).collect::<String>()
    };
    for digits in [4, 5, 6] {
        let r = record(&toml("cycle", "", TIME, "", ""), &file(digits));
        said(&r, "time", "taken as sampled uniformly at 3004.");
        let settled = r.settled().unwrap();
        assert!(!settled.notes.iter().any(|n| n.text.contains("interpolation")), "{digits}: {:?}", settled.notes);
        let force = settled.channels.iter().find(|c| c.role == Role::Force).unwrap();
        let worst = settled.phase.iter().zip(&force.mean).map(|(p, f)| (f - 8.0 * (p + 0.3).sin()).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-3, "{digits}: {worst}");
    }
}

#[test]
fn jitter_of_a_transient_is_said() {
    let stamp = |i: usize| format!("{:.8}", 0.01 * (i as f64 + 0.04 * (7.0 * i as f64).sin()));
    let r = record(&toml("transient", "", TIME, "", ""), &csv(6, stamp, |_| 0.4));
    said(&r, "time", "samples lie up to 4.0 % of a step from equal times");
}

#[test]
fn date_and_time_as_loggers_write_it() {
    let load = |stamp: &dyn Fn(usize) -> String| {
        let text = csv(6, |i| format!("\"{}\"", stamp(i)), |_| 0.4);
        record(&toml("cycle", "", TIME, "", ""), &text)
    };
    let second = |i: usize| format!("{:02}", 10 + i / 100);
    for stamp in [
        &|i: usize| format!("2025-11-14T19:15:{},{:02}0", second(i), i % 100),
        &|i: usize| format!("14.11.2025 19:15:{},{:02}", second(i), i % 100),
        &|i: usize| format!("2025/11/14 19:15:{}.{:02}", second(i), i % 100),
        &|i: usize| format!("19:15:{}.{:02}", second(i), i % 100),
    ] as [&dyn Fn(usize) -> String; 4]
    {
        let r = load(stamp);
        assert!(r.time[0] == 0.0 && (r.time[599] - 5.99).abs() < 1e-9, "{}", stamp(3));
    }
    // Day and month cannot be told apart.
    let text = csv(6, |i| format!("03/04/2025 19:15:{}.{:02}", second(i), i % 100), |_| 0.4);
    let e = Folder::new(&toml("cycle", "", TIME, "", "")).with("t.csv", &text).load().unwrap_err();
    assert!(e.to_string().contains("`03/04/2025 19:15:10.00`") && e.place().ends_with("line 2, column `t`"), "{e} {}", e.place());
    assert!(e.accepted().contains("2025-11-14 19:15:18.25"), "{}", e.accepted());
    // Beside decimal commas.
    let text = csv(6, |i| format!("14.11.2025 19:15:{}.{:02}", second(i), i % 100), |_| 0.4).replace(',', ";");
    let numbers = text.lines().map(|l| l.split_once(';').map_or(l.into(), |(t, v)| format!("{t};{}", v.replace('.', ","))));
    let r = record(&toml("cycle", "", TIME, "", ""), &numbers.collect::<Vec<_>>().join("\n"));
    assert!((r.time[599] - 5.99).abs() < 1e-9);
}

#[test]
fn a_decay_has_no_channel_that_drives_it() {
    let file = csv(6, plain, |c| 0.4 * 0.7f64.powi(c as i32));
    let released = toml("transient", "", TIME, "", "").replace("control = \"displacement\"", "control = \"free\"");
    let only_x = released.replace(",\n { role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\", sigma=\"0.1 N\" }]", "]");
    let read = record(&only_x, &file);
    let drives: Vec<_> =
        read.channels.iter().filter(|c| c.input).map(|c| (c.role, c.at.as_str(), c.values.iter().all(|f| *f == 0.0))).collect();
    assert_eq!(drives, [(Role::Force, "c1.x", true)]);
    assert_eq!(read.control, Some(crate::data::Control::Force));
    said(&read, "control", "released before it begins");
    // A force that is measured somewhere is compared, and drives nothing.
    let read = record(&released, &file);
    assert_eq!(read.channels.iter().filter(|c| read.answers(c)).count(), 2);
    let e = |toml: &str| load(toml, &file).unwrap_err().to_string();
    assert!(e(&released.replace("unit=\"mm\"", "unit=\"mm\", input=true")).contains("marked as input, and control is free"));
    let only_f = released.replace(" { role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" },\n", "");
    assert!(e(&only_f).contains("of a motion"), "{}", e(&only_f));
    assert!(e(&released.replace("\"transient\"", "\"cycle\"")).contains("unknown control"));
}

#[test]
fn lines_of_an_frf_have_the_force_that_was_measured_or_made_their_response() {
    let lines: String = (10..60).map(|f| format!("{f},{},{},{}\n", -0.1 * f as f64, 0.02 * f as f64, 5.0 / f as f64)).collect();
    let test = |more: &str, channel: &str| {
        format!(
            "schema = 1\n[[test]]\nid = \"t\"\nkind = \"frf\"\nfile = \"t.csv\"\nexcite = \"m.x\"\nrespond = \"m.x\"\nquantity = \"accelerance\"\nnoise = \"1 %\"\n{more}\nchannels = [\n \
             {{ role=\"frequency\", column=\"f\", unit=\"Hz\" }},\n {{ role=\"real\", column=\"re\", unit=\"m/s2/N\" }},\n \
             {{ role=\"imag\", column=\"im\", unit=\"m/s2/N\" }}{channel}]\n"
        )
    };
    let file = "f,re,im,F\n".to_string() + &lines;
    let read = |toml: &str| match load(toml, &file).unwrap_or_else(|e| panic!("{e}")).tests.remove(0).record {
        Record::Frf(f) => *f,
        other => panic!("{other:?}"),
    };
    let column = ",\n { role=\"excitation\", column=\"F\", unit=\"N\" }";
    let measured = read(&test("", column));
    assert!(measured.excitation == Some(0.5) && measured.parts.len() == 50, "{measured:?}");
    assert!((measured.parts[40] - 10.0 / 50.0).abs() < 1e-12);
    let held = read(&test("response_amplitude = \"2 m/s2\"", ""));
    let force = |k: usize| held.excitation.unwrap() * held.parts[k];
    assert!((0..50).all(|k| (force(k) * held.measured[k].norm() - 2.0).abs() < 1e-12));
    assert!(read(&test("excitation = \"0.5 N\"", "")).parts.is_empty());
    let e = |toml: &str, file: &str| load(toml, file).unwrap_err();
    let twice = e(&test("excitation = \"0.5 N\"", column), &file);
    assert!(twice.to_string().contains("said twice"), "{twice}");
    let unit = e(&test("response_amplitude = \"2 mm\"", ""), &file);
    assert!(unit.to_string().contains("is a length"), "{unit}");
    let none = e(&test("", column), &file.replace(&format!(",{}\n", 5.0 / 30.0), ",0\n"));
    assert!(none.to_string().contains("an excitation of 0") && none.place().contains("line 22"), "{none} {}", none.place());
}
