//! Recording and playback of camera paths.

use glam::DQuat;

use super::Controls;
use strivec_field::render::{KeyframesError, MAX_KEYFRAMES, read_keyframes, write_keyframes};
use strivec_format::container::Pose;
use strivec_format::geometry::{CameraPath, Keyframe, Similarity, Viewpoint};

/// Seconds between the keyframes of a recorded path.
const RECORDED_EVERY: f64 = 0.25;

/// Records and plays a camera path in the dataset's space. It reads no clock and writes no file.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    /// The path that was recorded or opened last.
    path: Option<CameraPath>,
    /// Keyframes so far; `None` unless a path is being recorded.
    recording: Option<Vec<Keyframe>>,
    /// Seconds since the start of the recording or of the playback.
    seconds: f64,
    is_playing: bool,
}

impl Recorder {
    /// True while a camera path is being recorded.
    pub fn is_recording(&self) -> bool {
        self.recording.is_some()
    }

    /// True while the camera follows a path.
    pub fn is_playing(&self) -> bool {
        self.is_playing
    }

    /// The path that was recorded or opened last, as the JSON of its file.
    pub fn file(&self) -> Option<String> {
        self.path.as_ref().map(write_keyframes)
    }

    /// Begins a recording, or ends it. Returns true if it ended with a new path.
    pub fn record(&mut self) -> bool {
        let Some(keyframes) = self.recording.take() else {
            *self = Self { recording: Some(Vec::new()), ..Self::default() };
            return false;
        };
        self.path = CameraPath::new(keyframes).ok();
        self.path.is_some()
    }

    /// Plays the path from its beginning, or stops. Ends a recording first. Returns true if that gave a new path.
    pub fn play(&mut self) -> bool {
        let is_new = self.is_recording() && self.record();
        self.is_playing = !self.is_playing && self.path.is_some();
        self.seconds = 0.0;
        is_new
    }

    /// Plays the camera path in the bytes of a file.
    ///
    /// # Errors
    ///
    /// If `bytes` are not a camera path; the recorder then stays as it is.
    pub fn open(&mut self, bytes: &[u8]) -> Result<(), KeyframesError> {
        let path = read_keyframes(bytes)?;
        *self = Self { path: Some(path), is_playing: true, ..Self::default() };
        Ok(())
    }

    /// Records the camera, or moves it along the path, `elapsed` seconds after the last call. Returns whether it has
    /// moved the camera.
    pub fn follow(&mut self, elapsed: f64, controls: &mut Controls, model_from_dataset: &Similarity) -> bool {
        self.seconds += elapsed;
        if let Some(keyframes) = &mut self.recording {
            let is_due = keyframes.last().is_none_or(|last| self.seconds - last.seconds >= RECORDED_EVERY);
            if is_due && keyframes.len() < MAX_KEYFRAMES {
                let seen = controls.camera([2, 2]).mapped(&model_from_dataset.inverse());
                keyframes.push(Keyframe { seconds: self.seconds, viewpoint: Viewpoint::from_camera(&seen) });
            }
            return false;
        }
        let Some(path) = self.path.as_ref().filter(|_| self.is_playing) else { return false };
        let at = path.at(path.start() + self.seconds);
        let camera = at.camera([2, 2]).mapped(model_from_dataset);
        let pose = Pose { position: camera.position, rotation: DQuat::from_mat3(&camera.world_from_camera) };
        controls.place_with_angle(pose, at.vertical_angle);
        self.is_playing = self.seconds <= path.end() - path.start();
        true
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use strivec_format::container::{Limits, decode_scene_file};

    #[test]
    fn recorded_paths_are_played() {
        let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/everything.strivec");
        let scene_file = decode_scene_file(&std::fs::read(fixture).unwrap(), Limits::default()).unwrap();
        let map =
            Similarity { scale: 2.5, rotation: DQuat::from_rotation_z(0.7), translation: DVec3::new(1.0, -2.0, 3.0) };
        let mut controls = Controls::new(&scene_file.scene, None, &[]);
        let mut recorder = Recorder::default();
        assert!(!recorder.play() && !recorder.is_playing(), "there is nothing to play");
        assert!(!recorder.record() && recorder.is_recording());
        let mut places = Vec::new();
        for _ in 0..5 {
            assert!(!recorder.follow(0.25, &mut controls, &map));
            assert!(!recorder.follow(0.01, &mut controls, &map), "too soon for another");
            places.push(controls.pose());
            controls.orbit(0.1, 0.02);
        }
        assert!(recorder.play() && recorder.is_playing() && !recorder.is_recording());
        let file = recorder.file().unwrap();
        assert_eq!(read_keyframes(file.as_bytes()).unwrap().keyframes().len(), 5);

        let mut again = Recorder::default();
        assert!(again.open(b"words").is_err());
        again.open(file.as_bytes()).unwrap();
        for (n, place) in places.iter().enumerate() {
            assert!(again.follow(if n == 0 { 0.0 } else { 0.26 }, &mut controls, &map));
            let pose = controls.pose();
            assert!((pose.position - place.position).length() < 1e-6, "{n}: {pose:?} and {place:?}");
            assert!(pose.rotation.angle_between(place.rotation) < 1e-6, "{n}");
        }
        assert!(again.follow(0.3, &mut controls, &map) && !again.is_playing(), "it ends");
        assert!(!again.follow(0.3, &mut controls, &map));
    }
}
