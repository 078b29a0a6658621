//! A picture of the scene in training beside its photograph: in a PNG file, and in a terminal that displays pictures.

use std::fmt::Write;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::{Error, Session, write_atomically};
use crate::dataset::View;
use crate::geometry::Camera;
use crate::measure::{Canvas, color_png, side_by_side};
use crate::train::Trainer;

/// The most columns of a picture.
const MAX_WIDTH: u32 = 400;
/// The least time between two pictures, and how many times as long as making a picture it is at least.
const LEAST_PAUSE: Duration = Duration::from_secs(2);
const PAUSES: u32 = 20;
/// Rows of text that a picture takes up in a terminal.
const ROWS: u32 = 16;

/// The view that is shown again and again.
pub(super) struct Watch {
    path: PathBuf,
    camera: Camera,
    photograph: Canvas,
    protocol: Option<Protocol>,
    due: Instant,
}

impl Watch {
    /// Shows `view` as a PNG file at `path`, which may be overwritten, on `background`, and in the terminal.
    pub(super) fn new(path: PathBuf, view: &View, background: [f32; 3]) -> Result<Self, Error> {
        let factor = view.camera.width.div_ceil(MAX_WIDTH).clamp(1, view.camera.height);
        let camera = view.camera.downscaled(factor);
        let photograph = downscaled(view, factor, background)?;
        let is_terminal = std::io::stderr().is_terminal();
        let protocol = Protocol::of_environment(|name| std::env::var(name).ok()).filter(|_| is_terminal);
        Ok(Self { path, camera, photograph, protocol, due: Instant::now() })
    }

    /// True if it is time for the next picture.
    pub(super) fn is_due(&self) -> bool {
        Instant::now() >= self.due
    }

    /// Shows the scene of `trainer`.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub(super) fn show(&mut self, trainer: &Trainer<'_>, session: &Session) -> Result<(), Error> {
        let begun = Instant::now();
        let picture = Canvas::new(self.photograph.size, trainer.picture(&self.camera))?;
        let sheet = side_by_side(&[picture, self.photograph.clone()]);
        let png = color_png(sheet.size, &sheet.colors)?;
        write_atomically(&self.path, &png, true)?;
        if let Some(protocol) = self.protocol.filter(|_| !session.console.is_quiet()) {
            session.console.draw(&protocol.sequence(&png), ROWS);
        }
        self.due = Instant::now() + (begun.elapsed() * PAUSES).max(LEAST_PAUSE);
        Ok(())
    }
}

/// The photograph of `view` on `background`, `factor` times smaller: the means of blocks of its pixels.
fn downscaled(view: &View, factor: u32, background: [f32; 3]) -> Result<Canvas, Error> {
    let size = [view.camera.width / factor, view.camera.height / factor];
    let mut colors = Vec::new();
    for y in 0..size[1] {
        for x in 0..size[0] {
            let mut sum = [0.0; 3];
            for (j, i) in (0..factor).flat_map(|j| (0..factor).map(move |i| (j, i))) {
                let pixel = (y * factor + j) as usize * view.camera.width as usize + (x * factor + i) as usize;
                let color = view.pixels.color(pixel, background);
                sum.iter_mut().zip(color).for_each(|(sum, c)| *sum += c);
            }
            colors.push(sum.map(|sum: f32| sum / (factor * factor) as f32));
        }
    }
    Ok(Canvas::new(size, colors)?)
}

/// How a terminal is told to display a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Protocol {
    /// Kitty's graphics protocol: kitty, Ghostty, Konsole.
    Kitty,
    /// iTerm's inline pictures: iTerm, WezTerm, mintty.
    Iterm,
}

impl Protocol {
    /// The protocol of the terminal that these environment variables describe; `None` if it is not known to display
    /// pictures, or a multiplexer is between, which would drop them.
    fn of_environment(variable: impl Fn(&str) -> Option<String>) -> Option<Self> {
        let value = |name| variable(name).unwrap_or_default();
        let (term, program) = (value("TERM"), value("TERM_PROGRAM"));
        if variable("TMUX").is_some() || term.starts_with("screen") || term.starts_with("tmux") {
            return None;
        }
        let is_kitty = ["KITTY_WINDOW_ID", "KONSOLE_VERSION"].iter().any(|name| variable(name).is_some());
        if is_kitty || ["xterm-kitty", "xterm-ghostty"].contains(&term.as_str()) {
            return Some(Self::Kitty);
        }
        let is_iterm = ["iTerm.app", "WezTerm", "mintty"].contains(&program.as_str());
        (is_iterm || value("LC_TERMINAL") == "iTerm2").then_some(Self::Iterm)
    }

    /// The characters that display `png` in [`ROWS`] rows.
    fn sequence(self, png: &[u8]) -> String {
        /// Characters of a part, in kitty's protocol.
        const PART: usize = 4096;
        let text = STANDARD.encode(png);
        let mut sequence = String::new();
        match self {
            Self::Kitty => {
                // A picture of the same numbers replaces the one before; no answers.
                let mut options = format!("a=T,f=100,i=5731,p=1,r={ROWS},q=2,");
                let mut rest = text.as_str();
                while !rest.is_empty() {
                    let (part, after) = rest.split_at(PART.min(rest.len()));
                    let is_last = u8::from(!after.is_empty());
                    let _ = write!(sequence, "\x1b_G{options}m={is_last};{part}\x1b\\");
                    options.clear();
                    rest = after;
                }
            }
            Self::Iterm => {
                let size = png.len();
                let _ = write!(sequence, "\x1b]1337;File=inline=1;height={ROWS};size={size}:{text}\x07");
            }
        }
        sequence
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Pixels;
    use glam::DVec3;

    fn protocol_of(variables: &[(&str, &str)]) -> Option<Protocol> {
        Protocol::of_environment(|name| variables.iter().find(|v| v.0 == name).map(|v| v.1.to_owned()))
    }

    #[test]
    fn terminals_are_known_by_their_variables() {
        assert_eq!(protocol_of(&[("TERM", "xterm-kitty")]), Some(Protocol::Kitty));
        assert_eq!(protocol_of(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm")]), Some(Protocol::Iterm));
        assert_eq!(protocol_of(&[("TERM", "xterm-256color")]), None);
        assert_eq!(protocol_of(&[("TERM", "tmux-256color"), ("KITTY_WINDOW_ID", "1")]), None);
    }

    #[test]
    fn parts_in_kittys_protocol_join_to_the_file() {
        let png: Vec<u8> = (0..10_000u32).map(|n| (n * n % 251) as u8).collect();
        let sequence = Protocol::Kitty.sequence(&png);
        let parts: Vec<(&str, &str)> = sequence
            .split_terminator("\x1b\\")
            .map(|part| part.strip_prefix("\x1b_G").unwrap().split_once(';').unwrap())
            .collect();
        assert!(parts.len() > 2 && parts.iter().all(|(_, text)| text.len() <= 4096));
        let more = |part: &(&str, &str)| part.0.ends_with("m=1");
        assert!(parts[..parts.len() - 1].iter().all(more) && !more(&parts[parts.len() - 1]));
        assert!(parts[0].0.starts_with("a=T,f=100") && parts[1].0 == "m=1");
        let text: String = parts.iter().map(|(_, text)| *text).collect();
        assert_eq!(STANDARD.decode(text).unwrap(), png);
    }

    #[test]
    fn a_photograph_is_shrunk_by_the_means_of_blocks() {
        let camera = Camera::looking_at([5, 2], 1.0, DVec3::X, DVec3::ZERO, DVec3::Z);
        let colors = (0..10).map(|n| [n as f32, 0.0, 1.0]);
        let view = View::new("v", camera, Pixels::opaque(colors));
        let small = downscaled(&view, 2, [0.0; 3]).unwrap();
        assert_eq!((small.size, small.colors), ([2, 1], vec![[3.0, 0.0, 1.0], [5.0, 0.0, 1.0]]));
    }
}
