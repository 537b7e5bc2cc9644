//! What a person reads on a terminal.

use std::io::Write;

/// The text with every character that commands a terminal written as an escape: titles and names come from files. Line ends and tabs stay.
pub fn plain(text: &str) -> String {
    let commands = |c: char| c.is_control() && c != '\n' && c != '\t';
    text.chars().flat_map(|c| if commands(c) { c.escape_unicode().collect::<Vec<_>>() } else { vec![c] }).collect()
}

/// A line on stderr. Where nobody can read it, that is no failure.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", plain(line));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_commands_no_terminal() {
        assert_eq!(
            plain("\u{1b}[2J\u{1b}]0;owned\u{7}Title µ\r\n\tof a study"),
            "\\u{1b}[2J\\u{1b}]0;owned\\u{7}Title µ\\u{d}\n\tof a study"
        );
    }
}
