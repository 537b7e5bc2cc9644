//! Whether the samples of a record stand at equal times, up to the rounding of the time stamps.

/// How a record is sampled.
#[derive(Debug, Clone, PartialEq)]
pub enum Sampling {
    /// At equal times.
    Uniform,
    /// At equal times, with stamps written to a multiple of this many seconds: the times that were rounded.
    Rounded { quantum: f64, time: Vec<f64> },
    /// At times that lie up to this part of a step from equal ones, s / s.
    Jittered { part: f64 },
    /// At unlike times: the sample after the step that is furthest from the usual one, that step, and the usual one, s.
    Uneven { at: usize, step: f64, usual: f64 },
}

/// Distance of a stamp from its place, in steps, at which nothing is to be said: a phase of 0.0001 of a turn at ten samples a cycle.
const EXACT: f64 = 1e-3;
/// Distance of a stamp from its place, in steps, at which a record still counts as uniform.
const JITTER: f64 = 0.05;
/// Distance of a rounded stamp from its place, in units of the last digit: half of one, and a little for the line through the stamps.
const ROUNDING: f64 = 0.6;
/// Digits after the point at most that stamps are looked at for.
const DIGITS: i32 = 9;

impl Sampling {
    /// Samples at unlike times: which one shows it, and how.
    pub fn uneven(&self) -> Option<(usize, String)> {
        match self {
            Self::Uneven { at, step, usual } => {
                Some((*at, format!("not sampled uniformly: a step of {step:.3e} s, where most are {usual:.3e} s")))
            }
            _ => None,
        }
    }

    /// The times to be used for these stamps, and what is to be said of it.
    pub fn placed(self, stamps: &[f64]) -> (Vec<f64>, Option<String>) {
        let rate = |time: &[f64]| (time.len() - 1) as f64 / (time[time.len() - 1] - time[0]);
        match self {
            Self::Rounded { quantum, time } => {
                let said = format!("stamps rounded to {quantum} s; taken as sampled uniformly at {:.6} Hz", rate(&time));
                (time, Some(said))
            }
            Self::Jittered { part } => {
                let said = format!("samples lie up to {:.1} % of a step from equal times", 100.0 * part);
                (stamps.to_vec(), Some(format!("{said}; taken as sampled uniformly at {:.6} Hz", rate(stamps))))
            }
            Self::Uniform | Self::Uneven { .. } => (stamps.to_vec(), None),
        }
    }
}

/// How these times, strictly increasing, are spaced.
pub fn sampling(time: &[f64]) -> Sampling {
    let n = time.len();
    if n < 3 {
        return Sampling::Uniform;
    }
    // The line through all stamps: those at the ends are rounded, or late, too.
    let middle = (n - 1) as f64 / 2.0;
    let mean = time.iter().map(|t| t - time[0]).sum::<f64>() / n as f64 + time[0];
    let (along, square) = time.iter().enumerate().fold((0.0, 0.0), |(a, s), (i, t)| {
        let place = i as f64 - middle;
        (a + place * (t - mean), s + place * place)
    });
    let step = along / square;
    let start = mean - middle * step;
    let worst = time.iter().enumerate().map(|(i, t)| (t - start - step * i as f64).abs()).fold(0.0, f64::max);
    if worst <= EXACT * step {
        return Sampling::Uniform;
    }
    if let Some(quantum) = quantum(time).filter(|q| *q < step && worst <= ROUNDING * q) {
        return Sampling::Rounded { quantum, time: (0..n).map(|i| start + step * i as f64).collect() };
    }
    if worst <= JITTER * step {
        return Sampling::Jittered { part: worst / step };
    }
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    let off = |usual: f64| steps.iter().map(|s| (s / usual).ln().abs()).enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |m| m.0);
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let k = off(usual);
    Sampling::Uneven { at: k + 1, step: steps.swap_remove(k), usual }
}

/// The coarsest power of ten that all stamps are multiples of.
fn quantum(time: &[f64]) -> Option<f64> {
    (0..=DIGITS).map(|k| 10f64.powi(-k)).find(|q| {
        time.iter().all(|t| {
            let multiple = t / q;
            (multiple - multiple.round()).abs() < 1e-4
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamps(rate: f64, n: usize, digits: usize) -> Vec<f64> {
        (0..n).map(|i| format!("{:.digits$}", 3.7 + i as f64 / rate).parse().unwrap()).collect()
    }

    #[test]
    fn rounded_stamps_are_uniform_and_give_the_rate_back() {
        let Sampling::Rounded { quantum, time } = sampling(&stamps(3004.8, 6000, 4)) else { panic!("rounded") };
        assert_eq!(quantum, 1e-4);
        let rate = 5999.0 / (time[5999] - time[0]);
        assert!((rate / 3004.8 - 1.0).abs() < 1e-7, "{rate}");
        assert!(time.iter().enumerate().all(|(i, t)| (t - 3.7 - i as f64 / 3004.8).abs() < 1e-5));
        assert_eq!(sampling(&stamps(3004.8, 6000, 7)), Sampling::Uniform);
        // Five decimals lie within a twentieth of a step of their places, and are rounded all the same.
        for digits in [4, 5, 6] {
            let Sampling::Rounded { quantum, time } = sampling(&stamps(3004.8, 6000, digits)) else { panic!("{digits}") };
            assert_eq!(quantum, 10f64.powi(-(digits as i32)));
            assert!(time.iter().enumerate().all(|(i, t)| (t - 3.7 - i as f64 / 3004.8).abs() < 1e-5));
        }
    }

    #[test]
    fn a_gap_is_no_rounding_and_is_named() {
        let mut time = stamps(3004.8, 6000, 4);
        time.iter_mut().skip(2500).for_each(|t| *t += 0.01);
        let Sampling::Uneven { at, step, usual } = sampling(&time) else { panic!("uneven") };
        assert!(at == 2500 && (step - 0.0103).abs() < 2e-4 && (usual - 3.33e-4).abs() < 1e-4, "{at} {step} {usual}");
        // Jitter of a twenty-fifth of a step stays, and is said; that of a fifth, in stamps of nine digits, is another sampling.
        let jitter = |part: f64| (0..500).map(|i| 1e-3 * (i as f64 + part * (7.0 * i as f64).sin())).collect::<Vec<f64>>();
        let Sampling::Jittered { part } = sampling(&jitter(0.04)) else { panic!("jittered") };
        assert!((part - 0.04).abs() < 1e-3, "{part}");
        let (time, said) = sampling(&jitter(0.04)).placed(&jitter(0.04));
        assert!(time == jitter(0.04) && said.unwrap().contains("% of a step from equal times"));
        assert!(matches!(sampling(&jitter(0.2)), Sampling::Uneven { .. }));
    }
}
