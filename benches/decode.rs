//! Time to decode whole files, on one thread: `cargo bench --no-default-features --bench decode -- FILE...`

use std::time::Instant;

use strivec::container::{Limits, decode_scene_file};

/// Times that a file is decoded.
const RUNS: usize = 9;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files = std::env::args().skip(1).filter(|argument| !argument.starts_with("--"));
    for file in files {
        let bytes = std::fs::read(&file)?;
        let mut seconds: Vec<f64> = Vec::new();
        for _ in 0..RUNS {
            let start = Instant::now();
            let decoded = decode_scene_file(&bytes, Limits::default())?;
            seconds.push(start.elapsed().as_secs_f64());
            drop(decoded);
        }
        seconds.sort_by(f64::total_cmp);
        println!(
            "{file}: {} bytes, {:.1} ms in the median of {RUNS}, {:.1} to {:.1}",
            bytes.len(),
            1e3 * seconds[RUNS / 2],
            1e3 * seconds[0],
            1e3 * seconds[RUNS - 1]
        );
    }
    Ok(())
}
