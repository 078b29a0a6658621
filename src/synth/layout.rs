//! Layouts of synthetic datasets, and the views in them.

use super::camera_model::CameraModel;
use strivec_dataset::Layout;
use strivec_dataset::Split;
use strivec_dataset::TEST_EVERY;
use strivec_format::geometry::Camera;

/// Layouts in which synthetic datasets are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SynthLayout {
    /// [`Layout::Blender`].
    #[default]
    Blender,
    /// [`Layout::Transforms`].
    Transforms,
    /// [`Layout::Colmap`], binary files.
    Colmap,
    /// [`Layout::Colmap`], text files.
    ColmapText,
    /// [`Layout::Nsvf`].
    Nsvf,
    /// [`Layout::Llff`].
    Llff,
    /// [`Layout::ScanNet`].
    ScanNet,
    /// [`Layout::Metashape`].
    Metashape,
}

/// A picture to be made.
pub(super) struct PlannedPicture {
    /// The path of the picture in the dataset's folder.
    pub(super) file: String,
    /// The split that it is made for.
    pub(super) split: Split,
    /// The camera that takes it.
    pub(super) camera: Camera,
}

impl PlannedPicture {
    /// The path of the picture's depth map in the dataset's folder.
    pub(super) fn depth_file(&self) -> String {
        format!("depths/{}.npy", self.file.trim_end_matches(".png").replace('/', "_"))
    }

    /// The file's name without folder and ending.
    pub(super) fn stem(&self) -> &str {
        let name = self.file.rsplit('/').next().unwrap_or_default();
        name.trim_end_matches(".png")
    }
}

impl SynthLayout {
    /// All layouts.
    pub const ALL: [Self; 8] = [
        Self::Blender,
        Self::Transforms,
        Self::Colmap,
        Self::ColmapText,
        Self::Nsvf,
        Self::Llff,
        Self::ScanNet,
        Self::Metashape,
    ];

    /// The layout as which it is read.
    pub fn layout(self) -> Layout {
        match self {
            Self::Blender => Layout::Blender,
            Self::Transforms => Layout::Transforms,
            Self::Colmap | Self::ColmapText => Layout::Colmap,
            Self::Nsvf => Layout::Nsvf,
            Self::Llff => Layout::Llff,
            Self::ScanNet => Layout::ScanNet,
            Self::Metashape => Layout::Metashape,
        }
    }

    /// Name of the layout: that of [`SynthLayout::layout`], or `colmap-text`.
    pub fn name(self) -> &'static str {
        if self == Self::ColmapText { "colmap-text" } else { self.layout().name() }
    }

    /// The camera models that it can state.
    pub fn cameras(self) -> &'static [CameraModel] {
        match self {
            Self::Colmap | Self::ColmapText => &CameraModel::ALL,
            // Its keys have no thin prism coefficients.
            Self::Transforms => &[
                CameraModel::Pinhole,
                CameraModel::SimpleRadial,
                CameraModel::Radial,
                CameraModel::OpenCv,
                CameraModel::FullOpenCv,
                CameraModel::OpenCvFisheye,
                CameraModel::SimpleRadialFisheye,
                CameraModel::RadialFisheye,
                CameraModel::Equirectangular,
            ],
            // Its calibrations have neither a divisor nor a thin prism.
            Self::Metashape => &[
                CameraModel::Pinhole,
                CameraModel::SimpleRadial,
                CameraModel::Radial,
                CameraModel::OpenCv,
                CameraModel::OpenCvFisheye,
                CameraModel::SimpleRadialFisheye,
                CameraModel::RadialFisheye,
                CameraModel::Equirectangular,
            ],
            Self::Blender | Self::Nsvf | Self::Llff | Self::ScanNet => &[CameraModel::Pinhole],
        }
    }

    /// True if every eighth picture by name is a test view, so that the number of training views fixes that of test views.
    pub fn holds_out_every_eighth(self) -> bool {
        matches!(self, Self::Colmap | Self::ColmapText | Self::Llff | Self::Metashape)
    }

    /// The number of test views for `views` training views if the layout fixes it.
    pub fn test_views(self, views: u32) -> Option<u32> {
        self.holds_out_every_eighth().then(|| views.div_ceil(TEST_EVERY as u32 - 1))
    }

    /// True if `views` training and `test_views` test views fit the layout's split.
    pub(super) fn splits(self, views: u32, test_views: u32) -> bool {
        !self.holds_out_every_eighth() || (views + test_views).div_ceil(TEST_EVERY as u32) == test_views
    }

    /// The pictures of the three splits. Layouts that hold out every eighth have no validation views.
    pub(super) fn photographs(
        self,
        train: Vec<Camera>,
        validation: Vec<Camera>,
        test: Vec<Camera>,
    ) -> Vec<PlannedPicture> {
        if self.holds_out_every_eighth() {
            let (mut train, mut test) = (train.into_iter(), test.into_iter());
            let next = |n: usize| {
                let is_test = n.is_multiple_of(TEST_EVERY);
                let (split, camera) = if is_test { (Split::Test, test.next()) } else { (Split::Train, train.next()) };
                Some(PlannedPicture { file: format!("images/{n:05}.png"), split, camera: camera? })
            };
            return (0..).map_while(next).collect();
        }
        let splits = [(Split::Train, train), (Split::Validation, validation), (Split::Test, test)];
        let of_split = |(split, cameras): (Split, Vec<Camera>)| {
            cameras.into_iter().enumerate().map(move |(n, camera)| {
                let file = match self {
                    Self::Nsvf => format!("rgb/{}_{n:05}.png", split as u8),
                    _ => format!("{}/r_{n}.png", split.name()),
                };
                PlannedPicture { file, split, camera }
            })
        };
        splits.into_iter().flat_map(of_split).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_eighth_is_a_test_view_for_the_fixed_numbers() {
        for views in 1..100 {
            let test = SynthLayout::Colmap.test_views(views).unwrap();
            assert!(SynthLayout::Colmap.splits(views, test), "{views} {test}");
            assert!(!SynthLayout::Llff.splits(views, test + 2) && SynthLayout::Nsvf.splits(views, test + 2));
            let cameras = |count| super::super::pictures::orbit(count, [8, 8], 1);
            let made = SynthLayout::Colmap.photographs(cameras(views), Vec::new(), cameras(test));
            assert_eq!(made.len() as u32, views + test);
        }
    }
}
