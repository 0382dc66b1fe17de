//! Tables out, and back in.

use std::fs;
use std::path::Path;

use proptest::prelude::*;

use super::{fails, read};
use crate::log::*;

fn sample_log() -> Log {
    let (u, y) = (Channel::parse("u, left [N]"), Channel::parse("y"));
    let data = vec![1.0, -0.1, 1e-7, 1e300];
    Log::from_columns(
        "made",
        0.1,
        vec![u],
        vec![y],
        vec![data.clone()],
        vec![data],
    )
    .unwrap()
}

#[test]
fn a_log_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["out.csv", "out.csv.gz"] {
        let path = folder.path().join(name);
        let mut log = sample_log();
        log.start_time = 3.0;
        log.write_csv(&path).unwrap();
        let back = Log::read(&Source::from(path.clone()), &Roles::default()).unwrap();
        assert_eq!((back.sample_time, back.start_time), (0.1, 3.0));
        assert_eq!((back.inputs, back.outputs), (log.inputs, log.outputs));
        assert_eq!(
            (back.input_data, back.output_data),
            (log.input_data, log.output_data)
        );
        assert_eq!(
            fs::read(&path).unwrap().starts_with(&[0x1F, 0x8B]),
            name.ends_with("gz")
        );
    }
    sample_log()
        .write_csv(&folder.path().join("out.csv"))
        .unwrap();
    let text = fs::read_to_string(folder.path().join("out.csv")).unwrap();
    assert_eq!(
        text,
        "t [s],\"u, left [N]\",y\n0,1,1\n0.1,-0.1,-0.1\n0.2,1e-7,1e-7\n0.3,1e300,1e300\n"
    );
}

#[test]
fn blocks_and_the_whole_write_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let log = read(&super::long_csv(1000)).unwrap();
    let (whole, blocks) = (
        folder.path().join("whole.csv"),
        folder.path().join("blocks.csv"),
    );
    log.write_csv(&whole).unwrap();
    let channels = || log.inputs.iter().chain(&log.outputs);
    let mut writer =
        CsvWriter::create(&blocks, log.sample_time, log.start_time, channels()).unwrap();
    for from in (0..1000).step_by(300) {
        let to = (from + 300).min(1000);
        writer
            .write_block(&[&log.input_data[0][from..to], &log.output_data[0][from..to]])
            .unwrap();
    }
    fails(
        writer.write_block(&[vec![1.0]]),
        &["blocks.csv", "1 data columns where 2"],
    );
    fails(
        writer.write_block(&[vec![1.0], vec![]]),
        &["blocks.csv", "column `y [rad]` has 0 samples"],
    );
    assert!(!blocks.exists());
    writer.finish().unwrap();
    assert_eq!(fs::read(whole).unwrap(), fs::read(blocks).unwrap());
}

#[test]
fn a_file_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.json");
    write_file_atomically(&path, b"old").unwrap();
    write_file_atomically(&path, b"new").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    let writer = CsvWriter::create(&path, 1.0, 0.0, &[Channel::new("u")]).unwrap();
    drop(writer);
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        1,
        "no temporary file is left"
    );
}

#[test]
fn places_that_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing").join("out.csv");
    fails(
        sample_log().write_csv(&missing),
        &["missing/out.csv: cannot write"],
    );
    fails(write_file_atomically(&missing, b""), &["missing/out.csv"]);
    fails(
        write_file_atomically(folder.path(), b""),
        &["cannot write", "directory"],
    );
    let asked = CsvWriter::create(&folder.path().join("x.csv"), 0.0, 0.0, &[Channel::new("u")]);
    fails(asked.map(|_| ()), &["sample time"]);
}

#[cfg(unix)]
#[test]
fn permissions_and_links_are_ordinary() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    let (ours, ordinary) = (folder.path().join("ours"), folder.path().join("ordinary"));
    write_file_atomically(&ours, b"x").unwrap();
    fs::write(&ordinary, b"x").unwrap();
    assert_eq!(mode(&ours), mode(&ordinary));
    fs::set_permissions(&ours, fs::Permissions::from_mode(0o640)).unwrap();
    let link = folder.path().join("link");
    symlink(&ours, &link).unwrap();
    write_file_atomically(&link, b"y").unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(
        (fs::read(&ours).unwrap(), mode(&ours)),
        (b"y".to_vec(), 0o640)
    );
    fs::set_permissions(&ours, fs::Permissions::from_mode(0o440)).unwrap();
    fails(
        write_file_atomically(&ours, b"z"),
        &["ours: cannot write", "permission"],
    );
    write_file_atomically(Path::new("/dev/null"), b"gone").unwrap();
}

#[test]
fn columns_are_checked() {
    let (u, y) = (|| vec![Channel::new("u")], || vec![Channel::new("y")]);
    let make = |dt, input: Vec<Vec<f64>>, output: Vec<Vec<f64>>| {
        Log::from_columns("made", dt, u(), y(), input, output)
    };
    fails(
        make(-1.0, vec![vec![1.0]], vec![vec![1.0]]),
        &["sample time", "-1"],
    );
    fails(
        make(1.0, vec![vec![1.0]], vec![vec![1.0, 2.0]]),
        &["made: column `y` has 2 samples", "1"],
    );
    fails(
        make(1.0, vec![vec![1.0, f64::NAN]], vec![vec![1.0, 2.0]]),
        &["made: column `u`, sample 1", "NaN"],
    );
    fails(
        make(1.0, vec![], vec![vec![1.0]]),
        &["made: 0 input columns where 1"],
    );
    fails(make(1.0, vec![vec![]], vec![vec![]]), &["made: 0 samples"]);
}

#[test]
fn a_log_is_split() {
    let log = sample_log();
    let (head, tail) = log.split_at(3).unwrap();
    assert_eq!((head.samples(), tail.samples()), (3, 1));
    assert_eq!(tail.input_data[0], [1e300]);
    assert!((tail.start_time - 0.3).abs() < 1e-15);
    assert_eq!(head.name, "made [samples 0 to 2]");
    fails(log.split_at(0), &["made", "4 samples", "sample 0"]);
    fails(log.split_at(4), &["sample 4"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_number_is_read_back(
        bits in prop::collection::vec(any::<u64>(), 2..200),
        nice in prop::collection::vec(-1e6..1e6_f64, 200),
        sample_time in 1e-6..1e3_f64,
    ) {
        let wild: Vec<f64> = bits.iter().map(|b| f64::from_bits(*b)).map(|x| if x.is_finite() { x } else { -0.0 }).collect();
        let nice = nice[..wild.len()].to_vec();
        let (u, y) = (vec![Channel::new("u")], vec![Channel::new("y")]);
        let log = Log::from_columns("made", sample_time, u, y, vec![wild], vec![nice]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("made.csv");
        log.write_csv(&path).unwrap();
        let back = Log::read(&Source::from(path), &Roles::default()).unwrap();
        let bits = |data: &[Vec<f64>]| data.concat().into_iter().map(f64::to_bits).collect::<Vec<_>>();
        prop_assert_eq!(bits(&back.input_data), bits(&log.input_data));
        prop_assert_eq!(bits(&back.output_data), bits(&log.output_data));
        prop_assert!((back.sample_time / sample_time - 1.0).abs() < 1e-14);
    }
}
