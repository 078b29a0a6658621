//! Renders one picture of a `.strivec` file on the CPU and writes it as PNG.
//!
//!     cargo run --release --example render_picture -- fixtures/v1/f32.strivec picture.png

use std::error::Error;

use strivec::container;
use strivec::geometry::Camera;
use strivec::measure::color_png;
use strivec::render::{CpuRenderer, Renderer};

/// Columns and rows.
const SIZE: [u32; 2] = [320, 240];

fn main() -> Result<(), Box<dyn Error>> {
    let usage = "usage: render_picture FILE PNG";
    let mut arguments = std::env::args().skip(1);
    let (file, output) = (arguments.next().ok_or(usage)?, arguments.next().ok_or(usage)?);

    let scene = container::decode(&std::fs::read(file)?)?;
    // From the front, slightly above, far enough that the bounds fill the picture. Model space is z up.
    let extent = scene.bounds.size().length();
    let position = scene.bounds.center() + extent * glam::DVec3::new(0.3, -1.1, 0.5);
    let camera = Camera::looking_at(SIZE, f64::from(SIZE[1]), position, scene.bounds.center(), glam::DVec3::Z);

    let picture = CpuRenderer::<f32>::new(&scene)?.render(&camera);
    let colors: Vec<[f32; 3]> = picture.pixels.iter().map(|pixel| pixel.color).collect();
    std::fs::write(output, color_png(SIZE, &colors)?)?;
    Ok(())
}
