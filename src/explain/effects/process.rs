//! Process plants: filled in below.

use super::Definition;

pub(super) static ENTRIES: &[Definition] = &[];
