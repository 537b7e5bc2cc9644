//! Constants of the race between candidates: which are refitted, from where, for how long. None of them decides what is believed; what a race
//! misses is not found.

use serde::Serialize;

/// How candidates are picked, begun and refitted.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Race {
    /// Share of the time left that refits may take: what they have found by then is weighed, and told.
    pub share: f64,
    /// Picked for its score when its predicted fall is at least this part of the best: the score is a slope, off by factors far from the truth.
    pub worth: f64,
    /// Part of the sparse combination of all columns from which its members are refitted...
    pub carries: f64,
    /// ...and how many of them.
    pub of_opinion: usize,
    /// Candidates refitted beside those for what they may gain at most.
    pub of_bound: usize,
    /// Leaders whose laws are tried at other places...
    pub leaders: usize,
    /// ...the part of the greatest fall of the cost that makes one...
    pub leads: f64,
    /// ...and the places tried for all of them together.
    pub elsewhere: usize,
    /// Candidates refitted at the leader's place, with those that already are: it may have crowded them out of the list...
    pub at_place: usize,
    /// ...and the part of the leader's predicted fall that they promise.
    pub rivals: f64,
    /// Part of the cost without a candidate below which a refit has explained all that the race can tell.
    pub explained: f64,
    /// Parts of the strength that the score expects at which a candidate's best shape is computed: a law that is not smooth does something else there. So far along
    /// the way of its look a refit begins where the model cannot be computed at the end of it.
    pub parts: [f64; 3],
    /// Factors on a reading between which a gain begins: what its slope asks for may be no gain at all.
    pub gain_begins: [f64; 2],
    /// Secants of a candidate that refits begin at: the cheapest alone is not always that of the best fit.
    pub giving: usize,
    /// Shapes of a candidate that are looked at, the best...
    pub shapes: usize,
    /// ...as far as they promise at least this part of the best of them.
    pub promising: f64,
    /// Width of the prior within which the tests of one state of the conditions by themselves move what a law may follow, in parts of its value:
    /// wide beside any scatter, as a law over a condition is...
    pub state_width: f64,
    /// ...factor within which they move it...
    pub state_reach: f64,
    /// ...iterations of that fit, which begins at the model as it stands...
    pub state_iterations: u64,
    /// ...and parts of the way from that model to what the states want of it at which a law over a condition is computed.
    pub state_parts: [f64; 3],
    /// Lines of an FRF that a look computes at most for each of its resonances, three at least, where every line is a balance of its own or about where a model
    /// stands.
    pub lines: usize,
    /// Iterations after which those of a candidate's starts go on that are level with its best...
    pub tried: u64,
    /// ...by this part of what it has gained, or by the way they have come: a start in the right valley may begin above all the others...
    pub level_with: f64,
    /// ...and after which that is asked again.
    pub choice: u64,
    /// Iterations of a leg; after one the best of its starts stands for a candidate.
    pub leg: u64,
    /// Legs at most.
    pub legs: usize,
    /// Legs within which a refit must come up with the best at the rate of its last one. In a curved valley a rate may also grow: what is left
    /// behind there is not found (study 11).
    pub ahead: f64,
    /// Part of the fall of the best of earlier refits by which a later one must have fallen after its first iterations to be looked at further.
    pub following: f64,
    /// Factor on the least cost within which a refit is worth other starts.
    pub hopeful: f64,
    /// Iterations of a refit from another start.
    pub iterations: u64,
    /// Largest displacements within which a place along the motion is looked for, as a gap: at twice, it is passed by none, and its law is as
    /// good as smooth.
    pub passed: f64,
    /// Part of the largest slope of a candidate's own parameters below which a combination of them does nothing: it has come to rest on a plateau...
    pub flat: f64,
    /// ...how far it is then moved, in logarithms...
    pub off: [f64; 4],
    /// ...and the part of the cost below which that changed nothing either.
    pub unmoved: f64,
    /// Times where a candidate's positive shape begins, and one over it, within which it stays: begun where the tests move, it is another law beyond three decades
    /// from there. A film whose speed is a millionth of theirs is a friction that grows with its logarithm.
    pub shape_reach: f64,
    /// Part of the cost that a setting must take away to be fitted.
    pub freeing: f64,
    /// Parameters of one name and dimension that make two laws kin, the values of one a start for the other...
    pub shared: usize,
    /// ...where it saves this part of the cost.
    pub kin_ahead: f64,
    /// Candidates that came closest to an addition at other places and are held against it again at the end.
    pub closest: usize,
    /// Candidates that are followed along the whole of a record whose beginning they explain.
    pub followed: usize,
}

impl Default for Race {
    fn default() -> Self {
        Race {
            share: 0.75,
            worth: 0.05,
            carries: 0.1,
            of_opinion: 3,
            of_bound: 2,
            leaders: 2,
            leads: 0.5,
            elsewhere: 6,
            at_place: 6,
            rivals: 0.2,
            explained: 0.01,
            parts: [1.0, 0.3, 0.1],
            gain_begins: [0.5, 2.0],
            giving: 2,
            shapes: 3,
            promising: 0.3,
            state_width: 0.5,
            state_reach: 5.0,
            state_iterations: 8,
            state_parts: [1.0, 0.5, 0.25],
            lines: 13,
            tried: 2,
            level_with: 0.8,
            choice: 4,
            leg: 4,
            legs: 40,
            ahead: 10.0,
            following: 0.05,
            hopeful: 10.0,
            iterations: 40,
            passed: 2.0,
            flat: 1e-3,
            off: [-1.4, -0.6, 0.6, 1.4],
            unmoved: 1e-6,
            shape_reach: 1e3,
            freeing: 0.1,
            shared: 2,
            kin_ahead: 0.1,
            closest: 3,
            followed: 4,
        }
    }
}
