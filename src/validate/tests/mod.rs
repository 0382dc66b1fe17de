//! Tests of the whole judgement.

mod documents;
mod false_alarms;
mod power;
mod support;
