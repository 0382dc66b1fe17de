//! How many states, and how much dead time.
//!
//! | file | step | source |
//! |---|---|---|
//! | `evidence` | singular values propose, a chi-square test referees | Bauer 2001 |
//! | `order_candidate`, `select_order` | each order estimated, polished and tested; the choice | |
//! | `free_run_order` | the order of a plant that is not linear: free runs on blocks held out | Breiman et al. 1984 |
//! | `dead_time` | inputs that do nothing for some samples | |

mod dead_time;
mod evidence;
mod free_run_order;
mod order_candidate;
mod select_order;

pub(crate) use dead_time::{Evidence, LEVEL};
pub use evidence::OrderEvidence;
pub(crate) use evidence::REFEREE_LEVEL;
pub use free_run_order::FreeRunRest;
pub(crate) use free_run_order::{FreeRun, by_free_run, many_states};
pub(crate) use order_candidate::{cost_p_value, polish_is_used};
pub(crate) use select_order::{Selection, Windowed, propose, select, windowed};
