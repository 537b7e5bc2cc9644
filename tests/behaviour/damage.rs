//! Files damaged at random: the program says what is wrong or works, and never panics.

use super::rig::{Rig, keys};

/// A small generator, so that a failure can be repeated.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n.max(1)
    }
}

const SCRAPS: [&str; 16] =
    ["", "\"", "[", "]", "{", "nan", "-", "1e999", "\n", ",", "=", "0", "[[effect]]\n", "\"c1-9.x\"", "-9223372036854775808", "\u{fffd}"];

/// Cuts something out, and puts something in.
fn damage(text: &str, random: &mut Random) -> String {
    let marks: Vec<usize> = text.char_indices().map(|(k, _)| k).chain([text.len()]).collect();
    let from = random.below(marks.len());
    let to = (from + random.below(12)).min(marks.len() - 1);
    format!("{}{}{}", &text[..marks[from]], SCRAPS[random.below(SCRAPS.len())], &text[marks[to]..])
}

#[test]
fn no_damage_makes_a_panic() {
    let rig = Rig::new();
    let mut random = Random(20_261_121);
    let files = ["study.toml", "data/dataset.toml", "data/loop1.csv"];
    let whole: Vec<String> = files.iter().map(|f| rig.read(f)).collect();
    for round in 0..240 {
        let which = round % files.len();
        let damaged = damage(&whole[which], &mut random);
        rig.write(files[which], &damaged);
        let verb = ["check", "compare"][round / files.len() % 2];
        let ran = rig.run(verb, &["--json"]);
        let said = format!("round {round}, {verb}: exit {}, {}\n{}\n{damaged}", ran.code, ran.stdout, ran.stderr);
        assert!((ran.code == 0 || ran.code == 1) && !ran.stderr.contains("panicked"), "{said}");
        let json = ran.json();
        match (verb, ran.code) {
            ("check", 1) => assert!(!json["problems"].as_array().unwrap().is_empty(), "{said}"),
            (_, 1) => assert_eq!(keys(&json), ["error"], "{said}"),
            _ => {}
        }
        rig.write(files[which], &whole[which]);
    }
}
