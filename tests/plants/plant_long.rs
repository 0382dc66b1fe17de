//! `explain` of long recordings, a part of which is searched, and of plants without states.

use crate::cart::explained_with;
use crate::folder::Folder;

const GAIN: &str = "model Gain
  parameter Real k(min=1, max=3) = 2;
  input Real u; output Real y;
equation
  y = k*u;
end Gain;
";

/// Samples of a limited gain; the input changes after so many of them.
fn limited(folder: &Folder, name: &str, samples: usize, held: usize) {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut rows = "t,u,y\n".to_owned();
    let mut u = 0.0;
    for k in 0..samples {
        if k % held == 0 {
            u = 2.0 * uniform();
        }
        let noise = 0.02 * (uniform() + uniform() + uniform());
        let y = (2.1 * u).clamp(-1.2, 1.2) + noise;
        rows.push_str(&format!("{},{u},{y}\n", 0.01 * k as f64));
    }
    folder.text(name, &rows);
}

#[test]
fn a_plant_without_states_is_explained() {
    let folder = Folder::new();
    let nothing_to_fit = GAIN
        .replace("  parameter Real k(min=1, max=3) = 2;\n", "")
        .replace("k*u", "2.1*u");
    for text in [GAIN, &nothing_to_fit] {
        folder.text("cart.mo", text);
        limited(&folder, "log.csv", 800, 10);
        let said = explained_with(&folder, "log.csv", &[]);
        assert_eq!(said["verdict"], "named", "{}", said["summary"]);
        let effect = said["effects"][0]["effect"].as_str().unwrap();
        assert!(
            ["input_saturation", "sensor_saturation"].contains(&effect),
            "{}",
            said["summary"]
        );
        assert!(
            !said["summary"].to_string().contains("searched"),
            "{}",
            said["summary"]
        );
    }
}

#[test]
fn long_recordings_are_searched_in_a_part_and_fitted_whole() {
    let folder = Folder::new();
    folder.text("cart.mo", GAIN);
    for (held, which) in [
        (300, "5000 of 15000 samples, one in 3;"),
        (
            1,
            "5000 of 15000 samples, in one stretch of each recording;",
        ),
    ] {
        limited(&folder, "log.csv", 15_000, held);
        let said = explained_with(&folder, "log.csv", &[]);
        assert_eq!(said["verdict"], "named", "{}", said["summary"]);
        let summary = said["summary"].to_string();
        assert!(summary.contains(which), "{summary}");
        // The noise has a deviation of 0.01, and 43 % of the samples are beyond the limit: the mean of those of 15 000 samples is
        // known to 1.2e-4, that of 5000 samples to 2.2e-4.
        let limits = said["effects"][0]["parameters"].as_object().unwrap();
        let std = limits.values().next().unwrap()["std"].as_f64().unwrap();
        assert!((1e-4..1.6e-4).contains(&std), "{limits:?}");
        assert_eq!(said["recordings"][0]["samples"], 15_000);
    }
}
