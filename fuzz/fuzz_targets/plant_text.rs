#![no_main]

#[path = "../bound.rs"]
mod bound;

/// A plant in equations: read, its units checked, and, where it is one, simulated for a few samples.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match innovant::physics::parse(text) {
        Err(error) => assert!(!error.render("plant.mo", text).is_empty()),
        Ok(spec) => {
            let _ = innovant::physics::check_units(&spec);
            let plant = innovant::physics::Plant::new(spec);
            let column = [0.0, 1.0, -1.0, 0.5];
            let inputs: Vec<&[f64]> = plant.spec.inputs().iter().map(|_| column.as_slice()).collect();
            let excitation = innovant::physics::Excitation {
                inputs: &inputs,
                length: column.len(),
                sample_time: 0.1,
                start_time: 0.0,
                hold: innovant::physics::Hold::Zero,
            };
            let _ = plant.simulate(&plant.nominal(), &excitation, None);
        }
    }
});
