//! Modal parameters for benches/peers/modal.py: reads FRFs as JSON on standard input, {frequency, outputs, inputs, re, im, sigma} (lists by FRF, receptance),
//! prints {modes: [{frequency, frequency_sigma, damping, damping_sigma, shape}], seconds}.

use std::error::Error;
use std::time::Instant;

use misfit::data::modal_fit::{FrfSet, Settings, fit};
use num_complex::Complex64;
use serde_json::{Value, json};

fn list(v: &Value) -> Option<Vec<f64>> {
    v.as_array()?.iter().map(Value::as_f64).collect()
}

fn lists(v: &Value) -> Option<Vec<Vec<f64>>> {
    v.as_array()?.iter().map(list).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    for line in std::io::stdin().lines() {
        let v: Value = serde_json::from_str(&line?)?;
        let read = || {
            let (re, im) = (lists(&v["re"])?, lists(&v["im"])?);
            let h = re.iter().zip(&im).map(|(a, b)| a.iter().zip(b).map(|(a, b)| Complex64::new(*a, *b)).collect()).collect();
            let count = |key: &str| v[key].as_u64().map(|n| n as usize);
            Some(FrfSet {
                frequency: list(&v["frequency"])?,
                outputs: count("outputs")?,
                inputs: count("inputs")?,
                h,
                sigma: lists(&v["sigma"])?,
            })
        };
        let set = read().ok_or("frequency, outputs, inputs, re, im and sigma")?;
        let clock = Instant::now();
        let found = fit(&set, &Settings::default())?;
        let seconds = clock.elapsed().as_secs_f64();
        let mode = |m: &misfit::data::modal_fit::Mode| {
            json!({ "frequency": m.frequency, "frequency_sigma": m.frequency_sigma, "damping": m.damping, "damping_sigma": m.damping_sigma,
                    "shape": m.shape.iter().map(|s| [s.re, s.im]).collect::<Vec<_>>() })
        };
        println!(
            "{}",
            json!({ "modes": found.modes.iter().map(mode).collect::<Vec<_>>(), "chi_squared": found.chi_squared, "seconds": seconds })
        );
    }
    Ok(())
}
