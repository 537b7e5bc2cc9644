use super::*;
use proptest::prelude::*;
use std::sync::LazyLock;

static DATA: LazyLock<[(String, Dataset); 3]> = LazyLock::new(|| {
    let extra = "[[effect]]\neffect = \"interference_law\"\nat = \"c1.x\"\nof = \"viscous.c\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = \"0.2 1/mm\"\n\
        [[effect]]\neffect = \"delay\"\nat = \"*.force\"\ntau = \"1 ms\"\n[[order]]\norder = [\"c1.x.viscous.c\", \"c1.x.viscous#2.c\"]\n\
        [[effect]]\neffect = \"viscous\"\nat = \"c1.x\"\nc = { start = \"1 N s/mm\", max = \"3 N s/mm\" }\n";
    [
        (format!("{ONE}{extra}"), Folder::one(ONE).dataset()),
        (CHAIN.to_string(), Folder::chain(CHAIN).dataset()),
        (every_key::STUDY.to_string(), every_field::folder().dataset()),
    ]
});

/// Reads a text that may be anything; what is accepted is written and read again.
fn survive(text: &str, dataset: &Dataset) -> Result<(), TestCaseError> {
    match read(text, dataset) {
        Ok(study) => {
            let written = study.with_values(&study.system, Path::new("."));
            let again = read(&written, dataset).map_err(|e| TestCaseError::fail(format!("{e} at {}\n{written}", e.place())))?;
            prop_assert_eq!(essence(&study), essence(&again), "{}", written);
        }
        Err(e) => {
            prop_assert!(!e.to_string().is_empty() && !e.accepted().is_empty() && !e.place().is_empty(), "{:?}", e);
        }
    }
    Ok(())
}

/// The text between quotes and the numbers: what a value may be.
fn values(text: &str) -> Vec<(usize, usize)> {
    let mut values = Vec::new();
    let mut open = None;
    for (i, c) in text.char_indices().filter(|(_, c)| *c == '"') {
        match open.take() {
            None => open = Some(i + c.len_utf8()),
            Some(start) => values.push((start, i)),
        }
    }
    values
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn flipped_bytes(which in 0usize..3, flips in prop::collection::vec((any::<prop::sample::Index>(), 32u8..127), 1..4)) {
        let (text, dataset) = &DATA[which];
        let mut bytes = text.clone().into_bytes();
        for (at, byte) in flips {
            let i = at.index(bytes.len());
            bytes[i] = byte;
        }
        survive(&String::from_utf8_lossy(&bytes), dataset)?;
    }

    #[test]
    fn deleted_and_doubled_lines(which in 0usize..3, lines in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 1..4)) {
        let (text, dataset) = &DATA[which];
        let mut all: Vec<&str> = text.lines().collect();
        for (at, double) in lines {
            let i = at.index(all.len());
            if double { all.insert(i, all[i]) } else { all.remove(i); }
        }
        survive(&all.join("\n"), dataset)?;
    }

    #[test]
    fn swapped_values(which in 0usize..3, a in any::<prop::sample::Index>(), b in any::<prop::sample::Index>()) {
        let (text, dataset) = &DATA[which];
        let all = values(text);
        let (a, b) = (all[a.index(all.len())], all[b.index(all.len())]);
        let (a, b) = if a <= b { (a, b) } else { (b, a) };
        if a != b {
            let swapped = [&text[..a.0], &text[b.0..b.1], &text[a.1..b.0], &text[a.0..a.1], &text[b.1..]].concat();
            survive(&swapped, dataset)?;
        }
    }

    #[test]
    fn hostile_values(which in 0usize..3, at in any::<prop::sample::Index>(), value in "(\\PC{0,12}|[-+0-9.e]{1,8} (N|mm|N/mm|N s/mm|kg|1/mm|s)|[a-z0-9*.-]{0,9})") {
        let (text, dataset) = &DATA[which];
        let all = values(text);
        let (start, end) = all[at.index(all.len())];
        survive(&[&text[..start], value.as_str(), &text[end..]].concat(), dataset)?;
    }
}
