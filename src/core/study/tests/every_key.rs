//! A dataset.toml and a study.toml that use every key there is, and which of the keys may be left out.

pub const DATASET: &str = r#"
schema = 1
folder = "."
title = "every key"
source = "a bench"
licence = "CC-BY-4.0"
assumptions = ["room temperature"]
rig = { force_max = "2 kN", displacement_max = "20 mm", velocity_max = "1 m/s", acceleration_max = "50 m/s2", frequency_min = "0.1 Hz", frequency_max = "900 Hz" }
instruments = { gain = "1 %", offset = "0.1 %", delay = "0.1 ms", linearity = "0.1 %" }
[[test]]
id = "loop"
kind = "cycle"
description = "a loop"
file = "loop-1.csv"
control = "displacement"
discard_cycles = 1
noise = "1 %"
conditions = { frequency = "1 Hz", i = "0.1 mm +- 0.01 mm", load = "80 N", temperature = "20 degC", pressure = "1 bar" }
channels = [
 { role = "time", column = "t", unit = "s" },
 { role = "displacement", at = "c1.x", column = "x", unit = "mm", input = true },
 { role = "force", at = "c1.x", column = "F", unit = "N", sigma = "0.5 N" }]
[[test]]
id = "whole"
kind = "transient"
file = "loop-2.csv"
control = "displacement"
noise = "1 %"
conditions = { i = { value = "0.3 mm", sigma = "0.01 mm" } }
channels = [
 { role = "time", column = "t", unit = "s", from = "0.1 s", to = "1.9 s" },
 { role = "displacement", at = "c1.x", column = "x", unit = "mm", input = true, centre = true },
 { role = "force", at = "c1.x", column = "F", unit = "N", sigma = "2 %", scale = -1.5, offset = "0.1 N" }]
[[test]]
id = "counted"
kind = "cycle"
file = "loop-5.csv"
control = "displacement"
cycles = "2-4"
conditions = { i = "0.4 mm" }
channels = [
 { role = "time", rate = "500 Hz" },
 { role = "displacement", at = "c1.x", column = "x", unit = "mm" },
 { role = "force", at = "c1.x", column = "F", unit = "N" }]
[[test]]
id = "hammer"
kind = "frf"
file = "frf.csv"
excite = "end.x"
respond = "end.x"
quantity = "accelerance"
excitation = "0.1 N"
noise = "1 %"
conditions = { i = "0.5 mm" }
channels = [
 { role = "frequency", column = "f", unit = "Hz" },
 { role = "real", column = "re", unit = "m/s2/N" },
 { role = "imag", column = "im", unit = "m/s2/N" },
 { role = "coherence", column = "coh", averages = 20 }]
[[test]]
id = "energies"
kind = "energy"
at = "c1.x"
control = "force"
force_min = "21.6 N"
force_max = "138.3 N"
W_s_reading = "slope"
noise = "3 %"
conditions = { i = "0.5 mm" }
rows = [{ case = "slow", frequency = "1 Hz", W_D = "1.04 mJ", W_s = "249.07 mJ", D = 0.5, sigma_frequency = "0.1 Hz", sigma_W_D = "0.03 mJ", sigma_W_s = "0.7 mJ", sigma_D = 0.01, conditions = { i = "0.1 mm" } }]
[[test]]
id = "energies-x"
kind = "energy"
at = "c1.x"
control = "displacement"
displacement_min = "-1 mm"
displacement_max = "1 mm"
conditions = { i = "0.5 mm", frequency = "1 Hz" }
rows = [{ W_D = "1.04 mJ" }]
[[test]]
id = "energies-file"
kind = "energy"
at = "c1.x"
control = "displacement"
amplitude = "1 mm"
mean = "0.1 mm"
conditions = { i = "0.5 mm" }
file = "energies.csv"
channels = [
 { role = "frequency", column = "f", unit = "Hz" },
 { role = "W_D", column = "wd", unit = "mJ", sigma_column = "s" }]
[[test]]
id = "modes"
kind = "modal"
noise = "1 %"
conditions = { i = "0.5 mm" }
rows = [{ mode = 1, frequency = "290 Hz", sigma_frequency = "1 Hz", damping = "5.3 %", sigma_damping = "0.2 %", family = "bending", description = "first" }]
[[test]]
id = "modes-file"
kind = "modal"
conditions = { i = "0.5 mm" }
file = "modes.csv"
channels = [
 { role = "mode", column = "n" },
 { role = "frequency", column = "f", unit = "Hz" },
 { role = "family", column = "family" }]
[[test]]
id = "backbone"
kind = "backbone"
at = "c1.x"
mode = 1
noise = "1 %"
conditions = { i = "0.5 mm" }
rows = [{ amplitude = "0.1 mm", frequency = "290 Hz", sigma_frequency = "1 Hz", damping = "5.3 %", sigma_damping = "0.2 %" }]
"#;

pub const STUDY: &str = r#"
schema = 1
title = "every key"
dataset = "data"
folder = "data"
assumptions = ["rigid"]
[split]
select = ["whole"]
held_out = ["hammer"]
[[shift]]
test = "modes-file"
against = "modes"
sigma = "0.2 %"
[[leave_out]]
test = "modes"
quantity = "natural_frequency"
mode = 1
why = "out of family"
[fit]
loss = "huber"
width = 1.345
max_iterations = 50
starts = 2
points = 100
frf_tolerance = 0.03
[search]
effects = ["film"]
places = ["c1.x"]
max_added = 2
slack = true
model_error_least = 0.002
frf_error_least = 0.0005
model_error_spread = 0.5
scatter_prior = 0.01
scatter_most = 0.03
instruments_common = 0.4
noise_spread = 0.2
noise_most = 3
facts_loop = 5
facts_most = 20
facts_mode = 4
facts_record = 10
tie = 2
held_out_nats = 2
held_out_fall = 0.05
remainder = 0.5
missing_odds = 4
fault_odds = 10
fault_gain = 0.05
fault_least = 0.02
[[body]]
name = "ground"
fixed = true
[[body]]
name = "end"
free = ["x"]
mass = "1 kg"
[[body]]
name = "m"
free = ["x", "psi"]
mass = "1 kg"
inertia = "1 kg m2"
count = 2
[[connector]]
name = "c1"
from = "ground"
to = "end"
[[connector]]
name = "d"
chain = "m"
[[connector]]
name = "base"
from = "end"
to = "m1"
[[effect]]
effect = "linear_stiffness"
at = ["c1.x", "d1.x", "base.x"]
k = { start = "20 N/mm", min = "1 N/mm", max = "90 N/mm", prior = { mean = "20 N/mm", sigma = "2 N/mm" }, fixed = false, slack = "5 %" }
[[effect]]
effect = "linear_stiffness"
at = ["d1.psi", "base.psi"]
k = "3 N m/rad"
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.1 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.3 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "coulomb"
at = "c1.x"
f = "1 N"
vr = { start = "1 mm/s", free = true }
[[effect]]
effect = "interference_law"
at = "c1.x"
of = "viscous.c"
condition = "i"
reference = "0.3 mm"
a = "0.2 1/mm"
[[effect]]
effect = "delay"
at = "*.force"
tau = "1 ms"
[[order]]
order = ["c1.x.viscous.c", "c1.x.viscous#2.c"]
gap = "0.01 N s/mm"
[[prediction]]
case = "a"
quantity = "W_s"
W_s_reading = "product"
at = "c1.x"
control = "force"
force_min = "1 N"
force_max = "9 N"
conditions = { frequency = "1 Hz", i = "0.3 mm" }
reference = "74 mJ"
[[prediction]]
case = "b"
quantity = "W_D"
at = "c1.x"
control = "displacement"
displacement_min = "-1 mm"
displacement_max = "1 mm"
conditions = { frequency = "1 Hz", i = "0.3 mm" }
[[prediction]]
case = "c"
quantity = "force_range"
at = "c1.x"
control = "displacement"
amplitude = "1 mm"
mean = "0.1 mm"
conditions = { frequency = "1 Hz", i = "0.3 mm" }
[[prediction]]
case = "d"
quantity = "natural_frequency"
mode = 1
[[prediction]]
case = "e"
quantity = "receptance"
excite = "end.x"
respond = "m2.x"
frequency = "120 Hz"
excitation = "0.1 N"
"#;

/// Fields that may be left out.
pub const OPTIONAL: &[&str] = &[
    "leave_out",
    "shift",
    // dataset.toml
    "folder",
    "title",
    "source",
    "licence",
    "assumptions",
    "test.description",
    "test.noise",
    "test.discard_cycles",
    "test.cycles",
    "test.excitation",
    "test.W_s_reading",
    "test.mean",
    "test.conditions",
    "test.conditions.i",
    "test.conditions.frequency",
    "test.conditions.load",
    "test.conditions.temperature",
    "test.conditions.pressure",
    "test.conditions.i.sigma",
    "test.channels.sigma",
    "test.channels.sigma_column",
    "test.channels.input",
    "test.channels.scale",
    "test.channels.offset",
    "test.channels.centre",
    "rig",
    "rig.force_max",
    "rig.displacement_max",
    "rig.velocity_max",
    "rig.acceleration_max",
    "rig.frequency_min",
    "rig.frequency_max",
    "instruments",
    "instruments.gain",
    "instruments.offset",
    "instruments.delay",
    "instruments.linearity",
    "test.channels.from",
    "test.channels.to",
    "test.rows.case",
    "test.rows.frequency",
    "test.rows.W_D",
    "test.rows.W_s",
    "test.rows.D",
    "test.rows.damping",
    "test.rows.sigma_frequency",
    "test.rows.sigma_damping",
    "test.rows.sigma_W_D",
    "test.rows.sigma_W_s",
    "test.rows.sigma_D",
    "test.rows.family",
    "test.rows.description",
    "test.rows.conditions",
    "test.rows.conditions.i",
    // `input = true` says as much.
    "test.control",
    // Without limits the table can be read, though not computed.
    "test.amplitude",
    // The frequency of the first row says which mode it is.
    "test.mode",
    // study.toml
    "split",
    "split.select",
    "split.held_out",
    "fit",
    "fit.loss",
    "fit.width",
    "fit.max_iterations",
    "fit.starts",
    "fit.points",
    "fit.frf_tolerance",
    "search",
    "search.effects",
    "search.places",
    "search.max_added",
    "search.slack",
    "search.model_error_least",
    "search.frf_error_least",
    "search.model_error_spread",
    "search.scatter_prior",
    "search.scatter_most",
    "search.instruments_common",
    "search.noise_spread",
    "search.noise_most",
    "search.facts_loop",
    "search.facts_most",
    "search.facts_mode",
    "search.facts_record",
    "search.tie",
    "search.held_out_nats",
    "search.held_out_fall",
    "search.remainder",
    "search.missing_odds",
    "search.fault_odds",
    "search.fault_gain",
    "search.fault_least",
    "body.mass",
    "body.inertia",
    "effect.k.min",
    "effect.k.max",
    "effect.k.prior",
    "effect.k.fixed",
    "effect.k.slack",
    "effect.c.min",
    "effect.vr",
    "effect.vr.free",
    "order",
    "order.gap",
    "prediction",
    "prediction.W_s_reading",
    "prediction.reference",
    "prediction.mean",
    "prediction.excitation",
    "prediction.conditions",
    "prediction.conditions.i",
];

/// Tables of a chain of parts and the supports of a test stand in space.rs, keys that a CSV file has no use for in the tests of the other readers
/// (src/core/data/dataset/files_tests.rs), a response at which an FRF was held in
/// src/core/data/dataset/reading_tests.rs, responses without their excitation in src/core/data/output_only/tests.rs, values per condition in levels.rs; and the second spelling of a licence.
pub const ELSEWHERE: &[&str] = &[
    "tolerance",
    "rungs",
    "supports",
    "arc",
    "joint",
    "load",
    "part",
    "point",
    "estimate",
    "header_units",
    "load_cell_mass",
    "output_only",
    "record",
    "response_amplitude",
    "license",
    "per",
    "only",
    "monotone",
];
