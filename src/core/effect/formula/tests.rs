//! Formulas against closed forms, central differences, and the laws of the library they spell out.

use num_dual::{Dual64, DualNum};

use super::examine::Motion;
use super::*;
use crate::effect::find;

fn program(text: &str) -> Result<Program, FormulaError> {
    parse::parse(text, &["x", "v", "n"])
}

fn number(text: &str, x: f64) -> f64 {
    program(text).unwrap().evaluate(&[x, -2.0, 3.0])
}

#[test]
fn precedence_is_that_of_the_textbook() {
    for (text, expected) in [
        ("-x^2", -9.0),
        ("2^3^2", 512.0),
        ("1e-3", 1e-3),
        ("1.5E+2 + .5", 150.5),
        ("2^-1", 0.5),
        ("-2^-2", -0.25),
        ("(-2)^3", -8.0),
        ("2 - 3 - 4", -5.0),
        ("24/4/2", 3.0),
        ("2*x^2*2", 36.0),
        ("- -x", 3.0),
        ("6/2*(1+2)", 9.0),
        ("--2^2", 4.0),
        ("min(x, 1) + max(x, 1)", 4.0),
        ("pow(2, n)", 8.0),
        ("pow(v, n)", -8.0),
        ("v^2", 4.0),
        ("sign(v)*abs(v)", -2.0),
        ("log(exp(2)) + sqrt(x^2)", 5.0),
        ("tanh(1e9) + tanh(-1e9)", 0.0),
        ("2*pi", std::f64::consts::TAU),
        ("asinh(x)", 3f64.asinh()),
        ("sin(x)^2 + cos(x)^2 + tan(0)", 1.0),
    ] {
        assert!((number(text, 3.0) - expected).abs() < 1e-14 * expected.abs().max(1.0), "{text}: {}", number(text, 3.0));
    }
}

#[test]
fn errors_name_the_character() {
    for (text, position, message) in [
        ("x + * v", 5, "`*` where a value"),
        ("x + ", 5, "ends where a value"),
        ("(x + v", 1, "not closed"),
        ("x + v)", 6, "without an opening"),
        ("x y", 3, "operator"),
        ("2x", 2, "right after the number"),
        ("1.2.3", 4, "right after the number"),
        ("sine(x)", 1, "nearest is `sin`"),
        ("sin x", 1, "without its value"),
        ("pow(x)", 6, "takes 2"),
        ("sin(x, v)", 6, "takes 1"),
        ("x + foo", 5, "`foo` is not known"),
        ("x ** 2", 3, "`**`"),
        ("x # v", 3, "`#`"),
        ("", 1, "ends where"),
        ("ä*x", 1, "not known"),
    ] {
        let e = program(text).unwrap_err();
        let FormulaError::Syntax { position: at, .. } = &e else { panic!("{e}") };
        assert!(*at == position && e.to_string().contains(message), "{text}: {e}");
    }
    // Hostile depth ends in an error, not in a full stack.
    for text in ["(".repeat(500), "-".repeat(1999), "2^".repeat(900) + "2", "1+(".repeat(300)] {
        assert!(program(&text).is_err());
    }
    assert!(program(&"x+".repeat(1500)).is_err());
}

#[test]
fn derivatives_equal_central_differences() {
    let all = "sin(x) cos(x) tan(x) exp(x) log(x+3) sqrt(x+3) abs(x) sign(x) tanh(x) asinh(x) min(x,v) max(x,v) pow(x+3,n) x^3 x^-2 (x+3)^n (x+3)^0.5 x/(v+n) -x^2";
    for text in all.split(' ') {
        let p = program(text).unwrap();
        for x in [-2.6, -1.3, 0.7, 2.2] {
            let at = |x: f64| p.evaluate(&[x, 0.4, 1.7]);
            let slope = p.evaluate(&[Dual64::from_re(x).derivative(), Dual64::from_re(0.4), Dual64::from_re(1.7)]).eps;
            let numeric = (at(x + 1e-5) - at(x - 1e-5)) / 2e-5;
            assert!((slope - numeric).abs() < 1e-7 * (1.0 + slope.abs()), "{text} at {x}: {slope} against {numeric}");
        }
    }
}

/// The same expression written in Rust over num-dual: value and slope to the last digits.
#[test]
fn a_formula_is_the_rust_expression() {
    let p = program("n*x*exp(-x^2) + tanh(v/n)*abs(x)^1.5").unwrap();
    for x in [0.3, 1.9] {
        let (x, v, n) = (Dual64::new(x, 1.0), Dual64::from_re(-0.8), Dual64::from_re(2.5));
        let rust = n * x * (-(x * x)).exp() + (v / n).tanh() * x.powf(1.5);
        let ours = p.evaluate(&[x, v, n]);
        assert!((ours.re - rust.re).abs() < 1e-15 && (ours.eps - rust.eps).abs() < 1e-14);
    }
}

/// A power of zero, a root of zero: no infinite slope that would stop a march at rest.
#[test]
fn values_at_rest_are_finite_in_value_and_slope() {
    for text in ["sqrt(abs(x))", "abs(x)^0.5", "pow(abs(x), n)", "x*abs(x)", "sign(x)", "asinh(x)", "max(x, 0)", "x^2"] {
        let y = program(text).unwrap().evaluate(&[Dual64::new(0.0, 1.0), Dual64::from_re(0.0), Dual64::from_re(0.4)]);
        assert!(y.re == 0.0 && y.eps.is_finite(), "{text}: {y}");
    }
}

const N_MM: Dimension = Dimension::STIFFNESS;

fn definition(expression: &str, states: &[(&str, &str)], parameters: &[(&str, Dimension)]) -> Definition {
    Definition {
        expression: expression.into(),
        states: states.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect(),
        parameters: parameters.iter().map(|(a, d)| (a.to_string(), *d)).collect(),
        active: false,
        rotational: false,
    }
}

fn law(d: &Definition) -> &'static dyn ForceLaw {
    match compile(d) {
        Ok(Effect::Force(law)) => *law,
        other => panic!("{other:?}"),
    }
}

/// Maxwell's branch, LuGre's bristle, and one without states.
fn examples() -> Vec<(&'static dyn ForceLaw, Vec<f64>)> {
    let maxwell = definition("k*z", &[("z", "v - z/tau")], &[("k", N_MM), ("tau", Dimension::TIME)]);
    let two = definition(
        "f*y + k*z + m*a",
        &[("y", "(v - abs(v)*y)/d"), ("z", "v - z/tau*(1 + y^2)")],
        &[("f", Dimension::FORCE), ("d", Dimension::LENGTH), ("k", N_MM), ("tau", Dimension::TIME), ("m", Dimension::MASS)],
    );
    let plain =
        definition("k*x + c*v*abs(x)", &[], &[("k", N_MM), ("c", Dimension::FORCE.over(Dimension::VELOCITY).over(Dimension::LENGTH))]);
    vec![(law(&maxwell), vec![0.8, 0.7]), (law(&two), vec![0.8, 0.3, 0.5, 0.7, 0.2]), (law(&plain), vec![0.8, 0.4])]
}

fn motion(k: usize, dt: f64) -> Inputs<f64> {
    let t = k as f64 * dt;
    let at = |t: f64| t.sin() + 0.3 * (2.7 * t).sin();
    Inputs { x: at(t), v: t.cos() + 0.81 * (2.7 * t).cos(), a: -t.sin() - 2.187 * (2.7 * t).sin(), dx: at(t) - at(t - dt) }
}

#[test]
fn tangents_with_states_equal_central_differences() {
    for (law, p) in examples() {
        let (ns, np, dt) = (law.info().states, p.len(), 0.02);
        let (mut s, mut t) = (vec![0.0; ns], Tangent::default());
        for k in 1..80 {
            let (u, old) = (motion(k, dt), s.clone());
            law.tangent(&u, dt, &mut s, &p, dispatch::Wanted::Params(&vec![true; np]), &mut t);
            let run = |u: &Inputs<f64>, s0: &[f64], p: &[f64]| {
                let mut s = s0.to_vec();
                let f = law.value(u, dt, &mut s, p);
                [vec![f], s].concat()
            };
            for column in 0..dispatch::INPUTS + ns + np {
                let at = |h: f64| {
                    let (mut u, mut s, mut p) = (u, old.clone(), p.clone());
                    match column {
                        0 => u.x += h,
                        1 => u.v += h,
                        2 => u.a += h,
                        3 => u.dx += h,
                        c if c < dispatch::INPUTS + ns => s[c - dispatch::INPUTS] += h,
                        c => p[c - dispatch::INPUTS - ns] += h,
                    }
                    run(&u, &s, &p)
                };
                let (up, down) = (at(1e-5), at(-1e-5));
                for row in 0..=ns {
                    let exact = match column {
                        c if c < dispatch::INPUTS => t.inputs(row)[c],
                        c if c < dispatch::INPUTS + ns => t.states(row)[c - dispatch::INPUTS],
                        c => t.params(row)[c - dispatch::INPUTS - ns],
                    };
                    let numeric = (up[row] - down[row]) / 2e-5;
                    assert!((exact - numeric).abs() < 1e-7 * (1.0 + exact.abs()), "step {k} row {row} column {column}: {exact} {numeric}");
                }
            }
        }
    }
}

#[test]
fn a_formula_is_the_law_it_spells_out() {
    let (formula, p) = &examples()[0];
    let Effect::Force(maxwell) = find("maxwell").unwrap() else { panic!("a force") };
    // Second order from a smooth start: the gap to the exact update of the library falls fourfold with half the step.
    let gap = |steps: usize| {
        let dt = 4.0 / steps as f64;
        let (mut a, mut b) = (vec![0.0; 2], vec![0.0]);
        let at = |k: usize| 1.0 - (k as f64 * dt).cos();
        let motion = |k: usize| Inputs { x: at(k), v: (k as f64 * dt).sin(), a: (k as f64 * dt).cos(), dx: at(k) - at(k - 1) };
        (1..=steps).map(|k| (formula.value(&motion(k), dt, &mut a, p) - maxwell.value(&motion(k), dt, &mut b, p)).abs()).fold(0.0, f64::max)
    };
    let (coarse, fine) = (gap(400), gap(800));
    assert!(fine < 1e-4 && coarse > 3.5 * fine, "{coarse:e}, {fine:e}");
    let s = Complex64::new(-0.1, 2.0);
    assert!((formula.stiffness(s, p).unwrap() - maxwell.stiffness(s, p).unwrap()).norm() < 1e-14);
    let (mut d1, mut d2) = ([Complex64::ZERO; 2], [Complex64::ZERO; 2]);
    let (one, two) = (formula.stiffness_tangent(s, p, &mut d1).unwrap(), maxwell.stiffness_tangent(s, p, &mut d2).unwrap());
    assert!((one.1 - two.1).norm() < 1e-13 && (d1[0] - d2[0]).norm() < 1e-13 && (d1[1] - d2[1]).norm() < 1e-13);
}

#[test]
fn stiffness_of_two_coupled_states_has_exact_slopes() {
    for (law, p) in examples() {
        let s = Complex64::new(-0.1, 2.0);
        let mut dp = vec![Complex64::ZERO; p.len()];
        let (_, ds) = law.stiffness_tangent(s, &p, &mut dp).unwrap();
        let at = |s: Complex64, p: &[f64]| law.stiffness(s, p).unwrap();
        assert!(((at(s + 1e-6, &p) - at(s - 1e-6, &p)) / 2e-6 - ds).norm() < 1e-8 * (1.0 + ds.norm()));
        for k in 0..p.len() {
            let shifted = |h: f64| at(s, &(0..p.len()).map(|j| p[j] + if j == k { h } else { 0.0 }).collect::<Vec<_>>());
            assert!(((shifted(1e-6) - shifted(-1e-6)) / 2e-6 - dp[k]).norm() < 1e-7 * (1.0 + dp[k].norm()));
        }
    }
    // A jump at rest has no small-signal limit, and says what to write instead.
    let rigid = law(&definition("f*sign(v)", &[], &[("f", Dimension::FORCE)]));
    let e = rigid.stiffness(Complex64::I, &[1.0]).unwrap_err();
    assert!(crate::explain::Explain::accepted(&e).contains("tanh"));
}

fn examine(expression: &str, states: &[(&str, &str)], parameters: &[(&str, Dimension)], p: &[f64]) -> Result<(), FormulaError> {
    let law = law(&definition(expression, states, parameters));
    law.formula().unwrap().examine(p, &[Motion { x: 0.5, v: 2.0 }, Motion { x: 1e-3, v: 0.1 }])
}

#[test]
fn passive_formulas_pass_and_sources_do_not() {
    let k = ("k", N_MM);
    let c = ("c", Dimension::DAMPING);
    for (expression, states, parameters, p) in [
        ("k*x + c*v", vec![], vec![k, c], vec![5.0, 0.1]),
        ("-k*x", vec![], vec![k], vec![5.0]),
        ("k*abs(x)*x/d", vec![], vec![k, ("d", Dimension::LENGTH)], vec![5.0, 1.0]),
        ("k*z", vec![("z", "v - z/tau")], vec![k, ("tau", Dimension::TIME)], vec![5.0, 100.0]),
        ("f*z", vec![("z", "(v - abs(v)*z)/d")], vec![("f", Dimension::FORCE), ("d", Dimension::LENGTH)], vec![5.0, 0.01]),
        ("f*sign(v)", vec![], vec![("f", Dimension::FORCE)], vec![3.0]),
    ] {
        examine(expression, &states, &parameters, &p).unwrap_or_else(|e| panic!("{e}"));
    }
    let energy = |e: Result<(), FormulaError>| matches!(e, Err(FormulaError::Energy { given, .. }) if given > 0.0);
    assert!(energy(examine("k*x - c*v", &[], &[k, c], &[5.0, 0.1])));
    assert!(energy(examine("-c*v*(1 - abs(x)/d)", &[], &[c, ("d", Dimension::LENGTH)], &[1.0, 0.8])), "a van der Pol oscillator");
    assert!(energy(examine("-k*z", &[("z", "v - z/tau")], &[k, ("tau", Dimension::TIME)], &[5.0, 0.1])));
    let active = Definition { active: true, ..definition("k*x - c*v", &[], &[k, c]) };
    assert!(law(&active).formula().unwrap().examine(&[5.0, 0.1], &[Motion { x: 0.5, v: 2.0 }]).is_ok());
    let e = examine("k*z", &[("z", "v + z/tau")], &[k, ("tau", Dimension::TIME)], &[5.0, 0.3]).unwrap_err();
    assert!(matches!(e, FormulaError::Unstable { .. }), "{e}");
}

#[test]
fn a_formula_without_a_value_says_where() {
    let f = ("f", Dimension::FORCE);
    let d = ("d", Dimension::LENGTH);
    for (expression, position, what) in [
        ("f*d/x", 4, "division by zero"),
        ("f/(d - abs(x))*d", 2, "division by zero"),
        ("f*log(x/d)", 3, "logarithm of 0"),
        ("f*sqrt(x/d - 0.1)", 3, "square root"),
        ("f*(x/d)^-2", 8, "division by zero"),
        ("f*pow(x/d - 0.1, 0.5)", 3, "no real number"),
        ("f*exp(1e4 + x/d)", 3, "inf"),
    ] {
        let e = examine(expression, &[], &[f, d], &[1.0, 0.5]).unwrap_err();
        let FormulaError::NoValue { position: at, .. } = &e else { panic!("{expression}: {e}") };
        assert!(*at == position && e.to_string().contains(what), "{e}");
    }
}

#[test]
fn dimensions_are_held_against_each_other() {
    let refused = |d: Definition| compile(&d).map(|_| ()).unwrap_err();
    let (part, e) = refused(definition("k*x", &[], &[("k", Dimension::FORCE)]));
    assert!(part == Part::Expression && e.to_string().contains("the result is a moment"), "{e}");
    let (_, e) = refused(definition("k*x + c*x", &[], &[("k", N_MM), ("c", Dimension::DAMPING)]));
    assert!(e.to_string().contains("character 5: the sum of a force"), "{e}");
    let (_, e) = refused(definition("f*tanh(v)", &[], &[("f", Dimension::FORCE)]));
    assert!(e.to_string().contains("hyperbolic tangent of a velocity"), "{e}");
    let (part, e) = refused(definition("k*z", &[("z", "v - abs(v)*z/f")], &[("k", N_MM), ("f", Dimension::FORCE)]));
    assert!(part == Part::State("z".into()) && e.to_string().contains("difference of a velocity"), "{e}");
    for fine in [
        definition("f*tanh(v/0.001) + 0.5*k*x", &[], &[("f", Dimension::FORCE), ("k", N_MM)]),
        definition("k*z", &[("z", "v - abs(v)*z/z0")], &[("k", N_MM), ("z0", Dimension::LENGTH)]),
        definition("k*max(x - 0.001, 0)", &[], &[("k", N_MM)]),
        Definition { rotational: true, ..definition("k*x", &[], &[("k", Dimension::ROTATIONAL_STIFFNESS)]) },
        Definition { rotational: true, ..definition("k*x", &[], &[("k", Dimension::MOMENT)]) },
    ] {
        compile(&fine).unwrap_or_else(|e| panic!("{:?}", e));
    }
}

#[test]
fn names_are_checked_and_a_definition_is_compiled_once() {
    let refused = |d: Definition| compile(&d).map(|_| ()).unwrap_err();
    for name in ["x", "pi", "sin", "2k", "k-1"] {
        let (part, e) = refused(definition("x", &[], &[(name, N_MM)]));
        assert_eq!(part, Part::Parameter(name.into()), "{e}");
    }
    let (part, e) = refused(definition("k*x", &[], &[("k", N_MM), ("q", N_MM)]));
    assert!(part == Part::Parameter("q".into()) && e.to_string().contains("not used"), "{e}");
    let names: Vec<String> = (0..8).map(|k| format!("k{k}")).collect();
    let many: Vec<(&str, Dimension)> = names.iter().map(|n| (n.as_str(), N_MM)).collect();
    assert!(refused(definition("x", &[], &many)).1.to_string().contains("8 parameters"));
    let d = definition("k*x", &[], &[("k", N_MM)]);
    assert!(std::ptr::eq(compile(&d).unwrap(), compile(&d).unwrap()));
}
