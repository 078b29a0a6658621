//! Points and their front, drawn.

use plotters::backend::DrawingBackend;
use plotters::prelude::{
    BLACK, ChartBuilder, Circle, IntoDrawingArea, IntoLogRange, LineSeries, RGBColor, SVGBackend, Text, WHITE,
};
use plotters::style::{Color, IntoFont};

use crate::cli::plots::{self, FONT};

/// A plot of points.
pub(super) struct Plot {
    pub(super) title: String,
    /// What goes right, in a logarithmic scale, and what goes up.
    pub(super) axes: [&'static str; 2],
    pub(super) points: Vec<Point>,
}

/// One of them.
pub(super) struct Point {
    pub(super) at: [f64; 2],
    pub(super) name: String,
    pub(super) is_on_front: bool,
}

const SIZE: (u32, u32) = (1000, 640);
const FRONT: RGBColor = RGBColor(200, 70, 20);
const OTHER: RGBColor = RGBColor(90, 110, 140);

impl Plot {
    /// As an SVG file.
    pub(super) fn svg(&self) -> Result<String, String> {
        let mut text = String::new();
        self.draw(SVGBackend::with_string(&mut text, SIZE))?;
        Ok(text)
    }

    /// As colours, with columns and rows.
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
            return Err("expected points with finite coordinates, the first positive".into());
        }
        let margin = 0.06 * (high - low).max(0.1);
        let area = backend.into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
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
        let mut front: Vec<(f64, f64)> =
            self.points.iter().filter(|p| p.is_on_front).map(|p| (p.at[0], p.at[1])).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart.draw_series(LineSeries::new(front, FRONT.stroke_width(2)))?;
        // Those of the front get their names first; names that would lie on others are left to the table.
        let mut points: Vec<&Point> = self.points.iter().collect();
        points.sort_by_key(|p| !p.is_on_front);
        let mut taken: Vec<[i32; 4]> = Vec::new();
        for point in points {
            let (color, size, height) = if point.is_on_front { (FRONT, 5, 14) } else { (OTHER, 3, 12) };
            let at = (point.at[0], point.at[1]);
            chart.draw_series([Circle::new(at, size, color.filled())])?;
            let (x, y) = chart.backend_coord(&at);
            let width = 6 * point.name.chars().count() as i32;
            // Right of the point, or left of it at the right edge.
            let left = if x + 8 + width > SIZE.0 as i32 { x - 8 - width } else { x + 8 };
            let place = [left, y - 16, left + width, y - 16 + height];
            let is_free = |other: &[i32; 4]| {
                place[0] > other[2] || place[2] < other[0] || place[1] > other[3] || place[3] < other[1]
            };
            if taken.iter().all(is_free) {
                taken.push(place);
                let text_color = if point.is_on_front { BLACK } else { OTHER };
                let font = (FONT, height).into_font().color(&text_color);
                area.draw(&Text::new(point.name.clone(), (place[0], place[1]), font))?;
            }
        }
        area.present()?;
        Ok(())
    }
}
