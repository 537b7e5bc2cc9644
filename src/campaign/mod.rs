//! Campaigns: one verb over many variants, every result kept once and whole, one table and one page of what differs.
//!
//! campaign.toml lists or crosses studies, seeds, values and arguments ([`Spec`]). Every task is the verb on one variant in a process of its own ([`task`]), named by the
//! content of its inputs: what has not changed is not computed again. Two executors work on one list: the machine's own cores, and Slurm ([`slurm`]), which
//! queues, places and requeues; nothing here schedules. A result is written to a temporary file that takes its name when it is complete, and the table
//! ([`table`]) is made from these files, in the order of the list.
//!
//! # campaign.toml
//! | key | what |
//! |---|---|
//! | `schema = 1`, `title` | the first is required |
//! | `verb` | check, compare, fit, diagnose, add, ladder, predict, tolerance, trial |
//! | `studies = ["a", "b"]` | folders with study.toml, or such files, relative to campaign.toml |
//! | `arguments = ["--bootstrap", "20"]` | of every task |
//! | `retries = 1` | how often a failed task is tried again |
//! | `threads = 1` | threads of a task |
//! | `keep_runs = true` | keep the folder of every run |
//! | `shares = 8` | tasks among which the replicates of `--bootstrap`, the parameters of `--profile` and the cases of a trial are divided; the run that puts them together is the row |
//! | `refits = 20` | of `add`: the tasks are the best so many candidates of the score map of each study (`diagnose --scores`) |
//! | `[grid]` | every combination of its lists: `seed`, the name of a parameter (`"c1.x.viscous.c"`: its start), a key of study.toml (`"fit.loss"`), an option (`"--cases"`), for `add` the name of an effect (`effect`) |
//! | `[[variant]]` | one task beside the grid: `name`, `study`, `seed`, `set = { key = value }`, `arguments` |

mod error;
mod execute;
mod folder;
mod list;
mod page;
mod spec;
mod share;
pub mod slurm;
pub mod table;
pub mod task;
mod variant;

pub use error::CampaignError;
pub use execute::{Done, How, On, Say, Stopped, element, run};
pub use page::page;
pub use share::{Share, shares};
pub use spec::{Spec, VERBS};
pub use task::{Record, Runner, Task, whole};

/// Puts tasks in order and names them by their inputs.
pub fn tasks(spec: &Spec) -> Result<Vec<Task>, CampaignError> {
    list::list(spec)
}

/// The score maps (`diagnose --scores`) that a campaign with `refits` runs first; none for another.
pub fn looks(spec: &Spec) -> Result<Vec<Task>, CampaignError> {
    list::looks(spec)
}

/// Its tasks, once these maps have their records: the best candidates of each.
pub fn refits(spec: &Spec, looks: &[Task], records: &[Option<Record>]) -> Vec<Task> {
    list::refits(spec, looks, records)
}
