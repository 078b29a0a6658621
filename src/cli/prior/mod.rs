//! `strivec prior`, and what other commands take of priors from files.

mod inputs;
#[expect(dead_code, reason = "the command `strivec prior` is to run it")]
mod show;

pub(super) use inputs::Inputs;
