//! What the instruments of a case write down.

use super::super::bench::{Bench, Drive, Flaw, Planted, Response, Test};
use super::super::draw::Draw;
use super::super::generate::Generated;

/// The record of test `at` with its noise, and the true standard deviation of that noise by sample.
pub fn measure(case: &mut Generated, at: usize) -> Response {
    let flaws: Vec<Flaw> = case.nuisances.iter().chain(&case.instrument).cloned().collect();
    let test = case.tests[at].clone();
    let Some(life) = case.life.clone() else {
        let mut r = case.bench.read(&case.bench.params, &case.planted, &flaws, &case.tests, &test);
        for (c, s) in r.channels.iter_mut().zip(&r.sigma) {
            c.iter_mut().zip(s).for_each(|(c, s)| *c += s * case.draw.normal());
        }
        return r;
    };
    let Some(own) = life.tests.get(at).cloned() else { return Response { channels: vec![], sigma: vec![] } };
    let bench = Bench { parts: life.parts.clone(), ..case.bench.clone() };
    let params: Vec<f64> = bench.params.iter().zip(&own.params).map(|(p, f)| p * f).collect();
    let there: Vec<Planted> = case.planted.iter().chain(&life.quirks).cloned().collect();
    let there: Vec<Planted> = there.into_iter().zip(&own.effects).map(|(p, f)| Planted { size: p.size * f, ..p }).collect();
    let mut r = bench.read(&params, &there, &flaws, &case.tests, &test);
    let frf = matches!(test.drive, Drive::Frf { .. });
    let draw = &mut case.draw;
    for (k, c) in r.channels.iter_mut().enumerate() {
        if own.cycles > 0.0 {
            let wander = walk(draw, c.len(), (-1.0 / test.record.samples as f64).exp());
            c.iter_mut().zip(wander).for_each(|(c, w)| *c *= 1.0 + own.cycles * w);
        }
        if let (false, Some([square, cube]), Some(full)) = (frf, life.sensors.get(k), life.full.get(k)) {
            c.iter_mut().for_each(|c| *c += full * (square * (*c / full).powi(2) + cube * (*c / full).powi(3)));
        }
        // Real and imaginary part of a frequency response come from one channel.
        let gain = own.gains.get(if frf { 0 } else { k }).copied().unwrap_or(1.0);
        c.iter_mut().for_each(|c| *c *= gain);
    }
    for (c, s) in r.channels.iter_mut().zip(&r.sigma) {
        let fast = walk(draw, c.len(), own.correlation);
        let slow = if own.slow > 0.0 { walk(draw, c.len(), slow_correlation(&test)) } else { vec![0.0; c.len()] };
        let part = (1.0 - own.slow * own.slow).sqrt();
        let noise = fast.iter().zip(&slow).map(|(f, w)| part * f + own.slow * w);
        c.iter_mut().zip(s).zip(noise).for_each(|((c, s), e)| *c += s * e);
    }
    r
}

fn slow_correlation(test: &Test) -> f64 {
    (-1.0 / (super::SETTINGS.slow_cycles * test.record.samples as f64)).exp()
}

/// Normal values of variance 1 in a row, neighbours correlated by `rho`: AR(1) from its stationary state.
fn walk(draw: &mut Draw, n: usize, rho: f64) -> Vec<f64> {
    let mut z = draw.normal();
    (0..n)
        .map(|_| {
            let now = z;
            z = rho * z + (1.0 - rho * rho).sqrt() * draw.normal();
            now
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_has_variance_one_and_the_correlation_asked_for() {
        let z = walk(&mut Draw::new(1, 0), 200_000, 0.9);
        let power: f64 = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
        let lagged: f64 = z.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / z.len() as f64;
        // Standard error of the variance of 200,000 values at 0.9: sqrt(2 (1 + 0.81) / (1 - 0.81) / n) = 0.01.
        assert!((power - 1.0).abs() < 0.03 && (lagged / power - 0.9).abs() < 0.005, "{power} {lagged}");
    }
}
