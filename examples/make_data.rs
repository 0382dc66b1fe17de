//! Writes the recordings of `data/`: `cargo run --release --example make_data -- data`.
//!
//! A test compares the files with what this makes, so that each file is what its note says.

#[path = "../tests/support/data.rs"]
mod data;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "data".to_owned());
    for (name, csv) in data::recordings() {
        std::fs::write(std::path::Path::new(&folder).join(name), csv)?;
    }
    Ok(())
}
