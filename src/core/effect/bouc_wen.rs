//! Bouc-Wen hysteresis, normalised.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::{phi1, power};
use super::{Force, Inputs, Num};

/// Bouc-Wen hysteresis, normalised.
pub struct BoucWen;

/// Substeps of a step.
const SUBSTEPS: usize = 4;

impl Force for BoucWen {
    const INFO: Info = Info {
        name: "bouc_wen",
        role: Role::Force,
        claim: "sticks elastically and yields gradually to a limit force: smooth loops of equal shape at every frequency",
        equation: "F = f z,  dz/dx = (1 - |z|^n (sigma sign(z dx) + 1 - sigma))/d",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "limit force"),
            Param::shape("d", Dim::X, Grid::OfX(&[0.03, 0.2, 0.8]), "yield displacement: the initial stiffness is f/d"),
            Param::shape("n", Dim::One, Grid::Values(&[1.0, 3.0]), "sharpness of the yield; beyond its bound elastic_slip")
                .within(1.0, 5.0),
            Param::setting("sigma", Dim::One, Sign::Positive, 0.5, "unloading: 0.5 elastic, above it rounded; 1 with n = 1 is Dahl's law")
                .within(0.5, 5.0)
                .tried(Grid::Starts(&[0.6])),
        ],
        states: 1,
        ports: Ports::DX,
        family: "friction",
        source: "Bouc (1967); Wen, J. Eng. Mech. Div. 102 (1976) 249-263; normalised form, sigma >= 1/2 for passivity: Ikhouane and \
                 Rodellar, Systems with Hysteresis (2007), ch. 2",
        range: "rate-independent hysteresis; drifts under small cycles about a load unless they are symmetric",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, s: &mut [T], p: &[T]) -> T {
        // Along the direction of loading w = z sign(dx): dw/dh = g(w) = 1 - |w|^n (sigma sign(w) + 1 - sigma) over h = |dx|/d. The
        // exponential Rosenbrock-Euler step is of second order, exact for n = 1 under loading, and stable at every step.
        let direction = if u.dx.re() < 0.0 { -1.0 } else { 1.0 };
        let h = u.dx * direction / p[1] * (1.0 / SUBSTEPS as f64);
        let (n, sigma) = (p[2], p[3]);
        let mut w = s[0] * direction;
        for _ in 0..SUBSTEPS {
            let side = if w.re() < 0.0 { -1.0 } else { 1.0 };
            let lower = power(w * side, n - 1.0);
            let share = sigma * (side - 1.0) + 1.0;
            let rate = -(lower * w * side * share) + 1.0;
            let slope = -(n * lower * share * side);
            w += h * phi1(h * slope) * rate;
            if w.re() > 1.0 {
                w = T::from(1.0);
            }
        }
        s[0] = w * direction;
        p[0] * s[0]
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(p[0] / p[1], T::from(0.0)))
    }
}
