//! Machine on which a study ran, and the date.

use std::time::{SystemTime, UNIX_EPOCH};

use tiprub_shell::sweep;

/// Returns names and values.
pub fn facts() -> Vec<(String, String)> {
    let cores = sweep::processors();
    vec![
        ("processor".into(), processor().unwrap_or_else(|| std::env::consts::ARCH.to_owned())),
        ("processors available".into(), cores.to_string()),
        ("system".into(), std::env::consts::OS.to_owned()),
        ("date".into(), date(now())),
    ]
}

/// Returns the name of the processor, if the system provides it.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Returns the seconds since 1970, or SOURCE_DATE_EPOCH if it is set.
fn now() -> u64 {
    let given = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|text| text.parse().ok());
    given.unwrap_or_else(|| SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()))
}

/// Returns year, month and day (Gregorian, UTC) for seconds since 1970, by counting eras of 400 years from the first of March.
fn date(seconds: u64) -> String {
    let days = seconds / 86_400 + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day_of_year = day - (365 * year + year / 4 - year / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = era * 400 + year + u64::from(month <= 2);
    format!("{year}-{month:02}-{:02}", day_of_year - (153 * shifted + 2) / 5 + 1)
}

#[cfg(test)]
mod tests {
    #[test]
    fn converts_seconds_to_calendar_dates() {
        for (seconds, date) in [
            (0, "1970-01-01"),
            (951_782_400, "2000-02-29"),
            (951_868_800, "2000-03-01"),
            (1_700_000_000, "2023-11-14"),
            (4_107_542_399, "2100-02-28"),
            (4_107_542_400, "2100-03-01"),
        ] {
            assert_eq!(super::date(seconds), date);
        }
    }
}
