//! Where recording and equations differ: at which outputs, when, at which frequencies and operating points.

use super::{Answer, Verdict};
use crate::explain::document::plots::spectrum;
use crate::explain::explanation::Location;
use crate::explain::linear::answer::regions::{excess, frequencies, regimes, windows};
use crate::explain::linear::data::{Data, Segment, difference};
use crate::noise::Series;
use crate::physics::estimate::Form;

impl Answer<'_> {
    /// What the equations miss without the effects, measured by the noise that is left with them. `shows` is the output on which
    /// the effects act most.
    pub(super) fn location(
        &self,
        verdict: Verdict,
        recorded: &Series,
        only: &Series,
        shows: usize,
    ) -> Location {
        let equations = self.found.map.clone();
        if verdict == Verdict::Consistent {
            return Location {
                equations,
                ..Location::default()
            };
        }
        let names = |channels: Vec<(String, String)>| -> Vec<String> {
            channels.into_iter().map(|(name, _)| name).collect()
        };
        let outputs = names(self.outputs());
        let inputs: Vec<String> = self.plant.spec.names(&self.plant.spec.inputs());
        let data = self.data();
        let l = data.outputs;
        let mask = self.whole.mask();
        let known = |series: &Series| -> Series {
            let finite = |column: &Vec<f64>| -> Vec<f64> {
                let each = column.iter();
                each.map(|e| if e.is_finite() { *e } else { 0.0 }).collect()
            };
            series.iter().map(finite).collect()
        };
        // Both of the same kind: errors of free runs, or of one-step predictions.
        let (fit, baseline) = (&self.found.fit, &self.found.baseline);
        let before = match (fit.form, baseline.form) {
            (Form::Innovation, Form::Innovation) => self.base.residual(baseline),
            _ => None,
        };
        let before = before.unwrap_or_else(|| known(&difference(recorded, only)));
        let after = self.whole.residual(fit).unwrap_or_else(|| before.clone());
        let squares = excess(&before, &fit.noise, mask);
        let mut time = self.since();
        if time.is_empty() {
            time = (0..data.segments.len())
                .flat_map(|s| windows(&data, &squares, mask, s))
                .collect();
            time.sort_by(|a, b| b[2].total_cmp(&a[2]));
        }
        let power = |residual: &Series| spectrum(residual, l, shows, data.sample_time);
        Location {
            port: self.port(),
            time,
            frequency: frequencies(&power(&before), &power(&after)),
            regime: regimes(&data, only, &squares, mask, shows, (&inputs, &outputs)),
            outputs,
            equations,
            ..Location::default()
        }
    }

    /// From when on effects act that begin at an instant, to the end of the recordings.
    fn since(&self) -> Vec<[f64; 3]> {
        let ends = self.recordings.iter().map(|r| {
            let samples = r.outputs.first().map_or(0, Vec::len);
            r.start_time + samples as f64 * r.sample_time
        });
        let end = ends.fold(f64::NEG_INFINITY, f64::max);
        let instants = self.times_of_change();
        let parameters = self.found.plant.spec.parameters();
        let each = parameters.into_iter().zip(&self.found.fit.point);
        each.filter(|(v, _)| instants.contains(&self.found.plant.spec.variable(*v).name))
            .map(|(_, &from)| [from, end, 1.0])
            .collect()
    }

    fn data(&self) -> Data {
        let segment = |r: &crate::physics::estimate::PlantRecording| Segment {
            inputs: r.inputs.clone(),
            outputs: r.outputs.clone(),
            start_time: r.start_time,
        };
        let spec = &self.plant.spec;
        Data {
            segments: self.recordings.iter().map(segment).collect(),
            sample_time: self.recordings.first().map_or(1.0, |r| r.sample_time),
            inputs: spec.inputs().len(),
            outputs: spec.outputs().len(),
            constant: false,
        }
    }
}
