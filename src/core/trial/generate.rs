//! Random models, tests, hidden effects and instruments.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::bench::{Bench, Drive, Flaw, Hidden, Planted, Record, Response, Test};
use super::draw::Draw;
use super::law::{Law, Sizes};
use super::life::{self, Life};
use super::{Data, Kind, Options, Structure};

/// Least noncentrality of what is hidden.
pub const NONCENTRALITY: f64 = 25.0;
/// Growth of a strength that is too small to be seen, how often, and the largest size that makes sense.
const GROWTH: f64 = 1.6;
const GROWTHS: usize = 10;
const LARGEST: f64 = 1.0;
/// Samples of a hit in a period of the first mode, and periods recorded.
const HIT_SAMPLES: usize = 400;
const HIT_PERIODS: usize = 6;
/// Draws of what is hidden before a structure is given up.
const DRAWS: u64 = 40;

/// Effects hidden in loops of one connector, in loops of a chain, and in frequency responses alone.
const ON_CONNECTOR: [&str; 21] = [
    "cubic_stiffness",
    "quadratic_stiffness",
    "bilinear_stiffness",
    "contact",
    "viscous",
    "quadratic_damping",
    "power_damping",
    "maxwell",
    "structural_damping",
    "springpot",
    "coulomb",
    "elastic_slip",
    "iwan",
    "bouc_wen",
    "lugre",
    "stribeck",
    "film",
    "added_mass",
    "backlash",
    "support_compliance",
    "coefficient",
];
const IN_CHAIN: [&str; 9] = [
    "cubic_stiffness",
    "quadratic_stiffness",
    "bilinear_stiffness",
    "contact",
    "quadratic_damping",
    "maxwell",
    "elastic_slip",
    "iwan",
    "bouc_wen",
];
const IN_FRF: [&str; 5] = ["maxwell", "structural_damping", "springpot", "added_mass", "support_compliance"];

/// A generated case: all that is needed to write it down.
pub struct Generated {
    /// The structure at its truth.
    pub bench: Bench,
    /// Its tests.
    pub tests: Vec<Test>,
    /// Condition that the tests state, with its unit.
    pub condition: Option<(&'static str, &'static str)>,
    /// What is hidden in the structure.
    pub planted: Vec<Planted>,
    /// What is hidden in an instrument.
    pub instrument: Option<Flaw>,
    /// Errors within the tolerance of good instruments.
    pub nuisances: Vec<Flaw>,
    /// Least noncentrality of what is hidden; 0 where nothing is.
    pub noncentrality: f64,
    /// Starts of the free parameters over their truth.
    pub starts: Vec<f64>,
    /// The draws that are left, for the noise.
    pub draw: Draw,
    /// What the search is restricted to, as a line of study.toml.
    pub search: Option<String>,
    /// What model and instruments do not know; none in a clean case.
    pub life: Option<Life>,
    /// What was recorded, test by test, once it is.
    pub measured: Vec<Response>,
}

/// Case `index`: always the same for the same options and seed.
pub fn generate(options: &Options, index: usize) -> Generated {
    let kind = options.kind(index);
    for attempt in 0..DRAWS {
        let mut draw = Draw::new(options.seed, index as u64 * DRAWS + attempt);
        let chain = match options.structure {
            Structure::Connector | Structure::Sparse => false,
            Structure::Chain => true,
            Structure::Both => draw.chance(0.3),
        };
        let sparse = options.structure == Structure::Sparse;
        let realistic = options.data == Data::Realistic;
        let mut made = if chain { in_chain(kind, realistic, draw) } else { on_connector(kind, sparse, draw) };
        let least = if realistic {
            life::lived(&mut made, options.only(index));
            life::SETTINGS.strength.0.powi(2)
        } else {
            sized(&mut made);
            NONCENTRALITY
        };
        let hidden = made.planted.len() + usize::from(made.instrument.is_some());
        if hidden == 0 || made.noncentrality >= least || attempt + 1 == DRAWS {
            return made;
        }
    }
    on_connector(Kind::None, false, Draw::new(options.seed, index as u64 * DRAWS))
}

fn on_connector(kind: Kind, sparse: bool, mut draw: Draw) -> Generated {
    let (travel, k) = (draw.log(0.1e-3, 2e-3), draw.log(1e4, 1e6));
    let low = draw.log(0.05, 1.0);
    let high = low * draw.log(10.0, 50.0);
    let sizes = Sizes { x: travel, w: (TAU * low, TAU * high) };
    let count = if kind == Kind::Two { 2 } else { usize::from(kind == Kind::One) };
    let mut names: Vec<&str> = Vec::new();
    while names.len() < count {
        let name = draw.pick(&ON_CONNECTOR).unwrap_or("coulomb");
        // In series with another effect, or as the damper of a model without one: alone.
        let alone = ["backlash", "support_compliance", "viscous"].contains(&name);
        if (count != 2 || !alone) && !names.contains(&name) {
            names.push(name);
        }
    }
    let conditioned = names.contains(&"coefficient") || draw.chance(0.2);
    let load = draw.chance(0.5);
    let condition = conditioned.then_some(if load { ("load", "N") } else { ("i", "mm") });
    let mut planted: Vec<Planted> = names
        .iter()
        .filter_map(|name| {
            let (effect, hidden) = match *name {
                "backlash" => (*name, Hidden::Gap),
                "support_compliance" => (*name, Hidden::Compliance),
                "coefficient" if load => ("load_stiffness", Hidden::Slope),
                "coefficient" => ("interference_law", Hidden::Exponent),
                name => (name, Hidden::Force(Law::of(name, sizes, &mut draw)?)),
            };
            Some(Planted { effect: effect.into(), hidden, size: draw.log(0.03, 0.3), place: 0 })
        })
        .collect();
    if kind == Kind::Outside {
        let (name, law) = Law::outside(sizes, &mut draw);
        planted.push(Planted { effect: format!("outside: {name}"), hidden: Hidden::Force(law), size: draw.log(0.05, 0.3), place: 0 });
    }
    // Either sign where the library admits both.
    let signed = ["cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness", "interference_law", "load_stiffness"];
    planted.iter_mut().filter(|p| signed.contains(&p.effect.as_str())).for_each(|p| p.size *= draw.sign());
    let damper = draw.log(0.02, 0.2) * k / (sizes.w.0 * sizes.w.1).sqrt();
    let with_damper = !names.contains(&"viscous") && draw.chance(0.7);
    let bench = Bench {
        bodies: 0,
        mass: 0.0,
        params: if with_damper { vec![k, damper] } else { vec![k] },
        force: k * travel,
        travel,
        parts: vec![],
    };
    let noise = draw.log(0.003, 0.015);
    let middle = low * (high / low).powf(draw.between(0.35, 0.65));
    // The corners are fitted; what decides and what is held out lies between and among them.
    let corners = [(low, 1.0), (high, 1.0), (low, 0.4), (high, 0.5), (middle, 0.7)];
    let between = [(middle, 1.0), (low * (middle / low).sqrt(), 0.8), (high / (high / middle).sqrt(), 0.6)];
    let splits = ["fit", "fit", "fit", "fit", "fit", "select", "select", "held_out"];
    let tests = corners.iter().chain(&between).zip(splits).enumerate().map(|(j, ((frequency, part), split))| {
        let u = draw.between(-0.5, 0.5);
        let value = if load { format!("{:.3} N", 100.0 + 80.0 * u) } else { format!("{:.4} mm", 0.4 + 0.4 * u) };
        let frequency = round(if sparse { middle } else { *frequency }, 3);
        let drive = Drive::Loop { frequency, amplitude: travel * part, mean: 0.0, discard: 2, bodies: vec![] };
        Test { id: format!("loop-{}", j + 1), drive, noise, split, condition: conditioned.then_some((value, u)), record: Record::default() }
    });
    let tests: Vec<Test> = tests.collect();
    let (mut nuisances, mut instrument) = (Vec::new(), None);
    if draw.chance(0.5) {
        nuisances.push(Flaw { effect: "gain", test: "*".into(), role: "force", size: 0.003 * draw.normal() });
        nuisances.push(Flaw { effect: "delay", test: "*".into(), role: "force", size: 3e-4 * draw.normal() });
        for (effect, part) in [("offset", 0.002), ("drift", 0.002)] {
            for t in tests.iter().filter(|_| effect == "offset").chain(tests.get(draw.below(tests.len())).filter(|_| effect == "drift")) {
                nuisances.push(Flaw { effect, test: t.id.clone(), role: "force", size: part * draw.normal() });
            }
        }
    }
    if kind == Kind::Instrument {
        let effect = draw.pick(&["gain", "delay", "offset", "drift", "moving_mass"]).unwrap_or("gain");
        let test = if effect == "moving_mass" { "*".into() } else { format!("loop-{}", 1 + draw.below(5)) };
        let size = if effect == "moving_mass" { draw.log(0.02, 0.2) } else { draw.log(0.015, 0.1) * draw.sign() };
        instrument = Some(Flaw { effect, test, role: "force", size: if effect == "delay" { 0.2 * size } else { size } });
    }
    drafted(bench, tests, condition, planted, (instrument, nuisances), draw)
}

fn in_chain(kind: Kind, realistic: bool, mut draw: Draw) -> Generated {
    let (least, most) = life::SETTINGS.bodies;
    let bodies = match realistic {
        true => least + draw.below(most + 1 - least),
        false if draw.chance(0.1) => 22,
        false => 3 + draw.below(6),
    };
    let (k, mass) = (draw.log(5e4, 5e5), draw.log(0.05, 0.3));
    let k_base = k * draw.log(0.5, 2.0);
    // First mode of a uniform chain, fixed at one end.
    let first = (k / mass).sqrt() * TAU / (4.0 * (2.0 * bodies as f64 + 1.0)) * 2.0;
    let c = 2.0 * draw.between(0.02, 0.05) * k / first;
    let bench_force = draw.log(20.0, 100.0);
    let (loops, frfs, hits) =
        [(true, false, false), (false, true, false), (true, true, false), (false, false, true), (false, true, true)][draw.below(5)];
    let f1 = first / TAU;
    let (low, high) = (f1 * draw.log(0.03, 0.06), f1 * draw.between(0.2, 0.4));
    let travel = 1.3 * bench_force / k;
    let band = if loops || hits { (TAU * low, TAU * high) } else { (first * 0.3, first * 6.0) };
    let sizes = Sizes { x: travel, w: band };
    let count = if kind == Kind::Two { 2 } else { usize::from(kind == Kind::One) };
    let pool: &[&str] = if loops || hits { &IN_CHAIN } else { &IN_FRF };
    let mut planted: Vec<Planted> = Vec::new();
    while planted.len() < count {
        let Some(name) = draw.pick(pool) else { break };
        let place = draw.below(bodies);
        let hidden = match (name, Law::of(name, sizes, &mut draw)) {
            ("support_compliance", _) => Hidden::Compliance,
            (_, Some(law)) => Hidden::Force(law),
            _ => continue,
        };
        if planted.iter().all(|p| p.effect != name && p.place != place) {
            planted.push(Planted { effect: name.into(), hidden, size: draw.log(0.05, 0.4), place });
        }
    }
    if kind == Kind::Outside {
        let (name, law) = Law::outside(sizes, &mut draw);
        planted.push(Planted {
            effect: format!("outside: {name}"),
            hidden: Hidden::Force(law),
            size: draw.log(0.1, 0.4),
            place: draw.below(bodies),
        });
    }
    let params = vec![k_base, c * draw.log(0.5, 2.0), k, c];
    let bench = Bench { bodies, mass, params, force: bench_force, travel, parts: vec![] };
    let noise = draw.log(0.003, 0.01);
    let all: Vec<usize> = (1..=bodies).filter(|b| bodies < 10 || b % 3 == 1).collect();
    // Transients have died away to a few parts in ten thousand.
    let settle = |f: f64| 2 + (8.0 * f * TAU / (first * first * c / (2.0 * k) * TAU)).ceil().max(1.0) as usize;
    let mut tests = Vec::new();
    if loops || (kind == Kind::Outside && !hits) {
        let middle = (low * high).sqrt();
        let drives = [(low, 1.0, "fit"), (high, 0.6, "fit"), (middle, 0.4, "fit"), (middle, 0.8, "select"), (high, 1.0, "held_out")];
        for (j, (f, part, split)) in drives.into_iter().enumerate() {
            let f = round(f, 3);
            let drive = Drive::Loop { frequency: f, amplitude: bench_force * part, mean: 0.0, discard: settle(f), bodies: all.clone() };
            tests.push(Test { id: format!("loop-{}", j + 1), drive, noise, split, condition: None, record: Record::default() });
        }
    }
    if hits {
        // Half a period of the first mode long, so that the fast modes are hardly struck.
        let period = 1.0 / f1;
        // The last body and one in the middle that is another.
        let two: Vec<usize> = [bodies, (1 + bodies / 2).min(bodies - 1)].into_iter().filter(|b| *b > 0).collect();
        for (j, (part, split)) in [(1.0, "fit"), (0.3, "fit"), (0.6, "select"), (0.8, "held_out")].into_iter().enumerate() {
            let drive = Drive::Hit {
                length: 0.5 * period,
                force: 0.5 * bench_force * part,
                dt: period / HIT_SAMPLES as f64,
                samples: HIT_PERIODS * HIT_SAMPLES,
                bodies: two.clone(),
            };
            tests.push(Test { id: format!("hit-{}", j + 1), drive, noise, split, condition: None, record: Record::default() });
        }
    }
    // Only laws with a limit at small motion have a frequency response.
    let shown = |p: &Planted| matches!(&p.hidden, Hidden::Force(law) if law.small(1.0).is_none());
    if frfs && !planted.iter().any(shown) && kind != Kind::Outside {
        let lines: Vec<f64> = (0..200).map(|j| (f1 * (0.3 + 5.7 * f64::from(j) / 199.0) * 1e3).round() / 1e3).collect();
        for (j, split) in ["fit", "fit", "select", "held_out"].into_iter().enumerate() {
            let respond = if j == 0 { bodies } else { 1 + draw.below(bodies) };
            tests.push(Test {
                id: format!("frf-{}", j + 1),
                drive: Drive::Frf { respond, lines: lines.clone() },
                noise,
                split,
                condition: None,
                record: Record::default(),
            });
        }
    }
    let (mut nuisances, mut instrument) = (Vec::new(), None);
    let role = if loops || hits { "displacement" } else { "response" };
    if draw.chance(0.5) {
        nuisances.push(Flaw { effect: "gain", test: "*".into(), role, size: 0.002 * draw.normal() });
    }
    if kind == Kind::Instrument {
        let test = draw.pick(&[0usize, 1]).and_then(|j| tests.get(j)).map_or("*".into(), |t| t.id.clone());
        let effect = if draw.chance(0.5) || hits { "gain" } else { "delay" };
        instrument =
            Some(Flaw { effect, test, role, size: draw.log(0.015, 0.1) * draw.sign() * if effect == "delay" { 0.2 } else { 1.0 } });
    }
    drafted(bench, tests, None, planted, (instrument, nuisances), draw)
}

/// So many significant digits.
pub fn round(f: f64, digits: i32) -> f64 {
    let scale = 10f64.powi(digits - 1 - f.log10().floor() as i32);
    (f * scale).round() / scale
}

/// A case whose hidden effects have no size yet.
fn drafted(
    bench: Bench,
    tests: Vec<Test>,
    condition: Option<(&'static str, &'static str)>,
    planted: Vec<Planted>,
    (instrument, nuisances): (Option<Flaw>, Vec<Flaw>),
    mut draw: Draw,
) -> Generated {
    let starts = bench.params.iter().map(|_| draw.log(0.7, 1.4)).collect();
    let (noncentrality, search, life, measured) = (0.0, None, None, vec![]);
    Generated { bench, tests, condition, planted, instrument, nuisances, noncentrality, starts, draw, search, life, measured }
}

/// Scales what is hidden until it can be seen.
fn sized(case: &mut Generated) {
    let fitted: Vec<Test> = case.tests.iter().filter(|t| t.split == "fit").cloned().collect();
    for _ in 0..GROWTHS {
        let seen = noncentralities(&case.bench, &case.planted, case.instrument.as_ref(), &fitted);
        case.noncentrality = seen.iter().copied().reduce(f64::min).unwrap_or(0.0);
        if seen.iter().all(|n| *n >= NONCENTRALITY) {
            break;
        }
        for (p, n) in case.planted.iter_mut().zip(&seen) {
            if *n < NONCENTRALITY && p.size.abs() * GROWTH <= LARGEST {
                p.size *= GROWTH;
            }
        }
        if let Some(flaw) = case.instrument.as_mut().filter(|f| f.size.abs() < 0.2) {
            flaw.size *= GROWTH;
        }
    }
}

/// For each hidden effect (or the instrument's) the squared length of what it adds to the whitened fit tests, beyond what the free
/// parameters of the model, the other hidden effect and instruments within tolerance can imitate; the last as columns with a prior.
fn noncentralities(bench: &Bench, planted: &[Planted], instrument: Option<&Flaw>, tests: &[Test]) -> Vec<f64> {
    let flaws: Vec<Flaw> = instrument.into_iter().cloned().collect();
    if planted.is_empty() && flaws.is_empty() {
        return vec![];
    }
    let reference: Vec<_> = tests.iter().map(|t| bench.read(&bench.params, planted, &flaws, tests, t)).collect();
    let whole = bench.seen(&bench.params, planted, &flaws, tests, &reference);
    let differs = |other: Vec<f64>| -> DVector<f64> { DVector::from_iterator(whole.len(), whole.iter().zip(&other).map(|(a, b)| a - b)) };
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for j in 0..bench.params.len() {
        let mut params = bench.params.clone();
        params[j] *= 1.0 + 1e-4;
        columns.push(differs(bench.seen(&params, planted, &flaws, tests, &reference)) * 1e4);
    }
    let mut own: Vec<DVector<f64>> = (0..planted.len())
        .map(|j| {
            let others: Vec<Planted> = planted.iter().enumerate().filter(|(i, _)| *i != j).map(|(_, p)| p.clone()).collect();
            differs(bench.seen(&bench.params, &others, &flaws, tests, &reference))
        })
        .collect();
    if !flaws.is_empty() {
        own.push(differs(bench.seen(&bench.params, planted, &[], tests, &reference)));
    }
    let tolerances = bench.tolerances(tests, &reference);
    // Below the data stand the rows of the priors, one for each error of an instrument.
    let (n, errors) = (whole.len(), tolerances.len());
    let below = |c: &DVector<f64>| c.clone().resize_vertically(n + errors, 0.0);
    let left = |j: usize| -> f64 {
        let others = own.iter().enumerate().filter(|(i, _)| *i != j).map(|(_, c)| c);
        let mut all: Vec<DVector<f64>> = columns.iter().chain(others).map(below).collect();
        all.extend(tolerances.iter().enumerate().map(|(k, c)| {
            let mut c = below(&DVector::from_column_slice(c));
            c[n + k] = 1.0;
            c
        }));
        let scaled: Vec<_> = all.into_iter().filter(|c| c.norm() > 0.0).map(|c| c.normalize()).collect();
        if scaled.is_empty() {
            return own[j].norm_squared();
        }
        let q = DMatrix::from_columns(&scaled).qr().q();
        let own = below(&own[j]);
        (&own - &q * q.tr_mul(&own)).norm_squared()
    };
    (0..own.len()).map(left).filter(|n| !n.is_nan()).collect()
}
