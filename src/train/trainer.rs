//! One step of training, and the schedule between steps.

use rayon::prelude::*;

use super::adam::{Adam, Moments};
use super::backward::Backward;
use super::block_rules::BlockRules;
use super::divergence::DivergenceMonitor;
use super::factors::{BlockGeometry, TensorGradient};
use super::lean::{self, Worth, add_squares};
use super::network_rounding::UnroundedNetworks;
use super::networks::put_decoder;
use super::ray_errors::RayErrors;
use super::rounding::{Unrounded, UnroundedTensor};
use super::{
    BatchRoulette, Checkpoint, DeadComponents, RayBatch, RaySampler, SamplingConfig, TrainConfig, TrainError,
    network_parts, prune_dead_components,
};
use strivec_capture::dataset::Photograph;
use strivec_field::{Field, FieldDecoder, FieldFactors, Pool, Roulette, Stage, StageClock, Work, vectorized};
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::{MemoryLimit, Scene};
use strivec_format::random::Random;

/// A run in progress.
#[derive(Debug)]
pub struct Trainer<'a> {
    pub(super) config: TrainConfig,
    pub(super) sampler: RaySampler<'a>,
    /// The scene without factors. The current ones, and matrices, decoder and sky, are in `field`.
    pub(super) scene: Scene,
    pub(super) field: Field<f32>,
    pub(super) backward: Backward<f32>,
    tensor_gradients: Pool<TensorGradient<f32>>,
    order: Random,
    /// Steps of the trainings before this run.
    steps_before: u64,
    /// The number of the last step.
    last_step: u64,
    pub(super) checkpoint: Checkpoint,
    monitor: DivergenceMonitor,
    /// While factors are rounded.
    pub(super) unrounded: Option<Unrounded>,
    /// While matrices and decoder are rounded.
    pub(super) unrounded_networks: Option<UnroundedNetworks>,
}

/// The result of one step.
#[derive(Clone, Debug, PartialEq)]
pub struct StepReport {
    /// Steps done.
    pub step: u64,
    /// Mean squared error of the step's rays, before its update.
    pub mean_squared_error: f64,
    /// Counts and times of its stages.
    pub work: Work,
}

impl<'a> Trainer<'a> {
    /// Begins a run on `views` from `scene`, as made by [`super::initial_scene`].
    ///
    /// # Errors
    ///
    /// [`TrainError::NoRays`], [`TrainError::TooManyPixels`] and [`TrainError::Memory`].
    pub fn new(config: TrainConfig, mut scene: Scene, views: &'a [Photograph]) -> Result<Self, TrainError> {
        let field = field_of(&mut scene)?;
        let mut sampler = sampler_of(&scene, views, &config)?;
        sampler.filter_rays(&field);
        let checkpoint = Checkpoint::start(&config, &field, &sampler);
        let mut trainer = Self::assemble(config, scene, field, sampler, checkpoint)?;
        if trainer.config.lean.max_drop.is_some() {
            trainer.checkpoint.psnr_at_start = Some(trainer.psnr());
        }
        Ok(trainer)
    }

    /// Resumes the run of `checkpoint` and its `scene`.
    ///
    /// # Errors
    ///
    /// If `views` are not those that the run began with, `scene` is not the checkpoint's, or it takes more memory than it may.
    pub fn resume(checkpoint: Checkpoint, mut scene: Scene, views: &'a [Photograph]) -> Result<Self, TrainError> {
        let field = field_of(&mut scene)?;
        let mut sampler = sampler_of(&scene, views, &checkpoint.config)?;
        checkpoint.restore(&field, &mut sampler)?;
        Self::assemble(checkpoint.config.clone(), scene, field, sampler, checkpoint)
    }

    fn assemble(
        config: TrainConfig,
        scene: Scene,
        mut field: Field<f32>,
        sampler: RaySampler<'a>,
        checkpoint: Checkpoint,
    ) -> Result<Self, TrainError> {
        check_active_rays(&sampler)?;
        let unrounded = checkpoint.rounding.as_ref().map(|r| Unrounded::from_field(&mut field, &r.codes));
        let unrounded_networks = checkpoint.rounds_networks().then(|| UnroundedNetworks::from_field(&mut field));
        Ok(Self {
            steps_before: scene.provenance.steps.saturating_sub(checkpoint.step),
            last_step: config.schedule.steps,
            order: Random::new(config.seed, "rays"),
            backward: backward(&config, &field),
            tensor_gradients: Pool::default(),
            config,
            sampler,
            scene,
            field,
            checkpoint,
            monitor: DivergenceMonitor::default(),
            unrounded,
            unrounded_networks,
        })
    }

    /// The run's settings.
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Continues with another `scene` of the same photographs for `steps`, counted from 0, over which learning rates fall.
    /// The optimizer restarts, and the errors of rays are forgotten.
    pub(super) fn restart_from(&mut self, mut scene: Scene, steps: u64) {
        self.steps_before += self.checkpoint.step;
        self.checkpoint.step = 0;
        self.field = Field::unlimited_from_scene(&mut scene);
        self.backward = backward(&self.config, &self.field);
        self.scene = scene;
        self.config.schedule.steps = steps;
        self.last_step = steps;
        self.checkpoint.ray_errors = RayErrors::unknown(self.sampler.block_count());
        self.checkpoint.restart(&self.field);
        self.checkpoint.config = self.config.clone();
        self.checkpoint.worth = Worth::none(&self.field);
    }

    /// Steps done.
    pub fn steps_done(&self) -> u64 {
        self.checkpoint.step
    }

    /// Steps of this run and of the trainings that it continues.
    pub fn steps_in_all(&self) -> u64 {
        self.steps_before + self.checkpoint.step
    }

    /// Number of rays that training draws from.
    pub fn ray_count(&self) -> usize {
        self.sampler.active_ray_count()
    }

    /// The state that resumes the run, together with [`Trainer::scene`].
    pub fn checkpoint(&self) -> &Checkpoint {
        &self.checkpoint
    }

    /// \[view\] the refined cameras in the dataset's space; `None` if no pose has been refined.
    pub fn refined_cameras(&self) -> Option<Vec<Camera>> {
        let dataset_from_model = self.scene.frame.model_from_dataset.inverse();
        let cameras = (0..self.sampler.view_count()).map(|view| self.sampler.camera(view).mapped(&dataset_from_model));
        (!self.checkpoint.cameras.is_empty()).then(|| cameras.collect())
    }

    /// Adds to the wall time of the checkpoint.
    pub fn add_seconds(&mut self, seconds: f64) {
        self.checkpoint.seconds += seconds;
    }

    /// The current scene.
    pub fn scene(&self) -> Scene {
        self.scene_with(&self.field.decoder)
    }

    /// The current scene, with the matrices and layers of `decoder`.
    pub(super) fn scene_with(&self, decoder: &FieldDecoder<f32>) -> Scene {
        let mut scene = self.scene.clone();
        for (scale, trained) in scene.scales.iter_mut().zip(&self.field.scales) {
            scale.cloud.resolution = trained.resolution;
            for (block, trained) in scale.factors.blocks_mut().zip(trained.blocks()) {
                block.values = trained.held().dense(trained.values());
            }
        }
        put_decoder(decoder, &mut scene);
        if let (Some(sky), Some(trained)) = (&mut scene.rules.sky, &self.field.sky) {
            sky.coefficients.clone_from(&trained.coefficients);
        }
        scene.provenance.steps = self.steps_in_all();
        scene
    }

    /// \[height\]\[width\] the colors that the current scene has for `camera`, which is in the dataset's space.
    pub fn picture(&self, camera: &Camera) -> Vec<[f32; 3]> {
        let camera = camera.mapped(&self.scene.frame.model_from_dataset);
        let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
        let rays: Vec<_> = pixels.map(|(x, y)| camera.ray(x, y)).collect();
        let known: Vec<Ray> = rays.iter().flatten().copied().collect();
        let background = self.scene.frame.background;
        let mut colors = super::rays::colors(&self.field, &known, |_| background).into_iter();
        rays.iter().map(|ray| ray.and_then(|_| colors.next()).unwrap_or(background)).collect()
    }

    /// Removes the dead components of `scene`, which is [`Trainer::scene`] at the end of the run: see
    /// [`prune_dead_components`].
    ///
    /// # Errors
    ///
    /// [`TrainError::EmptyScene`].
    pub fn prune_dead_components(&self, scene: &mut Scene) -> Result<DeadComponents, TrainError> {
        prune_dead_components(scene, &self.sampler, self.checkpoint.exposures.maps(), self.config.seed)
    }

    /// One optimizer step, then the changes that the schedule has after it.
    ///
    /// # Errors
    ///
    /// If the run has diverged, or no ray passes through the model any more.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let mut clock = StageClock::default();
        let SamplingConfig { batch_rays, ray_candidates, .. } = self.config.sampling;
        // A few pixels have most of the error: drawing them more often gains 0.3 dB for a twentieth of the time
        // (docs/experiments/2026-11-26-rays-by-error.md).
        let errors = &self.checkpoint.ray_errors;
        let drawn = errors.draw(&self.sampler, &self.order, self.checkpoint.step, batch_rays, ray_candidates);
        let (RayBatch { rays, targets }, blocks) = RayBatch::of_pixels(&self.sampler, &self.field, &drawn);
        // The names of the streams determine the bits of every trained scene.
        let roulette = |below: f64, name: &str| {
            let random = Random::new(self.config.seed, name).substream(self.checkpoint.step);
            (below > 0.0).then_some(Roulette { below, random, first_ray: 0 })
        };
        let roulette = BatchRoulette {
            color: roulette(self.config.sampling.color_roulette, "thinning"),
            density: roulette(self.config.sampling.density_roulette, "density thinning"),
        };
        // All threads draw rays.
        clock.lap(Stage::Rays);
        let threads = rayon::current_num_threads() as f64;
        self.backward.color_maps.clear();
        self.backward.color_maps.extend_from_slice(self.checkpoint.exposures.maps());
        self.backward.loss(&self.field, &rays, &targets, roulette);
        let mean_squared_error = self.backward.mean_squared_error();
        self.checkpoint.step += 1;
        let step = self.checkpoint.step;
        self.checkpoint.exposures.follow(self.backward.colors(), &targets, step, self.config.schedule.steps);
        let mut weighted = 0.0;
        for ((&block, target), squared) in blocks.iter().zip(&targets).zip(self.backward.squared_errors()) {
            self.checkpoint.ray_errors.add(block, squared);
            weighted += f64::from(target.weight).powi(2) * f64::from(squared) / rays.len() as f64;
        }
        let diverged = |found| TrainError::Diverged { step, found };
        self.monitor.record(mean_squared_error, &targets, &self.config).map_err(diverged)?;
        clock.skip();
        self.update_networks();
        clock.lap(Stage::Optimizer);
        // A stage that all threads work on is booked as core seconds, like those that tasks time themselves.
        clock.work.seconds.iter_mut().for_each(|s| *s *= threads);
        let square_weight = lean::square_weight(mean_squared_error, weighted, rays.len());
        self.update_factors(square_weight, &mut clock.work);
        self.monitor.check_parameters(&mut self.field, &self.config).map_err(diverged)?;
        clock.work.add(&self.backward.work());
        let report = StepReport { step: self.checkpoint.step, mean_squared_error, work: clock.work };
        self.follow_schedule()?;
        Ok(report)
    }

    /// The optimizer's step for parameters whose learning rate starts at `start`.
    fn adam(&self, start: f64, weight_decay: f64) -> Adam<f32> {
        let since_restart = self.checkpoint.step - self.checkpoint.restarted_at;
        let along = (since_restart - 1) as f64 / self.config.schedule.steps as f64;
        // Exponential. Along a cosine it brought nothing (docs/experiments/2026-11-21-training-settings.md).
        let decay = self.config.optimizer.learning_rate_decay.powf(along);
        let left = (self.last_step + 1).saturating_sub(self.checkpoint.step) as f64;
        // Training rays gain 1.1 dB over the cooldown at full size: much of the error of late steps is their noise
        // (docs/experiments/2026-11-26-adam.md). Means of parameters do no better
        // (docs/experiments/2026-11-27-averages.md).
        let cooled = (left / (self.config.optimizer.cooldown * self.config.schedule.steps as f64)).min(1.0);
        Adam::new(start * decay * cooled, weight_decay, since_restart)
    }

    fn update_networks(&mut self) {
        let rate = self.config.optimizer.network_learning_rate;
        let [of_networks, of_sky] = [rate, self.config.optimizer.sky_learning_rate].map(|rate| self.adam(rate, 0.0));
        let sky_at = self.backward.layout.sky_at();
        let gradients = self.backward.network_gradients();
        // Gradients at the rounded weights move the unrounded ones, or steps below half a rounding step would be
        // lost.
        let mut unrounded = self.unrounded_networks.as_mut().map_or(&mut [][..], UnroundedNetworks::values_mut);
        let Moments { first, second } = &mut self.checkpoint.networks;
        let mut at = 0;
        for part in network_parts(&mut self.field) {
            let range = at..at + part.len();
            at = range.end;
            let adam = if range.start >= sky_at { &of_sky } else { &of_networks };
            let moved = unrounded.split_off_mut(..part.len()).unwrap_or(part);
            adam.update::<false>(moved, &mut first[range.clone()], &mut second[range.clone()], &gradients[range]);
        }
        match &self.unrounded_networks {
            Some(networks) => networks.round(&mut self.field),
            None if self.checkpoint.rounds_networks() => {
                self.unrounded_networks = Some(UnroundedNetworks::from_field(&mut self.field));
            }
            None => {}
        }
    }

    /// `square_weight` is [`lean::square_weight`].
    fn update_factors(&mut self, square_weight: f64, work: &mut Work) {
        let is_measuring = self.config.lean.is_measuring(self.checkpoint.step, self.config.schedule.steps);
        self.checkpoint.worth.steps += u64::from(is_measuring);
        let adam = self.adam(self.config.optimizer.factor_learning_rate, self.config.optimizer.factor_decay);
        let bit = self.rounding().map_or(0.0, |rounding| rounding.bit as f32);
        let (chunks, pool) = (&self.backward.chunks, &self.tensor_gradients);
        pool.for_each(|gradient| gradient.clock.restart());
        let geometries = BlockGeometry::of(&self.field, self.field.decoder.own_rows());
        for (s, (scale, geometries)) in self.field.scales.iter_mut().zip(geometries).enumerate() {
            let tensors = scale.len();
            let unrounded = Unrounded::of_scale(&mut self.unrounded, s, scale);
            // Taken out, because the factors are borrowed to be changed.
            let centers = std::mem::take(&mut scale.centers);
            let states = self.checkpoint.factors[s].iter_mut().zip(&mut self.checkpoint.worth.rises[s]);
            let mut updates = Vec::with_capacity(geometries.len() * tensors);
            for (((block, geometry), (moments, rises)), unrounded) in
                scale.blocks_mut().zip(geometries).zip(states).zip(unrounded)
            {
                let geometry = geometry.at(&centers);
                let rules = match geometry.appearance {
                    None => BlockRules::new(block, self.config.loss.density_l1, self.config.loss.density_variation),
                    Some(_) => BlockRules::new(block, 0.0, self.config.loss.appearance_variation),
                };
                let rises = block.held().split_mut(rises);
                let values = tensor_updates(block, moments).into_iter();
                let of_tensor = values.zip(rises).zip(unrounded).enumerate();
                updates.extend(
                    of_tensor.map(|(n, ((values, rises), unrounded))| {
                        (geometry, rules.clone(), n, values, rises, unrounded)
                    }),
                );
            }
            updates.into_par_iter().for_each(|(geometry, rules, n, [values, first, second], rises, unrounded)| {
                pool.with(|gradient| {
                    gradient.clock.skip();
                    gradient.accumulate(geometry, n, values, chunks);
                    vectorized(
                        #[inline(always)]
                        || {
                            let is_of_density = geometry.appearance.is_none();
                            // Appearance without a gradient stays as it is, so a tensor without shaded samples needs
                            // no pass at all. Density has a gradient everywhere, that of its size.
                            if !is_of_density && !gradient.has_samples {
                                return;
                            }
                            let gradients = &mut gradient.values;
                            if is_measuring {
                                add_squares(rises, values, gradients, rules.first_factor_rows(), square_weight);
                            }
                            rules.add_gradients(values, gradients);
                            // Adam follows at once, while the tensor and its gradient are in the cache.
                            UnroundedTensor::update(
                                unrounded,
                                bit,
                                rules.vectors(),
                                gradients,
                                values,
                                #[inline(always)]
                                |v, g| match is_of_density {
                                    true => adam.update::<false>(v, first, second, g),
                                    false => adam.update::<true>(v, first, second, g),
                                },
                            );
                        },
                    );
                    gradient.clock.lap(Stage::Optimizer);
                });
            });
            scale.centers = centers;
        }
        pool.for_each(|gradient| work.add(&gradient.clock.work));
    }
}

/// The field of `scene`, whose factors it takes, within the memory that the scene allows. What is trained may then take more.
fn field_of(scene: &mut Scene) -> Result<Field<f32>, TrainError> {
    let field = Field::from_scene(scene)?;
    scene.memory = MemoryLimit::NONE;
    Ok(field)
}

/// The loss of `config`, on `field`.
fn backward(config: &TrainConfig, field: &Field<f32>) -> Backward<f32> {
    let mut backward = Backward::new(field);
    (backward.distance_weight, backward.sky_of_open_rays) = (config.loss.distance_weight, true);
    backward
}

/// The rays of `views` in the space of `scene`. Random backgrounds are ignored if it has a sky.
fn sampler_of<'a>(scene: &Scene, views: &'a [Photograph], config: &TrainConfig) -> Result<RaySampler<'a>, TrainError> {
    let sampler = RaySampler::new(views, &scene.frame, config)?;
    Ok(if scene.rules.sky.is_some() { sampler.without_random_backgrounds() } else { sampler })
}

pub(super) fn check_active_rays(sampler: &RaySampler<'_>) -> Result<(), TrainError> {
    match sampler.active_ray_count() {
        0 => Err(TrainError::NoRays { pixels: sampler.active_ray_mask().len() as u64 * 8 }),
        _ => Ok(()),
    }
}

/// \[tensor\] the factors that it holds, and both moments.
fn tensor_updates<'a>(factors: &'a mut FieldFactors<f32>, moments: &'a mut Moments<f32>) -> Vec<[&'a mut [f32]; 3]> {
    let (held, factors) = factors.split();
    let [factors, first, second] =
        [factors, &mut moments.first, &mut moments.second].map(|values| held.split_mut(values));
    let of_tensor = |((factors, first), second)| [factors, first, second];
    factors.into_iter().zip(first).zip(second).map(of_tensor).collect()
}
