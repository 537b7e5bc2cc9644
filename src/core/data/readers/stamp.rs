//! Date and time of a cell, as data loggers write it: ISO 8601 with `T` or a space, with or without a fraction or an offset from UTC; the day
//! first with points, as in German; the time of day alone, where the date has a column of its own.

use chrono::{DateTime, NaiveDateTime, NaiveTime, Timelike};

/// What is read, in words.
pub(crate) const ACCEPTED: &str = "date and time such as 2025-11-14 19:15:18.25, 14.11.2025 19:15:18,25 or 19:15:18.25";

/// Forms of date and time. `03/04/2025` is the third of April or the fourth of March, and is none.
const FORMS: [&str; 8] = [
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%d.%m.%Y %H:%M:%S%.f",
    "%Y-%m-%dT%H:%M",
    "%Y-%m-%d %H:%M",
    "%Y/%m/%d %H:%M",
    "%d.%m.%Y %H:%M",
];

/// Nanoseconds since 1970 (of the offset stated, else of the clock that was read), or since midnight; none for a cell that is none.
pub(super) fn nanoseconds(cell: &str) -> Option<i64> {
    // Most cells are numbers: only what has a colon is parsed.
    if !cell.is_ascii() || cell.len() > 40 || !cell.contains(':') {
        return None;
    }
    // The fraction behind a comma.
    let pointed = match cell.split_once(',') {
        Some((time, fraction)) => format!("{time}.{fraction}"),
        None => cell.to_string(),
    };
    if let Ok(with_offset) = DateTime::parse_from_rfc3339(&pointed) {
        return with_offset.timestamp_nanos_opt();
    }
    if let Ok(time) = NaiveTime::parse_from_str(&pointed, "%H:%M:%S%.f") {
        return Some(i64::from(time.num_seconds_from_midnight()) * 1_000_000_000 + i64::from(time.nanosecond()));
    }
    FORMS.iter().find_map(|f| NaiveDateTime::parse_from_str(&pointed, f).ok()).and_then(|t| t.and_utc().timestamp_nanos_opt())
}

#[cfg(test)]
mod tests {
    use super::nanoseconds;

    #[test]
    fn stamps_of_every_form_are_the_same_moment() {
        let moment = nanoseconds("2025-11-14T19:15:18.250000Z").unwrap();
        for form in [
            "2025-11-14 19:15:18.25",
            "2025-11-14T19:15:18.250",
            "2025-11-14T20:15:18.25+01:00",
            "2025-11-14 19:15:18.250000000",
            "2025-11-14T19:15:18,25",
            "2025/11/14 19:15:18.25",
            "14.11.2025 19:15:18,250",
        ] {
            assert_eq!(nanoseconds(form), Some(moment), "{form}");
        }
        assert_eq!(nanoseconds("2025-11-14 19:15:18").unwrap(), moment - 250_000_000);
        assert_eq!(nanoseconds("19:15:18,25").unwrap(), (69_318 * 4 + 1) * 250_000_000);
        let none = ["", "2025-11-14", "2025-13-14 19:15:18", "12345-67-8901234567", "03/04/2025 19:15:18", "25:15:18", "1:2"];
        assert!(none.iter().all(|c| nanoseconds(c).is_none()));
    }
}
