//! Block-tridiagonal linear systems, the form every chain-like graph of bodies takes once it is ordered.
//!
//! - [`Levels`] orders a sparse symmetric pattern breadth first: neighbours lie in the same or in adjacent levels, so the matrix is
//!   block tridiagonal, one block per level. A chain of 22 bodies with six coupled degrees of freedom becomes 22 blocks of 6; six
//!   uncoupled axes become six scalar tridiagonals.
//! - [`BlockTri`] stores, factors and solves such a matrix, real or complex, symmetric or not (the march's tangents).
//! - [`FrfSystem`] sweeps Z(w) X = E for symmetric Z(w) = K - w^2 M + sum_g z_g(w) A_g over many frequency lines, four lines to a
//!   vector register and all cores, with the adjoint sensitivities dH/dz_g.
//!
//! Cost and memory are linear in the number of levels. Degrees of freedom ("dofs") are numbered as the caller numbers them; the
//! internal order ("positions") does not show.

// Loops over rows and columns of blocks read as the formulas do; several arrays are indexed alike in each.
#![allow(clippy::needless_range_loop)]

mod error;
mod lanes;
mod layout;
mod levels;
mod matrix;
mod solve;
mod sweep;
mod symmetric;
mod table;

#[cfg(test)]
mod tests;

pub use error::BlockTriError;
#[cfg(target_arch = "x86_64")]
pub(in crate::engine) use lanes::{Avx2, avx2};
pub(in crate::engine) use lanes::{F4, widest};
pub use layout::{Block, Layout};
pub use levels::Levels;
pub use matrix::{BlockTri, Entry, WeakestPivot};
pub use sweep::{FrfSystem, Response, Sweep};
pub use table::Element;
