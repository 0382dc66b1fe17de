//! How sure an answer about a plant is.

use crate::explain::engine::thresholds::LEFT;
use crate::explain::explanation::Verdict;

/// Recordings with fewer values have few.
const FEW_VALUES: usize = 300;

/// How often answers like this one were right, by what tells most: how many effects are named, and whether score tests find
/// structure beside them. Single names without that were counted on 60 recordings of 23 classes of plants (`benches/physics_cases.py
/// --seed 5` and `--seed 6`, the first 30 of each), the others on 106 recordings of 55 classes, of which 20 are real and 44 the developers' own,
/// which these counts favour; one right and one wrong answer are added to each group. `docs/accuracy.md` has the check. Single names of
/// recordings with few values were counted on 14 real ones (bodies that fall, pendulums, motors, tanks, circuits, ovens, a culture): they
/// hold little, and real rigs differ from their equations in more than one way. Without a name it is the probability that something is
/// missing, or that nothing is.
pub(in crate::explain::plant_answer) fn probability(
    verdict: Verdict,
    effects: usize,
    p_value: f64,
    values: usize,
) -> f64 {
    let (right, all) = match verdict {
        Verdict::Named | Verdict::Family if effects > 1 => (5, 10),
        Verdict::Named | Verdict::Family if p_value < LEFT => (14, 23),
        Verdict::Named | Verdict::Family if values < FEW_VALUES => (7, 14),
        Verdict::Named | Verdict::Family => (27, 31),
        Verdict::Unexplained => (4, 4),
        Verdict::Consistent | Verdict::Parameters => (10, 11),
    };
    f64::from(right + 1) / f64::from(all + 2)
}
