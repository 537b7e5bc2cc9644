use super::*;
use crate::explain::Explain;
use proptest::prelude::*;
use std::f64::consts::PI;

#[test]
fn engineers_units() {
    let close = |text: &str, d: Dimension, si: f64| {
        let got = parse(text, d).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert!((got - si).abs() <= 1e-14 * si.abs(), "{text}: {got} instead of {si}");
    };
    close("20 N/mm", Dimension::STIFFNESS, 2e4);
    close("20N/mm", Dimension::STIFFNESS, 2e4);
    close("3.6E+06 N/mm", Dimension::STIFFNESS, 3.6e9);
    close("0.1 N s/mm", Dimension::DAMPING, 100.0);
    close("0.1 N·s/mm", Dimension::DAMPING, 100.0);
    close("0.1 N*s/mm", Dimension::DAMPING, 100.0);
    close("0.4 mm", Dimension::LENGTH, 4e-4);
    close("-2 µm", Dimension::LENGTH, -2e-6);
    close("−2 um", Dimension::LENGTH, -2e-6);
    close("1 Hz", Dimension::FREQUENCY, 1.0);
    close("3 1/s", Dimension::FREQUENCY, 3.0);
    close("120 rpm", Dimension::FREQUENCY, 2.0);
    close("30 rpm", Dimension::ANGULAR_VELOCITY, PI);
    close("1490 N mm/deg", Dimension::ROTATIONAL_STIFFNESS, 1.49 * 180.0 / PI);
    close("1490 N*mm/°", Dimension::ROTATIONAL_STIFFNESS, 1.49 * 180.0 / PI);
    close("5 N m", Dimension::ROTATIONAL_STIFFNESS, 5.0);
    close("3500 N·mm·s/°", Dimension::ROTATIONAL_DAMPING, 3.5 * 180.0 / PI);
    close("30 lbf", Dimension::FORCE, 133.446648457815);
    close("0.03 kip", Dimension::FORCE, 133.446648457815);
    close("1 in", Dimension::LENGTH, 0.0254);
    close("1 ft", Dimension::LENGTH, 0.3048);
    close("2 g", Dimension::ACCELERATION, 19.6133);
    close("2 g", Dimension::MASS, 0.002);
    close("1 g/N", Dimension::ACCELERANCE, 9.80665);
    for unit in ["m/s2", "m/s^2", "m/s²", "m s-2", "m·s⁻²", "m/(s s)", "m/s/s", "m s^-2", "m/s**2"] {
        close(&format!("3 {unit}"), Dimension::ACCELERATION, 3.0);
    }
    close("7 m/s2/N", Dimension::ACCELERANCE, 7.0);
    close("1.04 mJ", Dimension::ENERGY, 1.04e-3);
    close("1.04 mJ/cycle", Dimension::ENERGY, 1.04e-3);
    close("210 GPa", Dimension::PRESSURE, 210e9);
    close("1 N/mm2", Dimension::PRESSURE, 1e6);
    close("1 t", Dimension::MASS, 1000.0);
    close("5.3 %", Dimension::DIMENSIONLESS, 0.053);
    close("0.3", Dimension::DIMENSIONLESS, 0.3);
    close("0.3 -", Dimension::DIMENSIONLESS, 0.3);
    close("0.3 1", Dimension::DIMENSIONLESS, 0.3);
    close("0.276 1/mm", Dimension::DIMENSIONLESS.over(Dimension::LENGTH), 276.0);
    close("1/mm", Dimension::DIMENSIONLESS.over(Dimension::LENGTH), 1000.0);
    close("20 °C", Dimension::TEMPERATURE, 293.15);
    close("5 min", Dimension::TIME, 300.0);
    assert_eq!(parse("0.3 mm", Dimension::LENGTH).unwrap(), 0.0003);
}

#[test]
fn refusals_say_what_was_found_and_what_is_accepted() {
    let error = |text: &str, d: Dimension| parse(text, d).expect_err(text);
    let e = error("20 mm", Dimension::FORCE);
    assert!(matches!(e, UnitError::WrongDimension { .. }));
    assert_eq!(e.to_string(), "`20 mm` is a length (m), where a force is expected");
    assert!(e.accepted().contains("lbf"));
    let e = error("20", Dimension::STIFFNESS);
    assert!(matches!(e, UnitError::MissingUnit { .. }) && e.accepted().contains("N/mm"), "{e}");
    assert!(error("20 n/mm", Dimension::STIFFNESS).to_string().contains("nearest is `N`"));
    assert!(error("20 KN", Dimension::FORCE).to_string().contains("nearest is `kN`"));
    assert!(matches!(error("", Dimension::FORCE), UnitError::Empty { .. }));
    assert!(matches!(error("  ", Dimension::FORCE), UnitError::Empty { .. }));
    assert!(matches!(error("nan N", Dimension::FORCE), UnitError::NotFinite { .. }));
    assert!(matches!(error("-inf N", Dimension::FORCE), UnitError::NotFinite { .. }));
    assert!(matches!(error("1e400 N", Dimension::FORCE), UnitError::NotFinite { .. }));
    assert!(matches!(error("1e308 kN", Dimension::FORCE), UnitError::NotFinite { .. }));
    assert!(matches!(error("0,5 N", Dimension::FORCE), UnitError::DecimalComma { .. }));
    assert!(matches!(error("N", Dimension::FORCE), UnitError::NoNumber { .. }));
    assert!(matches!(error(&"9".repeat(500), Dimension::FORCE), UnitError::TooLong { .. }));
    for bad in ["1 N/", "1 N//m", "1 N)", "1 (N", "1 N^", "1 N^0", "1 N^99", "1 N/m s", "1 N$", "1 N 2 m", "1 N^1.5", "1..2 N"] {
        assert!(matches!(error(bad, Dimension::FORCE), UnitError::Syntax { .. }), "{bad}: {:?}", error(bad, Dimension::FORCE));
    }
    // A factor of 2 pi is not to be lost: rad/s is no frequency, Hz no angular velocity, a bare number no angle.
    assert!(parse("6 rad/s", Dimension::FREQUENCY).is_err());
    assert!(parse("6 Hz", Dimension::ANGULAR_VELOCITY).is_err());
    assert!(parse("6", Dimension::ANGLE).is_err());
    assert!(parse("6 N m/rad", Dimension::MOMENT).is_err());
}

#[test]
fn spreads() {
    let s = |text: &str| parse_spread(text, None).unwrap_or_else(|e| panic!("{text}: {e}"));
    for text in ["0.4 mm +- 0.02 mm", "0.4 mm +- 0.02", "0.4 +- 0.02 mm", "0.4 mm ± 20 um", "0.4 mm +/- 5 %"] {
        let spread = s(text);
        assert!((spread.quantity.value - 4e-4).abs() < 1e-18 && (spread.sigma.unwrap() - 2e-5).abs() < 1e-18, "{text}: {spread:?}");
    }
    assert_eq!(s("20 degC +- 2 degC").sigma, Some(2.0));
    assert_eq!(s("0.4 mm").sigma, None);
    for bad in ["0.4 mm +- 0 mm", "0.4 mm +- -1 mm", "0.4 mm +-", "0.4 mm +- 1 N", "+- 1 mm"] {
        assert!(parse_spread(bad, None).is_err(), "{bad}");
    }
}

proptest! {
    #[test]
    fn no_text_panics(text in "\\PC{0,60}", unit in "[-+0-9.e ]{0,6}[a-zA-Z%°µ·*/^()²⁻0-9 ]{0,30}") {
        for t in [&text, &unit] {
            let _ = parse(t, Dimension::FORCE);
            let _ = parse_any(t);
            let _ = parse_spread(t, None);
            let _ = parse_unit_any(t);
        }
    }

    #[test]
    fn printed_quantities_read_back(x in -1e9..1e9f64, k in 0usize..12) {
        let units = ["N/mm", "N s/mm", "mm", "kip", "in", "m/s²", "N·mm/°", "%", "GPa", "mJ", "1/mm", "lbf/in"];
        let unit = parse_unit_any(units[k]).unwrap();
        let q = Quantity { value: x, unit };
        let back = parse_quantity(&q.to_string(), q.unit.dimension).unwrap();
        prop_assert!((back.value - x).abs() <= 2e-15 * x.abs(), "{q}: {} {}", back.value, x);
    }
}

/// Few digits are within 1e-9 of the value; what has few digits by itself keeps them.
#[test]
fn a_value_for_a_reader_has_few_digits() {
    let unit = parse_unit("N/mm", Dimension::STIFFNESS).unwrap();
    for (si, text) in
        [(310_059.827_134_352_8, "310.059827 N/mm"), (20e3, "20 N/mm"), (0.0, "0 N/mm"), (1e-4 / 3.0, "0.00000003333333333 N/mm")]
    {
        let printed = unit.print_short(si);
        assert_eq!(printed, text);
        let back = parse(&printed, Dimension::STIFFNESS).unwrap();
        assert!((back - si).abs() <= 1e-9 * si.abs(), "{printed}");
    }
}
