//! Mutations of text, numbers and bytes. Everything follows from a seed.

/// SplitMix64: a seed gives one sequence.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    pub fn pick<'a, T: ?Sized>(&mut self, of: &[&'a T]) -> &'a T {
        of[self.below(of.len())]
    }
}

/// Numbers somebody could write, by mistake or on purpose.
const NUMBERS: [&str; 32] = [
    "0",
    "-1",
    "1",
    "2",
    "3",
    "1e-300",
    "1e300",
    "1e308",
    "-1e308",
    "1e-308",
    "1e8",
    "1e7",
    "1e5",
    "1e12",
    "-1e12",
    "1e-12",
    "nan",
    "inf",
    "-inf",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551616",
    "4294967296",
    "10000",
    "100000",
    "2147483647",
    "0.5",
    "1e-5",
    "-0",
    "1e999",
    "0x10",
    "1_000",
];

/// Text that stands in no sensible file.
const SCRAPS: [&str; 30] = [
    "",
    "\"",
    "[",
    "]",
    "{",
    "}",
    "nan",
    "-",
    "1e999",
    "\n",
    ",",
    "=",
    "0",
    "[[effect]]\n",
    "\"c1-9.x\"",
    "-9223372036854775808",
    "\u{fffd}",
    "'",
    "\\",
    ";",
    "%",
    " mm",
    "\"c1-99999999.x\"",
    "$(touch /tmp/misfit-was-here)",
    "<script>",
    "\u{0}",
    "\t",
    "e",
    "1e8",
    "µ",
];

/// Start and end of every number in `text`.
pub fn numbers(text: &[u8]) -> Vec<(usize, usize)> {
    let (mut found, mut at) = (Vec::new(), 0);
    let part = |b: u8| b.is_ascii_digit() || b == b'.';
    while at < text.len() {
        if !text[at].is_ascii_digit() {
            at += 1;
            continue;
        }
        let mut from = at;
        while at < text.len() && part(text[at]) {
            at += 1;
        }
        let exponent = at + 1 < text.len()
            && matches!(text[at], b'e' | b'E')
            && (text[at + 1].is_ascii_digit() || matches!(text[at + 1], b'-' | b'+'));
        if exponent {
            at += 2;
            while at < text.len() && text[at].is_ascii_digit() {
                at += 1;
            }
        }
        if from > 0 && text[from - 1] == b'-' {
            from -= 1;
        }
        found.push((from, at));
    }
    found
}

/// Another number in place of the one at `range`: a hostile one, its negative, or it a power of ten away.
fn other(old: &str, random: &mut Random) -> String {
    match random.below(4) {
        0 => format!("-{old}"),
        1 => old.parse::<f64>().map_or("0".into(), |v| format!("{:e}", v * 10f64.powi(random.below(25) as i32 - 12))),
        _ => random.pick(&NUMBERS).to_string(),
    }
}

/// One to three numbers changed.
pub fn change_numbers(text: &str, random: &mut Random) -> String {
    let mut text = text.to_string();
    for _ in 0..1 + random.below(3) {
        let all = numbers(text.as_bytes());
        if all.is_empty() {
            return text;
        }
        let (from, to) = all[random.below(all.len())];
        let new = other(&text[from..to], random);
        text.replace_range(from..to, &new);
    }
    text
}

/// Text cut, put in, doubled or moved, once or twice.
pub fn change_text(text: &str, random: &mut Random) -> String {
    let mut text = text.to_string();
    for _ in 0..1 + random.below(2) {
        text = change_once(&text, random);
    }
    text
}

fn change_once(text: &str, random: &mut Random) -> String {
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let (a, b) = (random.below(lines.len()), random.below(lines.len()));
    let mut moved = lines.clone();
    match random.below(6) {
        0 if !lines.is_empty() => {
            moved.remove(a);
            moved.concat()
        }
        1 if !lines.is_empty() => {
            moved.insert(a, lines[b]);
            moved.concat()
        }
        2 if !lines.is_empty() => {
            moved.swap(a, b);
            moved.concat()
        }
        // A word of the file in the place of another.
        3 => {
            let words: Vec<&str> = text.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| w.len() > 1).collect();
            if words.is_empty() {
                return text.into();
            }
            let (old, new) = (words[random.below(words.len())], words[random.below(words.len())]);
            text.replacen(old, new, 1)
        }
        _ => {
            let marks: Vec<usize> = text.char_indices().map(|(k, _)| k).chain([text.len()]).collect();
            let from = random.below(marks.len());
            let to = (from + random.below(12)).min(marks.len() - 1);
            format!("{}{}{}", &text[..marks[from]], random.pick(&SCRAPS), &text[marks[to]..])
        }
    }
}

/// Bytes changed, cut, put in, doubled; numbers changed where the file is text.
pub fn change_bytes(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    if let Ok(text) = std::str::from_utf8(bytes)
        && random.below(3) == 0
    {
        return if random.below(2) == 0 { change_numbers(text, random) } else { change_text(text, random) }.into_bytes();
    }
    let mut bytes = bytes.to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len());
        let length = (1 + random.below(64)).min(bytes.len() - at);
        match random.below(7) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            1 if !bytes.is_empty() => bytes[at] = *random.pick(&[&0, &0xff, &0x7f, &0x80, &b'-', &b'9', &b' ', &b'\n']),
            2 => drop(bytes.drain(at..at + length)),
            3 => bytes.truncate(at),
            4 => {
                let piece = bytes[at..at + length].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => {
                let word: [u8; 4] = *random.pick(&[&[0xff; 4], &[0; 4], &[0xff, 0xff, 0xff, 0x7f], &[0, 0, 0, 0x80], &[0, 0, 1, 0]]);
                for (k, b) in word.iter().enumerate().filter(|(k, _)| k + at < at + length) {
                    bytes[at + k] = *b;
                }
            }
            _ => bytes[at..at + length].iter_mut().for_each(|b| *b = random.next() as u8),
        }
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}
