//! The files under `fixtures/`, for this and other readers: `v1/` opens, and its probes hold; `skipped/` opens without
//! the sections that `skipped.tsv` lists; `hostile/` is rejected, each file with the error that `errors.tsv` lists.
//!
//! Written anew by `cargo test --release -p strivec-train --test field vectors -- --ignored`.

#[path = "../format/scenes.rs"]
#[allow(dead_code, reason = "each test uses a part")]
mod made;
use crate::scenes;
#[path = "../format/surgery.rs"]
#[allow(dead_code, reason = "each test uses a part")]
mod surgery;

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use strivec_field::render::{CpuRenderer, ReferenceRenderer};
use strivec_format::container::{
    ArrayOptions, EncodeOptions, Encoding, FactorOptions, Filter, GRID_BITS, Limits, Metadata, Part, Prefix,
    SectionKind, SkippedSection, decode_scene_file, encode_scene_file, step_code,
};
use strivec_format::geometry::Aabb;
use strivec_format::model::{
    Aggregation, Coverage, DecoderMode, FactorKind, Occupancy, Placement, Reduction, Rules, Scene, UpAxis,
};
use strivec_measure::{check_probes, make_probes, probe_density_error};
use strivec_train::{DecoderConfig, OptimizerConfig, ScaleConfig, TrainConfig};
use surgery::{File, Part as Section, name, seal, seal_header};

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(name)
}

/// A ball of two scales, partly opaque, small as a file.
fn ball() -> Scene {
    ball_of(FactorKind::Cp)
}

/// A ball of two scales with components of this kind, partly opaque, small as a file.
fn ball_of(factors: FactorKind) -> Scene {
    let scale = |pitch: f64, resolution, density_rank, appearance_rank| ScaleConfig {
        whole_scene: false,
        pitch: [pitch, 0.9 * pitch, 1.1 * pitch],
        edge: [1.5 * pitch; 3],
        resolutions: vec![resolution],
        factors,
        density_rank,
        appearance_rank,
        top_k: 4,
    };
    let base = scenes::config();
    let config = TrainConfig {
        decoder: DecoderConfig { features: 5, hidden: vec![8], ..DecoderConfig::default() },
        scales: vec![scale(0.6, [3, 2, 4], 3, 4), scale(0.35, [2, 3, 2], 2, 9)],
        // Opaque, so that thresholds matter, and as different from sample to sample as can be.
        model: Rules { density_shift: 0.0, distance_scale: 25.0, min_weight: 0.01, ..base.model },
        optimizer: OptimizerConfig { factor_deviation: 1.5, ..base.optimizer },
        ..base
    };
    let mut scene = scenes::scene(&config);
    // Away from the tensors' faces, on which every ray's first sample would lie.
    scene.bounds = scene.bounds.grown(glam::DVec3::splat(0.0123));
    // Between the nearest and the farthest probes.
    (scene.frame.near, scene.frame.far) = (1.2, 2.4);
    scene
}

/// `scene` without some components: tensor 3 loses all, others some.
fn made_ragged(mut scene: Scene) -> Scene {
    for scale in &mut scene.scales {
        for block in scale.factors.blocks_mut() {
            let (rank, len) = (block.rank as usize, block.tensor_len(scale.cloud.resolution));
            for (n, v) in block.values.iter_mut().enumerate() {
                let (tensor, component) = (n / len, n % rank);
                if tensor == 3 || (tensor + component).is_multiple_of(3) {
                    *v = 0.0;
                }
            }
        }
    }
    scene
}

/// The file of `scene` in this encoding, with probes.
fn file(scene: &Scene, mut metadata: Metadata, options: &EncodeOptions) -> Vec<u8> {
    // Probes are evaluated in the decoded scene.
    let decoded = encode_scene_file(scene, &Metadata::default(), options).unwrap();
    let decoded = decode_scene_file(&decoded, Limits::default()).unwrap().scene;
    metadata.probes = Some(make_probes(&decoded, 64, 1));
    encode_scene_file(scene, &metadata, options).unwrap()
}

fn in_arrays(encoding: Encoding, filter: Filter) -> EncodeOptions {
    let array = ArrayOptions { encoding, filter };
    let factors = vec![FactorOptions { array, steps: None }];
    EncodeOptions {
        density: factors.clone(),
        appearance: factors,
        chunk_tensors: 16,
        zstd_level: None,
        ..EncodeOptions::default()
    }
}

/// Name and bytes of each valid vector: every feature of the format in one at least.
fn valid() -> BTreeMap<String, Vec<u8>> {
    let plain = in_arrays(Encoding::F32, Filter::None);
    let mut files = BTreeMap::new();
    let mut add = |name: &str, bytes| assert!(files.insert(name.into(), bytes).is_none(), "{name} twice");
    add("smallest", encode_scene_file(&made::smallest(), &Metadata::default(), &plain).unwrap());
    add("everything", encode_scene_file(&made::two_scales(), &made::metadata(), &plain).unwrap());
    add("f32", file(&ball(), Metadata::default(), &plain));
    for (name, encoding, filter) in [
        ("f32-planes", Encoding::F32, Filter::Planes),
        ("f16", Encoding::F16, Filter::None),
        ("f16-planes", Encoding::F16, Filter::Planes),
    ] {
        add(name, file(&ball(), Metadata::default(), &in_arrays(encoding, filter)));
    }
    for bits in GRID_BITS {
        add(
            &format!("grid-{bits}"),
            file(&ball(), Metadata::default(), &in_arrays(Encoding::Grid(bits), Filter::None)),
        );
    }
    let network =
        |encoding| EncodeOptions { networks: ArrayOptions { encoding, filter: Filter::None }, ..plain.clone() };
    add("networks-f16", file(&ball(), Metadata::default(), &network(Encoding::F16)));
    add("networks-grid", file(&ball(), Metadata::default(), &network(Encoding::Grid(8))));
    add("zstd", file(&ball(), Metadata::default(), &EncodeOptions { zstd_level: Some(19), ..plain.clone() }));

    // Two density components of the second scale: none has its vector along z.
    let matrices = ball_of(FactorKind::Vm);
    add("vm", file(&matrices, Metadata::default(), &plain));
    add("vm-f16-planes", file(&matrices, Metadata::default(), &in_arrays(Encoding::F16, Filter::Planes)));
    add("vm-grid-8", file(&matrices, Metadata::default(), &in_arrays(Encoding::Grid(8), Filter::None)));

    let [ragged, ragged_matrices] = [ball(), matrices].map(made_ragged);
    for (name, options) in [("ragged-f32", plain.clone()), ("ragged-grid", in_arrays(Encoding::Grid(6), Filter::None))]
    {
        add(name, file(&ragged, Metadata::default(), &options));
        add(&format!("vm-{name}"), file(&ragged_matrices, Metadata::default(), &options));
    }
    // Steps as a packed file has them, and the finest, whose integers are the largest.
    let coarse = vec![vec![step_code(0.1); 1 << 14]];
    for (name, scene, bits, steps) in [
        ("integers-adaptive", &ball(), 16, Some(coarse.clone())),
        ("integers-adaptive-finest", &ball(), 16, None),
        ("integers-adaptive-3", &ball(), 3, None),
        ("integers-adaptive-ragged", &ragged, 16, Some(coarse)),
        ("vm-integers-adaptive", &ragged_matrices, 16, Some(vec![vec![step_code(0.1); 1 << 14]; 3])),
    ] {
        let factors = vec![FactorOptions { array: ArrayOptions::best(Encoding::Grid(bits)), steps }];
        let options = EncodeOptions {
            density: factors.clone(),
            appearance: factors,
            networks: ArrayOptions::best(Encoding::Grid(8)),
            zstd_level: Some(19),
            ..plain.clone()
        };
        add(name, file(scene, Metadata::default(), &options));
    }

    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 12] = [
        ("coverage-any", |s| s.rules.coverage = Coverage::Any),
        ("aggregation-clamped", |s| s.rules.aggregation = Aggregation::Clamped),
        ("reductions-mean", |s| {
            s.rules.density_reduction = Reduction::Mean;
            s.rules.appearance_reduction = Reduction::Mean;
        }),
        ("per-ray", |s| s.decoder.mode = DecoderMode::PerRay),
        ("residual", |s| s.decoder.mode = DecoderMode::Residual),
        ("explicit", |s| {
            for scale in &mut s.scales {
                scale.cloud.placement = Placement::Explicit { centers: scale.cloud.centers().collect() };
            }
        }),
        ("top-1", |s| s.scales.iter_mut().for_each(|scale| scale.top_k = 1)),
        ("contracted", |s| *s = scenes::contracted(s.clone())),
        ("sky", |s| s.rules.sky = Some(scenes::sky(4))),
        ("contracted-sky", |s| {
            *s = scenes::contracted(s.clone());
            s.rules.sky = Some(scenes::sky(1));
        }),
        ("up-minus-y", |s| s.frame.up = UpAxis::MinusY),
        ("occupancy", |s| {
            let bounds = s.bounds.grown(glam::DVec3::splat(0.031));
            let mut occupancy = Occupancy::empty(bounds, glam::UVec3::new(7, 8, 9));
            for z in 2..9 {
                for y in 0..8 {
                    for x in 0..5 {
                        occupancy.set(glam::UVec3::new(x, y, z));
                    }
                }
            }
            s.occupancy = Some(occupancy);
        }),
    ];
    for (name, change) in changes {
        let mut scene = ball();
        change(&mut scene);
        add(name, file(&scene, Metadata::default(), &plain));
    }

    let mut hollow = ball();
    hollow.occupancy = Some(shell(hollow.bounds.grown(glam::DVec3::splat(0.031))));
    let compressed = EncodeOptions { zstd_level: Some(19), ..plain.clone() };
    add("occupancy-adaptive", file(&hollow, Metadata::default(), &compressed));

    let mut newer = File::of(&file(&ball(), Metadata::default(), &plain));
    newer.minor = 9;
    newer.sections.insert(2, Section::ancillary("X-FUTURE", b"something that a reader skips"));
    add("newer-minor", newer.bytes());

    let made = made::metadata();
    let prefix = Prefix { gain: 1.0, offset: 0.0, features: 5, matrices: vec![vec![0.5; 20]] };
    let metadata = Metadata { prefixes: vec![Some(prefix), None], ..made };
    let mut newer = File::of(&file(&ball(), metadata, &plain));
    newer.minor = 9;
    newer.part("PROVENANCE").codec = 3;
    newer.part("THUMBNAIL").patch(0, &[7]);
    newer.part("PREFIX").patch(24, &[9]);
    newer.part("NOTES").codec = 3;
    add("newer-codes", newer.bytes());

    let mut empty = File::of(&file(&ball(), Metadata { prefixes: Vec::new(), ..made::metadata() }, &plain));
    for kind in ["CAMERAS", "NOTES"] {
        empty.part(kind).set(vec![0; 64]);
        empty.part(kind).compress(64);
    }
    add("zstd-of-nothing", empty.bytes());
    let mut window = File::of(&file(&ball(), Metadata::default(), &plain));
    framed(window.part("DENSITY"), 17 << 3);
    add("zstd-largest-window", window.bytes());
    add("explicit-minus-zero", file(&around_zero(), Metadata::default(), &plain));
    files
}

/// The ball with explicit centers. In each scale those of one layer have z = 0, some of them −0.
fn around_zero() -> Scene {
    let mut scene = ball();
    for scale in &mut scene.scales {
        let mut centers: Vec<_> = scale.cloud.centers().collect();
        let middle = centers.iter().map(|c| c.z).min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap();
        centers.iter_mut().for_each(|c| c.z -= middle);
        let zeros = centers.iter_mut().filter(|c| c.z == 0.0).collect::<Vec<_>>();
        let half = zeros.len() / 2;
        assert!(half > 0, "some of each sign");
        zeros.into_iter().take(half).for_each(|c| c.z = -0.0);
        scale.cloud.placement = Placement::Explicit { centers };
    }
    scene
}

/// Puts the body behind a record of at most 64 bytes, which is stored, into a zstd frame with this byte for its window.
fn framed(section: &mut Section, window: u8) {
    let body = section.payload.split_off(64);
    let length = body.len() as u32;
    assert_eq!((section.codec, body.len() < 1 << 17), (0, true), "a stored body of one block");
    section.payload.extend([0x28, 0xB5, 0x2F, 0xFD, 0x80, window]);
    section.payload.extend(length.to_le_bytes());
    section.payload.extend(&(length << 3 | 1).to_le_bytes()[..3]);
    section.payload.extend(body);
    section.codec = 1;
}

/// The file `base` after a `change`.
fn changed(base: &[u8], change: &dyn Fn(&mut File)) -> Vec<u8> {
    let mut file = File::of(base);
    change(&mut file);
    file.bytes()
}

/// Name and bytes of files that open without some ancillary sections, which cannot be used.
fn skipped() -> BTreeMap<String, Vec<u8>> {
    let plain = in_arrays(Encoding::F32, Filter::None);
    let base = encode_scene_file(&made::two_scales(), &made::metadata(), &plain).unwrap();
    let changed = |change: &dyn Fn(&mut File)| changed(&base, change);
    let patched = |kind: &str, at: usize, bytes: &[u8]| changed(&|f| f.part(kind).patch(at, bytes));
    let damaged = |base: &[u8], kinds: &[&str]| {
        let mut bytes = base.to_vec();
        let contents = strivec_format::container::sections(base).unwrap();
        for section in contents.sections.iter().filter(|s| kinds.contains(&&*s.kind.to_string())) {
            bytes[section.offset as usize + 3] ^= 0x10;
        }
        bytes
    };
    let unknown = changed(&|f| f.sections.insert(2, Section::ancillary("X-FUTURE", b"something")));
    let all = ["PROVENANCE", "LICENCE", "QUALITY", "VIEWS", "PREFIX", "PROBES", "CAMERAS", "THUMBNAIL", "NOTES"];
    let f64s = |v: f64| v.to_le_bytes();
    let files = [
        ("damaged-thumbnail", damaged(&base, &["THUMBNAIL"])),
        ("damaged-all", damaged(&base, &all)),
        ("damaged-unknown-kind", damaged(&unknown, &["X-FUTURE"])),
        ("cameras-focal-length-0", patched("CAMERAS", 64 + 56, &f64s(0.0))),
        ("cameras-focal-length-negative", patched("CAMERAS", 64 + 64, &f64s(-5.0))),
        ("cameras-focal-length-nan", patched("CAMERAS", 64 + 56, &f64s(f64::NAN))),
        ("cameras-principal-point-infinite", patched("CAMERAS", 64 + 72, &f64s(f64::INFINITY))),
        ("cameras-width-0", patched("CAMERAS", 64 + 88, &[0; 4])),
        ("cameras-projection", patched("CAMERAS", 64 + 96, &[3])),
        ("cameras-distortion-nan", patched("CAMERAS", 64 + 184, &f64s(f64::NAN))),
        (
            "cameras-longer-records",
            changed(&|f| {
                let cameras = f.part("CAMERAS");
                cameras.set([cameras.payload.as_slice(), &[0; 16]].concat());
            }),
        ),
        ("quality-minus-infinity", patched("QUALITY", 0, &f64s(f64::NEG_INFINITY))),
        ("quality-nan", patched("QUALITY", 8, &f64s(f64::NAN))),
        ("quality-count", {
            changed(&|f| {
                let quality = f.part("QUALITY");
                // One number of two is left, and the string.
                quality.set([&quality.payload[..24], &1u64.to_le_bytes(), &quality.payload[40..]].concat());
            })
        }),
        ("probes-margin-negative", patched("PROBES", 64 + 120, &f64s(-1.0))),
        ("probes-margin-infinite", patched("PROBES", 64 + 120, &f64s(f64::INFINITY))),
        ("probes-steps", {
            // A hundred thousand steps on the diagonal, of 64 probes.
            let mut file = File::of(&file(&ball(), Metadata::default(), &plain));
            let step = 1e-5 * ball().bounds.size().length();
            file.part("RULES").patch(72, &step.to_le_bytes());
            file.bytes()
        }),
        ("probes-reserved", patched("PROBES", 64 + 143, &[1])),
        ("probes-codec", changed(&|f| f.part("PROBES").compress(64))),
        ("thumbnail-codec", changed(&|f| f.part("THUMBNAIL").compress(64))),
        ("thumbnail-format", patched("THUMBNAIL", 0, &[2])),
        ("thumbnail-reserved", patched("THUMBNAIL", 1, &[1])),
        ("licence-flags", changed(&|f| f.part("LICENCE").flags = 2)),
        ("licence-text", patched("LICENCE", 8, &[0xFF])),
        ("licence-length", patched("LICENCE", 0, &(1_048_577u64).to_le_bytes())),
        // "author" becomes "zuthor", behind "place".
        ("notes-order", patched("NOTES", 64 + 8, b"z")),
        ("views-poses", patched("VIEWS", 97, &65_537u64.to_le_bytes())),
        ("views-closed", patched("VIEWS", 96, &[2])),
    ];
    files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect()
}

/// The sections that are skipped in such a file, a line for each: section, class and message of the error.
fn skipped_in(name: &str, bytes: &[u8]) -> String {
    let read = decode_scene_file(bytes, Limits::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
    let line = |s: &SkippedSection| format!("{name}\t{}\t{}\t{}\n", s.name, s.error.class().unwrap(), s.error);
    read.metadata.skipped.iter().map(line).collect()
}

/// The vertices of a grid of odd numbers near a sphere, and those near its center.
fn shell(bounds: Aabb) -> Occupancy {
    let mut occupancy = Occupancy::empty(bounds, glam::UVec3::new(37, 26, 43));
    for vertex in 0..37 * 26 * 43 {
        let vertex = glam::UVec3::new(vertex % 37, vertex / 37 % 26, vertex / (37 * 26));
        let radius = ((occupancy.position(vertex) - bounds.center()) / bounds.size()).length();
        if (radius - 0.4).abs() < 0.05 || radius < 0.2 {
            occupancy.set(vertex);
        }
    }
    occupancy
}

/// Name, bytes and the start of the error's text of each hostile vector: one at least for every variant of the error.
fn hostile() -> BTreeMap<String, (Vec<u8>, String)> {
    let plain = in_arrays(Encoding::F32, Filter::None);
    let base = encode_scene_file(&made::two_scales(), &made::metadata(), &plain).unwrap();
    let changed = |change: &dyn Fn(&mut File)| changed(&base, change);
    let patched = |kind: &str, at: usize, bytes: &[u8]| changed(&|f| f.part(kind).patch(at, bytes));
    let flipped = |at: usize| {
        let mut bytes = base.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    let most = u32::MAX.to_le_bytes();
    // The finer scale has these centers, in this order.
    let in_order = |centers: [[f64; 3]; 2]| {
        changed(&|f| {
            let half = made::two_scales().scales[1].cloud.half_edge;
            let centers = centers.map(glam::DVec3::from_array);
            let covered = Aabb::from_points(centers).grown(half);
            let bytes = |v: glam::DVec3| v.to_array().map(f64::to_le_bytes).concat();
            let scale = f.sections.iter_mut().rfind(|p| p.kind == name("SCALE")).unwrap();
            scale.patch(128 + 4, &[bytes(covered.min), bytes(covered.max)].concat());
            let placement = f.sections.iter_mut().rfind(|p| p.kind == name("PLACEMENT")).unwrap();
            placement.set(centers.map(bytes).concat());
        })
    };
    let mut files: Vec<(&str, Vec<u8>)> = vec![
        ("not-strivec", b"\x89PNG\r\n\x1A\n0000".to_vec()),
        ("line-endings", base.iter().flat_map(|&b| if b == b'\n' { vec![b'\r', b'\n'] } else { vec![b] }).collect()),
        ("major-2", changed(&|f| f.major = 2)),
        ("major-2-short", changed(&|f| f.major = 2)[..12].to_vec()),
        ("truncated-magic", base[..5].to_vec()),
        ("truncated-header", base[..40].to_vec()),
        ("truncated-table", base[..200].to_vec()),
        ("truncated-payload", base[..base.len() - 1].to_vec()),
        ("corrupt-header", flipped(13)),
        ("corrupt-table", flipped(64 + 30)),
        ("corrupt-section", {
            let sections = strivec_format::container::sections(&base).unwrap().sections;
            flipped(sections.iter().find(|s| s.kind == SectionKind::Density).unwrap().offset as usize + 70)
        }),
        (
            "unknown-critical",
            changed(&|f| f.sections.push(Section { flags: 1, ..Section::ancillary("WAVELETS", b"") })),
        ),
        ("unsupported-factor-kind", patched("SCALE", 44, &[2])),
        ("malformed-axis-ranks", {
            let matrices = ball_of(FactorKind::Vm);
            let options = in_arrays(Encoding::F32, Filter::None);
            let mut file = File::of(&encode_scene_file(&matrices, &Metadata::default(), &options).unwrap());
            file.part("SCALE").patch(124, &[2]);
            file.bytes()
        }),
        ("unsupported-placement", patched("SCALE", 45, &[17])),
        ("unsupported-components", patched("DENSITY", 0, &[2])),
        ("unsupported-codec-rules", changed(&|f| f.part("RULES").codec = 7)),
        ("unsupported-contraction", patched("RULES", 6, &[2])),
        ("value-shell", patched("RULES", 6, &[1])),
        ("unsupported-sky", patched("RULES", 7, &[5])),
        ("malformed-sky", patched("RULES", 7, &[1])),
        ("value-sky", {
            changed(&|f| {
                f.part("RULES").patch(7, &[1]);
                let rules = f.part("RULES");
                rules.set([rules.payload.as_slice(), &f32::NAN.to_le_bytes(), &[0; 44]].concat());
            })
        }),
        ("unsupported-encoding", patched("DENSITY", 8, &[9])),
        ("unsupported-codec", changed(&|f| f.part("DENSITY").codec = 3)),
        ("malformed-codec-density", changed(&|f| f.part("DENSITY").codec = 2)),
        ("missing-decoder", changed(&|f| drop(f.sections.remove(f.index("DECODER"))))),
        ("limit-rank", patched("SCALE", 48, &most)),
        ("limit-tensors", patched("SCALE", 0, &(1u32 << 22 | 1).to_le_bytes())),
        ("limit-layer", patched("DECODER", 21, &1025u32.to_le_bytes())),
        ("limit-occupancy", patched("OCCUPANCY", 48, &[1024u32, 1024, 257].map(u32::to_le_bytes).concat())),
        ("limit-sections", {
            let mut bytes = base.clone();
            bytes[12..16].copy_from_slice(&most);
            seal_header(&mut bytes);
            bytes
        }),
        ("malformed-order", changed(&|f| f.sections.swap(0, 1))),
        ("malformed-name", changed(&|f| f.part("LICENCE").kind = name("license"))),
        ("malformed-padding", {
            let mut bytes = base.clone();
            let first = 64 + 64 * u32::from_le_bytes(base[12..16].try_into().unwrap()) as usize;
            // FRAME has 102 bytes.
            bytes[first + 110] = 1;
            seal(&mut bytes);
            bytes
        }),
        ("malformed-offset", {
            let mut bytes = base.clone();
            bytes[64 + 64 + 32] ^= 0x40;
            seal(&mut bytes);
            bytes
        }),
        ("malformed-cells", patched("PLACEMENT", 1, &[21])),
        (
            "malformed-zstd",
            changed(&|f| {
                f.part("DENSITY").compress(64);
                f.part("DENSITY").payload.truncate(70);
            }),
        ),
        (
            "malformed-zstd-size",
            changed(&|f| {
                f.part("DENSITY").compress(64);
                f.part("DENSITY").decoded_length += 1;
            }),
        ),
        (
            "malformed-zstd-second-frame",
            changed(&|f| {
                f.part("DENSITY").compress(64);
                f.part("DENSITY").payload.extend(zstd::bulk::compress(b"", 3).unwrap());
            }),
        ),
        ("malformed-long-integer", changed(&|f| f.part("PLACEMENT").set(vec![2, 0x80, 0]))),
        ("malformed-covered", patched("SCALE", 128 + 4, &0f64.to_le_bytes())),
        ("malformed-extent", patched("SCALE", 120, &5u32.to_le_bytes())),
        ("malformed-unsorted", {
            let centers = [[0.1f64, 0.2, 0.3], [-0.1, 0.2, -0.3]].map(|c| c.map(f64::to_le_bytes).concat()).concat();
            changed(&|f| {
                let fine = f.sections.iter_mut().rfind(|p| p.kind == name("PLACEMENT")).unwrap();
                fine.set(centers.clone());
            })
        }),
        ("malformed-filter", patched("DENSITY", 8, &[2, 8, 1])),
        ("unsupported-filter", patched("DENSITY", 10, &[2])),
        ("unsupported-reserved", patched("SCALE", 46, &[1])),
        ("unsupported-flags", changed(&|f| f.part("RULES").flags = 3)),
        ("unsupported-entry", changed(&|f| f.part("RULES").reserved = 1)),
        ("unsupported-header", {
            let mut bytes = base.clone();
            bytes[59] = 1;
            seal_header(&mut bytes);
            bytes
        }),
        ("malformed-critical", changed(&|f| f.part("NOTES").flags = 1)),
        ("malformed-ancillary", changed(&|f| f.part("RULES").flags = 0)),
        ("malformed-place", changed(&|f| f.part("FRAME").scale = 0)),
        ("malformed-shell", patched("RULES", 96, &[1])),
        ("malformed-rank", patched("MATRIX", 4, &[1])),
        ("malformed-occupancy-bits", patched("OCCUPANCY", 64 + 7, &[0x80])),
        ("malformed-window", changed(&|f| framed(f.part("DENSITY"), 17 << 3 | 1))),
        ("malformed-window-huge", changed(&|f| framed(f.part("DENSITY"), 0xFF))),
        ("malformed-minus-zero", in_order([[-1.0, 0.0, 0.5], [1.0, -0.0, 0.5]])),
        ("malformed-minus-zero-numbers", in_order([[1.0, -0.0, 0.5], [-1.0, 0.0, 0.5]])),
        ("malformed-same-center", in_order([[1.0, 0.0, 0.5]; 2])),
        ("value-center", in_order([[1.0, 0.0, f64::NAN], [1.0, 0.0, 0.5]])),
        ("value-features", patched("MATRIX", 0, &[3])),
        ("value-layer", patched("DECODER", 17, &[7])),
        ("value-half-edge", patched("SCALE", 8, &f64::NAN.to_le_bytes())),
        ("value-pitch", patched("SCALE", 88, &(-1f64).to_le_bytes())),
        ("value-origin", patched("SCALE", 64, &f64::INFINITY.to_le_bytes())),
        ("limit-steps", patched("RULES", 72, &1e-9f64.to_le_bytes())),
        ("limit-layers", patched("DECODER", 9, &[66])),
        (
            "malformed-twice",
            changed(&|f| {
                let twice = f.part("MATRIX").clone();
                f.sections.insert(f.index("MATRIX"), twice);
            }),
        ),
        ("corrupt-file", {
            let mut bytes = base.clone();
            bytes[28] ^= 1;
            seal_header(&mut bytes);
            bytes
        }),
        ("malformed-adaptive-floats", changed(&|f| f.part("MATRIX").codec = 2)),
        ("malformed-extra-byte", [base.as_slice(), &[0]].concat()),
        ("value-nan", patched("RULES", 72, &f64::NAN.to_le_bytes())),
        ("value-infinite-factor", patched("DENSITY", 64, &f32::INFINITY.to_le_bytes())),
    ];
    let adaptive = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut scene = made::smallest();
        scene.occupancy = Some(shell(scene.bounds));
        let options = EncodeOptions { zstd_level: Some(19), ..plain.clone() };
        let mut file = File::of(&encode_scene_file(&scene, &Metadata::default(), &options).unwrap());
        assert_eq!(file.part("OCCUPANCY").codec, 2, "adaptive");
        change(&mut file.part("OCCUPANCY").payload);
        file.bytes()
    };
    files.push(("malformed-adaptive-short", adaptive(&|payload| payload.truncate(payload.len() - 2))));
    files.push(("malformed-adaptive-long", adaptive(&|payload| payload.push(0))));
    files.push(("malformed-adaptive-last", adaptive(&|payload| *payload.last_mut().unwrap() ^= 1)));
    files.push(("malformed-adaptive-ones", adaptive(&|payload| payload[64..72].fill(0xff))));
    let integers = |change: &dyn Fn(&mut Vec<u8>)| {
        let steps = Some(vec![vec![step_code(0.1); 1 << 14]]);
        let factors = vec![FactorOptions { array: ArrayOptions::best(Encoding::Grid(16)), steps }];
        let options =
            EncodeOptions { density: factors.clone(), appearance: factors, zstd_level: Some(19), ..plain.clone() };
        let mut file = File::of(&encode_scene_file(&ball(), &Metadata::default(), &options).unwrap());
        let last = file.sections.iter_mut().rfind(|part| part.kind == name("DENSITY")).unwrap();
        assert_eq!(last.codec, 2, "adaptive");
        change(&mut last.payload);
        file.bytes()
    };
    files.push(("malformed-integers-short", integers(&|payload| payload.truncate(payload.len() - 9))));
    files.push(("malformed-integers-long", integers(&|payload| payload.push(0))));
    files.push(("malformed-integers-ones", integers(&|payload| payload[64 + 20..].fill(0xff))));
    let bomb = {
        let mut scene = made::smallest();
        scene.occupancy = Some(Occupancy::empty(scene.bounds, glam::UVec3::new(1024, 512, 512)));
        encode_scene_file(&scene, &Metadata::default(), &EncodeOptions { zstd_level: Some(19), ..plain.clone() })
            .unwrap()
    };
    files.push(("budget", bomb));
    let error = |name: &str, bytes: &[u8]| match decode_scene_file(bytes, HOSTILE_LIMITS) {
        Ok(_) => panic!("{name} is valid"),
        Err(error) => format!("{}\t{error}", error.class().unwrap()),
    };
    files
        .into_iter()
        .map(|(name, bytes)| {
            let text = error(name, &bytes);
            (name.to_owned(), (bytes, text))
        })
        .collect()
}

/// The limits that the hostile vectors are opened with.
const HOSTILE_LIMITS: Limits = Limits { memory: 64 << 20 };

/// The CRC-32 of a file without bytes 60 to 64. In a scene file these are the header's own checksum, with which the CRC-32
/// of the whole file would be the same with any header.
fn checksum(bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[..bytes.len().min(60)]);
    hasher.update(bytes.get(64..).unwrap_or_default());
    hasher.finalize()
}

#[test]
#[ignore = "writes the vectors"]
fn write() {
    let mut hashes = String::new();
    let mut put = |folder_name: &str, name: &str, bytes: &[u8]| {
        fs::write(folder(folder_name).join(name), bytes).unwrap();
        hashes += &format!("{:08x}  {folder_name}/{name}\n", checksum(bytes));
    };
    for (name, bytes) in valid() {
        put("v1", &format!("{name}.strivec"), &bytes);
    }
    let mut lines = String::new();
    for (name, bytes) in skipped() {
        put("skipped", &format!("{name}.strivec"), &bytes);
        lines += &skipped_in(&name, &bytes);
    }
    put("skipped", "skipped.tsv", lines.as_bytes());
    let mut errors = String::new();
    for (name, (bytes, error)) in hostile() {
        put("hostile", &format!("{name}.strivec"), &bytes);
        errors += &format!("{name}\t{error}\n");
    }
    put("hostile", "errors.tsv", errors.as_bytes());
    fs::write(folder("CRC32"), hashes).unwrap();
}

#[test]
fn the_vectors_are_those_that_were_written() {
    let hashes = fs::read_to_string(folder("CRC32")).unwrap();
    assert!(hashes.lines().count() > 50);
    for line in hashes.lines() {
        let (hash, path) = line.split_once("  ").unwrap();
        assert_eq!(hash, format!("{:08x}", checksum(&fs::read(folder(path)).unwrap())), "{path}");
    }
    let different: std::collections::BTreeSet<_> = hashes.lines().filter_map(|line| line.split_once("  ")).collect();
    let hashes: std::collections::BTreeSet<_> = different.iter().map(|(hash, _)| hash).collect();
    assert_eq!(hashes.len(), different.len(), "different files have different checksums");
}

#[test]
fn files_open_without_the_sections_that_cannot_be_used() {
    let lines = fs::read_to_string(folder("skipped").join("skipped.tsv")).unwrap();
    let names: std::collections::BTreeSet<_> = lines.lines().filter_map(|line| line.split('\t').next()).collect();
    assert!(names.len() > 20);
    let mut found = String::new();
    for name in names {
        found += &skipped_in(name, &fs::read(folder("skipped").join(format!("{name}.strivec"))).unwrap());
    }
    assert_eq!(found, lines);
}

#[test]
fn valid_vectors_open_and_their_probes_hold() {
    let mut probed = 0;
    for name in valid().keys() {
        let bytes = fs::read(folder("v1").join(format!("{name}.strivec"))).unwrap();
        let document = decode_scene_file(&bytes, Limits::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(
            document.metadata.skipped.is_empty() || name == "newer-codes",
            "{name}: {:?}",
            document.metadata.skipped
        );
        let Some(probes) = document.metadata.probes.filter(|_| name != "everything") else { continue };
        probed += 1;
        assert_eq!(probes.probes.len(), 64, "{name}");
        assert!(probe_density_error(&document.scene, &probes) < 1e-9, "{name}");
        let reference = check_probes(&ReferenceRenderer::new(&document.scene), &probes);
        let fast = check_probes(&CpuRenderer::<f32>::unlimited(&document.scene), &probes);
        for report in [reference, fast] {
            assert!(report.failed == 0 && report.compared >= 40, "{name}: {report:?}");
        }
        // And they see another scene.
        let mut other = document.scene.clone();
        other.rules.density_shift += 0.2;
        assert!(check_probes(&CpuRenderer::<f32>::unlimited(&other), &probes).failed > 30, "{name}");
    }
    assert!(probed > 20);
}

#[test]
fn hostile_vectors_are_refused_as_written() {
    let errors = fs::read_to_string(folder("hostile").join("errors.tsv")).unwrap();
    for line in errors.lines() {
        let (name, error) = line.split_once('\t').unwrap();
        let bytes = fs::read(folder("hostile").join(format!("{name}.strivec"))).unwrap();
        let found = decode_scene_file(&bytes, HOSTILE_LIMITS).expect_err(name);
        assert_eq!(format!("{}\t{found}", found.class().unwrap()), error, "{name}");
    }
}

#[test]
fn ancillary_sections_with_codes_of_a_later_version_are_skipped() {
    let bytes = fs::read(folder("v1").join("newer-codes.strivec")).unwrap();
    let file = decode_scene_file(&bytes, Limits::default()).unwrap();
    let without = fs::read(folder("v1").join("f32.strivec")).unwrap();
    assert_eq!(file.scene.scales, decode_scene_file(&without, Limits::default()).unwrap().scene.scales);
    let Metadata { license, thumbnail, prefixes, notes, cameras, skipped, .. } = file.metadata;
    assert!(thumbnail.is_none() && notes.is_empty() && prefixes == [None, None]);
    assert!(license.is_some() && cameras.len() == 2, "other sections are read");
    assert!(skipped.iter().all(SkippedSection::is_valid));
    assert_eq!(
        skipped.iter().map(|skipped| skipped.error.to_string()).collect::<Vec<_>>(),
        [
            "PROVENANCE: codec 3 is not supported",
            "PREFIX of scale 0 encoding: code 9 is not supported",
            "THUMBNAIL format: code 7 is not supported",
            "NOTES: codec 3 is not supported",
        ]
    );
}

#[test]
fn a_part_of_a_vector_opens_without_the_rest() {
    let bytes = fs::read(folder("v1").join("f32.strivec")).unwrap();
    let reader = strivec_format::container::Reader::open(bytes.as_slice(), Limits::default()).unwrap();
    let fine = reader.contents().sections.iter().find(|s| s.scale == Some(1)).unwrap().offset as usize;
    // Nothing of the finer scale is there.
    let start = strivec_format::container::Reader::open(&bytes[..fine], Limits::default()).unwrap();
    let coarse = start.read(&Part { scales: Some(1), ..Part::default() }).unwrap().scene;
    assert_eq!(coarse.scales.len(), 1);
    let whole = reader.read(&Part::WHOLE).unwrap().scene;
    assert_eq!(coarse.scales[0], whole.scales[0]);
    assert!(start.read(&Part::default()).is_err());
    let corner = strivec_format::geometry::Aabb { min: whole.bounds.min, max: whole.bounds.center() };
    let crop = reader.read(&Part { within: Some(corner), ..Part::default() }).unwrap().scene;
    assert_eq!(crop.bounds, corner);
    assert!(crop.scales[1].cloud.len() < whole.scales[1].cloud.len());
}

#[test]
fn the_number_of_threads_changes_neither_bytes_nor_numbers_nor_errors() {
    let scene = ball();
    let options =
        EncodeOptions { chunk_tensors: 3, zstd_level: Some(3), ..in_arrays(Encoding::Grid(16), Filter::None) };
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let bytes = encode_scene_file(&scene, &Metadata::default(), &options).unwrap();
            let decoded = decode_scene_file(&bytes, Limits::default());
            // Several sections are wrong behind checksums that are right.
            let wrong = (0..200).map(|n| {
                let mut changed = File::of(&bytes);
                for part in changed.sections.iter_mut().skip(n % 7).step_by(5) {
                    let length = part.payload.len();
                    part.payload[n * 31 % length] ^= 0x55;
                }
                decode_scene_file(&changed.bytes(), Limits::default())
            });
            let wrong: Vec<_> = wrong.collect();
            (bytes, decoded, wrong)
        })
    });
    assert!(one == three);
    assert!(one.2.iter().any(|result| result.is_err()) && one.1.is_ok());
}
