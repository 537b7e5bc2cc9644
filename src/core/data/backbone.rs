//! Tables of natural frequency and damping over amplitude (backbone curves), from decays or steps of a sine; inline rows or a file.

use super::DataError;
use super::channel::{Role, along_axis, place};
use super::dataset::{Source, only};
use super::tables::{TableValue, at_row, rows};
use super::toml_strict::TableView;
use crate::units::{Dimension, Unit};

/// Natural frequency and damping of one mode over the amplitude at a place.
#[derive(Debug, Clone, PartialEq)]
pub struct BackboneTable {
    /// `name.axis` of the amplitude: a displacement.
    pub at: String,
    /// Number of the mode among those that swing at small amplitude, from 1; none: the one nearest to the frequency of the first row.
    pub mode: Option<u32>,
    /// In the order of rising amplitude.
    pub rows: Vec<BackboneRow>,
}

/// The mode at one amplitude. At least one of frequency and damping stands there.
#[derive(Debug, Clone, PartialEq)]
pub struct BackboneRow {
    /// First harmonic (peak) of the displacement at the place [m or rad].
    pub amplitude: f64,
    /// Unit that the amplitude was stated in.
    pub unit: Unit,
    /// Undamped natural frequency [Hz].
    pub frequency: Option<TableValue>,
    /// (Equivalent) damping ratio.
    pub damping: Option<TableValue>,
    /// Line of dataset.toml, or line or row of the file.
    pub place: String,
}

const ROLES: [Role; 3] = [Role::Amplitude, Role::Frequency, Role::Damping];

pub(super) fn backbone(table: &TableView<'_>, id: &str, source: &Source<'_>) -> Result<BackboneTable, DataError> {
    only(table, &["file", "channels", "rows", "noise", "at", "mode"])?;
    let at = place(&table.require("at", "the place of the amplitude, such as \"m1.x\"")?)?;
    let mode = table.optional("mode", |v| v.integer(1, 1_000_000))?.map(|n| n as u32);
    let amplitudes = along_axis(&[Dimension::LENGTH, Dimension::ANGLE], Some(&at));
    let mut found: Vec<BackboneRow> = Vec::new();
    for row in rows(table, id, source, &ROLES, &amplitudes, false)? {
        let fail = |message: String, accepted: &str| at_row(source, id, &row.place, message, accepted);
        let rising = "amplitudes (peak) above 0, each larger than the one before";
        let amplitude = row.number(Role::Amplitude).ok_or_else(|| fail("no amplitude".into(), "amplitude = \"0.1 mm\""))?;
        let shown = amplitude.unit.print(amplitude.value);
        if amplitude.value <= 0.0 {
            return Err(fail(format!("an amplitude of {shown}"), rising));
        }
        if let Some(before) = found.last().filter(|b| b.amplitude >= amplitude.value) {
            return Err(fail(format!("an amplitude of {shown} after one of {}", before.unit.print(before.amplitude)), rising));
        }
        let (frequency, damping) = (row.number(Role::Frequency), row.number(Role::Damping));
        if frequency.is_none() && damping.is_none() {
            return Err(fail("neither frequency nor damping".into(), "frequency = \"35 Hz\", damping = \"0.8 %\", or both"));
        }
        // Both are compared as logarithms: zero and below have none.
        if let Some(v) = [&frequency, &damping].into_iter().flatten().find(|v| v.value <= 0.0) {
            return Err(fail(
                format!("a frequency or damping ratio of {}", v.unit.print(v.value)),
                "frequencies and damping ratios above 0",
            ));
        }
        found.push(BackboneRow { amplitude: amplitude.value, unit: amplitude.unit, frequency, damping, place: row.place.clone() });
    }
    if let (None, Some(first)) = (mode, found.first().filter(|r| r.frequency.is_none())) {
        let accepted = "a frequency in the first row, or mode = 1, 2, ...";
        return Err(at_row(
            source,
            id,
            &first.place,
            "nothing says which mode it is: the smallest amplitude has no frequency".into(),
            accepted,
        ));
    }
    Ok(BackboneTable { at, mode, rows: found })
}

#[cfg(test)]
mod tests {
    use super::super::dataset::tests::Folder;
    use super::super::{Dataset, Record};
    use super::*;
    use crate::explain::Explain;

    fn table(d: &Dataset) -> &BackboneTable {
        let Record::Backbone(table) = &d.tests[0].record else { panic!() };
        table
    }

    const HEAD: &str = "schema = 1\n[[test]]\nid = \"b\"\nkind = \"backbone\"\nat = \"m1.x\"\n";

    #[test]
    fn rows_and_files_with_their_deviations() {
        let d = Folder::new(&format!(
            "{HEAD}rows = [{{ amplitude = \"0.1 mm\", frequency = \"35.1 Hz +- 0.05 Hz\", damping = \"0.8 %\", sigma_damping = \"0.1 %\" }}, {{ amplitude = \"0.3 mm\", damping = 0.02 }}]\n"
        ));
        let d = d.load().unwrap();
        let t = table(&d);
        assert_eq!((t.at.as_str(), t.mode, t.rows.len()), ("m1.x", None, 2));
        assert!((t.rows[1].amplitude - 0.3e-3).abs() < 1e-18 && t.rows[1].frequency.is_none());
        let sigmas = |r: &BackboneRow| [&r.frequency, &r.damping].map(|v| v.as_ref().and_then(|v| v.sigma));
        let [f, z] = sigmas(&t.rows[0]);
        assert!((f.unwrap() - 0.05).abs() < 1e-12 && (z.unwrap() - 1e-3).abs() < 1e-15);
        let channels = "mode = 2\nnoise = \"1 %\"\nfile = \"b.csv\"\nchannels = [{ role = \"amplitude\", column = \"X\", unit = \"um\" }, { role = \"frequency\", column = \"f\", unit = \"Hz\", sigma_column = \"s\" }, { role = \"damping\", column = \"z\", unit = \"%\", sigma = \"0.1 %\" }]\n";
        let d = Folder::new(&format!("{HEAD}{channels}")).with("b.csv", "X,f,s,z\n10,35,0.1,1\n20,34,0.2,2\n").load().unwrap();
        let t = table(&d);
        assert_eq!((t.mode, t.rows[1].place.contains("b.csv")), (Some(2), true));
        assert!((t.rows[1].amplitude - 20e-6).abs() < 1e-18);
        let [f, z] = sigmas(&t.rows[1]);
        assert!((f.unwrap() - 0.2).abs() < 1e-12 && (z.unwrap() - 1e-3).abs() < 1e-15);
    }

    #[test]
    fn what_is_no_backbone_names_its_row() {
        let of = |more: &str| {
            let e = Folder::new(&format!("{HEAD}{more}")).load().unwrap_err();
            (format!("{}: {e}", e.place()), e.accepted())
        };
        let row = |a: &str, rest: &str| format!("{{ amplitude = \"{a}\"{rest} }}");
        let f = ", frequency = \"3 Hz\"";
        for (rows, says) in [
            (vec![row("0 mm", f)], "an amplitude of 0 mm"),
            (vec![row("-1 mm", f)], "an amplitude of -1 mm"),
            (vec![row("2 mm", f), row("1 mm", f)], "an amplitude of 1 mm after one of 2 mm"),
            (vec![row("2 mm", f), row("2 mm", f)], "after one of 2 mm"),
            (vec![row("2 mm", "")], "neither frequency nor damping"),
            (vec![row("2 mm", ", damping = 0.1")], "nothing says which mode"),
            (vec![row("2 mm", ", frequency = \"0 Hz\"")], "a frequency or damping ratio of 0 Hz"),
            (vec![row("2 N", f)], "N"),
        ] {
            let (message, accepted) = of(&format!("rows = [{}]\n", rows.join(", ")));
            assert!(message.contains(says) && message.contains("line") && !accepted.is_empty(), "{message}; {accepted}");
        }
        assert!(of("mode = 0\nrows = []\n").0.contains("mode"));
        let angle = HEAD.replace("m1.x", "m1.psi");
        assert!(Folder::new(&format!("{angle}rows = [{}]\n", row("1 deg", f))).load().is_ok());
    }
}
