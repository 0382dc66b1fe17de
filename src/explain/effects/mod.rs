//! The library of physical effects that a simulation may have left out: one file a family.
//!
//! An entry is a [`Definition`]: an equation, where it acts (its [`Port`]), its parameters with units and bounds,
//! where to start looking for them, what imitates it, and which recording would tell the two apart. A force law is
//! written for unit amplitude: amplitude and entry point are the direction `b_w` of `structure`.

mod actuator;
mod change;
mod command;
mod disturbance;
mod flow;
mod friction;
mod law;
mod sensor;
mod stiffness;
#[cfg(test)]
mod tests;
mod wrong_parameters;

pub(crate) use law::{CHARGE_ORDERS, Clock, Motion, Observed, charge, decay, level};

/// Where an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// On an input channel, before the plant.
    Input,
    /// A force inside the plant: a function of a position or a velocity, through a direction of its own.
    Force,
    /// On a measured output, after the plant.
    Sensor,
    /// Another dynamic path from the inputs to an output, beside the plant.
    Path,
    /// Changes what the recording is, sample by sample; found by exact tests, not by fits.
    Exact,
}

/// What a parameter is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// The unit of the input channel.
    Input,
    /// The unit of the input channel per second.
    InputRate,
    /// The unit of the input channel times seconds.
    InputSeconds,
    /// The unit of the output (or position) that the effect looks at.
    Position,
    /// That unit per second.
    Rate,
    /// Seconds.
    Second,
    /// Hertz.
    Hertz,
    /// A pure number.
    Ratio,
    /// Radians.
    Radian,
}

/// One number of an effect.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Name in documents, spelled out.
    pub name: &'static str,
    /// Unit.
    pub unit: Unit,
    /// Fitted on a logarithmic scale: positive.
    pub logarithmic: bool,
    /// Smallest value allowed.
    pub lower: f64,
    /// Largest value allowed.
    pub upper: f64,
    /// Stays where it starts: it says where something is looked at and is not fitted.
    pub held: bool,
}

impl Parameter {
    /// A positive number, fitted on a logarithmic scale.
    pub(crate) const fn positive(name: &'static str, unit: Unit) -> Self {
        Self {
            name,
            unit,
            logarithmic: true,
            lower: 1e-12,
            upper: 1e12,
            held: false,
        }
    }

    /// Any number.
    pub(crate) const fn real(name: &'static str, unit: Unit) -> Self {
        Self {
            name,
            unit,
            logarithmic: false,
            lower: -1e12,
            upper: 1e12,
            held: false,
        }
    }

    /// The same, not fitted.
    pub(crate) const fn held(self) -> Self {
        Self { held: true, ..self }
    }

    /// A number between bounds.
    pub(crate) const fn between(name: &'static str, unit: Unit, lower: f64, upper: f64) -> Self {
        Self {
            name,
            unit,
            logarithmic: false,
            lower,
            upper,
            held: false,
        }
    }
}

/// What sign the amplitude of a force may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sense {
    /// It only resists: friction dissipates, a stop pushes back.
    Resists,
    /// It acts as the input does that it grows with: a flow through an opening enters from where the pressure is higher.
    Drives,
    /// Either way.
    Either,
}

/// Which of the two signals of a place a force needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Needs {
    /// A position.
    Position,
    /// A velocity.
    Rate,
    /// What changes a velocity.
    Acceleration,
    /// Nothing: time alone.
    Time,
}

/// A parameter vector's effect on one output channel, in place.
pub(crate) type ChannelLaw = fn(parameters: &[f64], channel: &mut [f64], clock: &Clock);
/// The same for an input: the mean over each sample interval, and its moments, for laws that do not hold their value over the
/// interval.
pub(crate) type InputLaw =
    fn(parameters: &[f64], mean: &mut [f64], moments: &mut [Moments], clock: &Clock);
/// `int (x - 1/2) u dx` and `int (x^2 - x + 1/6) u dx` over an interval of length 1: what an input does within it, by Legendre's
/// polynomials of the first and the second degree.
pub(crate) type Moments = [f64; 2];
/// Force of unit amplitude over one sample; the memory is the effect's own state.
pub(crate) type ForceLaw = fn(parameters: &[f64], motion: &Motion, memory: &mut [f64; 3]) -> f64;
/// Starting values of the shape parameters, from what the simulation says the channel does.
pub(crate) type Starts = fn(&Observed) -> Vec<Vec<f64>>;

/// What the effect does.
#[derive(Clone, Copy)]
pub(crate) enum Action {
    /// Changes an input channel.
    Input(InputLaw),
    /// A force through a direction.
    Force(ForceLaw, Needs, Sense),
    /// A force minus the position, the rate or the acceleration, which becomes part of the plant.
    Linear(Needs),
    /// Changes an output channel.
    Sensor(ChannelLaw),
    /// A second-order path beside the plant (`extra_mode`).
    Mode,
    /// A sinusoid in time at every output, which a periodic force in the plant makes as well as a pickup at a sensor.
    Sine,
    /// The path of an input that the simulation lacks (`missing_input`).
    MissingPath,
    /// A curve of the integral of an input, added to the outputs.
    Charge,
    /// Found by an exact test; in the model it is a sensor law without effect on fits.
    Exact,
}

impl Action {
    /// Whether it enters the state equation through a direction.
    pub(crate) fn is_force(&self) -> bool {
        matches!(self, Self::Force(..) | Self::Linear(_))
    }
}

impl std::fmt::Debug for Action {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Input(_) => "Input",
            Self::Force(..) => "Force",
            Self::Linear(_) => "Linear",
            Self::Sensor(_) => "Sensor",
            Self::Mode => "Mode",
            Self::Sine => "Sine",
            Self::MissingPath => "MissingPath",
            Self::Charge => "Charge",
            Self::Exact => "Exact",
        })
    }
}

/// What imitates an effect, and what would tell them apart.
#[derive(Debug, Clone, Copy)]
pub struct Mimic {
    /// Id of the other effect.
    pub effect: &'static str,
    /// The recording that separates the two.
    pub experiment: &'static str,
}

/// An entry of the library.
#[derive(Debug)]
pub struct Definition {
    /// Id in documents: `coulomb_friction`.
    pub id: &'static str,
    /// Which form of it, where there are several (`upper`, `lower`); empty else.
    pub variant: &'static str,
    /// What people call it.
    pub name: &'static str,
    /// The law, for reading.
    pub equation: &'static str,
    /// Shape parameters (a force's amplitude is not among them).
    pub parameters: &'static [Parameter],
    /// What it looks like, and what tells the two apart.
    pub mimics: &'static [Mimic],
    /// Parameters that scale what the effect does: with all of them zero it does nothing.
    pub linear: &'static [usize],
    /// Whether it acts on a new input as well: an event of the recording (a drift, a frozen sensor) does not.
    pub persists: bool,
    pub(crate) action: Action,
    pub(crate) starts: Starts,
}

impl Definition {
    /// Whether what the effect does grows about in proportion to its first parameter, from nothing at zero.
    pub(crate) fn grows_with_first(&self) -> bool {
        self.parameters
            .first()
            .is_some_and(|p| matches!(p.name, "delay" | "time_constant" | "width" | "half_gap"))
    }

    /// Whether it is a force with coefficients of its own, which need no amplitude beside them.
    pub(crate) fn is_curve(&self) -> bool {
        matches!(self.action, Action::Force(..)) && !self.linear.is_empty()
    }

    /// Which of its parameters is the time in the recording at which it begins.
    pub(crate) fn change_time(&self) -> Option<usize> {
        self.parameters
            .iter()
            .position(|p| p.name == "from" && p.unit == Unit::Second)
    }

    /// Whether it begins at some time in the recording.
    pub(crate) fn changes(&self) -> bool {
        self.change_time().is_some()
    }

    /// Unit that the output must be measured in, where the law holds for one unit only.
    pub(crate) fn unit_of_output(&self) -> Option<&'static str> {
        let unit = self.variant.split(' ').next();
        unit.filter(|unit| matches!(*unit, "deg" | "rad" | "degC" | "degF" | "K"))
    }

    /// Where the effect acts.
    pub fn port(&self) -> Port {
        match self.action {
            Action::Input(_) => Port::Input,
            Action::Force(..) | Action::Linear(_) => Port::Force,
            Action::Sensor(_) | Action::Sine => Port::Sensor,
            Action::Mode | Action::MissingPath | Action::Charge => Port::Path,
            Action::Exact => Port::Exact,
        }
    }
}

/// All entries, variants of one effect next to each other.
pub fn library() -> impl Iterator<Item = &'static Definition> {
    [
        friction::ENTRIES,
        stiffness::ENTRIES,
        flow::ENTRIES,
        actuator::ENTRIES,
        command::ENTRIES,
        sensor::ENTRIES,
        disturbance::ENTRIES,
        change::ENTRIES,
    ]
    .into_iter()
    .flatten()
}

/// The entry with this id and variant, also of what is not physics but a number (`wrong_parameters`).
pub(crate) fn find(id: &str, variant: &str) -> Option<&'static Definition> {
    library()
        .chain(wrong_parameters::ENTRIES)
        .find(|d| d.id == id && d.variant == variant)
}
