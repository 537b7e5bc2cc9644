//! Bouc-Wen hysteresis that gives way where its force changes sign.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::{phi1, power};
use super::{Force, Inputs, Num};

/// Bouc-Wen hysteresis that gives way where its force changes sign.
pub struct PinchedBoucWen;

/// Substeps of a step.
const SUBSTEPS: usize = 8;

impl Force for PinchedBoucWen {
    const INFO: Info = Info {
        name: "pinched_bouc_wen",
        role: Role::Force,
        claim: "yields gradually to a limit force, and is soft for a stretch after each reversal: loops with a waist, of equal shape at every frequency",
        equation: "F = f z,  dz/dx = h (1 - (|z|^n (sigma sign(z dx) + 1 - sigma)))/d,  h = 1 - zeta exp(-((z sign(dx) - q)/w)^2)",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "limit force"),
            Param::shape("d", Dim::X, Grid::OfX(&[0.05, 0.2]), "yield displacement: the initial stiffness is f/d, less what is pinched"),
            Param::shape("zeta", Dim::One, Grid::Values(&[0.8]), "share of the stiffness that is lost where it is pinched most")
                .within(0.01, 0.98),
            Param::shape("q", Dim::One, Grid::Values(&[0.1]), "force over f, on the way up, at which it is pinched most")
                .within(0.001, 0.9),
            Param::setting("w", Dim::One, Sign::Positive, 0.2, "width of the pinched stretch, in forces over f").within(0.05, 2.0),
            Param::setting("n", Dim::One, Sign::Positive, 1.0, "sharpness of the yield").within(1.0, 5.0),
            Param::setting("sigma", Dim::One, Sign::Positive, 0.5, "unloading: 0.5 elastic, above it rounded").within(0.5, 5.0),
        ],
        states: 1,
        ports: Ports::DX,
        family: "friction",
        source: "Baber and Noori, J. Eng. Mech. 111 (1985) 1010-1026; pinching function: Foliente, J. Struct. Eng. 121 (1995) 1013-1022, without \
                 degradation",
        range: "nailed and bolted joints with ovalised holes, reinforced concrete; passive for q >= 0 (what is pinched is the way up)",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, s: &mut [T], p: &[T]) -> T {
        // As in bouc_wen along the direction of loading: the exponential Rosenbrock-Euler step with the slope of the product.
        let direction = if u.dx.re() < 0.0 { -1.0 } else { 1.0 };
        let h = u.dx * direction / p[1] * (1.0 / SUBSTEPS as f64);
        let [zeta, q, width, n, sigma] = [p[2], p[3], p[4], p[5], p[6]];
        let mut w = s[0] * direction;
        for _ in 0..SUBSTEPS {
            let side = if w.re() < 0.0 { -1.0 } else { 1.0 };
            let lower = power(w * side, n - 1.0);
            let share = sigma * (side - 1.0) + 1.0;
            let free = -(lower * w * side * share) + 1.0;
            let free_slope = -(n * lower * share * side);
            let off = (w - q) / width;
            let pinch = zeta * (-(off * off)).exp();
            let (left, left_slope) = (-pinch + 1.0, pinch * off * 2.0 / width);
            let slope = left * free_slope + left_slope * free;
            w += h * phi1(h * slope) * left * free;
            if w.re() > 1.0 {
                w = T::from(1.0);
            }
        }
        s[0] = w * direction;
        p[0] * s[0]
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let off = p[3] / p[4];
        Ok(Complex::new(p[0] / p[1] * (-(p[2] * (-(off * off)).exp()) + 1.0), T::from(0.0)))
    }
}
