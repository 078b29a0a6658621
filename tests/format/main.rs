//! The `.strivec` file: round trips, and errors for everything that is not such a file.

mod allocation;
mod damage;
mod finite;
mod hostile;
mod mutation;
mod roundtrip;
mod scenes;
mod specification;
mod surgery;
