//! Where the time of a step or a picture goes, and how much work was done: what measurements divide by each other.
//!
//! Always on: a clock is read a few dozen times a chunk of rays, which costs nothing against what it tells apart.

use std::time::Instant;

/// A part of a training step or of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Stage {
    /// Drawing rays and ordering them in space.
    Rays,
    /// Walking rays through the occupancy to the samples that may count.
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
    /// Ordering (tensor, sample) contributions by tensor.
    ContributionOrder,
    /// Gradients of density factors.
    DensityBackward,
    /// Gradients of appearance factors.
    AppearanceBackward,
    /// Adam, over everything that is trained; summing shared weights' gradients and regularization included.
    Optimizer,
}

impl Stage {
    /// How many there are.
    pub const COUNT: usize = 17;

    /// All, in the order in which a step goes through them.
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

    /// Its name in reports.
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

/// Core seconds by stage, and counts of what was done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work {
    /// \[stage\] seconds, summed over threads.
    pub seconds: [f64; Stage::COUNT],
    /// Rays marched.
    pub rays: u64,
    /// Samples whose density was computed.
    pub evaluated: u64,
    /// Samples that counted: those evaluated beyond a ray's end did not.
    pub samples: u64,
    /// (tensor, sample) contributions of the evaluated samples, by scale.
    pub contributions: Vec<u64>,
    /// Samples that were shaded.
    pub shaded: u64,
    /// (tensor, sample) contributions of the shaded samples, by scale.
    pub shaded_contributions: Vec<u64>,
    /// Calls of the decoder: shaded samples, or rays where it is called once a ray.
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
        self.decoded += other.decoded;
        for (sums, counts) in [(&mut self.contributions, &other.contributions), (&mut self.shaded_contributions, &other.shaded_contributions)] {
            sums.resize(sums.len().max(counts.len()), 0);
            sums.iter_mut().zip(counts).for_each(|(sum, &n)| *sum += n);
        }
    }

    /// Core seconds of `stage`.
    pub fn seconds_of(&self, stage: Stage) -> f64 {
        self.seconds[stage as usize]
    }
}

/// Books time and counts as work goes from one stage to the next.
#[derive(Clone, Debug)]
pub struct StageClock {
    /// What was booked.
    pub work: Work,
    last: Instant,
}

impl Default for StageClock {
    fn default() -> Self {
        Self { work: Work::default(), last: Instant::now() }
    }
}

impl StageClock {
    /// Forgets what was booked, and begins now.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Forgets the time since the last call.
    pub fn skip(&mut self) {
        self.last = Instant::now();
    }

    /// Books the time since the last call under `stage`.
    pub fn lap(&mut self, stage: Stage) {
        let now = Instant::now();
        self.work.seconds[stage as usize] += (now - self.last).as_secs_f64();
        self.last = now;
    }
}
