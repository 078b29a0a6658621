//! Exposure and white balance of photographs: an affine map of the scene's colors for each, fitted while the scene trains.
//!
//! An affine map of least squares needs no learning rate. The maps follow in closed form from sums over the last
//! batches, in which older rays count less and less. Their mean is the identity, so that the scene has the colors of
//! the mean photograph.

use super::Exposure;
use glam::{DMat3, DVec3};

use super::Target;
use strivec_format::color_map::{ColorFit, ColorMap};
use strivec_format::psnr::psnr_of_mse;

/// The share of steps after which colors are mapped, and after which [`Exposure::Auto`] decides.
const FITTED_FROM: f64 = 0.05;
const DECIDED_AT: f64 = 0.1;
/// Steps between two fits.
const FIT_EVERY: u64 = 10;
/// The factor by which an older step counts less than the next one.
const FADING: f64 = 0.99;
/// The weight of the identity in a fit, in rays.
const RIDGE: f64 = 20.0;
/// The gain of the fit, in dB on training rays, from which [`Exposure::Auto`] maps colors. Scenes photographed with one
/// exposure gain 0.1 to 0.4 dB: the fit also takes up a part of other errors.
const WORTHWHILE: f64 = 1.0;

/// The maps of all photographs.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposures {
    setting: Exposure,
    sums: Vec<ColorFit>,
    /// \[view\]; empty while no color is mapped.
    maps: Vec<ColorMap>,
}

impl Exposures {
    /// The exposures of `views` photographs, not known yet.
    pub(super) fn new(setting: Exposure, views: usize) -> Self {
        Self { setting, sums: vec![ColorFit::default(); views], maps: Vec::new() }
    }

    /// \[view\] the map from the scene's colors to the photograph's; empty if there are none.
    pub fn maps(&self) -> &[ColorMap] {
        &self.maps
    }

    /// Number of photographs.
    pub(super) fn view_count(&self) -> usize {
        self.sums.len()
    }

    /// Counts the colors that the scene has along a step's rays, before any map, and fits the maps when it is due. `step`
    /// of `steps` is done.
    pub(super) fn follow(&mut self, colors: impl Iterator<Item = [f32; 3]>, targets: &[Target], step: u64, steps: u64) {
        if self.setting == Exposure::Off {
            return;
        }
        self.sums.iter_mut().for_each(|sums| sums.scale(FADING));
        for (color, target) in colors.zip(targets) {
            self.sums[target.view as usize].add(color, target.color, f64::from(target.weight));
        }
        let at = |share: f64| (share * steps as f64) as u64;
        if self.setting == Exposure::Auto {
            if step >= at(DECIDED_AT).max(1) {
                // Decided once: photographs of one exposure lose on held-out photographs by maps of their own
                // (docs/experiments/2026-11-25-exposure-poses.md).
                self.setting = if self.gain() > WORTHWHILE { Exposure::On } else { Exposure::Off };
            }
        } else if step >= at(FITTED_FROM).max(1) && step.is_multiple_of(FIT_EVERY) {
            self.maps = self.fitted();
        }
    }

    /// The gain of fitted maps over none, in dB on the last rays.
    fn gain(&self) -> f64 {
        let error = |map: &dyn Fn(usize) -> ColorMap| -> f64 {
            self.sums.iter().enumerate().map(|(n, sums)| sums.squared_error(&map(n))).sum()
        };
        let maps = self.fitted();
        psnr_of_mse(error(&|n| maps[n])) - psnr_of_mse(error(&|_| ColorMap::IDENTITY))
    }

    /// The maps of least squares, their mean moved to the identity.
    fn fitted(&self) -> Vec<ColorMap> {
        let mut maps: Vec<ColorMap> = self.sums.iter().map(|sums| sums.map(RIDGE)).collect();
        let share = 1.0 / maps.len().max(1) as f64;
        let mean: DMat3 = maps.iter().map(|map| share * map.matrix).sum();
        let offset: DVec3 = maps.iter().map(|map| share * map.offset).sum();
        for map in &mut maps {
            // Otherwise scene and maps could drift together, without a change of any error.
            map.matrix += DMat3::IDENTITY - mean;
            map.offset -= offset;
        }
        maps
    }

    /// Everything as numbers, for checkpoints: the setting, then the sums and the map of each photograph.
    pub(super) fn to_numbers(&self) -> Vec<f64> {
        let mut numbers = vec![f64::from(self.setting as u8), if self.maps.is_empty() { 0.0 } else { 1.0 }];
        for (n, sums) in self.sums.iter().enumerate() {
            let map = self.maps.get(n).unwrap_or(&ColorMap::IDENTITY);
            numbers.extend(sums.to_numbers());
            numbers.extend(map.matrix.to_cols_array());
            numbers.extend(map.offset.to_array());
        }
        numbers
    }

    /// From [`Exposures::to_numbers`]; `None` if these are other numbers.
    pub(super) fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let ([setting, mapped], views) = numbers.split_first_chunk()?;
        let setting = Exposure::ALL.into_iter().find(|s| f64::from(*s as u8) == *setting)?;
        let views = views.chunks(ColorFit::NUMBERS + 12).map(|view| {
            let (sums, map) = view.split_first_chunk()?;
            let map: &[f64; 12] = map.try_into().ok()?;
            let matrix = DMat3::from_cols_slice(&map[..9]);
            Some((ColorFit::from_numbers(sums), ColorMap { matrix, offset: DVec3::from_slice(&map[9..]) }))
        });
        let (sums, maps): (Vec<_>, Vec<_>) = views.collect::<Option<Vec<_>>>()?.into_iter().unzip();
        Some(Self { setting, sums, maps: if *mapped == 1.0 { maps } else { Vec::new() } })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::random::Random;

    /// The colors of a step of 256 rays, and the targets that four photographs make of them, darker and brighter by
    /// `spread`.
    fn step(n: u64, spread: f64) -> (Vec<[f32; 3]>, Vec<Target>) {
        let random = Random::new(n, "rays");
        (0..256_u32)
            .map(|ray| {
                let color = [0, 1, 2].map(|c| random.uniform(u64::from(3 * ray + c)) as f32);
                let view = ray % 4;
                let gain = 1.0 + spread * (f64::from(view) - 1.5);
                let noise = 0.02 * (random.uniform(u64::from(1000 + ray)) - 0.5);
                let seen = color.map(|v| (gain * f64::from(v) + noise) as f32);
                (color, Target { color: seen, background: [0.0; 3], view, distance: 0.0, weight: 1.0 })
            })
            .unzip()
    }

    fn followed(setting: Exposure, spread: f64) -> Exposures {
        let mut exposures = Exposures::new(setting, 4);
        for n in 1..=100 {
            let (colors, targets) = step(n, spread);
            exposures.follow(colors.into_iter(), &targets, n, 100);
        }
        exposures
    }

    #[test]
    fn exposures_are_found_and_their_mean_is_the_identity() {
        for setting in [Exposure::Auto, Exposure::On] {
            let exposures = followed(setting, 0.2);
            let maps = exposures.maps();
            assert_eq!(maps.len(), 4);
            for (n, map) in maps.iter().enumerate() {
                let gain = 1.0 + 0.2 * (n as f64 - 1.5);
                assert!(
                    (map.matrix - gain * DMat3::IDENTITY).to_cols_array().iter().all(|d| d.abs() < 0.02),
                    "{map:?}"
                );
            }
            let mean: DMat3 = maps.iter().map(|map| map.matrix * 0.25).sum();
            assert!((mean - DMat3::IDENTITY).to_cols_array().iter().all(|d| d.abs() < 1e-12));
            assert!(maps.iter().map(|map| map.offset).sum::<DVec3>().length() < 1e-12);
            let again = Exposures::from_numbers(&exposures.to_numbers()).unwrap();
            assert_eq!(again, exposures);
            assert_eq!(Exposures::from_numbers(&exposures.to_numbers()[..50]), None);
        }
    }

    #[test]
    fn equal_exposures_and_those_that_are_off_are_left_alone() {
        assert_eq!(followed(Exposure::Auto, 0.0).maps(), []);
        assert_eq!(followed(Exposure::Off, 0.2).maps(), []);
    }
}
