//! What a term is: an expression of the language of the plants with places for its argument, shapes and memories.

/// What a term may enter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Port {
    /// An equation: a function of variables of the plant is added to its right-hand side.
    Equation,
    /// An input, as a function of itself.
    Input,
    /// A sensor, as a function of what it shows or of another variable.
    Sensor,
    /// A parameter, as a function of variables of the plant.
    Parameter,
}

/// What the argument of a term must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Needs {
    /// Nothing.
    Anything,
    /// Both signs occur.
    BothSigns,
    /// The same, or it comes down to zero: what acts about zero shows.
    AboutZero,
    /// Never below zero.
    Positive,
    /// A difference of fourth powers of absolute temperatures.
    Radiation,
    /// The reciprocal of an absolute temperature.
    Reciprocal,
    /// A difference of two variables of one unit.
    Difference,
    /// The size of what drives a velocity, with the sign of this.
    Driven,
    /// Such a difference of positions: what a spring is stretched by.
    Stretch,
    /// An angle.
    Angle,
    /// An angle, or the position of what moves along a line.
    AlongPath,
    /// Both signs occur, of a velocity however rarely.
    Turning,
    /// A velocity of both signs.
    Velocity,
    /// A velocity of one sign.
    OneWay,
    /// What has a direction: both signs occur, however rarely, or it is a velocity of one sign.
    Directed,
    /// The state whose derivative the equation determines.
    OwnState,
    /// Such a state that its own derivative does not depend on: what moves or fills as it is driven.
    Integrated,
    /// Another variable than the sensor shows.
    Another,
    /// What is switched on as each recording begins: it is not zero at the first sample, and may have been before.
    SwitchedOn,
    /// No argument: a function of time alone.
    Time,
}

/// Where the search for a number that shapes a term starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Starts {
    /// Quantiles of the argument.
    Quantiles(&'static [f64]),
    /// Quantiles of the size of the argument.
    SizeQuantiles(&'static [f64]),
    /// Parts of the argument's standard deviation.
    Spread(&'static [f64]),
    /// Parts of its reciprocal.
    PerSpread(&'static [f64]),
    /// The same as [`Self::Spread`] of sizes at which something snaps: what a recording says of them changes in jumps, and the screen looks between
    /// these for the best.
    Releases(&'static [f64]),
    /// Wave numbers with every half period more in the range of an argument, and more of whole ones in an angle.
    Waves,
    /// Parts of the recording's length.
    Length(&'static [f64]),
    /// Instants, as parts of the recording's length; the screen looks between them for the sample.
    Instants(&'static [f64]),
    /// Parts of the range of the argument's integral.
    Travel(&'static [f64]),
    /// Parts of the argument's range in a sample.
    Rate(&'static [f64]),
    /// Parts of the root mean square of its rate.
    RateSize(&'static [f64]),
    /// Numbers of samples.
    Samples(&'static [f64]),
    /// As they stand.
    Values(&'static [f64]),
    /// Powers, as they stand.
    Powers(&'static [f64]),
    /// Frequencies at which the spectrum of the residual has its peaks.
    Peaks,
    /// Parts of a whole.
    Share(&'static [f64]),
    /// What the integral of the argument moves in a sample at a typical size of it.
    Moved(&'static [f64]),
}

/// Where a memory starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MemoryStart {
    /// At the first value of the argument.
    Argument,
    /// At its square.
    Square,
    /// At zero.
    Zero,
}

/// A memory of a term: `{m}`, then `{p}` and `{q}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Memory {
    /// Its derivative, or, of one that changes at samples only, its value, where it stands for the value before.
    pub(crate) rate: &'static str,
    pub(crate) start: MemoryStart,
    pub(crate) sampled: bool,
}

/// What stands for the memories in a form.
pub(crate) const MEMORIES: [&str; 3] = ["{m}", "{p}", "{q}"];

/// A number that shapes a term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape {
    /// As in the form: `from` for `{from}`. Not the symbol of the strength.
    pub(crate) symbol: &'static str,
    pub(crate) starts: Starts,
    /// True when only positive values make sense.
    pub(crate) positive: bool,
}

impl Shape {
    /// Whether it is a time of the recording.
    pub(crate) fn is_instant(&self) -> bool {
        matches!(self.starts, Starts::Instants(_))
    }

    /// Whether it is a place on the axis of the argument or of time, where 0 is like any other.
    pub(crate) fn is_place(&self) -> bool {
        matches!(self.starts, Starts::Quantiles(_)) && !self.positive || self.is_instant()
    }

    /// Whether it is a value of the argument.
    pub(crate) fn is_value(&self) -> bool {
        matches!(self.starts, Starts::Quantiles(_) | Starts::SizeQuantiles(_))
    }

    /// Whether it is a part of what the equation's coefficient holds.
    pub(crate) fn is_share(&self) -> bool {
        matches!(self.starts, Starts::Share(_))
    }

    /// Whether it is a time that something takes.
    pub(crate) fn is_duration(&self) -> bool {
        matches!(self.starts, Starts::Samples(_) | Starts::Length(_))
    }
}

/// A term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Term {
    /// Id where nothing more is known of the place; see [`named`](crate::explain::engine::terms::names::named).
    pub(crate) id: &'static str,
    pub(crate) port: Port,
    pub(crate) needs: Needs,
    /// Function of `{z}`, of the shapes, of the memories, and of the time `{begin}` at which the recordings begin; the strength is its
    /// factor. `{v}` is what stands at the place,
    /// `{a}` the factor of the derivative there, `{instant}` a part of a sample, `{-usual}` ` - ` and a usual value of `{z}`, `{-usual^2}` its square.
    pub(crate) form: &'static str,
    pub(crate) memories: &'static [Memory],
    pub(crate) shapes: &'static [Shape],
    /// False when the size of the term is fixed by its shapes: `{v}` becomes the form itself.
    pub(crate) free_strength: bool,
    /// Symbol of its strength.
    pub(crate) symbol: &'static str,
    /// Units of the parameters that it may enter; none: all.
    pub(crate) units: &'static [&'static str],
}

impl Term {
    /// Whether it remembers the way that its argument went, as play and hysteresis do.
    pub(crate) fn remembers_way(&self) -> bool {
        self.memories.iter().any(|m| m.sampled)
    }

    /// Whether it is a function of the factors of a product.
    pub(crate) fn is_of_product(&self) -> bool {
        ["{first}", "{second}"]
            .iter()
            .any(|factor| self.form.contains(factor))
    }
}

pub(in crate::explain::engine) const fn shape(
    symbol: &'static str,
    starts: Starts,
    positive: bool,
) -> Shape {
    Shape {
        symbol,
        starts,
        positive,
    }
}

pub(in crate::explain::engine) const fn curve(
    id: &'static str,
    port: Port,
    needs: Needs,
    form: &'static str,
    shapes: &'static [Shape],
) -> Term {
    Term {
        id,
        port,
        needs,
        form,
        memories: &[],
        shapes,
        free_strength: true,
        symbol: "c",
        units: &[],
    }
}

/// A memory that changes at samples only.
pub(super) const fn sampled(value: &'static str) -> Memory {
    Memory {
        rate: value,
        start: MemoryStart::Argument,
        sampled: true,
    }
}

/// What acts in place of an input.
pub(super) const fn in_place(
    id: &'static str,
    memories: &'static [Memory],
    shapes: &'static [Shape],
) -> Term {
    Term {
        memories,
        free_strength: false,
        symbol: "",
        ..curve(id, Port::Input, Needs::Anything, "{m} - {z}", shapes)
    }
}
