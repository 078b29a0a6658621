//! `strivec prior`, and what other commands take of priors from files.

mod inputs;

pub(super) use inputs::Inputs;
