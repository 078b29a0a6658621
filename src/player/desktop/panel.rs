//! The panel, the help, and messages.

use egui::{Color32, RichText, Slider, Ui};

use super::app::App;
use super::opening;
use crate::player::{Action, Comparison, View, scale_count};
use crate::render::RenderSettings;

const KEYS: [(&str, &str); 16] = [
    ("left drag, one finger", "turn around the scene"),
    ("right drag, two fingers", "move"),
    ("Ctrl + drag", "look around"),
    ("wheel, pinch", "nearer, farther"),
    ("W A S D Q E", "fly; with Shift faster"),
    ("F", "turn around what is under the pointer"),
    ("R", "back to the first view"),
    ("1 … 9", "go to a view that was kept; with Ctrl keep it"),
    ("V", "color, depth, opacity, normals, samples"),
    ("B", "tensor boxes"),
    ("P", "screenshot"),
    ("C, Space", "record a path, play it"),
    ("Page Down, Page Up", "the next training camera, the one before"),
    ("I", "this panel"),
    ("H", "this help"),
    ("drop a file", "open it, a scene or a path; with Ctrl compare with it"),
];

/// Lays everything out; returns what is left for the picture, in points.
pub(super) fn lay_out(app: &mut App, ui: &mut Ui) -> egui::Rect {
    if app.has_panel {
        egui::Panel::right("panel").default_size(290.0).show(ui, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| contents(app, ui));
        });
    }
    let picture = ui.available_rect_before_wrap();
    let context = ui.ctx().clone();
    if app.has_help {
        help(app, &context);
    }
    message(app, &context);
    if app.slots[0].is_none() {
        welcome(app, &context, picture);
    }
    picture
}

fn contents(app: &mut App, ui: &mut Ui) {
    files(app, ui);
    if app.slots[0].is_none() {
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
        if let Some(slot) = &app.slots[n] {
            ui.separator();
            if !slot.opened.is_whole {
                let all = scale_count(&slot.opened.contents);
                ui.label(format!("{} of {all} scales so far", slot.opened.scales));
            }
            egui::CollapsingHeader::new(RichText::new(&slot.opened.name).strong())
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
    let mut wanted = None;
    let mut text = std::mem::take(&mut app.address);
    ui.horizontal(|ui| {
        let field = ui.add(egui::TextEdit::singleline(&mut text).hint_text("file, folder or URL").desired_width(150.0));
        let is_entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        if (ui.button("open").clicked() || is_entered) && !text.is_empty() {
            wanted = Some((text.clone(), 0));
        }
        if app.slots[0].is_some() && ui.button("compare").clicked() && !text.is_empty() {
            wanted = Some((text.clone(), 1));
        }
    });
    app.address = text;
    let mut list = |ui: &mut Ui, title: &str, places: Vec<String>| {
        if !places.is_empty() {
            egui::CollapsingHeader::new(title).show(ui, |ui| {
                for place in places {
                    if ui.link(place.rsplit(['/', '\\']).next().unwrap_or(&place)).on_hover_text(&place).clicked() {
                        wanted = Some((place, 0));
                    }
                }
            });
        }
    };
    list(ui, "folder", app.folder.iter().map(|p| p.display().to_string()).collect());
    list(ui, "recent", app.recent.clone());
    if app.is_opening() {
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label("opening");
        });
    }
    if let Some((place, slot)) = wanted {
        app.open(&place, slot);
    }
}

fn speed(app: &mut App, ui: &mut Ui) {
    ui.label(RichText::new(app.device.name()).weak());
    let milliseconds = |s: Option<f64>| s.map_or_else(|| "…".to_owned(), |s| format!("{:.1} ms", 1e3 * s));
    ui.label(match app.seconds_before {
        Some(before) => format!("picture {} (before {})", milliseconds(app.seconds), milliseconds(Some(before))),
        None => format!("picture {}", milliseconds(app.seconds)),
    });
    if let Some(rays) = app.pace.rays_per_second() {
        let (rate, unit) = if rays < 1e5 { (1e-3 * rays, "thousand") } else { (1e-6 * rays, "million") };
        ui.label(format!("{rate:.2} {unit} rays/s, shown at 1/{}", app.pace.shown().unwrap_or(16)));
    }
    if let Some([scene, work]) = app.slots[0].as_ref().and_then(|s| s.memory_bytes()) {
        ui.label(format!("device memory {:.0} + {:.0} MB", scene as f64 / 1e6, work as f64 / 1e6));
    }
    let mut target = app.frame_time_ms;
    if ui.add(Slider::new(&mut target, 5..=500).logarithmic(true).text("ms while moving")).changed() {
        app.frame_time_ms = target;
        app.pace.set_target(1e-3 * f64::from(target));
    }
}

fn views(app: &mut App, ui: &mut Ui) {
    ui.horizontal_wrapped(|ui| {
        for view in View::ALL {
            if ui.selectable_label(app.view == view, view.name()).clicked() {
                app.set_view(view);
            }
        }
    });
    ui.horizontal(|ui| {
        let own = app.slots[0].as_ref().map_or([1.0; 3], |s| s.scene.frame.background);
        let mut color = app.background.unwrap_or(own);
        ui.label("background");
        if ui.color_edit_button_rgb(&mut color).changed() {
            app.background = Some(color);
        }
        if app.background.is_some() && ui.button("as trained").clicked() {
            app.background = None;
        }
    });
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut app.has_boxes, "tensor boxes");
        if app.has_boxes {
            for (s, is_shown) in app.boxes.iter_mut().enumerate() {
                ui.checkbox(is_shown, s.to_string());
            }
        }
    });
    if app.slots[1].is_some() {
        ui.horizontal_wrapped(|ui| {
            let is_side = app.comparison == Comparison::SideBySide;
            if ui.selectable_label(is_side, "side by side").clicked() {
                app.comparison = Comparison::SideBySide;
                app.changed();
            }
            if ui.selectable_label(!is_side, "slider").clicked() && is_side {
                app.comparison = Comparison::Slider(0.5);
                app.changed();
            }
            if ui.button("close the second").clicked() {
                app.close_second();
            }
        });
        if let Comparison::Slider(at) = &mut app.comparison {
            ui.add(Slider::new(at, 0.0..=1.0).text("split"));
        }
    }
}

fn quality(app: &mut App, ui: &mut Ui) {
    let Some(slot) = &app.slots[0] else { return };
    let scales = slot.scene.scales.len() as u32;
    let most = slot.scene.scales.iter().map(|s| s.top_k).max().unwrap_or(1);
    let (weight, own) = (slot.scene.rules.min_weight.max(1e-6), app.approximation);
    let choices = slot.choices.clone();
    let mut wanted = own;
    let mut is_done = false;
    let mut row = |ui: &mut Ui, slider: Slider<'_>| {
        let response = ui.add(slider);
        is_done |= response.drag_stopped() || (response.changed() && !response.dragged());
    };
    let mut neighbors = wanted.neighbors.unwrap_or(most);
    row(ui, Slider::new(&mut neighbors, 1..=most).text("neighbors"));
    let mut used = wanted.scales.unwrap_or(scales);
    row(ui, Slider::new(&mut used, 1..=scales).text("scales"));
    row(ui, Slider::new(&mut wanted.step_scale, 0.5..=8.0).logarithmic(true).text("step"));
    let mut threshold = wanted.min_weight.unwrap_or(weight).max(1e-6);
    row(ui, Slider::new(&mut threshold, 1e-6..=0.05).logarithmic(true).text("color threshold"));
    wanted.neighbors = (neighbors < most).then_some(neighbors);
    wanted.scales = (used < scales).then_some(used);
    wanted.min_weight = ((threshold - weight).abs() > 1e-9).then_some(threshold);
    let mut finest = app.finest.trailing_zeros();
    if ui
        .add(Slider::new(&mut finest, 0..=4).custom_formatter(|v, _| format!("1/{}", 1 << v as u32)).text("resolution"))
        .changed()
    {
        app.finest = 1 << finest;
        app.changed();
    }
    app.approximation = wanted;
    let mut chosen = None;
    ui.horizontal_wrapped(|ui| {
        let exact = [("exact".to_owned(), RenderSettings::default())];
        for (name, choice) in exact.into_iter().chain(choices) {
            if ui.button(name).clicked() {
                chosen = Some(choice);
            }
        }
    });
    if let Some(choice) = chosen {
        app.choose(&choice);
        return;
    }
    if is_done {
        app.approximate();
    }
}

fn cameras(app: &mut App, ui: &mut Ui) {
    ui.horizontal_wrapped(|ui| {
        for (text, action) in [
            ("reset", Action::Reset),
            ("screenshot", Action::Screenshot),
            (if app.recorder.is_recording() { "stop" } else { "record" }, Action::Record),
            (if app.recorder.is_playing() { "stop" } else { "play" }, Action::Play),
            ("help", Action::Help),
        ] {
            if ui.button(text).clicked() {
                app.act(action, None);
            }
        }
    });
    let count = app.slots[0].as_ref().map_or(0, |s| s.opened.document.metadata.cameras.len());
    if count > 0 {
        let mut n = app.photograph.camera.unwrap_or(0);
        if ui.add(Slider::new(&mut n, 0..=count - 1).text("training camera")).changed() {
            app.go_to_camera(n);
        }
        if app.data.is_some() {
            let is_moved = ui.add(Slider::new(&mut app.photograph.share, 0.0..=1.0).text("photograph")).changed();
            if is_moved && app.photograph.camera.is_none() {
                app.go_to_camera(0);
            }
            app.load_photograph();
        }
    }
}

fn help(app: &mut App, context: &egui::Context) {
    let mut is_open = true;
    egui::Window::new("Keys").open(&mut is_open).collapsible(false).resizable(false).show(context, |ui| {
        egui::Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
            for (key, does) in KEYS {
                ui.label(RichText::new(key).strong());
                ui.label(does);
                ui.end_row();
            }
        });
    });
    app.has_help = is_open;
}

fn message(app: &mut App, context: &egui::Context) {
    let Some(text) = app.message.clone() else { return };
    let mut is_open = true;
    egui::Window::new("Message")
        .open(&mut is_open)
        .anchor(egui::Align2::CENTER_BOTTOM, [0.0, -20.0])
        .collapsible(false)
        .show(context, |ui| {
            ui.set_max_width((context.content_rect().width() - 40.0).min(600.0));
            ui.add(egui::Label::new(RichText::new(text).color(Color32::from_rgb(255, 190, 120))).wrap());
        });
    if !is_open {
        app.message = None;
    }
}

fn welcome(app: &App, context: &egui::Context, picture: egui::Rect) {
    if app.is_opening() {
        return;
    }
    egui::Area::new(egui::Id::unique("welcome"))
        .fixed_pos(picture.center())
        .pivot(egui::Align2::CENTER_CENTER)
        .interactable(false)
        .show(context, |ui| {
            ui.label(RichText::new("Drop a .strivec file here").heading());
        });
}

/// Opens what was dropped: the first file, or a folder.
pub(super) fn dropped(app: &mut App, place: &str, is_compared: bool) {
    if place.ends_with(".json") {
        return app.open_path(place);
    }
    let slot = usize::from(is_compared && app.slots[0].is_some());
    if opening::is_url(place) || std::path::Path::new(place).exists() {
        app.open(place, slot);
    } else {
        app.say(format!("{place}: there is no such file"));
    }
}
