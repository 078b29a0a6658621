//! Overlays of the picture: divider, names, messages, help, and the list of files.

use egui::{Align2, Color32, FontId, Rect, RichText, Sense, Stroke};

use super::app::App;
use strivec_player::{Comparison, KEYS};

/// Width of the divider's handle, in points.
const HANDLE: f32 = 12.0;

/// Lays out the overlays of the picture, whose rectangle is `picture`, in points.
pub(super) fn lay_out(app: &mut App, context: &egui::Context, picture: Rect) {
    if app.session.active_comparison().is_some() {
        divider(app, context, picture);
    }
    if app.has_help {
        help(app, context, picture);
    }
    choose(app, context, picture);
    message(app, context, picture);
    if app.session.slots[0].is_none() && !app.is_opening() {
        welcome(context, picture);
    }
}

/// The line between two scenes, which can be dragged, and their names on both sides.
fn divider(app: &mut App, context: &egui::Context, picture: Rect) {
    let (share, is_slider) = match app.session.comparison {
        Comparison::Slider(at) => (at, true),
        Comparison::SideBySide => (0.5, false),
    };
    let x = picture.left() + share * picture.width();
    let line = Rect::from_x_y_ranges(x - 0.5 * HANDLE..=x + 0.5 * HANDLE, picture.y_range());
    egui::Area::new(egui::Id::unique("divider")).fixed_pos(line.min).constrain(false).show(context, |ui| {
        let sense = if is_slider { Sense::drag() } else { Sense::empty() };
        let response = ui.allocate_rect(line, sense);
        if is_slider {
            let response = response.on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
            if let Some(pointer) = response.interact_pointer_pos() {
                let at = (pointer.x - picture.left()) / picture.width().max(1.0);
                app.session.set_comparison(Comparison::Slider(at.clamp(0.0, 1.0)));
            }
        }
    });
    let painter = context.layer_painter(egui::LayerId::new(egui::Order::Background, egui::Id::unique("names")));
    let painter = painter.with_clip_rect(picture);
    painter.vline(x, picture.y_range(), Stroke::new(3.0, Color32::from_black_alpha(160)));
    painter.vline(x, picture.y_range(), Stroke::new(1.0, Color32::WHITE));
    for (n, (side, at)) in [(Align2::RIGHT_TOP, x - HANDLE), (Align2::LEFT_TOP, x + HANDLE)].into_iter().enumerate() {
        let at = egui::Pos2::new(at, picture.top() + 8.0);
        let text = painter.layout_no_wrap(app.names[n].clone(), FontId::proportional(14.0), Color32::WHITE);
        let place = side.anchor_size(at, text.size());
        painter.rect_filled(place.expand(4.0), 4.0, Color32::from_black_alpha(160));
        painter.galley(place.min, text, Color32::WHITE);
    }
}

fn help(app: &mut App, context: &egui::Context, picture: Rect) {
    egui::Window::new("Keys and pointer")
        .open(&mut app.has_help)
        .collapsible(false)
        .vscroll(true)
        .default_pos(picture.min + egui::vec2(20.0, 20.0))
        .max_height((picture.height() - 80.0).max(60.0))
        .show(context, |ui| {
            egui::Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
                for (input, effect) in KEYS {
                    ui.label(RichText::new(input).strong());
                    ui.label(effect);
                    ui.end_row();
                }
            });
        });
}

/// The list of files.
fn choose(app: &mut App, context: &egui::Context, picture: Rect) {
    let Some(mut chooser) = app.chooser.take() else { return };
    let (mut is_open, mut chosen) = (true, None);
    let title = if chooser.is_compared { "Compare with" } else { "Open" };
    egui::Window::new(title)
        .id(egui::Id::unique("chooser"))
        .open(&mut is_open)
        .collapsible(false)
        .default_pos(picture.min + egui::vec2(20.0, 20.0))
        .default_width(360.0)
        .show(context, |ui| chosen = chooser.lay_out(ui));
    match chosen {
        Some(path) => app.open_any(&path.display().to_string(), chooser.is_compared),
        None if is_open => app.chooser = Some(chooser),
        None => {}
    }
}

/// The message, at the bottom of the picture until its time is over.
fn message(app: &mut App, context: &egui::Context, picture: Rect) {
    let Some(left) = app.message.as_ref().and_then(|message| message.time_left()) else {
        app.message = None;
        return;
    };
    context.request_repaint_after(left);
    let Some(message) = &app.message else { return };
    let color = if message.is_error { Color32::from_rgb(255, 190, 120) } else { Color32::WHITE };
    let mut is_closed = false;
    egui::Area::new(egui::Id::unique("message"))
        .order(egui::Order::Foreground)
        .fixed_pos(picture.center_bottom() - egui::vec2(0.0, 16.0))
        .pivot(Align2::CENTER_BOTTOM)
        .constrain_to(picture)
        .show(context, |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_max_width((picture.width() - 60.0).clamp(40.0, 600.0));
                ui.horizontal_top(|ui| {
                    is_closed = ui.small_button("×").on_hover_text("Close").clicked();
                    ui.add(egui::Label::new(RichText::new(&message.text).color(color)).wrap());
                });
            });
        });
    if is_closed {
        app.message = None;
    }
}

fn welcome(context: &egui::Context, picture: Rect) {
    egui::Area::new(egui::Id::unique("welcome"))
        .fixed_pos(picture.center())
        .pivot(Align2::CENTER_CENTER)
        .interactable(false)
        .show(context, |ui| {
            ui.label(RichText::new("Drop a .strivec file here").heading());
        });
}
