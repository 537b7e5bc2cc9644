//! What can go wrong in a block-tridiagonal system.

use crate::explain::Explain;

/// Errors of ordering, assembly, factorisation and solution. Dofs are in the caller's numbering.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BlockTriError {
    /// A dof number outside 0..n.
    #[error("degree of freedom {dof} does not exist: the system has {n}")]
    NoSuchDof { dof: usize, n: usize },
    /// An entry that couples dofs whose coupling was not declared in the pattern.
    #[error("degrees of freedom {row} and {column} are not coupled in the declared pattern")]
    OutsidePattern { row: usize, column: usize },
    /// No admissible pivot in the column of this dof: nothing resists its motion.
    #[error("the system is singular: nothing resists degree of freedom {dof} (pivot {pivot:.3e} of the row's scale)")]
    Singular { dof: usize, pivot: f64 },
    /// As [`BlockTriError::Singular`], at one line of a sweep.
    #[error(
        "the dynamic stiffness is singular at {frequency} Hz: nothing resists degree of freedom {dof} (pivot {pivot:.3e} of the row's scale)"
    )]
    SingularLine { dof: usize, frequency: f64, pivot: f64 },
    /// An entry or a coefficient is NaN or infinite.
    #[error("the matrix has a value that is not finite in the row of degree of freedom {dof}")]
    NotFinite { dof: usize },
    /// A coefficient of a group of elements is NaN or infinite at a line.
    #[error("the coefficient of element group {group} is not finite at {frequency} Hz")]
    CoefficientNotFinite { group: usize, frequency: f64 },
    /// A frequency that is NaN or infinite.
    #[error("frequency line {line} is not finite")]
    FrequencyNotFinite { line: usize },
    /// `solve` before `factor`.
    #[error("the matrix was changed after its last factorisation")]
    NotFactored,
    /// A right-hand side whose length is no multiple of n.
    #[error("a right-hand side of length {len} does not hold whole columns of {n}")]
    Length { len: usize, n: usize },
    /// A matrix that must be symmetric is not.
    #[error("the {matrix} matrix is not symmetric at degrees of freedom {row} and {column}: {value} against {mirrored}")]
    Unsymmetric { matrix: &'static str, row: usize, column: usize, value: f64, mirrored: f64 },
}

impl Explain for BlockTriError {
    fn stage(&self) -> &'static str {
        "engine"
    }

    fn place(&self) -> String {
        match self {
            Self::NoSuchDof { dof, .. } | Self::Singular { dof, .. } | Self::NotFinite { dof } => format!("dof {dof}"),
            Self::SingularLine { dof, frequency, .. } => format!("dof {dof} at {frequency} Hz"),
            Self::OutsidePattern { row, column } | Self::Unsymmetric { row, column, .. } => format!("dofs {row} and {column}"),
            Self::CoefficientNotFinite { group, frequency } => format!("element group {group} at {frequency} Hz"),
            Self::FrequencyNotFinite { line } => format!("line {line}"),
            Self::NotFactored | Self::Length { .. } => String::new(),
        }
    }

    fn accepted(&self) -> String {
        match self {
            Self::NoSuchDof { n, .. } => format!("a number from 0 to {}", n.saturating_sub(1)),
            Self::OutsidePattern { .. } => "entries between dofs declared as coupled when the ordering was made".into(),
            Self::Singular { .. } => "a structure held by stiffness, mass or a constraint in every degree of freedom".into(),
            Self::SingularLine { .. } => "damping, or a frequency that is not exactly an undamped resonance".into(),
            Self::NotFinite { .. } | Self::CoefficientNotFinite { .. } | Self::FrequencyNotFinite { .. } => "finite numbers".into(),
            Self::NotFactored => "a call of factor after the last change of an entry".into(),
            Self::Length { n, .. } => format!("a length that is a multiple of {n}"),
            Self::Unsymmetric { .. } => "a symmetric matrix here; unsymmetric systems go through BlockTri".into(),
        }
    }
}
