//! The picture of a dataset's cameras, their rays, its points and its box, from above and from the side.

use glam::{DVec2, DVec3};
use plotters::prelude::*;

use crate::{Error, plots};
use strivec_capture::dataset::NamedCamera;
use strivec_format::geometry::{Aabb, Camera};

/// Columns and rows of one of the two views.
const VIEW: [u32; 2] = [700, 700];
/// The most points that are drawn; of more, some at equal steps.
const MAX_POINTS: usize = 50_000;
/// Length of a camera's symbol, as a share of what is shown.
const SYMBOL: f64 = 0.03;
const POINT: RGBColor = RGBColor(170, 170, 170);
const BOX: RGBColor = RGBColor(90, 90, 90);
/// The middle ray of a camera, in so many steps.
const RAY: RGBColor = RGBColor(222, 210, 170);
const RAY_STEPS: u32 = 64;
/// Colors of splits, in their order.
const SPLITS: [RGBColor; 3] = [RGBColor(31, 119, 180), RGBColor(255, 127, 14), RGBColor(44, 160, 44)];
/// The axes across and upwards of both views, with their names.
const VIEWS: [(&str, [usize; 2]); 2] =
    [("from above: x to the right, y up", [0, 1]), ("from the side: x to the right, z up", [0, 2])];

/// Cameras, points and box, in the dataset's space.
pub(super) struct FloorPlan<'a> {
    pub(super) splits: &'a [(&'static str, &'a [NamedCamera])],
    pub(super) points: Vec<DVec3>,
    pub(super) bounds: Option<Aabb>,
    pub(super) focus: DVec3,
    /// The distances at which rays begin and end.
    pub(super) near_far: [f64; 2],
}

impl FloorPlan<'_> {
    /// Size and colors of the picture.
    pub(super) fn draw(&self) -> Result<([u32; 2], Vec<[f32; 3]>), Error> {
        plots::register();
        let size = (2 * VIEW[0], VIEW[1]);
        let failed = |error: String| Error::Runtime(format!("cannot draw the cameras: {error}"));
        plots::picture(size, |backend| {
            let root = backend.into_drawing_area();
            root.fill(&WHITE).map_err(|e| failed(e.to_string()))?;
            for ((title, axes), area) in VIEWS.iter().zip(root.split_evenly((1, 2))) {
                self.draw_view(title, *axes, &area).map_err(|e| failed(e.to_string()))?;
            }
            root.present().map_err(|e| failed(e.to_string()))
        })
    }

    fn draw_view<B: DrawingBackend>(
        &self,
        title: &str,
        [across, up]: [usize; 2],
        area: &DrawingArea<B, plotters::coord::Shift>,
    ) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        let flat = |p: DVec3| (p[across], p[up]);
        let cameras = || self.splits.iter().flat_map(|(_, cameras)| cameras.iter());
        // All cameras and the point they look at; of the points and the box whatever is near them.
        let shown = Aabb::from_points(cameras().map(|named| named.camera.position).chain([self.focus]));
        let middle = shown.center();
        let half = (0.6 * shown.size().max_element()).max(1e-9);
        let range = |axis: usize| middle[axis] - half..middle[axis] + half;
        let is_shown = |p: &DVec3| [across, up].iter().all(|&axis| range(axis).contains(&p[axis]));
        let mut chart = ChartBuilder::on(area)
            .caption(title, (plots::FONT, 20))
            .margin(12)
            .x_label_area_size(28)
            .y_label_area_size(52)
            .build_cartesian_2d(range(across), range(up))?;
        chart.configure_mesh().label_style((plots::FONT, 14)).light_line_style(WHITE).draw()?;
        let rays = cameras().map(|named| self.middle_ray(&named.camera).filter(is_shown).map(flat).collect());
        chart.draw_series(rays.map(|ray: Vec<_>| PathElement::new(ray, RAY)))?;
        let stride = self.points.len().div_ceil(MAX_POINTS).max(1);
        let points = self.points.iter().step_by(stride).filter(|p| is_shown(p));
        chart.draw_series(points.map(|p| Pixel::new(flat(*p), POINT)))?;
        if let Some(bounds) = self.bounds {
            let clamped = |p: DVec3| p.clamp(middle - half, middle + half);
            let corners = [flat(clamped(bounds.min)), flat(clamped(bounds.max))];
            chart.draw_series([Rectangle::new(corners, BOX)])?;
        }
        chart.draw_series([Cross::new(flat(self.focus), 6, BLACK)])?;
        for (n, (name, cameras)) in self.splits.iter().enumerate() {
            let color = SPLITS[n % SPLITS.len()];
            let symbols = cameras.iter().flat_map(|named| symbol(&named.camera, 2.0 * half * SYMBOL));
            let series = symbols.map(|line| PathElement::new(line.map(flat).to_vec(), color.stroke_width(1)));
            chart.draw_series(series)?.label(*name).legend(move |(x, y)| Circle::new((x + 8, y), 4, color.filled()));
            let places = cameras.iter().map(|named| Circle::new(flat(named.camera.position), 2, color.filled()));
            chart.draw_series(places)?;
        }
        chart
            .configure_series_labels()
            .label_font((plots::FONT, 16))
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK)
            .draw()
    }

    /// Points at equal steps on the middle ray of `camera`, from where it begins to where it ends.
    fn middle_ray(&self, camera: &Camera) -> impl Iterator<Item = DVec3> {
        let ([near, far], ahead, from) = (self.near_far, -camera.world_from_camera.z_axis, camera.position);
        let distance = move |n: u32| near + (far - near) * f64::from(n) / f64::from(RAY_STEPS);
        (0..=RAY_STEPS).map(move |n| from + distance(n) * ahead)
    }
}

/// The lines of a camera's pyramid of the length `length`.
fn symbol(camera: &Camera, length: f64) -> Vec<[DVec3; 2]> {
    let corners: Vec<DVec3> = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
        .map(|[x, y]| DVec2::new(x * f64::from(camera.width), y * f64::from(camera.height)))
        .iter()
        .filter_map(|at| camera.ray_through(at.x, at.y))
        .map(|ray| ray.at(length))
        .collect();
    let ahead = camera.position - length * camera.world_from_camera.z_axis;
    let mut lines: Vec<_> = corners.iter().map(|&corner| [camera.position, corner]).collect();
    lines.extend((0..corners.len()).map(|n| [corners[n], corners[(n + 1) % corners.len()]]));
    if corners.is_empty() {
        lines.push([camera.position, ahead]);
    }
    lines
}
