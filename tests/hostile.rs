//! The targets of `fuzz/` with drawn bytes, and what fuzzing has found.
//!
//! `fuzz/run.sh` searches longer, led by coverage and under the address sanitizer.

#[path = "hostile/mod.rs"]
mod hostile;

use proptest::prelude::*;

fn bytes(most: usize) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(any::<u8>(), 0..most)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn any_file_is_a_recording_or_refused(bytes in bytes(120)) {
        hostile::csv_reader(&bytes);
    }

    #[test]
    fn any_document_is_a_model_or_refused(bytes in bytes(120)) {
        hostile::model_json(&bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn any_document_is_an_explanation_or_refused(bytes in bytes(160)) {
        hostile::explanation_json(&bytes);
    }

    #[test]
    fn any_small_log_is_identified_or_refused(bytes in bytes(240)) {
        hostile::identify(&bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn any_small_log_is_explained_or_refused(bytes in bytes(160)) {
        hostile::explain(&bytes);
    }
}
