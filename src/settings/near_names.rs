//! Names that are similar to one that does not exist.

/// The most edits between similar names.
const MAX_EDITS: usize = 2;

/// The names that are a few edits from `name`, the nearest first.
pub(super) fn near_names<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let allowed = MAX_EDITS.min(name.chars().count() / 2);
    let mut near: Vec<_> = names.into_iter().map(|other| (edits(name, other), other)).collect();
    near.retain(|(edits, _)| *edits <= allowed);
    near.sort_by_key(|(edits, _)| *edits);
    near.into_iter().map(|(_, name)| name).collect()
}

/// The edit distance: the fewest characters to insert, delete or replace (Levenshtein).
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, of_a) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, of_b) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(of_a != *of_b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_few_edits_are_near() {
        let names = ["steps", "scales", "seed"];
        assert_eq!(near_names("stepz", names), ["steps"]);
        assert_eq!(near_names("sed", names), ["seed"]);
        assert_eq!(near_names("colors", names), [""; 0]);
        assert_eq!(edits("kitten", "sitting"), 3);
    }
}
