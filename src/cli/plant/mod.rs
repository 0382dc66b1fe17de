//! Commands on a plant in equations, and how its text and recordings are loaded.

pub(crate) mod identify_plant;
mod load_plant;
pub(crate) mod show_plant;
pub(crate) mod simulate_plant;
mod units_of_logs;

pub(crate) use identify_plant::{HoldFlag, StructureFlags, write_and_tell};
pub(crate) use load_plant::{
    all_known, channels, is_plant_file, kept_missing, load, read_recordings, read_with,
    tell_warnings,
};
pub(crate) use show_plant::PlantShowFlags;
pub(crate) use simulate_plant::{PlantRun, Start};
pub(crate) use units_of_logs::units_of_logs;
