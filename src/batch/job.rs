//! One log: the model that is there already, or a new one.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::time::Instant;

use sha2::{Digest, Sha256};

use super::Batch;
use super::row::{Row, Status};
use crate::identify::{IdentifyError, on_files};
use crate::log::{LogError, Source, write_file_atomically};
use crate::report::{DocumentError, ModelDocument, ReadModel, Request, read_model};
use crate::validate::{TestedModel, identify_and_test};

/// Bytes hashed at a time.
const BUFFER: usize = 1 << 16;

/// The row of one log; whatever goes wrong is told in it.
pub(super) fn run(log: &Path, model: &Path, batch: &Batch) -> Row {
    let started = Instant::now();
    let request = Request::new(&batch.options, &batch.roles);
    let row = match kept(log, model, &request).filter(|_| !batch.again) {
        Some(read) => Row::of_model(
            log,
            Status::Kept,
            &read.model,
            read.document.residual_tests(),
        ),
        None => match identified(log, model, batch, request) {
            Ok(tested) => Row::of_model(
                log,
                Status::Identified,
                &tested.model,
                tested.tests.as_ref(),
            ),
            Err(failure) => {
                // What an earlier content of this log left is not the model of this one.
                if failure.of_content {
                    let _ = fs::remove_file(model);
                }
                Row::failed(log, failure.message)
            }
        },
    };
    Row {
        seconds: started.elapsed().as_secs_f64(),
        ..row
    }
}

/// The model that was made from these bytes as asked; `None` when there is none, or it cannot be read.
fn kept(log: &Path, model: &Path, request: &Request) -> Option<ReadModel> {
    // Looked at first: a log need not be read where no model is.
    fs::metadata(model).ok()?;
    let read = read_model(model).ok()?;
    let provenance = read.document.provenance.as_ref()?;
    if provenance.request.as_ref() != Some(request)
        || provenance.version != env!("CARGO_PKG_VERSION")
    {
        return None;
    }
    // A log that was split has several recordings, of one hash.
    let sha256 = provenance.recordings.first()?.sha256.clone()?;
    if provenance
        .recordings
        .iter()
        .any(|r| r.sha256.as_ref() != Some(&sha256))
    {
        return None;
    }
    (sha256_of(log).ok()? == sha256).then_some(read)
}

fn identified(
    log: &Path,
    model: &Path,
    batch: &Batch,
    request: Request,
) -> Result<TestedModel, Failure> {
    let source = [Source::from(log.to_owned())];
    let (tested, _) = on_files(&source, &batch.roles, None, &mut |records| {
        identify_and_test(records, &batch.options)
    })?;
    let document = ModelDocument::new(&tested.model)?
        .with_residual_tests(tested.tests.clone())
        .with_request(request);
    let text = document.to_json()?;
    write_file_atomically(model, text.as_bytes())?;
    Ok(tested)
}

/// Why a log has no model.
struct Failure {
    message: String,
    /// Whether it is because of what the log says. A disk that is full, a file that is away for a while or too little
    /// memory say nothing about a model that is there from before.
    of_content: bool,
}

impl From<LogError> for Failure {
    fn from(error: LogError) -> Self {
        Self {
            of_content: !error.is_of_system(),
            message: error.to_string(),
        }
    }
}

impl From<IdentifyError> for Failure {
    fn from(error: IdentifyError) -> Self {
        match error {
            IdentifyError::Log(error) => error.into(),
            error => Self {
                of_content: !matches!(error, IdentifyError::Limit(_)),
                message: error.to_string(),
            },
        }
    }
}

impl From<DocumentError> for Failure {
    fn from(error: DocumentError) -> Self {
        Self {
            message: error.to_string(),
            of_content: true,
        }
    }
}

/// SHA-256 of the bytes of a file, hexadecimal, as [`crate::identify::Recording`] has it.
fn sha256_of(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; BUFFER];
    loop {
        let count = io::Read::read(&mut file, &mut buffer)?;
        if count == 0 {
            break;
        }
        hash.update(&buffer[..count]);
    }
    Ok(hash.finalize().iter().map(|b| format!("{b:02x}")).collect())
}
