//! Date and time of a cell, as data loggers write it: ISO 8601 with `T` or a space, with or without a fraction or an offset from UTC.

use chrono::{DateTime, NaiveDateTime};

/// Nanoseconds since 1970 (of the offset stated, else of the clock that was read); none for a cell that is none.
pub(super) fn nanoseconds(cell: &str) -> Option<i64> {
    // Most cells are numbers: only what begins as a date is parsed.
    let begins = cell.len() >= 16 && cell.is_ascii() && cell.as_bytes()[4] == b'-' && cell.as_bytes()[7] == b'-';
    if !begins {
        return None;
    }
    if let Ok(with_offset) = DateTime::parse_from_rfc3339(cell) {
        return with_offset.timestamp_nanos_opt();
    }
    let formats = ["%Y-%m-%dT%H:%M:%S%.f", "%Y-%m-%d %H:%M:%S%.f", "%Y-%m-%dT%H:%M", "%Y-%m-%d %H:%M"];
    formats.iter().find_map(|f| NaiveDateTime::parse_from_str(cell, f).ok()).and_then(|t| t.and_utc().timestamp_nanos_opt())
}

#[cfg(test)]
mod tests {
    use super::nanoseconds;

    #[test]
    fn stamps_of_every_form_are_the_same_moment() {
        let moment = nanoseconds("2025-11-14T19:15:18.250000Z").unwrap();
        for form in ["2025-11-14 19:15:18.25", "2025-11-14T19:15:18.250", "2025-11-14T20:15:18.25+01:00", "2025-11-14 19:15:18.250000000"] {
            assert_eq!(nanoseconds(form), Some(moment), "{form}");
        }
        assert_eq!(nanoseconds("2025-11-14 19:15:18").unwrap(), moment - 250_000_000);
        assert!(
            ["", "2025-11-14", "14.11.2025 19:15:18", "2025-13-14 19:15:18", "12345-67-8901234567"]
                .iter()
                .all(|c| nanoseconds(c).is_none())
        );
    }
}
