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

/// The images of `path` with their numbers. Each has two lines: its own, and that of its points, which may be empty.
pub(super) fn images(path: &Path) -> Result<Vec<(u32, RawImage)>, Error> {
    let text = files::read_listing(path)?;
    let mut images = Vec::new();
    let mut lines = text.lines().enumerate();
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
        lines.next();
    }
    Ok(images)
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
