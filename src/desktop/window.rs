//! The window: its events, and painting it.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Parser;
use egui::Rect;
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, StartCause, TouchPhase, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{ModifiersState, PhysicalKey};
use winit::window::{Window, WindowId};

use super::app::App;
use super::arguments::{Arguments, RendererChoice};
use super::opening::{self, OpeningError, is_url};
use super::painter::Device;
use super::panel;
use super::surface::{Painting, WindowSurface};
use strivec_cli::print_clap_error;
use strivec_field::render::gpu::Precision;
use strivec_format::escape::escaped;
use strivec_player::Drag;

/// Pixels of touchpad scrolling per line of a wheel.
const PIXELS_A_LINE: f64 = 40.0;

/// Runs `strivec-player` with the process's arguments.
pub fn main() -> ExitCode {
    match Arguments::try_parse() {
        Ok(arguments) => match run(arguments) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("strivec-player: {}", escaped(&error.text));
                ExitCode::from(error.exit_code)
            }
        },
        Err(error) => {
            print_clap_error(&error);
            ExitCode::from(u8::from(error.use_stderr()))
        }
    }
}

/// Runs the player until its window is closed.
fn run(arguments: Arguments) -> Result<(), OpeningError> {
    if let Some(place) = arguments.place.as_ref().filter(|place| !is_url(place) && !Path::new(place).is_dir()) {
        opening::check(place)?;
    }
    let no_window = |text| OpeningError { text, exit_code: 4 };
    let event_loop = EventLoop::<Woken>::with_user_event().build().map_err(|_| no_window(no_display()))?;
    let proxy = event_loop.create_proxy();
    let mut player = PlayerWindow { arguments, proxy, open: None, failure: None };
    let ended = event_loop.run_app(&mut player);
    match player.failure {
        Some(error) => Err(error),
        None => ended.map_err(|_| no_window("the connection to the display was lost".into())),
    }
}

/// Text of the error that there is no connection to a display.
fn no_display() -> String {
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    match (set("WAYLAND_DISPLAY"), set("DISPLAY")) {
        _ if cfg!(any(windows, target_os = "macos")) => {
            "cannot open a window: the window system is not available".to_owned()
        }
        (None, None) => "cannot open a window: no display; set DISPLAY or WAYLAND_DISPLAY".to_owned(),
        (Some(name), _) => format!("cannot open a window: cannot connect to the display WAYLAND_DISPLAY={name}"),
        (None, Some(name)) => format!(
            "cannot open a window: cannot connect to the display DISPLAY={name}, or the libraries libX11, libX11-xcb, \
             libXcursor, libXi and libxkbcommon-x11 are missing"
        ),
    }
}

/// A background thread has an event.
#[derive(Debug)]
struct Woken;

/// The player, and its window once it is open.
struct PlayerWindow {
    arguments: Arguments,
    proxy: EventLoopProxy<Woken>,
    open: Option<OpenWindow>,
    failure: Option<OpeningError>,
}

/// An open window and its player.
struct OpenWindow {
    window: Arc<Window>,
    surface: WindowSurface,
    egui: egui_winit::State,
    app: App,
    modifiers: ModifiersState,
    /// Position of the pointer, in pixels.
    pointer: [f64; 2],
    dragging: Option<Drag>,
    /// The picture's place, in pixels.
    picture: Rect,
    title: String,
}

impl ApplicationHandler<Woken> for PlayerWindow {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.open.is_some() {
            return;
        }
        match OpenWindow::new(event_loop, &self.arguments, &self.proxy) {
            Ok(open) => self.open = Some(open),
            Err(text) => {
                self.failure = Some(OpeningError { text, exit_code: 4 });
                event_loop.exit();
            }
        }
    }

    /// Repaints the window once the delay that egui has set is over.
    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let (StartCause::ResumeTimeReached { .. }, Some(open)) = (cause, &self.open) {
            open.window.request_redraw();
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, Woken: Woken) {
        if let Some(open) = &self.open {
            open.window.request_redraw();
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::RedrawRequested => {
                match open.redraw() {
                    Ok(flow) => event_loop.set_control_flow(flow),
                    Err(text) => self.failure = Some(OpeningError { text, exit_code: 4 }),
                }
                self.failure = self.failure.take().or(open.app.failure.take());
                if self.failure.is_some() {
                    event_loop.exit();
                }
            }
            event => open.on_event(event),
        }
    }
}

/// Opens the surface of `window` and the device that renders the pictures, as `arguments` select them. The third value
/// is a note if the graphics device cannot be used.
fn open_surface(
    window: &Arc<Window>,
    arguments: &Arguments,
) -> Result<(WindowSurface, Device, Option<String>), String> {
    let on_gpu = if arguments.renderer == RendererChoice::Memory { None } else { Some(WindowSurface::on_gpu(window)) };
    let (surface, gpu, note) = match on_gpu {
        Some(Ok((surface, gpu, format))) => (surface, Some((gpu, format)), None),
        Some(Err(error)) => (WindowSurface::in_memory(window)?, None, Some(format!("{error}; the CPU draws instead"))),
        None => (WindowSurface::in_memory(window)?, None, None),
    };
    // A software device is many times slower than the CPU renderer.
    let is_hardware = gpu.as_ref().is_some_and(|(gpu, _)| gpu.info().device_type != wgpu::DeviceType::Cpu);
    let draws = match arguments.renderer {
        RendererChoice::Auto => is_hardware,
        RendererChoice::Gpu => gpu.is_some(),
        RendererChoice::Cpu | RendererChoice::Memory => false,
    };
    let precision = if arguments.half { Precision::F16 } else { Precision::F32 };
    Ok((surface, Device { gpu, draws, precision }, note))
}

/// Makes functions that wake the window of `proxy` from another thread.
fn waker(proxy: EventLoopProxy<Woken>) -> impl Fn() -> Box<dyn Fn() + Send> + 'static {
    move || {
        let proxy = proxy.clone();
        // A closed window needs no event.
        Box::new(move || drop(proxy.send_event(Woken))) as Box<dyn Fn() + Send>
    }
}

impl OpenWindow {
    fn new(event_loop: &ActiveEventLoop, arguments: &Arguments, proxy: &EventLoopProxy<Woken>) -> Result<Self, String> {
        let [width, height] = arguments.size.unwrap_or([1280, 800]);
        let attributes =
            Window::default_attributes().with_title("Strivec").with_inner_size(LogicalSize::new(width, height));
        let window =
            event_loop.create_window(attributes).map_err(|e| format!("cannot open a window on this display: {e}"))?;
        let window = Arc::new(window);
        let (surface, device, note) = open_surface(&window, arguments)?;
        let most_texture = device.gpu.as_ref().map(|(gpu, _)| gpu.device().limits().max_texture_dimension_2d as usize);
        let egui = egui_winit::State::new(
            egui::Context::default(),
            egui::ViewportId::ROOT,
            event_loop,
            Some(window.scale_factor() as f32),
            Some(winit::window::Theme::Dark),
            most_texture,
        );
        let mut app = App::new(device, arguments, waker(proxy.clone()));
        app.open_arguments(arguments);
        if let Some(note) = note {
            app.say(note);
        }
        window.request_redraw();
        Ok(Self {
            window,
            surface,
            egui,
            app,
            modifiers: ModifiersState::empty(),
            pointer: [0.0; 2],
            dragging: None,
            picture: Rect::NOTHING,
            title: String::new(),
        })
    }

    /// Handles an event of the window.
    fn on_event(&mut self, event: WindowEvent) {
        let response = self.egui.on_window_event(&self.window, &event);
        let in_text = self.egui.egui_ctx().text_edit_focused();
        match event {
            WindowEvent::Resized(size) => self.surface.resize(size.width, size.height),
            WindowEvent::ModifiersChanged(modifiers) => self.modifiers = modifiers.state(),
            WindowEvent::Focused(false) => {
                self.dragging = None;
                if let Some(controls) = &mut self.app.session.controls {
                    controls.release_keys();
                }
            }
            WindowEvent::KeyboardInput { event, .. } if !in_text => self.on_key(&event),
            WindowEvent::CursorMoved { position, .. } => {
                let height = f64::from(self.picture.height()).max(1.0);
                let moved = [(position.x - self.pointer[0]) / height, (position.y - self.pointer[1]) / height];
                self.pointer = [position.x, position.y];
                if let Some(drag) = self.dragging {
                    self.app.session.steer(|controls| {
                        controls.dragged(moved, drag);
                        true
                    });
                }
            }
            WindowEvent::MouseInput { state: ElementState::Released, .. } => self.dragging = None,
            WindowEvent::MouseInput { state: ElementState::Pressed, button, .. } if self.over_picture() => {
                self.dragging = match button {
                    MouseButton::Left if self.modifiers.control_key() => Some(Drag::Look),
                    MouseButton::Left if self.modifiers.shift_key() => Some(Drag::Pan),
                    MouseButton::Left => Some(Drag::Orbit),
                    MouseButton::Right | MouseButton::Middle => Some(Drag::Pan),
                    _ => None,
                };
            }
            WindowEvent::MouseWheel { delta, .. } if self.over_picture() => {
                let lines = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => f64::from(lines),
                    MouseScrollDelta::PixelDelta(pixels) => pixels.y / PIXELS_A_LINE,
                };
                self.app.session.steer(|controls| {
                    controls.wheel(lines);
                    true
                });
            }
            WindowEvent::Touch(touch) => {
                let height = f64::from(self.picture.height()).max(1.0);
                let at = [touch.location.x / height, touch.location.y / height];
                let is_gone = matches!(touch.phase, TouchPhase::Ended | TouchPhase::Cancelled);
                self.app.session.steer(|controls| controls.touched(touch.id, (!is_gone).then_some(at)));
            }
            WindowEvent::DroppedFile(path) => {
                self.app.open_any(&path.display().to_string(), self.modifiers.control_key());
            }
            _ if !response.repaint => return,
            _ => {}
        }
        self.window.request_redraw();
    }

    fn on_key(&mut self, event: &KeyEvent) {
        let PhysicalKey::Code(code) = event.physical_key else { return };
        let code = format!("{code:?}");
        // Only keys that step repeat.
        if event.repeat && !code.starts_with("Arrow") {
            return;
        }
        let saves = self.modifiers.shift_key() && code.starts_with("Digit");
        let is_modified = self.modifiers.control_key() || self.modifiers.super_key() || saves;
        let pointer = self.over_picture().then(|| self.in_picture());
        self.app.key(&code, event.state == ElementState::Pressed, is_modified, pointer);
    }

    /// True if the pointer is over the picture and not over an overlay.
    fn over_picture(&self) -> bool {
        let scale = self.window.scale_factor() as f32;
        let at = egui::Pos2::new(self.pointer[0] as f32, self.pointer[1] as f32);
        let layer = self.egui.egui_ctx().layer_id_at((at.to_vec2() / scale).to_pos2());
        self.picture.contains(at) && layer.is_none_or(|layer| layer.order == egui::Order::Background)
    }

    /// The pointer's place, in parts of the picture's width and height.
    fn in_picture(&self) -> [f64; 2] {
        let at = egui::Pos2::new(self.pointer[0] as f32, self.pointer[1] as f32) - self.picture.min;
        [f64::from(at.x / self.picture.width()), f64::from(at.y / self.picture.height())]
    }

    /// Paints the window. Returns when to paint it again.
    fn redraw(&mut self) -> Result<ControlFlow, String> {
        let input = self.egui.take_egui_input(&self.window);
        let context = self.egui.egui_ctx().clone();
        let mut picture = Rect::NOTHING;
        let app = &mut self.app;
        let output = context.run_ui(input, |ui| picture = panel::lay_out(app, ui));
        self.egui.handle_platform_output(&self.window, output.platform_output);
        let scale = output.pixels_per_point;
        self.picture = Rect::from_min_max(
            (picture.min.to_vec2() * scale).round().to_pos2(),
            (picture.max.to_vec2() * scale).round().to_pos2(),
        );
        let size = [self.picture.width(), self.picture.height()].map(|v| v.max(1.0) as u32);
        let is_busy = self.app.update(size);
        let painting = Painting {
            primitives: context.tessellate(output.shapes, scale),
            textures: output.textures_delta,
            pixels_per_point: scale,
            picture: self.picture,
        };
        self.window.pre_present_notify();
        self.surface.paint(&self.app, painting, &self.window)?;
        let title = self.app.title();
        if self.title != title {
            self.window.set_title(&title);
            self.title = title;
        }
        let delay = output.viewport_output.values().map(|v| v.repaint_delay).min().unwrap_or(Duration::MAX);
        if is_busy || delay.is_zero() {
            self.window.request_redraw();
            return Ok(ControlFlow::Poll);
        }
        Ok(Instant::now().checked_add(delay).map_or(ControlFlow::Wait, ControlFlow::WaitUntil))
    }
}
