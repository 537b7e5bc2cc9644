//! Eqs. 4 to 6: the interference that leaf springs and their housing settle at, and whether a table keeps to it.
//!
//! Spring force of the leaf (eq. 4) `F_s = 24 E_s I delta / L^3`, force of the housing (eq. 5) `F_p = E_p A i / h_r`. They are equal
//! (eq. 6): `i A = 24 E_s I h_r delta / (L^3 E_p)`, one constant of the leaf and its housing, whatever the contact area.

use super::{Cases, ToleranceError};

/// An interference with the contact area it stands at.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Name of the interference.
    pub interference: String,
    /// Name of the area.
    pub area: String,
    /// One unit of the last printed digit of either [m, m2].
    pub resolution: (f64, f64),
}

/// What eqs. 4 to 6 need beside the area [SI].
#[derive(Clone, Debug, PartialEq)]
pub struct Housing {
    /// Young's modulus of the leaf, E_s.
    pub leaf_modulus: f64,
    /// Length of the leaf, L.
    pub leaf_length: f64,
    /// Width of the leaf, for the thickness its moment of area means.
    pub leaf_width: f64,
    /// Deflection of the leaf in its housing, delta.
    pub deflection: f64,
    /// Young's modulus of the housing, E_p.
    pub housing_modulus: f64,
    /// Resistant thickness of the housing, h_r.
    pub thickness: f64,
}

impl Housing {
    /// Moment of area of the leaf [m4] that eq. 6 needs for the constant `i A` [m3].
    pub fn moment_of_area(&self, constant: f64) -> f64 {
        constant * self.leaf_length.powi(3) * self.housing_modulus / (24.0 * self.leaf_modulus * self.thickness * self.deflection)
    }

    /// The constant `i A` [m3] of a leaf with the moment of area `inertia` [m4]: eq. 6.
    pub fn constant(&self, inertia: f64) -> f64 {
        24.0 * self.leaf_modulus * inertia * self.thickness * self.deflection / (self.leaf_length.powi(3) * self.housing_modulus)
    }

    /// Thickness [m] of a leaf of the declared width with that moment of area: I = b h^3 / 12.
    pub fn leaf_thickness(&self, inertia: f64) -> f64 {
        (12.0 * inertia / self.leaf_width).cbrt()
    }
}

/// The constant that serves a table best, and what it leaves.
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    /// `i A` [m3], by least squares on the interferences.
    pub value: f64,
    /// Of each pair: name of the interference, largest difference of the table to `constant / A` [m], the case where it is.
    pub largest: Vec<(String, f64, String)>,
    /// Of each pair: the values of `i A` that rounding allows in all cases [m3], lowest and highest; crossed where there are none.
    pub allowed: Vec<(String, f64, f64)>,
    /// The same for all pairs together.
    pub allowed_by_all: (f64, f64),
}

impl Constant {
    /// Whether one constant is within the rounding of the whole table.
    pub fn holds(&self) -> bool {
        self.allowed_by_all.0 <= self.allowed_by_all.1
    }

    /// The best constant of a table: minimises the sum of `(i - c / A)^2` over cases and pairs.
    pub fn of(cases: &Cases, pairs: &[Pair]) -> Result<Constant, ToleranceError> {
        if cases.cases.is_empty() || pairs.is_empty() {
            return Err(ToleranceError::TooFew { what: "one constant i A".into(), found: cases.cases.len().min(pairs.len()), needed: 1 });
        }
        let of = |p: &Pair| cases.of(&p.interference).into_iter().zip(cases.of(&p.area)).collect::<Vec<(f64, f64)>>();
        let all: Vec<(f64, f64)> = pairs.iter().flat_map(of).collect();
        let value = all.iter().map(|(i, a)| i / a).sum::<f64>() / all.iter().map(|(_, a)| 1.0 / (a * a)).sum::<f64>();
        let (mut largest, mut allowed) = (Vec::new(), Vec::new());
        for pair in pairs {
            let rows = of(pair);
            let off = rows.iter().map(|(i, a)| (i - value / a).abs()).enumerate();
            let worst = off.fold((0, 0.0), |m, (k, d)| if d > m.1 { (k, d) } else { m });
            largest.push((pair.interference.clone(), worst.1, cases.cases[worst.0].name.clone()));
            let half = (0.5 * pair.resolution.0, 0.5 * pair.resolution.1);
            let low = rows.iter().map(|(i, a)| (i - half.0) * (a - half.1)).fold(f64::NEG_INFINITY, f64::max);
            let high = rows.iter().map(|(i, a)| (i + half.0) * (a + half.1)).fold(f64::INFINITY, f64::min);
            allowed.push((pair.interference.clone(), low, high));
        }
        let by_all = allowed.iter().fold((f64::NEG_INFINITY, f64::INFINITY), |(l, h), a| (l.max(a.1), h.min(a.2)));
        Ok(Constant { value, largest, allowed, allowed_by_all: by_all })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tolerance::Case;
    use crate::units::{Dimension, Unit};

    fn table(rows: &[(f64, f64)]) -> (Cases, Vec<Pair>) {
        let case = |(k, (i, a)): (usize, &(f64, f64))| Case {
            name: (k + 1).to_string(),
            values: [("i".to_string(), *i), ("A".to_string(), *a)].into(),
            energy: 1.0,
            stored: None,
            place: String::new(),
        };
        let cases = rows.iter().enumerate().map(case).collect();
        let pair = Pair { interference: "i".into(), area: "A".into(), resolution: (1e-5, 1e-7) };
        (Cases { cases, units: Default::default(), energy_unit: Unit::si(Dimension::ENERGY) }, vec![pair])
    }

    #[test]
    fn a_table_of_one_constant_holds_and_another_does_not() {
        // i A = 2.8e-9 m3, i rounded to 0.01 mm.
        let round = |i: f64| (i * 1e5).round() * 1e-5;
        let rows: Vec<(f64, f64)> = [7.1e-6, 6.2e-6, 5.0e-6].map(|a| (round(2.8e-9 / a), a)).to_vec();
        let (cases, pairs) = table(&rows);
        let c = Constant::of(&cases, &pairs).unwrap();
        assert!(c.holds() && (c.value / 2.8e-9 - 1.0).abs() < 0.02, "{c:?}");
        assert!(c.largest[0].1 < 1.2e-5, "{c:?}");
        let (cases, pairs) = table(&[(0.4e-3, 7e-6), (0.4e-3, 5e-6)]);
        let c = Constant::of(&cases, &pairs).unwrap();
        assert!(!c.holds());
        // Least squares by hand: sum(i/A) / sum(1/A^2).
        let by_hand = (0.4e-3 / 7e-6 + 0.4e-3 / 5e-6) / (1.0 / 49e-12 + 1.0 / 25e-12);
        assert!((c.value / by_hand - 1.0).abs() < 1e-14);
        assert!(Constant::of(&cases, &[]).is_err());
    }

    #[test]
    fn forces_of_leaf_and_housing_are_equal_at_the_interference() {
        let housing =
            Housing { leaf_modulus: 210e9, leaf_length: 84e-3, leaf_width: 18e-3, deflection: 5e-3, housing_modulus: 4e9, thickness: 8e-3 };
        let (width, height): (f64, f64) = (18e-3, 0.6e-3);
        let inertia = width * height.powi(3) / 12.0;
        let area = 7.1e-6;
        let i = housing.constant(inertia) / area;
        // Eqs. 4 and 5 as they stand.
        let spring = 3.0 * 210e9 * inertia / (0.042f64).powi(3) * 5e-3;
        let seat = 4e9 * area * i / 8e-3;
        assert!((spring / seat - 1.0).abs() < 1e-12);
        assert!((housing.moment_of_area(housing.constant(inertia)) / inertia - 1.0).abs() < 1e-12);
        assert!((housing.leaf_thickness(inertia) / height - 1.0).abs() < 1e-12);
    }
}
