//! Troubles put into recordings of several plants, and ordinary recordings in which there are none.
