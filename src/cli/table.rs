//! Tables of text with aligned columns.

pub(super) use crate::units::significant;

/// Most characters of a cell. The name of a parameter holds every place it stands at, and thousands of them are no name to read.
const CELL: usize = 300;

/// Rows under a header; a cell of more than [`CELL`] characters loses its middle; columns whose cells are all numbers are set to the right.
pub(super) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let rows: Vec<Vec<String>> = rows.iter().map(|r| r.iter().map(|cell| short(cell)).collect()).collect();
    let width = |c: usize| {
        let cells = rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count());
        cells.chain([header[c].chars().count()]).max().unwrap_or(0)
    };
    let numeric = |c: usize| {
        let mut cells = rows.iter().filter_map(|r| r.get(c)).filter(|s| !s.is_empty() && *s != "-").peekable();
        cells.peek().is_some() && cells.all(|s| s.starts_with(|ch: char| ch.is_ascii_digit() || "+-".contains(ch)))
    };
    let columns: Vec<(usize, bool)> = (0..header.len()).map(|c| (width(c), numeric(c))).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let set = |(text, (width, right)): (&str, &(usize, bool))| {
            if *right { format!("{text:>width$}") } else { format!("{text:<width$}") }
        };
        let cells: Vec<String> = cells.zip(&columns).map(set).collect();
        format!("  {}", cells.join("  ")).trim_end().to_string() + "\n"
    };
    let mut text = line(&mut header.iter().copied());
    let rules: Vec<String> = columns.iter().map(|c| "-".repeat(c.0)).collect();
    text += &line(&mut rules.iter().map(String::as_str));
    for row in &rows {
        text += &line(&mut row.iter().map(String::as_str));
    }
    text
}

fn short(cell: &str) -> String {
    let n = cell.chars().count();
    if n <= CELL {
        return cell.into();
    }
    let (start, end) = (CELL / 2, CELL / 2 - 5);
    cell.chars().take(start).chain(" ... ".chars()).chain(cell.chars().skip(n - end)).collect()
}

/// A fraction in percent with three significant digits.
pub(super) fn percent(fraction: f64) -> String {
    if fraction.is_finite() { format!("{} %", significant(100.0 * fraction, 3)) } else { "-".into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_align_and_numbers_stand_right() {
        let rows = vec![vec!["a".into(), "1.5 %".into()], vec!["long name".into(), "12.5 %".into()]];
        let text = table(&["test", "error"], &rows);
        assert_eq!(text, "  test        error\n  ---------  ------\n  a           1.5 %\n  long name  12.5 %\n");
        // A parameter at 22 000 places: a width beyond 65 535 is more than a format takes.
        let name = (1..22_000).map(|k| format!("c{k}.x,")).collect::<String>() + "c22000.x.viscous.c";
        let text = table(&["parameter", "value"], &[vec![name, "1".into()]]);
        assert!(text.contains("c1.x,c2.x") && text.contains(" ... ") && text.contains("c22000.x.viscous.c      1\n"), "{text}");
        assert!(text.lines().all(|l| l.chars().count() < CELL + 20));
        assert_eq!((percent(0.0265), percent(f64::NAN)), ("2.65 %".into(), "-".into()));
    }
}
