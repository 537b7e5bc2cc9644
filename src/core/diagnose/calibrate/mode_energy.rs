//! Where the energy of the modes of a table is, and which of them are the fixture's.

use std::collections::BTreeMap;

use crate::effect::Role;
use crate::engine::modal::Shares;
use crate::model::{Model, Site, System};
use crate::response::{BlockKind, Plan};

use crate::diagnose::results::{EnergyShare, ModeEnergy, words};
use crate::diagnose::settings::Telling;

/// Every mode that a modal table pairs with the model, with the shares of its energy that are worth a word, largest first. Empty of another kind of test, and
/// where the modes cannot be computed.
pub fn modes(plan: &Plan, system: &System, telling: &Telling) -> Vec<ModeEnergy> {
    let Some(block) = plan.blocks.iter().find(|b| b.kind == BlockKind::Table && b.role == "natural_frequency") else { return vec![] };
    let Some(table) = plan.modes(system).ok().flatten() else { return vec![] };
    let rows = block.range.clone().zip(&block.abscissa).zip(&table.rows);
    rows.map(|((row, number), found)| {
        let shares = &table.shares[*found];
        ModeEnergy {
            mode: *number as u32,
            measured: plan.measured[row].exp(),
            computed: table.found[*found].frequency_hz,
            strain: grouped(strain(system, shares), telling.energy),
            kinetic: grouped(moving(system, shares), telling.energy),
            finding: finding(*number as u32, &fixture(&system.model, shares), telling),
        }
    })
    .collect()
}

/// What to think of a mode that fixtures hold; none of another.
fn finding(mode: u32, fixture: &[EnergyShare], telling: &Telling) -> Option<String> {
    let held: f64 = fixture.iter().map(|f| f.share).sum();
    let worth: Vec<EnergyShare> = fixture.iter().filter(|f| f.share >= telling.energy).cloned().collect();
    (held > telling.fixture).then(|| {
        format!(
            "{:.0} % of the strain energy of mode {mode} is in what holds the part and is no part of it ({}): this frequency is the fixture's and says \
             little of the part; the same test with another stiffness or mass there tells them apart",
            100.0 * held,
            words(&worth)
        )
    })
}

fn grouped(parts: impl Iterator<Item = (String, f64)>, least: f64) -> Vec<EnergyShare> {
    let mut sums: BTreeMap<String, f64> = BTreeMap::new();
    parts.for_each(|(at, share)| *sums.entry(at).or_insert(0.0) += share);
    let mut list: Vec<EnergyShare> = sums.into_iter().filter(|s| s.1.abs() >= least).map(|(at, share)| EnergyShare { at, share }).collect();
    list.sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
    list
}

/// The group of places that the first effect with this place acts on; a place of a group is not told by itself.
fn group(system: &System, place: usize, inertial: bool) -> String {
    let acts = |i: &&crate::model::Instance| {
        let info = i.effect.info();
        info.role == Role::Force && (info.family == "inertial") == inertial && matches!(&i.site, Site::Places(p) if p.contains(&place))
    };
    system.instances.iter().find(acts).map_or_else(|| system.model.place_name(place), |i| i.at.clone())
}

fn strain<'a>(system: &'a System, shares: &'a Shares) -> impl Iterator<Item = (String, f64)> {
    let places = shares.strain.iter().map(|(place, share)| (group(system, *place, false), *share));
    places.chain(std::iter::once(("loads and preloads (geometric stiffness)".to_string(), shares.geometric)))
}

fn moving<'a>(system: &'a System, shares: &'a Shares) -> impl Iterator<Item = (String, f64)> {
    let stem = |body: usize| {
        let stems = system.model.space.iter().flat_map(|s| &s.stems);
        let of = stems.into_iter().find(|s| (s.first..s.first + s.count).contains(&body));
        of.map_or_else(|| system.model.bodies[body].name.clone(), |s| s.name.clone())
    };
    let bodies = shares.kinetic.iter().map(move |(body, share)| (stem(*body), *share));
    bodies.chain(shares.carried.iter().map(|(place, share)| (group(system, *place, true), *share)))
}

/// The connectors that some tests do not have, or that are attached once the structure is loaded, with their strain energy: what holds the part under test
/// and is no part of it.
fn fixture(model: &Model, shares: &Shares) -> Vec<EnergyShare> {
    let connector = |place: usize| model.places[place].connector;
    let holds = |place: usize| {
        let c = connector(place);
        c < model.declared && (model.attached.contains(&c) || model.absent.iter().any(|a| a.0 == c))
    };
    let name = |place: usize| model.connectors[connector(place)].name.clone();
    grouped(shares.strain.iter().filter(|s| holds(s.0)).map(|s| (name(s.0), s.1)), 0.0)
}
