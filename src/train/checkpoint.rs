//! Checkpoints: the state with which a run resumes and ends in the same bytes as without the interruption.
//!
//! A checkpoint is one safetensors file: the moments as tensors, which other tools can read, the scene's own file as
//! bytes, and the rest as metadata with a version and a checksum. The checksum is that of the whole file with zeros for the
//! digits of the checksum itself, so that no setting and no counter can change unnoticed.

use std::collections::HashMap;
use std::ops::Range;

use glam::{DMat3, DMat4, DVec4};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::lean::Worth;
use super::ray_errors::RayErrors;
use super::{CheckpointError, Exposures, Moments, NetworkLayout, RaySampler, Rounding, TrainConfig};
use strivec_field::{Field, FieldScale, Real};
use strivec_format::Invalid;
use strivec_format::geometry::Camera;

/// The version of the file, raised when a reader of the last one would misread it.
const VERSION: &str = "1";
/// The beginning of the checksum in the metadata, as JSON. Quotes of other texts are escaped there.
const CHECKSUM: &[u8] = b"\"checksum\":\"";
/// The digits of the checksum, leading zeros included.
const CHECKSUM_DIGITS: usize = 10;

/// The metadata of the numbers of [`Rounding`].
const ROUNDING: [&str; 4] = ["bit", "first_bit", "file_bytes_goal", "file_bytes_at_start"];

/// Optimizer state and counters. Resolutions and occupancy are in the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The run's settings.
    pub config: TrainConfig,
    /// Steps done.
    pub step: u64,
    /// The step after which the optimizer last restarted.
    pub restarted_at: u64,
    /// Wall time spent so far, in seconds; only reported.
    pub seconds: f64,
    /// \[scale\]\[block\].
    pub(super) factors: Vec<Vec<Moments<f32>>>,
    pub(super) networks: Moments<f32>,
    pub(super) worth: Worth,
    /// [`super::Trainer::psnr`] before the first step, if [`super::LeanConfig::max_drop`] is set.
    pub(super) psnr_at_start: Option<f64>,
    /// How factors are rounded, if they are; the scene beside the checkpoint then has the unrounded ones.
    pub(super) rounding: Option<Rounding>,
    /// The exposures of the photographs.
    pub exposures: Exposures,
    /// The errors by which rays are drawn.
    pub(super) ray_errors: RayErrors,
    /// \[view\] the refined pose in the model's space, as [`Camera::pose`], and focal lengths; empty before the first
    /// refinement.
    pub(super) cameras: Vec<([f64; 16], [f64; 2])>,
    /// [`RaySampler::active_ray_mask`].
    pub(super) active_rays: Vec<u8>,
    /// [`RaySampler::checksum`].
    photographs: u32,
}

pub(super) fn malformed(place: &str, expected: impl ToString, found: impl ToString) -> CheckpointError {
    CheckpointError::Malformed(Invalid::new(place, expected.to_string(), found.to_string()))
}

impl Checkpoint {
    pub(super) fn start(config: &TrainConfig, field: &Field<f32>, sampler: &RaySampler<'_>) -> Self {
        let mut checkpoint = Self {
            config: config.clone(),
            step: 0,
            restarted_at: 0,
            seconds: 0.0,
            factors: Vec::new(),
            networks: Moments::default(),
            worth: Worth::none(field),
            psnr_at_start: None,
            rounding: None,
            exposures: Exposures::new(config.photographs.exposure, sampler.view_count()),
            ray_errors: RayErrors::unknown(sampler.block_count()),
            cameras: Vec::new(),
            active_rays: sampler.active_ray_mask(),
            photographs: sampler.checksum(),
        };
        checkpoint.restart(field);
        checkpoint
    }

    /// Resets the optimizer, for the resolutions that `field` has now.
    pub(super) fn restart(&mut self, field: &Field<f32>) {
        self.restarted_at = self.step;
        // The old moments first: they are as large as two scenes.
        self.factors = Vec::new();
        let zeros = |scale: &FieldScale<f32>| scale.blocks().map(|b| Moments::zeros(b.values().len())).collect();
        self.factors = field.scales.iter().map(zeros).collect();
        self.networks = Moments::zeros(NetworkLayout::new(field).len());
    }

    /// Removes the optimizer's state of all tensors but \[scale\] those of index `kept`, of `field`.
    pub(super) fn keep_tensors(&mut self, kept: &[Vec<usize>], field: &Field<f32>) {
        for (s, (kept, scale)) in kept.iter().zip(&field.scales).enumerate() {
            for (moments, block) in self.factors[s].iter_mut().zip(scale.blocks()) {
                moments.keep_tensors(kept, block.held());
            }
            self.worth.keep_tensors(s, kept, scale);
        }
    }

    /// Checks that this belongs to `field` and to the photographs of `sampler`, and restores its active rays.
    pub(super) fn restore<T: Real>(
        &self,
        field: &Field<T>,
        sampler: &mut RaySampler<'_>,
    ) -> Result<(), CheckpointError> {
        let expect = |place: &str, expected: usize, found: usize| {
            if expected == found { Ok(()) } else { Err(malformed(place, expected, found)) }
        };
        expect("scales", field.scales.len(), self.factors.len())?;
        for (s, scale) in field.scales.iter().enumerate() {
            let (moments, rises) = (&self.factors[s], &self.worth.rises[s]);
            let blocks = scale.blocks().count();
            expect(&format!("moments of scale {s}"), blocks, moments.len())?;
            expect(&format!("worth of scale {s}"), blocks, rises.len())?;
            for (b, ((block, moments), rises)) in scale.blocks().zip(moments).zip(rises).enumerate() {
                expect(&format!("moments of scale {s}, block {b}"), block.values().len(), moments.first.len())?;
                expect(&format!("worth of scale {s}, block {b}"), block.held().components(), rises.len())?;
            }
        }
        for (s, (codes, scale)) in self.rounding.iter().flat_map(|r| &r.codes).zip(&field.scales).enumerate() {
            for (b, (codes, block)) in codes.iter().zip(scale.blocks()).enumerate() {
                expect(&format!("step codes of scale {s}, block {b}"), block.held().components(), codes.len())?;
            }
        }
        expect("network moments", NetworkLayout::new(field).len(), self.networks.first.len())?;
        expect("exposures", sampler.view_count(), self.exposures.view_count())?;
        expect("ray errors", sampler.block_count(), self.ray_errors.0.len())?;
        if sampler.checksum() != self.photographs || !sampler.restore_active_rays(&self.active_rays) {
            return Err(malformed("photographs", "those of the dataset", "other ones"));
        }
        if !self.cameras.is_empty() {
            expect("cameras", sampler.view_count(), self.cameras.len())?;
            let camera = |(view, (pose, focal)): (usize, &([f64; 16], [f64; 2]))| {
                let old = sampler.camera(view);
                for focal in focal {
                    Camera::posed(pose, [old.width, old.height], *focal)
                        .map_err(|e| malformed(&format!("camera {view}"), e.expected, e.found))?;
                }
                // The numbers as they are: those of a checked pose are rounded once more.
                let [x, y, z, position] = DMat4::from_cols_array(pose).transpose().to_cols_array_2d().map(DVec4::from);
                let world_from_camera = DMat3::from_cols(x.truncate(), y.truncate(), z.truncate());
                Ok(Camera { world_from_camera, position: position.truncate(), focal: *focal, ..*old })
            };
            let cameras: Result<Vec<Camera>, CheckpointError> = self.cameras.iter().enumerate().map(camera).collect();
            sampler.set_cameras(cameras?);
        }
        Ok(())
    }

    /// The bytes of the checkpoint, with the scene's own file in it.
    pub fn to_bytes(&self, scene_file: &[u8]) -> Vec<u8> {
        let mut tensors: Vec<(String, Dtype, &[u8])> = Vec::new();
        for (name, moments) in self.moments() {
            tensors.push((format!("{name}.first"), Dtype::F32, bytemuck::cast_slice(&moments.first)));
            tensors.push((format!("{name}.second"), Dtype::F32, bytemuck::cast_slice(&moments.second)));
        }
        for (s, rises) in self.worth.rises.iter().enumerate() {
            for (b, rises) in rises.iter().enumerate() {
                tensors.push((format!("worth.{s}.{b}"), Dtype::F64, bytemuck::cast_slice(rises)));
            }
        }
        for (s, codes) in self.rounding.iter().flat_map(|rounding| &rounding.codes).enumerate() {
            for (b, codes) in codes.iter().enumerate() {
                tensors.push((format!("step_codes.{s}.{b}"), Dtype::U8, codes));
            }
        }
        let exposures = self.exposures.to_numbers();
        tensors.push(("exposures".into(), Dtype::F64, bytemuck::cast_slice(&exposures)));
        let poses: Vec<f64> = self.cameras.iter().flat_map(|(pose, _)| *pose).collect();
        let focals: Vec<f64> = self.cameras.iter().flat_map(|(_, focal)| *focal).collect();
        tensors.push(("poses".into(), Dtype::F64, bytemuck::cast_slice(&poses)));
        tensors.push(("focal_lengths".into(), Dtype::F64, bytemuck::cast_slice(&focals)));
        tensors.push(("ray_errors".into(), Dtype::F32, bytemuck::cast_slice(&self.ray_errors.0)));
        tensors.push(("active_rays".into(), Dtype::U8, &self.active_rays));
        // The scene's own file, so that scenes have one encoding.
        tensors.push(("scene".into(), Dtype::U8, scene_file));
        // One order, so that a state has one file.
        tensors.sort_by(|a, b| a.0.cmp(&b.0));
        let mut metadata = HashMap::from([
            ("config".to_string(), self.config.to_toml()),
            ("step".to_string(), self.step.to_string()),
            ("worth_steps".to_string(), self.worth.steps.to_string()),
            ("restarted_at".to_string(), self.restarted_at.to_string()),
            ("seconds".to_string(), self.seconds.to_string()),
            ("photographs".to_string(), self.photographs.to_string()),
            ("version".to_string(), VERSION.to_string()),
            ("checksum".to_string(), "0".repeat(CHECKSUM_DIGITS)),
        ]);
        if let Some(psnr) = self.psnr_at_start {
            metadata.insert("psnr_at_start".to_string(), psnr.to_string());
        }
        if let Some(Rounding { bit, first_bit, goal, start, .. }) = &self.rounding {
            let numbers = [bit.to_string(), first_bit.to_string(), goal.to_string(), start.to_string()];
            metadata.extend(ROUNDING.map(str::to_string).into_iter().zip(numbers));
        }
        let views = tensors.iter().map(|(name, dtype, bytes)| {
            let view = TensorView::new(*dtype, vec![bytes.len() * 8 / dtype.bitsize()], bytes);
            (name.as_str(), view.expect("the length is a multiple of the element's"))
        });
        let mut file = safetensors::serialize(views, Some(metadata)).expect("names and lengths are sound");
        let digits = checksum_digits(&file).expect("the metadata have a checksum");
        let checksum = checksum(&file, &digits);
        file[digits].copy_from_slice(format!("{checksum:0CHECKSUM_DIGITS$}").as_bytes());
        file
    }

    fn moments(&self) -> impl Iterator<Item = (String, &Moments<f32>)> {
        let scales = self.factors.iter().enumerate();
        let named = scales.flat_map(|(s, blocks)| {
            blocks.iter().enumerate().map(move |(b, moments)| (format!("factors.{s}.{b}"), moments))
        });
        named.chain([("networks".to_string(), &self.networks)])
    }

    /// Reads the bytes of [`Checkpoint::to_bytes`]: the checkpoint, and the scene's own file.
    ///
    /// # Errors
    ///
    /// If the file is of another version, or a part is missing or damaged; the error names the first such part.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, Vec<u8>), CheckpointError> {
        let not_safetensors =
            |e: safetensors::SafeTensorError| malformed("file", "a safetensors file", format!("a damaged one ({e})"));
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(not_safetensors)?;
        let file = SafeTensors::deserialize(bytes).map_err(not_safetensors)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let text =
            |key: &str| metadata.get(key).ok_or_else(|| malformed(&format!("metadata {key}"), "present", "missing"));
        fn number<N: std::str::FromStr>(key: &str, text: &str) -> Result<N, CheckpointError> {
            text.parse().map_err(|_| malformed(&format!("metadata {key}"), "a number", text))
        }
        let version = text("version").map_or("an older one", String::as_str);
        if version != VERSION {
            let expected = format!("{VERSION}; finish the run with the program that wrote it");
            return Err(malformed("version", expected, version));
        }
        let digits = checksum_digits(bytes).ok_or_else(|| malformed("metadata checksum", "present", "missing"))?;
        let found = checksum(bytes, &digits);
        let expected: u32 = number("checksum", text("checksum")?)?;
        if bytes[digits] != *format!("{found:0CHECKSUM_DIGITS$}").as_bytes() {
            return Err(malformed("bytes", format!("of the checksum {expected}"), found));
        }
        let tensor = |name: &str, dtype: Dtype| {
            let view = file.tensor(name).map_err(|_| malformed(&format!("tensor {name}"), "present", "missing"))?;
            if view.dtype() != dtype {
                return Err(malformed(&format!("tensor {name}"), format!("{dtype:?}"), format!("{:?}", view.dtype())));
            }
            Ok(view.data())
        };
        let moments = |name: &str| -> Result<Moments<f32>, CheckpointError> {
            let part = |which: &str| {
                Ok::<_, CheckpointError>(bytemuck::pod_collect_to_vec(tensor(&format!("{name}.{which}"), Dtype::F32)?))
            };
            let moments: Moments<f32> = Moments { first: part("first")?, second: part("second")? };
            if moments.first.len() != moments.second.len() {
                return Err(malformed(&format!("{name}.second"), moments.first.len(), moments.second.len()));
            }
            Ok(moments)
        };
        let exposures: Vec<f64> = bytemuck::pod_collect_to_vec(tensor("exposures", Dtype::F64)?);
        let poses: Vec<f64> = bytemuck::pod_collect_to_vec(tensor("poses", Dtype::F64)?);
        let focals: Vec<f64> = bytemuck::pod_collect_to_vec(tensor("focal_lengths", Dtype::F64)?);
        if !poses.len().is_multiple_of(16) || 8 * focals.len() != poses.len() {
            let found = format!("{} and {}", poses.len(), focals.len());
            return Err(malformed("tensors poses and focal_lengths", "16 and 2 numbers for each photograph", found));
        }
        let (poses, focals) = (poses.as_chunks().0, focals.as_chunks().0);
        let config = TrainConfig::from_toml(text("config")?, None)?;
        // [scale][block]
        let has = |place: &String| file.tensor(&format!("factors.{place}.first")).is_ok();
        let blocks_of = |s: usize| (0..).map(move |b| format!("{s}.{b}")).take_while(has).collect();
        let places: Vec<Vec<String>> = (0..config.scales.len()).map(blocks_of).collect();
        let rises = of_blocks(&places, |place| {
            Ok(bytemuck::pod_collect_to_vec(tensor(&format!("worth.{place}"), Dtype::F64)?))
        })?;
        let rounding = if metadata.contains_key(ROUNDING[0]) {
            let [bit, first_bit, goal, start] = ROUNDING;
            Some(Rounding {
                codes: of_blocks(&places, |place| Ok(tensor(&format!("step_codes.{place}"), Dtype::U8)?.to_vec()))?,
                bit: number(bit, text(bit)?)?,
                first_bit: number(first_bit, text(first_bit)?)?,
                goal: number(goal, text(goal)?)?,
                start: number(start, text(start)?)?,
            })
        } else {
            None
        };
        let checkpoint = Self {
            rounding,
            worth: Worth { rises, steps: number("worth_steps", text("worth_steps")?)? },
            psnr_at_start: text("psnr_at_start").ok().map(|text| number("psnr_at_start", text)).transpose()?,
            step: number("step", text("step")?)?,
            restarted_at: number("restarted_at", text("restarted_at")?)?,
            seconds: number("seconds", text("seconds")?)?,
            photographs: number("photographs", text("photographs")?)?,
            factors: of_blocks(&places, |place| moments(&format!("factors.{place}")))?,
            networks: moments("networks")?,
            exposures: Exposures::from_numbers(&exposures)
                .ok_or_else(|| malformed("tensor exposures", "the sums and maps of photographs", "other numbers"))?,
            cameras: poses.iter().copied().zip(focals.iter().copied()).collect(),
            ray_errors: RayErrors(bytemuck::pod_collect_to_vec(tensor("ray_errors", Dtype::F32)?)),
            active_rays: tensor("active_rays", Dtype::U8)?.to_vec(),
            config,
        };
        if !(checkpoint.seconds.is_finite() && checkpoint.seconds >= 0.0) {
            return Err(malformed("seconds", "a finite number of at least 0", checkpoint.seconds));
        }
        if checkpoint.restarted_at > checkpoint.step || checkpoint.step > checkpoint.config.schedule.steps {
            let found = format!("{} and {}", checkpoint.restarted_at, checkpoint.step);
            return Err(malformed(
                "restarted_at and step",
                format!("ascending and at most {}", checkpoint.config.schedule.steps),
                found,
            ));
        }
        Ok((checkpoint, tensor("scene", Dtype::U8)?.to_vec()))
    }
}

/// The place of the checksum's digits in the checkpoint `file`.
fn checksum_digits(file: &[u8]) -> Option<Range<usize>> {
    let (length, rest) = file.split_first_chunk()?;
    let header = &rest[..rest.len().min(usize::try_from(u64::from_le_bytes(*length)).ok()?)];
    let before = header.windows(CHECKSUM.len()).position(|window| window == CHECKSUM)?;
    let first = length.len() + before + CHECKSUM.len();
    let digits = first..first + CHECKSUM_DIGITS;
    (digits.end <= length.len() + header.len()).then_some(digits)
}

/// The checksum of `file` with zeros at `digits`.
fn checksum(file: &[u8], digits: &Range<usize>) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&file[..digits.start]);
    hasher.update(&[b'0'; CHECKSUM_DIGITS]);
    hasher.update(&file[digits.end..]);
    hasher.finalize()
}

/// \[scale\]\[block\] what `read` finds at `places`.
fn of_blocks<V>(
    places: &[Vec<String>],
    read: impl Fn(&str) -> Result<V, CheckpointError>,
) -> Result<Vec<Vec<V>>, CheckpointError> {
    places.iter().map(|of_scale| of_scale.iter().map(|place| read(place)).collect()).collect()
}
