//! Cases of concealed physics, made by a simulator that shares nothing with the library.
//!
//! A plant is integrated at 50 steps a sample with physics richer than a candidate library holds (bristles,
//! contact, soft knees); the simulation that goes with it leaves one effect out. [`draw`] makes a case,
//! [`Case::write`] puts it into a folder.
//!
//! In the fresh truth, what belongs to the moment of recording is absent (periodic disturbance, drift, freeze,
//! quantisation, jitter), and what has changed stays changed from the first sample on (load step, gain and
//! stiffness change). Derating starts cold again. Noise enters at the measurement: after offset, drift, limits
//! and lost sign, before quantisation and freezing.

#![allow(
    dead_code,
    reason = "shared by an example and by tests, which use different parts"
)]

pub mod actuator;
pub mod case;
pub mod contact;
pub mod controller;
pub mod dice;
pub mod drawing;
pub mod effect;
pub mod excitation;
pub mod force;
pub mod friction;
pub mod hysteresis;
pub mod linear;
pub mod noise;
pub mod numbers;
pub mod plant;
pub mod scene;
pub mod sensor;
pub mod simulate;
pub mod truth;
pub mod wiring;
pub mod write;

#[allow(unused_imports, reason = "the face of the module")]
pub use {
    case::{Case, Recording, Simulation, draw},
    drawing::{Drawing, Kind},
    effect::Effect,
    truth::{Model, Truth},
};
