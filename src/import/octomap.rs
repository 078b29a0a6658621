//! OctoMap's octrees: `.bt` with two bits per node, and `.ot` with a probability per node.
//!
//! The tree has 16 levels below the root, which spans 2^16 smallest cells along each axis and is centered at the
//! origin. Nodes are stored depth first. Child n of a node lies on the larger side of x, y and z if bits 0, 1 and 2 of
//! n are set. Leaves of any level are cells.

use glam::DVec3;

use super::{Fault, Input, ReadOptions, Visitor};
use strivec_format::geometry::Aabb;

/// Levels below the root.
const DEPTH: u32 = 16;
/// Bytes of a header's line, and number of lines.
const MAX_LINE: usize = 1 << 12;
const MAX_LINES: usize = 1 << 12;

const BINARY: &[u8] = b"# Octomap OcTree binary file";
const FULL: &[u8] = b"# Octomap OcTree file";

/// The header before the nodes.
struct TreeHeader {
    binary: bool,
    /// True if the nodes of a file that is not binary have colors.
    colors: bool,
    /// Declared number of nodes.
    nodes: u64,
    /// Edge length of a smallest cell.
    resolution: f64,
}

/// A node whose children are being read.
#[derive(Clone, Copy)]
struct OpenNode {
    /// Smallest corner, in smallest cells from the root's.
    corner: [u32; 3],
    /// Levels below the root.
    depth: u32,
    /// Children that have not been read, one bit each.
    to_come: u8,
}

/// Reads `input`. Cells are the occupied leaves of a binary tree, or the leaves whose probability exceeds
/// [`ReadOptions::threshold`].
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let header = TreeHeader::read(input)?;
    let mut found = 0;
    if header.nodes > 0 {
        let threshold = log_odds(options.threshold);
        let mut path = Vec::with_capacity(DEPTH as usize + 1);
        found = 1;
        let root = OpenNode { corner: [0; 3], depth: 0, to_come: 0 };
        found += header.node(root, threshold, input, &mut path, visitor)?;
        while let Some(parent) = path.last_mut() {
            input.report(visitor)?;
            if parent.to_come == 0 {
                path.pop();
                continue;
            }
            let child = parent.to_come.trailing_zeros();
            parent.to_come &= parent.to_come - 1;
            let node = parent.child(child);
            found += header.node(node, threshold, input, &mut path, visitor)?;
        }
    }
    if found != header.nodes {
        return Err(Fault::malformed(input.place(), format!("{} nodes, as the header says", header.nodes), found));
    }
    // As OctoMap's own reader, ignore what follows: pyoctomap stores colors there.
    Ok(())
}

impl TreeHeader {
    fn read(input: &mut Input<'_>) -> Result<Self, Fault> {
        let mut line = Vec::new();
        input.line(&mut line, MAX_LINE)?;
        let binary = line.starts_with(BINARY);
        if !binary && !line.starts_with(FULL) {
            let found = String::from_utf8_lossy(&line[..line.len().min(40)]).into_owned();
            return Err(Fault::malformed(
                "line 1",
                "\"# Octomap OcTree file\" or \"# Octomap OcTree binary file\" (OctoMap's convert_octree converts older trees)",
                format!("{found:?}"),
            ));
        }
        let (mut id, mut nodes, mut resolution) = (None, None, None);
        for number in 2..MAX_LINES {
            let place = || format!("line {number}");
            if !input.line(&mut line, MAX_LINE)? {
                return Err(Fault::malformed(place(), "a line \"data\"", "the end of the file"));
            }
            let text =
                std::str::from_utf8(&line).map_err(|_| Fault::malformed(place(), "UTF-8 text", "other bytes"))?;
            let (key, value) = text.trim().split_once(char::is_whitespace).unwrap_or((text.trim(), ""));
            let value = value.trim();
            match key {
                "id" => id = Some(value.to_owned()),
                "size" => {
                    let size =
                        value.parse::<u32>().map_err(|_| Fault::malformed(place(), "a number of nodes", value))?;
                    nodes = Some(u64::from(size));
                }
                "res" => {
                    let res = value.parse().ok().filter(|&r: &f64| r > 0.0 && (r * f64::from(1 << DEPTH)).is_finite());
                    resolution =
                        Some(res.ok_or_else(|| Fault::malformed(place(), "a finite edge length above 0", value))?);
                }
                "data" => {
                    let missing = |what: &str| Fault::broken(place(), format!("the header has no line \"{what}\""));
                    let id = id.ok_or_else(|| missing("id"))?;
                    let colors = match (id.as_str(), binary) {
                        ("OcTree", _) => false,
                        ("ColorOcTree", _) => true,
                        _ => {
                            let what = format!("OctoMap's {:?}", id.chars().take(40).collect::<String>());
                            return Err(Fault::unsupported(what, "convert it to an OcTree or a ColorOcTree"));
                        }
                    };
                    let nodes = nodes.ok_or_else(|| missing("size"))?;
                    let resolution = resolution.ok_or_else(|| missing("res"))?;
                    return Ok(Self { binary, colors, nodes, resolution });
                }
                // As OctoMap's own reader, ignore comments and unknown lines.
                _ => {}
            }
        }
        Err(Fault::broken(format!("line {MAX_LINES}"), "the header has no line \"data\""))
    }

    /// Reads `node`, passes its occupied leaves to `visitor`, and pushes it to `path` for its children. Returns the
    /// number of children.
    fn node(
        &self,
        node: OpenNode,
        threshold: f64,
        input: &mut Input<'_>,
        path: &mut Vec<OpenNode>,
        visitor: &mut dyn Visitor,
    ) -> Result<u64, Fault> {
        let place = input.place();
        let (to_come, children) = if self.binary {
            let pairs = u16::from_le_bytes(input.array("a node")?);
            let (mut inner, mut occupied, mut children) = (0, 0_u8, 0);
            for child in 0..8 {
                match pairs >> (2 * child) & 3 {
                    0 => continue,
                    2 => occupied |= 1 << child,
                    3 => inner |= 1 << child,
                    _ => {}
                }
                children += 1;
            }
            self.check_depth(node.depth, children > 0, &place)?;
            for child in (0..8).filter(|child| occupied >> child & 1 == 1) {
                visitor.cell(&self.cell(node.child(child)), None)?;
            }
            (inner, children)
        } else {
            let value = f32::from_le_bytes(input.array("a node")?);
            if value.is_nan() {
                return Err(Fault::malformed(place, "log odds that are a number", value));
            }
            let color = if self.colors { Some(input.array("a node's color")?) } else { None };
            let [children] = input.array("a node's children")?;
            self.check_depth(node.depth, children != 0, &place)?;
            if children == 0 && f64::from(value) > threshold {
                visitor.cell(&self.cell(node), color)?;
            }
            (children, children.count_ones())
        };
        path.push(OpenNode { to_come, ..node });
        Ok(children.into())
    }

    fn check_depth(&self, depth: u32, has_children: bool, place: &str) -> Result<(), Fault> {
        if depth == DEPTH && has_children {
            return Err(Fault::malformed(place, format!("a leaf at level {DEPTH}"), "a node with children"));
        }
        Ok(())
    }

    fn cell(&self, node: OpenNode) -> Aabb {
        let middle = f64::from(1 << (DEPTH - 1));
        let min = DVec3::from_array(node.corner.map(f64::from)) - middle;
        let max = min + f64::from(1 << (DEPTH - node.depth));
        Aabb { min: min * self.resolution, max: max * self.resolution }
    }
}

impl OpenNode {
    fn child(&self, number: u32) -> Self {
        let edge = 1 << (DEPTH - self.depth - 1);
        let corner = std::array::from_fn(|axis| self.corner[axis] + edge * (number >> axis & 1));
        Self { corner, depth: self.depth + 1, to_come: 0 }
    }
}

/// ln(p / (1 − p)); −∞ for p ≤ 0 and ∞ for p ≥ 1.
fn log_odds(probability: f64) -> f64 {
    let p = probability.clamp(0.0, 1.0);
    (p / (1.0 - p)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Seen, seen_with};

    fn tree(binary: bool, header: &str, nodes: &[u8]) -> Vec<u8> {
        let first = if binary { BINARY } else { FULL };
        [first, b"\n# (a comment)\n#\n", header.as_bytes(), b"\ndata\n", nodes].concat()
    }

    fn seen(bytes: &[u8]) -> Result<Seen, Fault> {
        seen_with(bytes, &ReadOptions::default(), read)
    }

    fn message(bytes: &[u8]) -> String {
        seen(bytes).err().map_or_else(String::new, |error| error.to_string())
    }

    fn cube(min: [f64; 3], edge: f64) -> Aabb {
        Aabb { min: DVec3::from_array(min), max: DVec3::from_array(min) + edge }
    }

    /// Log odds, and which children there are.
    fn node(value: f32, children: u8) -> Vec<u8> {
        [value.to_le_bytes().as_slice(), &[children]].concat()
    }

    #[test]
    fn two_bits_a_child() {
        // Child 0 is free (01), 1 occupied (10), 3 has children (11): its child 7 is occupied. The root is 65536 · 0.5
        // wide.
        let nodes = [0b1100_1001, 0b0000_0000, 0b0000_0000, 0b1000_0000];
        let bytes = tree(true, "id OcTree\nsize 5\nres 0.5", &nodes);
        let expected = [cube([0.0, -16384.0, -16384.0], 16384.0), cube([8192.0, 8192.0, -8192.0], 8192.0)];
        assert_eq!(seen(&bytes).unwrap().cells, expected);
    }

    #[test]
    fn a_probability_a_node() {
        // The root has children 0 and 6; the latter, children 0 (free) and 1 (occupied).
        let nodes = [node(0.0, 0b0100_0001), node(1.5, 0), node(9.0, 0b11), node(-0.1, 0), node(0.1, 0)].concat();
        let bytes = tree(false, "id OcTree\nsize 5\nres 1", &nodes);
        let expected = [cube([-32768.0; 3], 32768.0), cube([-16384.0, 0.0, 0.0], 16384.0)];
        assert_eq!(seen(&bytes).unwrap().cells, expected);
        // e^1.5 / (1 + e^1.5) = 0.818
        for (threshold, count) in [(0.0, 3), (0.81, 1), (0.82, 0), (1.0, 0)] {
            let options = ReadOptions { threshold, ..ReadOptions::default() };
            assert_eq!(seen_with(&bytes, &options, read).unwrap().cells.len(), count, "{threshold}");
        }
        let colored = [0.0_f32.to_le_bytes().as_slice(), &[1, 2, 3, 1], &1.0_f32.to_le_bytes(), &[4, 5, 6, 0]].concat();
        let bytes = tree(false, "id ColorOcTree\nsize 2\nres 1", &colored);
        assert_eq!(seen(&bytes).unwrap().cells, [cube([-32768.0; 3], 32768.0)]);
    }

    #[test]
    fn the_deepest_leaf_is_one_cell() {
        // Child 7 sixteen times: the smallest cell at the largest corner.
        let mut nodes = node(0.0, 0x80).repeat(16);
        nodes.extend(node(1.0, 0));
        let good = tree(false, "id OcTree\nsize 17\nres 0.25", &nodes);
        assert_eq!(seen(&good).unwrap().cells, [cube([8191.75; 3], 0.25)]);
        let mut nodes = node(0.0, 0x80).repeat(17);
        nodes.extend(node(1.0, 0));
        let bad = message(&tree(false, "id OcTree\nsize 18\nres 0.25", &nodes));
        assert!(bad.ends_with("expected a leaf at level 16, found a node with children"), "{bad}");
        let mut nodes = [0, 0b1100_0000].repeat(16);
        nodes.extend([0, 0b1000_0000]);
        let bad = message(&tree(true, "id OcTree\nsize 18\nres 0.25", &nodes));
        assert!(bad.ends_with("expected a leaf at level 16, found a node with children"), "{bad}");
    }

    #[test]
    fn headers_that_are_none_are_refused() {
        assert!(message(b"").starts_with("line 1: expected \"# Octomap OcTree file\""));
        assert!(message(&tree(true, "id OcTree\nsize 1", &[])).ends_with("line 6: the header has no line \"res\""));
        for res in ["0", "-1", "NaN", "inf", "1e308", "x"] {
            let error = message(&tree(true, &format!("id OcTree\nres {res}"), &[]));
            assert_eq!(error, format!("line 5: expected a finite edge length above 0, found {res}"));
        }
        assert_eq!(
            message(&tree(false, "id CountingOcTree\nsize 1\nres 1", &[])),
            "OctoMap's \"CountingOcTree\" is not supported: convert it to an OcTree or a ColorOcTree"
        );
        assert_eq!(message(&tree(true, "size -4", &[])), "line 4: expected a number of nodes, found -4");
        assert!(
            message(&[FULL, b"\n#\n"].concat())
                .ends_with("line 3: expected a line \"data\", found the end of the file")
        );
        assert!(message(&[FULL, b"\n", &[b'#'; 5000]].concat()).contains("longer than 4096 bytes"));
        assert!(message(&[FULL, b"\n", "#\n".repeat(5000).as_bytes()].concat()).starts_with("line 4096"));
    }

    #[test]
    fn trees_that_end_elsewhere_are_refused() {
        assert_eq!(
            message(&tree(true, "id OcTree\nsize 4000000000\nres 1", &[3, 0])),
            "byte 84: expected 2 bytes of a node, found 0 bytes"
        );
        let bad = message(&tree(true, "id OcTree\nsize 3\nres 1", &[2, 0]));
        assert!(bad.ends_with("expected 3 nodes, as the header says, found 2"), "{bad}");
        let followed = tree(true, "id OcTree\nsize 2\nres 1", &[2, 0, 9]);
        assert_eq!(seen(&followed).unwrap().cells.len(), 1, "what follows is not the tree's");
        let bad = message(&tree(false, "id OcTree\nsize 1\nres 1", &node(f32::NAN, 0)));
        assert!(bad.ends_with("expected log odds that are a number, found NaN"), "{bad}");
        assert_eq!(seen(&tree(true, "id OcTree\nsize 0\nres 1", &[])).unwrap().cells, []);
    }
}
