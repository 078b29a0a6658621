//! Options whose value is one of a type's names.

use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Reads the one of `all` that has the given `name`; help and errors list all names.
pub(super) fn one_of<T, const N: usize>(all: [T; N], name: fn(T) -> &'static str) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    PossibleValuesParser::new(all.map(name))
        .map(move |given| all.into_iter().find(|&value| name(value) == given).expect("a possible value"))
}
