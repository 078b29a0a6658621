//! Time by stage and counts of work, of a training step or a picture.
//!
//! Always on: the clock is read a few dozen times per chunk of rays, which costs no measurable time.

use std::time::Instant;

strivec_format::named! {
    /// A part of a training step or of a picture.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[repr(usize)]
    pub enum Stage {
        /// Sampling rays and ordering them in space.
        Rays = "rays",
        /// Marching rays through the occupancy to the samples that may count.
        March = "march",
        /// Finding each sample's neighbors and their weights.
        Neighbors = "neighbors",
        /// Interpolating density factors.
        DensityGather = "density gather",
        /// Opacities, transmittances, and pixels from samples' colors.
        Composite = "compositing",
        /// Interpolating appearance factors.
        AppearanceGather = "appearance gather",
        /// Appearance matrices: components to features.
        AppearanceMatrices = "appearance matrices",
        /// Positional encoding, and the decoder's input rows.
        Encoding = "encoding",
        /// The MLP.
        Decoder = "decoder",
        /// Backward of compositing and loss.
        CompositeBackward = "compositing, backward",
        /// Backward of the MLP, its weights' gradients included.
        DecoderBackward = "decoder, backward",
        /// Backward of the positional encoding.
        EncodingBackward = "encoding, backward",
        /// Backward of the appearance matrices, their own gradients included.
        AppearanceMatricesBackward = "appearance matrices, backward",
        /// Sorting (tensor, sample) contributions by tensor.
        ContributionOrder = "contribution order",
        /// Gradients of density factors.
        DensityBackward = "density, backward",
        /// Gradients of appearance factors.
        AppearanceBackward = "appearance, backward",
        /// Adam over all trained parameters, with regularization and the sums of the shared weights' gradients.
        Optimizer = "optimizer",
    }
}

impl Stage {
    /// Number of stages.
    pub const COUNT: usize = 17;
}

/// Core seconds by stage, and counts of the work done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work {
    /// \[stage\] seconds, summed over threads.
    pub seconds: [f64; Stage::COUNT],
    /// Rays marched.
    pub rays: u64,
    /// Samples whose density was computed.
    pub evaluated: u64,
    /// Samples that counted (spec 4.8); samples evaluated beyond a ray's end do not.
    pub samples: u64,
    /// (tensor, sample) contributions of the evaluated samples, by scale.
    pub contributions: Vec<u64>,
    /// Density components of these contributions: those that their tensors hold.
    pub density_components: u64,
    /// Samples that were shaded (spec 4.8).
    pub shaded: u64,
    /// (tensor, sample) contributions of the shaded samples, by scale.
    pub shaded_contributions: Vec<u64>,
    /// Appearance components of these contributions: those that their tensors hold.
    pub appearance_components: u64,
    /// Decoder evaluations: one per shaded sample or, in modes that decode rays, one per ray.
    pub decoded: u64,
}

impl Work {
    /// Adds `other`.
    pub fn add(&mut self, other: &Self) {
        for (sum, s) in self.seconds.iter_mut().zip(other.seconds) {
            *sum += s;
        }
        self.rays += other.rays;
        self.evaluated += other.evaluated;
        self.samples += other.samples;
        self.shaded += other.shaded;
        self.density_components += other.density_components;
        self.appearance_components += other.appearance_components;
        self.decoded += other.decoded;
        for (sums, counts) in [
            (&mut self.contributions, &other.contributions),
            (&mut self.shaded_contributions, &other.shaded_contributions),
        ] {
            sums.resize(sums.len().max(counts.len()), 0);
            sums.iter_mut().zip(counts).for_each(|(sum, &count)| *sum += count);
        }
    }

    /// Core seconds of `stage`.
    pub fn seconds_of(&self, stage: Stage) -> f64 {
        self.seconds[stage as usize]
    }
}

/// A stopwatch that books time by stage.
#[derive(Clone, Debug)]
pub struct StageClock {
    /// Time and counts booked so far.
    pub work: Work,
    last: Instant,
}

impl Default for StageClock {
    fn default() -> Self {
        Self { work: Work::default(), last: Instant::now() }
    }
}

impl StageClock {
    /// Clears what was booked and starts now.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Discards the time since the last call.
    pub fn skip(&mut self) {
        self.last = Instant::now();
    }

    /// Books the time since the last call under `stage`.
    pub fn lap(&mut self, stage: Stage) {
        // One reading ends a stage and begins the next, so that no time is lost between them.
        let now = Instant::now();
        self.work.seconds[stage as usize] += (now - self.last).as_secs_f64();
        self.last = now;
    }
}
