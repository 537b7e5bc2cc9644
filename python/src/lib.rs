//! The native part of the Python package `misfit`: verbs through [`misfit::cli::call`], the model as a function of its parameters, tables, curves,
//! and laws written in Python. What users see is in `misfit/*.py`.

mod call;
mod curve;
mod dual;
mod error;
mod law;
mod model;
mod stiffness;
mod table;
mod watch;
mod write;

use pyo3::prelude::*;

/// Native part of the package.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::call::{Called, call, main, panic};
    #[pymodule_export]
    use crate::curve::Curve;
    #[pymodule_export]
    use crate::dual::Dual;
    #[pymodule_export]
    use crate::law::register;
    #[pymodule_export]
    use crate::model::Model;
    #[pymodule_export]
    use crate::table::Table;
    #[pymodule_export]
    use crate::write::{save_study, write_study};
}
