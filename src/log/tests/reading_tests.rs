//! What is accepted, and that it is the same however it comes.

use std::io::{Cursor, Write};

use proptest::prelude::*;

use super::{Drip, fails, gzip, long_csv, read, read_as, roles};
use crate::log::*;

const PLAIN: &str = "t,u,y\n0,1,2.5\n0.5,-3,4e-1\n1,0.25,+5\n";

fn same_numbers(csv: &str) {
    let (log, plain) = (
        read(csv).unwrap_or_else(|error| panic!("{csv:?}: {error}")),
        read(PLAIN).unwrap(),
    );
    assert_eq!(log.input_data, plain.input_data, "{csv:?}");
    assert_eq!(log.output_data, plain.output_data, "{csv:?}");
    assert_eq!(log.sample_time, 0.5, "{csv:?}");
}

#[test]
fn a_table_that_was_written_with_its_index() {
    let dates =
        "2024-01-01 00:00:00,1,2.5\n2024-01-01 00:00:00.5,-3,4e-1\n2024-01-01 00:00:01,0.25,+5\n";
    same_numbers(&format!(",u,y\n{dates}"));
    same_numbers(&format!("Unnamed: 0,u,y\n{dates}"));
    same_numbers(&PLAIN.replacen('t', "", 1));
    // A count of rows is no time.
    let counted = ",u,y\n0,1,2\n1,2,3\n2,3,4\n";
    fails(read(counted), &["no time column", "(no name)", "--dt"]);
}

#[test]
fn forms_of_the_same_table() {
    same_numbers(PLAIN);
    same_numbers(&PLAIN.replace('\n', "\r\n"));
    same_numbers(&format!("\u{FEFF}{PLAIN}"));
    same_numbers(&PLAIN.replace(',', ";"));
    same_numbers(&PLAIN.replace(',', "\t"));
    same_numbers(&PLAIN.replace(',', " , "));
    same_numbers(&PLAIN.replace(',', ",\t"));
    same_numbers(PLAIN.trim_end());
    same_numbers(&PLAIN.trim_end().replace('\n', "\r\n"));
    same_numbers(&format!("{PLAIN}\n\n  \n\r\n"));
    same_numbers(&format!("# made by a logger\n\n#, more\n{PLAIN}"));
    same_numbers("\"t\",\"u\",\"y\"\n\"0\",\"1\",\"2.5\"\n0.5, \"-3\" ,0.4\n1,\" 0.25\",5\n");
    same_numbers("t,note,u,y\n0,,1,2.5\n0.5,\"a, \"\"b\"\"\",-3,4e-1\n1,x y,0.25,5\n");
    same_numbers("y,u,t,\n2.5,1,0,\n.4,-3,.5,\n5.,0.25,1,\n");
    same_numbers("T,U,Y\n0,1,2.5\n0.5,-3,4e-1\n1,0.25,+5\n");
    same_numbers(
        "t,u [m,s],y\n0,1,2.5\n0.5,-3,4e-1\n1,0.25,+5\n"
            .replace("u [m,s]", "\"u [m,s]\"")
            .as_str(),
    );
}

#[test]
fn units_names_and_order() {
    let log = read_as(
        "time [s],force [N],Pos[m] ,vel\n0,1,2,3\n1,4,5,6\n",
        &roles("FORCE", "vel,pos [m]"),
    )
    .unwrap();
    assert_eq!(log.inputs, [Channel::parse("force [N]")]);
    assert_eq!(
        log.outputs
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>(),
        ["vel", "Pos [m]"]
    );
    assert_eq!(log.output_data, [[3.0, 6.0], [2.0, 5.0]]);
    // The case asked for wins over others, and the unit picks one of two.
    let log = read_as(
        "t,a,A,b [V],b [A]\n0,1,2,3,4\n1,1,2,3,4\n",
        &roles("A", "b [A]"),
    )
    .unwrap();
    assert_eq!((log.input_data[0][0], log.output_data[0][0]), (2.0, 4.0));
    // What is asked for as one role is not taken for another.
    let log = read_as("t,u1,u2,y\n0,1,2,3\n1,1,2,3\n", &roles("", "u2")).unwrap();
    assert_eq!(log.inputs, [Channel::new("u1")]);
    let log = read_as(
        "0,1,2\n1,2,3\n",
        &Roles {
            time: Some("1".into()),
            ..roles("2", "3")
        },
    )
    .unwrap();
    assert_eq!(
        (log.inputs[0].name.as_str(), log.samples(), log.sample_time),
        ("2", 2, 1.0)
    );
}

#[test]
fn needs_decide_what_is_read() {
    let open = |csv: &'static str, roles: &Roles, need| {
        LogReader::from_reader("run.csv", csv.as_bytes(), roles, need)
    };
    let csv = "t,u,y1,y2\n0,1,2,x\n1,1,2,x\n";
    let reader = open(csv, &Roles::default(), RoleNeed::InputsOnly).unwrap();
    assert_eq!((reader.inputs().len(), reader.outputs().len()), (1, 0));
    assert_eq!(reader.finish().unwrap().samples, 2);
    let reader = open(csv, &roles("", "y1"), RoleNeed::OutputsOnly).unwrap();
    assert_eq!((reader.inputs().len(), reader.outputs().len()), (0, 1));
    let free = RoleNeed::OutputsAndMaybeInputs;
    let inputs = |csv, roles: &Roles| open(csv, roles, free).map(|r| r.inputs().len());
    assert_eq!(inputs("t,y\n0,1\n1,2\n", &Roles::default()).unwrap(), 0);
    assert_eq!(
        inputs("t,u,y\n0,1,1\n1,1,2\n", &Roles::default()).unwrap(),
        1
    );
    let left = "t,a,y\n0,1,1\n1,1,2\n";
    let error = inputs(left, &Roles::default()).unwrap_err().to_string();
    assert!(error.contains("`--inputs none`"), "{error}");
    assert_eq!(inputs(left, &roles("none", "y")).unwrap(), 0);
    let called_so = "t,none,y\n0,1,1\n1,1,2\n";
    assert_eq!(inputs(called_so, &roles("none", "y")).unwrap(), 1);
    let maybe = RoleNeed::InputsAndMaybeOutputs;
    assert_eq!(
        open(csv, &roles("u", "y1,y2"), maybe)
            .unwrap()
            .outputs()
            .len(),
        2
    );
    assert_eq!(
        open(csv, &roles("u", "y1,y3"), maybe)
            .unwrap()
            .outputs()
            .len(),
        0
    );
    assert_eq!(
        open("t,u\n0,1\n", &Roles::default(), maybe)
            .unwrap()
            .outputs()
            .len(),
        0
    );
    assert!(open("t,y\n0,1\n", &roles("u", "y"), maybe).is_err());
    let model = Roles::named(&[Channel::parse("u [V]")], &[Channel::new("y2")]);
    assert_eq!(
        open(csv, &model, RoleNeed::Identify).unwrap().outputs()[0].name,
        "y2"
    );
}

#[test]
fn pieces_of_any_size_read_the_same() {
    for csv in [
        long_csv(20_000),
        long_csv(3),
        PLAIN.replace('\n', "\r\n"),
        format!("\u{FEFF}{PLAIN}"),
    ] {
        let (whole, csv) = (read(&csv).unwrap(), csv.into_bytes());
        assert_eq!(
            Log::from_reader("run.csv", Drip::new(&csv), &Roles::default()).unwrap(),
            whole
        );
        let packed = gzip(&csv);
        let unpacked = Log::from_reader("run.csv", Drip::new(&packed), &Roles::default()).unwrap();
        assert_eq!(
            (&unpacked.input_data, &unpacked.output_data),
            (&whole.input_data, &whole.output_data)
        );
        assert_ne!(unpacked.sha256, whole.sha256);
    }
}

#[test]
fn blocks_hold_what_the_file_has() {
    for rows in [
        1,
        2,
        BLOCK_ROWS - 1,
        BLOCK_ROWS,
        BLOCK_ROWS + 1,
        3 * BLOCK_ROWS,
    ] {
        let asked = Roles {
            sample_time: Some(0.01),
            ..Roles::default()
        };
        let bytes = Cursor::new(long_csv(rows).into_bytes());
        let mut reader =
            LogReader::from_reader("run.csv", bytes, &asked, RoleNeed::Identify).unwrap();
        let (mut block, mut next) = (Block::new(), 0);
        while reader.next_block(&mut block).unwrap() {
            assert_eq!(block.columns.len(), 2);
            assert!(
                !block.is_empty()
                    && block
                        .columns
                        .iter()
                        .all(|column| column.len() == block.len())
            );
            for (u, y) in block.columns[0].iter().zip(&block.columns[1]) {
                let k = next as f64;
                assert!((u - (k * 0.37).sin()).abs() <= 5e-7);
                assert_eq!(*y, (k * 0.11).cos() * 1e-3);
                next += 1;
            }
        }
        assert_eq!(next, rows);
        assert!(!reader.next_block(&mut block).unwrap() && block.is_empty());
        assert_eq!(reader.finish().unwrap().samples, rows);
    }
}

#[test]
fn the_summary_is_of_the_raw_bytes() {
    let reader = LogReader::from_reader(
        "run.csv",
        PLAIN.as_bytes(),
        &Roles::default(),
        RoleNeed::Identify,
    )
    .unwrap();
    let summary = reader.finish().unwrap();
    assert_eq!(
        (summary.name.as_str(), summary.samples, summary.bytes),
        ("run.csv", 3, PLAIN.len() as u64)
    );
    use sha2::Digest;
    let expected: String = sha2::Sha256::digest(PLAIN)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    assert_eq!(summary.sha256, expected);
}

/// A buffered logger writes blocks that end anywhere, also within a number of the last column.
#[test]
fn a_line_that_is_still_being_written_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let long = long_csv(100_000);
    for (text, cut) in [(PLAIN, 1), (PLAIN, 2), (PLAIN, 4), (&long, 3), (&long, 1)] {
        let path = folder.path().join("log.csv");
        std::fs::write(&path, &text[..text.len() - cut]).unwrap();
        let open = || {
            let source = Source::Path(path.clone());
            LogReader::open(&source, &Roles::default(), RoleNeed::Identify).unwrap()
        };
        let whole = text.lines().count() - 1;
        // Nobody writes: the line is taken for whole if it can be one.
        let left = open().finish().map(|summary| summary.samples);
        assert!(left.is_err() || left.unwrap() == whole);
        let reader = open();
        let mut file = std::fs::File::options().append(true).open(&path).unwrap();
        let rest = format!("{}3,1,1\n4,", &text[text.len() - cut..]);
        file.write_all(rest.as_bytes()).unwrap();
        let summary = reader.finish().unwrap();
        assert_eq!(
            (summary.samples, summary.bytes),
            (whole - 1, (text.len() - cut) as u64)
        );
    }
}

#[test]
fn joined_gzip_members_are_one_file() {
    let (head, tail) = PLAIN.split_at(17);
    let packed = [gzip(head.as_bytes()), gzip(tail.as_bytes())].concat();
    let bytes = packed.len() as u64;
    let reader = LogReader::from_reader(
        "-",
        Cursor::new(packed),
        &Roles::default(),
        RoleNeed::Identify,
    )
    .unwrap();
    let summary = reader.finish().unwrap();
    assert_eq!((summary.samples, summary.bytes), (3, bytes));
}

#[test]
fn headers_hold_units() {
    for (header, name, unit) in [
        ("force [N]", "force", Some("N")),
        ("force[rad/s]", "force", Some("rad/s")),
        (" x ", "x", None),
        ("a [1] b", "a [1] b", None),
        ("a [1] [m]", "a [1]", Some("m")),
        ("[N]", "[N]", None),
        ("x []", "x", None),
    ] {
        let channel = Channel::parse(header);
        assert_eq!(
            (channel.name.as_str(), channel.unit.as_deref()),
            (name, unit)
        );
        assert_eq!(Channel::parse(&channel.to_string()), channel);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(5_000))]

    #[test]
    fn no_text_makes_the_reader_panic(text in "(t|u|y|0|1|,|;|\\.|\"|-|e| |\t|\r|\n|#|\\[|\\]|\u{FEFF}|\u{0}|é){0,60}") {
        let _ = read(&text);
        let _ = read(&format!("t,u,y\n0,1,2\n{text}"));
        let _ = read_as(&text, &Roles { sample_time: Some(1.0), ..roles("u,1", "y") });
    }

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), gzip in any::<bool>()) {
        let bytes = if gzip { [vec![0x1F, 0x8B, 8], bytes].concat() } else { bytes };
        let _ = Log::from_reader("run.csv", Cursor::new(bytes), &Roles::default());
    }
}
