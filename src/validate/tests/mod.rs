//! Tests of the whole judgement.

mod false_alarms;
mod support;
