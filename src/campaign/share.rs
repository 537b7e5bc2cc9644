//! A run that is divided: one process of many draws every n-th replicate, profiles every n-th parameter, generates every n-th case; what they have drawn is put together by
//! the verb itself, which then finds all of it done.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::CampaignError;

/// One of so many shares, `3/8` the third of eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Share {
    at: usize,
    of: usize,
}

impl Share {
    /// All of it.
    pub const WHOLE: Share = Share { at: 0, of: 1 };

    /// Those of a run that is divided by `of`.
    pub fn all(of: usize) -> impl Iterator<Item = Share> {
        (0..of).map(move |at| Share { at, of })
    }

    /// Whether the draw `k` is one of this share.
    pub fn has(&self, k: usize) -> bool {
        k % self.of.max(1) == self.at
    }

    /// The part of `0..n` that it has.
    pub fn of(&self, n: usize) -> impl Iterator<Item = usize> + use<> {
        let share = *self;
        (0..n).filter(move |k| share.has(*k))
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.at + 1, self.of)
    }
}

impl FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Share, String> {
        let parsed = text.split_once('/').and_then(|(k, n)| Some((k.parse::<usize>().ok()?, n.parse::<usize>().ok()?)));
        let share = parsed.filter(|(k, n)| (1..=*n).contains(k)).map(|(k, n)| Share { at: k - 1, of: n });
        share.ok_or_else(|| "K/N, the K-th of N shares, such as 3/8".into())
    }
}

/// The folders of shares in `folder`, in the order of their names.
///
/// # Errors
/// Where it cannot be read.
pub fn shares(folder: &Path) -> Result<Vec<PathBuf>, CampaignError> {
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(folder).map_err(|e| CampaignError::file(folder, e))?.flatten().map(|e| e.path()).filter(|p| p.is_dir()).collect();
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_draw_is_of_one_share() {
        for n in [1, 3, 8] {
            let mut all: Vec<usize> = Share::all(n).flat_map(|s| s.of(20)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..20).collect::<Vec<_>>());
        }
        assert_eq!("3/8".parse::<Share>().unwrap().to_string(), "3/8");
        assert_eq!("3/8".parse::<Share>().unwrap().of(20).collect::<Vec<_>>(), [2, 10, 18]);
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0"] {
            assert!(wrong.parse::<Share>().is_err(), "{wrong}");
        }
    }
}
