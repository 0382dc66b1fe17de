//! State updates per second of `diffsol` (equations in DiffSL, compiled by Cranelift) on the plant of `benches/simulation.rs`, in
//! one thread. `benches/compare_simulation.sh` runs it beside the others.
//!
//! `diffsol` gets the sine as a function of time, so that its steps may be longer than a sample.

use diffsol::{
    CraneliftJitModule, DenseMatrix, NalgebraMat, OdeBuilder, OdeSolverMethod,
    SensitivitiesOdeSolverMethod,
};
use std::hint::black_box;
use std::time::Instant;

const SAMPLES: usize = 20_000;
const SAMPLE_TIME: f64 = 1e-3;
const STATES: usize = 5;
const REPETITIONS: usize = 7;

const EQUATIONS: &str = "
in = [R, L, k, J1, J2, d1, d2, c, c3, d]
R { 1.5 } L { 0.03 } k { 0.06 } J1 { 0.0003 } J2 { 0.0008 } d1 { 0.0001 } d2 { 0.0005 } c { 0.8 } c3 { 2 } d { 0.0002 }
u_i { i = 0, w1 = 0, w2 = 0, p1 = 0, p2 = 0 }
e { p1 - p2 }
tau { c*e + c3*e*e*e + d*(w1 - w2) }
F_i {
  (6*sin(3*t) - R*i - k*w1)/L,
  (k*i - d1*w1 - tau)/J1,
  (tau - d2*w2)/J2,
  w1,
  w2,
}
out_i { w1, w2 }
";

/// Values of the parameters, in the order of the plant.
const VALUES: [f64; 10] = [1.5, 0.03, 0.06, 3e-4, 8e-4, 1e-4, 5e-4, 0.8, 2.0, 2e-4];

/// State updates per second at the fastest of some runs.
fn rate(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..REPETITIONS {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed().as_secs_f64());
    }
    (STATES * SAMPLES) as f64 / best
}

fn main() {
    let times: Vec<f64> = (0..SAMPLES).map(|k| k as f64 * SAMPLE_TIME).collect();
    let problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .p(VALUES)
        .rtol(1e-6)
        .atol([1e-9])
        .sens_rtol(1e-6)
        .sens_atol([1e-9])
        .build_from_diffsl::<CraneliftJitModule>(EQUATIONS)
        .expect("the equations compile");
    let mut last = 0.0;
    let alone = rate(|| {
        let mut solver = problem.tsit45().expect("a solver");
        let (answer, _) = solver.solve_dense(&times).expect("a solution");
        last = answer.get_index(1, SAMPLES - 1);
    });
    println!("diffsol, tsit45, states: {alone:.3e} state updates a second (last y2 {last:.8})");
    let with = rate(|| {
        let mut solver = problem.tsit45_sens().expect("a solver");
        let answer = solver.solve_dense_sensitivities(&times);
        black_box(answer.expect("a solution"));
    });
    println!("diffsol, tsit45, states and ten sensitivities: {with:.3e} state updates a second");
}
