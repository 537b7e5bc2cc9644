"""What the verbs give: the fields of the JSON that the command line prints, with its meanings. SI units where no other stands beside a number.

Written by `python/make-results` from the JSON Schemas of `misfit schema`.
"""

from __future__ import annotations

from typing import Any, Literal

import msgspec

from ._run import Run

Against = Literal["better", "worse", "tied"]
"""A model beside a constant."""

class ConstantDamping(msgspec.Struct, kw_only=True):
    """Damping of the modes of a test that is not fitted: the model beside one constant ratio."""
    constant: float | None
    """The same of the constant."""
    gain: float | None
    """Mean over the modes of the difference of these squares, constant less model."""
    model: float | None
    """Root mean square over the modes of computed / measured - 1."""
    modes: int
    """Modes compared."""
    ratio: float | None
    """The constant: mean of the damping ratios measured of the fitted modes."""
    standard_error: float | None
    """Its standard error, paired by modes."""
    verdict: Against
    """What that says."""


class EffectAt(msgspec.Struct, kw_only=True):
    """An effect and its place."""
    at: str
    """Place."""
    effect: str
    """Name of the effect."""
    of: str | None = None
    """Of a coefficient, the parameter that it acts on and the condition: `viscous.c over i`."""


class EnergyShare(msgspec.Struct, kw_only=True):
    """A part of a mode's energy."""
    at: str
    """General forces or bodies that share it."""
    share: float | None
    """Share of the whole; that of the forces present (geometric stiffness) may be below 0."""


class Factor(msgspec.Struct, kw_only=True):
    """How far off the energies of one channel of a table are, as factors: energies run over decades."""
    channel: str
    """`W_D per cycle at c1.x`."""
    largest: float | None
    """Largest of computed / measured and its inverse, exp(max |ln(computed / measured)|)."""
    strength: OneStrength | None = None
    """Where one strength carries the whole loss: what it can reach at best."""


class FitResult(msgspec.Struct, kw_only=True):
    """Result of `fit`."""
    cost: float | None
    """1/2 ||r||^2 over the fitted tests and priors."""
    effects: list[EffectAt]
    """Effects of the model."""
    iterations: int
    """Iterations."""
    model_error: list[OwnError]
    """The model's own error, channel by channel, on the fitted tests."""
    n_free: int
    """Free parameters."""
    n_residuals: int
    """Rows."""
    noise: float | None
    """True noise over that seen between cycles or stated; 1 where it is not estimated. Below 1 it is no finding: where the model errs in some
    harmonics more than in others, the estimate takes it from the noise."""
    notes: list[str]
    """Notes on data and fit."""
    parameters: list[ParameterResult]
    """Free parameters."""
    readings: list[Reading]
    """What instruments read wrong by this model, beyond what they may err by."""
    scatter: list[ScatterOf]
    """How much strengths differ from test to test."""
    study: str
    """Name of the study."""
    termination: str
    """converged, stalled, max_iterations, interrupted, failed."""
    tests: list[TestResult]
    """Every test of the study."""
    unidentifiable: list[str]
    """Combinations the data do not determine, in words."""
    wall_s: float | None
    """Wall time [s]."""


class LargestDifference(msgspec.Struct, kw_only=True):
    """`Curve::largest_difference` of one channel, as a fraction."""
    channel: str
    """`displacement at P.x`."""
    fraction: float | None
    """The difference as a fraction of that."""
    over: str
    """What it is over: `range`, `range of magnitude` or `value`."""


Misreading = Literal["gain", "offset", "delay", "bend", "jump", "drift"]
"""How an instrument may misread."""

class ModeEnergy(msgspec.Struct, kw_only=True):
    """One mode of a modal table in the model."""
    computed: float | None
    """As computed [Hz]."""
    finding: str | None = None
    """Where a fixture holds more than half of the strain energy, what to think of it."""
    kinetic: list[EnergyShare]
    """Kinetic energy by body, the largest shares."""
    measured: float | None
    """Natural frequency as measured [Hz]."""
    mode: int
    """Its number in the table."""
    strain: list[EnergyShare]
    """Strain energy by general force, the largest shares."""


class OneStrength(msgspec.Struct, kw_only=True):
    """What the one strength that carries the whole loss of a table can reach: the least largest factor (minimax) over its values."""
    best: float | None
    """The least largest factor."""
    parameter: str
    """The strength."""
    value: float | None
    """Its value there [SI]; all other parameters stay as they are."""
    weak: float | None
    """The same where the strength is weak (a thousandth of its value), the losses are proportional to it and the motion is that of the model
    without: exp of half the range of ln(computed / measured)."""


class OwnError(msgspec.Struct, kw_only=True):
    """The model's own error in a channel."""
    channel: str
    """`force at c1.x`."""
    kind: str
    """cycle, frf, transient, energy, modal, backbone."""
    relative: float | None
    """Root mean square over tests, relative to the response."""


class ParameterResult(msgspec.Struct, kw_only=True):
    """One parameter."""
    at_bound: bool
    """Whether it lies at a bound."""
    identifiable: bool
    """Whether the data determine it."""
    interval: tuple[float | None, float | None]
    """95 % interval [SI], open ends none."""
    name: str
    """`at.effect.parameter`."""
    note: str | None
    """Why it is not identified."""
    printed: str
    """Value as the engineer writes it, `20.3 N/mm`."""
    printed_interval: str
    """Interval in the same unit, `19.9 to 20.7 N/mm`."""
    std: float | None
    """Standard deviation [SI]; none where it is not identified."""
    unit: str
    """SI unit."""
    value: float | None
    """Value [SI]."""


class Reading(msgspec.Struct, kw_only=True):
    """What an instrument reads wrong by a model, beyond what it may err by."""
    channel: str
    """`force at c1.x`."""
    deviations: float | None
    """The same in standard deviations of what the instrument may err by."""
    misreading: Misreading
    """How it misreads."""
    part: float | None
    """How much, most likely: gain relative, offset in parts of the amplitude, delay in parts of the period (of the shortest one of an FRF),
    bend in parts of the largest reading, jump in parts of it. Above 0 it reads less, or late."""
    test: str
    """Test."""


class ScatterOf(msgspec.Struct, kw_only=True):
    """How much a strength differs from test to test."""
    kind: str
    """Between tests of which kind: cycle, frf, transient, energy, modal, backbone."""
    parameter: str
    """`at.effect.parameter`."""
    relative: float | None
    """Standard deviation, relative."""


SplitName = Literal["fit", "select", "held_out"]
"""Which use a test serves."""

class TestResult(msgspec.Struct, kw_only=True):
    """One test against the model."""
    constant_damping: ConstantDamping | None = None
    """Of a table of modes that is not fitted, what a constant damping ratio does."""
    error: float | None
    """rms(measured - computed) / rms(measured - mean)."""
    factors: list[Factor] | None = None
    """Of a table of energies, how far each channel is off."""
    floor: float | None
    """The same with sigma in place of the difference."""
    id: str
    """Id of the test."""
    kind: str
    """cycle, frf, transient, energy, modal, backbone."""
    largest_difference: list[LargestDifference]
    """Largest difference over the range of the measured, channel by channel: the measure of the tensioner's paper."""
    modes: list[ModeEnergy] | None = None
    """Of a table of modes, where the energy of each is."""
    n: int
    """Number of measured values."""
    split: SplitName
    """Its split."""
    whitened_rms: float | None
    """Root mean square of the whitened residuals."""
    worst: Worst
    """Farthest point."""


class Worst(msgspec.Struct, kw_only=True):
    """The point of a test that lies farthest from the model in units of sigma."""
    computed: float | None
    """Computed value [SI]."""
    measured: float | None
    """Measured value [SI]."""
    where: str
    """Channel and abscissa, in words."""


class Add(Run, kw_only=True, dict=True):
    """Result of `add`."""
    added: EffectAt
    """The effect."""
    after: FitResult
    """Fit with it."""
    before: FitResult
    """Fit without the effect."""
    run: str
    """Folder of the run."""


class FailedTask(msgspec.Struct, kw_only=True):
    """A task that failed."""
    reason: str
    """Why it failed."""
    task: str
    """What it differs in."""


class Campaign(Run, kw_only=True, dict=True):
    """Result of `campaign`."""
    computed: int
    """Tasks computed in this run; the others were there."""
    done: int
    """Tasks with a result."""
    failed: list[FailedTask]
    """Tasks that failed."""
    interrupted: bool
    """Whether it was stopped."""
    of_other_inputs: int
    """Earlier results of other inputs."""
    report: str
    """HTML page."""
    table_: str = msgspec.field(name="table")
    """Parquet file with a row a task."""
    tasks: int
    """Tasks of the campaign."""


class Free(msgspec.Struct, kw_only=True):
    """A free parameter at the gate."""
    moves_residual: bool
    """Whether any residual depends on it."""
    name: str
    """`at.effect.parameter`."""


class Problem(msgspec.Struct, kw_only=True):
    """What is wrong, where, and what would be accepted."""
    accepted: str
    """What would be accepted."""
    message: str
    """What is wrong."""
    stage: str
    """Stage: data, study, model, identify, ..."""
    where: str
    """File and line, test, or option."""


class Check(Run, kw_only=True, dict=True):
    """Result of `check`."""
    findings: list[str]
    """Remarks on data and model."""
    free: list[Free]
    """Free parameters."""
    ok: bool
    """Whether a fit can begin."""
    problems: list[Problem]
    """What is wrong."""


class Compare(Run, kw_only=True, dict=True):
    """Result of `compare`."""
    run: str
    """Folder of the run."""
    study: str
    """Name of the study."""
    tests: list[TestResult]
    """Every test."""


class Candidate(msgspec.Struct, kw_only=True):
    """A candidate effect."""
    accepted: bool
    """Whether it earned its place."""
    at: str
    """Place."""
    effect: str
    """Name of the effect."""
    error_after: float | None
    """The same after the refit; none where it was not refitted."""
    error_before: float | None
    """Pooled error before."""
    nats: float | None
    """Nats that it gains beyond its price; none where it was not weighed."""
    of: str | None = None
    """For a coefficient: the parameter it acts on."""
    p_value: float | None
    """p-value of the best of all candidates under nothing missing, for this candidate's score."""
    predicted_drop: float | None
    """Fraction of the cost that the score test expects to fall."""
    reason: Reason
    """What was decided of it."""
    remark: str
    """The same in words."""
    selected: float | None
    """The second opinion: the part it has in a sparse nonnegative combination of all candidates' columns; none where it is not in it."""
    tied_with: list[str]
    """Candidates the data cannot tell from it, `effect at place`."""


Fault = Literal["small", "below_model_error", "unlike_others", "few_tests"]
"""Why the record speaks against a fault of an instrument."""

class Finding(msgspec.Struct, kw_only=True):
    """Something seen in the residuals."""
    claim: str
    """What is claimed, in words."""
    number: float | None
    """Statistic."""
    power: float | None
    """Probability of seeing an effect of 10 % of the signal."""
    test: str
    """Test."""
    threshold: float | None
    """Value beyond which it is claimed."""


class Missed(msgspec.Struct, kw_only=True):
    """The missing force along one cycle [SI]."""
    force: list[float | None]
    """Measured less computed; empty where nobody measured it."""
    formula: list[float | None]
    """The formula."""
    phase: list[float | None]
    """Phase [rad]."""
    test: str
    """Test; empty for the formula over a made-up cycle of the largest motion, where no test drives the place itself."""
    v: list[float | None]
    """Relative velocity."""
    x: list[float | None]
    """Relative displacement."""


class NextTest(msgspec.Struct, kw_only=True):
    """A test that would separate tied candidates."""
    amplitude: float | None
    """Half range of the drive; of an FRF the peak of its force, 0 for a small signal [SI]."""
    breaks: bool
    """Whether the tie broke there."""
    conditions: dict[str, float | None]
    """Conditions with another value [SI] than the test that it varies."""
    cut_short: bool
    """Whether the search for it ended for want of time; what was not simulated is then an estimate."""
    describe: str
    """In words."""
    frequency: float | None
    """Drive frequency; of an FRF its highest line, of a modal test 0 [Hz]."""
    kind: str
    """cycle, frf or modal."""
    mean: float | None
    """Mean of the drive [SI]."""
    separation: float | None
    """By how many sigma the true one fits better in the simulation, whichever is true: the root of twice the difference of the costs."""
    test: str
    """The test that it varies."""
    unit: str
    """SI unit of the amplitude."""


Reason = dict[str, Any]
"""What was decided of a candidate."""

class SecondOpinion(msgspec.Struct, kw_only=True):
    """What a sparse nonnegative combination of all candidates' columns says beside the scores of single ones."""
    agrees: bool
    """Whether its first is what was accepted or, without that, the best score, or is tied with it."""
    needs: list[Share]
    """What it needs, the largest part first; empty where nothing scores beyond chance."""
    remark: str | None
    """A word where the two disagree."""


class Share(msgspec.Struct, kw_only=True):
    """A candidate's part of what a combination explains."""
    at: str
    """Place."""
    effect: str
    """Effect."""
    part: float | None
    """Part, of 1."""


class Unexplained(msgspec.Struct, kw_only=True):
    """What would explain the rest."""
    at: str
    """Place."""
    error_after: float | None
    """The same with it."""
    error_before: float | None
    """Pooled error before, on the select tests; on the fit tests where there are none."""
    explains: float | None
    """Part of the cost on the fit tests that it takes away."""
    expression: str
    """The force as it was fitted: a formula, or the equation of a spline."""
    formula: str
    """The `[[effect]]` to be pasted into study.toml: formula, velocity_spline or displacement_spline."""
    picture: list[Missed]
    """The force that is missing, test by test."""


Verdict = Literal["missing", "nothing_missing", "unexplained"]
"""What a diagnosis says."""

class Diagnose(Run, kw_only=True, dict=True):
    """Result of `diagnose`."""
    candidates: list[Candidate]
    """Candidates, best first."""
    findings: list[Finding]
    """Findings."""
    fit: FitResult
    """The fit it stands on."""
    missing: list[EffectAt]
    """Best accepted, with its place."""
    next_test: NextTest | None
    """Test that separates the tied."""
    no_next_test: str | None
    """Where candidates are tied and no test within reach separates them: so much in words."""
    run: str
    """Folder of the run."""
    second_opinion: SecondOpinion
    """What all candidates at once say."""
    unexplained: Unexplained | None
    """Where something is unexplained: the force that would explain it, and a formula fitted to it."""
    verdict: Verdict
    """Verdict."""
    would_have_been_seen: list[str]
    """Strength of each candidate that would have been seen, where nothing is missing: name and value with unit."""


class Law(msgspec.Struct, kw_only=True):
    """A law of the library."""
    claim: str
    """What it claims."""
    effect: str
    """Name."""
    equation: str
    """Its equation."""
    family: str
    """Laws that are told apart with difficulty."""
    parameters: list[Parameter]
    """Its parameters."""
    role: str
    """force, series, coefficient, channel."""


class Parameter(msgspec.Struct, kw_only=True):
    """A parameter of a law."""
    name: str
    """Name."""
    sign: str
    """`>= 0`, `> 0`, `any`."""
    unit: str
    """Unit along an axis."""


class Effects(Run, kw_only=True, dict=True):
    """Result of `effects`."""
    effects: list[Law]
    """The library, or the one that was asked for."""


class Export(Run, kw_only=True, dict=True):
    """Result of `export`."""
    files: list[str]
    """Files that were written."""
    notes: list[str]
    """What a format cannot hold."""
    run: str
    """Folder of the run."""
    test: str
    """Test whose conditions the set stands at."""


class Fit(Run, kw_only=True, dict=True):
    """Result of `fit`."""
    bootstrap: Any | None = None
    """Bootstrap, where asked for."""
    cost: float | None
    """1/2 ||r||^2 over the fitted tests and priors."""
    effects: list[EffectAt]
    """Effects of the model."""
    iterations: int
    """Iterations."""
    model_error: list[OwnError]
    """The model's own error, channel by channel, on the fitted tests."""
    n_free: int
    """Free parameters."""
    n_residuals: int
    """Rows."""
    noise: float | None
    """True noise over that seen between cycles or stated; 1 where it is not estimated. Below 1 it is no finding: where the model errs in some
    harmonics more than in others, the estimate takes it from the noise."""
    notes: list[str]
    """Notes on data and fit."""
    parameters: list[ParameterResult]
    """Free parameters."""
    profiles: list[Any] | None = None
    """Profile likelihoods, where asked for."""
    readings: list[Reading]
    """What instruments read wrong by this model, beyond what they may err by."""
    run: str
    """Folder of the run."""
    scatter: list[ScatterOf]
    """How much strengths differ from test to test."""
    study: str
    """Name of the study."""
    termination: str
    """converged, stalled, max_iterations, interrupted, failed."""
    tests: list[TestResult]
    """Every test of the study."""
    unidentifiable: list[str]
    """Combinations the data do not determine, in words."""
    wall_s: float | None
    """Wall time [s]."""


class Correction(msgspec.Struct, kw_only=True):
    """What a study ties or fixes and the data do not."""
    at: str
    """Place."""
    parameter: str
    """Parameter."""
    relative: float | None
    """Deviation from what the study says, relative."""
    std: float | None
    """Its standard deviation."""


class Effort(msgspec.Struct, kw_only=True):
    """What a step of the search took."""
    refits: int
    """Candidates refitted."""
    refits_s: float | None
    """Time of the refits [s]."""
    score_s: float | None
    """Time of the score test [s]."""
    trials: int
    """Effects at places with their shapes that the score test weighed."""


class Fitting(msgspec.Struct, kw_only=True):
    """How fits are begun and ended."""
    approach: int
    """...and its most iterations."""
    coarse: float | None
    """Relative change of the cost at which a fit ends that decides between candidates, or stands above the noise."""
    doublings: int
    """Doublings of a record's first cycles at most."""
    far_off: float | None
    """Relative error of an FRF from which its peaks do not overlap the measured ones, of a record from which it is out of phase: it is
    approached from afar."""
    known: float | None
    """Times its start and its plain fit that a coefficient without an upper bound may come to in the search: two decades."""
    misses: float | None
    """Root mean square of the whitened residuals from which intervals do not hold."""
    near: float | None
    """What a parameter may be off from its start for one unit of the approach's prior, as part of it or, of a logarithm, in the logarithm."""
    near_enough: float | None
    """Relative change of the cost at which the approach ends..."""
    part_of_the_way: float | None
    """Of the parameters of a model that stands still, those are named that have gone this part of the way (in the logarithm of their value) of
    the one that has gone furthest."""
    per_parameter: int
    """...of so many residuals for each free parameter: few are fitted closely."""
    ran_away: float | None
    """A parameter without an upper bound that the data do not identify and that ends this many times beyond its start is no value of the field
    any more: the data do not hold it, or they contradict the model."""
    shape_reach: float | None
    """Times where a plain fit begins, and one over it, within which a positive shape stays that no bound holds: six decades to either side."""
    stands_still: float | None
    """Size of the computed responses of the tests driven by a force, as a part of the measured ones (both in units of noise), below which the
    model stands still there: at its best it then explains the square of that, a twenty-fifth, of what was measured."""
    too_quiet: float | None
    """Root mean square of the whitened residuals of a test below which its sigma is told to be too large: noise leaves 1..."""
    worth_no_step: float | None
    """Fall of the cost that is worth no step: residuals are in units of their noise, so that it moves no parameter by more than `sqrt(2e-5)`,
    half a hundredth, of its standard deviation."""


class HeldOut(msgspec.Struct, kw_only=True):
    """Pooled error of the held-out tests."""
    after: float | None
    """On the last."""
    before: float | None
    """On the first rung."""
    floor: float | None
    """Floor."""


class Instrument(msgspec.Struct, kw_only=True):
    """An instrument at fault."""
    at: str
    """Channel, `test.role`."""
    effect: str
    """gain, delay, offset, drift, moving_mass, accelerometer_mass, clipping."""
    tied_with: list[str]
    """`effect at place` of the tied."""
    why: str
    """What the record says, in words."""


class Missing(msgspec.Struct, kw_only=True):
    """A missing effect with what it cannot be told from."""
    at: str
    """Place."""
    effect: str
    """Name of the effect."""
    of: str | None = None
    """Of a coefficient, the parameter that it acts on: `film.f`."""
    proven: bool | None
    """Whether the held-out tests bear it out beside what else was added; none where there are none."""
    tied_with: list[str]
    """`effect at place` of the tied."""


class Proposals(msgspec.Struct, kw_only=True):
    """Which tests are tried, how many of them are simulated, and when one is good enough."""
    amplitudes: int
    """...and amplitudes (half ranges)..."""
    bands: list[float | None]
    """Factors on the lines of an FRF."""
    batch: int
    """...and those that are weighed at a time."""
    beyond: float | None
    """Part of a condition's value by which one that all tests share is changed; where it varies, half of its range beyond either end is
    tried."""
    enough: float | None
    """Separation that is aimed at, in standard deviations of noise: among proposals beyond it the one nearest to what was tested is taken."""
    excitations: list[float | None]
    """Factors on its excitation..."""
    frequencies: int
    """Frequencies of a cycle that are tried..."""
    iterations: int
    """Iterations of a refit to a simulated test: it begins at the fit to the measured ones."""
    least: float | None
    """The least time it gets [s]."""
    means: list[float | None]
    """Means that are tried about the best cycles, in parts of the half range."""
    of_force: list[float | None]
    """...or parts of the largest force of a cycle, where it has none."""
    reach: float | None
    """...from the least tested over this factor to the largest times it: what a bench that ran those can be expected to run."""
    rivals: int
    """Tied laws at most that a test is to separate from the one that was taken."""
    share: float | None
    """Part of the time spent before that all of it may take: a third of that is a quarter of the whole."""
    simulated: int
    """Proposals that are simulated..."""
    weighing: float | None
    """Part of its time after which what has been weighed is simulated."""


class Race(msgspec.Struct, kw_only=True):
    """How candidates are picked, begun and refitted."""
    ahead: float | None
    """Legs within which a refit must come up with the best at the rate of its last one. In a curved valley a rate may also grow: what is left
    behind there is not found (study 11)."""
    at_place: int
    """Candidates refitted at the leader's place, with those that already are: it may have crowded them out of the list..."""
    carries: float | None
    """Part of the sparse combination of all columns from which its members are refitted..."""
    choice: int
    """...and after which that is asked again."""
    closest: int
    """Candidates that came closest to an addition at other places and are held against it again at the end."""
    elsewhere: int
    """...and the places tried for all of them together."""
    explained: float | None
    """Part of the cost without a candidate below which a refit has explained all that the race can tell."""
    flat: float | None
    """Part of the largest slope of a candidate's own parameters below which a combination of them does nothing: it has come to rest on a
    plateau..."""
    followed: int
    """Candidates that are followed along the whole of a record whose beginning they explain."""
    following: float | None
    """Part of the fall of the best of earlier refits by which a later one must have fallen after its first iterations to be looked at
    further."""
    freeing: float | None
    """Part of the cost that a setting must take away to be fitted."""
    gain_begins: list[float | None]
    """Factors on a reading between which a gain begins: what its slope asks for may be no gain at all."""
    giving: int
    """Secants of a candidate that refits begin at: the cheapest alone is not always that of the best fit."""
    hopeful: float | None
    """Factor on the least cost within which a refit is worth other starts."""
    iterations: int
    """Iterations of a refit from another start."""
    kin_ahead: float | None
    """...where it saves this part of the cost."""
    leaders: int
    """Leaders whose laws are tried at other places..."""
    leads: float | None
    """...the part of the greatest fall of the cost that makes one..."""
    leg: int
    """Iterations of a leg; after one the best of its starts stands for a candidate."""
    legs: int
    """Legs at most."""
    level_with: float | None
    """...by this part of what it has gained, or by the way they have come: a start in the right valley may begin above all the others..."""
    lines: int
    """Lines of an FRF that a look computes at most for each of its resonances, three at least, where every line is a balance of its own or
    about where a model stands."""
    of_bound: int
    """Candidates refitted beside those for what they may gain at most."""
    of_opinion: int
    """...and how many of them."""
    off: list[float | None]
    """...how far it is then moved, in logarithms..."""
    parts: list[float | None]
    """Parts of the strength that the score expects at which a candidate's best shape is computed: a law that is not smooth does something else
    there. So far along the way of its look a refit begins where the model cannot be computed at the end of it."""
    passed: float | None
    """Largest displacements within which a place along the motion is looked for, as a gap: at twice, it is passed by none, and its law is as
    good as smooth."""
    promising: float | None
    """...as far as they promise at least this part of the best of them."""
    rivals: float | None
    """...and the part of the leader's predicted fall that they promise."""
    shape_reach: float | None
    """Times where a candidate's positive shape begins, and one over it, within which it stays: begun where the tests move, it is another law
    beyond three decades from there. A film whose speed is a millionth of theirs is a friction that grows with its logarithm."""
    shapes: int
    """Shapes of a candidate that are looked at, the best..."""
    share: float | None
    """Share of the time left that refits may take: what they have found by then is weighed, and told."""
    shared: int
    """Parameters of one name and dimension that make two laws kin, the values of one a start for the other..."""
    state_iterations: int
    """...iterations of that fit, which begins at the model as it stands..."""
    state_parts: list[float | None]
    """...and parts of the way from that model to what the states want of it at which a law over a condition is computed."""
    state_reach: float | None
    """...factor within which they move it..."""
    state_width: float | None
    """Width of the prior within which the tests of one state of the conditions by themselves move what a law may follow, in parts of its value:
    wide beside any scatter, as a law over a condition is..."""
    tried: int
    """Iterations after which those of a candidate's starts go on that are level with its best..."""
    unmoved: float | None
    """...and the part of the cost below which that changed nothing either."""
    worth: float | None
    """Picked for its score when its predicted fall is at least this part of the best: the score is a slope, off by factors far from the
    truth."""


class Rung(msgspec.Struct, kw_only=True):
    """One rung of a ladder."""
    added: EffectAt | None
    """Effect added; none on the first rung."""
    candidates: list[Candidate]
    """Candidates weighed on top of this rung."""
    cost: float | None
    """Cost after the refit, under the variances of this rung's own model: that of another rung counts in other units."""
    effects: list[EffectAt]
    """Effects of the model."""
    effort: Effort
    """What weighing them took."""
    nats: float | None
    """Nats that it gained on the rung before beyond its price; none where it came in exchange for another."""
    parameters: list[ParameterResult]
    """Parameters after the refit."""
    readings: list[Reading]
    """What instruments read wrong by this model, beyond what they may err by."""
    removed: list[EffectAt]
    """Effects pruned."""
    second_opinion: SecondOpinion
    """What all of them at once say."""
    termination: str
    """Termination of the refit."""
    tests: list[TestResult]
    """Tests after the refit; held-out tests stand only on the first and last rung."""


class Scoring(msgspec.Struct, kw_only=True):
    """How candidates are scored."""
    apart: float | None
    """...and what may be left of a column beyond these, in parts of it."""
    beyond_chance: float | None
    """Level of the null distribution of the best score that is beyond chance..."""
    columns: int
    """Columns that the sparse combination weighs, those of the highest scores."""
    condensed: int
    """Trials beyond which their correlation is drawn in the directions that they lie in..."""
    dependent: float | None
    """Singular value of columns of unit length below which a combination of them is numerically nothing..."""
    directions: int
    """...so many of which are found at once: the size of a product of matrices, which changes the time alone..."""
    draws: int
    """Draws of the null distribution of the best score."""
    entered: float | None
    """Part of the largest weight below which a column has not entered."""
    passing: float | None
    """Trials that would pass, in a draw, the level at which candidates are counted as choices: what is taken lies far out."""
    power: float | None
    """...and the probability with which a strength that would have been seen passes it."""
    price: float | None
    """Price of a column there in parts of the best score, where chance does not ask for more."""
    shows: float | None
    """...and below which what it would have to do of a candidate is no guide."""
    visible: float | None
    """A column keeps at least this part of itself after projection, or the data cannot tell it from what the model has."""
    word: float | None
    """Part of the explained cost below which a candidate is not worth a word."""


class Settings(msgspec.Struct, kw_only=True):
    """How missing physics is searched for, and when it is believed."""
    colour_lines: int
    """Lines of FRFs from which the correlation of neighbours is told..."""
    colour_most: float | None
    """...and the most that it is: what is smoother is no noise."""
    correction_least: float | None
    """Relative deviation from which one is told as a correction: a per cent is within what is nominal."""
    correction_sure: float | None
    """The same in standard deviations."""
    curved: int
    """Directions in the space of strengths in which the curvature of a record is granted beside its slope, those in which it moves most..."""
    curved_over: float | None
    """...and the part of the strengths over which the curvature is taken: what they scatter by, from which estimates of that begin."""
    decisive: float | None
    """Nats that stand by themselves (e^8 in odds): a test that separates two laws by so much breaks their tie; effects that are to take the
    place of slack are exchanged while they are within so much of it."""
    errs_from: float | None
    """Model error, in parts of the least, from which a model is seen to err: pairs and slack are tried, and what is missing has the odds of a
    model that is searched, whatever was added to it."""
    estimates: int
    """Estimates of variances and counts in turn at the plain fit of the study's own model, from which that is weighed."""
    evaluations: int
    """Evaluations of the likelihood in one estimate of the variances..."""
    facts_loop: float | None
    """Facts that a loop holds at least: mean, stiffness, loss, one of shape."""
    facts_mode: float | None
    """Facts that a resonance holds in an FRF: frequency, damping, residue and their phases."""
    facts_most: float | None
    """Facts that the model's error of one channel counts as at most over all loops: one strength must take 43 % of its power."""
    facts_record: float | None
    """Facts that a channel of a record holds: its stretches that are independent."""
    fault_gain: float | None
    """Part of a channel's rms that a gain of one test must move, or a drift over a record: less is scatter between tests."""
    fault_least: float | None
    """The same of other faults of a channel."""
    fault_odds: float | None
    """Odds, before any test is read, that what a model lacks is physics and no fault of an instrument: of studies that miss something one in
    twenty has an instrument at fault. Where few tests speak, physics and the gain of one test are worth the same within a nat."""
    fault_over: float | None
    """Times the model's own error in a test that a fault must move it: physics first."""
    fault_tests: int
    """Tests from which a fault of one of them can be told from physics."""
    finish: int
    """Times that these are gone through again, at most, for a model that others are held against and that has not come to its end."""
    finish_least: float | None
    """Nats that going through them once more must have gained for another time: a fifth of a tie."""
    fitting: Fitting
    """How fits are begun and ended."""
    for_slack: int
    """Effects that slack may have been taken for, which are looked for once nothing gains beside it: two, of which the first alone gained less.
    More are no smaller statement than that parts differ, as they do in every structure."""
    frf_error_least: float | None
    """The same of an FRF. A linear response is computed without steps, and its error is smooth: over the lines of a resonance noise averages
    out, and 0.3 % would hide what they show."""
    held_out_fall: float | None
    """Part by which their error must fall beside that."""
    held_out_nats: float | None
    """Nats by which the density of the held-out tests must rise for an effect to be proven."""
    held_out_pieces: int
    """Pieces into which the held-out tests are cut at least, for the standard error of the fall of their error: fewer give no spread."""
    instruments_common: float | None
    """Part of the variance of what an instrument may misread that all tests of its channel have in common: calibration, zero and characteristic
    are the sensor's, mounting and temperature the test's. Half is what is said of two parts of which nothing is known."""
    iterations: int
    """Iterations of each of these fits."""
    last_step: float | None
    """...and the part of these steps at which it ends."""
    like_others: float | None
    """Error that a test may have once its fault is taken out, over the median of the others."""
    max_added: int
    """Effects added at most."""
    missing_odds: float | None
    """Odds, before any test is read, that a model lacks anything: of studies that are searched nine in ten miss something, or they would not
    be. They stand against the first thing that is found, and against what is found next where the model with it still errs. Beside one that
    errs no more there are even odds."""
    model_error_least: float | None
    """Relative error of a model below which no model of a device is claimed: sampling, integration and geometry are not better known."""
    model_error_most: float | None
    """Largest relative error of a model, as a logarithm."""
    model_error_spread: float | None
    """Standard deviation of the logarithm of the model's error in one test over the common one: laws fail unevenly, by factors of two."""
    negligible: float | None
    """Nats below the most at which the integrand over that grid, continued in held-out tests, is left off."""
    neighbours: int
    """Lines on either side over which the size of an FRF is averaged: between resonances a model errs by what its neighbours are."""
    next: Proposals
    """Which test separates what is tied."""
    no_scatter: float | None
    """Logarithm of a scatter that is none, a fifth of a percent..."""
    noise_most: float | None
    """Largest factor on the noise, and one over it: what is noisier is an error of the model."""
    noise_pool: float | None
    """Cycles' worth of weight of a noise spectrum pooled over tests: a test of four cycles has three degrees of freedom a harmonic."""
    noise_spread: float | None
    """Standard deviation of the logarithm of true over seen noise: a scatter of few cycles knows it to a third."""
    own_points: int
    """...and its points."""
    own_reach: float | None
    """Grid of the logarithm of a channel's own model error over the common one: its reach to either side..."""
    pair_of: int
    """Candidates that stood best alone and are tried in pairs where none alone gains."""
    pair_part: float | None
    """Part of the strength that each had alone with which the two begin."""
    parts_of_a_fit: list[float | None]
    """Parts of the way to where such a fit ends that are tried, in turn, where the likelihood is less there."""
    promise: float | None
    """Factor on the gain that a score or a refit under the base's variances promises, below which a candidate is not looked at further: once it
    is there, the error it leaves has a smaller variance."""
    promise_pair: float | None
    """The most that a pair may gain over what its two gained each by itself, before their price: each hides part of what the other does."""
    promise_series: float | None
    """The same as `Settings::promise` of an effect in series, whose score at opening zero says little."""
    race: Race
    """Which candidates are refitted, from where, for how long."""
    reach: float | None
    """Factor on the nats that one step of a refit under variances of its own promises, for what its fit may gain at most: more steps follow,
    and the variances fall with what they leave (2 to 11 times that step on one chain)."""
    refits: int
    """Candidates refitted for their scores: what is not refitted is not found."""
    remainder: float | None
    """Part of the first model error left on the held-out tests above which the verdict stays `unexplained`..."""
    ridge: float | None
    """Ridge on the information of the parameters, of which the tests may not know all."""
    rises: float | None
    """A maximum of an FRF's magnitude is a resonance where it stands this far above the minima about it."""
    rounds: int
    """Fits and estimates of variances in turn; estimates of the counts and of the widths of slack by what is then left; and fits of tests
    computed about where a model stands, before one in full."""
    scatter_from: float | None
    """...and of that from which an estimate begins at least: below it the likelihood is flat."""
    scatter_most: float | None
    """Largest scatter of strengths: what differs more from test to test is an error of the model, or it eats relaxation and inertia."""
    scatter_prior: float | None
    """Half-normal prior of the relative scatter of strengths between tests: temperature and mounting."""
    scatter_spread: float | None
    """Standard deviation of the logarithm of the scatter in tests of one kind over the common one: an FRF is a mean of many averages, a loop of
    its cycles, a record one event."""
    scatter_step: float | None
    """Step of the pattern search along that logarithm at first."""
    scoring: Scoring
    """How candidates are scored."""
    settled: float | None
    """Nats that a fit which decides between models may leave unfound: far below a tie."""
    slack_between: float | None
    """...of the part of the mass that lies between the nodes (half in a chain of twice as many bodies; half of that is what its end may lack),
    at most..."""
    slack_between_least: float | None
    """...and at least..."""
    slack_damper: float | None
    """...of dampers, alike joints; wider, it takes a relaxing branch for a damper..."""
    slack_least: float | None
    """...and of the others at least."""
    slack_mass: float | None
    """...of nominal masses..."""
    slack_members: int
    """Deviations that are given without being asked for, at most: each costs a column in every evaluation."""
    slack_reach: float | None
    """Part of a value by which it may deviate at most: beyond it, it is not that part."""
    slack_softer: float | None
    """Widths of a spring's slack, the widest, within which a compliance in series with it is that spring, softer than its group, and no
    effect."""
    slack_spring: float | None
    """Width of the prior of the deviations of springs that a study ties or fixes, at most: what a workshop calls the same part..."""
    steps: list[list[float | None]]
    """...steps of its pattern search at first, in the logarithms of noise, model error and scatter. The last gives the noise what it takes from
    the model error: where both are white the likelihood has a ridge along it, and steps along the axes alone stop beside its crest..."""
    swap: float | None
    """Nats by which an alternative must be better to take the place of what stands."""
    telling: Telling
    """What is told of a model beside the verdict."""
    tie: float | None
    """Nats within which two laws cannot be told apart, and within which nothing is decided by a gain alone; what stands is taken out only below
    minus this."""
    turned_gives: float | None
    """Sine of the loss angle below which a loop gives energy beyond any delay of a channel: its force is turned round..."""
    turned_phase: float | None
    """Mean cosine of the angle between the lines of an FRF and those of a model below minus which its response is turned round; modes that are
    displaced by a tenth leave 0.8."""
    turned_stands: float | None
    """...where the correlation of force and displacement is below this: a late channel turns the loss and leaves the stiffness."""
    turns: int
    """Parts at most into which the fitted tests are cut, each left out in its turn, where a gain lies within a tie of nothing: half a dozen
    refits of two models say what a dozen would."""
    unproven: float | None
    """Nats that fitted and held-out tests together must give for what is not proven, or it is withdrawn: odds of twenty."""
    visible: float | None
    """...where it is more than this many times the noise..."""
    visible_least: float | None
    """...and this many times the least model error."""
    weighed: int
    """Refitted candidates that are weighed with variances of their own."""


class Telling(msgspec.Struct, kw_only=True):
    """What is told of a model beside the verdict."""
    bands: int
    """Bands into which an FRF is cut to say where its misfit is largest."""
    energy: float | None
    """Part of a mode's energy below which a place is not told."""
    falls: float | None
    """...where this part of every loss is left if it carries them all..."""
    finding: float | None
    """Standard deviations beyond which a statistic of the residuals is claimed; about 1 in 1000 by chance."""
    finding_power: float | None
    """Part of the measured signal whose chance of being found is told beside a finding."""
    fixture: float | None
    """Part of a mode's strain energy beyond which the fixture that holds it is told."""
    held_out_points: int
    """Points of the grid on which the model error of the held-out tests is looked for..."""
    held_out_span: float | None
    """...and its span from the least one, in logarithms."""
    narrow: float | None
    """...and the relative change of the strength at which they end."""
    narrowing: int
    """...so many iterations that narrow the best down..."""
    picture: int
    """...and points of its picture for each loop at most."""
    same_factor: float | None
    """Median deviation of ln(measured / computed) over the lines of an FRF (from a constant times a power of the frequency) within which the
    two differ by that constant alone: half of the lines lie within a third."""
    same_phase: float | None
    """Mean cosine of the angle between the measured lines and the computed ones (times the power of i w) beyond which their phases agree."""
    same_unit: float | None
    """Distance of ln of the constant from that of a factor between units, as a part of the former, at which it is that factor, where the lines
    scatter by less: a start that is off by a fifth is told from a prefix, and 8 from 9.81 and from 2 pi."""
    shaped: float | None
    """Range of ln of the computed accelerance over the lines that it needs for that: one line of stiffness or of mass is any other, by a factor
    or a power."""
    spline_begins: list[list[float | None]]
    """Slopes at the outer and the inner nodes, over that at rest, from which a spline is fitted: one that levels off, one that hardens..."""
    spline_takes: float | None
    """...and the part of the largest force at a place that it has at the largest motion there."""
    standard_errors: float | None
    """Standard errors beyond which the damping of a model differs from a constant ratio."""
    strength_reach: float | None
    """One strength that carries the whole loss is searched from this part of its value to its inverse..."""
    strengths: int
    """...with so many values tried over the range..."""
    term: float | None
    """...part of the cost that a further one must take away..."""
    term_nats: float | None
    """...nats beyond half the logarithm of the data that it must gain, for the terms among which it was chosen..."""
    term_reach: float | None
    """...factor on the strength that its column has within which it is fitted..."""
    terms: int
    """Terms of a formula for what is unexplained at most..."""
    transient: float | None
    """Transient that may be left in the mean of the kept cycles, in units of sigma: its square is a tenth of the noise's."""
    weak: float | None
    """...it counts as weak at this part of its value..."""


class Ladder(Run, kw_only=True, dict=True):
    """Result of `ladder`."""
    began_with: list[EffectAt]
    """Effects beyond the study with which the first rung began: those of the model that it was climbed from."""
    corrections: list[Correction]
    """What the study ties or fixes and the data do not."""
    ended: str
    """Why the ladder ended, in words."""
    findings: list[Finding]
    """Findings on the last rung."""
    held_out: HeldOut
    """Held-out error, read once."""
    instruments: list[Instrument]
    """Instruments at fault."""
    interrupted: bool
    """Whether it was stopped: what was not found says nothing then."""
    missing: list[Missing]
    """Physics added that stayed, what costs most to leave out first."""
    model_error: list[OwnError]
    """The model's own error, channel by channel."""
    next_test: NextTest | None
    """Test that separates the tied."""
    no_next_test: str | None
    """Where candidates are tied and no test within reach separates them: so much in words."""
    noise: float | None
    """True noise over that seen between cycles or stated; below 1 no finding (see `FitResult::noise`)."""
    proven: bool
    """Whether the held-out tests bear out what was added: their density rises and their error falls."""
    remainder: float | None
    """Error of the last model on the held-out tests, relative to the response, beside noise and scatter; on the fitted tests where none is held
    out."""
    result_study: str | None
    """Folder of the resulting study."""
    run: str
    """Folder of the run."""
    rungs: list[Rung]
    """Rungs."""
    scatter: list[ScatterOf]
    """How much strengths differ from test to test."""
    settings: Settings
    """Constants of the search."""
    study: str
    """Name of the study."""
    unexplained: Unexplained | None
    """Where something is unexplained: the force that would explain it, and a formula fitted to it."""
    unexplained_remainder: bool
    """Whether a model error is left that is seen beside the noise."""
    verdict: Verdict
    """Verdict."""
    wall_s: float | None
    """Wall time [s]."""
    whitened_rms: float | None
    """Root mean square of the whitened residuals on the fit and select tests at the end, under the noise alone; none where the search was
    stopped."""
    why: str
    """Why, in words."""
    would_have_been_seen: list[str]
    """Strength of each candidate that would have been seen, where nothing more is missing: name and value with unit."""


class Found(msgspec.Struct, kw_only=True):
    """A record of a file."""
    file: str
    """The file."""
    what: str
    """cycle, transient, frf, modal, other."""


class New(Run, kw_only=True, dict=True):
    """Result of `new`."""
    dataset: str
    """dataset.toml that was written."""
    found: list[Found]
    """What was found in the files."""
    left_out: list[Problem]
    """Files that could not be read."""
    modes: list[Any] | None
    """Modes of the FRFs."""
    no_modes: str | None
    """Why FRFs show no modes."""
    problem: Problem | None
    """What is still wrong with the dataset."""
    study: str
    """study.toml that was written."""
    to_confirm: list[str]
    """What to confirm by eye."""


class Prediction(msgspec.Struct, kw_only=True):
    """One predicted value."""
    case: str
    """Case."""
    quantity: str
    """Quantity."""
    reference: float | None
    """Value it is held against."""
    relative_error: float | None
    """value / reference - 1."""
    std: float | None
    """Standard deviation."""
    unit: str
    """Unit of the value."""
    value: float | None
    """Value."""


class Shift(msgspec.Struct, kw_only=True):
    """Shift of a natural frequency."""
    computed: float | None
    """By the model."""
    measured: float | None
    """As printed."""
    mode: int
    """Number of the mode."""
    test: str
    """Test."""


class Predict(Run, kw_only=True, dict=True):
    """Result of `predict`."""
    fit: FitResult
    """The fit."""
    predictions: list[Prediction]
    """The predictions."""
    run: str
    """Folder of the run."""
    shift_error_over_none: float | None
    """Root mean square error of the shifts over that of no shift."""
    shifts: list[Shift]
    """Shifts of natural frequencies."""
    tolerance: Any | None = None
    """Tolerance cases by every rung."""


class Report(Run, kw_only=True, dict=True):
    """Result of `report`."""
    file: str
    """The page."""
    run: str
    """Folder of the run."""


class Scored(msgspec.Struct, kw_only=True):
    """A candidate under the score test, which refits nothing."""
    at: str
    """Place or channel."""
    effect: str
    """Name in the library."""
    nats: float | None
    """Nats that it may gain at most."""
    of: str | None
    """Of a coefficient, what it acts on and over which condition."""
    p_value: float | None
    """Probability that the best of all candidates scores as high where nothing is missing."""
    predicted_drop: float | None
    """Fraction of the cost that is expected to fall."""
    price: float | None
    """Nats that its parameters and the search cost."""
    promises: bool
    """Whether it may gain more than it costs."""
    set: list[tuple[str, str]]
    """Where its shapes score best: `--set` of `add`, by name."""
    target: ScoredTarget | None
    """Of a coefficient, the other options of `add`."""
    tied_with: list[str]
    """Candidates that the score cannot tell from it."""


class ScoredTarget(msgspec.Struct, kw_only=True):
    """What a coefficient is added with."""
    condition: str
    """`--condition`."""
    of: str
    """The parameter it scales, `--of`."""
    reference: str
    """`--reference`, with unit."""


class Scores(Run, kw_only=True, dict=True):
    """Result of `diagnose --scores`."""
    fit: FitResult
    """The fit it stands on."""
    run: str
    """Folder of the run."""
    scores: list[Scored]
    """Every candidate that is expected to lower the cost, the largest drop first."""


class Simulated(msgspec.Struct, kw_only=True):
    """A simulated test."""
    id: str
    """Id."""
    kind: str
    """cycle, frf, transient, energy, modal, backbone."""


class Simulate(Run, kw_only=True, dict=True):
    """Result of `simulate`."""
    dataset: str
    """Folder of the dataset."""
    run: str
    """Folder of the run."""
    tests: list[Simulated]
    """Its tests."""


class CaseResult(msgspec.Struct, kw_only=True):
    """A quantity of a case over its assemblies."""
    at_mean: float | None
    """The model at the mean conditions of the row."""
    case: str
    """Case."""
    inside: bool | None
    """Whether the table's value lies in the interval."""
    interval: tuple[float | None, float | None]
    """95 % of the assemblies, parameters and model error included."""
    mean: float | None
    """Mean over the assemblies."""
    mode: int | None
    """Mode of a natural frequency, from 1."""
    quantity: str
    """W_D, W_s, stiffness, natural_frequency."""
    reference: float | None
    """The table's value."""
    std: float | None
    """Standard deviation over the assemblies."""
    std_model: float | None
    """Standard deviation of the mean by parameters and model error."""
    unit: str
    """SI unit."""
    worst_case: tuple[float | None, float | None]
    """Least and greatest value with all deviations within their tolerances."""
    yield_: float | None = msgspec.field(name="yield")
    """Part of the assemblies within the band; none without a band."""
    yield_interval: tuple[float | None, float | None] | None
    """Its 95 % interval: parameters, model error, number of draws."""


class ContributionResult(msgspec.Struct, kw_only=True):
    """What a tolerance contributes."""
    case: str
    """Case it is of."""
    first: float | None
    """First-order Sobol index."""
    first_interval: tuple[float | None, float | None]
    """95 % interval of the first-order index."""
    mode: int | None
    """Mode of a natural frequency, from 1."""
    quantity: str
    """Quantity."""
    tolerance: str
    """Name of the tolerance; `rest` for what moves the area and stands in no column."""
    total: float | None
    """Total Sobol index."""
    total_interval: tuple[float | None, float | None]
    """95 % interval of the total index."""


class PricedResult(msgspec.Struct, kw_only=True):
    """The cost of the loosest tolerances that keep a yield."""
    asked: float | None
    """Yield asked for."""
    cost: float | None
    """Cost, sum of c / width."""
    yield_: float | None = msgspec.field(name="yield")
    """Yield on draws of their own."""


class SurrogateResult(msgspec.Struct, kw_only=True):
    """How far the surrogate is off."""
    error: float | None
    """Largest relative error of W_D there."""
    error_frequency: float | None
    """Largest relative error of a natural frequency there; 0 where none is asked for."""
    error_stored: float | None
    """Largest relative error of W_s there."""
    exact: int
    """Exact runs it was held against."""
    nodes: int
    """Points at which the model was computed."""


class SynthesisResult(msgspec.Struct, kw_only=True):
    """The loosest tolerances that keep a yield."""
    asked: float | None
    """Yield asked for."""
    case: str
    """Case it began with."""
    cost: float | None
    """Cost, sum of c / width, after."""
    cost_before: float | None
    """Cost of the case as it stands."""
    curve: list[PricedResult]
    """What other yields cost, rising, as far as they are within reach; from at most 20,000 draws."""
    feasible: bool
    """Whether there are such tolerances."""
    in_the_way: str | None
    """What stands in the way, where there are none."""
    programmes: int
    """Conic programmes solved."""
    tolerances: list[WidthResult]
    """Widths."""
    yield_: float | None = msgspec.field(name="yield")
    """Yield over all bands on draws of their own."""
    yield_before: float | None
    """Yield of the case as it stands."""
    yield_interval: tuple[float | None, float | None]
    """Its 95 % interval by the number of draws."""


class WidthResult(msgspec.Struct, kw_only=True):
    """A chosen width."""
    before: float | None
    """Width of the case."""
    cost: float | None
    """Its cost."""
    tolerance: str
    """Name."""
    unit: str
    """Unit of the widths."""
    width: float | None
    """Width."""


class Tolerance(Run, kw_only=True, dict=True):
    """Result of `tolerance`."""
    assemblies_s: float | None
    """Wall time of everything after the fit [s]."""
    cases: list[CaseResult]
    """Every quantity of every case."""
    constant: float | None
    """The constant i A of eq. 6 [m3], where the interference follows from the area."""
    contributions: list[ContributionResult]
    """Contributions to the variance, of one case."""
    draws: int
    """Assemblies drawn per case."""
    notes: list[str]
    """What to know of the numbers."""
    study: str
    """Name of the study."""
    surrogate: SurrogateResult
    """The surrogate of the model."""
    synthesis: SynthesisResult | None
    """The loosest tolerances; none where the study does not ask for them."""


class Bin(msgspec.Struct, kw_only=True):
    """A bin of strength."""
    from_: float | None = msgspec.field(name="from")
    """Least strength [standard deviations]."""
    strict: TrialShare
    """Effect and place first, strictly."""
    structure: str
    """connector or chain."""
    to: float | None
    """Largest; none: no end."""
    with_ties: TrialShare
    """The same with declared ties."""


class Confusion(msgspec.Struct, kw_only=True):
    """How often one truth was said to be what."""
    count: int
    """Cases."""
    said: str
    """Effects said, or the verdict."""
    truth: str
    """Effects hidden."""


class Counts(msgspec.Struct, kw_only=True):
    """Counts of some cases."""
    cases: int
    """Cases."""
    failed: int
    """Cases in which the ladder ended in an error."""
    false_alarms: int
    """False alarms."""
    missed: int
    """Missed."""
    next_tests: int
    """Cases with a tie of the truth and a proposed test that could be run; those in which it broke the tie for the truth."""
    strict: int
    """Right, strictly."""
    ties_broken: int
    """The ties that it broke."""
    weighed: int
    """Cases in which everything hidden was refitted at some step."""
    with_extra: int
    """Cases in which more is named than is hidden."""
    with_ties: int
    """Right, declared ties counted."""


class NullRow(msgspec.Struct, kw_only=True):
    """Cases that hide nothing, of one imperfection."""
    false_effect: TrialShare
    """A false effect is named."""
    false_instrument: TrialShare
    """A fault of an instrument is named."""
    imperfection: str
    """The imperfection, or `all`."""
    named: list[tuple[str, int]]
    """Effects and instruments named, with their count."""
    structure: str
    """connector or chain."""
    unexplained: TrialShare
    """No effect is named, and the verdict is `unexplained`."""


class OfStructure(msgspec.Struct, kw_only=True):
    """What is said of the cases of one structure."""
    blamed: TrialShare
    """Of those with an instrument at fault: blamed on physics."""
    both: TrialShare
    """Of those that hide two: both named, with declared ties."""
    cases: int
    """Cases."""
    first_strict: TrialShare
    """Of those that hide one or two effects of the library: effect and place first, strictly."""
    first_with_ties: TrialShare
    """The same with declared ties."""
    held_out_over_truth: float | None
    """Median of the held-out error over that of the true law."""
    quiet: TrialShare
    """Of those that hide nothing: nothing named and not unexplained."""
    structure: str
    """connector or chain."""
    unfounded: TrialShare
    """Of those in which something is claimed: the held-out error did not fall by its standard error."""
    wall_s: float | None
    """Median wall time of a case [s]."""
    wrong_instruments_per_case: float | None
    """Wrong instruments per case."""
    wrong_per_case: float | None
    """Wrong effects per case."""


class Realistic(msgspec.Struct, kw_only=True):
    """A realistic trial."""
    curve: list[Bin]
    """Recovery of hidden effects of the library over strength."""
    null_rows: list[NullRow]
    """Cases that hide nothing, by imperfection."""
    structures: list[OfStructure]
    """By structure."""


class TrialShare(msgspec.Struct, kw_only=True):
    """A count of some with Wilson's interval of 95 %."""
    count: int
    """How many."""
    interval: tuple[float | None, float | None]
    """Wilson's interval; 0 to 1 where there are none."""
    of: int
    """Of how many."""


class Trial(Run, kw_only=True, dict=True):
    """Result of `trial`."""
    by_kind: dict[str, Counts]
    """By kind and structure, `one, connector`."""
    cases: int
    """Cases."""
    confusion: list[Confusion]
    """Truth against what was said."""
    failed: int
    """Cases in which the ladder ended in an error."""
    false_alarms: int
    """False alarms."""
    folder_: str = msgspec.field(name="folder")
    """Folder of the cases."""
    held_out_over_floor: float | None
    """Median of held-out error over floor."""
    interrupted: bool
    """Whether it was stopped."""
    missed: int
    """Missed."""
    next_tests: int
    """Cases with a tie of the truth and a proposed test that could be run; those in which it broke the tie for the truth."""
    realistic: Realistic | None = None
    """Of realistic cases: recovery over strength, claims without ground, null rows."""
    seed: int
    """Seed of the cases."""
    strict: int
    """Right, strictly."""
    ties_broken: int
    """The ties that it broke."""
    weighed: int
    """Cases in which everything hidden was refitted at some step."""
    with_extra: int
    """Cases in which more is named than is hidden."""
    with_ties: int
    """Right, declared ties counted."""
