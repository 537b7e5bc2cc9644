//! Constants of how the search computes and of what it tells. None of them decides what is believed.

use serde::Serialize;

/// How fits are begun and ended.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Fitting {
    /// Relative error of an FRF from which its peaks do not overlap the measured ones, of a record from which it is out of phase: it is approached
    /// from afar.
    pub far_off: f64,
    /// Relative change of the cost at which the approach ends...
    pub near_enough: f64,
    /// ...and its most iterations.
    pub approach: u64,
    /// What a parameter may be off from its start for one unit of the approach's prior, as part of it or, of a logarithm, in the logarithm.
    pub near: f64,
    /// Doublings of a record's first cycles at most.
    pub doublings: u32,
    /// Fall of the cost that is worth no step: residuals are in units of their noise, so that it moves no parameter by more than
    /// `sqrt(2e-5)`, half a hundredth, of its standard deviation.
    pub worth_no_step: f64,
    /// Relative change of the cost at which a fit ends that decides between candidates, or stands above the noise.
    pub coarse: f64,
    /// Root mean square of the whitened residuals from which intervals do not hold.
    pub misses: f64,
    /// Root mean square of the whitened residuals of a test below which its sigma is told to be too large: noise leaves 1...
    pub too_quiet: f64,
    /// ...of so many residuals for each free parameter: few are fitted closely.
    pub per_parameter: usize,
    /// A parameter without an upper bound that the data do not identify and that ends this many times beyond its start is no value of the field
    /// any more: the data do not hold it, or they contradict the model.
    pub ran_away: f64,
    /// Size of the computed responses of the tests driven by a force, as a part of the measured ones (both in units of noise), below which the model stands
    /// still there: at its best it then explains the square of that, a twenty-fifth, of what was measured.
    pub stands_still: f64,
    /// Of the parameters of a model that stands still, those are named that have gone this part of the way (in the logarithm of their value) of the one that
    /// has gone furthest.
    pub part_of_the_way: f64,
    /// Times its start and its plain fit that a coefficient without an upper bound may come to in the search: two decades.
    pub known: f64,
    /// Times where a plain fit begins, and one over it, within which a positive shape stays that no bound holds: six decades to either side.
    pub shape_reach: f64,
}

/// How candidates are scored.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Scoring {
    /// A column keeps at least this part of itself after projection, or the data cannot tell it from what the model has.
    pub visible: f64,
    /// Singular value of columns of unit length below which a combination of them is numerically nothing...
    pub dependent: f64,
    /// ...and below which what it would have to do of a candidate is no guide.
    pub shows: f64,
    /// Draws of the null distribution of the best score.
    pub draws: usize,
    /// Trials beyond which their correlation is drawn in the directions that they lie in...
    pub condensed: usize,
    /// ...so many of which are found at once: the size of a product of matrices, which changes the time alone...
    pub directions: usize,
    /// ...and what may be left of a column beyond these, in parts of it.
    pub apart: f64,
    /// Trials that would pass, in a draw, the level at which candidates are counted as choices: what is taken lies far out.
    pub passing: f64,
    /// Columns that the sparse combination weighs, those of the highest scores.
    pub columns: usize,
    /// Price of a column there in parts of the best score, where chance does not ask for more.
    pub price: f64,
    /// Part of the largest weight below which a column has not entered.
    pub entered: f64,
    /// Part of the explained cost below which a candidate is not worth a word.
    pub word: f64,
    /// Level of the null distribution of the best score that is beyond chance...
    pub beyond_chance: f64,
    /// ...and the probability with which a strength that would have been seen passes it.
    pub power: f64,
}

/// What is told of a model beside the verdict.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Telling {
    /// Standard deviations beyond which a statistic of the residuals is claimed; about 1 in 1000 by chance.
    pub finding: f64,
    /// Part of the measured signal whose chance of being found is told beside a finding.
    pub finding_power: f64,
    /// Bands into which an FRF is cut to say where its misfit is largest.
    pub bands: usize,
    /// Transient that may be left in the mean of the kept cycles, in units of sigma: its square is a tenth of the noise's.
    pub transient: f64,
    /// Standard errors beyond which the damping of a model differs from a constant ratio.
    pub standard_errors: f64,
    /// One strength that carries the whole loss is searched from this part of its value to its inverse...
    pub strength_reach: f64,
    /// ...it counts as weak at this part of its value...
    pub weak: f64,
    /// ...where this part of every loss is left if it carries them all...
    pub falls: f64,
    /// ...with so many values tried over the range...
    pub strengths: usize,
    /// ...so many iterations that narrow the best down...
    pub narrowing: u64,
    /// ...and the relative change of the strength at which they end.
    pub narrow: f64,
    /// Points of the grid on which the model error of the held-out tests is looked for...
    pub held_out_points: usize,
    /// ...and its span from the least one, in logarithms.
    pub held_out_span: f64,
    /// Terms of a formula for what is unexplained at most...
    pub terms: usize,
    /// ...part of the cost that a further one must take away...
    pub term: f64,
    /// ...nats beyond half the logarithm of the data that it must gain, for the terms among which it was chosen...
    pub term_nats: f64,
    /// ...factor on the strength that its column has within which it is fitted...
    pub term_reach: f64,
    /// ...and points of its picture for each loop at most.
    pub picture: usize,
    /// Slopes at the outer and the inner nodes, over that at rest, from which a spline is fitted: one that levels off, one that hardens...
    pub spline_begins: [[f64; 2]; 2],
    /// ...and the part of the largest force at a place that it has at the largest motion there.
    pub spline_takes: f64,
    /// Median deviation of ln(measured / computed) over the lines of an FRF (from a constant times a power of the frequency) within which the two differ by that
    /// constant alone: half of the lines lie within a third.
    pub same_factor: f64,
    /// Range of ln of the computed accelerance over the lines that it needs for that: one line of stiffness or of mass is any other, by a factor or a power.
    pub shaped: f64,
    /// Mean cosine of the angle between the measured lines and the computed ones (times the power of i w) beyond which their phases agree.
    pub same_phase: f64,
    /// Distance of ln of the constant from that of a factor between units, as a part of the former, at which it is that factor, where the lines scatter by
    /// less: a start that is off by a fifth is told from a prefix, and 8 from 9.81 and from 2 pi.
    pub same_unit: f64,
    /// Part of a mode's energy below which a place is not told.
    pub energy: f64,
    /// Part of a mode's strain energy beyond which the fixture that holds it is told.
    pub fixture: f64,
}

impl Default for Fitting {
    fn default() -> Self {
        Fitting {
            far_off: 0.5,
            near_enough: 5e-2,
            approach: 40,
            near: 1.0,
            doublings: 16,
            worth_no_step: 1e-5,
            coarse: 1e-5,
            misses: 1.5,
            too_quiet: 0.5,
            per_parameter: 10,
            ran_away: 1e9,
            stands_still: 0.2,
            part_of_the_way: 0.5,
            known: 100.0,
            shape_reach: 1e6,
        }
    }
}

impl Default for Scoring {
    fn default() -> Self {
        Scoring {
            visible: 1e-3,
            dependent: 1e-8,
            shows: 1e-4,
            draws: 10_000,
            condensed: 1000,
            directions: 48,
            apart: 0.05,
            passing: 0.5,
            columns: 120,
            price: 0.1,
            entered: 1e-4,
            word: 0.02,
            beyond_chance: 0.99,
            power: 0.9,
        }
    }
}

impl Default for Telling {
    fn default() -> Self {
        Telling {
            finding: 3.3,
            finding_power: 0.1,
            bands: 12,
            transient: 0.3,
            standard_errors: 2.0,
            strength_reach: 1e3,
            weak: 1e-3,
            falls: 0.1,
            strengths: 25,
            narrowing: 60,
            narrow: 1e-3,
            held_out_points: 40,
            held_out_span: 7.6,
            terms: 4,
            term: 0.03,
            term_nats: 2.0,
            term_reach: 20.0,
            picture: 200,
            spline_begins: [[0.3, 0.6], [3.0, 1.5]],
            spline_takes: 0.3,
            same_factor: 0.3,
            shaped: 2.0,
            same_phase: 0.7,
            same_unit: 0.03,
            energy: 0.02,
            fixture: 0.5,
        }
    }
}
