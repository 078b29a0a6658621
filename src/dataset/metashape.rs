//! Metashape's layout: `cameras.xml` (File > Export > Export Cameras, Agisoft XML) and `images/`.
//!
//! A camera's `transform` is the row-major map from the camera, in OpenCV's axes, to its chunk, whose space is the dataset's.
//! A camera's sensor has the focal length, the offset of the principal point from the picture's middle, and Brown's
//! distortion, in which P1 and P2 stand in the other order than in OpenCV. Cameras of other components than the largest
//! have no common space, and cameras without a `transform` were not aligned: both count as frames without a pose.

use std::collections::BTreeMap;
use std::path::Path;

use roxmltree::{Document, Node, ParsingOptions};

use super::capture::Capture;
use super::inventory_entry::Standing;
use super::records::BadRecords;
use super::shot::{Focal, Intrinsics, OPENGL_FROM_OPENCV, Shot, extent};
use super::{Error, files};
use strivec_format::geometry::{Distortion, Lens, NotRigid, Projection, rigid};

/// The file of cameras.
pub(super) const CAMERAS: &str = "cameras.xml";
/// The most nodes of the file, each of some 50 bytes in memory.
const MAX_NODES: u32 = 1 << 24;
/// The most attributes of an element, which the parser compares with each other, and of declarations of namespaces, which it
/// copies to each element below.
const MAX_ATTRIBUTES: usize = 1 << 10;
/// The types of sensors that are read.
const TYPES: &str = "frame, fisheye or spherical";

/// Coefficients that bend rays in a way that is not supported.
const UNSUPPORTED: [(&str, &str); 3] = [
    ("b2", "0, as skew is not supported"),
    ("p3", "0, as a growing tangential distortion is not supported"),
    ("p4", "0, as a growing tangential distortion is not supported"),
];

/// The photographs in `folder`, ascending by name; those in `images_N` if there is such a folder for `downscale` N.
pub(super) fn read(folder: &Path, downscale: u32) -> Result<Capture, Error> {
    let path = folder.join(CAMERAS);
    let text = files::read_listing(&path)?;
    check_attributes(&path, &text)?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(&text, options)
        .map_err(|error| Error::text(&path, "the file", "Metashape's XML of cameras", error.to_string()))?;
    let file = CamerasFile { path: &path };
    let chunk = file.child(document.root_element(), "chunk")?;
    let mut sensors = BTreeMap::new();
    for sensor in file.child(chunk, "sensors")?.children().filter(|node| node.has_tag_name("sensor")) {
        sensors.insert(file.attribute(sensor, "id")?, Sensor { node: sensor, intrinsics: None });
    }
    // Groups of cameras are elements of their own.
    let cameras: Vec<Node<'_, '_>> =
        file.child(chunk, "cameras")?.descendants().filter(|node| node.has_tag_name("camera")).collect();
    let component = largest_component(&cameras);
    let images = folder.join("images");
    let smaller = files::smaller(&images, downscale);
    let (mut capture, mut bad) = (Capture::new(&path, Vec::new()), BadRecords::default());
    file.tell(document.root_element(), &cameras, component, &mut capture);
    let mut aligned = 0;
    for camera in cameras.into_iter().filter(|camera| camera.attribute("enabled") != Some("false")) {
        match camera.children().find(|node| node.has_tag_name("transform")) {
            Some(pose) if camera.attribute("component_id") == component => {
                let sensor = sensors.get_mut(file.attribute(camera, "sensor_id")?);
                aligned += 1;
                let shot = file.shot(camera, pose, sensor, (&images, smaller.as_deref(), downscale));
                let numbers = pose.text().unwrap_or_default().split_whitespace().filter_map(|word| word.parse().ok());
                if numbers.into_iter().all(f64::is_finite) {
                    capture.shots.push(shot?);
                } else {
                    bad.keep(shot);
                }
            }
            _ => capture.lost += 1,
        }
    }
    let bad = bad.tolerated(aligned)?;
    capture.lost += bad.len();
    capture.tell_bad(CAMERAS.into(), &bad, aligned, "poses");
    capture.leave_out_repeated(folder);
    capture.shots.sort_by(|a, b| a.picture.cmp(&b.picture));
    Ok(capture)
}

/// Checks that the parser takes time in proportion to `text`, the file `path`.
fn check_attributes(path: &Path, text: &str) -> Result<(), Error> {
    // An element's attributes stand between two "<", which no attribute may contain. Each has a "=".
    let in_one = text.split('<').map(|part| part.bytes().filter(|byte| *byte == b'=').count()).max().unwrap_or(0);
    let namespaces = text.matches("xmlns").count();
    for (what, found) in [("attributes of an element", in_one), ("declarations of namespaces", namespaces)] {
        if found > MAX_ATTRIBUTES {
            let (limit, found) = (MAX_ATTRIBUTES as u64, found as u64);
            return Err(Error::TooLarge { path: path.to_path_buf(), what, limit, found });
        }
    }
    Ok(())
}

/// A sensor, and its intrinsics once a camera has needed them: to look for them again for each camera would take the
/// product of cameras and elements.
struct Sensor<'a, 'i> {
    node: Node<'a, 'i>,
    intrinsics: Option<Intrinsics>,
}

/// The `component_id` of the most aligned `cameras`, which may be none.
fn largest_component<'a>(cameras: &[Node<'a, '_>]) -> Option<&'a str> {
    let mut counts: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    for camera in cameras.iter().filter(|camera| camera.children().any(|node| node.has_tag_name("transform"))) {
        *counts.entry(camera.attribute("component_id")).or_default() += 1;
    }
    // The first of several.
    let largest = counts.values().copied().max()?;
    counts.into_iter().find(|(_, count)| *count == largest).and_then(|(component, _)| component)
}

/// `cameras.xml`, for messages.
struct CamerasFile<'a> {
    path: &'a Path,
}

impl CamerasFile<'_> {
    /// Tells what else is in the file: further chunks, components without a common space, cameras that are turned off.
    fn tell(&self, root: Node<'_, '_>, cameras: &[Node<'_, '_>], component: Option<&str>, capture: &mut Capture) {
        let is_off = |camera: &&Node<'_, '_>| camera.attribute("enabled") == Some("false");
        let is_apart = |camera: &&Node<'_, '_>| {
            let has_pose = camera.children().any(|node| node.has_tag_name("transform"));
            !is_off(camera) && has_pose && camera.attribute("component_id") != component
        };
        for (count, what) in [
            (root.children().filter(|node| node.has_tag_name("chunk")).count().saturating_sub(1), "further chunks"),
            (cameras.iter().filter(is_off).count(), "cameras that are not enabled"),
            (cameras.iter().filter(is_apart).count(), "cameras of smaller components, which have no common space"),
        ] {
            if count > 0 {
                capture.tell(Standing::Unused, CAMERAS, count, format!("{count} {what}"));
            }
        }
    }

    fn child<'a, 'i>(&self, node: Node<'a, 'i>, name: &str) -> Result<Node<'a, 'i>, Error> {
        let place = || node.tag_name().name().to_owned();
        let found = node.children().find(|child| child.has_tag_name(name));
        found.ok_or_else(|| Error::text(self.path, place(), format!("an element with a {name}"), "none"))
    }

    fn attribute<'a>(&self, node: Node<'a, '_>, name: &str) -> Result<&'a str, Error> {
        let place = || format!("{}: {name}", self.place(node));
        node.attribute(name).ok_or_else(|| Error::text(self.path, place(), "an attribute", "none"))
    }

    /// The name of `node` and its label or number.
    fn place(&self, node: Node<'_, '_>) -> String {
        let of = node.attribute("label").or(node.attribute("id")).unwrap_or("without a label");
        format!("{} {of:?}", node.tag_name().name())
    }

    fn number(&self, node: Node<'_, '_>, name: &str, text: &str) -> Result<f64, Error> {
        let place = || format!("{}: {name}", self.place(node));
        text.trim().parse().map_err(|_| Error::text(self.path, place(), "a number", format!("{text:?}")))
    }

    fn shot(
        &self,
        camera: Node<'_, '_>,
        pose: Node<'_, '_>,
        sensor: Option<&mut Sensor<'_, '_>>,
        (images, smaller, downscale): (&Path, Option<&Path>, u32),
    ) -> Result<Shot, Error> {
        let refuse = |what: &str, expected: &str, found: String| {
            Error::text(self.path, format!("{}: {what}", self.place(camera)), expected, found)
        };
        let sensor = sensor.ok_or_else(|| refuse("sensor_id", "the id of a sensor", "another".into()))?;
        let label = self.attribute(camera, "label")?;
        let picture = files::inside(label)
            .ok_or_else(|| refuse("label", "the name of a picture in images", format!("{label:?}")))?;
        let smaller = smaller.map(|smaller| (smaller.join(&picture), downscale));
        let picture = images.join(picture);
        let picture = if files::is_picture(&picture) { picture } else { files::with_ending(&picture) };
        let mut rows = [[0.0; 4]; 4];
        let words: Vec<&str> = pose.text().unwrap_or_default().split_whitespace().collect();
        if words.len() != 16 {
            return Err(refuse("transform", "16 numbers", words.len().to_string()));
        }
        for (value, word) in rows.as_flattened_mut().iter_mut().zip(words) {
            *value = self.number(camera, "transform", word)?;
        }
        let (rotation, position) =
            rigid(&rows).map_err(|NotRigid { expected, found }| refuse("transform", expected, found))?;
        let intrinsics = match sensor.intrinsics {
            Some(known) => known,
            None => *sensor.intrinsics.insert(self.intrinsics(sensor.node)?),
        };
        let world_from_camera = rotation * OPENGL_FROM_OPENCV;
        Ok(Shot { smaller, ..Shot::of(picture, intrinsics, world_from_camera, position) })
    }

    /// The intrinsics of `sensor`, by its adjusted calibration if it has one.
    fn intrinsics(&self, sensor: Node<'_, '_>) -> Result<Intrinsics, Error> {
        let place = self.place(sensor);
        let calibrations = || sensor.children().filter(|node| node.has_tag_name("calibration"));
        let adjusted = calibrations().find(|node| node.attribute("class") == Some("adjusted"));
        let calibration = adjusted.or_else(|| calibrations().next());
        let resolution = self.child(calibration.unwrap_or(sensor), "resolution").or(self.child(sensor, "resolution"))?;
        let side = |name| {
            let value = self.number(sensor, name, self.attribute(resolution, name)?)?;
            extent(value).ok_or_else(|| Error::text(self.path, &place, super::shot::EXTENT, value.to_string()))
        };
        let size = [side("width")?, side("height")?];
        let kind = sensor.attribute("type").unwrap_or("frame");
        let projection = match kind {
            "frame" => Projection::Perspective,
            "fisheye" | "equidistant_fisheye" => Projection::Fisheye,
            "spherical" => {
                let (focal, principal) = (Focal::Panorama, [None; 2]);
                return Ok(Intrinsics { size: Some(size), focal, principal, lens: Lens::PANORAMA });
            }
            other => return Err(Error::text(self.path, format!("{place}: type"), TYPES, format!("{other:?}"))),
        };
        let calibration = calibration.ok_or_else(|| Error::text(self.path, &place, "calibrated", "no calibration"))?;
        let value = |name: &str| match calibration.children().find(|node| node.has_tag_name(name)) {
            Some(node) => self.number(sensor, name, node.text().unwrap_or_default()),
            None => Ok(0.0),
        };
        for (key, expected) in UNSUPPORTED {
            let found = value(key)?;
            if found != 0.0 {
                return Err(Error::text(self.path, format!("{place}: {key}"), expected, found.to_string()));
            }
        }
        let (f, radial) = (value("f")?, [value("k1")?, value("k2")?, value("k3")?, value("k4")?]);
        let distortion = Distortion::new(radial, [0.0; 3], [value("p2")?, value("p1")?], [0.0; 2]);
        let distortion = distortion
            .ok_or_else(|| Error::text(self.path, &place, "of finite coefficients", format!("{radial:?}")))?;
        let principal = [Some(0.5 * f64::from(size[0]) + value("cx")?), Some(0.5 * f64::from(size[1]) + value("cy")?)];
        let lens = Lens { projection, distortion };
        let intrinsics = Intrinsics { size: Some(size), focal: Focal::Pixels([f + value("b1")?, f]), principal, lens };
        intrinsics.check(self.path, &place)?;
        Ok(intrinsics)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras_of(xml: &str) -> Result<Capture, Error> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(CAMERAS), xml).unwrap();
        read(folder.path(), 1)
    }

    #[test]
    fn cameras_of_one_sensor_take_time_in_proportion_to_the_file() {
        // Of a sensor with 400 000 other elements, 20 000 cameras: 8·10⁹ elements, if each camera looks at all.
        let resolution = r#"<resolution width="16" height="16"/>"#;
        let others = "<x/>".repeat(200_000);
        let sensor = format!(
            r#"<sensor id="0" type="frame">{others}{resolution}<calibration class="adjusted">{others}{resolution}<f>20</f></calibration></sensor>"#
        );
        let pose = "<transform>1 0 0 0 0 1 0 0 0 0 1 4 0 0 0 1</transform>";
        let camera = |n: u32| format!(r#"<camera id="{n}" sensor_id="0" label="{n}.png">{pose}</camera>"#);
        let cameras: String = (0..20_000).map(camera).collect();
        let xml =
            format!("<document><chunk><sensors>{sensor}</sensors><cameras>{cameras}</cameras></chunk></document>");
        let shots = cameras_of(&xml).unwrap().shots;
        assert_eq!(shots.len(), 20_000);
        assert!(shots.iter().all(|shot| shot.intrinsics == shots[0].intrinsics));
    }

    #[test]
    fn attributes_and_namespaces_are_limited() {
        let many = |attribute: fn(usize) -> String| -> String { (0..200_000).map(attribute).collect() };
        for (attributes, what) in [
            (many(|n| format!(" a{n}='1'")), "1024 attributes of an element"),
            (many(|n| format!("><b xmlns:a{n}='{n}'")), "1024 declarations of namespaces"),
        ] {
            let error = cameras_of(&format!("<document{attributes}/>")).unwrap_err().to_string();
            assert!(error.contains(&format!("at most {what} are supported; found 200")), "{error}");
        }
    }
}
