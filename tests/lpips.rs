//! LPIPS against the original package, with weights that are made up and with the real ones.
//!
//! `tools/lpips/reference.py` wrote `fixtures/lpips.json` and makes up the same weights and pictures. The real weights are read
//! if `STRIVEC_LPIPS` names the file of `tools/lpips/convert.py`.
#![cfg(feature = "toolkit")]

mod data;

use std::collections::BTreeMap;
use std::io::Write;
use std::ops::Range;

use safetensors::tensor::{Dtype, TensorView};
use serde::Deserialize;
use strivec::dataset::{self, LoadOptions};
use strivec::measure::{Error, Lpips, LpipsNetwork, LpipsWeightsError};

/// The largest difference to the original package.
const TOLERANCE: f64 = 1e-6;
/// \[network\]\[layer\] (edge, inputs, outputs) of the convolutions.
const CONVOLUTIONS: [&[[usize; 3]]; 2] = [
    &[[11, 3, 64], [5, 64, 192], [3, 192, 384], [3, 384, 256], [3, 256, 256]],
    &[
        [3, 3, 64],
        [3, 64, 64],
        [3, 64, 128],
        [3, 128, 128],
        [3, 128, 256],
        [3, 256, 256],
        [3, 256, 256],
        [3, 256, 512],
        [3, 512, 512],
        [3, 512, 512],
        [3, 512, 512],
        [3, 512, 512],
        [3, 512, 512],
    ],
];
/// \[network\]\[stage\] channels that are compared.
const CHANNELS: [[usize; 5]; 2] = [[64, 192, 384, 256, 256], [64, 128, 256, 512, 512]];

type Picture = Vec<[f32; 3]>;
/// Shape and numbers by name.
type Tensors = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

#[derive(Deserialize)]
struct Row {
    weights: String,
    network: String,
    pair: String,
    original: f64,
    numpy: f64,
}

fn rows(weights: &str) -> Vec<Row> {
    let all: Vec<Row> = serde_json::from_str(include_str!("../fixtures/lpips.json")).unwrap();
    all.into_iter().filter(|row| row.weights == weights).collect()
}

/// A number in \[0, 1) of 24 bits.
fn hashed(index: usize) -> f64 {
    let x = (index as u32).wrapping_mul(2_654_435_761);
    let x = (x ^ (x >> 15)).wrapping_mul(2_246_822_519);
    f64::from((x ^ (x >> 13)) >> 8) / f64::from(1 << 24)
}

fn made_up(network: LpipsNetwork) -> Tensors {
    let mut start = 0;
    let mut take = |shape: &[usize], value: &dyn Fn(f64) -> f64| {
        let taken = start..start + shape.iter().product::<usize>();
        start = taken.end;
        (shape.to_vec(), taken.map(|i| value(hashed(i)) as f32).collect())
    };
    let (n, name) = (network as usize, network.name());
    let mut tensors = Tensors::new();
    for (layer, &[edge, inputs, outputs]) in CONVOLUTIONS[n].iter().enumerate() {
        let bound = (6.0 / (edge * edge * inputs) as f64).sqrt();
        let kernel = take(&[edge, edge, inputs, outputs], &|v| (2.0 * v - 1.0) * bound);
        tensors.insert(format!("{name}.conv.{layer}.kernel"), kernel);
        tensors.insert(format!("{name}.conv.{layer}.bias"), take(&[outputs], &|v| (2.0 * v - 1.0) * 0.05));
    }
    for (stage, &channels) in CHANNELS[n].iter().enumerate() {
        tensors.insert(format!("{name}.linear.{stage}"), take(&[channels], &|v| v));
    }
    tensors
}

/// The tensors as a safetensors file; those that `as_half` names as zeros of 16 bits.
fn file(tensors: &Tensors, as_half: &str) -> Vec<u8> {
    let bytes: Vec<_> = (tensors.iter())
        .map(|(name, (shape, values))| {
            let is_half = name == as_half;
            let bytes = if is_half { vec![0; 2 * values.len()] } else { bytemuck::cast_slice(values).to_vec() };
            (name, if is_half { Dtype::F16 } else { Dtype::F32 }, shape.clone(), bytes)
        })
        .collect();
    let views =
        bytes.iter().map(|(name, dtype, shape, bytes)| (name, TensorView::new(*dtype, shape.clone(), bytes).unwrap()));
    safetensors::serialize(views, None).unwrap()
}

fn of_tensors(tensors: &Tensors, network: LpipsNetwork) -> Lpips {
    Lpips::from_safetensors(&file(tensors, ""), network).unwrap()
}

fn picture(numbers: impl Iterator<Item = f64>) -> Picture {
    let values: Vec<f32> = numbers.map(|v| v as f32).collect();
    values.as_chunks().0.to_vec()
}

fn noise([width, height]: [u32; 2], start: usize) -> Picture {
    picture((start..start + (3 * width * height) as usize).map(hashed))
}

fn smooth([width, height]: [u32; 2]) -> Vec<[f64; 3]> {
    let at = |x: u32, y: u32| [0, 1, 2].map(|c| f64::from((3 * x + 5 * y + 40 * c) % 128 + (x * y) % 97) / 256.0);
    (0..height).flat_map(|y| (0..width).map(move |x| at(x, y))).collect()
}

/// The mean of 5×5 pixels, the border repeated.
fn blurred([width, height]: [u32; 2], of: &[[f64; 3]]) -> Picture {
    let near = |at: u32, extent: u32| -> Range<i64> { i64::from(at) - 2..i64::from(at) + 3.min(i64::from(extent) + 3) };
    let pixel = |x: u32, y: u32| {
        let mut sum = [0.0; 3];
        for row in near(y, height).map(|row| row.clamp(0, i64::from(height) - 1)) {
            for column in near(x, width).map(|column| column.clamp(0, i64::from(width) - 1)) {
                let color = of[(row * i64::from(width) + column) as usize];
                sum.iter_mut().zip(color).for_each(|(sum, v)| *sum += v);
            }
        }
        sum.map(|sum| (sum / 25.0) as f32)
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
}

fn noisy(of: &[[f64; 3]]) -> Picture {
    picture((of.as_flattened().iter().zip(9_000_000..)).map(|(v, i)| (v + 0.2 * (hashed(i) - 0.5)).clamp(0.0, 1.0)))
}

fn rounded(colors: &[[f64; 3]]) -> Picture {
    colors.iter().map(|color| color.map(|v| v as f32)).collect()
}

/// The size and the pictures of a pair of the reference; `None` for one of a data set that is not there.
fn pair(name: &str) -> Option<([u32; 2], Picture, Picture)> {
    let size = |width, height| [width, height];
    Some(match name {
        "random 64x64" => (size(64, 64), noise([64, 64], 1_000_000), noise([64, 64], 2_000_000)),
        "random 67x45" => (size(67, 45), noise([67, 45], 3_000_000), noise([67, 45], 4_000_000)),
        "smooth and noisy 53x37" => (size(53, 37), rounded(&smooth([53, 37])), noisy(&smooth([53, 37]))),
        "smooth and blurred 96x80" => (size(96, 80), rounded(&smooth([96, 80])), blurred([96, 80], &smooth([96, 80]))),
        "smallest 31x31" => (size(31, 31), rounded(&smooth([31, 31])), noise([31, 31], 5_000_000)),
        _ => {
            let lego = lego()?;
            let other = if name.contains("blurred") { blurred([200, 200], &lego) } else { noisy(&lego) };
            (size(200, 200), rounded(&lego), other)
        }
    })
}

/// The middle of the first test photograph on white, 200×200.
fn lego() -> Option<Vec<[f64; 3]>> {
    let folder = data::folder("lego")?;
    let options = LoadOptions { views: Some(0..1), ..LoadOptions::default() };
    let views = dataset::load(&folder, "test", &options).unwrap().views;
    let colors = views[0].pixels.colors([1.0; 3]);
    Some((300..500).flat_map(|y| colors[y * 800 + 300..][..200].to_vec()).map(|c| c.map(f64::from)).collect())
}

#[track_caller]
fn compare(lpips: &Lpips, rows: &[Row]) -> f64 {
    let mut largest: f64 = 0.0;
    for row in rows.iter().filter(|row| row.network == lpips.network().name()) {
        assert!((row.original - row.numpy).abs() < 1e-7, "the references differ for {}", row.pair);
        let Some((size, a, b)) = pair(&row.pair) else { continue };
        let found = lpips.distance(size, &a, &b).unwrap();
        println!("{} {}: {found}, {:+.1e}", row.network, row.pair, found - row.original);
        largest = largest.max((found - row.original).abs());
    }
    largest
}

#[test]
fn distances_with_made_up_weights_are_the_original_packages() {
    for network in LpipsNetwork::ALL {
        let largest = compare(&of_tensors(&made_up(network), network), &rows("made up"));
        assert!(largest < TOLERANCE, "{network:?}: {largest}");
    }
}

#[test]
fn distances_with_the_real_weights_are_the_original_packages() {
    let Some(path) = std::env::var_os("STRIVEC_LPIPS") else {
        // Past the harness, which swallows what a passing test prints.
        let _ = writeln!(std::io::stderr(), "LPIPS with the real weights: not run: STRIVEC_LPIPS is not set");
        return;
    };
    let bytes = std::fs::read(path).unwrap();
    for network in LpipsNetwork::ALL {
        let lpips = Lpips::from_safetensors(&bytes, network).unwrap();
        let largest = compare(&lpips, &rows("lpips-jax 0.1.0"));
        assert!(largest < TOLERANCE, "{network:?}: {largest}");
    }
}

#[test]
fn planted_differences_are_seen() {
    let network = LpipsNetwork::Alex;
    let rows = rows("made up");
    let row = rows.iter().find(|row| row.network == "alex" && row.pair == "smooth and noisy 53x37").unwrap();
    let (size, a, b) = pair(&row.pair).unwrap();
    let sound = made_up(network);
    let differs = |tensors: &Tensors, a: &Picture, b: &Picture, planted: &str| {
        let found = of_tensors(tensors, network).distance(size, a, b).unwrap();
        assert!((found - row.original).abs() > 20.0 * TOLERANCE, "{planted}: {found}");
    };
    let changed = |picture: &Picture, change: fn([f32; 3]) -> [f32; 3]| picture.iter().map(|&c| change(c)).collect();
    let swapped = |[r, g, b]: [f32; 3]| [b, g, r];
    differs(&sound, &changed(&a, swapped), &changed(&b, swapped), "blue in place of red");
    // Colors that become those of 2x - 1 by the normalization.
    let plain = |color: [f32; 3]| {
        let (shift, scale) = ([-0.030, -0.088, -0.188], [0.458, 0.448, 0.450]);
        [0, 1, 2].map(|c| ((2.0 * color[c] - 1.0) * scale[c] + shift[c] + 1.0) / 2.0)
    };
    differs(&sound, &changed(&a, plain), &changed(&b, plain), "colors that are not normalized");
    let with = |name: &str, change: &dyn Fn(&mut Vec<f32>)| {
        let mut tensors = made_up(network);
        change(&mut tensors.get_mut(name).unwrap().1);
        tensors
    };
    differs(&with("alex.conv.2.bias", &|bias| bias.fill(0.0)), &a, &b, "no bias");
    differs(&with("alex.linear.4", &|linear| linear.reverse()), &a, &b, "channels in another order");
    let transposed = |kernel: &mut Vec<f32>| {
        let of = |n: usize| ((n / (5 * 64 * 192)) + 5 * (n / (64 * 192) % 5)) * 64 * 192 + n % (64 * 192);
        *kernel = (0..kernel.len()).map(|n| kernel[of(n)]).collect();
    };
    differs(&with("alex.conv.1.kernel", &transposed), &a, &b, "rows of a kernel in place of columns");
}

#[test]
fn identical_pictures_are_at_no_distance_and_the_order_does_not_matter() {
    let (size, a, b) = pair("smooth and noisy 53x37").unwrap();
    let lpips = of_tensors(&made_up(LpipsNetwork::Alex), LpipsNetwork::Alex);
    assert_eq!(lpips.distance(size, &a, &a).unwrap(), 0.0);
    assert_eq!(lpips.distance(size, &a, &b).unwrap(), lpips.distance(size, &b, &a).unwrap());
}

#[test]
fn pictures_that_cannot_be_compared_are_refused() {
    for network in LpipsNetwork::ALL {
        let lpips = of_tensors(&made_up(network), network);
        let smallest = network.smallest_extent() as u32;
        let flat = |size: [u32; 2]| vec![[0.5; 3]; (size[0] * size[1]) as usize];
        let small = [smallest + 9, smallest - 1];
        let error = lpips.distance(small, &flat(small), &flat(small)).unwrap_err();
        let expected = format!(
            "LPIPS with the network {} needs pictures of at least {smallest}x{smallest} pixels, not {}x{}",
            network.name(),
            small[0],
            small[1]
        );
        assert_eq!(error.to_string(), expected);
        let least = [smallest, smallest];
        assert_eq!(lpips.distance(least, &flat(least), &flat(least)).unwrap(), 0.0);
        let found = lpips.distance(least, &flat(least), &flat(small));
        assert!(matches!(found, Err(Error::Size { .. })), "{found:?}");
        let infinite = vec![[f32::INFINITY; 3]; (smallest * smallest) as usize];
        assert!(lpips.distance(least, &flat(least), &infinite).unwrap().is_nan());
    }
}

#[test]
fn files_of_weights_with_faults_are_refused_by_name() {
    let network = LpipsNetwork::Alex;
    let refused = |bytes: &[u8]| Lpips::from_safetensors(bytes, network).unwrap_err();
    let sound = made_up(network);
    let bytes = file(&sound, "");
    for damaged in [&b""[..], b"PK\x03\x04 and so on", &bytes[..bytes.len() / 2], &[0xff; 64]] {
        assert!(matches!(refused(damaged), LpipsWeightsError::NotSafetensors(_)));
    }
    let mut tensors = sound.clone();
    tensors.remove("alex.conv.3.bias");
    assert_eq!(refused(&file(&tensors, "")).to_string(), "the tensor alex.conv.3.bias is missing");
    let vgg = Lpips::from_safetensors(&bytes, LpipsNetwork::Vgg).unwrap_err();
    assert_eq!(vgg.to_string(), "the tensor vgg.conv.0.kernel is missing");
    let found = refused(&file(&sound, "alex.linear.2")).to_string();
    assert_eq!(found, "the tensor alex.linear.2: expected 32-bit floats (F32), found F16");
    tensors = sound.clone();
    tensors.get_mut("alex.conv.0.kernel").unwrap().0 = vec![64, 3, 11, 11];
    let found = refused(&file(&tensors, "")).to_string();
    assert_eq!(found, "the tensor alex.conv.0.kernel: expected the shape [11, 11, 3, 64], found [64, 3, 11, 11]");
    tensors = sound;
    tensors.get_mut("alex.linear.0").unwrap().1[7] = f32::NAN;
    let found = refused(&file(&tensors, "")).to_string();
    assert_eq!(found, "the tensor alex.linear.0: expected finite numbers, found NaN at 7");
}

#[cfg(feature = "cli")]
#[test]
fn eval_has_the_distance_of_each_view_and_names_a_view_that_is_too_small() {
    use std::process::{Command, Output};

    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("alex.safetensors"), file(&made_up(LpipsNetwork::Alex), "")).unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/f32.strivec");
    let run = |arguments: &[&str]| -> Output {
        Command::new(env!("CARGO_BIN_EXE_strivec")).current_dir(folder).args(arguments).output().unwrap()
    };
    assert!(
        run(&["synth", "data", "--views", "4", "--test-views", "2", "--size", "40x34", "--quiet"]).status.success()
    );
    let eval = ["eval", scene, "data", "--json", "--quiet", "--lpips", "alex", "--lpips-weights", "alex.safetensors"];
    let result: serde_json::Value = serde_json::from_slice(&run(&eval).stdout).unwrap();
    let distance = |of: &serde_json::Value| of["lpips_alex"].as_f64().unwrap();
    assert!(distance(&result["views"][0]) > 0.01, "{result}");
    assert_eq!(distance(&result), (distance(&result["views"][0]) + distance(&result["views"][1])) / 2.0);
    let small = run(&[&eval[..], &["--downscale", "2"]].concat());
    let message = String::from_utf8_lossy(&small.stderr).into_owned();
    assert_eq!(small.status.code(), Some(1), "{message}");
    let expected = "view r_0: LPIPS with the network alex needs pictures of at least 31x31 pixels, not 20x17";
    assert!(message.contains(expected), "{message}");
}
