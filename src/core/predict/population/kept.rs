//! The loosest tolerances of parts that keep the yield over all bands, and their check on draws of their own.

use crate::study::{Banded, SynthesisSpec};
use crate::tolerance::synthesis::Question;
use crate::tolerance::{AreaLaw, Limited, Synthesis, deviation};

use super::{Asked, Whole, wilson};

/// A chosen width.
#[derive(Clone, Debug, PartialEq)]
pub struct Width {
    /// Name of the tolerance.
    pub name: String,
    /// Width of the case it began with [m].
    pub before: f64,
    /// Width that was found, or the least one where nothing was [m].
    pub width: f64,
    /// Its cost.
    pub cost: f64,
}

/// Outcome of the synthesis.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// Case it began with.
    pub case: String,
    /// Yield asked for.
    pub asked: f64,
    /// Yield of the case as it stands.
    pub before: f64,
    /// Yield on draws of their own, with its 95 % interval.
    pub reached: (f64, (f64, f64)),
    /// Widths.
    pub widths: Vec<Width>,
    /// Cost before and after.
    pub cost: (f64, f64),
    /// Conic programmes solved.
    pub programmes: usize,
    /// Where it is infeasible: what stands in the way, in words.
    pub in_the_way: Option<String>,
    /// What other yields cost, rising.
    pub curve: Vec<Priced>,
}

/// The cost of the loosest tolerances that keep a yield.
#[derive(Clone, Debug, PartialEq)]
pub struct Priced {
    /// Yield asked for.
    pub asked: f64,
    /// Yield on draws of their own.
    pub reached: f64,
    /// Cost.
    pub cost: f64,
}

/// Yields whose cost is told beside that of the one asked for.
const YIELDS: [f64; 8] = [0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.9973, 0.999];
/// Draws at most behind each of these costs.
const FEW: usize = 20_000;

/// Tolerances the synthesis may choose.
fn chosen(whole: &Whole) -> Vec<usize> {
    (0..whole.parts.parts.len()).filter(|k| whole.parts.parts[*k].cost.is_some()).collect()
}

/// Least and greatest width: as stated, or as the cases have them.
fn range(whole: &Whole, k: usize) -> (f64, f64) {
    let stated = whole.parts.parts[k].range;
    let (low, high) = super::bounds(whole.laws.iter().map(|l| l.1[k]));
    let (low, high) = (if stated.0.is_nan() { low } else { stated.0 }, if stated.1.is_nan() { high } else { stated.1 });
    (low.min(high), high)
}

/// The law and the widths with the largest deviations that the synthesis may try; none where it is not asked for.
pub(super) fn widest(whole: &Whole) -> Option<(AreaLaw, Vec<f64>)> {
    let spec = whole.parts.synthesis.as_ref()?;
    let case = whole.table.cases.cases.iter().position(|c| c.name == spec.case)?;
    let (law, mut widths) = whole.laws[case].clone();
    chosen(whole).into_iter().for_each(|k| widths[k] = range(whole, k).1.max(widths[k]));
    Some((law, widths))
}

/// The synthesis from a case.
pub(super) fn kept(whole: &Whole, case: usize, spec: &SynthesisSpec, draws: &[f64], how: Asked) -> Kept {
    let (law, start) = &whole.laws[case];
    let chosen = chosen(whole);
    let d = whole.all.len();
    let split = |draws: &[f64]| {
        let mut without = start.clone();
        chosen.iter().for_each(|k| without[*k] = 0.0);
        let fixed: Vec<f64> = draws.chunks_exact(d).map(|s| law.log_area(&without, s)).collect();
        let slopes: Vec<f64> =
            draws.chunks_exact(d).flat_map(|s| chosen.iter().map(|k| law.slope(*k, s[*k])).collect::<Vec<_>>()).collect();
        (fixed, slopes)
    };
    let (fixed, slopes) = split(draws);
    let surrogate = &whole.surrogates[whole.of[case]];
    let quantities: Vec<(Banded, (f64, f64))> = whole.quantities().into_iter().filter_map(|q| Some((q, whole.band(q)?))).collect();
    let value = |q: Banded| move |x: f64| whole.at(case, q, x);
    let slope = |q: Banded| {
        move |x: f64| {
            // k over 1 / W_s under force control, over W_s under displacement control.
            let falls = q == Banded::Stiffness && whole.range.1 == crate::data::Control::Force;
            whole.at(case, q, x) * surrogate.slope(whole.which(q), x) * if falls { -1.0 } else { 1.0 }
        }
    };
    type Of<'b> = Box<dyn Fn(f64) -> f64 + Sync + 'b>;
    let functions: Vec<(Of, Of)> = quantities.iter().map(|(q, _)| (Box::new(value(*q)) as Of, Box::new(slope(*q)) as Of)).collect();
    let limited = || -> Vec<Limited> {
        functions.iter().zip(&quantities).map(|((value, slope), (_, band))| Limited { value, slope, band: *band }).collect()
    };
    let costs: Vec<f64> = chosen.iter().filter_map(|k| whole.parts.parts[*k].cost).collect();
    let ranges: Vec<(f64, f64)> = chosen.iter().map(|k| range(whole, *k)).collect();
    let begin: Vec<f64> = chosen.iter().map(|k| start[*k]).collect();
    let list = limited();
    let question =
        |fixed, slopes| Question { fixed, slopes, costs: &costs, ranges: &ranges, start: &begin, limited: &list, asked: spec.asked };
    let ask = question(&fixed, &slopes);
    let few = how.draws.min(FEW);
    let least: Vec<f64> = ranges.iter().map(|r| r.0).collect();
    let (widths, programmes, in_the_way) = match ask.answer() {
        Synthesis::Found { widths, programmes, .. } => (widths, programmes, None),
        Synthesis::Infeasible { reached, in_the_way, part } => {
            let name = in_the_way.map_or("rest", |k| whole.all[chosen[k]].name.as_str());
            let words = format!(
                "with every tolerance at its least width {:.2} % keep the bands; `{name}` carries {:.0} % of the spread there",
                100.0 * reached,
                100.0 * part
            );
            (least, 0, Some(words))
        }
    };
    // The yield that is told comes from draws that were not chosen on.
    let others = deviation::draws(&whole.all, &whole.factor, how.draws, how.seed.wrapping_add(0x7fff));
    let (other_fixed, other_slopes) = split(&others);
    let reached = question(&other_fixed, &other_slopes).reached(&widths);
    // The same question on fewer draws for every other yield, until one is out of reach.
    let m = chosen.len();
    let price = |asked: f64| match (Question { asked, ..question(&fixed[..few], &slopes[..few * m]) }).answer() {
        Synthesis::Found { widths, cost, .. } => {
            Some(Priced { asked, cost, reached: question(&other_fixed[..few], &other_slopes[..few * m]).reached(&widths) })
        }
        Synthesis::Infeasible { .. } => None,
    };
    let curve = crate::parallel::map(&YIELDS, |y| price(*y)).into_iter().map_while(|p| p).collect();
    Kept {
        case: spec.case.clone(),
        asked: spec.asked,
        before: ask.reached(&begin),
        reached: (reached, wilson(reached, how.draws)),
        cost: (ask.cost(&begin), ask.cost(&widths)),
        widths: chosen
            .iter()
            .zip(&widths)
            .zip(&costs)
            .map(|((k, w), c)| Width { name: whole.all[*k].name.clone(), before: start[*k], width: *w, cost: c / w })
            .collect(),
        programmes,
        in_the_way,
        curve,
    }
}
