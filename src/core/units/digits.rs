//! Numbers in messages and on the terminal.

/// A number with so many significant digits, as an exponent where it is very large or small.
pub fn significant(x: f64, digits: usize) -> String {
    if !x.is_finite() {
        return "-".into();
    }
    if x == 0.0 {
        return "0".into();
    }
    let exponent = x.abs().log10().floor() as i32;
    if !(-4..=6).contains(&exponent) {
        return format!("{x:.*e}", digits.saturating_sub(1));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    format!("{x:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        let found = [(1234.5678, 4), (0.00123, 2), (1e9, 3), (0.0, 3), (f64::NAN, 3)].map(|(x, n)| significant(x, n));
        assert_eq!(found, ["1235", "0.0012", "1.00e9", "0", "-"]);
    }
}
