//! COLMAP's database (SQLite 3): features of each picture and matches of each pair.
//!
//! Reads the rows of a table in order of their key, without indices, views or values beyond a page, which these three
//! tables do not need: `images` (key, name), `keypoints` (key of the image, count) and `two_view_geometries` (key of the
//! pair, count of verified matches). Format: <https://www.sqlite.org/fileformat2.html>.

use std::collections::BTreeMap;
use std::path::Path;

use super::super::Error;

/// COLMAP's factor between the pictures' numbers in the key of a pair.
const PAIR: i64 = 2_147_483_647;
/// The first bytes of the file.
const MAGIC: &[u8] = b"SQLite format 3\0";
/// Levels of a tree, at most.
const MAX_DEPTH: u32 = 20;

/// A picture in the database.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Features {
    pub(super) count: u64,
    /// Verified matches with each other picture that has any, by name.
    pub(super) matches: BTreeMap<String, u64>,
}

/// The pictures in the database at `path`, by name.
///
/// # Errors
///
/// If the file cannot be read or is not such a database.
pub(super) fn read(path: &Path) -> Result<BTreeMap<String, Features>, Error> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    pictures(&bytes).ok_or_else(|| Error::Malformed(format!("{}: not a database of COLMAP", path.display())))
}

fn pictures(bytes: &[u8]) -> Option<BTreeMap<String, Features>> {
    let tables = Tables::open(bytes)?;
    let mut names = BTreeMap::new();
    for (key, name) in tables.rows("images")? {
        names.insert(key, name.text()?);
    }
    let mut pictures: BTreeMap<String, Features> =
        names.values().map(|name| (name.clone(), Features::default())).collect();
    for (key, count) in tables.rows("keypoints")? {
        pictures.get_mut(names.get(&key)?)?.count = count.count()?;
    }
    for (key, count) in tables.rows("two_view_geometries")? {
        let (a, b) = (names.get(&(key / PAIR))?, names.get(&(key % PAIR))?);
        let count = count.count()?;
        if count > 0 {
            pictures.get_mut(a)?.matches.insert(b.clone(), count);
            pictures.get_mut(b)?.matches.insert(a.clone(), count);
        }
    }
    Some(pictures)
}

/// A value in a row.
#[derive(Debug)]
enum Value<'a> {
    Integer(i64),
    Text(&'a [u8]),
    Other,
}

impl Value<'_> {
    fn count(&self) -> Option<u64> {
        if let Self::Integer(value) = self { u64::try_from(*value).ok() } else { None }
    }

    fn text(&self) -> Option<String> {
        if let Self::Text(bytes) = self { Some(String::from_utf8_lossy(bytes).into_owned()) } else { None }
    }
}

/// Pages and levels that a walk may still enter, so that a damaged tree with a cycle ends.
struct Budget {
    pages: usize,
    levels: u32,
}

/// The pages of a database and the root page of each table.
struct Tables<'a> {
    bytes: &'a [u8],
    page_bytes: usize,
    roots: BTreeMap<String, usize>,
}

impl<'a> Tables<'a> {
    fn open(bytes: &'a [u8]) -> Option<Self> {
        let page_bytes = match u16::from_be_bytes(bytes.get(16..18)?.try_into().ok()?) {
            1 => 65_536,
            size if size >= 512 => usize::from(size),
            _ => return None,
        };
        if !bytes.starts_with(MAGIC) {
            return None;
        }
        let mut tables = Self { bytes, page_bytes, roots: BTreeMap::new() };
        let mut records = Vec::new();
        tables.collect(1, &mut tables.budget(), &mut records)?;
        for (_, record) in records {
            // Columns: type, name, table, root page, SQL.
            let [kind, name, _, root] = columns::<4>(record)?;
            if kind.text()? == "table" {
                tables.roots.insert(name.text()?, root.count()?.try_into().ok()?);
            }
        }
        Some(tables)
    }

    /// The key and the second column of each row of `table`. The first column of these tables is the key.
    fn rows(&self, table: &str) -> Option<Vec<(i64, Value<'a>)>> {
        let mut records = Vec::new();
        self.collect(*self.roots.get(table)?, &mut self.budget(), &mut records)?;
        let row = |(key, record)| columns::<2>(record).map(|[_, second]| (key, second));
        records.into_iter().map(row).collect()
    }

    fn budget(&self) -> Budget {
        Budget { pages: self.bytes.len() / self.page_bytes, levels: MAX_DEPTH }
    }

    /// Appends the key and the record, as far as it is on the page, of each row in the tree of `page`.
    fn collect(&self, page: usize, budget: &mut Budget, rows: &mut Vec<(i64, &'a [u8])>) -> Option<()> {
        budget.pages = budget.pages.checked_sub(1)?;
        budget.levels = budget.levels.checked_sub(1)?;
        let start = page.checked_sub(1)?.checked_mul(self.page_bytes)?;
        let bytes = self.bytes.get(start..start.checked_add(self.page_bytes)?)?;
        // The first page begins with the file's header.
        let header = bytes.get(if page == 1 { 100 } else { 0 }..)?;
        let is_leaf = match header.first()? {
            0x0d => true,
            0x05 => false,
            _ => return None,
        };
        let cells = header.get(if is_leaf { 8 } else { 12 }..)?;
        let u16_at = |bytes: &[u8], at: usize| Some(u16::from_be_bytes(bytes.get(at..at + 2)?.try_into().ok()?));
        let child = |bytes: &[u8]| Some(u32::from_be_bytes(bytes.get(..4)?.try_into().ok()?) as usize);
        for cell in 0..usize::from(u16_at(header, 3)?) {
            let cell = bytes.get(usize::from(u16_at(cells, 2 * cell)?)..)?;
            if is_leaf {
                let (_, rest) = varint(cell)?;
                rows.push(varint(rest)?);
            } else {
                self.collect(child(cell)?, budget, rows)?;
            }
        }
        if !is_leaf {
            self.collect(child(header.get(8..)?)?, budget, rows)?;
        }
        budget.levels += 1;
        Some(())
    }
}

/// The first `N` values of `record`.
fn columns<const N: usize>(record: &[u8]) -> Option<[Value<'_>; N]> {
    let (header_bytes, _) = varint(record)?;
    let (header, mut body) = record.split_at_checked(usize::try_from(header_bytes).ok()?)?;
    let (_, mut header) = varint(header)?;
    let mut values = Vec::with_capacity(N);
    for _ in 0..N {
        let (kind, rest) = varint(header)?;
        header = rest;
        let length = match kind {
            0 | 8 | 9 => 0,
            1..=4 => usize::try_from(kind).ok()?,
            5 => 6,
            6 | 7 => 8,
            12.. => usize::try_from((kind - 12) / 2).ok()?,
            _ => return None,
        };
        let (value, rest) = body.split_at_checked(length)?;
        body = rest;
        values.push(match kind {
            8 | 9 => Value::Integer(kind - 8),
            // Big-endian two's complement.
            1..=6 => {
                let first = i64::from(i8::from_ne_bytes([*value.first()?]));
                Value::Integer(value[1..].iter().fold(first, |all, byte| (all << 8) | i64::from(*byte)))
            }
            13.. if kind % 2 == 1 => Value::Text(value),
            _ => Value::Other,
        });
    }
    values.try_into().ok()
}

/// A big-endian integer of seven bits per byte, and the bytes after it.
fn varint(bytes: &[u8]) -> Option<(i64, &[u8])> {
    let mut value = 0_i64;
    for (at, byte) in bytes.iter().take(9).enumerate() {
        if at == 8 {
            return Some(((value << 8) | i64::from(*byte), &bytes[9..]));
        }
        value = (value << 7) | i64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some((value, &bytes[at + 1..]));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Made by `fixtures/pose/make.py`.
    const DATABASE: &[u8] = include_bytes!("../../../fixtures/pose/database.db");

    #[test]
    fn features_and_matches_of_each_picture_are_read() {
        let pictures = pictures(DATABASE).unwrap();
        let counts: Vec<(&str, u64)> = pictures.iter().map(|(name, found)| (name.as_str(), found.count)).collect();
        let expected = [
            ("a.png", 4000),
            ("b b.png", 4100),
            ("c.png", 3900),
            ("dark.png", 12),
            ("far.png", 3800),
            ("twice.png", 4200),
        ];
        assert_eq!(counts, expected);
        let matches = |name: &str| pictures[name].matches.clone().into_iter().collect::<Vec<_>>();
        assert_eq!(matches("far.png"), [("b b.png".to_owned(), 14), ("c.png".to_owned(), 16)]);
        assert_eq!(matches("a.png").len(), 3, "no entry for the pair without matches");
        assert_eq!(matches("dark.png"), []);
    }

    #[test]
    fn a_damaged_database_is_refused_or_read_but_never_a_panic() {
        for length in 0..DATABASE.len().min(3000) {
            let _ = pictures(&DATABASE[..length]);
        }
        assert!(pictures(&DATABASE[..DATABASE.len() / 2]).is_none());
        for at in 0..DATABASE.len() {
            let mut bytes = DATABASE.to_vec();
            bytes[at] ^= 0xff;
            let _ = pictures(&bytes);
        }
    }

    #[test]
    fn integers_of_seven_bits_per_byte() {
        assert_eq!(varint(&[0x05, 9]), Some((5, &[9][..])));
        assert_eq!(varint(&[0x81, 0x00]), Some((128, &[][..])));
        assert_eq!(varint(&[0xff; 9]), Some((-1, &[][..])));
        assert_eq!(varint(&[0x80]), None);
    }
}
