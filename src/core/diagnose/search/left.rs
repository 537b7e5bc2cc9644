//! What the likelihood makes of what a model leaves: its own error, instruments beyond their tolerance, strengths that scatter.

use crate::evidence::{Record, scatters};
use crate::model::FreeParam;
use crate::response::Misreading;

use crate::diagnose::calibrate::weigh::{Scale, Weighed};
use crate::diagnose::results::{OwnError, Reading, ScatterOf, SplitName};

impl Scale {
    /// The model's own error, channel by channel.
    pub fn model_error(&self, w: &Weighed) -> Vec<OwnError> {
        let mut list: Vec<(OwnError, f64)> = Vec::new();
        let plans = self.case.plans_of(SplitName::Fit);
        for (t, (plan, record)) in plans.iter().zip(&self.evidence.records).enumerate() {
            for (channel, error) in record.channels.iter().zip(w.v.own_errors(t, record)) {
                let kind = plan.kind.word();
                match list.iter_mut().find(|(m, _)| m.kind == kind && m.channel == channel.label) {
                    Some((m, n)) => (m.relative, *n) = (m.relative + error * error, *n + 1.0),
                    None => list.push((OwnError { kind: kind.into(), channel: channel.label.clone(), relative: error * error }, 1.0)),
                }
            }
        }
        list.into_iter().map(|(m, n)| OwnError { relative: (m.relative / n).sqrt(), ..m }).collect()
    }

    /// What instruments read wrong by a model, beyond what they may err by.
    pub fn readings(&self, w: &Weighed) -> Vec<Reading> {
        let plans = self.case.plans_of(SplitName::Fit);
        let mut list = Vec::new();
        for ((plan, record), all) in plans.iter().zip(&self.evidence.records).zip(self.evidence.readings(&w.seen, &self.counts, &w.v)) {
            let beyond = record.instruments.of.iter().zip(all).filter(|(_, x)| x.abs() > self.settings.telling.finding);
            // What reads less than there is has a part above 0, and is early.
            let late = |what, x: f64| if what == Misreading::Delay { -x } else { x };
            let told = |(&(block, what, std), x): (&(usize, Misreading, f64), f64)| {
                let x = late(what, x);
                Reading { test: plan.id.clone(), channel: plan.blocks[block].label.clone(), misreading: what, part: x * std, deviations: x }
            };
            list.extend(beyond.map(told));
        }
        list
    }

    /// How much each strength differs from test to test, in tests of every kind where that is more than none (`no_scatter`); none in one test.
    pub fn scatter(&self, w: &Weighed) -> Vec<ScatterOf> {
        if self.evidence.records.len() < 2 {
            return vec![];
        }
        let system = &w.fitted.system;
        let mut kinds: Vec<&Record> = vec![];
        for record in &self.evidence.records {
            let any = w.v.scatter(record) > self.settings.evidence.no_scatter;
            if any && kinds.iter().all(|k| k.kind != record.kind) {
                kinds.push(record);
            }
        }
        let free = w.fitted.free.iter().filter(|f| scatters(system, f));
        let of = |f: &FreeParam, of: &Record| ScatterOf {
            parameter: f.name.clone(),
            kind: of.kind.word().into(),
            relative: w.v.scatter(of).exp(),
        };
        free.flat_map(|f| kinds.iter().map(move |k| of(f, k))).collect()
    }
}
