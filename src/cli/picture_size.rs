//! Picture sizes on the command line.

/// The longest edge of a picture.
const MAX_EDGE: u32 = 16_384;

/// Columns and rows written as `WxH`.
pub(super) fn parse(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or("expected WIDTHxHEIGHT, as in 800x600")?;
    let edge = |text: &str| match text.parse() {
        Ok(value @ 1..=MAX_EDGE) => Ok(value),
        _ => Err(format!("{text:?} is not WxH with edges from 1 to {MAX_EDGE} pixels")),
    };
    Ok([edge(width)?, edge(height)?])
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn sizes_are_two_edges_within_the_limit() {
        assert_eq!(parse("800x600"), Ok([800, 600]));
        for wrong in ["800", "0x10", "10x16385", "x", "-1x5", "5x5x5", "5 x 5"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
