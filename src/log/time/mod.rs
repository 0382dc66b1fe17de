//! The time base.
//!
//! | file | one idea |
//! |---|---|
//! | `stamp`, `stamps` | a date; a time column |
//! | `sampling` | is the time base uniform, and what is its step |
//! | `stamped_rows` | what is known of the rows |
//! | `time_grid` | time stamps to a grid, repaired |
//! | `common_step` | a grid with a point at each of irregular times |
//! | `repair` | stamps that are coarse, repeated or out of order |
//! | `fill` | missing samples: bridged, or the recording is cut |
//! | `resample` | another rate |

mod common_step;
mod fill;
mod repair;
mod resample;
mod sampling;
mod stamp;
mod stamped_rows;
pub(crate) mod stamps;
pub(crate) mod time_grid;

pub(crate) use common_step::{FEW_ROWS, NEAR, common_step};
pub(crate) use fill::{Filled, SHORTEST, Tally, fill};
pub(crate) use resample::Resampling;
pub(crate) use sampling::{STEP_TOLERANCE, Sampling, readable, time_base};
pub(crate) use stamp::Format;
pub(crate) use stamped_rows::{Rows, counted};
pub(crate) use stamps::Origin;
pub(crate) use stamps::{Stamps, check_sample_time, first_look};
pub(crate) use time_grid::Piece;
