//! Points from the depth maps that a `transforms.json` names (see [`depth_maps`]).

use std::path::Path;

use crate::dataset::depth_maps;
use strivec_import::{Fault, ImportError, Point, Visitor};

/// About the most points of all maps; larger maps are read at equal steps.
const MAX_POINTS: u64 = 1 << 22;

/// The points of the depth maps of the file `json`, in the dataset's space.
pub(super) fn read(json: &Path, visitor: &mut dyn Visitor) -> Result<(), ImportError> {
    let maps = depth_maps(json).map_err(|error| error.of_geometry(json))?;
    let most = MAX_POINTS / maps.len().max(1) as u64;
    let bytes: Vec<u64> = maps.iter().map(|map| map.path.metadata().map_or(0, |metadata| metadata.len())).collect();
    let (mut done, total) = (0, bytes.iter().sum());
    for (map, bytes) in maps.iter().zip(bytes) {
        let points = map.points(most).map_err(|error| error.of_geometry(json))?;
        let received =
            points.into_iter().try_for_each(|position| visitor.point(Point::new(position, None, || "a depth".into())?));
        done += bytes;
        received.and_then(|()| visitor.progress(done, total)).map_err(|fault: Fault| fault.of(&map.path))?;
    }
    Ok(())
}
