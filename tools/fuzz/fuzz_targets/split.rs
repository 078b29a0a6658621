//! Changed files must give the same scene or error whether the bytes are read at once, by seeking, or in ranges with an
//! allocation each. A part of the file must give the same or an error.
#![no_main]

mod mutation;

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use mutation::Input;
use strivec::container::{Error, Fetch, Limits, Part, Reader, Seekable, Source};
use strivec::model::Scene;

const LIMITS: Limits = Limits { memory: 1 << 26 };

fn read(source: impl Source, part: &Part) -> Result<Scene, Error> {
    Ok(Reader::open(source, LIMITS)?.read(part)?.scene)
}

fuzz_target!(|input: (u8, Input)| {
    let (scales, input) = input;
    let bytes = input.bytes();
    let fetch = |range: std::ops::Range<u64>| {
        let [start, end] = [range.start, range.end].map(|at| at.min(bytes.len() as u64) as usize);
        Ok::<_, String>(bytes[start..end].to_vec())
    };
    let some = Part { scales: Some(scales as usize % 4), ..Part::default() };
    for part in [Part::WHOLE, some] {
        let text = |result: Result<Scene, Error>| result.map_err(|e| e.to_string());
        let whole = text(read(bytes.as_slice(), &part));
        assert_eq!(whole, text(read(Seekable::new(Cursor::new(&bytes)), &part)));
        assert_eq!(whole, text(read(Fetch(fetch), &part)));
        if let Ok(scene) = whole {
            scene.check().expect("what opens is valid");
        }
    }
});
