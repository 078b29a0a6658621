//! Trains a scene on a folder of posed photographs and writes it as `.strivec`.
//!
//!     cargo run --release -- synth photographs --views 20 --size 64x64
//!     cargo run --release --example train_folder -- photographs scene.strivec 500

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

use strivec::container::{self, EncodeOptions, Encoding};
use strivec::dataset::{self, LoadOptions};
use strivec::train::{TrainConfig, Trainer, place_scene, reconstruct_prior};

fn main() -> Result<(), Box<dyn Error>> {
    let usage = "usage: train_folder DATASET FILE STEPS";
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or(usage)?;
    let output = arguments.next().ok_or(usage)?;
    let steps: u64 = arguments.next().ok_or(usage)?.parse()?;

    let dataset = dataset::load(Path::new(&folder), "train", &LoadOptions::default())?;
    let mut config = TrainConfig::preset("per-ray")?.with_steps(steps);
    config.sampling.batch_rays = 512;

    // Where the scene is: a coarse reconstruction from the photographs (paper 3.3).
    let occupied = reconstruct_prior(&config, &dataset, &mut |_| ControlFlow::Continue(()))?;
    println!("{} occupied voxels", occupied.cells.len());

    let scene = place_scene(&config, &dataset, &occupied)?;
    let mut trainer = Trainer::new(config, scene, &dataset.views)?;
    while trainer.steps_done() < steps {
        let report = trainer.step()?;
        if trainer.steps_done() % 100 == 0 {
            println!("step {}: mean squared error {:.5}", trainer.steps_done(), report.mean_squared_error);
        }
    }
    std::fs::write(output, container::encode(&trainer.scene(), &EncodeOptions::uniform(Encoding::F16))?)?;
    Ok(())
}
