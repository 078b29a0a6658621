//! Resolution of the next picture: coarse while the camera moves, then doubled with each picture up to the window's.

/// Maximum divisor of the window's resolution, per axis.
const COARSEST: u32 = 16;
/// Weight of the old estimate of the speed in the moving average.
const SMOOTHING: f64 = 0.7;
/// Minimum number of rays of a batch; overhead dominates smaller ones.
const MIN_RAYS: f64 = 1024.0;

/// Chooses the resolution and the batches of the next picture from the measured speed. It reads no clock: pass times to
/// [`Pace::measured`].
#[derive(Clone, Debug)]
pub struct Pace {
    /// Maximum seconds of a picture while the camera moves.
    target: f64,
    /// Moving average over pictures, as the speed differs too much between parts of one; `None` before the first.
    seconds_per_ray: Option<f64>,
    /// Measured rays of the picture that is being drawn, and their seconds.
    drawn: (f64, f64),
    /// Divisor of the displayed picture; `None` if it is out of date.
    shown: Option<u32>,
    /// Divisor of the picture that is being drawn.
    drawing: Option<u32>,
    /// True if the camera has moved since the picture that is being drawn was begun.
    is_stale: bool,
}

impl Pace {
    /// Aims at pictures of at most `target` seconds while the camera moves.
    pub fn new(target: f64) -> Self {
        Self { target, seconds_per_ray: None, drawn: (0.0, 0.0), shown: None, drawing: None, is_stale: false }
    }

    /// Sets the maximum seconds of a picture while the camera moves, clamped to 0.001 to 10.
    pub fn set_target(&mut self, seconds: f64) {
        self.target = seconds.clamp(0.001, 10.0);
    }

    /// Marks the displayed picture as out of date, after the camera or a setting has changed.
    pub fn changed(&mut self) {
        self.shown = None;
        self.is_stale = true;
    }

    /// Smallest divisor at which a picture takes no longer than the target, for a window of `pixels` pixels.
    pub fn coarse(&self, pixels: u64) -> u32 {
        let Some(seconds) = self.seconds_per_ray else { return COARSEST };
        let fits = |divisor: &u32| seconds * pixels as f64 / f64::from(divisor * divisor) <= self.target;
        [1, 2, 4, 8].into_iter().find(fits).unwrap_or(COARSEST)
    }

    /// Divisor of the picture to begin now, for a window of `pixels` pixels; `None` if no new picture is needed, as the
    /// displayed one is final or the one that is being drawn is to be finished.
    pub fn next(&self, pixels: u64) -> Option<u32> {
        let coarse = self.coarse(pixels);
        match (self.drawing, self.shown) {
            // A quick picture is finished even if the camera has moved since; a slow one is replaced.
            (Some(divisor), _) if self.is_stale && divisor < coarse => Some(coarse),
            (Some(_), _) => None,
            (None, None) => Some(coarse),
            (None, Some(1)) => None,
            (None, Some(divisor)) => Some(divisor / 2),
        }
    }

    /// Marks a picture of this divisor as begun.
    pub fn begun(&mut self, divisor: u32) {
        self.update_speed();
        (self.drawing, self.is_stale) = (Some(divisor), false);
    }

    /// Marks the picture as finished and displayed.
    pub fn finished(&mut self) {
        self.update_speed();
        if let Some(divisor) = self.drawing.take() {
            self.shown = (!self.is_stale).then_some(divisor);
        }
    }

    /// Marks the picture as discarded.
    pub fn abandoned(&mut self) {
        self.drawing = None;
    }

    /// Records that `rays` rays of the picture took `seconds`.
    pub fn measured(&mut self, rays: u32, seconds: f64) {
        if seconds > 0.0 && seconds.is_finite() {
            self.drawn = (self.drawn.0 + f64::from(rays), self.drawn.1 + seconds);
        }
    }

    /// Updates the estimate of the speed by the measurements of a picture, finished or not.
    fn update_speed(&mut self) {
        let (rays, seconds) = std::mem::take(&mut self.drawn);
        if rays > 0.0 {
            let new = seconds / rays;
            self.seconds_per_ray =
                Some(self.seconds_per_ray.map_or(new, |old| SMOOTHING * old + (1.0 - SMOOTHING) * new));
        }
    }

    /// Number of rays to submit at once: a batch takes about half of the target, so that the window keeps responding.
    pub fn rays_at_once(&self) -> u32 {
        self.seconds_per_ray.map_or(MIN_RAYS, |seconds| (0.5 * self.target / seconds).max(MIN_RAYS)) as u32
    }

    /// True if the picture of full resolution is displayed and none is being drawn.
    pub fn is_at_rest(&self) -> bool {
        self.shown == Some(1) && self.drawing.is_none()
    }

    /// Divisor of the displayed picture; `None` if it is out of date.
    pub fn shown(&self) -> Option<u32> {
        self.shown
    }

    /// Rays per second; `None` before the first picture.
    pub fn rays_per_second(&self) -> Option<f64> {
        self.seconds_per_ray.map(f64::recip)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window of 1600 by 1000.
    const PIXELS: u64 = 1_600_000;

    /// Draws until the picture has full resolution, on a device of `rays_per_second`. Returns the pictures' divisors.
    fn settle(pace: &mut Pace, rays_per_second: f64) -> Vec<u32> {
        let mut drawn = Vec::new();
        while let Some(divisor) = pace.next(PIXELS) {
            pace.begun(divisor);
            let rays = (PIXELS / u64::from(divisor * divisor)) as u32;
            pace.measured(rays, f64::from(rays) / rays_per_second);
            pace.finished();
            drawn.push(divisor);
        }
        drawn
    }

    #[test]
    fn pictures_get_finer_until_they_are_whole() {
        let mut pace = Pace::new(0.05);
        assert_eq!(settle(&mut pace, 1e6), [16, 8, 4, 2, 1]);
        assert!(pace.is_at_rest() && pace.next(PIXELS).is_none());
        pace.changed();
        assert_eq!(settle(&mut pace, 1e6), [8, 4, 2, 1], "a million rays a second make 50 000 in 50 ms");
        let mut fast = Pace::new(0.05);
        settle(&mut fast, 1e9);
        fast.changed();
        assert_eq!(settle(&mut fast, 1e9), [1], "a fast device needs no coarse picture");
    }

    #[test]
    fn a_slow_picture_gives_way_and_a_quick_one_is_finished() {
        let mut pace = Pace::new(0.05);
        settle(&mut pace, 1e6);
        pace.changed();
        pace.begun(8);
        pace.changed();
        assert_eq!(pace.next(PIXELS), None, "a quick one");
        pace.finished();
        assert_eq!((pace.shown(), pace.next(PIXELS)), (None, Some(8)), "the finished picture has an old camera");
        pace.begun(2);
        assert_eq!(pace.next(PIXELS), None, "nothing has moved");
        pace.changed();
        assert_eq!(pace.next(PIXELS), Some(8), "a slow one");
        pace.abandoned();
        assert!(!pace.is_at_rest());
    }

    #[test]
    fn batches_fit_the_target() {
        let mut pace = Pace::new(0.05);
        assert_eq!(pace.rays_at_once(), 1024);
        pace.begun(16);
        pace.measured(10_000, 0.001);
        pace.measured(90_000, 0.099);
        pace.finished();
        assert_eq!(pace.rays_at_once(), 25_000);
        pace.measured(5, f64::NAN);
        pace.finished();
        assert_eq!(pace.rays_at_once(), 25_000);
    }
}
