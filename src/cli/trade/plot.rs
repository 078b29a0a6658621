//! Plots of points and their Pareto front.

use plotters::backend::DrawingBackend;
use plotters::prelude::{
    BLACK, ChartBuilder, Circle, IntoDrawingArea, IntoLogRange, LineSeries, RGBColor, SVGBackend, Text, WHITE,
};
use plotters::style::{Color, IntoFont};

use crate::plots;
use crate::plots::FONT;

/// A plot of points.
pub(super) struct Plot {
    pub(super) title: String,
    /// Labels of the horizontal axis, which is logarithmic, and of the vertical one.
    pub(super) axes: [&'static str; 2],
    pub(super) points: Vec<PlotPoint>,
}

/// A point of a plot.
pub(super) struct PlotPoint {
    pub(super) at: [f64; 2],
    pub(super) name: String,
    pub(super) is_on_front: bool,
}

const SIZE: (u32, u32) = (1280, 640);
/// Columns of the chart; the names of the front's points are listed to its right.
const CHART: u32 = 920;
/// Height of a line of the list, in pixels.
const FRONT_LINE: i32 = 19;
const FRONT: RGBColor = RGBColor(200, 70, 20);
const OTHER: RGBColor = RGBColor(90, 110, 140);

impl Plot {
    /// As an SVG file.
    pub(super) fn svg(&self) -> Result<String, String> {
        let mut text = String::new();
        self.draw(SVGBackend::with_string(&mut text, SIZE))?;
        Ok(text)
    }

    /// As an image: \[columns, rows\] and colors.
    pub(super) fn picture(&self) -> Result<([u32; 2], Vec<[f32; 3]>), String> {
        plots::picture(SIZE, |backend| self.draw(backend))
    }

    fn draw<B: DrawingBackend>(&self, backend: B) -> Result<(), String>
    where
        B::ErrorType: 'static,
    {
        plots::register();
        self.try_draw(backend).map_err(|e| format!("plot: {e}"))
    }

    fn try_draw<B: DrawingBackend>(&self, backend: B) -> Result<(), Box<dyn std::error::Error>>
    where
        B::ErrorType: 'static,
    {
        let range = |axis: usize| {
            let values = self.points.iter().map(|p| p.at[axis]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
        };
        let ([left, right], [low, high]) = (range(0), range(1));
        if !(left > 0.0 && right.is_finite() && low.is_finite() && high.is_finite()) {
            return Err("points need finite coordinates and a positive horizontal one".into());
        }
        let margin = 0.06 * (high - low).max(0.1);
        let area = backend.into_drawing_area();
        area.fill(&WHITE)?;
        let (chart_area, list) = area.split_horizontally(CHART);
        let mut chart = ChartBuilder::on(&chart_area)
            .caption(&self.title, (FONT, 20))
            .margin(14)
            .x_label_area_size(44)
            .y_label_area_size(60)
            .build_cartesian_2d((0.85 * left..1.35 * right).log_scale(), low - margin..high + margin)?;
        chart
            .configure_mesh()
            .light_line_style(RGBColor(238, 238, 238))
            .bold_line_style(RGBColor(215, 215, 215))
            .x_desc(self.axes[0])
            .y_desc(self.axes[1])
            .label_style((FONT, 14))
            .axis_desc_style((FONT, 16))
            .x_label_formatter(&|v| if *v >= 10.0 { format!("{v:.0}") } else { format!("{v:.2}") })
            .y_label_formatter(&|v| format!("{v:.1}"))
            .draw()?;
        let (mut front, others): (Vec<&PlotPoint>, Vec<&PlotPoint>) = self.points.iter().partition(|p| p.is_on_front);
        front.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
        let coordinates = |point: &&PlotPoint| (point.at[0], point.at[1]);
        chart.draw_series(LineSeries::new(front.iter().map(coordinates), FRONT.stroke_width(2)))?;
        chart.draw_series(others.iter().map(|p| Circle::new(coordinates(p), 3, OTHER.filled())))?;
        chart.draw_series(front.iter().map(|p| Circle::new(coordinates(p), 5, FRONT.filled())))?;
        // No name overlaps a point, the front's line or another name. Names without a free place are in the table only.
        let pixel = |point: &&PlotPoint| chart.backend_coord(&coordinates(point));
        let mut taken: Vec<PlotArea> = self.points.iter().map(|p| PlotArea::around(pixel(&p), 4)).collect();
        taken.extend(front.windows(2).flat_map(|ends| along(pixel(&ends[0]), pixel(&ends[1]))));
        let (columns, rows) = chart.plotting_area().get_pixel_range();
        let chart_place = PlotArea([columns.start, rows.start, columns.end, rows.end]);
        let font = |height: i32, color: &RGBColor| (FONT, height).into_font().color(color);
        let list_top = 48;
        list.draw(&Text::new("Pareto front, from left to right", (0, list_top), font(16, &BLACK)))?;
        for (n, point) in front.iter().enumerate() {
            let number = (n + 1).to_string();
            let at = (0, list_top + 26 + (n as i32) * FRONT_LINE);
            list.draw(&Text::new(format!("{number}  {}", point.name), at, font(14, &BLACK)))?;
            if let Some(place) = PlotArea::beside(pixel(point), &number, 15, &chart_place, &taken) {
                area.draw(&Text::new(number, place.corner(), font(15, &BLACK)))?;
                taken.push(place);
            }
        }
        for point in others {
            if let Some(place) = PlotArea::beside(pixel(&point), &point.name, 12, &chart_place, &taken) {
                area.draw(&Text::new(point.name.clone(), place.corner(), font(12, &OTHER)))?;
                taken.push(place);
            }
        }
        area.present()?;
        Ok(())
    }
}

/// A rectangle of pixels: left, top, right, bottom.
#[derive(Clone, Copy)]
struct PlotArea([i32; 4]);

impl PlotArea {
    fn around((x, y): (i32, i32), by: i32) -> Self {
        Self([x - by, y - by, x + by, y + by])
    }

    /// A free rectangle for `name`, in letters of `height` pixels, beside the point (`x`, `y`): inside `within` and
    /// apart from all `taken`.
    fn beside((x, y): (i32, i32), name: &str, height: i32, within: &Self, taken: &[Self]) -> Option<Self> {
        let width = name.chars().count() as i32 * height / 2;
        let places = [
            [x + 7, y - height - 2],
            [x - 7 - width, y - height - 2],
            [x + 7, y + 3],
            [x - 7 - width, y + 3],
            [x + 8, y - height / 2],
            [x - 8 - width, y - height / 2],
        ];
        let is_free = |place: &Self| place.is_within(within) && !taken.iter().any(|other| place.meets(other));
        places.map(|[left, top]| Self([left, top, left + width, top + height])).into_iter().find(is_free)
    }

    fn is_within(&self, other: &Self) -> bool {
        (0..2).all(|a| self.0[a] >= other.0[a] && self.0[a + 2] <= other.0[a + 2])
    }

    fn meets(&self, other: &Self) -> bool {
        (0..2).all(|a| self.0[a] <= other.0[a + 2] && other.0[a] <= self.0[a + 2])
    }

    fn corner(&self) -> (i32, i32) {
        (self.0[0], self.0[1])
    }
}

/// Rectangles that cover the line from `from` to `to`.
fn along(from: (i32, i32), to: (i32, i32)) -> impl Iterator<Item = PlotArea> {
    let count = ((to.0 - from.0).abs().max((to.1 - from.1).abs()) / 3).max(1);
    let at = move |a: i32, b: i32, n: i32| a + (b - a) * n / count;
    (0..=count).map(move |n| PlotArea::around((at(from.0, to.0, n), at(from.1, to.1, n)), 1))
}
