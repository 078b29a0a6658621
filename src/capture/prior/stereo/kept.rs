//! The planes that were found so far, as bytes: a matching goes on from them, and a whole one is not done again.
//!
//! `strivec planes 4`, the stage, then two lists of the photographs' planes: those that the stage begins with and those
//! that it has found. Of a photograph: the number of its planes, or all bits set if it is not searched yet, and for each
//! its patch, whose highest bit is set if the plane may be anywhere, 1/depth and slopes, 4 bytes each. Last the CRC-32 of all bytes before it.

use glam::DVec2;
use twox_hash::XxHash3_128;

use super::plane::Plane;
use super::shot::{PlaneMap, StereoShot};

const MAGIC: &[u8] = b"strivec planes 4\n";
/// The number of planes of a photograph that is not searched yet.
const UNSEARCHED: u32 = u32::MAX;
/// The bit of a plane's patch that says that it may be anywhere.
const ANYWHERE: u32 = 1 << 31;
/// Bytes of a plane.
const PLANE: usize = 16;

/// The stages of a matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    Sweep,
    Grow,
    Done,
}

/// The state of a matching of photographs.
#[derive(Debug, PartialEq)]
pub(super) struct Kept {
    pub(super) stage: Stage,
    /// \[view\] the planes with which the stage begins; empty in a sweep.
    pub(super) before: Vec<Option<PlaneMap>>,
    /// \[view\] the planes that the stage has found; empty if it is done.
    pub(super) found: Vec<Option<PlaneMap>>,
}

impl Kept {
    /// Nothing is searched of `views` photographs.
    pub(super) fn new(views: usize) -> Self {
        Self { stage: Stage::Sweep, before: vec![None; views], found: vec![None; views] }
    }

    /// The name of the matching of `shots`: what it depends on is in it.
    pub(super) fn name<'a>(shots: impl Iterator<Item = &'a StereoShot>) -> String {
        let mut hash = XxHash3_128::with_seed(0);
        hash.write(MAGIC);
        for shot in shots {
            let camera = &shot.camera;
            hash.write(&[camera.width, camera.height].map(u32::to_le_bytes).concat());
            let numbers = camera.focal.iter().chain(&camera.principal).copied().chain(camera.pose());
            numbers.for_each(|number| hash.write(&number.to_le_bytes()));
            hash.write(bytemuck::cast_slice(shot.luminance()));
        }
        format!("{:032x}.planes", hash.finish_128())
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.push(self.stage as u8);
        for map in self.before.iter().chain(&self.found) {
            let Some(map) = map else {
                bytes.extend(UNSEARCHED.to_le_bytes());
                continue;
            };
            let planes = map.iter().enumerate().filter_map(|(n, plane)| Some((n, (*plane)?)));
            bytes.extend((planes.clone().count() as u32).to_le_bytes());
            for (n, plane) in planes {
                bytes.extend((n as u32 | if plane.may_be_anywhere { ANYWHERE } else { 0 }).to_le_bytes());
                let numbers = [plane.inverse, plane.slope.x, plane.slope.y];
                numbers.iter().for_each(|&number| bytes.extend((number as f32).to_le_bytes()));
            }
        }
        let checksum = crc32fast::hash(&bytes);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }

    /// The state in `bytes` of a matching of photographs with \[view\] so many `patches`; `None` if they are not that.
    pub(super) fn from_bytes(bytes: &[u8], patches: &[usize]) -> Option<Self> {
        let (bytes, checksum) = bytes.split_last_chunk::<4>()?;
        if crc32fast::hash(bytes) != u32::from_le_bytes(*checksum) {
            return None;
        }
        let (&stage, mut rest) = bytes.strip_prefix(MAGIC)?.split_first()?;
        let stage = [Stage::Sweep, Stage::Grow, Stage::Done].into_iter().find(|known| *known as u8 == stage)?;
        let mut list = || -> Option<Vec<Option<PlaneMap>>> {
            patches.iter().map(|&patches| map_from(&mut rest, patches)).collect()
        };
        let kept = Self { stage, before: list()?, found: list()? };
        rest.is_empty().then_some(kept)
    }
}

/// The planes of one photograph of so many `patches` at the start of `rest`, which is moved behind them.
fn map_from(rest: &mut &[u8], patches: usize) -> Option<Option<PlaneMap>> {
    let (count, planes) = rest.split_first_chunk::<4>()?;
    let count = u32::from_le_bytes(*count);
    if count == UNSEARCHED {
        *rest = planes;
        return Some(None);
    }
    let (planes, behind) = planes.split_at_checked((count as usize).checked_mul(PLANE)?)?;
    *rest = behind;
    let mut map = vec![None; patches];
    for plane in planes.as_chunks::<PLANE>().0 {
        let words = plane.as_chunks::<4>().0;
        let [inverse, x, y] = [1, 2, 3].map(|n| f64::from(f32::from_le_bytes(words[n])));
        let patch = u32::from_le_bytes(words[0]);
        let place = map.get_mut((patch & !ANYWHERE) as usize)?;
        *place = (inverse > 0.0 && inverse.is_finite() && (x + y).is_finite()).then_some(Plane {
            inverse,
            slope: DVec2::new(x, y),
            may_be_anywhere: patch & ANYWHERE != 0,
        });
    }
    Some(Some(map))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_hold_a_state_and_others_are_refused() {
        let plane =
            |inverse: f64| Some(Plane { inverse, slope: DVec2::new(0.5, -0.25), may_be_anywhere: inverse > 3.0 });
        let patches = [3, 2];
        let kept = Kept {
            stage: Stage::Grow,
            before: vec![Some(vec![None, plane(2.0), None]), Some(vec![plane(0.125), plane(4.0)])],
            found: vec![None, Some(vec![None, plane(1.0)])],
        };
        let bytes = kept.to_bytes();
        assert_eq!(Kept::from_bytes(&bytes, &patches), Some(kept));
        for damaged in [&bytes[1..], &bytes[..bytes.len() - 1], b"", MAGIC] {
            assert_eq!(Kept::from_bytes(damaged, &patches), None);
        }
        assert_eq!(Kept::from_bytes(&bytes, &[3, 1]), None, "a patch that is not there");
        assert_eq!(Kept::from_bytes(&bytes, &[3]), None, "one photograph less");
        assert_eq!(Kept::from_bytes(&bytes, &[3, 2, 2]), None, "one photograph more");
    }
}
