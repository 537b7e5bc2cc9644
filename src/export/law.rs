//! Laws as expressions that other programs read. The words are those that Adams' functions and a Python script with a few aliases
//! share (`**`, ABS, SQRT, EXP, LOG, MAX, SIGN); laws with memory are written for Adams alone.
//!
//! The force is that of the library: on the second part, the one that holds it there (+k x).

use crate::effect::prony;

/// Adams' arithmetic IF: a value where an expression is negative, zero, positive.
fn cases(of: &str, negative: &str, zero: &str, positive: &str) -> String {
    format!("IF({of}: {negative}, {zero}, {positive})")
}

/// A law without memory: force from displacement `x` and velocity `v`; `p` the parameters as expressions, `si` their values in SI.
pub(super) fn memoryless(effect: &str, p: &[String], si: &[f64], x: &str, v: &str) -> Option<String> {
    let at = |k: usize| p.get(k).map_or("0", String::as_str);
    let (a, b, c, d) = (at(0), at(1), at(2), at(3));
    Some(match effect {
        "preload" => a.to_string(),
        "linear_stiffness" | "stiffness_deviation" => format!("{a}*{x}"),
        "viscous" | "damping_deviation" => format!("{a}*{v}"),
        "quadratic_stiffness" => format!("{a}*{x}**2"),
        "cubic_stiffness" => format!("{a}*{x}**3"),
        "saturating_stiffness" => format!("{a}*{x}/SQRT(1+({x}/{b})**2)"),
        "bilinear_stiffness" => format!("{a}*(MAX({x}-{b}, 0)-MAX(-{b}, 0))"),
        "quadratic_damping" => format!("{a}*{v}*ABS({v})"),
        "asymmetric_damping" => format!("{a}*({v}+{b}*ABS({v}))"),
        "digressive_damping" => format!("{a}*{v}/(1+ABS({v})/{b})"),
        "velocity_spline" | "displacement_spline" => {
            let (u, scale) = (if effect == "velocity_spline" { v } else { x }, at(5));
            // The integral of a slope that is linear between 0, a quarter of the scale and the scale, on one side of rest.
            let side = |s: &str, near: &str, far: &str| {
                let (first, second) = (format!("({near}-1)/(0.25*{scale})"), format!("({far}-{near})/(0.75*{scale})"));
                let beyond = |from: &str| format!("MAX({s}-{from}, 0)**2");
                let inner = format!("0.25*{scale}");
                format!("{s}+0.5*{first}*{s}**2-0.5*({first}-{second})*{}-0.5*{second}*{}", beyond(&inner), beyond(scale))
            };
            let (up, down) = (format!("MAX({u}, 0)"), format!("MAX(-({u}), 0)"));
            format!("{a}*(({})-({}))", side(&up, d, at(4)), side(&down, c, b))
        }
        "power_damping" => format!("{a}*({v}/{c})*(({v}**2+{d}**2)/{c}**2)**(({b}-1)/2)"),
        "coulomb" => format!("{a}*{v}/SQRT({v}**2+{b}**2)"),
        "stribeck" => format!("{a}*(1+{c}*EXP(-({v}/{b})**2))*{v}/SQRT({v}**2+{d}**2)"),
        "contact" | "hunt_crossley" => {
            let hertz = effect == "contact";
            // Indices of side, exponent, reference penetration, damping.
            let [side, n, r, chi] = if hertz { [2, 3, 4, 5] } else { [3, 4, 5, 2] };
            let rate = if hertz { format!("1.5*{}", at(chi)) } else { at(chi).to_string() };
            let stop = |x: &str, v: &str| {
                let depth = format!("MAX({x}-{b}, 0)");
                let power = if si.get(n) == Some(&1.0) { String::new() } else { format!("*({depth}/{})**({}-1)", at(r), at(n)) };
                let damping = if si.get(chi) == Some(&0.0) { String::new() } else { format!("*MAX(1+{rate}*{v}, 0)") };
                format!("{a}*{depth}{power}{damping}")
            };
            let (minus_x, minus_v) = (format!("(-{x})"), format!("(-{v})"));
            match si.get(side).copied().unwrap_or(1.0) {
                side if side > 0.0 => stop(x, v),
                side if side < 0.0 => format!("(-{})", stop(&minus_x, &minus_v)),
                _ => format!("({}-{})", stop(x, v), stop(&minus_x, &minus_v)),
            }
        }
        "smooth_coulomb" => {
            // tanh, without a quotient of two large exponentials.
            let decay = format!("EXP(-2*ABS({v})/{b})");
            format!("{a}*SIGN(1, {v})*(1-{decay})/(1+{decay})")
        }
        "film" if si.get(2) == Some(&0.0) => {
            // asinh, without cancellation for negative velocities.
            format!("{a}*SIGN(1, {v})*LOG(ABS({v}/{b})+SQRT(({v}/{b})**2+1))")
        }
        _ => return None,
    })
}

/// A law with memory: force, and the rate of each state; `z(k)` is how state k is read.
pub(super) struct Remembering {
    pub force: String,
    pub rates: Vec<String>,
    /// Whether the states keep their values while an equilibrium is sought (friction), or settle (creep).
    pub held: bool,
}

/// A law with memory as differential equations in time, in the words of Adams.
pub(super) fn remembering(effect: &str, p: &[String], si: &[f64], x: &str, v: &str, z: &dyn Fn(usize) -> String) -> Option<Remembering> {
    let at = |k: usize| p.get(k).map_or("0", String::as_str);
    let (a, b, c, d) = (at(0), at(1), at(2), at(3));
    let sign = |of: &str| cases(of, "-1", "0", "1");
    // u' = v/d inside the limit and on the way back, else 0: the rate form of a slider.
    let slider = |u: &str, limit: &str| {
        let back = cases(&format!("{u}*{v}"), "1", "0", "0");
        format!("({v}/{b})*{}", cases(&format!("ABS({u})-{limit}"), "1", &back, &back))
    };
    if let Some(series) = prony(effect, si) {
        let mut force: Vec<String> = vec![];
        if series.spring != 0.0 {
            force.push(format!("{:?}*{x}", series.spring));
        }
        if series.damper != 0.0 {
            force.push(format!("{:?}*{v}", series.damper));
        }
        force.extend(series.branches.iter().enumerate().map(|(k, (weight, _))| format!("{weight:?}*{}", z(k))));
        let rates = series.branches.iter().enumerate().map(|(k, (_, rate))| format!("{v}-{rate:?}*{}", z(k))).collect();
        return Some(Remembering { force: format!("{a}*({})", force.join("+")), rates, held: false });
    }
    let u = z(0);
    Some(match effect {
        "film" => Remembering { force: format!("{a}*{u}"), rates: vec![format!("({v}-{b}*SINH({u}))/{c}")], held: false },
        "elastic_slip" => Remembering { force: format!("{a}*{u}"), rates: vec![slider(&u, "1")], held: true },
        "iwan" => {
            let limits = crate::effect::iwan_limits(si.get(2).copied().unwrap_or(0.0));
            let full: f64 = limits.iter().sum();
            let sum: Vec<String> = (0..limits.len()).map(z).collect();
            let rates = limits.iter().enumerate().map(|(k, y)| slider(&z(k), &format!("{y:?}"))).collect();
            Remembering { force: format!("{a}*({})/{full:?}", sum.join("+")), rates, held: true }
        }
        "bouc_wen" => {
            let rate = format!("({v}-ABS({u})**({c}-1)*{u}*ABS({v})*{d}-(1-{d})*{v}*ABS({u})**{c})/{b}");
            Remembering { force: format!("{a}*{u}"), rates: vec![rate], held: true }
        }
        "pinched_bouc_wen" => {
            let (zeta, q, w, n, sigma) = (at(2), at(3), at(4), at(5), at(6));
            let pinch = format!("(1-{zeta}*EXP(-(({u}*{}-{q})/{w})**2))", sign(v));
            let rate = format!("{pinch}*({v}-ABS({u})**({n}-1)*{u}*ABS({v})*{sigma}-(1-{sigma})*{v}*ABS({u})**{n})/{b}");
            Remembering { force: format!("{a}*{u}"), rates: vec![rate], held: true }
        }
        "absorber" => {
            // Displacement relative to the body and velocity of the hidden mass; 2 pi f0 squared and 2 zeta 2 pi f0.
            let rate = format!("((2*PI*{b})**2*{u}+4*PI*{b}*{c}*({}-{v}))", z(1));
            Remembering { force: format!("(-{a}*{rate})"), rates: vec![format!("{}-{v}", z(1)), format!("-{rate}")], held: false }
        }
        "lugre" => {
            let (vs, drop, skew, tau) = (at(2), at(3), at(4), at(5));
            let level = format!("((1+{drop}*EXP(-({v}/{vs})**2))*(1+{skew}*{}))", sign(v));
            let rate = format!("({v}-ABS({v})*{u}/{level})/{b}");
            let damping = format!("{tau}/(1+{tau}*ABS({v})/(4*{b}*{level}))");
            Remembering { force: format!("{a}*({u}+{damping}*{rate})"), rates: vec![rate], held: true }
        }
        _ => return None,
    })
}
