use glam::{DVec3, UVec3};
use rayon::prelude::*;
use strivec::dataset::*;
use strivec::geometry::*;
use strivec::model::*;
use strivec::render::*;
use strivec::train::*;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let steps: u64 = args[1].parse().unwrap();
    let batch: usize = args[2].parse().unwrap();
    let evals: u64 = args[3].parse().unwrap();
    let dir = std::path::Path::new("/work/shared/data/lego");
    let opt = LoadOptions { downscale: 4, background: [1.0; 3] };
    let ds = load_blender(dir, "train", &opt).unwrap();
    let test = load_blender(dir, "test", &opt).unwrap();
    let mut config = TrainConfig::preset("24").unwrap().with_steps(steps);
    config.batch_rays = batch;
    if let Some(r) = args.get(4) { let n: usize = r.parse().unwrap();
      for s in &mut config.scales { let last = s.resolutions[n]; for q in s.resolutions[n..].iter_mut() { *q = last; } } }
    // hull on 0.05 voxels
    let n = 56u32; let v = 0.05; let lat = Lattice { origin: DVec3::splat(-1.4), pitch: DVec3::splat(v) };
    let occ: Vec<UVec3> = (0..n*n*n).into_par_iter().filter_map(|i| {
        let c = UVec3::new(i % n, i / n % n, i / n / n); let p = lat.center(c.as_ivec3());
        for w in &ds.views { let q = w.camera.world_from_camera.transpose() * (p - w.camera.position);
            let x = w.camera.focal[0] * q.x / -q.z + w.camera.principal[0]; let y = -w.camera.focal[1] * q.y / -q.z + w.camera.principal[1];
            let (x0, y0) = (x as i32, y as i32); let mut any = false;
            for dy in -3..=3 { for dx in -3..=3 { let (a, b) = (x0 + dx, y0 + dy);
                if a >= 0 && b >= 0 && a < 200 && b < 200 { any |= w.pixels[(b * 200 + a) as usize] != [1.0; 3]; } else { any = true } } }
            if !any { return None; } }
        Some(c) }).collect();
    println!("hull {}", occ.len());
    let lo = occ.iter().fold(UVec3::MAX, |a, &b| a.min(b));
    let origin = lat.origin + lo.as_dvec3() * v;
    let clouds: Vec<TensorCloud> = config.scales.iter().map(|s| {
        let pitch = DVec3::from_array(s.pitch); let l = Lattice { origin, pitch };
        let mut cells: Vec<UVec3> = occ.iter().map(|c| l.cell_of(lat.center(c.as_ivec3())).as_uvec3()).collect();
        cells.sort_by_key(|c| [c.z, c.y, c.x]); cells.dedup();
        TensorCloud { placement: Placement::Lattice { lattice: l, cells }, half: DVec3::from_array(s.edge) / 2.0, resolution: s.resolutions[0] }
    }).collect();
    for c in &clouds { println!("tensors {}", c.len()); }
    let frame = Frame { model_from_dataset: Similarity::IDENTITY, up: UpAxis::Z, metres_per_unit: None, near: 2.0, far: 6.0, background: [1.0; 3], color_space: ColorSpace::Srgb };
    let scene = initial_scene(&config, clouds, frame, "lego").unwrap();
    scene.check().unwrap();
    let t = Instant::now();
    let mut trainer = Trainer::new(config, scene, &ds.views).unwrap();
    println!("kept {} in {:?}", trainer.ray_count(), t.elapsed());
    let mut spent = 0.0; let mut last = Instant::now(); let mut mse = 0.0; let mut cnt = 0.0; let mut sam = 0; let mut col = 0;
    let stop: u64 = std::env::var("STOP").map_or(steps, |v| v.parse().unwrap());
    while trainer.steps_done() < stop {
        let r = trainer.step().unwrap();
        mse += r.mean_squared_error; cnt += 1.0; sam += r.samples; col += r.colored;
        if r.step % (steps / 20) == 0 {
            spent += last.elapsed().as_secs_f64();
            println!("step {} {:.1}s psnr {:.2} samples/ray {:.1} colored {:.1} ms/step {:.0} params {}", r.step, spent, -10.0 * (mse / cnt as f64).log10(), sam as f64 / cnt / batch as f64, col as f64 / cnt / batch as f64, last.elapsed().as_secs_f64() * 1e3 / cnt, trainer.scene().parameter_count());
            mse = 0.0; cnt = 0.0; sam = 0; col = 0; 
            if r.step % (steps / evals) == 0 {
                let s = trainer.scene(); let ren = CpuRenderer::new(&s);
                let t = Instant::now();
                let k = if r.step == steps { 1 } else { 10 };
                let ps: Vec<f64> = test.views.iter().step_by(k).map(|v| { let p = ren.render(&v.camera);
                    let e: f64 = p.pixels.iter().zip(&v.pixels).map(|(a, b)| (0..3).map(|i| (a.color[i] - b[i]).powi(2) as f64).sum::<f64>()).sum::<f64>() / 120000.0; -10.0 * e.log10() }).collect();
                println!("   EVAL {:.3} dB, {:.2}s/view", ps.iter().sum::<f64>() / ps.len() as f64, t.elapsed().as_secs_f64() / ps.len() as f64);
            }
            last = Instant::now();
        }
    }
}
