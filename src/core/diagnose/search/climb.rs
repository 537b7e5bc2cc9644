//! The state of a ladder: the model as it stands, what was added to it, and how it is weighed.

use crate::identify::Monitor;
use crate::model::{Instance, System};
use crate::parallel;

use super::candidates::Name;
use super::fault::of_channel;
use super::horizon;
use super::kin::carried;
use super::loosened::{Beside, Offer};
use super::step::{Against, Move, Step, Stood, error_of, step};
use crate::diagnose::calibrate::approach::in_step;
use crate::diagnose::calibrate::case::{Case, Fitted};
use crate::diagnose::calibrate::fit::begin;
use crate::diagnose::calibrate::slack::{self, Slack};
use crate::diagnose::calibrate::weigh::{Scale, Tied, Weighed};
use crate::diagnose::results::Rung;
use crate::diagnose::settings::Settings;
use crate::diagnose::{DiagnoseError, trace};

/// An effect that was added.
#[derive(Clone)]
pub struct Added {
    /// Its name.
    pub name: Name,
    /// Whether it was held against what could stand in its place since the model changed last.
    pub held: bool,
    /// What it cannot be told from, what is alike first.
    pub tied: Vec<(Tied, Name, Weighed)>,
    /// What came closest to it at other places and what was tied with it at its own, as it was fitted there.
    pub rivals: Vec<(Name, Instance)>,
    /// Laws of its kind that stood at its place beside it, as they were fitted: what laws over a condition act on can be exchanged for these alone.
    pub kin: Vec<(Name, Instance)>,
    /// Nats that it gained when it was added.
    pub gain: f64,
    /// The model without it, once that was weighed.
    pub without: Option<Weighed>,
    /// The same as it was weighed last, before whatever was done to the model since.
    pub smaller: Option<Weighed>,
    /// Squared error of that.
    pub loss: f64,
}

impl Added {
    /// Nothing else is known of it.
    pub fn new(name: Name) -> Added {
        Added { name, held: false, tied: vec![], rivals: vec![], kin: vec![], gain: 0.0, without: None, smaller: None, loss: 0.0 }
    }

    /// Laws that are as good a statement: a larger one contains what was added, or nearly, and an instrument reads so in every test, so that none of them
    /// tells these apart.
    pub fn alike(&self) -> impl Iterator<Item = &(Tied, Name, Weighed)> {
        self.tied.iter().filter(|(how, _, w)| *how == Tied::Alike && w.last().is_some_and(|i| !of_channel(i)))
    }
}

/// A climb.
pub struct Climb<'a> {
    /// The case as it was given, in as many time steps as the present model needs.
    pub case: Case,
    /// Constants.
    pub settings: Settings,
    /// Watch over the fits.
    pub monitor: &'a Monitor<'a>,
    /// Lines of progress.
    pub watch: &'a (dyn Fn(&str) + Sync),
    /// Instances of the study's own model, its slack with them.
    pub base: usize,
    /// What deviates of what the study ties or fixes.
    pub slack: Slack,
    /// Whether that was given by a move, which may be taken back once.
    pub loosened: bool,
    /// What was found beside slack when it was given.
    pub beside: Option<Beside>,
    /// Slack that was weighed before the last step.
    pub offered: Option<Offer>,
    /// What models are weighed on, under the counts of the model before the last addition.
    pub scale: Scale,
    /// Where else the parameters of the study's own model may stand when a candidate begins.
    pub elsewhere: Vec<System>,
    /// The study's own model.
    pub first: Weighed,
    /// The present one.
    pub now: Weighed,
    /// Its additions, in the order of its instances.
    pub added: Vec<Added>,
    /// The order in which they are named.
    pub order: Vec<usize>,
    /// Whether a setting of an addition has been fitted since the last rung was told.
    pub freed: bool,
    /// Candidates of a step.
    pub tried: f64,
    /// Force channels that were turned back.
    pub turned: Vec<crate::diagnose::results::Instrument>,
}

impl<'a> Climb<'a> {
    /// At the foot: the study's own model, fitted.
    pub fn new(
        case: &Case,
        fitted: &Fitted,
        monitor: &'a Monitor<'a>,
        watch: &'a (dyn Fn(&str) + Sync),
    ) -> Result<Climb<'a>, DiagnoseError> {
        let settings = case.search.settings.clone();
        let (start, plain) = bounded(case.system.clone(), fitted.system.clone(), &settings);
        let begun = Fitted { system: plain, ..fitted.clone() };
        let (case, fitted, slack) = with_slack(&case.at(&start), &begun, &settings, monitor, watch);
        let mut scale = Scale::new(&case, &fitted.system, &settings);
        // Where it is time to stop, the fit is taken as it stands.
        let first = match scale.begin(&fitted.system, monitor) {
            Err(_) if trace::stopped(monitor) => scale.as_it_stands(&fitted).ok_or_else(|| "its response is not finite".to_string()),
            weighed => weighed,
        };
        let first = first.map_err(DiagnoseError::start_fails)?;
        let base = first.fitted.system.instances.len();
        let elsewhere = elsewhere(&scale, &first, &fitted.system, &start);
        let now = first.clone();
        Ok(Climb {
            case,
            settings,
            monitor,
            watch,
            base,
            slack,
            loosened: false,
            beside: None,
            offered: None,
            scale,
            elsewhere,
            first,
            now,
            added: vec![],
            order: vec![],
            freed: false,
            tried: 1.0,
            turned: vec![],
        })
    }

    /// Gives slack to what the study ties or fixes where that gains more than what a step has found. Whether it did.
    pub fn loosen(&mut self, step: &Step, rungs: &mut Vec<Rung>) -> Result<bool, DiagnoseError> {
        let watch = self.monitor.watch();
        if !parallel::watched(&watch, || self.slacken(step)) {
            return Ok(false);
        }
        self.refresh(rungs)?;
        // What was added stands beside slack now: some of it may be superfluous, something else may do its work better, and its ties are others.
        let gone = parallel::watched(&watch, || self.remove(self.added.len()));
        if !gone.is_empty() {
            rungs.push(self.rung(None, gone)?);
        }
        if !self.added.is_empty()
            && let Some((added, removed)) = parallel::watched(&watch, || self.swap())
        {
            rungs.push(self.rung(Some(added), vec![removed])?);
        }
        Ok(true)
    }

    /// Scores and weighs what may be missing from the present model, under its own counts.
    pub fn step(&mut self) -> Result<Step, DiagnoseError> {
        self.step_beyond(0.0)
    }

    /// A step that is of interest only where what it finds gains so many nats beyond its price.
    pub(in crate::diagnose) fn step_beyond(&mut self, beyond: f64) -> Result<Step, DiagnoseError> {
        if !self.added.is_empty() {
            self.renew()?;
            while self.free_setting() {
                self.freed = true;
                self.renew()?;
            }
        }
        let (monitor, watch) = (self.monitor, self.watch);
        let near = in_step(&self.scale.case.at(&self.now.fitted.system), monitor)?;
        self.offered = if near.is_none() && self.scale.errs(&self.now) { self.offer() } else { None };
        let rival = self.offered.as_ref().map(|o| o.gain);
        let open = self.added.is_empty();
        let elsewhere: Vec<System> = self.elsewhere.iter().filter(|_| open).map(|there| self.standing_at(there)).collect();
        let added = self.added.iter().map(|a| &a.name).collect();
        let found = match near {
            Some(near) => horizon::near(&self.scale, &near, &self.now, (added, beyond), monitor, watch)?,
            None => step(&Against {
                scale: &self.scale,
                base: &self.now,
                need: None,
                beyond,
                stands: None,
                rival,
                elsewhere: &elsewhere,
                added,
                monitor,
                watch,
            })?,
        };
        self.tried = found.tried.max(1.0);
        Ok(found)
    }

    /// Weighs the present model under its own counts.
    fn renew(&mut self) -> Result<(), DiagnoseError> {
        let mut scale = self.scale.renewed(&self.now.fitted.system);
        let now = scale.tempered(&self.now, self.monitor).map_err(DiagnoseError::start_fails)?;
        self.now = scale.finished(now, self.monitor).map_err(DiagnoseError::start_fails)?;
        self.scale = scale;
        Ok(())
    }

    /// The present model with its own parameters where they stand there, nothing of what was given slack deviating.
    fn standing_at(&self, there: &System) -> System {
        let mut system = self.now.fitted.system.clone();
        for (k, own) in system.instances.iter_mut().enumerate() {
            match there.instances.get(k) {
                Some(i) => own.params.iter_mut().zip(&i.params).for_each(|(own, p)| own.value = p.value),
                None => own.params.iter_mut().take(1).for_each(|p| p.value = 0.0),
            }
        }
        system
    }

    /// Takes what a step found, with what came close to it.
    pub fn add(&mut self, taken: &Move, step: &Step) {
        self.forget();
        for name in &taken.names {
            let mut added = Added { gain: taken.gain / taken.names.len() as f64, ..Added::new(name.clone()) };
            if let [_] = taken.names.as_slice() {
                let others = || step.stood.iter().filter(|s| s.admissible && s.name != *name);
                let tied = |s: &Stood| self.scale.tied(&s.weighed, &taken.weighed);
                let close = others().filter_map(|s| Some((tied(s)?, s.name.clone(), s.weighed.clone())));
                added.tied = close.collect();
                let rival = |s: &Stood| {
                    let instance = s.weighed.fitted.system.instances.last()?;
                    (!of_channel(instance) && instance.target.is_none()).then(|| (s.name.clone(), instance.clone()))
                };
                let here = |s: &&Stood| s.name.at == name.at;
                added.rivals = others().filter(|s| !here(s)).filter_map(rival).take(self.settings.race.closest).collect();
                // A tie at its own place may be broken by what is added next.
                let alike = others().filter(here).filter(|s| tied(s) == Some(Tied::Alike));
                added.rivals.extend(alike.filter_map(rival));
                let (own, shared) = (taken.weighed.last(), self.settings.race.shared);
                let kin = |of: &&Stood| own.zip(of.weighed.last()).is_some_and(|(own, law)| carried(law, own, shared).is_some());
                added.kin = others().filter(here).filter(kin).filter_map(rival).collect();
                added.held = true;
                (added.without, added.smaller) = (Some(self.now.clone()), Some(self.now.clone()));
                added.loss = error_of(&self.scale, &self.now).powi(2);
            }
            self.added.push(added);
        }
        self.now = taken.weighed.clone();
        self.order = (0..self.added.len()).collect();
        self.refine();
        self.revive();
    }

    /// A new effect may ask for finer steps.
    fn refine(&mut self) {
        if let Some(finer) = self.case.refined(&self.now.fitted.system).filter(|_| !trace::stopped(self.monitor)) {
            let counts = self.scale.counts.clone();
            self.case = finer;
            self.scale = Scale { counts, ..Scale::new(&self.case, &self.now.fitted.system, &self.settings) };
            if let Ok(again) = self.scale.weigh(&self.now.fitted.system, &self.now.v, self.monitor) {
                self.now = again;
            }
        }
    }

    /// What was weighed before the model changed no longer holds.
    pub fn forget(&mut self) {
        for added in &mut self.added {
            (added.held, added.tied, added.without) = (false, vec![], None);
        }
        self.order = (0..self.added.len()).collect();
    }
}

/// The systems of a study and of its plain fit with bounds on coefficients that have none: some decades above both, and of shapes below both as well. One
/// that becomes a stand-in for what is missing (a support that turns rigid, say) has no way back from farther away, since nothing changes there any more.
fn bounded(mut start: System, mut plain: System, settings: &Settings) -> (System, System) {
    for f in start.free() {
        let (own, fitted) = (&mut start.instances[f.instance].params[f.param], &mut plain.instances[f.instance].params[f.param]);
        let most = settings.fitting.known * own.value.max(fitted.value);
        if own.max.is_infinite() && own.prior.is_none() && most > 0.0 {
            (own.max, fitted.max) = (most, most);
        }
        let least = own.value.min(fitted.value) / settings.race.shape_reach;
        if f.log && own.min <= 0.0 {
            (own.min, fitted.min) = (least, least);
        }
    }
    (start, plain)
}

/// The system that a climb ended with, which begins with the instances of `stated`, the study's own, in their order: with the bounds that these have there, in
/// place of those that the search keeps about coefficients without any.
pub fn unbounded(stated: &System, mut system: System) -> System {
    for (own, stated) in system.instances.iter_mut().zip(&stated.instances) {
        own.params.iter_mut().zip(&stated.params).for_each(|(own, stated)| (own.min, own.max) = (stated.min, stated.max));
    }
    system
}

/// Where else candidates may begin: where the plain fit stands, and the study, as far as the model responds otherwise there by more than a tie. What is
/// missing bends the parameters of a model without it, each covariance in its own way, and from a bent one no refit may lead to it.
fn elsewhere(scale: &Scale, first: &Weighed, plain: &System, start: &System) -> Vec<System> {
    let mut begun = plain.clone();
    begun.instances.iter_mut().zip(&start.instances).for_each(|(own, s)| *own = s.clone());
    let near = scale.about(&first.fitted.system);
    let near = near.as_ref().unwrap_or(scale);
    let apart = |system: &System| near.see(system).is_ok_and(|seen| scale.apart(&seen, first) > scale.settings.tie);
    [plain.clone(), begun].into_iter().filter(apart).collect()
}

/// The fit with slack in what the study ties or fixes, begun from the one without; that one where nothing has slack or no fit with it comes out.
fn with_slack(
    case: &Case,
    fitted: &Fitted,
    settings: &Settings,
    monitor: &Monitor,
    watch: &(dyn Fn(&str) + Sync),
) -> (Case, Fitted, Slack) {
    let (system, slack) = slack::given(case, &fitted.system, case.search.slack == Some(true), settings);
    if slack.is_empty() || trace::stopped(monitor) {
        return (case.clone(), fitted.clone(), Slack::default());
    }
    watch(&format!("fitting {} deviations of what the study ties or fixes", slack.len()));
    let loose = Case { worth: Some(settings.settled), ..case.at(&system) };
    match begin(&loose, &monitor.quiet()) {
        Ok(began) => (Case { worth: None, deviations: slack.clone(), ..began.case }.at(&case.system), began.fitted, slack),
        Err(_) => (case.clone(), fitted.clone(), Slack::default()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Sign;
    use crate::model::{Axis, Body, Model, ParamValue};

    /// One spring between the ground and a mass, `k` as it is declared.
    fn spring(k: ParamValue) -> System {
        let model = Model::joined(vec![Body::fixed("ground"), Body::new("m", 1.0, &[Axis::X])], &[("c1", "ground", "m")]);
        let mut system = System::new(model.unwrap()).and("linear_stiffness", "c1.x", &[]).unwrap();
        system.instances[0].params[0] = k;
        system
    }

    #[test]
    fn a_coefficient_without_a_bound_stays_within_reach_of_start_and_plain_fit() {
        let settings = Settings::default();
        let bounds = |start: ParamValue, fitted: f64| {
            let (a, b) = bounded(spring(start.clone()), spring(ParamValue { value: fitted, ..start }), &settings);
            (a.instances[0].params[0].max, b.instances[0].params[0].max)
        };
        let free = ParamValue::free(2e4, Sign::Positive);
        assert_eq!(bounds(free.clone(), 3e5), (3e5 * settings.fitting.known, 3e5 * settings.fitting.known));
        assert_eq!(bounds(free.clone(), 1e3).0, 2e4 * settings.fitting.known);
        // What is written in the end has the study's bounds again.
        let start = spring(free.clone());
        let climbed = bounded(start.clone(), start.clone(), &settings).0;
        assert!(climbed.instances[0].params[0].max.is_finite());
        assert!(unbounded(&start, climbed).instances[0].params[0].max.is_infinite());
        // A bound of the study's own stays, and what is fixed has none.
        assert_eq!(bounds(ParamValue { max: 5e4, ..free }, 3e4), (5e4, 5e4));
        assert!(bounds(ParamValue::fixed(2e4), 2e4).0.is_infinite());
    }

    /// A film of a study whose speed its plain fit has nearly put to nothing.
    #[test]
    fn a_shape_has_a_range_that_fits_do_not_move() {
        let settings = Settings::default();
        let film = |v0: f64| {
            let mut system =
                spring(ParamValue::free(2e4, Sign::Positive)).and("film", "c1.x", &[("f", 2.0), ("v0", v0), ("d", 1e-5)]).unwrap();
            system.instances[1].params.iter_mut().for_each(|p| p.free = true);
            system
        };
        let (start, plain) = bounded(film(1e-2), film(1e-5), &settings);
        for system in [start, plain] {
            let v0 = &system.instances[1].params[1];
            assert_eq!((v0.min, v0.max), (1e-5 / settings.race.shape_reach, 1e-2 * settings.fitting.known));
        }
    }
}
