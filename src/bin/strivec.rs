//! The command `strivec`.

fn main() {}
