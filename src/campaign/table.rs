//! One table of all results: a row a task, in the order of the list, a column for what it differs in and for every number that the verb printed.
//!
//! Of a result are taken: numbers, words and truths at its top; of lists of parameters, tests, predictions, cases and the like a column for each number, by the
//! name of the item (`parameters.c1.x.viscous.c.value`); of lists of effects their names. Wall times and folders are left out: the table of a campaign
//! that was killed and resumed is that of an undisturbed one.

use std::path::Path;

use polars::prelude::{Column, DataFrame};
use serde_json::Value;

use crate::data::written;

use super::task::whole;
use super::{CampaignError, Record, Task};

/// A cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Nothing.
    None,
    /// A number [SI].
    Number(f64),
    /// A word.
    Text(String),
    /// A truth.
    Bool(bool),
}

impl Cell {
    /// As it is shown.
    pub fn shown(&self) -> String {
        match self {
            Cell::None => "-".into(),
            Cell::Number(v) => format!("{v:.6}").trim_end_matches('0').trim_end_matches('.').to_string(),
            Cell::Text(t) => t.clone(),
            Cell::Bool(b) => b.to_string(),
        }
    }
}

/// Columns by name, each with a cell a task.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    rows: usize,
    /// Name and cells, in the order in which they were first seen.
    pub all: Vec<(String, Vec<Cell>)>,
    places: std::collections::HashMap<String, usize>,
}

/// Keys that say where and how long, not what.
const ASIDE: [&str; 7] = ["wall_s", "run", "result_study", "folder", "score_s", "refits_s", "file"];
/// Keys that name an item of a list, alone or together.
const NAMES: [&[&str]; 5] = [&["case", "quantity"], &["tolerance", "quantity"], &["name"], &["id"], &["tolerance"]];
/// Most columns.
const MOST: usize = 5000;

impl Columns {
    /// The columns of a campaign; a task without record has its own columns alone.
    pub fn new(tasks: &[Task], records: &[Option<Record>]) -> Columns {
        let mut columns = Columns { rows: tasks.len(), ..Columns::default() };
        for (row, (task, record)) in tasks.iter().zip(records).enumerate() {
            columns.put(row, "task", Cell::Text(task.label.clone()));
            columns.put(row, "id", Cell::Text(task.id.clone()));
            task.axes.iter().for_each(|(k, v)| columns.put(row, k, Cell::Text(v.clone())));
            columns.put(row, "seed", Cell::Number(task.seed as f64));
            let done = record.as_ref().filter(|r| r.reason.is_none());
            columns.put(row, "done", Cell::Bool(done.is_some()));
            columns.put(row, "reason", record.as_ref().and_then(|r| r.reason.clone()).map_or(Cell::None, Cell::Text));
            if let Some(record) = done {
                columns.object(row, "", &record.result);
            }
        }
        columns
    }

    fn put(&mut self, row: usize, name: &str, cell: Cell) {
        let known = self.places.get(name).copied();
        let place = known.unwrap_or_else(|| {
            self.all.push((name.to_string(), vec![Cell::None; self.rows]));
            self.places.insert(name.to_string(), self.all.len() - 1);
            self.all.len() - 1
        });
        // The campaign's own columns go before those of a result.
        if self.all[place].1[row] == Cell::None {
            self.all[place].1[row] = cell;
        }
    }

    fn object(&mut self, row: usize, prefix: &str, value: &Value) {
        for (key, value) in value.as_object().into_iter().flatten().filter(|(k, _)| !ASIDE.contains(&k.as_str())) {
            if self.all.len() > MOST {
                return;
            }
            let name = format!("{prefix}{key}");
            match value {
                Value::Number(n) => self.put(row, &name, n.as_f64().map_or(Cell::None, Cell::Number)),
                Value::String(s) => self.put(row, &name, Cell::Text(s.clone())),
                Value::Bool(b) => self.put(row, &name, Cell::Bool(*b)),
                Value::Array(items) => self.list(row, &name, items),
                // One level down: the fit beside predictions, held-out errors.
                Value::Object(_) if prefix.is_empty() => self.object(row, &format!("{name}."), value),
                _ => {}
            }
        }
    }

    fn list(&mut self, row: usize, name: &str, items: &[Value]) {
        let text = |v: &Value, key: &str| v.get(key).and_then(Value::as_str).map(str::to_string);
        // Effects at places, whatever stands beside them.
        let effects: Vec<String> = items.iter().filter_map(|i| Some(format!("{} at {}", text(i, "effect")?, text(i, "at")?))).collect();
        if !items.is_empty() && effects.len() == items.len() && items.len() < 20 {
            self.put(row, name, Cell::Text(effects.join(", ")));
            return;
        }
        for item in items {
            let named = NAMES.iter().find_map(|keys| keys.iter().map(|k| text(item, k)).collect::<Option<Vec<_>>>());
            let Some(named) = named else { continue };
            let own = format!("{name}.{}", named.join("."));
            for (key, value) in item.as_object().into_iter().flatten() {
                match value {
                    Value::Number(n) => self.put(row, &format!("{own}.{key}"), n.as_f64().map_or(Cell::None, Cell::Number)),
                    Value::Bool(b) => self.put(row, &format!("{own}.{key}"), Cell::Bool(*b)),
                    _ => {}
                }
            }
        }
    }

    /// Columns in which the tasks differ, without those of the campaign itself.
    pub fn differing(&self) -> impl Iterator<Item = &(String, Vec<Cell>)> {
        self.all.iter().filter(|(name, cells)| name != "id" && cells.windows(2).any(|w| w[0] != w[1]))
    }

    /// Writes the columns as a Parquet file, whole.
    pub fn write(&self, path: &Path) -> Result<(), CampaignError> {
        let fail = |e: polars::error::PolarsError| CampaignError::file(path, e);
        let column = |(name, cells): &(String, Vec<Cell>)| {
            let numbers = cells.iter().all(|c| matches!(c, Cell::Number(_) | Cell::None)) && cells.iter().any(|c| *c != Cell::None);
            let truths = cells.iter().all(|c| matches!(c, Cell::Bool(_) | Cell::None)) && cells.iter().any(|c| *c != Cell::None);
            let name = name.as_str().into();
            if numbers {
                Column::new(name, cells.iter().map(|c| if let Cell::Number(v) = c { Some(*v) } else { None }).collect::<Vec<_>>())
            } else if truths {
                Column::new(name, cells.iter().map(|c| if let Cell::Bool(b) = c { Some(*b) } else { None }).collect::<Vec<_>>())
            } else {
                let text = |c: &Cell| if *c == Cell::None { None } else { Some(c.shown()) };
                Column::new(name, cells.iter().map(text).collect::<Vec<_>>())
            }
        };
        let table = DataFrame::new(self.rows, self.all.iter().map(column).collect()).map_err(fail)?;
        whole(path, &written::parquet(table).map_err(fail)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_of_a_result_become_columns_and_wall_times_do_not() {
        let task = |label: &str| Task {
            id: label.into(),
            label: label.into(),
            verb: "fit".into(),
            study: None,
            seed: 1,
            axes: vec![("seed".into(), "1".into())],
            set: vec![],
            arguments: vec![],
            part: Default::default(),
        };
        let result = json!({ "cost": 2.5, "wall_s": 9.0, "termination": "converged", "parameters": [{ "name": "c1.x.viscous.c", "value": 3.0, "std": null }],
                             "missing": [{ "effect": "coulomb", "at": "c1.x" }], "fit": { "cost": 1.0 },
                             "cases": [{ "case": "1", "quantity": "W_D", "mean": 0.1 }] });
        let record = |id: &str, reason: Option<&str>| {
            Some(Record { id: id.into(), reason: reason.map(str::to_string), attempts: 1, wall_s: 1.0, result: result.clone() })
        };
        let columns = Columns::new(&[task("a"), task("b")], &[record("a", None), record("b", Some("it broke"))]);
        let cell = |name: &str, row: usize| columns.all.iter().find(|c| c.0 == name).map(|c| c.1[row].clone());
        assert_eq!(cell("cost", 0), Some(Cell::Number(2.5)));
        assert_eq!(cell("cost", 1), Some(Cell::None));
        assert_eq!(cell("reason", 1), Some(Cell::Text("it broke".into())));
        assert_eq!(cell("parameters.c1.x.viscous.c.value", 0), Some(Cell::Number(3.0)));
        assert_eq!(cell("missing", 0), Some(Cell::Text("coulomb at c1.x".into())));
        assert_eq!(cell("fit.cost", 0), Some(Cell::Number(1.0)));
        assert_eq!(cell("cases.1.W_D.mean", 0), Some(Cell::Number(0.1)));
        assert_eq!(cell("wall_s", 0), None);
        let differing: Vec<&str> = columns.differing().map(|c| c.0.as_str()).collect();
        assert!(differing.contains(&"done") && !differing.contains(&"seed"), "{differing:?}");
    }
}
