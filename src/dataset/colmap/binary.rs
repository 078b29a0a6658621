//! `cameras.bin` and `images.bin`.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use super::super::Error;
use super::raw::{BINARY_MODELS, RawCamera, RawImage};

/// Bytes of a camera without parameters.
const CAMERA_BYTES: u64 = 4 + 4 + 8 + 8;
/// Bytes of an image without its name and its points.
const IMAGE_BYTES: u64 = 4 + 7 * 8 + 4 + 1 + 8;
/// Bytes of a point in an image.
const POINT_BYTES: u64 = 8 + 8 + 8;
/// The longest name of a picture, in bytes.
const MAX_NAME: usize = 4096;

/// The cameras of `path` with their numbers.
pub(super) fn cameras(path: &Path) -> Result<Vec<(u32, RawCamera)>, Error> {
    let mut input = BinaryFile::open(path)?;
    let count = input.count(CAMERA_BYTES, "cameras")?;
    let mut cameras = Vec::new();
    for _ in 0..count {
        let place = input.place();
        let [id, model] = [input.u32()?, input.u32()?];
        let size = [input.u64()?, input.u64()?];
        let Some(&(name, parameters)) = BINARY_MODELS.get(model as usize) else {
            let expected = format!("a camera model of number 0 to {}", BINARY_MODELS.len() - 1);
            return Err(Error::text(path, place, expected, model.to_string()));
        };
        let parameters = (0..parameters).map(|_| input.f64()).collect::<Result<_, _>>()?;
        cameras.push((id, RawCamera { model: name.to_owned(), size, parameters }));
    }
    input.finish()?;
    Ok(cameras)
}

/// The images of `path` with their numbers. Their points are skipped.
pub(super) fn images(path: &Path) -> Result<Vec<(u32, RawImage)>, Error> {
    let mut input = BinaryFile::open(path)?;
    let count = input.count(IMAGE_BYTES, "images")?;
    let mut images = Vec::new();
    for _ in 0..count {
        let id = input.u32()?;
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = input.f64()?;
        }
        let [w, x, y, z, tx, ty, tz] = numbers;
        let camera = input.u32()?;
        let name = input.name()?;
        let points = input.count(POINT_BYTES, "points of an image")?;
        input.skip(points * POINT_BYTES)?;
        images.push((id, RawImage { rotation: [w, x, y, z], translation: [tx, ty, tz], camera, name }));
    }
    input.finish()?;
    Ok(images)
}

/// The number of images that `path` declares, if it has room for them.
pub(super) fn count(path: &Path) -> Result<u64, Error> {
    BinaryFile::open(path)?.count(IMAGE_BYTES, "images")
}

/// A file that is read front to back.
struct BinaryFile<'a> {
    path: &'a Path,
    file: BufReader<File>,
    length: u64,
    at: u64,
}

impl<'a> BinaryFile<'a> {
    fn open(path: &'a Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(Error::read(path))?;
        let length = file.metadata().map_err(Error::read(path))?.len();
        Ok(Self { path, file: BufReader::new(file), length, at: 0 })
    }

    fn place(&self) -> String {
        format!("byte {}", self.at)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let mut bytes = [0; N];
        self.file.read_exact(&mut bytes).map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                Error::text(self.path, self.place(), "more bytes", "the end of the file")
            }
            _ => Error::read(self.path)(error),
        })?;
        self.at += N as u64;
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32, Error> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, Error> {
        self.array().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, Error> {
        self.array().map(f64::from_le_bytes)
    }

    /// A number of things of at least `bytes` each, which must fit what is left of the file.
    fn count(&mut self, bytes: u64, what: &str) -> Result<u64, Error> {
        let place = self.place();
        let count = self.u64()?;
        let most = (self.length - self.at.min(self.length)) / bytes;
        if count > most {
            let expected = format!("at most {most} {what}, as many as the file has room for");
            return Err(Error::text(self.path, place, expected, count.to_string()));
        }
        Ok(count)
    }

    fn skip(&mut self, bytes: u64) -> Result<(), Error> {
        self.file.seek_relative(bytes as i64).map_err(Error::read(self.path))?;
        self.at += bytes;
        Ok(())
    }

    /// Text that ends in a zero byte.
    fn name(&mut self) -> Result<String, Error> {
        let place = self.place();
        let mut bytes = Vec::new();
        loop {
            let [byte] = self.array()?;
            if byte == 0 {
                break;
            }
            bytes.push(byte);
            if bytes.len() > MAX_NAME {
                return Err(Error::text(
                    self.path,
                    place,
                    format!("a name of at most {MAX_NAME} bytes"),
                    "a longer one",
                ));
            }
        }
        String::from_utf8(bytes).map_err(|_| Error::text(self.path, place, "a name in UTF-8", "other bytes"))
    }

    fn finish(&self) -> Result<(), Error> {
        match self.length - self.at.min(self.length) {
            0 => Ok(()),
            left => Err(Error::text(self.path, self.place(), "the end of the file", format!("{left} more bytes"))),
        }
    }
}
