//! Time by stage and counts of work, of a training step or a picture.
//!
//! Always on: the clock is read a few dozen times per chunk of rays, which costs no measurable time.

use std::time::Instant;

/// A part of a training step or of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Stage {
    /// Sampling rays and ordering them in space.
    Rays,
    /// Marching rays through the occupancy to the samples that may count.
    March,
    /// Finding each sample's neighbors and their weights.
    Neighbors,
    /// Interpolating density factors.
    DensityGather,
    /// Opacities, transmittances, and pixels from samples' colors.
    Composite,
    /// Interpolating appearance factors.
    AppearanceGather,
    /// Appearance matrices: components to features.
    AppearanceMatrices,
    /// Positional encoding, and the decoder's input rows.
    Encoding,
    /// The MLP.
    Decoder,
    /// Backward of compositing and loss.
    CompositeBackward,
    /// Backward of the MLP, its weights' gradients included.
    DecoderBackward,
    /// Backward of the positional encoding.
    EncodingBackward,
    /// Backward of the appearance matrices, their own gradients included.
    AppearanceMatricesBackward,
    /// Sorting (tensor, sample) contributions by tensor.
    ContributionOrder,
    /// Gradients of density factors.
    DensityBackward,
    /// Gradients of appearance factors.
    AppearanceBackward,
    /// Adam over all trained parameters, with regularization and the sums of the shared weights' gradients.
    Optimizer,
}

impl Stage {
    /// Number of stages.
    pub const COUNT: usize = 17;

    /// All stages, in the order of a training step.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Rays,
        Self::March,
        Self::Neighbors,
        Self::DensityGather,
        Self::Composite,
        Self::AppearanceGather,
        Self::AppearanceMatrices,
        Self::Encoding,
        Self::Decoder,
        Self::CompositeBackward,
        Self::DecoderBackward,
        Self::EncodingBackward,
        Self::AppearanceMatricesBackward,
        Self::ContributionOrder,
        Self::DensityBackward,
        Self::AppearanceBackward,
        Self::Optimizer,
    ];

    /// The stage's name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::March => "march",
            Self::Neighbors => "neighbors",
            Self::DensityGather => "density gather",
            Self::Composite => "compositing",
            Self::AppearanceGather => "appearance gather",
            Self::AppearanceMatrices => "appearance matrices",
            Self::Encoding => "encoding",
            Self::Decoder => "decoder",
            Self::CompositeBackward => "compositing, backward",
            Self::DecoderBackward => "decoder, backward",
            Self::EncodingBackward => "encoding, backward",
            Self::AppearanceMatricesBackward => "appearance matrices, backward",
            Self::ContributionOrder => "contribution order",
            Self::DensityBackward => "density, backward",
            Self::AppearanceBackward => "appearance, backward",
            Self::Optimizer => "optimizer",
        }
    }
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
