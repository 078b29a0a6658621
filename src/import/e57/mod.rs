//! E57: all scans of a file, each in its pose. Points whose state marks them as a direction or as invalid are left out.
//!
//! The crate `e57` reads the header and the XML section. The points are read here, because `e57` buffers without a
//! limit if the streams of a scan advance at different rates, and allocates without end for a scan whose fields need no
//! bits.

mod packets;
mod pages;
mod scan;
#[cfg(test)]
mod tests;

use ::e57::E57Reader;
use strivec_format::Place;

use self::pages::Pages;
use self::scan::ScanParts;
use super::error::excerpt;
use super::input::bytes_at;
use super::{Fault, Input, ReadOptions, Visitor};

/// Bytes of the XML section. A scan takes some thousand of them.
const MAX_XML: u64 = 1 << 24;

/// Attributes of an XML element: the time of the XML parser grows with their square.
const MAX_ATTRIBUTES: usize = 1000;

/// Namespaces of the XML section: each nested element copies those of the elements around it.
const MAX_NAMESPACES: usize = 100;

/// Reads `input`.
///
/// # Errors
///
/// If a page's checksum is wrong, the XML section is invalid or declares more than the file holds, a coordinate is not
/// finite, and those of `visitor`.
pub fn read(input: &mut Input<'_>, _options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let mut pages = Pages::of(input)?;
    check_xml(&mut pages)?;
    let input = pages.input();
    input.go_to(0)?;
    let described =
        E57Reader::new(input).map_err(|error| Fault::broken("the XML section", format!("not valid E57: {error}")))?;
    let mut scans = Vec::new();
    for (at, described) in described.pointclouds().iter().enumerate() {
        scans.push(ScanParts::new(described, format!("scan {at}"))?);
    }
    let total = scans.iter().map(|scan| scan.records).fold(0, u64::saturating_add);
    let mut done = 0;
    for scan in &scans {
        scan.read(&mut pages, &mut |points, visitor| visitor.progress(done + points, total), visitor)?;
        done += scan.records;
    }
    Ok(())
}

/// Checks the header of the file, and limits what makes the XML parser slow.
fn check_xml(pages: &mut Pages<'_, '_>) -> Result<(), Fault> {
    let mut header = [0; 48];
    pages.fill(&mut header, "a header")?;
    if &header[..8] != b"ASTM-E57" {
        return Err(Fault::malformed(Place::Offset(0), "ASTM-E57", excerpt(&header[..8])));
    }
    let number = |at: usize| u64::from_le_bytes(bytes_at(&header, at));
    if number(40) != pages::PAGE {
        return Err(Fault::malformed(Place::Offset(40), format!("pages of {} bytes", pages::PAGE), number(40)));
    }
    let (offset, length) = (number(24), number(32));
    Fault::unless_within("bytes of the XML section", MAX_XML, length)?;
    pages.go_to(offset, "the XML section")?;
    pages.expect_left(length, "the XML section")?;
    let mut xml = vec![0; length as usize];
    pages.fill(&mut xml, "the XML section")?;
    let namespaces = xml.windows(5).filter(|word| word == b"xmlns").count();
    Fault::unless_within("namespaces in the XML section", MAX_NAMESPACES as u64, namespaces as u64)?;
    let element = xml.split(|byte| *byte == b'<');
    let attributes = element.map(|element| element.iter().filter(|byte| **byte == b'=').count()).max().unwrap_or(0);
    Fault::unless_within("attributes of an element in the XML section", MAX_ATTRIBUTES as u64, attributes as u64)
}
