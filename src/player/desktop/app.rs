//! What the window shows, apart from the window: scenes, camera, settings, and what is being drawn.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

use super::arguments::Arguments;
use super::opening::{self, News, Opened};
use super::recent;
use super::scene_slot::{Device, SceneSlot};
use crate::container::{SceneFile, TrainingCamera};
use crate::dataset::{self, LoadOptions};
use crate::geometry::Camera;
use crate::measure::color_png;
use crate::player::{Action, Comparison, Controls, Pace, Photograph, Recorder, Show, View, named_choices};
use crate::render::gpu::GpuError;
use crate::render::{Approximation, RenderSettings};

/// The player.
pub(super) struct App {
    pub(super) device: Device,
    /// The first, and the one that it is compared with.
    pub(super) slots: [Option<SceneSlot>; 2],
    pending: [Option<Receiver<News>>; 2],
    wake: Box<dyn Fn() -> Box<dyn Fn() + Send>>,
    pub(super) controls: Option<Controls>,
    pub(super) pace: Pace,
    pub(super) frame_time_ms: u32,
    pub(super) approximation: Approximation,
    /// Pictures get no finer than this many times smaller than the window.
    pub(super) finest: u32,
    pub(super) view: View,
    /// In place of the scene's.
    pub(super) background: Option<[f32; 3]>,
    pub(super) comparison: Comparison,
    /// \[scale\] whether its boxes are shown.
    pub(super) boxes: Vec<bool>,
    pub(super) has_boxes: bool,
    /// The folder of the photographs that the scene was trained on.
    pub(super) data: Option<PathBuf>,
    /// Which of a file's named choices scenes are opened with.
    quality: Option<String>,
    pub(super) photograph: Photograph,
    pub(super) recorder: Recorder,
    pub(super) message: Option<String>,
    /// What is typed into the panel.
    pub(super) address: String,
    pub(super) recent: Vec<String>,
    /// Scenes of the folder that was opened.
    pub(super) folder: Vec<PathBuf>,
    pub(super) has_help: bool,
    pub(super) has_panel: bool,
    /// Seconds that the last whole picture took, and the one before the settings were changed.
    pub(super) seconds: Option<f64>,
    pub(super) seconds_before: Option<f64>,
    says_timing: bool,
    opened_at: Instant,
    has_first_picture: bool,
    updated_at: Instant,
    /// The place of the picture, in pixels.
    size: [u32; 2],
}

impl App {
    /// Without a scene. `wake` makes functions that wake the window.
    pub(super) fn new(
        device: Device,
        arguments: &Arguments,
        wake: impl Fn() -> Box<dyn Fn() + Send> + 'static,
    ) -> Self {
        Self {
            device,
            slots: [None, None],
            pending: [None, None],
            wake: Box::new(wake),
            controls: None,
            pace: Pace::new(1e-3 * f64::from(arguments.frame_time)),
            frame_time_ms: arguments.frame_time,
            approximation: Approximation::default(),
            finest: 1,
            view: View::Color,
            background: None,
            comparison: Comparison::Slider(0.5),
            boxes: Vec::new(),
            has_boxes: false,
            data: arguments.data.clone(),
            quality: arguments.quality.clone(),
            photograph: Photograph::default(),
            recorder: Recorder::default(),
            message: None,
            address: String::new(),
            recent: recent::load(),
            folder: Vec::new(),
            has_help: false,
            has_panel: true,
            seconds: None,
            seconds_before: None,
            says_timing: arguments.timing,
            opened_at: Instant::now(),
            has_first_picture: false,
            updated_at: Instant::now(),
            size: [1, 1],
        }
    }

    /// Opens `place` as the first scene, or as the second.
    pub(super) fn open(&mut self, place: &str, slot: usize) {
        self.message = None;
        if !opening::is_url(place)
            && let Some(scenes) = opening::scenes_in(place.as_ref())
        {
            match scenes.first().map(|first| first.display().to_string()) {
                Some(first) => {
                    self.folder = scenes;
                    self.open(&first, slot);
                }
                None => self.say(format!("{place}: expected .strivec files in the folder, found none")),
            }
            return;
        }
        (self.opened_at, self.has_first_picture) = (Instant::now(), false);
        self.pending[slot] = Some(opening::open(place.to_owned(), (self.wake)()));
        recent::add(&mut self.recent, place);
    }

    /// Shows `text` until it is closed, or something else is opened.
    pub(super) fn say(&mut self, text: String) {
        if self.says_timing {
            println!("{text}");
        }
        self.message = Some(text);
    }

    /// Closes the second scene.
    pub(super) fn close_second(&mut self) {
        (self.slots[1], self.pending[1]) = (None, None);
        self.changed();
    }

    /// What is shown is out of date.
    pub(super) fn changed(&mut self) {
        self.pace.changed();
    }

    /// Takes in what was opened, moves the camera, and draws for as long as a picture may take. `size` is the picture's
    /// place. Whether there is more to do at once.
    pub(super) fn update(&mut self, size: [u32; 2]) -> bool {
        let elapsed = self.updated_at.elapsed().as_secs_f64();
        self.updated_at = Instant::now();
        for slot in 0..2 {
            self.hear(slot);
        }
        if self.size != size {
            self.size = size;
            self.changed();
        }
        let is_flying = self.controls.as_mut().is_some_and(|c| c.fly(elapsed));
        let is_playing = self.follow_path(elapsed);
        if is_flying || is_playing {
            self.changed();
        }
        let shown = self.pace.shown();
        if let Err(error) = self.draw() {
            self.say(error.to_string());
            self.slots = [None, None];
        }
        let is_drawing = self.slots.iter().flatten().any(SceneSlot::is_drawing);
        let is_unfinished = self.slots[0].is_some() && !self.is_fine_enough();
        // The panel says how the last picture went in the frame after it.
        let is_news = self.pace.shown() != shown;
        is_drawing || is_unfinished || is_news || is_flying || is_playing || self.recorder.is_recording()
    }

    fn is_fine_enough(&self) -> bool {
        self.pace.shown().is_some_and(|shown| shown <= self.finest)
    }

    /// Takes in what the background has opened; more of a scene only once what is there of it is seen.
    fn hear(&mut self, slot: usize) {
        let is_unseen = |s: &SceneSlot| !s.opened.is_whole && s.shown().is_none();
        if self.slots[slot].as_ref().is_some_and(is_unseen) {
            return;
        }
        while let Some(receiver) = &self.pending[slot] {
            match receiver.try_recv() {
                Ok(News::Scene(opened)) => return self.take(*opened, slot),
                Ok(News::Failed(text)) => {
                    self.say(text);
                    self.pending[slot] = None;
                }
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => self.pending[slot] = None,
            }
        }
    }

    fn take(&mut self, mut opened: Opened, slot: usize) {
        let is_more_of_the_same =
            self.slots[slot].as_ref().is_some_and(|s| !s.opened.is_whole && s.opened.name == opened.name);
        if slot == 0 && !is_more_of_the_same {
            let document = &opened.document;
            self.controls = Some(Controls::new(&document.scene, document.metadata.views.as_ref()));
            (self.approximation, self.finest) = (Approximation::default(), 1);
            self.background = None;
            (self.seconds, self.seconds_before) = (None, None);
            self.photograph = Photograph::default();
        }
        if slot == 0 {
            self.add_cameras(&mut opened.document);
            // The names come last of all.
            let choices = named_choices(&opened.document.metadata.notes);
            let chosen = choices.into_iter().find(|(name, _)| Some(name) == self.quality.as_ref());
            if let Some((_, RenderSettings { approximation, divisor })) = chosen.filter(|_| opened.is_whole) {
                (self.approximation, self.finest) = (approximation, divisor);
            }
            self.boxes.resize(opened.document.scene.scales.len(), true);
        }
        match SceneSlot::new(opened, &self.device, &self.approximation) {
            Ok(mut scene) => {
                if let Some(before) = self.slots[slot].as_mut().filter(|_| is_more_of_the_same) {
                    scene.painter.take_picture_of(&mut before.painter);
                }
                if self.says_timing {
                    let milliseconds = 1e3 * self.opened_at.elapsed().as_secs_f64();
                    println!("{} scales ready {milliseconds:.0} ms after opening", scene.opened.scales);
                }
                self.slots[slot] = Some(scene);
            }
            Err(text) => self.say(text),
        }
        self.changed();
    }

    /// The dataset's cameras, where the file holds none.
    fn add_cameras(&mut self, document: &mut SceneFile) {
        let Some(folder) = self.data.as_ref().filter(|_| document.metadata.cameras.is_empty()) else { return };
        match dataset::load_cameras(folder, "train", None, 1) {
            Ok(cameras) => {
                let map = document.scene.frame.model_from_dataset;
                let cameras = cameras.iter().map(|named| TrainingCamera::from(&named.camera.mapped(&map)));
                document.metadata.cameras = cameras.collect();
            }
            Err(error) => self.say(error.to_string()),
        }
    }

    /// Records the camera's path, or moves the camera along one; whether it has moved.
    fn follow_path(&mut self, elapsed: f64) -> bool {
        let (Some(controls), Some(slot)) = (&mut self.controls, &self.slots[0]) else { return false };
        self.recorder.follow(elapsed, controls, &slot.scene.frame.model_from_dataset)
    }

    /// Writes the recorded path to a new file in the current folder.
    fn write_path(&mut self) {
        let Some(text) = self.recorder.file() else { return };
        let stem = self.slots[0].as_ref().map_or("camera", |s| s.opened.name.trim_end_matches(".strivec")).to_owned();
        match write_new(&format!("{stem}-path"), "json", text.as_bytes()) {
            Ok(name) => self.say(format!("wrote {name}: strivec render --path takes it")),
            Err(text) => self.say(text),
        }
    }

    /// Takes the camera path in the file `place`, and plays it.
    pub(super) fn open_path(&mut self, place: &str) {
        let read = std::fs::read(place).map_err(|e| e.to_string());
        if let Err(text) = read.and_then(|bytes| self.recorder.open(&bytes).map_err(|e| e.to_string())) {
            self.say(format!("{place}: {text}"));
        }
    }

    /// The size of each scene's picture at full resolution.
    fn picture_size(&self) -> [u32; 2] {
        if self.slots[1].is_some() { self.comparison.picture_size(self.size) } else { self.size }
    }

    fn draw(&mut self) -> Result<(), GpuError> {
        let size = self.picture_size();
        let pixels = u64::from(size[0]) * u64::from(size[1]) * self.slots.iter().flatten().count() as u64;
        if self.slots[0].is_none() || pixels == 0 {
            return Ok(());
        }
        let until = Instant::now() + Duration::from_millis(u64::from(self.frame_time_ms));
        loop {
            if let Some(divisor) = self.pace.next(pixels).map(|d| d.max(self.finest)).filter(|_| !self.is_fine_enough())
            {
                let Some(controls) = &self.controls else { return Ok(()) };
                let camera = controls.camera(size.map(|v| v.div_ceil(divisor).max(1)));
                let frame = self.slots[0].as_ref().map(|slot| slot.scene.frame.clone());
                for slot in self.slots.iter_mut().flatten() {
                    let own = frame.as_ref().map(|f| Comparison::camera_of_second(&camera, f, &slot.scene.frame));
                    slot.begin(&own.unwrap_or(camera), self.view == View::Normals)?;
                }
                self.pace.begun(divisor);
            }
            if !self.slots.iter().flatten().any(SceneSlot::is_drawing) {
                return Ok(());
            }
            let mut seconds = 0.0;
            for slot in self.slots.iter_mut().flatten().filter(|slot| slot.is_drawing()) {
                let (rays, pace) = (self.pace.rays_at_once(), &mut self.pace);
                match slot.draw(&self.device, rays, until, |rays, seconds| pace.measured(rays, seconds))? {
                    Some(taken) => seconds += taken,
                    None => return Ok(()),
                }
            }
            let camera_size = self.slots[0].as_ref().and_then(|s| s.shown()).map(|c| [c.width, c.height]);
            self.pace.finished();
            if camera_size == Some(size) {
                self.seconds = Some(seconds);
            }
            self.say_timing(camera_size, seconds);
            if Instant::now() >= until || self.pace.shown().is_none() {
                return Ok(());
            }
        }
    }

    fn say_timing(&mut self, size: Option<[u32; 2]>, seconds: f64) {
        let Some([width, height]) = size.filter(|_| self.says_timing) else { return };
        if !self.has_first_picture {
            println!("first picture {:.0} ms after opening", 1e3 * self.opened_at.elapsed().as_secs_f64());
        }
        self.has_first_picture = true;
        println!("{width}x{height} in {:.1} ms", 1e3 * seconds);
    }

    /// Moves the camera by what `input` makes of it, if there is one: whether it has moved.
    pub(super) fn steer(&mut self, input: impl FnOnce(&mut Controls) -> bool) {
        if self.controls.as_mut().is_some_and(input) {
            self.changed();
        }
    }

    /// A key went down or up; `pointer` is where the pointer is, in parts of the picture's width and height.
    pub(super) fn key(&mut self, code: &str, is_pressed: bool, is_modified: bool, pointer: Option<[f64; 2]>) {
        let action = match &mut self.controls {
            Some(controls) => controls.key(code, is_pressed, is_modified),
            None => crate::player::action_of(code, is_modified).filter(|_| is_pressed),
        };
        if let Some(action) = action {
            self.act(action, pointer);
        }
    }

    /// Does what a key or a button asks for.
    pub(super) fn act(&mut self, action: Action, pointer: Option<[f64; 2]>) {
        match action {
            Action::Focus => self.focus(pointer.unwrap_or([0.5, 0.5])),
            Action::Reset => {
                if let Some(controls) = &mut self.controls {
                    controls.key("KeyR", true, false);
                }
            }
            Action::Recall(_) | Action::Keep(_) => {}
            Action::Help => self.has_help = !self.has_help,
            Action::Panel => self.has_panel = !self.has_panel,
            Action::NextView => self.set_view(self.view.next()),
            Action::Screenshot => self.take_screenshot(),
            Action::Boxes => self.has_boxes = !self.has_boxes,
            Action::Record | Action::Play => {
                let is_new = if action == Action::Record { self.recorder.record() } else { self.recorder.play() };
                if is_new {
                    self.write_path();
                }
            }
            Action::NextCamera | Action::CameraBefore => {
                let count = self.slots[0].as_ref().map_or(0, |s| s.opened.document.metadata.cameras.len());
                self.go_to_camera(self.photograph.neighbor(count, action == Action::NextCamera));
            }
        }
        if matches!(action, Action::Reset | Action::Recall(_)) {
            self.changed();
        }
    }

    /// Changes the way to look at the picture.
    pub(super) fn set_view(&mut self, view: View) {
        // Normals are drawn only where they are wanted.
        if view == View::Normals {
            self.changed();
        }
        self.view = view;
    }

    fn focus(&mut self, at: [f64; 2]) {
        let size = self.picture_size();
        let (Some(controls), Some(slot)) = (&mut self.controls, &mut self.slots[0]) else { return };
        if slot.is_drawing() {
            // The device is at a picture that is then begun again.
            self.pace.abandoned();
        }
        if let Some(point) = slot.point_at(&controls.camera(size), at) {
            controls.focus(point);
        }
        self.pace.changed();
    }

    /// Draws all scenes as `choice` says.
    pub(super) fn choose(&mut self, choice: &RenderSettings) {
        (self.approximation, self.finest) = (choice.approximation, choice.divisor);
        self.approximate();
    }

    /// Draws all scenes with the approximation that is set now.
    pub(super) fn approximate(&mut self) {
        self.seconds_before = self.seconds.take();
        let mut failure = None;
        for slot in self.slots.iter_mut().flatten() {
            failure = slot.approximate(&self.device, &self.approximation).err().or(failure);
        }
        if let Some(text) = failure {
            self.say(text);
        }
        self.pace.abandoned();
        self.changed();
    }

    /// Writes what is seen, at full resolution, to a PNG file in the current folder.
    fn take_screenshot(&mut self) {
        let size = self.picture_size();
        let (Some(controls), Some(slot)) = (&self.controls, &mut self.slots[0]) else { return };
        let camera = controls.camera(size);
        let written = slot.picture(&camera).map_err(|e| e.to_string()).and_then(|pixels| {
            let own = slot.scene.frame.background;
            let wanted = self.background.unwrap_or(own);
            let colors: Vec<[f32; 3]> = (pixels.iter())
                .map(|p| [0, 1, 2].map(|c| p.color[c] + (1.0 - p.opacity) * (wanted[c] - own[c])))
                .collect();
            let png = color_png(size, &colors).map_err(|e| e.to_string())?;
            let stem = slot.opened.name.trim_end_matches(".strivec").to_owned();
            write_new(&stem, "png", &png)
        });
        self.say(match written {
            Ok(name) => format!("wrote {name}"),
            Err(text) => format!("screenshot: {text}"),
        });
        self.pace.abandoned();
        self.changed();
    }

    /// Puts the camera where training camera number `n` of the file was.
    pub(super) fn go_to_camera(&mut self, n: usize) {
        let (Some(controls), Some(slot)) = (&mut self.controls, &self.slots[0]) else { return };
        if self.photograph.go_to(n, &slot.opened.document.metadata.cameras, controls) {
            self.changed();
        }
    }

    /// Loads the photograph that training camera took whose number is chosen, where it is wanted and not there yet.
    pub(super) fn load_photograph(&mut self) {
        let (Some(folder), Photograph { camera: Some(n), share, is_loaded: false }) = (&self.data, &self.photograph)
        else {
            return;
        };
        if *share == 0.0 {
            return;
        }
        let options = LoadOptions { views: Some(*n..*n + 1), ..LoadOptions::default() };
        let loaded = dataset::load(folder, "train", &options);
        let Some(slot) = &mut self.slots[0] else { return };
        match loaded.map(|dataset| dataset.views.into_iter().next()) {
            Ok(Some(view)) => {
                let colors = view.pixels.colors(slot.scene.frame.background);
                let byte = |v: f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
                let rgba: Vec<u8> = colors.iter().flat_map(|c| [byte(c[0]), byte(c[1]), byte(c[2]), 255]).collect();
                slot.painter.set_photograph([view.camera.width, view.camera.height], rgba);
                self.photograph.is_loaded = true;
            }
            Ok(None) => {}
            Err(error) => {
                self.photograph.share = 0.0;
                self.say(error.to_string());
            }
        }
    }

    /// How slot `n` is shown.
    pub(super) fn show(&self, n: usize) -> Option<Show> {
        let slot = self.slots[n].as_ref()?;
        let show = Show::new(&slot.scene, slot.shown(), self.view, self.background);
        let place = slot.shown().and_then(|shown| self.photograph.place(&slot.opened.document.metadata.cameras, shown));
        Some(match place.filter(|_| n == 0) {
            Some(photograph) => Show { photograph_share: self.photograph.shown_share(), photograph, ..show },
            None => show,
        })
    }

    /// The camera of the picture that slot `n` shows.
    pub(super) fn shown_camera(&self, n: usize) -> Option<&Camera> {
        self.slots[n].as_ref()?.shown()
    }

    /// Whether anything is being opened.
    pub(super) fn is_opening(&self) -> bool {
        self.pending.iter().any(Option::is_some)
    }
}

/// Writes to the first of STEM-001.ENDING, STEM-002.ENDING, … that there is not; returns its name.
fn write_new(stem: &str, ending: &str, bytes: &[u8]) -> Result<String, String> {
    use std::io::Write as _;
    for n in 1.. {
        let name = format!("{stem}-{n:03}.{ending}");
        match std::fs::File::create_new(&name) {
            Ok(mut file) => return file.write_all(bytes).map(|()| name.clone()).map_err(|e| format!("{name}: {e}")),
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(e) => return Err(format!("{name}: {e}")),
        }
    }
    Err(format!("{stem}: there are too many of them"))
}
