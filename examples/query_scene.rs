//! Reads a `.strivec` file and evaluates its field at one point: density, and color seen from the front.
//!
//!     cargo run --release --example query_scene -- fixtures/v1/everything.strivec 0.1 0.2 0.3

use std::error::Error;

use glam::DVec3;
use strivec::container;
use strivec::model::ReferenceField;

fn main() -> Result<(), Box<dyn Error>> {
    let usage = "usage: query_scene FILE X Y Z";
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or(usage)?;
    let position = arguments.map(|text| text.parse()).collect::<Result<Vec<f64>, _>>()?;
    let [x, y, z] = position.try_into().map_err(|_| usage)?;

    let scene = container::decode(&std::fs::read(&file)?)?;
    println!(
        "{file}: {} scales, {} parameters, bounds {:?}",
        scene.scales.len(),
        scene.parameter_count(),
        scene.bounds
    );

    let field = ReferenceField::new(&scene);
    let point = field.locate(DVec3::new(x, y, z));
    if !point.covered {
        println!("no tensor covers ({x}, {y}, {z})");
        return Ok(());
    }
    let density = field.density(field.density_feature(&point).feature);
    println!("density {density:.6}");
    // Only a network that runs once a sample has a color at a point (spec 4.7).
    if scene.decoder.mode == strivec::model::DecoderMode::PerSample {
        let [red, green, blue] = field.decode(&field.appearance_features(&point), DVec3::NEG_Y);
        println!("sRGB color seen along -y: {red:.4} {green:.4} {blue:.4}");
    }
    Ok(())
}
