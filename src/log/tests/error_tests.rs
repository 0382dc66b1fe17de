//! Every error names the file, the line and the column, and says what to do.

use std::io::Cursor;

use super::{fails, gzip, read, read_as, roles};
use crate::log::*;

#[test]
fn cells_that_are_no_numbers() {
    let place = ["run.csv, line 3, column `u [V]`"];
    let with = |cell: &str| read(&format!("t,u [V],y\n0,1,2\n1,{cell},2\n2,1,2\n"));
    fails(with("abc"), &[place[0], "`abc` is not a number"]);
    fails(with("1.5x"), &[place[0], "`1.5x` is not a number"]);
    fails(with("0x10"), &[place[0], "not a number"]);
    for cell in ["inf", "-Infinity", "1e999"] {
        fails(
            with(cell),
            &[place[0], cell, "not a finite number", "two experiments"],
        );
    }
    let long = "x".repeat(100);
    fails(
        with(&long),
        &[place[0], &format!("`{}...`", "x".repeat(40))],
    );
    fails(with("u [V]"), &[place[0], "the header again"]);
}

#[test]
fn rows_of_another_length() {
    fails(
        read("t,u,y\n0,1,2\n1,2\n"),
        &["run.csv, line 3: 2 fields where the header has 3"],
    );
    fails(
        read("t,u,y\n0,1,2\n1,2,3,4\n"),
        &["line 3: 4 fields", "stray separator"],
    );
    fails(
        read("t,u,y\n0,1,2\n1,2"),
        &["line 3: 2 fields", "ends in the middle"],
    );
    fails(
        read("t,u,y\n0,0,1,5,2,5\n"),
        &["line 2: 6 fields", "decimals written with commas"],
    );
    fails(
        read("t,u,y\n0;1;2\n"),
        &["line 2: 1 fields", "another separator"],
    );
    let timeless = Roles {
        sample_time: Some(1.0),
        ..Roles::default()
    };
    fails(
        read_as("u,y\n1,2\n\n2,3\n", &timeless),
        &["run.csv, line 3: a blank line"],
    );
}

#[test]
fn files_without_data() {
    fails(read(""), &["run.csv", "empty", "t,u,y"]);
    fails(read("\n\n# only comments\n"), &["run.csv", "empty"]);
    fails(
        read("# a comment\nt,u,y\n"),
        &["run.csv", "no data", "line 2"],
    );
    fails(read("t,u,y"), &["no data", "line 1"]);
    fails(read("t,u,y\n\n\n"), &["no data"]);
    fails(
        read("t,u,y\n0,1,2\n"),
        &["run.csv: 1 samples", "at least 2", "--dt"],
    );
    fails::<()>(
        Err(LogError::too_short("run.csv", 9, 50, "order 4")),
        &["9 samples", "order 4 takes at least 50"],
    );
}

#[test]
fn files_that_are_not_csv() {
    let bytes =
        |bytes: &[u8]| Log::from_reader("run.bin", Cursor::new(bytes.to_vec()), &Roles::default());
    fails(bytes(b"t,u\0,y\n1,2,3\n"), &["run.bin, line 1", "NUL"]);
    fails(bytes(b"PK\x03\x04\x14\0\n"), &["Excel"]);
    fails(bytes(&[0; 3 << 20]), &["line 1", "NUL"]);
    fails(
        bytes(b"t,u,y\n0,1,2\n1,\0\0,3\n"),
        &["run.bin, line 3", "NUL"],
    );
    fails(bytes(&vec![b'1'; 3 << 20]), &["line 1", "1 MiB"]);
    let late = [b"t,u,y\n0,1,2\n".as_slice(), &vec![b'1'; 2 << 20]].concat();
    fails(bytes(&late), &["run.bin, line 3", "1 MiB"]);
    let whole = gzip(super::long_csv(5000).as_bytes());
    fails(
        bytes(&whole[..whole.len() / 2]),
        &["run.bin, after line ", "broken gzip", "gzip -t"],
    );
    let mut damaged = whole.clone();
    let middle = damaged.len() / 2;
    damaged[middle..middle + 64].fill(0xAA);
    fails(bytes(&damaged), &["broken gzip"]);
    fails(
        Log::read(&Source::from("/nowhere/run.csv"), &Roles::default()),
        &["/nowhere/run.csv", "cannot open"],
    );
    fails(
        Log::read(&Source::from("/tmp"), &Roles::default()),
        &["/tmp", "directory"],
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plain.csv.gz");
    std::fs::write(&path, "t,u,y\n0,1,2\n").unwrap();
    fails(
        Log::read(&Source::Path(path), &Roles::default()),
        &["plain.csv.gz", "broken gzip", "drop the `.gz`"],
    );
}

#[test]
fn roles_that_cannot_be_told() {
    let csv = "time,force [N],angle [rad]\n0,1,2\n1,2,3\n";
    let all = "`time`, `force [N]`, `angle [rad]`";
    fails(
        read(csv),
        &["run.csv", all, "`--inputs force --outputs angle`"],
    );
    fails(
        read("t,left wheel,y 2,pose\n"),
        &["no inputs", "--inputs a,b"],
    );
    fails(
        read("t,u,pose\n0,1,2\n"),
        &["no outputs", "`pose`", "--outputs c"],
    );
    fails(
        read("t,motor speed,pose\n0,1,2\n"),
        &["`--inputs 'motor speed' --outputs pose`"],
    );
    fails(read("t~u~y\n0~1~2\n"), &["`t~u~y`", "--inputs a,b"]);
    // Blanks separate as well.
    fails(read("t u y\n0 1 2\n"), &["1 samples", "--dt"]);
    fails(
        read("0,1,2\n1,2,3\n"),
        &[
            "no header",
            "`1`, `2`, `3`",
            "`--time 1 --inputs 2 --outputs 3`",
        ],
    );
    // Decimal commas: three columns, not six.
    fails(
        read("0,5;1,5;2,5\n"),
        &["the columns are `1`, `2`, `3` (", "no header"],
    );
    fails(read("0.5,,nan\n"), &["no header"]);
    fails(read_as(csv, &roles("force", "")), &["no outputs"]);
    fails(
        read_as(csv, &roles("forse", "angle")),
        &["no column `forse`", "did you mean `force [N]`", all],
    );
    fails(
        read_as(csv, &roles("current", "angle")),
        &["run.csv: no column `current`; the columns are", all],
    );
    fails(
        read_as(csv, &roles("force [lbf]", "angle")),
        &["no column `force [lbf]`", "`force [N]`"],
    );
    fails(
        read_as(csv, &roles("force", "angle,force")),
        &["`force [N]` is given twice", "as input and as output"],
    );
    fails(
        read_as(csv, &roles("time", "angle")),
        &["no time column", "--time", "--dt"],
    );
    let mut timed = roles("force", "angle");
    timed.time = Some("force".to_owned());
    fails(
        read_as(csv, &timed),
        &["given twice", "as input and as time"],
    );
    fails(
        read_as("0,1,2\n1,2,3\n", &roles("u", "y")),
        &["no column `u`", "by number"],
    );
    fails(
        read_as("0,1,2\n1,2,3\n", &roles("2", "3")),
        &["no time column"],
    );
    fails(
        read("t,u,u,y\n"),
        &["line 1: columns 2 and 3 are both called `u`"],
    );
    fails(
        read_as("t,a,a,y\n", &roles("a", "")),
        &["columns 2 and 3", "`a`"],
    );
    fails(
        read_as("t,a [V],a [A],y\n", &roles("a", "")),
        &["`a` may be any of `a [V]`, `a [A]`"],
    );
    fails(read_as("t,AB,Ab,y\n", &roles("ab", "")), &["`AB`, `Ab`"]);
    fails(read("u,y\n1,2\n"), &["no time column", "--dt"]);
}

#[test]
fn sample_times_that_cannot_be() {
    for sample_time in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let asked = Roles {
            sample_time: Some(sample_time),
            ..Roles::default()
        };
        fails(
            read_as("t,u,y\n0,1,2\n1,2,3\n", &asked),
            &["positive", "--dt 0.01"],
        );
    }
}

#[test]
fn experiments_that_do_not_belong_together() {
    let log = |csv: &str, name: &str| {
        Log::from_reader(
            name,
            Cursor::new(csv.as_bytes().to_vec()),
            &Roles::default(),
        )
    };
    let one = log("t,u [N],y\n0,1,2\n0.1,2,3\n", "one.csv").unwrap();
    let same = log("t,y [m],u [N]\n0,1,2\n0.1,2,3\n", "same.csv").unwrap();
    one.check_same_kind(&same).unwrap();
    let other = log("t,u2,y\n0,1,2\n0.1,2,3\n", "two.csv").unwrap();
    fails(
        one.check_same_kind(&other),
        &["two.csv: its inputs are `u2`", "`u`", "one.csv"],
    );
    let other = log("t,u [lbf],y\n0,1,2\n0.1,2,3\n", "two.csv").unwrap();
    fails(
        one.check_same_kind(&other),
        &["two.csv: column `u` is in `lbf`", "`N` in one.csv"],
    );
    let other = log("t,u [N],y\n0,1,2\n0.2,2,3\n", "two.csv").unwrap();
    fails(
        one.check_same_kind(&other),
        &["two.csv: the sample time is 0.2 s", "0.1 s in one.csv"],
    );
}

#[test]
fn errors_cross_threads_and_stay_small() {
    fn crosses<T: Send + Sync + std::error::Error + 'static>() {}
    crosses::<LogError>();
    assert!(std::mem::size_of::<LogError>() <= 128);
}
