//! Parameters per cell against error per cell, before and after.

use std::error::Error;

use plotters::prelude::{
    BLACK, ChartBuilder, Circle, DrawingBackend, IntoDrawingArea, IntoLogRange, RGBColor, Rectangle, WHITE,
};
use plotters::style::Color;

use crate::plots::{FONT, picture, register};
use strivec_measure::ramp;
use strivec_train::{Cell, CellMap};

const SIZE: (u32, u32) = (1440, 900);
const DOT: RGBColor = RGBColor(40, 90, 150);
/// Decades that a map or an axis shows below its largest value.
const DECADES: i32 = 4;

/// The picture's size and colors. Each of `maps`, which have the same cells, is a row: parameters and errors seen from the
/// front, and a plot of one against the other.
pub(super) fn draw(maps: &[(&str, &CellMap)]) -> Result<([u32; 2], Vec<[f32; 3]>), String> {
    register();
    picture(SIZE, |backend| try_draw(backend, maps)).map_err(|e| format!("picture: {e}"))
}

/// The value of a cell that a panel shows.
type Value = fn(&Cell) -> f64;

const VALUES: [(&str, Value); 2] = [("parameters", |c| c.parameters), ("squared error", |c| c.error)];

fn try_draw<B: DrawingBackend>(backend: B, maps: &[(&str, &CellMap)]) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    let area = backend.into_drawing_area();
    area.fill(&WHITE)?;
    let panels = area.split_evenly((maps.len(), 3));
    // One scale for all rows makes them comparable.
    let most = VALUES.map(|(_, value)| {
        let columns = maps.iter().flat_map(|(_, map)| map.from_the_front(value)).flatten();
        columns.fold(f64::MIN_POSITIVE, f64::max)
    });
    let most_of_cell = VALUES
        .map(|(_, value)| maps.iter().flat_map(|(_, map)| &map.cells).map(value).fold(f64::MIN_POSITIVE, f64::max));
    for ((name, map), panels) in maps.iter().zip(panels.chunks_exact(3)) {
        for (((what, value), most), panel) in VALUES.into_iter().zip(most).zip(panels) {
            let columns = map.from_the_front(value);
            let (width, height) = (map.size[0] as f64, map.size[2] as f64);
            // Square cells in the panel.
            let (right, down) = panel.dim_in_pixel();
            let scale = (f64::from(right) / width).min((f64::from(down) - 40.0) / height);
            let margin = ((f64::from(right) - scale * width) * 0.5) as i32;
            let mut chart = ChartBuilder::on(panel)
                .caption(format!("{name}: {what} by column of cells"), (FONT, 17))
                .margin_left(margin)
                .margin_right(margin)
                .build_cartesian_2d(0.0..width, height..0.0)?;
            let shown = columns.iter().enumerate().flat_map(|(row, values)| {
                values.iter().enumerate().map(move |(column, &value)| {
                    let level = 1.0 + (value / most).log10() / f64::from(DECADES);
                    let [r, g, b] = ramp(level as f32).map(|c| (255.0 * c) as u8);
                    let (x, y) = (column as f64, row as f64);
                    Rectangle::new([(x, y), (x + 1.0, y + 1.0)], RGBColor(r, g, b).filled())
                })
            });
            chart.draw_series(shown)?;
        }
        let [parameters, error] = most_of_cell.map(|most| [most * 10f64.powi(-DECADES - 1), 2.0 * most]);
        let mut chart = ChartBuilder::on(&panels[2])
            .caption(format!("{name}: each cell"), (FONT, 17))
            .margin(12)
            .x_label_area_size(36)
            .y_label_area_size(56)
            .build_cartesian_2d((error[0]..error[1]).log_scale(), (parameters[0]..parameters[1]).log_scale())?;
        chart
            .configure_mesh()
            .light_line_style(RGBColor(245, 245, 245))
            .bold_line_style(RGBColor(220, 220, 220))
            .x_desc("squared error")
            .y_desc("parameters")
            .label_style((FONT, 13))
            .axis_desc_style((FONT, 15, &BLACK))
            .x_label_formatter(&|v| format!("{v:.0e}"))
            .y_label_formatter(&|v| format!("{v:.0e}"))
            .draw()?;
        let seen = map.cells.iter().filter(|c| c.weight > 0.0);
        let dots = seen.map(|c| (c.error.max(error[0]), c.parameters.max(parameters[0])));
        chart.draw_series(dots.map(|at| Circle::new(at, 1, DOT.mix(0.35).filled())))?;
    }
    area.present()?;
    Ok(())
}
