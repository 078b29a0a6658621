//! The panel: files, speed, view, quality, camera, and facts of the files.

use egui::{RichText, Slider, Ui};

use super::app::App;
use super::chooser::Chooser;
use super::opening::name_of;
use super::overlay;
use strivec_field::render::RenderSettings;
use strivec_format::escape::escaped;
use strivec_player::{Action, Comparison, View};

/// Lays out the panel and the overlays. Returns the rectangle that is left for the picture, in points.
pub(super) fn lay_out(app: &mut App, ui: &mut Ui) -> egui::Rect {
    if app.has_panel {
        egui::Panel::right("panel").default_size(300.0).show(ui, |ui| {
            ui.style_mut().spacing.scroll = egui::style::ScrollStyle::solid();
            egui::ScrollArea::vertical()
                .auto_shrink(false)
                .scroll_bar_visibility(egui::scroll_area::ScrollBarVisibility::AlwaysVisible)
                .show(ui, |ui| contents(app, ui));
        });
    }
    let picture = ui.available_rect_before_wrap();
    overlay::lay_out(app, &ui.ctx().clone(), picture);
    picture
}

fn contents(app: &mut App, ui: &mut Ui) {
    files(app, ui);
    if app.session.slots[0].is_none() {
        return;
    }
    ui.separator();
    speed(app, ui);
    ui.separator();
    views(app, ui);
    ui.separator();
    quality(app, ui);
    ui.separator();
    cameras(app, ui);
    for n in 0..2 {
        if let Some(slot) = &app.session.slots[n] {
            ui.separator();
            if !slot.is_whole {
                ui.label(format!("{} of {} scales loaded", slot.scales, slot.all_scales));
            }
            egui::CollapsingHeader::new(RichText::new(&app.names[n]).strong())
                .id_salt(("facts", n))
                .default_open(n == 0)
                .show(ui, |ui| {
                    egui::Grid::new(("grid", n)).num_columns(2).striped(true).show(ui, |ui| {
                        for fact in &slot.facts {
                            ui.label(&fact.name);
                            ui.add(egui::Label::new(&fact.value).wrap());
                            ui.end_row();
                        }
                    });
                });
        }
    }
}

fn files(app: &mut App, ui: &mut Ui) {
    let has_scene = app.session.slots[0].is_some();
    ui.horizontal(|ui| {
        if ui.button("Open…").on_hover_text("Choose a scene, a camera path or a folder").clicked() {
            app.chooser = Some(Chooser::new(false));
        }
        if has_scene && ui.button("Compare with…").on_hover_text("Choose a second scene").clicked() {
            app.chooser = Some(Chooser::new(true));
        }
    });
    let mut wanted = None;
    let mut text = std::mem::take(&mut app.address);
    ui.horizontal(|ui| {
        let field = ui.add(egui::TextEdit::singleline(&mut text).hint_text("File, folder or URL").desired_width(170.0));
        let is_entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        if (ui.button("Open").clicked() || is_entered) && !text.is_empty() {
            wanted = Some((text.clone(), false));
        }
        if has_scene && ui.button("Compare").clicked() && !text.is_empty() {
            wanted = Some((text.clone(), true));
        }
    });
    app.address = text;
    let mut list = |ui: &mut Ui, title: &str, places: Vec<String>| {
        if !places.is_empty() {
            egui::CollapsingHeader::new(title).show(ui, |ui| {
                for place in places {
                    if ui.link(escaped(name_of(&place))).on_hover_text(escaped(&place)).clicked() {
                        wanted = Some((place, false));
                    }
                }
            });
        }
    };
    list(ui, "Scenes of this folder", app.folder.iter().map(|p| p.display().to_string()).collect());
    list(ui, "Recent", app.recent.clone());
    if app.is_opening() {
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label("Opening…");
        });
    }
    if let Some((place, is_compared)) = wanted {
        app.open_any(&place, is_compared);
    }
}

fn speed(app: &mut App, ui: &mut Ui) {
    let session = &mut app.session;
    ui.label(RichText::new(session.device.name()).weak());
    let milliseconds = |s: Option<f64>| s.map_or_else(|| "…".to_owned(), |s| format!("{:.1} ms", 1e3 * s));
    ui.label(match session.seconds_before {
        Some(before) => {
            format!("Full picture: {} (before: {})", milliseconds(session.seconds), milliseconds(Some(before)))
        }
        None => format!("Full picture: {}", milliseconds(session.seconds)),
    });
    if let Some(rays) = session.pace.rays_per_second() {
        let (rate, unit) = if rays < 1e5 { (1e-3 * rays, "thousand") } else { (1e-6 * rays, "million") };
        let divisor = session.pace.shown().unwrap_or(16);
        ui.label(format!("{rate:.2} {unit} rays/s, resolution 1/{divisor}"));
    }
    if let Some([scene, work]) = session.slots[0].as_ref().and_then(|s| s.painter.memory_bytes()) {
        ui.label(format!("Device memory: scene {:.0} MB, workspace {:.0} MB", scene as f64 / 1e6, work as f64 / 1e6));
    }
    let slider = Slider::new(&mut app.frame_time_ms, 5..=500).logarithmic(true).text("ms while moving");
    if ui.add(slider).on_hover_text("Time of a picture while the camera moves").changed() {
        session.pace.set_target(1e-3 * f64::from(app.frame_time_ms));
    }
}

fn views(app: &mut App, ui: &mut Ui) {
    let session = &mut app.session;
    ui.horizontal_wrapped(|ui| {
        for view in View::ALL {
            if ui.selectable_label(session.view == view, view.label()).clicked() {
                session.set_view(view);
            }
        }
    });
    ui.add_enabled_ui(session.shows_background(), |ui| {
        ui.horizontal(|ui| {
            let own = session.slots[0].as_ref().map_or([1.0; 3], |s| s.scene.frame.background);
            let mut color = session.background.unwrap_or(own);
            ui.label("Background");
            if ui.color_edit_button_rgb(&mut color).changed() {
                session.background = Some(color);
            }
            if session.background.is_some() && ui.button("As trained").clicked() {
                session.background = None;
            }
        });
    });
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut session.has_boxes, "Tensor boxes");
        if session.has_boxes {
            for (s, is_shown) in session.boxes.iter_mut().enumerate() {
                ui.checkbox(is_shown, format!("scale {s}"));
            }
        }
    });
    if session.slots[1].is_some() {
        comparison(app, ui);
    }
}

fn comparison(app: &mut App, ui: &mut Ui) {
    let is_side = app.session.comparison == Comparison::SideBySide;
    ui.horizontal_wrapped(|ui| {
        if ui.selectable_label(!is_side, "Divider").clicked() && is_side {
            app.session.set_comparison(Comparison::Slider(0.5));
        }
        if ui.selectable_label(is_side, "Side by side").clicked() {
            app.session.set_comparison(Comparison::SideBySide);
        }
    });
    if ui.button(format!("Close {}", app.names[1])).clicked() {
        app.close_second();
    }
}

fn quality(app: &mut App, ui: &mut Ui) {
    let session = &app.session;
    let Some(slot) = &session.slots[0] else { return };
    let weight = slot.scene.rules.min_weight.max(1e-6);
    let choices = slot.choices.clone();
    // While a slider is dragged, the settings do not change yet.
    let mut wanted = app.dragged.unwrap_or(session.approximation);
    let mut is_done = false;
    let mut row = |ui: &mut Ui, slider: Slider<'_>, help: &str| {
        let response = ui.add(slider).on_hover_text(help);
        is_done |= response.drag_stopped() || (response.changed() && !response.dragged());
    };
    let step = Slider::new(&mut wanted.step_scale, 0.5..=8.0).logarithmic(true).text("Step");
    row(ui, step, "Step of the ray march, in steps of the scene");
    let mut threshold = wanted.min_weight.unwrap_or(weight).max(1e-6);
    let slider = Slider::new(&mut threshold, 1e-6..=0.05).logarithmic(true).text("Color threshold");
    row(ui, slider, "Least weight of a sample whose color is computed");
    wanted.min_weight = ((threshold - weight).abs() > 1e-9).then_some(threshold);
    let mut finest = session.finest.trailing_zeros();
    let resolution = |v: f64, _: std::ops::RangeInclusive<usize>| format!("1/{}", 1 << v as u32);
    let slider = Slider::new(&mut finest, 0..=4).custom_formatter(resolution).text("Resolution");
    let is_resized = ui.add(slider).on_hover_text("Finest resolution of a picture").changed();
    let mut chosen = None;
    ui.horizontal_wrapped(|ui| {
        let exact = [("exact".to_owned(), RenderSettings::default())];
        for (name, choice) in exact.into_iter().chain(choices) {
            if ui.button(name).clicked() {
                chosen = Some(choice);
            }
        }
    });
    let is_changed = wanted != session.approximation;
    if is_done || is_resized {
        chosen = chosen.or(Some(RenderSettings { approximation: wanted, divisor: 1 << finest }));
    }
    app.dragged = (is_changed && chosen.is_none()).then_some(wanted);
    if let Some(settings) = chosen
        && let Err(error) = app.session.approximate(&settings)
    {
        app.say_error(error.to_string());
    }
}

fn cameras(app: &mut App, ui: &mut Ui) {
    let (is_recording, is_playing) = (app.session.recorder.is_recording(), app.session.recorder.is_playing());
    ui.horizontal_wrapped(|ui| {
        for (text, action) in [
            ("First view", Action::Reset),
            ("Screenshot", Action::Screenshot),
            (if is_recording { "Stop recording" } else { "Record path" }, Action::Record),
            (if is_playing { "Stop" } else { "Play path" }, Action::Play),
            ("Help", Action::Help),
        ] {
            if ui.button(text).clicked() {
                app.act(action);
            }
        }
    });
    if let Some([mut near, max_near]) = app.session.near() {
        let slider = Slider::new(&mut near, 0.0..=max_near).text("Near");
        if ui.add(slider).on_hover_text("Distance from the camera at which rays begin, to see past a wall").changed() {
            app.session.set_near(near);
        }
    }
    let count = app.session.slots[0].as_ref().map_or(0, |slot| slot.cameras.len());
    if count > 0 {
        let mut n = app.session.photograph.camera.unwrap_or(0);
        if ui.add(Slider::new(&mut n, 0..=count - 1).text("Training camera")).changed() {
            app.session.go_to_camera(n);
        }
        if app.data.is_some() {
            let mut share = app.session.photograph.share;
            if ui.add(Slider::new(&mut share, 0.0..=1.0).text("Photograph")).changed() {
                app.session.set_photograph_share(share);
            }
            app.load_photograph();
        }
    }
}
