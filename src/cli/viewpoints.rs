//! Viewpoints: the cameras of a dataset, an orbit, one pose, or a path, all in the dataset's space.

use std::path::PathBuf;

use super::camera_path::{CameraPathOptions, Way, numbered};
use super::dataset::DatasetOptions;
use super::numbers::{POSITIVE, in_range};
use super::{Error, picture_size};
use strivec_capture::dataset;
use strivec_capture::dataset::NamedCamera;
use strivec_field::render::{Orbit, Turntable};
use strivec_format::geometry::{Aabb, Camera};
use strivec_format::model::{Frame, Scene};

/// Viewpoints and their pictures.
#[derive(Clone, Debug, clap::Args)]
#[group(skip)]
#[command(group = clap::ArgGroup::new("viewpoint").required(true).args(["cameras", "orbit", "pose", "path"]))]
pub(super) struct Viewpoints {
    /// Use the cameras of a dataset's JSON file, such as transforms_test.json, or of a dataset folder's test split
    #[arg(long, value_name = "PATH")]
    cameras: Option<PathBuf>,
    /// Place N cameras on a circle around the scene; in an unbounded scene or a room, where its photographs were taken
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    orbit: Option<u32>,
    /// Use one camera: 16 numbers, the row-major camera-to-world matrix as in transforms_test.json; written --pose=N,N,… if the first is negative
    #[arg(long, value_name = "NUMBER", num_args = 1..=16, value_delimiter = ',', allow_negative_numbers = true)]
    pose: Option<Vec<f64>>,
    #[command(flatten)]
    path: CameraPathOptions,
    /// Downscale the dataset's pictures N times
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with_all = ["orbit", "pose", "path"],
        value_parser = clap::value_parser!(u32).range(1..))]
    downscale: u32,
    #[command(flatten)]
    dataset: DatasetOptions,
    /// Size of the pictures in pixels [default: the dataset's, else 800x800]
    #[arg(long, value_name = "WxH", conflicts_with = "downscale", value_parser = picture_size::parse)]
    size: Option<[u32; 2]>,
    /// Horizontal field of view of --orbit, --pose and a turntable, 1 to 170 degrees [default: 40; of a circle where
    /// photographs were taken, theirs]
    #[arg(long, value_name = "DEGREES", conflicts_with = "cameras", value_parser = in_range(1.0..=170.0, "an angle from 1 to 170 degrees"))]
    fov: Option<f64>,
    /// Elevation above the horizon of --orbit and a turntable, -89 to 89 degrees [default: 30; of a circle where
    /// photographs were taken, theirs]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true,
        conflicts_with_all = ["cameras", "pose"],
        value_parser = in_range(-89.0..=89.0, "an angle from -89 to 89 degrees"))]
    elevation: Option<f64>,
    /// Distance from the scene's center of --orbit and a turntable, in dataset units [default: shows the whole scene; of a
    /// circle where photographs were taken, theirs]
    #[arg(long, value_name = "LENGTH", conflicts_with_all = ["cameras", "pose"], value_parser = in_range(POSITIVE, "a positive length"))]
    radius: Option<f64>,
}

impl Viewpoints {
    /// The cameras, at least one, for the scene of this `frame` whose `bounds` are in model units. Orbits and turntables
    /// follow `turn`, if there is one.
    pub(super) fn cameras(
        &self,
        frame: &Frame,
        bounds: &Aabb,
        turn: Option<&Turntable>,
    ) -> Result<Vec<NamedCamera>, Error> {
        if let Some(path) = &self.cameras {
            let options = self.dataset.load_options(self.downscale);
            let cameras = if path.is_dir() {
                dataset::load_cameras(path, "test", self.size, &options)?
            } else {
                dataset::load_transforms_cameras(path, self.size, &options)?
            };
            return match self.size {
                Some(size) => cameras.into_iter().map(|named| resized(named, size)).collect(),
                None => Ok(cameras),
            };
        }
        let size = self.size.unwrap_or([800, 800]);
        if let Some(pose) = &self.pose {
            let camera = Camera::posed(pose, size, self.focal(size));
            let camera = camera.map_err(|error| Error::Usage(format!("--pose: {error}")))?;
            return Ok(vec![NamedCamera { name: "pose".into(), path: "pose".into(), camera }]);
        }
        match (self.orbit, self.path.way()) {
            (Some(count), _) => Ok(numbered("orbit", 3, self.circle(frame, bounds, turn, count, size).into_iter())),
            (None, Some(Way::Turntable(count))) => {
                Ok(numbered("frame", 4, self.circle(frame, bounds, turn, count, size).into_iter()))
            }
            (None, Some(Way::Keyframes(file))) => {
                if self.fov.is_some() || self.elevation.is_some() || self.radius.is_some() {
                    let message = "the keyframes set the view; leave out --fov, --elevation and --radius";
                    return Err(Error::Usage(format!("--path {}: {message}", file.display())));
                }
                self.path.through_keyframes(file, size)
            }
            (None, None) => Err(Error::Usage("give one of --cameras, --orbit, --pose and --path".into())),
        }
    }

    /// Frames a second of a path.
    pub(super) fn fps(&self) -> f64 {
        self.path.fps
    }

    /// The focal length of a picture of `size`, in pixels.
    fn focal(&self, size: [u32; 2]) -> f64 {
        Camera::focal_of_angle(size[0], self.fov.map_or(Orbit::default().horizontal_angle, f64::to_radians))
    }

    /// The first camera of an orbit with the defaults of the command line, for pictures of `size` of `scene`, in model
    /// space. Neither cameras nor viewpoints of the scene are known.
    pub(super) fn first_of_orbit(scene: &Scene, size: [u32; 2]) -> Camera {
        let turn = Turntable::of(scene, None, &[]);
        if let Some(turn) = turn {
            return turn.camera_at(0.0, size, turn.focal(size), turn.distance(), turn.elevation());
        }
        let cameras = Orbit::default().cameras(&scene.frame, &scene.bounds, 1, size);
        cameras[0].mapped(&scene.frame.model_from_dataset)
    }

    /// `count` cameras evenly around the scene, or along `turn`.
    fn circle(
        &self,
        frame: &Frame,
        bounds: &Aabb,
        turn: Option<&Turntable>,
        count: u32,
        size: [u32; 2],
    ) -> Vec<Camera> {
        let dataset_from_model = frame.model_from_dataset.inverse();
        let share = |n: u32| f64::from(n) / f64::from(count);
        if let Some(turn) = turn {
            let focal = self.fov.map_or_else(|| turn.focal(size), |_| self.focal(size));
            let distance = self.radius.map_or(turn.distance(), |radius| radius * frame.model_from_dataset.scale);
            let elevation = self.elevation.map_or(turn.elevation(), f64::to_radians);
            let camera = |n: u32| turn.camera_at(share(n), size, focal, distance, elevation);
            return (0..count).map(|n| camera(n).mapped(&dataset_from_model)).collect();
        }
        let default = Orbit::default();
        let orbit = Orbit {
            horizontal_angle: self.fov.map_or(default.horizontal_angle, f64::to_radians),
            elevation: self.elevation.map_or(default.elevation, f64::to_radians),
            radius: self.radius,
        };
        orbit.cameras(frame, bounds, count, size)
    }
}

/// A dataset's camera for pictures of `size`, which must have the proportions of its own, but for a pixel.
fn resized(named: NamedCamera, size: [u32; 2]) -> Result<NamedCamera, Error> {
    let [width, height] = size;
    let (columns, rows) = (named.camera.width, named.camera.height);
    let difference = (u64::from(width) * u64::from(rows)).abs_diff(u64::from(height) * u64::from(columns));
    if difference > u64::from(columns.max(rows)) {
        let message = format!("--size {width}x{height} is no scaled {columns}x{rows}, the size of {}", named.path);
        return Err(Error::Usage(format!("{message}; leave it out, or give a size of the same proportions")));
    }
    Ok(NamedCamera { camera: named.camera.resized(size), ..named })
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use glam::{DQuat, DVec3};

    use super::*;
    use strivec_format::geometry::Similarity;
    use strivec_format::model::{ColorSpace, UpAxis};

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        viewpoints: Viewpoints,
    }

    fn cameras(arguments: &[&str], up: UpAxis) -> Result<Vec<NamedCamera>, Error> {
        let command = Command::try_parse_from([&["command"], arguments].concat()).unwrap();
        let (frame, bounds) = scene(up);
        command.viewpoints.cameras(&frame, &bounds, None)
    }

    /// A scene around (2, 0, 0) in the dataset's space, whose model space is half as large.
    fn scene(up: UpAxis) -> (Frame, Aabb) {
        let (scale, rotation) = (0.5, DQuat::from_rotation_z(1.0));
        let translation = -scale * (rotation * DVec3::new(2.0, 0.0, 0.0));
        let model_from_dataset = Similarity { scale, rotation, translation };
        let (meters_per_unit, background, color_space) = (None, [1.0; 3], ColorSpace::Srgb);
        let frame = Frame { model_from_dataset, up, meters_per_unit, near: 2.0, far: 6.0, background, color_space };
        (frame, Aabb::around(DVec3::ZERO, DVec3::ONE))
    }

    #[test]
    fn an_orbit_looks_at_the_middle_from_one_height_and_distance() {
        for (up, axis) in [
            (UpAxis::X, DVec3::X),
            (UpAxis::Y, DVec3::Y),
            (UpAxis::Z, DVec3::Z),
            (UpAxis::MinusX, -DVec3::X),
            (UpAxis::MinusY, -DVec3::Y),
            (UpAxis::MinusZ, -DVec3::Z),
        ] {
            let arguments = ["--orbit", "7", "--radius", "5", "--elevation", "30", "--size", "40x20"];
            let cameras = cameras(&arguments, up).unwrap();
            assert_eq!(cameras.len(), 7);
            assert_eq!(cameras[6].name, "orbit_006");
            let turn = |n: usize| (cameras[n].camera.position - DVec3::new(2.0, 0.0, 0.0)).reject_from(axis);
            assert!(turn(0).cross(turn(1)).dot(axis) > 0.0, "counterclockwise, seen from above");
            for NamedCamera { camera, .. } in &cameras {
                let from_target = camera.position - DVec3::new(2.0, 0.0, 0.0);
                assert!((from_target.length() - 5.0).abs() < 1e-12);
                assert!((from_target.dot(axis) - 2.5).abs() < 1e-12);
                assert!((camera.ray_through(20.0, 10.0).unwrap().direction + from_target / 5.0).length() < 1e-12);
                assert!(camera.ray_through(20.0, 0.0).unwrap().direction.dot(axis) > -0.5, "up is up");
            }
        }
    }

    #[test]
    fn by_default_an_orbit_keeps_the_scene_between_near_and_far() {
        // The sphere around the bounds, of radius √3, fits at √3/sin(20°) = 5.06; far allows 6 − √3 = 4.27.
        let radius = |arguments: &[&str]| {
            let cameras = cameras(&[&["--orbit", "1"], arguments].concat(), UpAxis::Z).unwrap();
            0.5 * (cameras[0].camera.position - DVec3::new(2.0, 0.0, 0.0)).length()
        };
        let reach = 3f64.sqrt();
        assert!((radius(&[]) - (6.0 - reach)).abs() < 1e-12);
        assert!((radius(&["--fov", "120"]) - (2.0 + reach)).abs() < 1e-12);
        assert!((radius(&["--fov", "50"]) - reach / 25f64.to_radians().sin()).abs() < 1e-12);
    }

    #[test]
    fn a_pose_is_the_matrix_as_datasets_write_it() {
        let pose = "--pose=0,0,-1,-4,1,0,0,2,0,-1,0,3,0,0,0,1";
        let camera = cameras(&[pose, "--size", "30x20"], UpAxis::Z).unwrap()[0].camera;
        assert_eq!(camera.position, DVec3::new(-4.0, 2.0, 3.0));
        let columns = camera.world_from_camera.to_cols_array_2d();
        let expected = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]];
        assert!(columns.as_flattened().iter().zip(expected.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-12));
        assert!((camera.focal[0] - 15.0 / 20f64.to_radians().tan()).abs() < 1e-12);
    }

    #[test]
    fn cameras_of_a_dataset_take_the_size_given() {
        let folder = tempfile::TempDir::new().unwrap();
        let json = folder.path().join("transforms_test.json");
        let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";
        let frames = format!("[{{\"file_path\": \"a.png\", \"transform_matrix\": {pose}}}]");
        std::fs::write(&json, format!("{{\"w\": 40, \"h\": 31, \"fl_x\": 50, \"frames\": {frames}}}")).unwrap();
        let path = json.to_str().unwrap();
        let size = |arguments: &[&str]| {
            cameras(&[&["--cameras", path], arguments].concat(), UpAxis::Z)
                .map(|cameras| (cameras[0].camera.width, cameras[0].camera.height, cameras[0].camera.focal[0]))
        };
        assert_eq!(size(&[]).unwrap(), (40, 31, 50.0));
        assert_eq!(size(&["--size", "20x15"]).unwrap(), (20, 15, 25.0));
        assert_eq!(size(&["--downscale", "2"]).unwrap(), (20, 15, 25.0));
        let error = size(&["--size", "20x20"]).unwrap_err();
        assert!(error.exit_code() == 1 && error.to_string().contains("no scaled 40x31"), "{error}");
    }

    #[test]
    fn what_is_no_pose_is_refused() {
        for (pose, expected) in [
            ("1,0,0,0,0,1,0,0,0,0,1,0,0,0,0", "16 numbers"),
            ("1,0,0,0,0,1,0,0,0,0,1,0,0,0,1,1", "last row"),
            ("1,0,0,0,0,1,0,0,0,0,-1,0,0,0,0,1", "right-handed"),
            ("1,0,0,0,0,2,0,0,0,0,1,0,0,0,0,1", "rotation"),
            ("1,0,0,NaN,0,1,0,0,0,0,1,0,0,0,0,1", "finite"),
        ] {
            let error = cameras(&["--pose", pose], UpAxis::Z).unwrap_err();
            assert_eq!(error.exit_code(), 1);
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}
