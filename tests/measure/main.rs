//! Tests of measure: one program, so that the crates are linked once.

mod pictures;
