//! Tests that a program holds in memory, checked as those of files are. Everything in SI.

use std::path::PathBuf;

use num_complex::Complex64;

use super::channel::along_axis;
use super::sampling::sampling;
use super::{Channel, Conditions, Content, Control, DataError, Frf, FrfQuantity, Note, Record, Role, Test, TimeRecord};
use crate::units::{Dimension, Unit};

impl Channel {
    /// Samples of displacement, velocity, acceleration or force at a place such as `c1.x` [SI].
    pub fn new(role: Role, at: &str, values: Vec<f64>) -> Channel {
        let dimension = along_axis(role.dimensions(), Some(at)).first().copied().unwrap_or(Dimension::DIMENSIONLESS);
        Channel { role, at: at.into(), unit: Unit::si(dimension), sigma: None, input: false, values }
    }

    /// The same with the standard deviation of one sample [SI]; without it, that of a cycle test follows from the scatter of its cycles.
    pub fn with_sigma(mut self, sigma: f64) -> Channel {
        self.sigma = Some(sigma);
        self
    }

    /// The same as the one that drives the test, where several have the controlled role.
    pub fn drives(mut self) -> Channel {
        self.input = true;
        self
    }
}

impl Test {
    /// A test without conditions.
    pub fn new(id: &str, record: Record) -> Test {
        Test { id: id.into(), description: None, conditions: Conditions::new(), supports: None, record, line: 0 }
    }

    /// A periodic test: `time` [s] and the channels, one of which has the controlled role.
    ///
    /// # Errors
    /// Channels that are shorter or longer than `time`, or not finite; time that does not rise; no controlled channel, or none that answers; a
    /// record that has no whole cycle.
    pub fn cycle(id: &str, control: Control, time: Vec<f64>, channels: Vec<Channel>) -> Result<Test, DataError> {
        let record = record(id, control, time, channels)?;
        record.settled()?;
        Ok(Test::new(id, Record::Cycle(record)))
    }

    /// A test that is computed from its first sample to its last: `time` [s], in equal steps, and the channels, one of which has the controlled role.
    ///
    /// # Errors
    /// As [`Test::cycle`]; samples at unlike times.
    pub fn transient(id: &str, control: Control, time: Vec<f64>, channels: Vec<Channel>) -> Result<Test, DataError> {
        let mut record = record(id, control, time, channels)?;
        let found = sampling(&record.time);
        if let Some((at, message)) = found.uneven() {
            return Err(refuse(id, Some(at), None, message, "samples at equal times"));
        }
        let (time, said) = found.placed(&record.time);
        record.time = time;
        record.notes.extend(said.map(|text| Note::new("time", text)));
        Ok(Test::new(id, Record::Transient(record)))
    }

    /// A frequency response H = response / force, e^{+i omega t}: `frequency` [Hz], `measured` in SI, `sigma` the standard deviation of each line's
    /// real part, and of its imaginary part.
    ///
    /// # Errors
    /// Columns of unlike length, frequencies that do not rise from above 0 Hz, numbers that are not finite, a sigma that is not above 0.
    pub fn frf(
        id: &str,
        excite: &str,
        respond: &str,
        quantity: FrfQuantity,
        frequency: Vec<f64>,
        measured: Vec<Complex64>,
        sigma: Vec<f64>,
    ) -> Result<Test, DataError> {
        if measured.len() != frequency.len() || sigma.len() != frequency.len() {
            let message = format!("{} frequencies, {} values, {} deviations", frequency.len(), measured.len(), sigma.len());
            return Err(refuse(id, None, None, message, "as many of each"));
        }
        rising(id, "frequency", &frequency)?;
        if frequency.first().is_none_or(|f| *f <= 0.0) {
            return Err(refuse(id, Some(0), None, "no frequency, or one that is not above 0 Hz".into(), "frequencies above 0 Hz"));
        }
        if let Some(k) = measured.iter().zip(&sigma).position(|(h, s)| !(h.is_finite() && s.is_finite() && *s > 0.0)) {
            let message = format!("H is {} with a deviation of {}", measured[k], sigma[k]);
            return Err(refuse(id, Some(k), None, message, "finite numbers, and a deviation above 0"));
        }
        let frf = Frf::new(id, excite, respond, quantity, frequency, measured, sigma);
        Ok(Test::new(id, Record::Frf(Box::new(frf))))
    }
}

/// A record whose channels are as long as its time and of which one drives.
fn record(id: &str, control: Control, time: Vec<f64>, mut channels: Vec<Channel>) -> Result<TimeRecord, DataError> {
    rising(id, "time", &time)?;
    for c in &channels {
        if c.values.len() != time.len() {
            let message = format!("{} samples at {} times", c.values.len(), time.len());
            return Err(refuse(id, None, Some(c.label()), message, "a sample for every time"));
        }
        if let Some(k) = c.values.iter().position(|v| !v.is_finite()) {
            return Err(refuse(id, Some(k), Some(c.label()), format!("a value of {}", c.values[k]), "finite numbers"));
        }
        if c.sigma.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err(refuse(id, None, Some(c.label()), "a sigma that is not above 0".into(), "a deviation above 0"));
        }
    }
    let role = control.role();
    if !channels.iter().any(|c| c.input) {
        let mut controlled: Vec<&mut Channel> = channels.iter_mut().filter(|c| c.role == role).collect();
        match controlled.as_mut_slice() {
            [only] => only.input = true,
            all => {
                let message = format!("{} channels of role {}, of which none drives", all.len(), role.word());
                return Err(refuse(id, None, None, message, "one channel of that role, or `drives` on one of them"));
            }
        }
    }
    if let Some(odd) = channels.iter().find(|c| c.input && c.role != role) {
        let message = format!("it drives, and control is {}", role.word());
        return Err(refuse(id, None, Some(odd.label()), message, "`drives` on a channel of the controlled role"));
    }
    let record = TimeRecord::new(id, PathBuf::new(), control, None, time, channels);
    if record.channels.iter().any(|c| !c.input) {
        Ok(record)
    } else {
        Err(refuse(id, None, None, "no channel answers".into(), "a force under displacement control, a displacement under force control"))
    }
}

fn rising(id: &str, what: &str, values: &[f64]) -> Result<(), DataError> {
    match values.windows(2).position(|w| !(w[0].is_finite() && w[1].is_finite() && w[1] > w[0])) {
        None => Ok(()),
        Some(k) => {
            let message = format!("the {what} does not rise: {} after {}", values[k + 1], values[k]);
            Err(refuse(id, Some(k + 1), None, message, "finite numbers, each above the one before"))
        }
    }
}

fn refuse(test: &str, sample: Option<usize>, channel: Option<String>, message: String, accepted: &str) -> DataError {
    let row = sample.map(|k| format!("sample {k}"));
    Content { file: PathBuf::from("arrays"), row, test: test.into(), channel, message, accepted: accepted.into() }.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::Explain;

    fn wave(n: usize) -> (Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..n).map(|k| k as f64 / 100.0).collect();
        let x = t.iter().map(|t| (std::f64::consts::TAU * t).sin()).collect();
        (t, x)
    }

    fn channels(x: &[f64]) -> Vec<Channel> {
        vec![Channel::new(Role::Displacement, "c1.x", x.to_vec()), Channel::new(Role::Force, "c1.x", x.to_vec())]
    }

    #[test]
    fn a_loop_of_arrays_settles_and_the_controlled_channel_drives() {
        let (t, x) = wave(400);
        let test = Test::cycle("loop", Control::Displacement, t.clone(), channels(&x)).unwrap();
        let Record::Cycle(record) = &test.record else { panic!() };
        assert_eq!(record.controlled().map(|c| c.role), Some(Role::Displacement));
        assert!((record.settled().unwrap().frequency - 1.0).abs() < 1e-6);
        assert!(Test::transient("all", Control::Force, t, channels(&x)).is_ok());
    }

    #[test]
    fn what_is_wrong_with_arrays_is_said_where_it_stands() {
        let (t, x) = wave(400);
        let cycle = |time: &[f64], channels| Test::cycle("loop", Control::Displacement, time.to_vec(), channels).unwrap_err();
        assert!(cycle(&t[1..], channels(&x)).to_string().contains("400 samples at 399 times"));
        let mut bad = x.clone();
        bad[7] = f64::NAN;
        let e = cycle(&t, channels(&bad));
        assert!(e.place().contains("sample 7") && e.to_string().contains("NaN"), "{}: {e}", e.place());
        let mut back = t.clone();
        back[9] = back[8];
        assert!(cycle(&back, channels(&x)).place().contains("sample 9"));
        assert!(cycle(&t, channels(&x)[1..].to_vec()).to_string().contains("0 channels of role displacement"));
        assert!(cycle(&t, channels(&x)[..1].to_vec()).to_string().contains("no channel answers"));
        assert!(cycle(&t[..40], channels(&x[..40])).stage() == "data");
        let mut gap = t.clone();
        gap[200..].iter_mut().for_each(|t| *t += 0.5);
        let e = Test::transient("all", Control::Force, gap, channels(&x)).unwrap_err();
        assert!(e.place().contains("sample 200") && e.to_string().contains("not sampled uniformly"), "{e}");
    }

    #[test]
    fn lines_of_an_frf() {
        let h = vec![Complex64::new(1.0, -1.0); 3];
        let frf = |f: Vec<f64>, s: Vec<f64>| Test::frf("a", "m.x", "m.x", FrfQuantity::Accelerance, f, h.clone(), s);
        let Record::Frf(made) = frf(vec![1.0, 2.0, 3.0], vec![0.1; 3]).unwrap().record else { panic!() };
        let omega = std::f64::consts::TAU * 2.0;
        assert!((made.receptance[1] + h[1] / (omega * omega)).norm() < 1e-15 && made.unit.symbol == "m/s2/N", "{}", made.unit.symbol);
        for (f, s, said) in [
            (vec![1.0, 2.0], vec![0.1; 3], "2 frequencies, 3 values"),
            (vec![1.0, 3.0, 2.0], vec![0.1; 3], "does not rise"),
            (vec![0.0, 1.0, 2.0], vec![0.1; 3], "not above 0 Hz"),
            (vec![1.0, 2.0, 3.0], vec![0.1, 0.0, 0.1], "a deviation of 0"),
        ] {
            let e = frf(f, s).unwrap_err();
            assert!(e.to_string().contains(said), "{e}");
        }
    }
}
