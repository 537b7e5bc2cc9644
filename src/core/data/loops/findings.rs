//! What a record of a cyclic test shows of the rig: control, gaps, clipping, signs, delays. Nothing is repaired; it is said.

use super::energy::series;
use super::{LoopChannel, Note, SettledLoop};
use crate::data::{Channel, Control, Role, TimeRecord};
use std::f64::consts::{PI, TAU};

/// A step in time this much longer than the usual one is a gap.
const GAP: f64 = 1.5;
/// The controlled channel is nearer to a sine by this factor.
const CLEARER: f64 = 1.5;

/// What is found in a record and its settled loop.
pub(super) fn findings(record: &TimeRecord, settled: &SettledLoop) -> Vec<Note> {
    let mut all: Vec<Note> = gaps(&record.time).into_iter().collect();
    all.extend(record.channels.iter().filter_map(|c| clipping(c, record, settled.frequency)));
    all.extend(control(record, settled));
    all.extend(settled.channels.get(settled.controlled).and_then(one_sided));
    all.extend(places(settled).flat_map(|at| [sign(settled, at), delay(settled, at)]).flatten());
    all
}

/// Roles and places of the channels that are clipped, each with what shows it.
pub(super) fn clipped(record: &TimeRecord, settled: &SettledLoop) -> Vec<(Role, String, String)> {
    let of = |c: &Channel| clipping(c, record, settled.frequency).map(|n| (c.role, c.at.clone(), n.text));
    record.channels.iter().filter_map(of).collect()
}

fn places(l: &SettledLoop) -> impl Iterator<Item = &str> {
    let mut seen: Vec<&str> = Vec::new();
    l.channels.iter().filter_map(move |c| {
        let new = !seen.contains(&c.at.as_str());
        seen.push(&c.at);
        new.then_some(c.at.as_str())
    })
}

/// Missing samples: steps longer than the median one.
fn gaps(time: &[f64]) -> Option<Note> {
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return None;
    }
    let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let long = || time.windows(2).enumerate().filter(|(_, w)| w[1] - w[0] > GAP * usual);
    let count = long().count();
    let (first, at) = long().next()?;
    let missing: f64 = long().map(|(_, w)| ((w[1] - w[0]) / usual).round() - 1.0).sum();
    Some(Note::new("time", format!("{count} gaps, about {missing:.0} samples missing; the first after sample {} ({} s)", first + 1, at[0])))
}

/// A driven displacement whose cycle lies to one side of 0, as a transducer has it that reads from the end of its travel.
fn one_sided(c: &LoopChannel) -> Option<Note> {
    let (low, high) = c.mean.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    (c.role == Role::Displacement && low * high > 0.0).then(|| {
        let (low, high) = (c.unit.print_difference(low), c.unit.print_difference(high));
        let text = format!("its cycle lies to one side of 0, {low} to {high}: springs begin at 0; centre = true counts from its mean");
        Note::new(format!("{} at {}", c.role.word(), c.at), text)
    })
}

/// A channel that stands at its extreme for longer than its resolution makes a sine stand.
fn clipping(c: &Channel, record: &TimeRecord, frequency: f64) -> Option<Note> {
    let v = &c.values;
    let (low, high) = v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let amplitude = 0.5 * (high - low);
    if !(amplitude > 0.0 && v.len() > 16) {
        return None;
    }
    let dt = (record.time[v.len() - 1] - record.time[0]) / (v.len() - 1) as f64;
    let quantum = v.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 1e-12 * amplitude).fold(f64::INFINITY, f64::min);
    let natural = 2.0 * (1.0 - (quantum / amplitude).min(1.0)).acos() / (TAU * frequency * dt);
    let longest = |extreme: f64| {
        let (mut runs, mut best, mut run) = (0, 0usize, 0usize);
        for x in v.iter().chain([&f64::NAN]) {
            if *x == extreme {
                run += 1;
            } else if run > 0 {
                runs += usize::from(run as f64 > 3.0 * natural + 3.0);
                best = best.max(run);
                run = 0;
            }
        }
        (runs, best)
    };
    let (value, (runs, best)) = [(high, longest(high)), (low, longest(low))].into_iter().max_by_key(|l| l.1)?;
    // One flat stretch may be a dwell of the machine; clipping comes back with every cycle.
    (runs >= 2).then(|| {
        Note::new(c.label(), format!("clipped: it stands at {} for up to {best} samples, {runs} times", c.unit.print_difference(value)))
    })
}

/// Power beyond the fundamental over the power at it.
fn distortion(l: &SettledLoop, role: Role, at: &str) -> Option<f64> {
    let c = l.channels.iter().find(|c| c.role == role && c.at == at)?;
    let (_, s) = series(l, c);
    let power = |m: &[f64; 4]| m[1] * m[1] + m[2] * m[2];
    let first = s.iter().find(|m| m[0] == 1.0).map(power).filter(|p| *p > 0.0)?;
    // Below its noise a channel is as pure as it can be told.
    let noise = 2.0 * c.sigma_mean.powi(2) / l.n as f64;
    Some((s.iter().filter(|m| m[0] > 1.0).map(power).sum::<f64>().max(noise) / first).sqrt())
}

/// The channel the machine controls: the one nearer to a sine. None where neither is clearly nearer.
pub(super) fn recognised(l: &SettledLoop, at: &str) -> Option<Control> {
    let (x, f) = (distortion(l, Role::Displacement, at)?, distortion(l, Role::Force, at)?);
    if x * CLEARER < f {
        Some(Control::Displacement)
    } else if f * CLEARER < x {
        Some(Control::Force)
    } else {
        None
    }
}

fn control(record: &TimeRecord, l: &SettledLoop) -> Option<Note> {
    let driven = l.channels.get(l.controlled)?;
    let (declared, found) = (record.control?, recognised(l, &driven.at)?);
    let word = |c: Control| c.role().word();
    (declared != found)
        .then(|| Note::new("control", format!("{} control is declared, and the {} is nearer to a sine", word(declared), word(found))))
}

/// Energy is dissipated, and a spring pushes back: where the loop says otherwise a sign is swapped, or a channel is late.
fn sign(l: &SettledLoop, at: &str) -> Option<Note> {
    let e = l.energy(Some(at))?;
    let clear = e.dissipated.value < -4.0 * e.dissipated.sigma;
    let (x, f) = (fundamental(l, Role::Displacement, at)?, fundamental(l, Role::Force, at)?);
    // Part of the force in phase with the displacement.
    let along = (f.1 - x.1).cos();
    if !clear {
        return None;
    }
    let text = if along < 0.0 {
        "the loop runs backwards and its force falls with displacement: the sign of force or displacement is swapped (scale = -1 in the channel turns it)"
    } else {
        "the loop runs backwards, gaining energy: the force channel is late against the displacement, or a sign is swapped"
    };
    Some(Note::new(at, text))
}

/// Amplitude, phase (x = A sin(p + phase)) and deviation of the phase of the fundamental.
fn fundamental(l: &SettledLoop, role: Role, at: &str) -> Option<(f64, f64, f64)> {
    let c = l.channels.iter().find(|c| c.role == role && c.at == at)?;
    let (_, s) = series(l, c);
    let [_, a, b, variance] = *s.iter().find(|m| m[0] == 1.0)?;
    let size = a.hypot(b);
    (size > 0.0).then(|| (size, a.atan2(b), variance.sqrt() / size))
}

/// Channels of one motion recorded twice (displacement, velocity, acceleration) must be a quarter turn apart; what is more is a delay.
fn delay(l: &SettledLoop, at: &str) -> Option<Note> {
    let omega = TAU * l.frequency;
    let motions = [(Role::Displacement, 0.0), (Role::Velocity, 0.5 * PI), (Role::Acceleration, PI)];
    let found: Vec<_> = motions.iter().filter_map(|(role, turn)| fundamental(l, *role, at).map(|f| (*role, turn, f))).collect();
    let (first, rest) = found.split_first()?;
    for (role, turn, (_, phase, sigma)) in rest {
        let lag = (first.2.1 + (*turn - first.1) - phase + PI).rem_euclid(TAU) - PI;
        let deviation = sigma.hypot(first.2.2);
        let per_sample = TAU / l.n as f64;
        if lag.abs() > 0.75 * PI {
            return Some(Note::new(at, format!("{} against {}: the sign of one of them is swapped", role.word(), first.0.word())));
        }
        // A fifth of a sample is what interpolation leaves.
        if lag.abs() > 5.0 * deviation && lag.abs() > 0.2 * per_sample {
            let (late, early) = if lag > 0.0 { (role.word(), first.0.word()) } else { (first.0.word(), role.word()) };
            let ms = 1e3 * lag.abs() / omega;
            return Some(Note::new(at, format!("the {late} is {ms:.3} ms (+- {:.3}) late against the {early}", 1e3 * deviation / omega)));
        }
    }
    None
}
