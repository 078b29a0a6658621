//! The codec *adaptive* (spec 2.5): bits with probabilities that adapt to those before. It has integers alone, so that every
//! machine decodes the same bits.

mod coder;
mod integers;
mod occupancy;

pub(in crate::container) use integers::{
    ArrayShape, Groups, compress as compress_integers, decompress as decompress_integers,
};
pub(in crate::container) use occupancy::{
    compress as compress_occupancy, decompress as decompress_occupancy, memory as memory_of_occupancy,
};
