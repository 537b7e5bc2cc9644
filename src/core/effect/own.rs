//! Laws that a program registers beside the library, without a change of this crate. A study names them as it names those of the library.

use std::sync::{PoisonError, RwLock};

use super::dispatch::Dispatch;
use super::{Effect, EffectError, Force, ForceLaw, LIBRARY};

/// A registered law.
#[derive(Clone, Copy)]
pub(super) struct Own {
    pub effect: &'static Effect,
    searched: bool,
}

static OWN: RwLock<Vec<Own>> = RwLock::new(Vec::new());

/// Keys of an `[[effect]]` that no parameter may take.
const TAKEN: [&str; 8] = ["effect", "at", "per", "monotone", "only", "of", "condition", "reference"];

/// Parameters of a law at most: small motion is differentiated by eight numbers, of which the frequency is one.
const MOST_PARAMETERS: usize = 7;
/// States of a law at most: with four inputs and the parameters they are no more than the 32 columns of a tangent.
const MOST_STATES: usize = 16;

/// Registers a force law under the name in its [`Info`](super::Info), or puts it in the place of an earlier one of that name. Studies that
/// were read before keep the earlier law. Where `searched`, the search for missing effects tries it as well; its force must then be
/// proportional to its first parameter and its states independent of it.
///
/// The law is kept for the life of the program, as those of the library are.
///
/// # Errors
/// A name that is no word or belongs to the library; parameters without a name of their own, or none.
pub fn register(law: Box<dyn ForceLaw>, searched: bool) -> Result<&'static Effect, EffectError> {
    let info = law.info();
    let refuse = |message: String, accepted: &str| EffectError::Refused { name: info.name.into(), message, accepted: accepted.into() };
    if !word(info.name) {
        return Err(refuse(format!("`{}` is no name for an effect", info.name), "letters, digits and _, not a digit first"));
    }
    if LIBRARY.iter().any(|e| e.info().name == info.name) {
        return Err(refuse(format!("`{}` is an effect of the library", info.name), "another name"));
    }
    if info.params.is_empty() {
        return Err(refuse(format!("`{}` has no parameter", info.name), "at least one parameter, the strength first"));
    }
    for (k, p) in info.params.iter().enumerate() {
        if !word(p.name) || TAKEN.contains(&p.name) || info.params[..k].iter().any(|q| q.name == p.name) {
            return Err(refuse(format!("`{}` cannot be the name of a parameter here", p.name), "a word of its own"));
        }
    }
    let own = Own { effect: Box::leak(Box::new(Effect::Force(Box::leak(law)))), searched };
    let mut all = OWN.write().unwrap_or_else(PoisonError::into_inner);
    all.retain(|o| o.effect.info().name != own.effect.info().name);
    all.push(own);
    Ok(own.effect)
}

/// As [`register`], for a law written as those of the library are.
///
/// # Errors
/// As [`register`]; more than 7 parameters or 16 states.
pub fn register_force<L: Force>(searched: bool) -> Result<&'static Effect, EffectError> {
    let info = L::INFO;
    if info.params.len() > MOST_PARAMETERS || info.states > MOST_STATES {
        let message = format!("`{}` has {} parameters and {} states", info.name, info.params.len(), info.states);
        let accepted = format!("at most {MOST_PARAMETERS} parameters and {MOST_STATES} states");
        return Err(EffectError::Refused { name: info.name.into(), message, accepted });
    }
    register(Box::new(Dispatch::<L>::NEW), searched)
}

fn word(name: &str) -> bool {
    name.chars().all(|c| c.is_alphanumeric() || c == '_') && name.chars().next().is_some_and(|c| !c.is_ascii_digit())
}

pub(super) fn all() -> Vec<Own> {
    OWN.read().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Names of all effects, those of the library first.
pub fn names() -> Vec<&'static str> {
    LIBRARY.iter().map(|e| e.info().name).chain(all().iter().map(|o| o.effect.info().name)).collect()
}

/// The registered laws that the search tries.
pub fn searched() -> Vec<&'static Effect> {
    all().into_iter().filter(|o| o.searched).map(|o| o.effect).collect()
}

#[cfg(test)]
mod tests {
    use super::super::dispatch::{Dispatch, Tangent, Wanted};
    use super::super::{Dim, Info, Inputs, Num, Param, Ports, Sign, find, viscous};
    use super::*;
    use num_complex::{Complex, Complex64};

    /// A damper under another name.
    struct Renamed(Info);

    impl ForceLaw for Renamed {
        fn info(&self) -> &'static Info {
            Box::leak(Box::new(self.0))
        }
        fn linear(&self) -> bool {
            true
        }
        fn superposes(&self) -> bool {
            true
        }
        fn value(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64]) -> f64 {
            Dispatch::<viscous::Viscous>::NEW.value(u, dt, s, p)
        }
        fn tangent(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64], wanted: Wanted, out: &mut Tangent) {
            Dispatch::<viscous::Viscous>::NEW.tangent(u, dt, s, p, wanted, out);
        }
        fn stiffness(&self, s: Complex64, p: &[f64]) -> Result<Complex64, EffectError> {
            Dispatch::<viscous::Viscous>::NEW.stiffness(s, p)
        }
        fn stiffness_tangent(&self, s: Complex64, p: &[f64], dp: &mut [Complex64]) -> Result<(Complex64, Complex64), EffectError> {
            Dispatch::<viscous::Viscous>::NEW.stiffness_tangent(s, p, dp)
        }
    }

    fn renamed(name: &'static str) -> Box<dyn ForceLaw> {
        Box::new(Renamed(Info { name, ..*find("viscous").unwrap().info() }))
    }

    #[test]
    fn a_registered_law_is_found_and_replaced_and_a_name_of_the_library_is_refused() {
        assert!(find("own_damper").is_err());
        let first = register(renamed("own_damper"), false).unwrap();
        assert!(std::ptr::eq(find("own_damper").unwrap(), first) && names().contains(&"own_damper"));
        assert!(!searched().iter().any(|e| e.info().name == "own_damper"));
        let second = register(renamed("own_damper"), false).unwrap();
        assert!(std::ptr::eq(find("own_damper").unwrap(), second) && !std::ptr::eq(first, second));
        assert_eq!(names().iter().filter(|n| **n == "own_damper").count(), 1);
        for name in ["viscous", "2nd", "", "own damper"] {
            assert!(matches!(register(renamed(name), false), Err(EffectError::Refused { .. })), "{name}");
        }
        let nameless = Renamed(Info { name: "other", params: &[], ..*find("viscous").unwrap().info() });
        assert!(matches!(register(Box::new(nameless), false), Err(EffectError::Refused { .. })));
    }

    /// A law that the dual numbers of a tangent have no columns for.
    struct Large;

    impl Force for Large {
        const INFO: Info = Info {
            states: MOST_STATES + 1,
            ..Info::force("large", "F = c v", &[Param::strength("c", Dim::FT_PER_X, Sign::Any, "")], Ports::V)
        };
        fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
            p[0] * u.v
        }
        fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
            Ok(s * p[0])
        }
    }

    #[test]
    fn a_law_with_too_many_states_is_refused() {
        let e = register_force::<Large>(false).unwrap_err();
        assert!(e.to_string().contains("17 states") && crate::explain::Explain::accepted(&e).contains("16 states"), "{e}");
        assert!(find("large").is_err());
    }
}
