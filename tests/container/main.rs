//! The `.strivec` file: what is written comes back, and nothing else passes for a file.

mod allocation;
mod damage;
mod finite;
mod hostile;
mod mutation;
mod roundtrip;
mod scenes;
mod specification;
mod surgery;
