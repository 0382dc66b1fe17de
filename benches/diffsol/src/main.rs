//! State updates per second of diffsol on the plant of `benches/simulation.rs`, with its ten sensitivities.
//!
//! ```text
//! cargo run --release --manifest-path benches/diffsol/Cargo.toml [-- SAMPLES]
//! ```
//!
//! Plant, input, tolerances and format of the output are those of `benches/simulation_scipy.py`. Without sensitivities the
//! model is DiffSL text, compiled by diffsl's JIT with cranelift.
//!
//! Cranelift code has no derivatives with respect to inputs (`rhs_sgrad` and others are compiled with LLVM and Enzyme only;
//! without them `DiffSl::sens_mul_inplace` panics). So sensitivities are computed in two other ways, and the printed line says in
//! which: by diffsol's own sensitivity equations, for a model of closures with derivatives written by hand; and by the JIT for 55
//! states, where the differential equations of the derivatives stand in the DiffSL text.
//!
//! The input is a smooth function of time, so that steps span several samples. innovant begins a step at each sample; what that
//! alone costs is shown by the lines with a stop at each sample.

use cpu_time::ProcessTime;
use diffsol::error::DiffsolError;
use diffsol::{
    CraneliftJitModule, DenseMatrix, MatrixCommon, NalgebraContext, NalgebraLU, NalgebraMat,
    NalgebraVec, OdeBuilder, OdeEquations, OdeEquationsImplicitSens, OdeSolverMethod,
    OdeSolverProblem, OdeSolverStopReason, SensitivitiesOdeSolverMethod,
};
use std::time::Instant;

type M = NalgebraMat<f64>;
type V = NalgebraVec<f64>;
type Lu = NalgebraLU<f64>;
type Result<T> = std::result::Result<T, DiffsolError>;

const STATES: usize = 5;
const PARAMETERS: [(&str, f64); 10] = [
    ("R", 1.5),
    ("L", 0.03),
    ("k", 0.06),
    ("J1", 3e-4),
    ("J2", 8e-4),
    ("d1", 1e-4),
    ("d2", 5e-4),
    ("c", 0.8),
    ("c3", 2.0),
    ("d", 2e-4),
];
const SAMPLE_TIME: f64 = 1e-3;
const RTOL: f64 = 1e-6;
const ATOL: f64 = 1e-9;

fn main() -> Result<()> {
    let samples = match std::env::args().nth(1) {
        Some(text) => text.parse().expect("SAMPLES is a number"),
        None => 20_000,
    };
    let times: Vec<f64> = (0..samples).map(|k| SAMPLE_TIME * k as f64).collect();
    println!("diffsol {}, {samples} samples", version_of_diffsol());

    let name = "states";
    let start = Instant::now();
    let problem = builder().build_from_diffsl::<CraneliftJitModule>(&text_of_states())?;
    println!("{name}: JIT in {:.3} s", start.elapsed().as_secs_f64());
    measure(name, "tsit45", samples, || dense(problem.tsit45()?, &times))?;
    measure(name, "tsit45, a stop at each sample", samples, || {
        dense_with_stops(problem.tsit45()?, &times)
    })?;
    measure(name, "bdf", samples, || dense(problem.bdf::<Lu>()?, &times))?;
    measure(name, "tr_bdf2", samples, || {
        dense(problem.tr_bdf2::<Lu>()?, &times)
    })?;
    measure(name, "esdirk34", samples, || {
        dense(problem.esdirk34::<Lu>()?, &times)
    })?;

    let name = "states and ten sensitivities, no JIT but closures";
    let problem = with_sensitivities()?;
    measure(name, "tsit45", samples, || {
        sensitivities(problem.tsit45_sens()?, &times)
    })?;
    measure(name, "bdf", samples, || {
        sensitivities(problem.bdf_sens::<Lu>()?, &times)
    })?;
    measure(name, "tr_bdf2", samples, || {
        sensitivities(problem.tr_bdf2_sens::<Lu>()?, &times)
    })?;
    measure(name, "esdirk34", samples, || {
        sensitivities(problem.esdirk34_sens::<Lu>()?, &times)
    })?;

    let name = "states and ten sensitivities, JIT of 55 states";
    let start = Instant::now();
    let problem =
        builder().build_from_diffsl::<CraneliftJitModule>(&text_of_states_and_sensitivities())?;
    println!("{name}: JIT in {:.3} s", start.elapsed().as_secs_f64());
    measure(name, "tsit45", samples, || dense(problem.tsit45()?, &times))?;
    measure(name, "tsit45, a stop at each sample", samples, || {
        dense_with_stops(problem.tsit45()?, &times)
    })?;
    measure(name, "bdf", samples, || dense(problem.bdf::<Lu>()?, &times))
}

/// `Cargo.lock` says which one was compiled.
fn version_of_diffsol() -> &'static str {
    include_str!("../Cargo.lock")
        .split_once("name = \"diffsol\"\nversion = \"")
        .and_then(|(_, rest)| rest.split('"').next())
        .expect("diffsol is a dependency")
}

fn builder() -> OdeBuilder<M> {
    OdeBuilder::<M>::new()
        .p(PARAMETERS.map(|(_, value)| value))
        .rtol(RTOL)
        .atol([ATOL])
}

/// Best of three, with what is measured in scipy's run: CPU time of the process, from a problem that is ready to the last sample.
fn measure(
    name: &str,
    method: &str,
    samples: usize,
    run: impl Fn() -> Result<Vec<f64>>,
) -> Result<()> {
    let mut best = f64::INFINITY;
    let mut end = Vec::new();
    for _ in 0..3 {
        let start = ProcessTime::now();
        end = run()?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    let rate = (STATES * samples) as f64 / best;
    println!("{name}, {method}: {best:.4} s, {rate:.2e} state updates a second");
    let (states, derivatives) = end.split_at(STATES);
    println!("    at the end: {states:.6?}");
    if !derivatives.is_empty() {
        let of_w2: Vec<f64> = derivatives.chunks(STATES).map(|by| by[2]).collect();
        println!("    derivatives of w2: {of_w2:.5?}");
    }
    Ok(())
}

/// What the model has at the last of the times.
fn dense<'a, E>(mut solver: impl OdeSolverMethod<'a, E>, times: &[f64]) -> Result<Vec<f64>>
where
    E: OdeEquations<M = M, V = V, T = f64> + 'a,
{
    let (states, _) = solver.solve_dense(times)?;
    Ok(last(&states))
}

/// The same with a step that ends at each of the times, as it must where an input jumps there. The input stays smooth.
fn dense_with_stops<'a, E>(
    mut solver: impl OdeSolverMethod<'a, E>,
    times: &[f64],
) -> Result<Vec<f64>>
where
    E: OdeEquations<M = M, V = V, T = f64> + 'a,
{
    let mut samples = vec![solver.state().y.batch_as_slice(0).to_vec()];
    for &time in &times[1..] {
        solver.set_stop_time(time)?;
        while !matches!(solver.step()?, OdeSolverStopReason::TstopReached) {}
        samples.push(solver.state().y.batch_as_slice(0).to_vec());
    }
    Ok(samples.pop().expect("at least the first"))
}

/// States at the last of the times, then their derivatives with respect to the first parameter, the second and so on.
fn sensitivities<'a, E>(
    mut solver: impl SensitivitiesOdeSolverMethod<'a, E>,
    times: &[f64],
) -> Result<Vec<f64>>
where
    E: OdeEquationsImplicitSens<M = M, V = V, T = f64> + 'a,
{
    let (states, by_parameters, _) = solver.solve_dense_sensitivities(times)?;
    let mut end = last(&states);
    end.extend(by_parameters.iter().flat_map(last));
    Ok(end)
}

fn last(samples: &M) -> Vec<f64> {
    let column = samples.ncols() - 1;
    (0..samples.nrows())
        .map(|row| samples.get_index(row, column))
        .collect()
}

/// The model in DiffSL. The parameters are its inputs.
fn text_of_states() -> String {
    text(STATES_AT_START, "", RIGHT)
}

/// The same with the derivatives of the five states with respect to each parameter as fifty states more.
fn text_of_states_and_sensitivities() -> String {
    let mut states = STATES_AT_START.to_string();
    let mut torques = "stiffness { c + 3 * c3 * e * e }\n".to_string();
    let mut right = RIGHT.to_string();
    for (name, _) in PARAMETERS {
        // What the right-hand sides have of the parameter itself, before they are divided by L, J1 and J2.
        let of_tau = match name {
            "c" => "+ e",
            "c3" => "+ e * e * e",
            "d" => "+ (w1 - w2)",
            _ => "",
        };
        let [of_cur, of_w1, of_w2] = match name {
            "R" => ["- cur", "", ""],
            "L" => ["- dcur", "", ""],
            "k" => ["- w1", "+ cur", ""],
            "J1" => ["", "- dw1", ""],
            "J2" => ["", "", "- dw2"],
            "d1" => ["", "- w1", ""],
            "d2" => ["", "", "- w2"],
            _ => [""; 3],
        };
        let [cur, w1, w2, p1, p2, tau] =
            ["cur", "w1", "w2", "p1", "p2", "tau"].map(|of| format!("{of}by{name}"));
        states += &format!(", {cur} = 0, {w1} = 0, {w2} = 0, {p1} = 0, {p2} = 0");
        torques += &format!("{tau} {{ stiffness * ({p1} - {p2}) + d * ({w1} - {w2}) {of_tau} }}\n");
        right += &format!(
            ", (0 - R * {cur} - k * {w1} {of_cur}) / L
            , (k * {cur} - d1 * {w1} - {tau} {of_w1}) / J1
            , ({tau} - d2 * {w2} {of_w2}) / J2
            , {w1}, {w2}"
        );
    }
    text(&states, &torques, &right)
}

const STATES_AT_START: &str = "cur = 0, w1 = 0, w2 = 0, p1 = 0, p2 = 0";
const ALGEBRA: &str = "
    voltage { 6 * sin(3 * t) }
    e { p1 - p2 }
    tau { c * e + c3 * e * e * e + d * (w1 - w2) }
    dcur { (voltage - R * cur - k * w1) / L }
    dw1 { (k * cur - d1 * w1 - tau) / J1 }
    dw2 { (tau - d2 * w2) / J2 }";
const RIGHT: &str = "dcur, dw1, dw2, w1, w2";

fn text(states: &str, torques: &str, right: &str) -> String {
    let inputs = PARAMETERS.map(|(name, value)| format!("{name} = {value}"));
    format!(
        "in_i {{ {} }}\nu_i {{ {states} }}\n{ALGEBRA}\n{torques}F_i {{ {right} }}",
        inputs.join(", ")
    )
}

/// The model in Rust with derivatives by hand, errors of the sensitivities under the same tolerances as those of the states.
fn with_sensitivities() -> Result<
    OdeSolverProblem<impl OdeEquationsImplicitSens<M = M, V = V, T = f64, C = NalgebraContext>>,
> {
    builder()
        .sens_rtol(RTOL)
        .sens_atol([ATOL])
        .rhs_sens_implicit(field, jacobian_times, by_parameters_times)
        .init_sens(
            |_, _, x: &mut [f64]| x.fill(0.0),
            |_, _, _, x: &mut [f64]| x.fill(0.0),
            STATES,
        )
        .build()
}

fn states(x: &[f64]) -> [f64; STATES] {
    x.try_into().expect("five states")
}

fn parameters(p: &[f64]) -> [f64; PARAMETERS.len()] {
    p.try_into().expect("ten parameters")
}

#[allow(non_snake_case)]
fn field(x: &[f64], p: &[f64], t: f64, f: &mut [f64]) {
    let [i, w1, w2, p1, p2] = states(x);
    let [R, L, k, J1, J2, d1, d2, c, c3, d] = parameters(p);
    let e = p1 - p2;
    let tau = c * e + c3 * e * e * e + d * (w1 - w2);
    let u = 6.0 * (3.0 * t).sin();
    f.copy_from_slice(&[
        (u - R * i - k * w1) / L,
        (k * i - d1 * w1 - tau) / J1,
        (tau - d2 * w2) / J2,
        w1,
        w2,
    ]);
}

/// The Jacobian of the field with respect to the states, times v.
#[allow(non_snake_case)]
fn jacobian_times(x: &[f64], p: &[f64], _: f64, v: &[f64], f: &mut [f64]) {
    let [_, _, _, p1, p2] = states(x);
    let [R, L, k, J1, J2, d1, d2, c, c3, d] = parameters(p);
    let [i_v, w1_v, w2_v, p1_v, p2_v] = states(v);
    let e = p1 - p2;
    let tau_v = (c + 3.0 * c3 * e * e) * (p1_v - p2_v) + d * (w1_v - w2_v);
    f.copy_from_slice(&[
        (-R * i_v - k * w1_v) / L,
        (k * i_v - d1 * w1_v - tau_v) / J1,
        (tau_v - d2 * w2_v) / J2,
        w1_v,
        w2_v,
    ]);
}

/// The derivatives of the field with respect to the parameters, times v.
#[allow(non_snake_case)]
fn by_parameters_times(x: &[f64], p: &[f64], t: f64, v: &[f64], f: &mut [f64]) {
    let [i, w1, w2, p1, p2] = states(x);
    let [_, L, _, J1, J2, ..] = parameters(p);
    let [R_v, L_v, k_v, J1_v, J2_v, d1_v, d2_v, c_v, c3_v, d_v] = parameters(v);
    let e = p1 - p2;
    let tau_v = c_v * e + c3_v * e * e * e + d_v * (w1 - w2);
    field(x, p, t, f);
    f[0] = (-R_v * i - k_v * w1 - L_v * f[0]) / L;
    f[1] = (k_v * i - d1_v * w1 - tau_v - J1_v * f[1]) / J1;
    f[2] = (tau_v - d2_v * w2 - J2_v * f[2]) / J2;
    f[3] = 0.0;
    f[4] = 0.0;
}
