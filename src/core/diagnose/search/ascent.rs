//! The way of a climb, rung by rung, and the way beside it that it did not take.

use crate::diagnose::results::Rung;
use crate::diagnose::{DiagnoseError, trace};
use crate::model::System;
use crate::parallel;

use super::candidates::Name;
use super::climb::Climb;
use super::fault::of_channel;
use super::step::{Move, Step, Stood};

/// Why a climb ends.
pub enum End {
    /// Nothing gains more than it costs.
    NothingGains,
    /// As many effects as may be added.
    Full,
    /// It was stopped.
    Stopped,
    /// The next step cannot be computed.
    Cannot(String),
}

impl End {
    pub fn describe(&self, climb: &Climb) -> String {
        match self {
            End::NothingGains => "no candidate gains more than its parameters and the search for it cost".into(),
            End::Full => format!("{} effects were added, and {} is the limit", climb.effects(), climb.settings.max_added),
            End::Stopped if climb.added.is_empty() => "it was interrupted before an effect was added; more may be missing".into(),
            End::Stopped => "it was interrupted after these effects were added; more may be missing".into(),
            End::Cannot(why) => format!("what else is missing could not be looked for: {why}"),
        }
    }
}

/// How a climb went.
pub struct Way<'a> {
    pub end: End,
    /// Name and visible strength of each candidate of its last step.
    pub visible: Vec<(Name, f64)>,
    /// Where it could have gone another way.
    pub fork: Option<Fork<'a>>,
}

/// A climb before its first addition, with what came closest to that at another place.
pub struct Fork<'a> {
    climb: Climb<'a>,
    rungs: Vec<Rung>,
    step: Step,
    other: Move,
}

/// Climbs from where `climb` stands until nothing gains, with a rung for every change; `keep` is given the model of every rung above the first.
pub fn ascend<'a>(climb: &mut Climb<'a>, rungs: &mut Vec<Rung>, keep: &dyn Fn(&System)) -> Result<Way<'a>, DiagnoseError> {
    let mut way = Way { end: End::NothingGains, visible: vec![], fork: None };
    let monitor = climb.monitor;
    way.end = loop {
        if trace::stopped(monitor) {
            break End::Stopped;
        }
        if climb.effects() >= climb.settings.max_added || rungs.len() > 2 * climb.settings.max_added {
            climb.exchange(rungs)?;
            break End::Full;
        }
        if rungs.len() > 1 {
            keep(&climb.slack.held(&climb.now.fitted.system));
        }
        (climb.watch)(&format!("rung {}", rungs.len()));
        let step = match parallel::watched(&monitor.watch(), || climb.step()) {
            Err(_) if trace::stopped(monitor) => break End::Stopped,
            Err(why) if !climb.added.is_empty() => break End::Cannot(why.to_string()),
            found => found?,
        };
        if let Some(last) = rungs.last_mut() {
            (last.candidates, last.second_opinion, last.effort) = (step.candidates.clone(), step.second_opinion.clone(), step.effort);
        }
        if climb.loosen(&step, rungs)? {
            continue;
        }
        let Some(taken) = &step.taken else {
            way.visible = step.visible;
            if climb.exchange(rungs)? {
                continue;
            }
            if let Some(tight) = parallel::watched(&monitor.watch(), || climb.tighten(true)) {
                rungs.extend(tight);
                continue;
            }
            break if step.cut || trace::stopped(monitor) { End::Stopped } else { End::NothingGains };
        };
        if climb.exchange_first(taken, rungs)? {
            continue;
        }
        // Whether what stands should be another is not known where the time ended before it was held against what could stand in its place, or before all
        // candidates beside it were refitted: what it leaves may be its own.
        if !climb.added.is_empty() && (step.cut || trace::stopped(monitor)) {
            break End::Stopped;
        }
        let foot = climb.added.is_empty().then(|| (climb.again(), rungs.clone()));
        rungs.push(climb.taken(taken, &step)?);
        if let Some((foot, below)) = foot {
            way.fork = Fork::at(foot, below, step);
        }
        rungs.extend(parallel::watched(&monitor.watch(), || climb.tighten(false)).unwrap_or_default());
    };
    Ok(way)
}

/// Which of those that stood, the most worth first, gains at another place than what is taken.
fn next_elsewhere<'s>(taken: &[Name], mut stood: impl Iterator<Item = (&'s Name, bool, f64)>) -> Option<usize> {
    stood.position(|(name, admissible, gain)| admissible && gain > 0.0 && taken.iter().all(|n| n.at != name.at))
}

impl<'a> Fork<'a> {
    /// Where a step has found something that gains at another place than what it takes.
    fn at(climb: Climb<'a>, rungs: Vec<Rung>, step: Step) -> Option<Fork<'a>> {
        // What an instrument reads off is no other way.
        let physics = |s: &Stood| s.weighed.last().is_some_and(|i| !of_channel(i));
        let stood = step.stood.iter().map(|s| (&s.name, s.admissible && physics(s), s.gain));
        let next = &step.stood[next_elsewhere(&step.taken.as_ref()?.names, stood)?];
        let other = Move { names: vec![next.name.clone()], weighed: next.weighed.clone(), gain: next.gain };
        Some(Fork { climb, rungs, step, other })
    }

    /// The climb that goes on from here the other way, where the first one has come to its end with an error that is seen, and this one comes to more. What is
    /// added first is nearly a draw where a model lacks much, and single exchanges do not lead from one way to the other.
    pub fn better(self, first: &Climb, end: &End) -> Option<(Climb<'a>, Vec<Rung>, Way<'a>)> {
        let Fork { mut climb, mut rungs, step, other } = self;
        if !matches!(end, End::NothingGains | End::Full) || !first.errs(&first.now) {
            return None;
        }
        let name = &other.names[0];
        (climb.watch)(&format!("an error is left: climbing once more from {} at {}, which came next", name.effect, name.at));
        rungs.push(climb.taken(&other, &step).ok()?);
        let way = ascend(&mut climb, &mut rungs, &|_| {}).ok()?;
        if matches!(way.end, End::Stopped) || climb.slack.len() != first.slack.len() {
            return None;
        }
        // Both on the scale of the first, from where each stands.
        let worth = |c: &Climb| {
            let weighed = first.scale.weigh(&c.now.fitted.system, &c.now.v, c.monitor).ok()?;
            Some(first.scale.worth(&weighed) - c.added.len() as f64 * first.tried.ln())
        };
        let more = worth(&climb)? - worth(first)?;
        (climb.watch)(&format!("it comes to {more:.1} nats more"));
        (more > first.settings.swap).then_some((climb, rungs, way))
    }
}

impl Climb<'_> {
    /// Exchanges an addition for what does its work better. What was added first may stand for two: where nothing gains beside it, or nothing more may be
    /// added, every addition is held against what could stand in its place now. Whether one was exchanged.
    fn exchange(&mut self, rungs: &mut Vec<Rung>) -> Result<bool, DiagnoseError> {
        let changed = self.effects() > 1 || !self.added.is_empty() && rungs.last().is_some_and(|r| !r.removed.is_empty());
        if !changed {
            return Ok(false);
        }
        let Some((added, removed)) = parallel::watched(&self.monitor.watch(), || self.swap()) else { return Ok(false) };
        rungs.push(self.rung(Some(added), vec![removed])?);
        Ok(true)
    }

    /// Exchanges an addition before anything is added beside it, where that comes to no less: a law that does nearly what is missing leaves a rest that
    /// another one, elsewhere, can take up. Whether one was exchanged.
    fn exchange_first(&mut self, taken: &Move, rungs: &mut Vec<Rung>) -> Result<bool, DiagnoseError> {
        let watch = self.monitor.watch();
        let exchanged = if self.added.is_empty() { None } else { parallel::watched(&watch, || self.replace(Some(&taken.weighed))) };
        let Some((added, removed)) = exchanged else { return Ok(false) };
        rungs.push(self.rung(Some(added), vec![removed])?);
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_way_begins_at_another_place_with_what_gains_and_may_be_taken() {
        let name = |effect, at: &str| Name { effect, at: at.into(), of: None };
        let [film, slip, damper, spring] =
            [("film", "a.x"), ("elastic_slip", "a.x"), ("viscous", "b.x"), ("maxwell", "c.x")].map(|(e, at)| name(e, at));
        let stood = [(&film, true, 9.0), (&slip, true, 8.5), (&damper, false, 8.0), (&spring, true, 3.0)];
        let next = |taken: &[Name]| next_elsewhere(taken, stood.into_iter());
        assert_eq!(next(&[film.clone()]), Some(3));
        assert_eq!(next(&[film.clone(), spring.clone()]), None);
        assert_eq!(next(&[spring.clone()]), Some(0));
        assert_eq!(next_elsewhere(&[film], [(&spring, true, -0.1)].into_iter()), None);
    }
}
