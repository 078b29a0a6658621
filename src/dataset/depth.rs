//! Depth maps that a `transforms.json` names: `depth_file_path` of a frame in nerfstudio, `depth_path` in Instant-NGP.
//!
//! A map is a 16-bit gray picture or a NumPy array \[height\]\[width\], in the shape of its photograph. Its numbers times the
//! unit are distances from the camera's plane, in the dataset's units; 0 is unknown. The unit is `integer_depth_scale`, as
//! in Instant-NGP, else a thousandth, as in nerfstudio.

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

use glam::DVec3;
use image::DynamicImage;

use super::decoding_memory::DecodingMemory;
use super::picture::{self, MAX_EDGE};
use super::shot::{Shot, is_scaled};
use super::{Error, LoadOptions};
use strivec_format::geometry::{Camera, Ray};
use strivec_import::npy;

/// The smallest cosine between a ray and the optical axis at which a depth is still a distance.
const LEAST_COSINE: f64 = 0.05;

/// A depth map of a photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// File of the depth map.
    pub path: PathBuf,
    pub(super) shot: Shot,
    /// Length of a depth of 1, in the dataset's units.
    pub(super) unit: f64,
}

impl DepthMap {
    /// \[height\]\[width\] the distances along the rays of `camera`, which is the photograph's at any size, in the
    /// dataset's units; 0 where unknown. The map is decoded within `memory`.
    pub(super) fn distances(&self, camera: &Camera, memory: &DecodingMemory) -> Result<Vec<f32>, Error> {
        let (size, depths) = self.depths(memory)?;
        self.camera(size)?;
        let nearest = |pixel: u32, of: u32, extent: u32| {
            (u64::from(2 * pixel + 1) * u64::from(extent) / u64::from(2 * of)) as usize
        };
        let distance = |column: u32, row: u32| -> Option<f64> {
            let place =
                nearest(row, camera.height, size[1]) * size[0] as usize + nearest(column, camera.width, size[0]);
            self.distance(camera, &camera.ray(column, row)?, depths[place])
        };
        let pixels = (0..camera.height).flat_map(|row| (0..camera.width).map(move |column| (column, row)));
        Ok(pixels.map(|(column, row)| distance(column, row).unwrap_or(0.0) as f32).collect())
    }

    /// The places that the map shows, in the dataset's space: those of all its pixels, or of pixels at equal steps if they
    /// are more than about `most`.
    ///
    /// # Errors
    ///
    /// If the map cannot be read or has another shape than its photograph.
    pub fn points(&self, most: u64) -> Result<Vec<DVec3>, Error> {
        let (size, depths) = self.depths(&DecodingMemory::new(LoadOptions::MAX_MEMORY))?;
        let camera = self.camera(size)?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let step = (pixels as f64 / most.max(1) as f64).sqrt().ceil().max(1.0) as usize;
        let mut points = Vec::new();
        for row in (step as u32 / 2..size[1]).step_by(step) {
            for column in (step as u32 / 2..size[0]).step_by(step) {
                let depth = depths[row as usize * size[0] as usize + column as usize];
                let Some(ray) = camera.ray(column, row) else { continue };
                points.extend(self.distance(&camera, &ray, depth).map(|distance| ray.at(distance)));
            }
        }
        Ok(points)
    }

    /// The distance along `ray` of `camera` at which `depth`, a number of the map, is; `None` if it is unknown.
    fn distance(&self, camera: &Camera, ray: &Ray, depth: f64) -> Option<f64> {
        let (depth, cosine) = (self.unit * depth, -ray.direction.dot(camera.world_from_camera.z_axis));
        (depth > 0.0 && depth.is_finite() && cosine >= LEAST_COSINE).then(|| depth / cosine)
    }

    /// The photograph's camera for a picture of `size`.
    fn camera(&self, size: [u32; 2]) -> Result<Camera, Error> {
        let mut shot = self.shot.clone();
        let expected = match shot.intrinsics.size {
            Some(declared) => declared,
            None => picture::header(&shot.picture)?.size,
        };
        if !is_scaled(size, expected) {
            let (path, like) = (self.path.clone(), shot.picture);
            return Err(Error::PictureSize { path, expected, like, found: size });
        }
        shot.intrinsics.size = Some(expected);
        Ok(shot.camera(size))
    }

    /// Columns and rows, and \[height\]\[width\] depths in units.
    fn depths(&self, memory: &DecodingMemory) -> Result<([u32; 2], Vec<f64>), Error> {
        if self.path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npy")) {
            return self.array();
        }
        match picture::decoded(&self.path, false, memory)?.0 {
            DynamicImage::ImageLuma16(gray) => {
                Ok((gray.dimensions().into(), gray.into_raw().into_iter().map(f64::from).collect()))
            }
            other => {
                let found = format!("{:?}", other.color());
                Err(Error::text(&self.path, "the depth map", "a 16-bit gray picture or a NumPy array", found))
            }
        }
    }

    fn array(&self) -> Result<([u32; 2], Vec<f64>), Error> {
        let path = &self.path;
        let malformed = |found: String| Error::text(path, "the depth map", "an array [height][width]", found);
        let file = File::open(path).map_err(Error::read(path))?;
        let mut input = BufReader::new(file);
        let header = npy::Header::read(&mut input).map_err(|e| malformed(e.to_string()))?;
        let extent = |length: u64| u32::try_from(length).ok().filter(|n| (1..=MAX_EDGE).contains(n));
        let size = match header.shape[..] {
            [height, width] | [height, width, 1] if !header.fortran_order => extent(width).zip(extent(height)),
            _ => None,
        };
        let (width, height) = size.ok_or_else(|| malformed(format!("the shape {:?}", header.shape)))?;
        let depths = header.numbers(&mut input).map_err(|e| malformed(e.to_string()))?;
        Ok(([width, height], depths))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A camera two units above the plane z = 0 that looks down, and its depth map in the file `name`.
    fn folder(name: &str, keys: &str, depth: &[u8]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,2],[0,0,0,1]]";
        let frame = format!(r#"{{"file_path": "a.png", "depth_file_path": "{name}", "transform_matrix": {pose}}}"#);
        let json = format!(r#"{{"fl_x": 10, "w": 8, "h": 6{keys}, "frames": [{frame}]}}"#);
        fs::write(folder.path().join("transforms.json"), json).unwrap();
        fs::write(folder.path().join(name), depth).unwrap();
        folder
    }

    fn png(size: [u32; 2], depth: u16) -> Vec<u8> {
        let gray = image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(size[0], size[1], image::Luma([depth]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        DynamicImage::ImageLuma16(gray).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    fn maps(folder: &tempfile::TempDir) -> Vec<DepthMap> {
        super::super::depth_maps(&folder.path().join("transforms.json")).unwrap()
    }

    #[test]
    fn a_constant_depth_is_a_plane_at_any_size_and_unit() {
        let array = {
            let mut bytes = Vec::new();
            npy::write(&mut bytes, &[3, 4], [500.0f32; 12]).unwrap();
            bytes
        };
        for (name, keys, depth, count) in [
            ("d.png", "", png([8, 6], 2000), 48),
            ("d.png", r#", "integer_depth_scale": 0.5"#, png([4, 3], 4), 12),
            ("d.npy", r#", "integer_depth_scale": 0.004"#, array, 12),
        ] {
            let points = maps(&folder(name, keys, &depth))[0].points(1000).unwrap();
            assert_eq!(points.len(), count);
            assert!(points.iter().all(|p| p.z.abs() < 1e-9), "{points:?}");
            // The middles of the outermost pixels of a picture 1.6 units wide.
            let widest = points.iter().map(|p| p.x).fold(0.0, f64::max);
            let expected = if count == 48 { 0.7 } else { 0.6 };
            assert!((widest - expected).abs() < 1e-9, "{widest}");
        }
        assert!(maps(&folder("d.png", "", &png([8, 6], 2000)))[0].points(12).unwrap().len() <= 12);
        assert_eq!(maps(&folder("d.png", "", &png([8, 6], 0)))[0].points(1000).unwrap(), []);
    }

    #[test]
    fn other_pictures_are_refused() {
        let gray8 = {
            let mut bytes = std::io::Cursor::new(Vec::new());
            DynamicImage::new_luma8(8, 6).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
            bytes.into_inner()
        };
        let mut huge = Vec::new();
        npy::write(&mut huge, &[3, 4], [0.5f32; 12]).unwrap();
        let at = huge.windows(4).position(|bytes| bytes == b"3, 4").unwrap();
        huge[at..at + 4].copy_from_slice(b"9, 9");
        for (name, depth, expected) in [
            ("d.png", gray8, "the depth map must be a 16-bit gray picture"),
            ("d.png", png([6, 6], 1), "the picture size must be 8x6"),
            ("d.npy", huge, "an array [height][width]"),
            ("d.npy", b"no array".to_vec(), "an array [height][width]"),
        ] {
            let message = maps(&folder(name, "", &depth))[0].points(9).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn distances_are_those_to_the_plane_at_any_size() {
        let folder = folder("d.png", "", &png([8, 6], 2000));
        let map = &maps(&folder)[0];
        for downscale in [1, 2] {
            let camera = map.camera([8, 6]).unwrap().downscaled(downscale);
            let distances = map.distances(&camera, &DecodingMemory::new(1 << 20)).unwrap();
            assert_eq!(distances.len(), (48 / downscale.pow(2)) as usize);
            for (ray, distance) in camera.rays(0..camera.height).zip(distances) {
                assert!(ray.unwrap().at(f64::from(distance)).z.abs() < 1e-6);
            }
        }
    }

    #[test]
    fn absent_maps_are_none() {
        let folder = folder("d.png", "", &png([8, 6], 2000));
        fs::remove_file(folder.path().join("d.png")).unwrap();
        assert_eq!(maps(&folder), []);
    }
}
