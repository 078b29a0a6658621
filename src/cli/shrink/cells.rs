//! Cells of space, grouped by the colors seen there, with their parameters and errors before and after shrinking.

use serde::Serialize;

use strivec_capture::dataset::Photograph;
use strivec_field::Field;
use strivec_format::model::Scene;
use strivec_format::random::Random;
use strivec_train::{Cell, CellMap, FLAT};
use strivec_train::{RayBatch, RaySampler, TrainConfig, TrainError};

/// Cells along the scene's longest edge, and the largest number of rays that measure them.
const CELLS_ALONG: usize = 64;
const CELL_RAYS: usize = 1 << 18;

/// Parameters and errors by cell, before and after.
pub(super) struct Cells([CellMap; 2]);

/// A group of cells.
#[derive(Clone, Copy, Serialize)]
pub(super) struct CellKind {
    pub(super) name: &'static str,
    pub(super) cells: usize,
    /// Share of the samples' weights.
    pub(super) share_of_weight: f64,
    /// Factor entries, before and after.
    pub(super) parameters: [f64; 2],
    /// Share of the mean squared error, before and after.
    pub(super) share_of_error: [f64; 2],
}

impl Cells {
    pub(super) fn new(scenes: [&Scene; 2], views: &[Photograph], config: &TrainConfig) -> Result<Self, TrainError> {
        let [before, _] = scenes;
        let field = Field::<f32>::unlimited(before);
        let mut sampler = RaySampler::new(views, &before.frame, config)?;
        sampler.filter_rays(&field);
        let count = sampler.active_ray_count().min(CELL_RAYS);
        let batch = RayBatch::draw(&sampler, &field, &Random::new(config.seed, "cells"), 0, count);
        Ok(Self(scenes.map(|scene| CellMap::new(scene, &before.bounds, &batch, CELLS_ALONG))))
    }

    pub(super) fn named(&self) -> [(&'static str, &CellMap); 2] {
        [("before", &self.0[0]), ("after", &self.0[1])]
    }

    /// The groups; cells are grouped by the scene before shrinking.
    pub(super) fn kinds(&self) -> Vec<CellKind> {
        let [before, after] = &self.0;
        let sum = |map: &CellMap, numbers: &[usize], value: fn(&Cell) -> f64| {
            numbers.iter().map(|&n| value(&map.cells[n])).fold(0.0, |sum, v| sum + v)
        };
        let all: Vec<usize> = (0..before.cells.len()).collect();
        // If nothing is seen, shares are 0.
        let weight = sum(before, &all, |c| c.weight).max(f64::MIN_POSITIVE);
        let errors = self.0.each_ref().map(|map| sum(map, &all, |c| c.error).max(f64::MIN_POSITIVE));
        let kind = |name, is_one: &dyn Fn(Option<f64>) -> bool| {
            let numbers: Vec<usize> =
                (0..before.cells.len()).filter(|&n| is_one(before.cells[n].deviation())).collect();
            CellKind {
                name,
                cells: numbers.len(),
                share_of_weight: sum(before, &numbers, |c| c.weight) / weight,
                parameters: [before, after].map(|map| sum(map, &numbers, |c| c.parameters)),
                share_of_error: [0, 1].map(|n| sum(&self.0[n], &numbers, |c| c.error) / errors[n]),
            }
        };
        let mut kinds = vec![
            kind("nothing seen", &|deviation| deviation.is_none()),
            kind("one color", &|deviation| deviation.is_some_and(|d| d <= FLAT)),
            kind("several colors", &|deviation| deviation.is_some_and(|d| d > FLAT)),
        ];
        for (n, map) in self.0.iter().enumerate() {
            kinds[0].parameters[n] += map.unseen_parameters;
        }
        kinds
    }
}
