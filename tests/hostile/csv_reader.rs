//! The reader of recordings: any bytes, under any roles, in any pieces.

use std::io::{Cursor, Read, Write};

use flate2::Compression;
use flate2::write::GzEncoder;
use innovant::log::{Block, Log, LogReader, RoleNeed, Roles};

use super::bytes::Bytes;
use super::sound;

/// Text that means something to the reader.
const WORDS: [&str; 40] = [
    "t,u,y\n",
    "0,1,2\n",
    "1,2,3\n",
    "2,-1,0.5\n",
    ",",
    ";",
    "\t",
    "\n",
    "\r",
    "\r\n",
    "\"",
    "\"\"",
    " ",
    "#",
    "[",
    "]",
    "t [ms]",
    "time",
    "u",
    "y",
    "u1",
    "y2 [rad/s]",
    "0",
    "-1",
    "1e5",
    "1e400",
    "1e-400",
    "NaN",
    "inf",
    ".",
    "-",
    "+",
    "0x10",
    "1,5",
    "\u{feff}",
    "\u{0}",
    "é",
    "12345678901234567890",
    "0.1\n",
    "1:00:00",
];

/// How a piece of the file is made.
fn text(bytes: &mut Bytes) -> Vec<u8> {
    let mut text = Vec::new();
    while !bytes.is_empty() {
        match bytes.byte() {
            word @ 0..=159 => {
                text.extend_from_slice(WORDS[usize::from(word) % WORDS.len()].as_bytes())
            }
            // A long run of one thing: fields, digits, rows.
            160..=175 => {
                let word = bytes.one_of(&WORDS);
                let times = 1 << (bytes.byte() % 13);
                text.extend_from_slice(word.repeat(times).as_bytes());
            }
            176..=207 => {
                let (rows, step) = (usize::from(bytes.byte()), bytes.finite());
                for k in 0..rows {
                    text.extend_from_slice(
                        format!("{},{},{}\n", step * k as f64, k % 7, k % 3).as_bytes(),
                    );
                }
            }
            208..=231 => text.extend_from_slice(bytes.number().to_string().as_bytes()),
            _ => text.push(bytes.byte()),
        }
    }
    text
}

/// Gives a few bytes at a time, as a pipe may.
struct Dribble(Cursor<Vec<u8>>, usize);

impl Read for Dribble {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let most = buffer.len().min(self.1);
        self.0.read(&mut buffer[..most])
    }
}

/// First byte: what the rest is. Whatever is read is a recording, and the same in any pieces.
pub fn csv_reader(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let kind = bytes.byte();
    let (piece, damage) = (1 + usize::from(bytes.byte()), bytes.byte());
    let roles = roles(&mut bytes);
    let need = bytes.one_of(&[
        RoleNeed::Identify,
        RoleNeed::InputsOnly,
        RoleNeed::OutputsOnly,
        RoleNeed::InputsAndMaybeOutputs,
    ]);
    let mut file = if kind & 1 == 0 {
        bytes.rest().to_vec()
    } else {
        text(&mut bytes)
    };
    if kind & 2 == 2 {
        let utf16: Vec<u8> = String::from_utf8_lossy(&file)
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        file = [vec![0xFF, 0xFE], utf16].concat();
    }
    if kind & 4 == 4 {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(&file).expect("a vector takes everything");
        file = encoder.finish().expect("a vector takes everything");
        if damage > 127 {
            let at = usize::from(damage) % file.len();
            file[at] ^= 0x55;
        }
    }
    if kind & 8 == 8 {
        file.truncate(file.len() - file.len().min(usize::from(damage)));
    }
    let whole = read(Cursor::new(file.clone()), &roles, need);
    let pieces = read(Dribble(Cursor::new(file), piece), &roles, need);
    match (&whole, &pieces) {
        (Ok(a), Ok(b)) => assert_eq!(a, b),
        // Damage may be met before or after what it made of the columns.
        (Err(_), Err(_)) if kind & 4 == 4 && (kind & 8 == 8 || damage > 127) => {}
        (Err(a), Err(b)) => assert_eq!(a, b),
        _ => panic!("other pieces, another answer: {whole:?} and {pieces:?}"),
    }
}

fn roles(bytes: &mut Bytes) -> Roles {
    let names = ["u", "y", "u1", "1", "2", "t", "", "Y2 [rad/s]", "[", "time"];
    let list = |bytes: &mut Bytes| {
        let count = bytes.below(4);
        (0..count)
            .map(|_| bytes.one_of(&names).to_owned())
            .collect()
    };
    if bytes.byte() < 160 {
        return Roles::default();
    }
    Roles {
        inputs: bytes.maybe(list),
        outputs: bytes.maybe(list),
        time: bytes.maybe(|bytes| bytes.one_of(&names).to_owned()),
        sample_time: bytes.maybe(Bytes::number),
        ..Roles::default()
    }
}

fn read(reader: impl Read + Send + 'static, roles: &Roles, need: RoleNeed) -> Result<Log, String> {
    let opened = LogReader::from_reader("run.csv", reader, roles, need);
    let collected = opened.and_then(|mut reader| {
        // After its end or an error a reader gives nothing more.
        let mut block = Block::new();
        let mut columns: Vec<Vec<f64>> =
            vec![Vec::new(); reader.inputs().len() + reader.outputs().len()];
        loop {
            match reader.next_block(&mut block) {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => {
                    assert!(matches!(reader.next_block(&mut block), Ok(false)));
                    return Err(error);
                }
            }
            for (column, more) in columns.iter_mut().zip(&block.columns) {
                column.extend_from_slice(more);
            }
        }
        let (inputs, outputs) = (reader.inputs().to_vec(), reader.outputs().to_vec());
        let summary = reader.finish()?;
        let output_data = columns.split_off(inputs.len());
        let log = Log {
            name: summary.name,
            sample_time: summary.sample_time,
            start_time: summary.start_time,
            inputs,
            outputs,
            input_data: columns,
            output_data,
            sha256: Some(summary.sha256),
        };
        assert_eq!(log.samples(), summary.samples);
        Ok(log)
    });
    match collected {
        Ok(log) => {
            sound::log(&log);
            Ok(log)
        }
        Err(error) => {
            sound::refusal(&error);
            Err(error.to_string())
        }
    }
}
