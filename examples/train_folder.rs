//! Trains a scene on a folder of posed photographs, as `strivec train` does, and writes it as `.strivec`.
//!
//!     cargo run --release -- synth photographs --views 20 --size 64x64
//!     cargo run --release --example train_folder -- photographs scene.strivec
//!
//! The third argument is a file of settings, as `strivec train --print-config` prints them.

use std::error::Error;
use std::fmt::Display;
use std::path::Path;

use strivec::recipe::{Observer, ObserverError, Photographs, Recipe};
use strivec::train::{StepReport, TrainConfig, Trainer};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, output, settings @ ..] = arguments.as_slice() else {
        return Err("usage: train_folder DATASET FILE [SETTINGS.toml]".into());
    };
    let settings = settings.first().map_or(Ok(String::new()), std::fs::read_to_string)?;
    let recipe = Recipe::new(TrainConfig::from_toml(&settings, None)?);
    let trained = recipe.train_folder(Path::new(folder), &Photographs::default(), &mut Print)?;
    trained.write(Path::new(output), false, &mut Print)?;
    println!("{} parameters, {} bytes", trained.scene.nonzero_parameter_count(), trained.bytes.len());
    Ok(())
}

/// Prints messages, and the error of every hundredth step.
struct Print;

impl Observer for Print {
    fn message(&mut self, text: &dyn Display) {
        println!("{text}");
    }

    fn step(&mut self, _: &Trainer<'_>, report: &StepReport) -> Result<(), ObserverError> {
        if report.step.is_multiple_of(100) {
            println!("step {}: mean squared error {:.5}", report.step, report.mean_squared_error);
        }
        Ok(())
    }
}
