//! The block-tridiagonal core against dense linear algebra.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use proptest::prelude::*;

use super::symmetric::{Batch, Column, Plan};
use super::table::Table;
use super::{BlockTri, BlockTriError, Element, FrfSystem, Layout, Levels, Response, Sweep};

type C64 = Complex<f64>;

fn chain_pairs(bodies: usize, dofs: usize) -> Vec<(usize, usize)> {
    let n = bodies * dofs;
    (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).filter(|&(i, j)| j / dofs - i / dofs <= 1).collect()
}

#[test]
fn chain_of_bodies_has_one_level_per_body() {
    let levels = Levels::new(132, &chain_pairs(22, 6)).unwrap();
    assert_eq!(levels.count(), 22);
    for body in 0..22 {
        assert_eq!(levels.dofs(body), (6 * body..6 * body + 6).collect::<Vec<_>>());
        assert_eq!(levels.linked(body), body < 21);
    }
}

#[test]
fn numbering_does_not_matter() {
    // Body b of the chain carries the dofs of body 7 b mod 22, interleaved axis by axis.
    let name = |i: usize| (i % 6) * 22 + (7 * (i / 6)) % 22;
    let pairs: Vec<_> = chain_pairs(22, 6).into_iter().map(|(i, j)| (name(i), name(j))).collect();
    let levels = Levels::new(132, &pairs).unwrap();
    assert_eq!((levels.count(), (0..22).map(|l| levels.size(l)).max()), (22, Some(6)));
}

#[test]
fn uncoupled_axes_are_scalar_tridiagonals() {
    let pairs: Vec<_> = (0..126).map(|i| (i, i + 6)).collect();
    let levels = Levels::new(132, &pairs).unwrap();
    assert_eq!(levels.count(), 132);
    assert_eq!((0..132).filter(|&l| !levels.linked(l)).count(), 6);
    assert_eq!(levels.dofs(1), [6]);
}

#[test]
fn wrong_dofs_and_entries_are_named() {
    assert_eq!(Levels::new(3, &[(0, 3)]), Err(BlockTriError::NoSuchDof { dof: 3, n: 3 }));
    let layout = Layout::new(Levels::new(4, &[(0, 1), (1, 2), (2, 3)]).unwrap());
    assert_eq!(layout.slot(0, 3), Err(BlockTriError::OutsidePattern { row: 0, column: 3 }));
    let mut matrix = BlockTri::<f64>::new(Arc::new(layout));
    assert_eq!(matrix.add(1, 9, 1.0), Err(BlockTriError::NoSuchDof { dof: 9, n: 4 }));
    assert_eq!(matrix.solve(&mut [0.0; 4]), Err(BlockTriError::NotFactored));
    for i in 0..4 {
        matrix.add(i, i, 1.0).unwrap();
    }
    matrix.factor().unwrap();
    assert_eq!(matrix.solve(&mut [0.0; 6]), Err(BlockTriError::Length { len: 6, n: 4 }));
    matrix.add(2, 2, f64::NAN).unwrap();
    assert_eq!(matrix.factor(), Err(BlockTriError::NotFinite { dof: 2 }));
}

#[test]
fn a_free_body_is_singular_and_named() {
    // A free-free chain of three masses beside a held one: dofs 0-2 move together.
    let layout = Arc::new(Layout::new(Levels::new(4, &[(0, 1), (1, 2)]).unwrap()));
    let mut matrix = BlockTri::<f64>::new(layout);
    for (i, j, v) in [(0, 0, 2.0), (0, 1, -2.0), (1, 0, -2.0), (1, 1, 5.0), (1, 2, -3.0), (2, 1, -3.0), (2, 2, 3.0), (3, 3, 1.0)] {
        matrix.add(i, j, v).unwrap();
    }
    assert!(matches!(matrix.factor(), Err(BlockTriError::Singular { dof: 2, .. })));
}

#[test]
fn zero_diagonal_blocks_are_solved_by_exchange_across_levels() {
    // [0 1; 1 0] cut into two levels of one: no pivoting inside a diagonal block can solve it.
    let layout = Arc::new(Layout::new(Levels::new(3, &[(0, 1), (1, 2)]).unwrap()));
    assert_eq!(layout.levels().count(), 3);
    let mut matrix = BlockTri::<f64>::new(layout);
    for (i, j, v) in [(0, 1, 2.0), (1, 0, 4.0), (1, 2, 1.0), (2, 1, 3.0), (2, 2, 5.0)] {
        matrix.add(i, j, v).unwrap();
    }
    matrix.factor().unwrap();
    // x = (1, 2, 3): rows give 4, 7, 21.
    let mut x = [4.0, 7.0, 21.0];
    matrix.solve(&mut x).unwrap();
    for (i, &v) in x.iter().enumerate() {
        approx::assert_relative_eq!(v, i as f64 + 1.0, max_relative = 1e-15);
    }
}

/// A tree of bodies: parent of each body, dofs of each body.
fn tree() -> impl Strategy<Value = (Vec<usize>, Vec<usize>)> {
    (1usize..14).prop_flat_map(|bodies| {
        let parents = (0..bodies).map(|b| if b < 3 { (0..b.max(1)).boxed() } else { (b - 3..b).boxed() }).collect::<Vec<_>>();
        (parents, prop::collection::vec(1usize..5, bodies))
    })
}

fn tree_pairs(parents: &[usize], sizes: &[usize]) -> (usize, Vec<(usize, usize)>) {
    let start: Vec<usize> = sizes.iter().scan(0, |s, &n| Some(std::mem::replace(s, *s + n))).collect();
    let dofs = |b: usize| start[b]..start[b] + sizes[b];
    let mut pairs = Vec::new();
    for (b, &p) in parents.iter().enumerate() {
        for i in dofs(b) {
            pairs.extend(dofs(b).map(|j| (i, j)));
            pairs.extend(dofs(p).map(|j| (i, j)));
        }
    }
    (sizes.iter().sum(), pairs)
}

fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(1);
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// max_i |A x - b|_i / (max_j |a_ij| |x|_inf + |b_i|): the backward error that row-scaled pivoting bounds, free of the rows' units.
fn backward_error<T: nalgebra::ComplexField<RealField = f64>>(a: &DMatrix<T>, x: &DVector<T>, b: &DVector<T>) -> f64 {
    let r = a * x - b;
    let longest = x.iter().map(|v| v.clone().modulus()).fold(0.0, f64::max);
    let scale = |i: usize| a.row(i).iter().map(|v| v.clone().modulus()).fold(0.0, f64::max) * longest + b[i].clone().modulus();
    (0..r.len()).map(|i| r[i].clone().modulus() / scale(i)).fold(0.0, f64::max)
}

fn assert_solves<T: super::Entry + nalgebra::ComplexField<RealField = f64>>(
    n: usize,
    pairs: &[(usize, usize)],
    dense: &DMatrix<T>,
    rhs: &DMatrix<T>,
) -> Result<(), TestCaseError> {
    let mut matrix = BlockTri::<T>::new(Arc::new(Layout::new(Levels::new(n, pairs).unwrap())));
    for round in 0..2 {
        matrix.clear();
        for i in 0..n {
            for j in 0..n {
                if dense[(i, j)] != <T as super::Entry>::ZERO {
                    matrix.add(i, j, dense[(i, j)]).unwrap();
                }
            }
        }
        let weakest = matrix.factor();
        prop_assert!(weakest.is_ok(), "round {round}: {weakest:?}");
        let mut x = rhs.clone();
        matrix.solve(x.as_mut_slice()).unwrap();
        let reference = dense.clone().lu().solve(rhs).unwrap();
        for c in 0..rhs.ncols() {
            let (b, own, theirs) = (rhs.column(c).into_owned(), x.column(c).into_owned(), reference.column(c).into_owned());
            let (mine, peer) = (backward_error(dense, &own, &b), backward_error(dense, &theirs, &b));
            prop_assert!(mine < 1e-13, "backward error {mine:e}, dense LU {peer:e}");
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn unsymmetric_real_systems_solve_as_dense((parents, sizes) in tree(), seed in any::<u64>(), columns in 1usize..7, diagonal in prop::sample::select(vec![0.0, 1e-9, 1.0, 10.0])) {
        let (n, pairs) = tree_pairs(&parents, &sizes);
        let mut next = noise(seed);
        let mut dense = DMatrix::zeros(n, n);
        for &(i, j) in &pairs {
            // Rows over eight decades, as newtons and newton metres are.
            let unit = 10f64.powi((i % 5) as i32 * 2);
            dense[(i, j)] = next() * unit;
            dense[(j, i)] = next() * 10f64.powi((j % 5) as i32 * 2);
        }
        for i in 0..n {
            dense[(i, i)] = diagonal * 10f64.powi((i % 5) as i32 * 2) * next();
        }
        let rhs = DMatrix::from_fn(n, columns, |_, _| next());
        prop_assume!(dense.clone().lu().is_invertible() && dense.clone().lu().solve(&rhs).is_some_and(|x| x.iter().all(|v| v.abs() < 1e12)));
        assert_solves(n, &pairs, &dense, &rhs)?;
    }

    #[test]
    fn saddle_point_systems_solve_as_dense(bodies in 2usize..9, seed in any::<u64>()) {
        // Bodies of three dofs joined by rigid links with one multiplier each: zeros on the diagonal, n levels of mixed size.
        let mut next = noise(seed);
        let n = 4 * bodies;
        let mut dense = DMatrix::<f64>::zeros(n, n);
        for b in 0..bodies {
            let row = DVector::from_fn(3, |_, _| next());
            for i in 0..3 {
                for j in 0..3 {
                    dense[(4 * b + i, 4 * b + j)] = row[i] * row[j] + if i == j { 1.0 } else { 0.0 };
                }
                let g = next();
                dense[(4 * b + i, 4 * b + 3)] = g;
                dense[(4 * b + 3, 4 * b + i)] = g;
                if b + 1 < bodies {
                    let g = next();
                    dense[(4 * b + 4 + i, 4 * b + 3)] = g;
                    dense[(4 * b + 3, 4 * b + 4 + i)] = g;
                }
            }
        }
        let pairs: Vec<_> = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|&(i, j)| dense[(i, j)] != 0.0).collect();
        let rhs = DMatrix::from_fn(n, 2, |_, _| next());
        assert_solves(n, &pairs, &dense, &rhs)?;
    }

    #[test]
    fn complex_systems_near_singular_solve_as_dense((parents, sizes) in tree(), seed in any::<u64>(), loss in prop::sample::select(vec![0.0, 1e-10, 1e-3, 0.5])) {
        let (n, pairs) = tree_pairs(&parents, &sizes);
        let mut next = noise(seed);
        let mut stiffness = DMatrix::<f64>::zeros(n, n);
        for &(i, j) in &pairs {
            let v = next();
            stiffness[(i, j)] = v;
            stiffness[(j, i)] = v;
        }
        // A shift within 1e-9 of an eigenvalue above several others: indefinite and nearly singular.
        let eigen = stiffness.clone().symmetric_eigenvalues();
        let shift = eigen[n / 2] + 1e-9;
        let dense = DMatrix::from_fn(n, n, |i, j| {
            C64::new(stiffness[(i, j)] - if i == j { shift } else { 0.0 }, loss * stiffness[(i, j)])
        });
        let rhs = DMatrix::from_fn(n, 3, |_, _| C64::new(next(), next()));
        prop_assume!(dense.clone().lu().solve(&rhs).is_some());
        assert_solves(n, &pairs, &dense, &rhs)?;
    }
}

/// A tree of masses with scalar elements between dofs of linked bodies; returns what [`FrfSystem::new`] takes.
struct Rig {
    n: usize,
    stiffness: Vec<(usize, usize, f64)>,
    mass: Vec<(usize, usize, f64)>,
    elements: Vec<Element>,
}

const GROUPS: usize = 3;

fn rig(parents: &[usize], sizes: &[usize], seed: u64) -> Rig {
    let (n, pairs) = tree_pairs(parents, sizes);
    let mut next = noise(seed);
    let start: Vec<usize> = sizes.iter().scan(0, |s, &n| Some(std::mem::replace(s, *s + n))).collect();
    let (mut stiffness, mut mass, mut elements) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..n {
        mass.push((i, i, 1.0 + 0.5 * next()));
        stiffness.push((i, i, 0.3));
    }
    for &(i, j) in pairs.iter().filter(|(i, j)| i != j).step_by(3) {
        let v = 0.05 * next();
        stiffness.extend([(i, j, v), (j, i, v)]);
    }
    for (b, &p) in parents.iter().enumerate() {
        for i in 0..sizes[b].max(sizes[p]) {
            let mut row: Vec<_> = (0..sizes[b]).map(|k| (start[b] + k, if k == i { 1.0 } else { 0.3 * next() })).collect();
            if p != b {
                row.extend((0..sizes[p]).map(|k| (start[p] + k, if k == i { -1.0 } else { 0.3 * next() })));
            }
            elements.push(Element { group: (i + b) % GROUPS, row });
        }
    }
    Rig { n, stiffness, mass, elements }
}

/// Maxwell branch, loss factor and dashpot: three coefficients that depend on frequency.
fn coefficients(loss: f64) -> impl Fn(f64, &mut [C64]) + Sync {
    move |w, z| {
        let all = [
            C64::new(2.0, 0.0) + loss * C64::new(0.0, 3.0 * w) / C64::new(1.0, 0.4 * w),
            C64::new(1.0, loss * 0.2),
            C64::new(0.7, loss * 0.05 * w),
        ];
        // A rig may be too small to use all the groups.
        z.iter_mut().zip(all).for_each(|(to, v)| *to = v);
    }
}

fn dense_stiffness(rig: &Rig, w: f64, z: &[C64]) -> DMatrix<C64> {
    let mut dense = DMatrix::<C64>::zeros(rig.n, rig.n);
    rig.stiffness.iter().for_each(|&(i, j, v)| dense[(i, j)] += v);
    rig.mass.iter().for_each(|&(i, j, v)| dense[(i, j)] -= w * w * v);
    for element in &rig.elements {
        for &(i, a) in &element.row {
            element.row.iter().for_each(|&(j, b)| dense[(i, j)] += z[element.group] * a * b);
        }
    }
    dense
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn sweep_agrees_with_dense((parents, sizes) in tree(), seed in any::<u64>(), lines in 1usize..23, loss in prop::sample::select(vec![0.0, 1e-6, 0.1, 1.0])) {
        let rig = rig(&parents, &sizes, seed);
        let system = FrfSystem::new(rig.n, &rig.stiffness, &rig.mass, &rig.elements).unwrap();
        let omega: Vec<f64> = (0..lines).map(|l| 0.01 + 0.2 * l as f64).collect();
        let all: Vec<usize> = (0..rig.n).collect();
        let inputs = [seed as usize % rig.n, rig.n - 1];
        let request = Sweep { omega: &omega, inputs: &inputs, outputs: &all, sensitivities: false };
        let mut response = Response::default();
        system.sweep(&request, coefficients(loss), &mut response).unwrap();
        let mut z = [C64::default(); GROUPS];
        for (line, &w) in omega.iter().enumerate() {
            coefficients(loss)(w, &mut z);
            let dense = dense_stiffness(&rig, w, &z);
            for (input, &dof) in inputs.iter().enumerate() {
                let at = (line * inputs.len() + input) * rig.n;
                let x = DVector::from_column_slice(&response.h[at..at + rig.n]);
                let load = DVector::from_fn(rig.n, |i, _| C64::from(f64::from(u8::from(i == dof))));
                // Normwise: the check of the unpivoted factors bounds the error against the diagonal scales.
                let r = (&dense * &x - &load).norm() / (dense.norm() * x.norm() + 1.0);
                prop_assert!(r < 1e-12, "line {line}: residual {r:e}");
            }
        }
        // A few responses go without back-substitution; the same numbers must come out.
        let few = [rig.n / 2, 0];
        let mut condensed = Response::default();
        system.sweep(&Sweep { outputs: &few, ..request }, coefficients(loss), &mut condensed).unwrap();
        for line in 0..lines {
            for (input, _) in inputs.iter().enumerate() {
                let whole = &response.h[(line * 2 + input) * rig.n..][..rig.n];
                let norm = whole.iter().map(|h| h.norm()).fold(1.0, f64::max);
                for (output, &dof) in few.iter().enumerate() {
                    let h = condensed.h[(line * 2 + input) * 2 + output];
                    prop_assert!((h - whole[dof]).norm() < 1e-11 * norm * norm, "line {line}: {h} against {}", whole[dof]);
                }
            }
        }
    }

    #[test]
    fn sensitivities_agree_with_dense_products((parents, sizes) in tree(), seed in any::<u64>()) {
        let rig = rig(&parents, &sizes, seed);
        let system = FrfSystem::new(rig.n, &rig.stiffness, &rig.mass, &rig.elements).unwrap();
        let omega = [0.3, 0.9, 1.7, 2.2, 4.0];
        let (inputs, outputs) = ([rig.n - 1], [0, rig.n / 2, rig.n - 1]);
        let mut response = Response::default();
        system.sweep(&Sweep { omega: &omega, inputs: &inputs, outputs: &outputs, sensitivities: true }, coefficients(0.3), &mut response).unwrap();
        let groups = system.groups();
        let mut z = [C64::default(); GROUPS];
        for (line, &w) in omega.iter().enumerate() {
            coefficients(0.3)(w, &mut z);
            let h = dense_stiffness(&rig, w, &z).try_inverse().unwrap();
            for (o, &output) in outputs.iter().enumerate() {
                let at = line * outputs.len() + o;
                prop_assert!((response.h[at] - h[(output, inputs[0])]).norm() < 1e-11 * h.norm());
                for group in 0..groups {
                    // d(Z^-1) = -Z^-1 dZ Z^-1
                    let mut pattern = DMatrix::<C64>::zeros(rig.n, rig.n);
                    for e in rig.elements.iter().filter(|e| e.group == group) {
                        for &(i, a) in &e.row {
                            e.row.iter().for_each(|&(j, b)| pattern[(i, j)] += C64::from(a * b));
                        }
                    }
                    let exact = -(&h * &pattern * &h)[(output, inputs[0])];
                    prop_assert!((response.dh[at * groups + group] - exact).norm() < 1e-11 * h.norm() * h.norm() * pattern.norm());
                }
            }
        }
    }

    #[test]
    fn registers_and_plain_arrays_agree((parents, sizes) in tree(), seed in any::<u64>()) {
        let rig = rig(&parents, &sizes, seed);
        let (layout, table) = Table::new(rig.n, &rig.stiffness, &rig.mass, &rig.elements).unwrap();
        let levels = layout.levels();
        let mut columns = [0, rig.n - 1, rig.n / 2].map(|dof| Column::new(levels, dof));
        columns.sort_by_key(|c| c.position);
        let mut plan = Plan { levels, table: &table, columns: &columns, pairs: &[(0, 1), (0, 2)], keep: true, last_wanted: 0 };
        let mut dispatched = Batch::new(levels, &table);
        let mut z = vec![C64::default(); table.groups];
        for lane in 0..4 {
            let w = 0.4 + lane as f64;
            coefficients(0.2)(w, &mut z);
            dispatched.inertia.0[lane] = -w * w;
            for (to, z) in dispatched.coefficients.iter_mut().zip(&z) {
                (to.re.0[lane], to.im.0[lane]) = (z.re, z.im);
            }
        }
        let mut plain = dispatched.clone();
        Batch::solve(std::slice::from_mut(&mut dispatched), &plan);
        Batch::solve_with::<super::lanes::F4>(std::slice::from_mut(&mut plain), &plan);
        prop_assert_eq!(dispatched.suspect, plain.suspect);
        dispatched.differentiate(&plan);
        plain.differentiate_with::<super::lanes::F4>(&plan);
        let kept = (dispatched.x.clone(), plain.x.clone());
        plan.keep = false;
        Batch::solve(std::slice::from_mut(&mut dispatched), &plan);
        Batch::solve_with::<super::lanes::F4>(std::slice::from_mut(&mut plain), &plan);
        prop_assert_eq!(dispatched.suspect, plain.suspect);
        let all = kept.0.iter().zip(&kept.1).chain(dispatched.h.iter().zip(&plain.h));
        for (a, b) in all.chain(dispatched.sensitivity.iter().zip(&plain.sensitivity)) {
            for lane in 0..4 {
                let (a, b) = (C64::new(a.re.0[lane], a.im.0[lane]), C64::new(b.re.0[lane], b.im.0[lane]));
                prop_assert!((a - b).norm() <= 1e-9 * (1.0 + a.norm()), "{a} {b}");
            }
        }
    }
}

/// Three unit masses in a row, four springs of group 0 between ground, masses and ground; one of group 1 from the last to the ground.
fn three_masses() -> FrfSystem {
    let mass: Vec<_> = (0..3).map(|i| (i, i, 1.0)).collect();
    let elements: Vec<_> = (0..4usize)
        .map(|e| Element { group: 0, row: [(e, 1.0), (e.wrapping_sub(1), -1.0)].into_iter().filter(|&(d, _)| d < 3).collect() })
        .collect();
    FrfSystem::new(3, &[], &mass, &[elements, vec![Element { group: 1, row: vec![(2, 1.0)] }]].concat()).unwrap()
}

#[test]
fn a_line_at_the_resonance_of_a_part_is_solved_with_pivoting() {
    // w^2 = 2 - 1e-9: the first mass alone nearly resonates, its pivot is 1e-9 of its scale, while the three are regular (a spring
    // of 1 from the first to the ground added to the third). Unpivoted factors would keep seven digits.
    let system = three_masses();
    let omega = [(2.0f64 - 1e-9).sqrt(), 0.9];
    let d = omega.map(|w| 2.0 - w * w);
    let request = Sweep { omega: &omega, inputs: &[2], outputs: &[0, 1, 2], sensitivities: false };
    let mut response = Response::default();
    system.sweep(&request, |_, z| z.copy_from_slice(&[C64::from(1.0), C64::from(0.5)]), &mut response).unwrap();
    for (line, d) in d.into_iter().enumerate() {
        let dense = DMatrix::from_row_slice(3, 3, &[d, -1.0, 0.0, -1.0, d, -1.0, 0.0, -1.0, d + 0.5]);
        let exact = dense.lu().solve(&DVector::from_column_slice(&[0.0, 0.0, 1.0])).unwrap();
        for (h, x) in response.h[3 * line..].iter().zip(&exact) {
            assert!((h - C64::from(*x)).norm() < 1e-13 * exact.norm(), "line {line}: {h} against {x}");
        }
    }
    // And it is the check of the unpivoted factors that sends exactly this line there.
    let (levels, table) = (system.layout().levels(), system.table());
    let plan = Plan { levels, table, columns: &[Column::new(levels, 2)], pairs: &[], keep: false, last_wanted: 0 };
    let mut batch = Batch::new(levels, table);
    for (lane, w) in [omega[1], omega[0], 2f64.sqrt(), 0.1].into_iter().enumerate() {
        batch.inertia.0[lane] = -w * w;
        batch.coefficients[0].re.0[lane] = 1.0;
        batch.coefficients[1].re.0[lane] = 0.5;
    }
    Batch::solve(std::slice::from_mut(&mut batch), &plan);
    assert_eq!(batch.suspect, [false, true, true, false]);
}

#[test]
fn an_undamped_resonance_and_bad_numbers_are_errors() {
    let system = three_masses();
    let mut response = Response::default();
    let free = FrfSystem::new(2, &[], &[(0, 0, 1.0), (1, 1, 1.0)], &[Element { group: 0, row: vec![(0, 1.0), (1, -1.0)] }]).unwrap();
    let at = |omega| Sweep { omega, inputs: &[0], outputs: &[1], sensitivities: false };
    let rigid = free.sweep(&at(&[1.0, 0.0]), |_, z| z[0] = C64::from(1.0), &mut response);
    assert!(matches!(rigid, Err(BlockTriError::SingularLine { dof: 1, frequency: 0.0, .. })), "{rigid:?}");
    let nan = system.sweep(&at(&[1.0]), |_, z| z.copy_from_slice(&[C64::from(1.0), C64::new(f64::NAN, 0.0)]), &mut response);
    assert!(matches!(nan, Err(BlockTriError::CoefficientNotFinite { group: 1, .. })));
    let line = system.sweep(&at(&[1.0, f64::INFINITY]), |_, z| z[0] = C64::from(1.0), &mut response);
    assert_eq!(line, Err(BlockTriError::FrequencyNotFinite { line: 1 }));
    let dof = system.sweep(&Sweep { inputs: &[3], ..at(&[1.0]) }, |_, z| z[0] = C64::from(1.0), &mut response);
    assert_eq!(dof, Err(BlockTriError::NoSuchDof { dof: 3, n: 3 }));
    let skew = FrfSystem::new(2, &[(0, 1, 1.0), (1, 0, 2.0)], &[], &[]).err();
    assert_eq!(skew, Some(BlockTriError::Unsymmetric { matrix: "stiffness", row: 1, column: 0, value: 2.0, mirrored: 1.0 }));
}

#[test]
fn components_that_end_do_not_leak_into_the_next() {
    // Two uncoupled pairs of unlike size, and a single dof between them.
    let elements = [
        Element { group: 0, row: vec![(0, 1.0), (3, -1.0)] },
        Element { group: 0, row: vec![(1, 1.0), (4, -1.0)] },
        Element { group: 0, row: vec![(1, 1.0), (5, 1.0), (4, 1.0)] },
    ];
    let stiffness: Vec<_> = (0..6).map(|i| (i, i, 1.0 + i as f64)).collect();
    let system = FrfSystem::new(6, &stiffness, &[], &elements).unwrap();
    let mut response = Response::default();
    let all = [0, 1, 2, 3, 4, 5];
    system
        .sweep(&Sweep { omega: &[0.0], inputs: &all, outputs: &all, sensitivities: false }, |_, z| z[0] = C64::from(2.0), &mut response)
        .unwrap();
    let rig = Rig { n: 6, stiffness, mass: vec![], elements: elements.to_vec() };
    let inverse = dense_stiffness(&rig, 0.0, &[C64::from(2.0)]).try_inverse().unwrap();
    for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
        assert!((response.h[6 * i + j] - inverse[(i, j)]).norm() < 1e-14);
    }
}
