//! What an engineer corrects of what was found: roles and units of columns, start-up and control of a cyclic test, places and quantity of
//! an FRF.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::data::inspect::{Corrected, FoundFile, FoundFrf, FoundHistory, FoundItem, history};
use crate::data::{Control, FrfQuantity, Role};

use super::scaffold::AXES;
use crate::work::Failure;

/// Roles a column of a history may have.
pub const ROLES: [Role; 5] = [Role::Time, Role::Displacement, Role::Velocity, Role::Acceleration, Role::Force];

/// Corrections of one thing in a file; what is not said stays as it was found.
#[derive(Deserialize, Serialize, Debug, Clone, Default)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Name of the file.
    pub file: String,
    /// Which of the things in it, from 0.
    pub item: usize,
    /// Columns by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, ColumnCorrection>,
    /// Cycles of the start-up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_up: Option<u32>,
    /// `displacement` or `force`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control: Option<String>,
    /// `receptance`, `mobility` or `accelerance`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<String>,
    /// Place of the response, `NODE.AXIS`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub respond: Option<String>,
    /// Place of the force, `NODE.AXIS`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excite: Option<String>,
    /// Averages behind the coherence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub averages: Option<u32>,
}

/// Corrections of a column.
#[derive(Deserialize, Serialize, Debug, Clone, Default)]
#[serde(deny_unknown_fields)]
pub struct ColumnCorrection {
    /// A role's word; empty: the column is not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub role: Option<String>,
    /// Unit; empty: not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

impl Correction {
    /// Applies it to what was found.
    ///
    /// # Errors
    /// Files, things and columns that are not there, and words that are none.
    pub fn apply(&self, found: &mut [FoundFile]) -> Result<(), Failure> {
        let file = found.iter_mut().find(|f| super::named(&f.path) == self.file);
        let Some(item) = file.and_then(|f| f.items.get_mut(self.item)) else {
            return Err(self.refused(&format!("there is no thing number {} in the file", self.item), "a file and a thing that were found"));
        };
        match item {
            FoundItem::History(h) => **h = self.of_history(h)?,
            FoundItem::Frf(f) => self.of_frf(f)?,
            FoundItem::Modes(_) | FoundItem::Backbone(_) | FoundItem::Other(_) => {
                return Err(self.refused("nothing of it can be corrected", "a history or an FRF"));
            }
        }
        Ok(())
    }

    fn refused(&self, message: &str, accepted: &str) -> Failure {
        Failure::new("data", &self.file, message, accepted)
    }

    fn of_history(&self, found: &FoundHistory) -> Result<FoundHistory, Failure> {
        let mut columns = found.columns.clone();
        for (name, said) in &self.columns {
            let Some(column) = columns.iter_mut().find(|c| c.column == *name) else { return Err(self.no_column(name)) };
            if let Some(role) = &said.role {
                column.role = self.role(role)?;
                column.guessed = false;
            }
            if let Some(unit) = &said.unit {
                column.unit = stated(unit);
            }
        }
        if !columns.iter().any(|c| c.role == Some(Role::Time)) {
            return Err(self.refused("no column is the time", "a column with the role `time`"));
        }
        let control = self.control.as_ref().map(|w| self.word(w, &Control::WORDS)).transpose()?;
        Ok(history(columns, &Corrected { start_up: self.start_up, control }))
    }

    fn of_frf(&self, frf: &mut FoundFrf) -> Result<(), Failure> {
        for (name, said) in &self.columns {
            let Some(column) = frf.columns.iter_mut().find(|c| c.1 == *name) else { return Err(self.no_column(name)) };
            if let Some(unit) = &said.unit {
                column.2 = stated(unit);
            }
        }
        if let Some(quantity) = &self.quantity {
            frf.quantity = Some(self.word(quantity, &FrfQuantity::WORDS)?);
        }
        frf.respond = self.respond.as_ref().map(|p| self.place(p)).transpose()?.or(frf.respond);
        frf.excite = self.excite.as_ref().map(|p| self.place(p)).transpose()?.or(frf.excite);
        frf.averages = self.averages.or(frf.averages);
        Ok(())
    }

    fn no_column(&self, name: &str) -> Failure {
        self.refused(&format!("there is no column `{name}`"), "a column that was found")
    }

    /// A role that a column of a history may have; empty for none.
    fn role(&self, word: &str) -> Result<Option<Role>, Failure> {
        let words: Vec<(&str, Role)> = ROLES.iter().map(|r| (r.word(), *r)).collect();
        if word.is_empty() { Ok(None) } else { self.word(word, &words).map(Some) }
    }

    /// The meaning of a word.
    fn word<T: Copy>(&self, word: &str, words: &[(&str, T)]) -> Result<T, Failure> {
        let all = || words.iter().map(|w| w.0).collect::<Vec<_>>().join(", ");
        words.iter().find(|w| w.0 == word).map(|w| w.1).ok_or_else(|| self.refused(&format!("`{word}` is none of its words"), &all()))
    }

    /// A place `NODE.AXIS`, along its axis.
    fn place(&self, text: &str) -> Result<(i64, &'static str, bool), Failure> {
        let parts = text.trim().trim_start_matches('n').split_once('.');
        let place = parts.and_then(|(node, axis)| Some((node.parse::<i64>().ok()?, *AXES.iter().find(|a| **a == axis)?, false)));
        let accepted = || format!("NODE.AXIS such as 3.z, the axis one of {}", AXES.join(", "));
        place.filter(|p| p.0 >= 0).ok_or_else(|| self.refused(&format!("`{text}` is no place"), &accepted()))
    }
}

/// A unit as it was typed; empty for none.
fn stated(unit: &str) -> Option<String> {
    Some(unit.trim().to_string()).filter(|u| !u.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::inspect::inspect;
    use std::f64::consts::TAU;
    use std::fmt::Write;

    /// Ten cycles of 1 Hz, the first of them rising.
    fn file() -> (tempfile::TempDir, std::path::PathBuf) {
        let mut text = "t,a,b\n".to_string();
        for k in 0..1000 {
            let t = f64::from(k) / 100.0;
            let p = TAU * t;
            writeln!(text, "{t},{},{}", t.min(1.0) * p.sin(), t.min(1.0) * (20.0 * p.sin() + 3.0 * p.cos())).unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, text.replacen("t,a,b", "time [s],a [mm],b [N]", 1)).unwrap();
        (folder, path)
    }

    #[test]
    fn cycles_are_looked_for_again_under_other_roles_and_start_up() {
        let (_folder, path) = file();
        let mut found = vec![inspect(&path, None).unwrap()];
        let name = |text: &str| {
            let FoundItem::History(h) = &found[0].items[0] else { panic!("no history") };
            h.columns.iter().find(|c| c.column.starts_with(text)).unwrap().column.clone()
        };
        let column = |role: &str| ColumnCorrection { role: Some(role.into()), unit: None };
        let time = name("time");
        let columns = BTreeMap::from([(name("a"), column("displacement")), (name("b"), column("force"))]);
        let said = Correction { file: "a.csv".into(), columns, start_up: Some(4), control: Some("force".into()), ..Correction::default() };
        said.apply(&mut found).unwrap();
        let FoundItem::History(h) = &found[0].items[0] else { panic!("no history") };
        let c = h.cyclic.as_ref().unwrap();
        assert_eq!((c.start_up, c.control, c.recognised, c.settled.cycles), (4, Control::Force, true, c.cycles - 4));
        // More start-up than cycles leaves one.
        Correction { start_up: Some(99), ..said.clone() }.apply(&mut found).unwrap();
        for wrong in [
            Correction { file: "b.csv".into(), ..said.clone() },
            Correction { item: 3, ..said.clone() },
            Correction { control: Some("both".into()), ..said.clone() },
            Correction { columns: BTreeMap::from([("c".into(), column("force"))]), ..said.clone() },
            Correction { columns: BTreeMap::from([(time, column(""))]), ..said },
        ] {
            assert!(wrong.apply(&mut found).is_err(), "{wrong:?}");
        }
    }
}
