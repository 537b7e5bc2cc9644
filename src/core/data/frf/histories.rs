//! FRF tests given as histories of force and response: `estimate = { method = "H1", window = "hann", block = "2 s", overlap = 0.5 }`.

use super::{Excited, Frf, floor};
use crate::data::channel::{ChannelSpec, Role, channels};
use crate::data::dataset::{Source, columns, no_channel};
use crate::data::frf_estimate::{Estimator, Excitation, Request, estimate};
use crate::data::readers::Column;
use crate::data::record::{content, increasing, to_si, window as kept_samples};
use crate::data::sampling::sampling;
use crate::data::toml_strict::TableView;
use crate::data::{DataError, FrfQuantity, Note};
use crate::units::{Dimension, Unit};
use num_complex::Complex64;
use std::f64::consts::TAU;

const ROLES: [Role; 5] = [Role::Time, Role::Displacement, Role::Velocity, Role::Acceleration, Role::Force];

#[derive(Clone, Copy, PartialEq)]
enum Window {
    Hann,
    None,
    Hammer,
}

const WINDOWS: [(&str, Window); 3] = [("hann", Window::Hann), ("none", Window::None), ("hammer", Window::Hammer)];

pub(super) fn read(table: &TableView<'_>, id: &str, source: &Source<'_>, excited: Excited) -> Result<Frf, DataError> {
    let how = table.require("estimate", "{ method = \"H1\", window = \"hann\", block = \"2 s\" }")?.table()?;
    how.only(&["method", "window", "block", "overlap", "overload_force", "overload_response"])?;
    let estimator = how.optional("method", |v| v.word("method", &Estimator::WORDS))?.unwrap_or(Estimator::H1);
    let window = how.optional("window", |v| v.word("window", &WINDOWS))?.unwrap_or(Window::Hann);
    let seconds = how.quantity("block", Dimension::TIME)?.value;
    let overlap = how.optional("overlap", |v| match v.number()? {
        o if (0.0..=0.9).contains(&o) => Ok(o),
        o => Err(v.refuse(format!("an overlap of {o}"), "0 to 0.9")),
    })?;
    let specs = channels(table, &ROLES, &[])?;
    let response_of = |s: &&ChannelSpec| {
        matches!(s.role, Role::Displacement | Role::Velocity | Role::Acceleration) && s.at.as_deref() == Some(&excited.respond)
    };
    let force_of = |s: &&ChannelSpec| s.role == Role::Force && s.at.as_deref() == Some(&excited.excite);
    let position = |f: &dyn Fn(&&ChannelSpec) -> bool, what: String| {
        specs.iter().position(|s| f(&s)).ok_or_else(|| DataError::from(no_channel(table, &what)))
    };
    let time = position(&|s| s.role == Role::Time, "role = \"time\"".into())?;
    let force = position(&force_of, format!("role = \"force\" at {}", excited.excite))?;
    let response = position(&response_of, format!("role = \"displacement\", \"velocity\" or \"acceleration\" at {}", excited.respond))?;
    let level = |key: &str, spec: &ChannelSpec| how.optional(key, |v| v.quantity(spec.unit.dimension).map(|q| q.value));
    let overload = (level("overload_force", &specs[force])?, level("overload_response", &specs[response])?);

    let file = source.file(table, id)?;
    let recorded: Vec<ChannelSpec> = specs.iter().filter(|s| s.reading.rate.is_none()).cloned().collect();
    let mut rows = columns(table, id, &file, &recorded)?;
    let n = rows.len();
    let mut values = Vec::with_capacity(specs.len());
    for (column, spec) in std::mem::take(&mut rows.columns).into_iter().zip(&recorded) {
        let Column::Numbers(mut column) = column else { continue };
        to_si(&file, &rows, id, spec, &mut column)?;
        values.push(column);
    }
    if let Some(clock) = specs[time].reading.clock(n) {
        values.insert(time, clock);
    }
    increasing(&file, &rows, id, &specs[time], &values[time])?;
    let mut treated: Vec<Note> = specs.iter().filter_map(|s| s.reading.note(&s.label(), &s.unit)).collect();
    let kept = kept_samples(&file, id, &specs[time], &values[time], &mut treated)?;
    for (spec, column) in specs.iter().zip(&mut values) {
        *column = column[kept.clone()].to_vec();
        if spec.reading.centre {
            let mean = column.iter().sum::<f64>() / column.len() as f64;
            column.iter_mut().for_each(|v| *v -= mean);
            treated.push(Note::new(spec.label(), format!("centred: its mean of {} was taken off", spec.unit.print_difference(mean))));
        }
    }
    let found = sampling(&values[time]);
    if let Some((at, message)) = found.uneven() {
        return Err(content(
            &file,
            Some(rows.place(kept.start + at)),
            id,
            &specs[time],
            &message,
            "a record sampled uniformly, whose time may be rounded",
        ));
    }
    let (t, said) = found.placed(&values[time]);
    treated.extend(said.map(|text| Note::new("time", text)));
    let dt = (t[t.len() - 1] - t[0]) / (t.len().max(2) - 1) as f64;
    let excitation = match window {
        Window::Hann => Excitation::Random { overlap: overlap.unwrap_or(0.5) },
        Window::None => Excitation::Periodic,
        // Without an exponential window nothing has to be taken off the damping.
        Window::Hammer => Excitation::Hammer { decay: 0.0 },
    };
    let request = Request { estimator, excitation, block: (seconds / dt).round() as usize, overload };
    let found = estimate(dt, &values[force], &values[response], &request)
        .map_err(|e| content(&file, None, id, &specs[response], &e.to_string(), e.accepted()))?;
    let own = match specs[response].role {
        Role::Displacement => FrfQuantity::Receptance,
        Role::Velocity => FrfQuantity::Mobility,
        _ => FrfQuantity::Accelerance,
    };
    let turn = |f: f64| Complex64::new(0.0, TAU * f).powi(excited.quantity.derivatives() - own.derivatives());
    let measured: Vec<Complex64> = found.frequency.iter().zip(&found.h).map(|(f, h)| h * turn(*f)).collect();
    let mut sigma: Vec<f64> = found.frequency.iter().zip(&found.sigma).map(|(f, s)| s * turn(*f).norm()).collect();
    let mut notes = found.notes;
    notes.extend(treated);
    notes.push(Note::new("estimate", format!("{} blocks averaged, worth {:.1} independent ones", found.blocks, found.independent)));
    floor(&measured, &mut sigma, &mut notes);
    let motion = specs[response].unit.dimension.over(Dimension::TIME.power((excited.quantity.derivatives() - own.derivatives()) as i8));
    let unit = Unit::si(motion.over(specs[force].unit.dimension));
    Ok(excited.frf(id, file, unit, found.frequency, measured, sigma, Some(found.coherence), notes))
}
