//! Opening scenes in the background: from files, folders and servers, the coarse scale first.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use crate::container::{Contents, Error, Fetch, Limits, Part, Reader, SceneFile, Seekable, Source};
use crate::player::scale_count;

/// A server that says nothing for so long is gone.
const PATIENCE: Duration = Duration::from_secs(30);
/// Files below this are opened at once.
const SMALL: u64 = 1 << 20;

/// What the background says.
pub(super) enum News {
    /// A scene of the first scales, or of all.
    Scene(Box<Opened>),
    /// Why there is none.
    Failed(String),
}

/// A scene, as far as it is there.
pub(super) struct Opened {
    /// The scene; a prefix of it is corrected to look like the whole.
    pub(super) document: SceneFile,
    pub(super) contents: Contents,
    /// Scales that are there.
    pub(super) scales: usize,
    /// Whether these are all.
    pub(super) is_whole: bool,
    /// What was opened.
    pub(super) name: String,
}

/// Opens `place`, a path or a URL; `wake` is called after each piece of news.
pub(super) fn open(place: String, wake: impl Fn() + Send + 'static) -> Receiver<News> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut tell = |news| {
            let is_heard = sender.send(news).is_ok();
            wake();
            is_heard
        };
        if let Err(error) = open_in_steps(&place, &mut tell) {
            tell(News::Failed(format!("{place}: {error}")));
        }
    });
    receiver
}

/// The scenes in the folder `path`, by name; `None` where it is no folder.
pub(super) fn scenes_in(path: &Path) -> Option<Vec<PathBuf>> {
    let entries = std::fs::read_dir(path).ok()?;
    let mut found: Vec<_> = entries
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "strivec"))
        .collect();
    found.sort();
    Some(found)
}

/// Whether `place` is on a server.
pub(super) fn is_url(place: &str) -> bool {
    place.starts_with("http://") || place.starts_with("https://")
}

fn open_in_steps(place: &str, tell: &mut dyn FnMut(News) -> bool) -> Result<(), Error> {
    let name = place.rsplit(['/', '\\']).next().unwrap_or(place).to_owned();
    if is_url(place) {
        let agent: ureq::Agent = ureq::Agent::config_builder().timeout_global(Some(PATIENCE)).build().into();
        let fetch = |range: Range<u64>| fetch(&agent, place, range);
        return read_in_steps(Remembered::new(Fetch(fetch)), name, tell);
    }
    let range = 0..0;
    let file = File::open(place).map_err(|e| Error::Source { range, message: e.to_string() })?;
    read_in_steps(Seekable::new(file), name, tell)
}

fn fetch(agent: &ureq::Agent, url: &str, range: Range<u64>) -> Result<Vec<u8>, String> {
    let last = range.end.saturating_sub(1);
    let answer = agent.get(url).header("Range", format!("bytes={}-{last}", range.start)).call();
    let answer = answer.map_err(|e| e.to_string())?;
    let is_part = answer.status() == 206;
    let length = range.end - range.start;
    // A server that does not know ranges sends everything.
    let skipped = if is_part { 0 } else { range.start };
    let mut body = answer.into_body().into_reader();
    let mut bytes = Vec::new();
    std::io::copy(&mut (&mut body).take(skipped), &mut std::io::sink()).map_err(|e| e.to_string())?;
    body.take(length).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes)
}

fn read_in_steps<S: Source>(source: S, name: String, tell: &mut dyn FnMut(News) -> bool) -> Result<(), Error> {
    let reader = Reader::open(source, Limits::default())?;
    let contents = reader.contents().clone();
    let all = scale_count(&contents);
    let mut steps: Vec<_> = if contents.file_length < SMALL { Vec::new() } else { (1..all).collect() };
    steps.push(all);
    for scales in steps {
        let is_whole = scales == all;
        let part = if is_whole { Part::WHOLE } else { Part { scales: Some(scales), within: None, metadata: true } };
        let document = reader.read(&part)?;
        // Fewer scales that nothing makes up for are hardly opaque.
        if !is_whole && !document.metadata.prefixes.get(scales - 1).is_some_and(Option::is_some) {
            continue;
        }
        let opened = Opened { document, contents: contents.clone(), scales, is_whole, name: name.clone() };
        if !tell(News::Scene(Box::new(opened))) {
            return Ok(());
        }
    }
    Ok(())
}

/// A source that is asked for no byte twice.
struct Remembered<S> {
    inner: S,
    known: Mutex<Vec<(u64, Vec<u8>)>>,
}

impl<S> Remembered<S> {
    fn new(inner: S) -> Self {
        Self { inner, known: Mutex::new(Vec::new()) }
    }
}

impl<S: Source> Source for Remembered<S> {
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error> {
        let mut known = self.known.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut bytes = Vec::new();
        let mut at = range.start;
        while at < range.end {
            let held = known.iter().find(|(start, held)| (*start..start + held.len() as u64).contains(&at));
            if let Some((start, held)) = held {
                let part = &held[(at - start) as usize..];
                let part = &part[..part.len().min((range.end - at) as usize)];
                bytes.extend_from_slice(part);
                at += part.len() as u64;
                continue;
            }
            let end = known.iter().map(|(start, _)| *start).filter(|start| *start > at).fold(range.end, u64::min);
            let new = self.inner.read(at..end)?.into_owned();
            if new.is_empty() {
                break;
            }
            known.push((at, new));
        }
        Ok(Cow::Owned(bytes))
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    #[test]
    fn no_byte_is_asked_for_twice() {
        let file: Vec<u8> = (0..200).collect();
        let asked = RefCell::new(Vec::new());
        let source = Remembered::new(Fetch(|range: Range<u64>| {
            asked.borrow_mut().push([range.start, range.end]);
            Ok(file[range.start as usize..(range.end as usize).min(200)].to_vec())
        }));
        for (range, expected) in [
            (10..20, vec![[10, 20]]),
            (10..20, vec![]),
            (5..25, vec![[5, 10], [20, 25]]),
            (0..30, vec![[0, 5], [25, 30]]),
            (190..250, vec![[190, 250], [200, 250]]),
        ] {
            asked.borrow_mut().clear();
            let end = (range.end as usize).min(200);
            assert_eq!(source.read(range.clone()).unwrap(), &file[range.start as usize..end], "{range:?}");
            assert_eq!(*asked.borrow(), expected, "{range:?}");
        }
    }

    #[test]
    fn folders_list_their_scenes() {
        let folder = tempfile::TempDir::new().unwrap();
        for name in ["b.strivec", "a.strivec", "c.png"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let names: Vec<_> =
            scenes_in(folder.path()).unwrap().iter().map(|p| p.file_name().unwrap().to_owned()).collect();
        assert_eq!(names, ["a.strivec", "b.strivec"]);
        assert_eq!(scenes_in(&folder.path().join("c.png")), None);
        assert!(is_url("https://a/b.strivec") && !is_url("/http://x"));
    }

    #[test]
    fn a_file_that_is_none_is_said() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "words").unwrap();
        let news = open(file.path().display().to_string(), || {});
        let News::Failed(text) = news.recv().unwrap() else { panic!("it opened") };
        assert!(text.contains(&file.path().display().to_string()), "{text}");
        let News::Failed(text) = open("/nowhere.strivec".into(), || {}).recv().unwrap() else { panic!("it opened") };
        assert!(text.contains("No such file"), "{text}");
    }
}
