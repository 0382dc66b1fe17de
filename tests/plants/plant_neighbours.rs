//! What is close to the first guess: a force and its reaction, changes that begin later, sides that differ, parameters along a variable
//! or at their bounds, and second effects of plants whose parameters have a common scale.

use std::fmt::Write;

use serde_json::Value;

use crate::folder::{Folder, effects};
use crate::plant_initial_states::noise;

/// Rows of a log: the inputs held over each interval, and what the states show, with noise.
pub fn recorded(
    names: &str,
    (count, step): (usize, f64),
    inputs: &[&dyn Fn(usize) -> f64],
    rate: impl Fn(&[f64], &[f64], f64) -> Vec<f64>,
    (start, shows): (&[f64], &[(usize, f64)]),
) -> String {
    let mut normal = noise(5);
    let mut x = start.to_vec();
    let mut log = format!("t,{names}\n");
    for k in 0..count {
        let u: Vec<f64> = inputs.iter().map(|input| input(k)).collect();
        write!(log, "{}", k as f64 * step).unwrap();
        u.iter().for_each(|u| write!(log, ",{u}").unwrap());
        for (state, size) in shows {
            write!(log, ",{:.5}", x[*state] + size * normal()).unwrap();
        }
        log.push('\n');
        const PARTS: usize = 50;
        let h = step / PARTS as f64;
        for part in 0..PARTS {
            let t = k as f64 * step + part as f64 * h;
            let middle: Vec<f64> = (x.iter().zip(rate(&x, &u, t)))
                .map(|(x, r)| x + 0.5 * h * r)
                .collect();
            let slope = rate(&middle, &u, t + 0.5 * h);
            x.iter_mut().zip(slope).for_each(|(x, r)| *x += h * r);
        }
    }
    log
}

/// Levels that change every so many samples, without a pattern.
pub fn levels(every: usize, low: f64, high: f64) -> impl Fn(usize) -> f64 {
    move |k| {
        let part = ((k / every) as f64 * 0.618_033_988_7 + 0.13).fract();
        low + (high - low) * part
    }
}

pub fn explained(folder: &Folder, log: &str, model: &str) -> Value {
    folder.text("log.csv", log);
    folder.text("plant.mo", model);
    folder.explained("log.csv", "plant.mo", &[])
}

pub fn number(said: &Value, effect: usize, name: &str) -> f64 {
    let found = &said["effects"][effect]["parameters"][name]["value"];
    found.as_f64().unwrap_or_else(|| panic!("{name}: {said:#}"))
}

/// Friction between two bodies brakes the one and drives the other.
#[test]
fn friction_between_two_bodies_enters_both() {
    let friction = |v: f64| 0.6 * (v / 0.002).tanh();
    let force = levels(40, -3.0, 3.0);
    let log = recorded(
        "F,x,w",
        (1200, 0.05),
        &[&force],
        |x, u, _| {
            let between = 30.0 * x[0] + 0.8 * (x[1] - x[2]) + friction(x[1] - x[2]);
            let (one, other) = ((u[0] - between) / 2.0, (between - 1.5 * x[2]) / 3.0);
            vec![x[1] - x[2], one, other]
        },
        (&[0.0; 3], &[(0, 5e-4), (2, 2e-3)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Two\n  parameter Real m(unit=\"kg\", min=1.5, max=2.5) = 2.2;\n  parameter Real n(unit=\"kg\", min=2, max=4) = 2.7;\n  parameter Real k(unit=\"N/m\", min=20, max=40) = 27;\n  parameter Real c(unit=\"N.s/m\", min=0.3, max=2) = 1;\n  parameter Real d(unit=\"N.s/m\", min=0.5, max=3) = 1.2;\n  input Real F(unit=\"N\");\n  output Real x(unit=\"m\");\n  output Real w(unit=\"m/s\");\n  Real s(unit=\"m\", start=0);\n  Real v1(unit=\"m/s\", start=0);\n  Real v2(unit=\"m/s\", start=0);\nequation\n  der(s) = v1 - v2;\n  m*der(v1) = F - k*s - c*(v1 - v2);\n  n*der(v2) = (v1 - v2)*c + s*k - d*v2;\n  x = s;\n  w = v2;\nend Two;\n",
    );
    assert_eq!(effects(&said), ["coulomb_friction"], "{}", said["summary"]);
    let effect = &said["effects"][0];
    assert_eq!(effect["enters"], "v1");
    let equation = effect["equation"].as_str().unwrap();
    assert!(equation.starts_with("shared_term ="), "{equation}");
    let summary = said["summary"].to_string();
    assert!(
        summary.contains("what the equations of v1 and v2 share"),
        "{summary}"
    );
}

/// A drag that grows from some time on: without the change the parameter goes to its bound, and a load is as good.
#[test]
fn a_parameter_that_went_to_its_bound_changes() {
    let wind = levels(25, -8.0, 8.0);
    let log = recorded(
        "wz,alt",
        (1000, 0.2),
        &[&wind],
        |x, u, t| {
            let area = if t > 120.0 { 14.58 } else { 10.8 };
            let air = x[1] - u[0];
            vec![x[1], -9.80665 - 0.5 * 1.1 * area * air * air.abs() / 90.0]
        },
        (&[2207.0, -22.0], &[(0, 0.5)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Parachute\n  final parameter Real m(unit=\"kg\") = 90;\n  parameter Real cA(unit=\"m2\", min=8, max=12) = 10;\n  final parameter Real rho(unit=\"kg/m3\") = 1.1;\n  input Real wz(unit=\"m/s\");\n  output Real alt(unit=\"m\");\n  Real h(unit=\"m\", start=2200);\n  Real v(unit=\"m/s\", start=-25);\nequation\n  der(h) = v;\n  m*der(v) = -m*Modelica.Constants.g_n - 0.5*rho*cA*(v - wz)*abs(v - wz);\n  alt = h;\nend Parachute;\n",
    );
    assert_eq!(effects(&said), ["parameter_change"], "{}", said["summary"]);
    let change = number(&said, 0, "parameter_step_c");
    assert!((change - 3.78).abs() < 0.1, "{change}");
}

/// A thermometer that drifts from some time on.
#[test]
fn a_drift_begins_after_the_recording() {
    let heat = levels(80, 0.0, 10.0);
    let log = recorded(
        "P,y",
        (1500, 20.0),
        &[&heat],
        |x, u, t| {
            let drift = if t > 18_000.0 { 2e-4 } else { 0.0 };
            let warms = (u[0] - 0.4 * (x[0] - 20.0)) / 900.0;
            vec![warms, drift + warms]
        },
        (&[22.0, 22.0], &[(1, 0.05)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Tank\n  parameter Real C(unit=\"kJ/K\", min=600, max=1200) = 800;\n  parameter Real G(unit=\"kW/K\", min=0.2, max=0.8) = 0.5;\n  input Real P(unit=\"kW\");\n  output Real y(unit=\"degC\");\n  Real T(unit=\"degC\", start=21);\nequation\n  C*der(T) = P - G*(T - 20);\n  y = T;\nend Tank;\n",
    );
    assert_eq!(effects(&said), ["sensor_drift"], "{}", said["summary"]);
    let (begin, rate) = (
        number(&said, 0, "sensor_drift_t0"),
        number(&said, 0, "sensor_drift_c"),
    );
    assert!((begin - 18_000.0).abs() < 500.0, "{begin}");
    assert!((rate - 2e-4).abs() < 5e-6, "{rate}");
}

/// Mass, friction, gain and drag have a common scale that nothing determines: the drag is no less certain.
#[test]
fn a_common_scale_hides_no_second_effect() {
    let (torque, slope) = (levels(30, 0.0, 65.0), levels(47, -0.03, 0.03));
    let log = recorded(
        "T,sl,speed",
        (1200, 0.3),
        &[&torque, &slope],
        |x, u, _| {
            let force = 3.2 * u[0].min(48.0) - 8.0 * x[0] - 0.45 * x[0] * x[0].abs();
            vec![force / 112.0 - 9.80665 * u[1]]
        },
        (&[5.0], &[(0, 0.05)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Bike\n  parameter Real m(unit=\"kg\", min=95, max=118) = 105;\n  parameter Real fr(unit=\"N.s/m\", min=4, max=10) = 6;\n  parameter Real k(unit=\"N/(N.m)\", min=2.6, max=3.4) = 3;\n  input Real T(unit=\"N.m\");\n  input Real sl(unit=\"1\");\n  output Real speed(unit=\"m/s\");\n  Real v(unit=\"m/s\", start=4);\nequation\n  m*der(v) = k*T - fr*v - m*Modelica.Constants.g_n*sl;\n  speed = v;\nend Bike;\n",
    );
    let mut found = effects(&said);
    found.sort_unstable();
    assert_eq!(
        found,
        ["input_saturation", "quadratic_drag"],
        "{}",
        said["summary"]
    );
    let limit = (0..2).find(|&i| said["effects"][i]["effect"] == "input_saturation");
    let limit = number(&said, limit.unwrap(), "input_saturation_L");
    assert!((limit - 48.0).abs() < 0.5, "{limit}");
}

/// A brake whose torque falls above a critical speed: the shape of a parameter along a variable, with a formula or a curve.
#[test]
fn a_parameter_falls_along_a_variable() {
    let (torque, current) = (levels(35, 3.0, 12.0), levels(50, 0.5, 3.0));
    let log = recorded(
        "Tm,ib,n",
        (1500, 0.05),
        &[&torque, &current],
        |x, u, _| {
            let brake = 0.014 / (1.0 + (x[0] / 90.0).powi(2)) * u[1] * u[1] * x[0];
            vec![(u[0] - 0.026 * x[0] - brake) / 0.052]
        },
        (&[50.0], &[(0, 0.3)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Brake\n  parameter Real J(unit=\"kg.m2\", min=0.045, max=0.056) = 0.05;\n  parameter Real d(unit=\"N.m.s/rad\", min=0.01, max=0.04) = 0.02;\n  parameter Real c(unit=\"N.m.s/(rad.A2)\", min=0.008, max=0.024) = 0.012;\n  input Real Tm(unit=\"N.m\");\n  input Real ib(unit=\"A\");\n  output Real n(unit=\"rad/s\");\n  Real w(unit=\"rad/s\", start=50);\nequation\n  J*der(w) = Tm - d*w - c*ib^2*w;\n  n = w;\nend Brake;\n",
    );
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(effects(&said), ["law"], "{}", said["summary"]);
    assert_eq!(said["effects"][0]["depends"], serde_json::json!(["w", "c"]));
    assert_eq!(said["remaining"]["adequate"], true);
}

/// A spring that stiffens about its rest, which the gauge shows as 8 mm: of the cube of the gauge's value nothing is to be seen.
#[test]
fn a_spring_stiffens_about_its_rest_wherever_the_gauge_has_its_zero() {
    let force = levels(30, -90.0, 90.0);
    let log = recorded(
        "F,shown",
        (1500, 0.02),
        &[&force],
        |x, u, _| {
            let stretch = x[0] - 8.0;
            vec![
                x[1],
                4.0 * u[0] - 220.0 * stretch - 0.15 * stretch.powi(3) - 6.0 * x[1],
            ]
        },
        (&[8.0, 0.0], &[(0, 0.01)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Table\n  parameter Real k(min=50, max=500) = 300;\n  parameter Real d(min=1, max=20) = 8;\n  parameter Real b(min=1, max=10) = 5;\n  parameter Real c(min=0, max=5000) = 1500;\n  input Real F(unit=\"N\");\n  output Real shown(unit=\"mm\");\n  Real x(unit=\"mm\", start=8);\n  Real v(unit=\"mm/s\", start=0);\nequation\n  der(x) = v;\n  der(v) = b*F - k*x - d*v + c;\n  shown = x;\nend Table;\n",
    );
    assert_eq!(effects(&said), ["cubic_stiffness"], "{}", said["summary"]);
    let rest = number(&said, 0, "cube_o");
    assert!((rest - 8.0).abs() < 0.2, "{rest}");
}

/// A throttle that acts between two limits: two numbers, where a curve of the input needs a dozen.
#[test]
fn an_input_with_two_limits_that_differ_is_no_curve() {
    let throttle = levels(25, 25.0, 80.0);
    let log = recorded(
        "throttle,climb",
        (1500, 0.1),
        &[&throttle],
        |x, u, _| {
            let acts = u[0].clamp(41.0, 61.0);
            vec![(acts - 50.0 - x[0]) / 0.3, (0.4 * x[0] - x[1]) / 1.5]
        },
        (&[0.0, 0.0], &[(1, 0.05)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Drone\n  parameter Real K(min=0.1, max=1) = 0.3;\n  parameter Real T(unit=\"s\", min=0.5, max=4) = 1;\n  parameter Real hover(min=40, max=60) = 48;\n  final parameter Real lag(unit=\"s\") = 0.3;\n  input Real throttle(unit=\"%\");\n  output Real climb(unit=\"m/s\");\n  Real thrust(unit=\"%\", start=0);\n  Real w(unit=\"m/s\", start=0);\nequation\n  lag*der(thrust) = throttle - hover - thrust;\n  T*der(w) = K*thrust - w;\n  climb = w;\nend Drone;\n",
    );
    assert_eq!(effects(&said), ["input_saturation"], "{}", said["summary"]);
    let [lower, upper] = ["lower", "L"].map(|n| number(&said, 0, &format!("input_saturation_{n}")));
    assert!(
        (lower - 41.0).abs() < 0.3 && (upper - 61.0).abs() < 0.3,
        "{lower} {upper}"
    );
}

/// The iron of a magnet saturates softly: a limit with a knee, not a curve without a name.
#[test]
fn a_limit_with_a_soft_knee_is_a_saturation() {
    let current = levels(25, 0.2, 3.0);
    let log = recorded(
        "i,v",
        (1200, 0.1),
        &[&current],
        |x, u, _| {
            vec![(4.0 * 1.6 * (1.0 - (-(u[0] / 1.6).powi(4)).exp()).powf(0.25) - 2.0 * x[0]) / 1.5]
        },
        (&[0.4], &[(0, 0.01)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Magnet\n  parameter Real k(unit=\"N/A\", min=2, max=6) = 3.5;\n  parameter Real d(unit=\"N.s/m\", min=1, max=4) = 2.2;\n  parameter Real m(unit=\"kg\") = 1.5;\n  input Real i(unit=\"A\");\n  output Real v(unit=\"m/s\");\n  Real w(unit=\"m/s\", start=0.4);\nequation\n  m*der(w) = k*i - d*w;\n  v = w;\nend Magnet;\n",
    );
    assert_eq!(effects(&said), ["input_saturation"], "{}", said["summary"]);
    let limit = number(&said, 0, "input_saturation_L");
    assert!((limit - 1.6).abs() < 0.15, "{limit}");
}

/// A stretch of gravel brakes a vehicle for a while.
#[test]
fn a_load_that_ends_has_a_beginning_and_a_length() {
    let force = levels(25, 20.0, 90.0);
    let log = recorded(
        "F [N],y [m/s]",
        (1500, 1.0),
        &[&force],
        |x, u, t| {
            let gravel = if t > 500.0 && t < 820.0 { 14.0 } else { 0.0 };
            vec![(u[0] - 3.0 * x[0] - 8.0 - gravel) / 90.0]
        },
        (&[5.0], &[(0, 0.02)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Cart\n  parameter Real m(unit=\"kg\", min=80, max=100) = 93;\n  parameter Real d(unit=\"N.s/m\", min=2, max=4) = 2.8;\n  parameter Real r(unit=\"N\", min=5, max=12) = 9;\n  input Real F(unit=\"N\");\n  output Real y(unit=\"m/s\");\n  Real v(unit=\"m/s\", start=5);\nequation\n  m*der(v) = F - d*v - r;\n  y = v;\nend Cart;\n",
    );
    assert_eq!(effects(&said), ["load_step"], "{}", said["summary"]);
    let (begins, lasts) = (
        number(&said, 0, "load_step_t0"),
        number(&said, 0, "load_step_T"),
    );
    assert!((begins - 500.0).abs() < 2.0, "{begins}");
    assert!((lasts - 320.0).abs() < 3.0, "{lasts}");
}

/// A window that stands open for a while: the parameter is what it was before and after.
#[test]
fn a_parameter_that_comes_back_has_a_beginning_and_a_length() {
    let heating = levels(30, 0.0, 2000.0);
    let log = recorded(
        "P [W],y [degC]",
        (1400, 60.0),
        &[&heating],
        |x, u, t| {
            let window = if t > 24_000.0 && t < 39_000.0 {
                60.0
            } else {
                0.0
            };
            vec![(u[0] - (90.0 + window) * (x[0] - 4.0)) / 4.0e5]
        },
        (&[15.0], &[(0, 0.03)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Room\n  parameter Real C(unit=\"J/K\", min=3e5, max=5e5) = 4.3e5;\n  parameter Real h(unit=\"W/K\", min=70, max=110) = 84;\n  input Real P(unit=\"W\");\n  output Real y(unit=\"degC\");\n  Real T(unit=\"degC\", start=15);\nequation\n  C*der(T) = P - h*(T - 4);\n  y = T;\nend Room;\n",
    );
    assert_eq!(effects(&said), ["parameter_change"], "{}", said["summary"]);
    assert_eq!(
        said["effects"][0]["depends"],
        serde_json::json!(["time", "h"])
    );
    let lasts = number(&said, 0, "parameter_step_T");
    assert!((lasts - 15_000.0).abs() < 200.0, "{lasts}");
}
