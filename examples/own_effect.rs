//! A law of friction written outside the library, tried on measured loops: `cargo run --release --example own_effect`.

use misfit::prelude::*;

/// Dahl's friction: a slider that gives way little by little.
struct Dahl;

impl Force for Dahl {
    const INFO: Info = Info {
        claim: "bends over smoothly after every reversal, and stays at its limit force",
        states: 1,
        ..Info::force(
            "dahl",
            "F = f z,  z' = (x'/d) (1 - z sign x')",
            // The strength comes first. The search for missing effects tries slip distances that are these parts of the amplitude.
            &[
                Param::strength("f", Dim::F, Sign::NonNegative, "limit force"),
                Param::shape("d", Dim::X, Grid::OfX(&[0.03, 0.1, 0.3]), "distance over which it gives way: the stuck stiffness is f/d"),
            ],
            Ports::DX,
        )
    };

    // Written over `T`, the law gives its values over plain numbers and its exact derivatives over dual numbers.
    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, s: &mut [T], p: &[T]) -> T {
        let (direction, way) = if u.dx.re() < 0.0 { (-1.0, -u.dx) } else { (1.0, u.dx) };
        s[0] = (s[0] - direction) * (-way / p[1]).exp() + direction;
        p[0] * s[0]
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(p[0] / p[1], T::from(0.0)))
    }
}

/// The program.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (before, after) = run("studies/08-two-effects")?;
    println!("cost {before:.0} without dahl, {after:.0} with it");
    Ok(())
}

/// Costs of the fits of a study without and with the law at `c1.x`.
pub fn run(path: &str) -> Result<(f64, f64), Box<dyn std::error::Error>> {
    // From here on studies may name it, and as `true` says, the search tries it.
    register_force::<Dahl>(true)?;
    let study = Study::load(path.as_ref(), None)?;
    let mut case = Case::from_study(&study, 1)?;
    let (_, _, before) = fit(&case, &[SplitName::Fit], &Monitor::default())?;
    case.system = case.system.and("dahl", "c1.x", &[("f", 5.0), ("d", 1e-4)])?;
    let (_, _, after) = fit(&case, &[SplitName::Fit], &Monitor::default())?;
    Ok((before.cost, after.cost))
}
