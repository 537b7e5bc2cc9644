//! Criterion benches of the linear-algebra core: FRF, implicit march step, factorisation and solution, ordering.
//!
//!     cargo bench -p misfit-benches
//!
//! Throughput is per body, so that linear cost shows as equal rates from 22 to 2200 bodies.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use misfit::engine::blocktri::{BlockTri, Layout, Levels, Response, Sweep};
use misfit_benches::chain::{Chain, coefficients, lines};
use misfit_benches::march::March;
use num_complex::Complex;

const BODIES: [usize; 3] = [22, 220, 2200];

/// 100 lines x 4 outputs, without and with the sensitivities to the six groups.
fn frf(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frf_100_lines");
    for bodies in BODIES {
        let (chain, omega) = (Chain::new(bodies), lines(100));
        let system = chain.system().expect("the chain is well posed");
        let (inputs, outputs) = ([chain.input()], chain.outputs());
        let mut response = Response::default();
        group.throughput(Throughput::Elements(bodies as u64));
        for sensitivities in [false, true] {
            let sweep = Sweep { omega: &omega, inputs: &inputs, outputs: &outputs, sensitivities };
            let name = if sensitivities { "with_sensitivities" } else { "response" };
            group.bench_function(BenchmarkId::new(name, bodies), |b| {
                b.iter(|| system.sweep(&sweep, coefficients, &mut response).expect("damped"));
            });
        }
    }
    group.finish();
}

/// One step of the implicit march: tangent, factorisation, solution.
fn march(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("march_step");
    for bodies in BODIES {
        let mut march = March::new(bodies, 1e-5).expect("the chain is well posed");
        group.throughput(Throughput::Elements(bodies as u64));
        group.bench_function(BenchmarkId::from_parameter(bodies), |b| b.iter(|| march.step().expect("regular")));
    }
    group.finish();
}

/// The general pivoting factorisation of a complex matrix, and its solution for four right-hand sides.
fn factor_solve(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("complex_pivoting");
    let chain = Chain::new(22);
    let mut z = [Complex::new(0.0, 0.0); 6];
    coefficients(2000.0, &mut z);
    let mut entries = Vec::new();
    for (at, row) in chain.rows.iter().enumerate() {
        for &(i, a) in row {
            entries.extend(row.iter().map(|&(j, b)| (i, j, z[at % 6] * a * b)));
        }
    }
    entries.extend(chain.mass.iter().map(|&(i, j, m)| (i, j, Complex::new(-4e6 * m, 0.0))));
    let pairs: Vec<_> = entries.iter().map(|&(i, j, _)| (i, j)).collect();
    group.bench_function("ordering_22", |b| b.iter(|| Levels::new(chain.n(), black_box(&pairs))));
    let layout = Arc::new(Layout::new(Levels::new(chain.n(), &pairs).expect("dofs in range")));
    let slots: Vec<_> = entries.iter().map(|&(i, j, v)| (layout.slot(i, j).expect("in the pattern"), v)).collect();
    let mut matrix = BlockTri::new(layout);
    group.bench_function("assemble_factor_22", |b| {
        b.iter(|| {
            matrix.clear();
            slots.iter().for_each(|&(slot, v)| matrix.add_at(slot, v));
            matrix.factor().expect("regular")
        });
    });
    let mut rhs = vec![Complex::new(1.0, 0.0); 4 * chain.n()];
    group.bench_function("solve_4_columns_22", |b| {
        b.iter(|| {
            rhs.fill(Complex::new(1.0, 0.0));
            matrix.solve(&mut rhs).expect("factored");
        });
    });
    group.finish();
}

criterion_group!(benches, frf, march, factor_solve);
criterion_main!(benches);
