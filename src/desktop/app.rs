//! State of the desktop player: the session, the files that are being opened, messages, and the fields of the panel.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Instant;

use super::arguments::Arguments;
use super::chooser::Chooser;
use super::dataset_folder;
use super::message::Message;
use super::opening::{self, OpeningError, OpeningEvent, is_url, name_of};
use super::output::{Saved, save_new};
use super::painter::{DesktopPainter, Device};
use super::recent;
use strivec_field::render::Approximation;
use strivec_field::render::gpu::GpuError;
use strivec_format::escape::escaped;
use strivec_measure::color_png;
use strivec_player::{Action, Comparison, Session, Step};

/// A file that is being opened.
struct Opening {
    place: String,
    events: Receiver<OpeningEvent>,
    opened_at: Instant,
    /// True if a step of it is shown.
    is_shown: bool,
    /// True if the process ends when it cannot be opened: the only file of the command line.
    is_required: bool,
}

/// The player.
pub(super) struct App {
    pub(super) session: Session<DesktopPainter>,
    /// \[slot\] name of the scene's file, escaped.
    pub(super) names: [String; 2],
    opening: [Option<Opening>; 2],
    wake: Box<dyn Fn() -> Box<dyn Fn() + Send>>,
    /// The error with which the process ends.
    pub(super) failure: Option<OpeningError>,
    pub(super) frame_time_ms: u32,
    /// The dataset's folder, for cameras and photographs.
    pub(super) data: Option<PathBuf>,
    pub(super) message: Option<Message>,
    /// Settings of a slider that is being dragged.
    pub(super) dragged: Option<Approximation>,
    /// Text of the panel's field.
    pub(super) address: String,
    pub(super) chooser: Option<Chooser>,
    pub(super) recent: Vec<String>,
    /// Scenes of the folder that was opened.
    pub(super) folder: Vec<PathBuf>,
    pub(super) has_help: bool,
    pub(super) has_panel: bool,
    prints_timing: bool,
    /// Time at which the scene was opened; `None` once its first picture is finished.
    waits_since: Option<Instant>,
    updated_at: Instant,
}

impl App {
    /// A player without a scene. `wake` makes functions that wake the window.
    pub(super) fn new(
        device: Device,
        arguments: &Arguments,
        wake: impl Fn() -> Box<dyn Fn() + Send> + 'static,
    ) -> Self {
        let mut session = Session::new(device, 1e-3 * f64::from(arguments.frame_time));
        session.quality = arguments.quality.clone();
        Self {
            session,
            names: [String::new(), String::new()],
            opening: [None, None],
            wake: Box::new(wake),
            failure: None,
            frame_time_ms: arguments.frame_time,
            data: arguments.data.clone(),
            message: None,
            dragged: None,
            address: String::new(),
            chooser: None,
            recent: recent::load(),
            folder: Vec::new(),
            has_help: false,
            has_panel: true,
            prints_timing: arguments.timing,
            waits_since: None,
            updated_at: Instant::now(),
        }
    }

    /// Opens the files of the command line. The process ends if the only one cannot be opened.
    pub(super) fn open_arguments(&mut self, arguments: &Arguments) {
        if let Some(place) = &arguments.place {
            self.open(place, 0);
        }
        match &arguments.compare {
            Some(place) => self.open(place, 1),
            None => self.opening.iter_mut().flatten().for_each(|opening| opening.is_required = true),
        }
    }

    /// Opens `place`, a file, a folder or a URL, in slot 0 or 1.
    pub(super) fn open(&mut self, place: &str, slot: usize) {
        self.message = None;
        if !is_url(place)
            && let Some(scenes) = opening::scenes_in(place.as_ref())
        {
            return self.open_folder(place, scenes, slot);
        }
        let place = if is_url(place) { place.to_owned() } else { recent::absolute(place) };
        self.opening[slot] = Some(Opening {
            events: opening::open(place.clone(), (self.wake)()),
            place,
            opened_at: Instant::now(),
            is_shown: false,
            is_required: false,
        });
    }

    /// Lists the `scenes` of a folder and opens the first; without scenes, takes it as the dataset's folder.
    fn open_folder(&mut self, folder: &str, scenes: Vec<PathBuf>, slot: usize) {
        if let Some(first) = scenes.first().map(|first| first.display().to_string()) {
            self.folder = scenes;
            self.open(&first, slot);
        } else if self.session.slots[0].is_some() {
            self.take_dataset(Path::new(folder));
        } else {
            self.say_error(format!("{folder}: no .strivec files in this folder"));
        }
    }

    /// Shows `text` for some seconds.
    pub(super) fn say(&mut self, text: String) {
        let text = escaped(&text);
        if self.prints_timing {
            println!("{text}");
        }
        self.message = Some(Message::note(text));
    }

    /// Shows an error until it is closed, its time is over, or another file is opened.
    pub(super) fn say_error(&mut self, text: String) {
        let text = escaped(&text);
        if self.prints_timing {
            println!("{text}");
        }
        self.message = Some(Message::error(text));
    }

    /// Title of the window.
    pub(super) fn title(&self) -> String {
        let [first, second] = &self.names;
        match (&self.session.slots[0], &self.session.slots[1]) {
            (None, _) => "Strivec".to_owned(),
            (_, None) => format!("{first} – Strivec"),
            _ => format!("{first} and {second} – Strivec"),
        }
    }

    /// Closes the second scene.
    pub(super) fn close_second(&mut self) {
        self.opening[1] = None;
        self.session.close_second();
    }

    /// True if a file is being opened.
    pub(super) fn is_opening(&self) -> bool {
        self.opening.iter().any(Option::is_some)
    }

    /// Takes events of opening, moves the camera, and draws for the time that a picture may take. `size` is the
    /// picture's place. Returns whether to call it again at once.
    pub(super) fn update(&mut self, size: [u32; 2]) -> bool {
        let elapsed = self.updated_at.elapsed().as_secs_f64();
        self.updated_at = Instant::now();
        for slot in 0..2 {
            self.poll(slot);
        }
        self.session.resize(size);
        let is_moving = self.session.move_camera(elapsed);
        let shown = self.session.pace.shown();
        if let Err(error) = self.draw() {
            self.say_error(error.to_string());
            self.session.close();
        }
        // The panel shows the last picture's time in the next frame.
        let is_new = self.session.pace.shown() != shown;
        is_moving || is_new || self.session.is_busy()
    }

    fn draw(&mut self) -> Result<(), GpuError> {
        let until = strivec_player::now() + 1e-3 * f64::from(self.frame_time_ms);
        for finished in self.session.draw(until)? {
            let waited = self.waits_since.take();
            if !self.prints_timing {
                continue;
            }
            if let Some(since) = waited {
                println!("first picture {:.0} ms after opening", 1e3 * since.elapsed().as_secs_f64());
            }
            let [width, height] = finished.size;
            println!("{width}x{height} in {:.1} ms", 1e3 * finished.seconds);
        }
        Ok(())
    }

    /// Takes events of the file that is being opened in `slot`. The next step waits until the last one is displayed.
    fn poll(&mut self, slot: usize) {
        let is_displayed = self.session.slots[slot].as_ref().is_none_or(|scene| {
            use strivec_player::Painter as _;
            scene.is_whole || scene.painter.shown().is_some()
        });
        let Some(mut opening) = self.opening[slot].take_if(|opening| is_displayed || !opening.is_shown) else { return };
        match opening.events.try_recv() {
            Ok(OpeningEvent::Step(step)) => {
                let is_whole = step.is_whole;
                self.take(*step, &mut opening, slot);
                self.opening[slot] = (!is_whole).then_some(opening);
            }
            Ok(OpeningEvent::Failed(error)) if opening.is_required && !opening.is_shown => self.failure = Some(error),
            Ok(OpeningEvent::Failed(error)) => self.say_error(error.text),
            Err(TryRecvError::Empty) => self.opening[slot] = Some(opening),
            Err(TryRecvError::Disconnected) => {}
        }
    }

    fn take(&mut self, mut step: Step, opening: &mut Opening, slot: usize) {
        if slot == 0
            && let Some(folder) = &self.data
            && step.file.metadata.cameras.is_empty()
            && let Err(text) = dataset_folder::add_cameras(folder, &step.file.scene, &mut step.file.metadata.cameras)
        {
            self.say_error(text);
        }
        if !opening.is_shown
            && let Some(skipped) = step.file.metadata.skipped.first()
        {
            self.say_error(format!("{}: {skipped}", opening.place));
        }
        let (is_whole, scales) = (step.is_whole, step.scales);
        if let Err(error) = self.session.take(step, opening.is_shown, slot) {
            return self.say_error(format!("{}: {error}", opening.place));
        }
        self.names[slot] = escaped(name_of(&opening.place));
        if !opening.is_shown {
            recent::add(&mut self.recent, &opening.place);
            self.waits_since = Some(opening.opened_at);
        }
        opening.is_shown = true;
        if self.prints_timing {
            println!("{scales} scales ready {:.0} ms after opening", 1e3 * opening.opened_at.elapsed().as_secs_f64());
        }
        if slot == 0 && is_whole {
            self.check_quality(opening);
        }
    }

    /// Reports stored settings that were requested and are missing.
    fn check_quality(&mut self, opening: &Opening) {
        let Some((name, slot)) = self.session.quality.as_ref().zip(self.session.slots[0].as_ref()) else { return };
        if slot.choice(name).is_some() {
            return;
        }
        let names: Vec<_> = slot.choices.iter().map(|(name, _)| name.as_str()).collect();
        let text = if names.is_empty() {
            format!("{}: the file stores no quality settings", opening.place)
        } else {
            format!("{}: the file has no quality setting `{name}`; choose one of {}", opening.place, names.join(", "))
        };
        if opening.is_required {
            self.failure = Some(OpeningError { text, exit_code: 1 });
        } else {
            self.say_error(text);
        }
    }

    /// Takes `folder` as the scene's dataset.
    fn take_dataset(&mut self, folder: &Path) {
        let Some(slot) = &mut self.session.slots[0] else { return };
        if let Err(text) = dataset_folder::add_cameras(folder, &slot.scene, &mut slot.cameras) {
            return self.say_error(text);
        }
        self.data = Some(folder.to_owned());
        self.session.photograph.is_loaded = false;
        self.say(format!("{}: photographs of this dataset can be blended in", folder.display()));
    }

    /// Loads the photograph of the chosen training camera if it is to be shown and missing.
    pub(super) fn load_photograph(&mut self) {
        let Some(n) = self.session.photograph.missing() else { return };
        let (Some(folder), Some(slot)) = (&self.data, &self.session.slots[0]) else { return };
        match dataset_folder::photograph(folder, n, slot.scene.frame.background) {
            Ok(Some((size, rgba))) => self.session.set_photograph(n, size, rgba),
            Ok(None) => {}
            Err(text) => {
                self.session.photograph.share = 0.0;
                self.say_error(text);
            }
        }
    }

    /// A key went down or up; `pointer` is in parts of the picture's width and height.
    pub(super) fn key(&mut self, code: &str, is_pressed: bool, is_modified: bool, pointer: Option<[f64; 2]>) {
        if code == "Escape" && is_pressed {
            (self.has_help, self.chooser) = (false, None);
        }
        if let Some(action) = self.session.key(code, is_pressed, is_modified) {
            self.on_action(action, pointer);
        }
    }

    /// Does the action of a button.
    pub(super) fn act(&mut self, action: Action) {
        self.session.act(action);
        self.on_action(action, None);
    }

    fn on_action(&mut self, action: Action, pointer: Option<[f64; 2]>) {
        match action {
            Action::Focus => self.focus(pointer.unwrap_or([0.5, 0.5])),
            Action::Help => self.has_help = !self.has_help,
            Action::Panel => self.has_panel = !self.has_panel,
            Action::Screenshot => self.take_screenshot(),
            Action::Record if self.session.slots[0].is_some() && self.session.recorder.record() => self.save_path(),
            Action::Play if self.session.recorder.play() => self.save_path(),
            _ => {}
        }
    }

    /// Sets the pivot to the visible point at `at`, in parts of the picture's width and height.
    fn focus(&mut self, at: [f64; 2]) {
        let size = self.session.full_size();
        let Some(camera) = self.session.camera_of(0, size) else { return };
        // Side by side, both halves show the same view.
        let x =
            if self.session.active_comparison() == Some(Comparison::SideBySide) { (2.0 * at[0]) % 1.0 } else { at[0] };
        let Some((slot, controls)) = self.session.slots[0].as_mut().zip(self.session.controls.as_mut()) else { return };
        // The device's picture is begun again.
        slot.stop();
        if let Some(point) = slot.painter.point_at(&camera, [x, at[1]]) {
            controls.focus(point);
        }
        self.session.pace.abandoned();
        self.session.changed();
    }

    /// Saves the first scene's picture at full resolution.
    fn take_screenshot(&mut self) {
        let size = self.session.full_size();
        let (Some(camera), Some(slot)) = (self.session.camera_of(0, size), &mut self.session.slots[0]) else { return };
        slot.stop();
        let own = slot.scene.frame.background;
        let wanted = self.session.background.unwrap_or(own);
        let saved = slot.painter.picture(&camera).map_err(|e| e.to_string()).and_then(|pixels| {
            let colors: Vec<[f32; 3]> = (pixels.iter())
                .map(|p| [0, 1, 2].map(|c| p.color[c] + (1.0 - p.opacity) * (wanted[c] - own[c])))
                .collect();
            let png = color_png(size, &colors).map_err(|e| e.to_string())?;
            save_new(self.names[0].trim_end_matches(".strivec"), "png", &png)
        });
        match saved {
            Ok(Saved { path }) => self.say(format!("wrote {}", path.display())),
            Err(text) => self.say_error(format!("cannot save the screenshot: {text}")),
        }
        self.session.pace.abandoned();
        self.session.changed();
    }

    /// Saves the recorded camera path.
    fn save_path(&mut self) {
        let Some(text) = self.session.recorder.file() else { return };
        match save_new(&format!("{}-path", self.names[0].trim_end_matches(".strivec")), "json", text.as_bytes()) {
            Ok(Saved { path }) => self.say(format!("wrote {}; `strivec render` plays it", path.display())),
            Err(text) => self.say_error(format!("cannot save the camera path: {text}")),
        }
    }

    /// Plays the camera path in the file `place`.
    fn open_path(&mut self, place: &str) {
        let read = std::fs::read(place).map_err(|e| format!("cannot be read: {e}"));
        if let Err(text) = read.and_then(|bytes| self.session.recorder.open(&bytes).map_err(|e| e.to_string())) {
            self.say_error(format!("{place}: {text}"));
        }
    }

    /// Opens a dropped or chosen path: a scene, a camera path, or a folder of scenes or of a dataset.
    pub(super) fn open_any(&mut self, place: &str, is_compared: bool) {
        if place.ends_with(".json") {
            return self.open_path(place);
        }
        self.open(place, usize::from(is_compared && self.session.slots[0].is_some()));
    }
}
