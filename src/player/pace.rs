//! How good the next picture may be: coarse while the camera moves, then finer and finer until it is whole.

/// Pictures are at most this many times smaller than the window in both directions.
const COARSEST: u32 = 16;
/// Of what is known of the speed, how much a new measurement leaves.
const KEPT: f64 = 0.7;
/// Fewer rays at once than this would be all overhead.
const MIN_RAYS: f64 = 1024.0;

/// Decides by what pictures have taken so far. Without a clock of its own: whoever draws says how long it took.
#[derive(Clone, Debug)]
pub struct Pace {
    /// Seconds that a picture may take while the camera moves.
    target: f64,
    /// Smoothed over pictures, as parts of one differ too much; absent before the first.
    seconds_per_ray: Option<f64>,
    /// Rays of the picture that is being drawn, and their seconds.
    drawn: (f64, f64),
    /// How much smaller the picture on the screen is than the window; absent where it is out of date.
    shown: Option<u32>,
    /// That of the picture that is being drawn.
    drawing: Option<u32>,
    /// Whether the camera has moved since the picture that is being drawn was begun.
    is_stale: bool,
}

impl Pace {
    /// For pictures of at most `target` seconds while the camera moves.
    pub fn new(target: f64) -> Self {
        Self { target, seconds_per_ray: None, drawn: (0.0, 0.0), shown: None, drawing: None, is_stale: false }
    }

    /// Sets the seconds that a picture may take while the camera moves.
    pub fn set_target(&mut self, seconds: f64) {
        self.target = seconds.clamp(0.001, 10.0);
    }

    /// The picture on the screen is out of date: the camera moved, or something else was changed.
    pub fn changed(&mut self) {
        self.shown = None;
        self.is_stale = true;
    }

    /// How many times smaller than the window, of `pixels` pixels, a picture has to be that takes no longer than the target.
    pub fn coarse(&self, pixels: u64) -> u32 {
        let Some(seconds) = self.seconds_per_ray else { return COARSEST };
        let fits = |divisor: &u32| seconds * pixels as f64 / f64::from(divisor * divisor) <= self.target;
        [1, 2, 4, 8].into_iter().find(fits).unwrap_or(COARSEST)
    }

    /// How many times smaller than the window, of `pixels` pixels, the picture should be that is to be begun now; `None` where
    /// the one on the screen, or the one that is being drawn, is just right.
    pub fn next(&self, pixels: u64) -> Option<u32> {
        let coarse = self.coarse(pixels);
        match (self.drawing, self.shown) {
            // A quick picture is worth finishing though the camera has moved on; a slow one is not.
            (Some(divisor), _) if self.is_stale && divisor < coarse => Some(coarse),
            (Some(_), _) => None,
            (None, None) => Some(coarse),
            (None, Some(1)) => None,
            (None, Some(divisor)) => Some(divisor / 2),
        }
    }

    /// A picture `divisor` times smaller than the window is begun.
    pub fn begun(&mut self, divisor: u32) {
        self.learn();
        (self.drawing, self.is_stale) = (Some(divisor), false);
    }

    /// It is on the screen.
    pub fn finished(&mut self) {
        self.learn();
        if let Some(divisor) = self.drawing.take() {
            self.shown = (!self.is_stale).then_some(divisor);
        }
    }

    /// It will not be finished.
    pub fn abandoned(&mut self) {
        self.drawing = None;
    }

    /// Some `rays` of the picture took `seconds`.
    pub fn measured(&mut self, rays: u32, seconds: f64) {
        if seconds > 0.0 && seconds.is_finite() {
            self.drawn = (self.drawn.0 + f64::from(rays), self.drawn.1 + seconds);
        }
    }

    /// Makes use of what was measured of a picture, whole or not.
    fn learn(&mut self) {
        let (rays, seconds) = std::mem::take(&mut self.drawn);
        if rays > 0.0 {
            let new = seconds / rays;
            self.seconds_per_ray = Some(self.seconds_per_ray.map_or(new, |old| KEPT * old + (1.0 - KEPT) * new));
        }
    }

    /// Rays that can be given to the device at once without the window standing still for longer than the target.
    pub fn rays_at_once(&self) -> u32 {
        self.seconds_per_ray.map_or(MIN_RAYS, |seconds| (0.5 * self.target / seconds).max(MIN_RAYS)) as u32
    }

    /// Whether the best picture is on the screen.
    pub fn is_at_rest(&self) -> bool {
        self.shown == Some(1) && self.drawing.is_none()
    }

    /// How many times smaller than the window the picture on the screen is.
    pub fn shown(&self) -> Option<u32> {
        self.shown
    }

    /// Rays a second, once anything was drawn.
    pub fn rays_per_second(&self) -> Option<f64> {
        self.seconds_per_ray.map(f64::recip)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window of 1600 by 1000.
    const PIXELS: u64 = 1_600_000;

    /// Draws until the picture is whole, on a device of `rays_per_second`; the divisors of the pictures.
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
        assert_eq!(settle(&mut fast, 1e9), [1], "a fast device is never coarse");
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
        assert_eq!((pace.shown(), pace.next(PIXELS)), (None, Some(8)), "of an older camera");
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
