//! `cameras.txt` and `images.txt`.

use std::path::Path;

use super::super::{Error, files};
use super::raw::{RawCamera, RawImage};

/// The cameras of `path` with their numbers.
pub(super) fn cameras(path: &Path) -> Result<Vec<(u32, RawCamera)>, Error> {
    let text = files::read_listing(path)?;
    let mut cameras = Vec::new();
    for (n, line) in text.lines().enumerate().filter(|(_, line)| has_content(line)) {
        let mut fields = Fields { path, line: n + 1, rest: line.trim() };
        let id = fields.number("the camera's number")?;
        let model = fields.next("the camera's model")?.to_owned();
        let size = [fields.number("the width")?, fields.number("the height")?];
        let mut parameters = Vec::new();
        while !fields.rest.is_empty() {
            parameters.push(fields.number("a parameter")?);
        }
        cameras.push((id, RawCamera { model, size, parameters }));
    }
    Ok(cameras)
}

/// The images of `path` with their numbers, and how many lack the line of their points. Each has two lines: its own, and
/// that of its points, which may be empty.
pub(super) fn images(path: &Path) -> Result<(Vec<(u32, RawImage)>, usize), Error> {
    let text = files::read_listing(path)?;
    let mut images = Vec::new();
    let mut lines = text.lines().enumerate().peekable();
    let mut without_points = 0;
    while let Some((n, line)) = lines.next() {
        if !has_content(line) {
            continue;
        }
        let mut fields = Fields { path, line: n + 1, rest: line.trim() };
        let id = fields.number("the image's number")?;
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = fields.number("a number of the pose")?;
        }
        let [w, x, y, z, tx, ty, tz] = numbers;
        let camera = fields.number("the camera's number")?;
        // Names may hold blanks.
        let name = fields.rest.to_owned();
        images.push((id, RawImage { rotation: [w, x, y, z], translation: [tx, ty, tz], camera, name }));
        // The file may end after its last image.
        let is_last = lines.peek().is_none();
        let has_points = lines.next_if(|(_, line)| !is_image(line) && !line.trim_start().starts_with('#')).is_some();
        without_points += usize::from(!has_points && !is_last);
    }
    Ok((images, without_points))
}

/// The number of lines of images in `path`.
pub(super) fn count(path: &Path) -> Result<u64, Error> {
    Ok(files::read_listing(path)?.lines().filter(|line| has_content(line) && is_image(line)).count() as u64)
}

/// True if `line` is that of an image: nine numbers and a name. A line of points has numbers alone.
fn is_image(line: &str) -> bool {
    let fields = line.split_whitespace();
    let is_number = |field: &str| field.parse::<f64>().is_ok();
    fields.clone().take(9).filter(|field| is_number(field)).count() == 9
        && fields.skip(9).any(|field| !is_number(field))
}

fn has_content(line: &str) -> bool {
    !line.trim().is_empty() && !line.trim_start().starts_with('#')
}

/// A line, field by field.
struct Fields<'a> {
    path: &'a Path,
    line: usize,
    rest: &'a str,
}

impl<'a> Fields<'a> {
    fn next(&mut self, what: &str) -> Result<&'a str, Error> {
        let (field, rest) = self.rest.split_once(char::is_whitespace).unwrap_or((self.rest, ""));
        if field.is_empty() {
            return Err(Error::text(self.path, format!("line {}", self.line), what, "the end of the line"));
        }
        self.rest = rest.trim_start();
        Ok(field)
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, Error> {
        let field = self.next(what)?;
        field.parse().map_err(|_| {
            let shown: String = field.chars().take(40).collect();
            Error::text(self.path, format!("line {}", self.line), what, format!("{shown:?}"))
        })
    }
}
