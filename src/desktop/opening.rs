//! Opening scenes in the background: from files, folders and servers, the coarse scale first.

use std::fs::File;
use std::io::Read as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use strivec_format::container::{Error, Limits, Reader, Seekable, read_all};
use strivec_player::{Step, Stream, each_step};

/// Longest time without progress: of the look-up of a name, a connection, a request, the beginning of an answer, and each read
/// of its bytes. A download as a whole may take longer.
const TIMEOUT: Duration = Duration::from_secs(30);

/// An event of the thread that opens a file.
pub(super) enum OpeningEvent {
    /// A scene of the first scales, or of all.
    Step(Box<Step>),
    /// The file cannot be opened.
    Failed(OpeningError),
}

/// An error of opening a file.
#[derive(Debug)]
pub(super) struct OpeningError {
    /// Text of the error; begins with the path or the URL.
    pub(super) text: String,
    /// Exit code of the process: 2 if the file cannot be read, 3 if it is malformed, 5 if it needs another reader.
    pub(super) exit_code: u8,
}

/// Opens `place`, a path or a URL; `wake` is called after each event.
pub(super) fn open(place: String, wake: impl Fn() + Send + 'static) -> Receiver<OpeningEvent> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let send = |event| {
            let is_open = sender.send(event).is_ok();
            wake();
            is_open
        };
        let mut show = |step| send(OpeningEvent::Step(Box::new(step)));
        let opened = if is_url(&place) { download(&place, &mut show) } else { read(&place, &mut show) };
        if let Err(error) = opened {
            send(OpeningEvent::Failed(failure(&place, &error)));
        }
    });
    receiver
}

/// Reads the header and the table of the file at `path`.
///
/// # Errors
///
/// If the file cannot be read, or if it is not a `.strivec` file.
pub(super) fn check(path: &str) -> Result<(), OpeningError> {
    reader(path).map(drop).map_err(|error| failure(path, &error))
}

fn failure(place: &str, error: &Error) -> OpeningError {
    let (text, exit_code) = match error {
        Error::Source { message, .. } => (message.clone(), 2),
        error => (error.to_string(), if error.needs_another_reader() { 5 } else { 3 }),
    };
    OpeningError { text: format!("{place}: {text}"), exit_code }
}

/// The scenes in the folder `path`, by name; `None` if it is not a folder.
pub(super) fn scenes_in(path: &Path) -> Option<Vec<PathBuf>> {
    let entries = std::fs::read_dir(path).ok()?;
    let mut found: Vec<_> = entries
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "strivec"))
        .collect();
    found.sort();
    Some(found)
}

/// True if `place` is a URL.
pub(super) fn is_url(place: &str) -> bool {
    place.starts_with("http://") || place.starts_with("https://")
}

/// The last part of a path or a URL.
pub(super) fn name_of(place: &str) -> &str {
    place.trim_end_matches(['/', '\\']).rsplit(['/', '\\']).next().unwrap_or(place)
}

fn reader(path: &str) -> Result<Reader<Seekable<File>>, Error> {
    let unreadable = |message: String| Error::Source { range: 0..0, message };
    if Path::new(path).is_dir() {
        return Err(unreadable("is a folder, not a file".into()));
    }
    let failed = |e: std::io::Error| unreadable(format!("cannot be read: {e}"));
    // Before it is opened: a pipe without a writer would block.
    let metadata = std::fs::metadata(path).map_err(failed)?;
    if !metadata.is_file() {
        return Err(unreadable("is a device or a pipe, not a file".into()));
    }
    let file = File::open(path).map_err(failed)?;
    Reader::open(Seekable::new(file), Limits::of_file(metadata.len()))
}

fn read(path: &str, show: &mut dyn FnMut(Step) -> bool) -> Result<(), Error> {
    each_step(&reader(path)?, show)
}

fn download(url: &str, show: &mut dyn FnMut(Step) -> bool) -> Result<(), Error> {
    download_within(TIMEOUT, url, show)
}

fn download_within(timeout: Duration, url: &str, show: &mut dyn FnMut(Step) -> bool) -> Result<(), Error> {
    let timeouts = ureq::Agent::config_builder()
        .timeout_resolve(Some(timeout))
        .timeout_connect(Some(timeout))
        .timeout_send_request(Some(timeout))
        .timeout_recv_response(Some(timeout))
        .timeout_per_read(Some(timeout));
    let agent: ureq::Agent = timeouts.build().into();
    let mut stream = Stream::default();
    while !stream.is_done() {
        for range in stream.wanted()? {
            let (range, bytes) = fetch(&agent, url, range)?;
            let is_whole_file = range.end == u64::MAX;
            stream.add(range, bytes);
            if is_whole_file {
                break;
            }
        }
        if stream.wanted()?.is_empty()
            && let Some(step) = stream.step()?
            && !show(step)
        {
            return Ok(());
        }
    }
    Ok(())
}

/// The bytes of `range`, or those of the whole file if the server does not support ranges.
fn fetch(agent: &ureq::Agent, url: &str, range: Range<u64>) -> Result<(Range<u64>, Vec<u8>), Error> {
    let last = range.end.saturating_sub(1);
    let answer = agent.get(url).header("Range", format!("bytes={}-{last}", range.start)).call();
    let failed = |message| Error::Source { range: range.clone(), message };
    let answer = answer.map_err(|e| failed(format!("cannot be downloaded: {e}")))?;
    let is_part = answer.status() == 206;
    let mut body = answer.into_body().into_reader();
    if !is_part {
        // The answer may have no end.
        let bytes = read_all(&mut body).map_err(|error| match error {
            Error::Source { range, message } => Error::Source { range, message: stopped(&message) },
            error => error,
        });
        return Ok((0..u64::MAX, bytes?));
    }
    let (mut bytes, length) = (Vec::new(), range.end - range.start);
    body.take(length).read_to_end(&mut bytes).map_err(|e| failed(stopped(&e.to_string())))?;
    Ok((range, bytes))
}

fn stopped(message: &str) -> String {
    format!("the download stopped: {message}")
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::io::Write as _;

    /// Serves `file` for `requests` requests; with ranges if `has_ranges`. Returns the requested ranges.
    fn serve(file: Vec<u8>, has_ranges: bool) -> (String, std::thread::JoinHandle<()>, Receiver<Range<usize>>) {
        let server = tiny_http::Server::http("127.0.0.1:0").unwrap();
        let url = format!("http://{}/scene.strivec", server.server_addr());
        let (sender, receiver) = channel();
        let thread = std::thread::spawn(move || {
            while let Ok(Some(request)) = server.recv_timeout(Duration::from_secs(2)) {
                let header = request.headers().iter().find(|header| header.field.equiv("Range")).unwrap();
                let (first, last) = header.value.as_str().strip_prefix("bytes=").unwrap().split_once('-').unwrap();
                let [first, last]: [u64; 2] = [first, last].map(|v| v.parse().unwrap());
                let range =
                    if has_ranges { first as usize..(last + 1).min(file.len() as u64) as usize } else { 0..file.len() };
                let response = tiny_http::Response::from_data(&file[range.clone()]);
                let _ = sender.send(range);
                request.respond(response.with_status_code(if has_ranges { 206 } else { 200 })).unwrap();
            }
        });
        (url, thread, receiver)
    }

    #[test]
    fn no_byte_is_downloaded_twice() {
        let file = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/everything.strivec")).unwrap();
        for has_ranges in [true, false] {
            let (url, thread, ranges) = serve(file.clone(), has_ranges);
            let OpeningEvent::Step(step) = open(url, || {}).recv().unwrap() else { panic!("it did not open") };
            assert!(step.is_whole);
            thread.join().unwrap();
            let bytes: usize = ranges.iter().map(|range| range.len()).sum();
            assert_eq!(bytes, file.len(), "with ranges: {has_ranges}");
        }
    }

    /// Answers one request with `head`, which ends the lines of the header, and then with the pieces of `body`, each after `pause`.
    fn answer(
        head: &'static str,
        body: impl Iterator<Item = Vec<u8>> + Send + 'static,
        pause: Duration,
    ) -> (String, std::thread::JoinHandle<usize>) {
        let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/scene.strivec", server.local_addr().unwrap());
        let thread = std::thread::spawn(move || {
            let (mut client, _) = server.accept().unwrap();
            assert!(client.read(&mut [0; 4096]).unwrap() > 0, "a request");
            client.write_all(head.as_bytes()).unwrap();
            let mut sent = 0;
            for piece in body {
                std::thread::sleep(pause);
                if client.write_all(&piece).is_err() {
                    break;
                }
                sent += piece.len();
            }
            sent
        });
        (url, thread)
    }

    const WHOLE: &str = "HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n";

    #[test]
    fn an_answer_without_end_is_refused_by_its_first_bytes() {
        let (url, server) = answer(WHOLE, std::iter::repeat(vec![0; 1 << 16]), Duration::ZERO);
        let error = download_within(TIMEOUT, &url, &mut |_| panic!("it opened")).unwrap_err();
        assert!(matches!(error, Error::NotStrivec { .. }), "{error}");
        // What is in the buffers of the system.
        assert!(server.join().unwrap() < 64 << 20);
    }

    #[test]
    fn no_more_is_read_than_the_file_declares() {
        let file = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/everything.strivec")).unwrap();
        let body = std::iter::once(file).chain(std::iter::repeat(vec![0; 1 << 16]));
        let (url, server) = answer(WHOLE, body, Duration::ZERO);
        let mut steps = Vec::new();
        let shown = download_within(TIMEOUT, &url, &mut |step| {
            steps.push(step.is_whole);
            true
        });
        assert_eq!((shown, steps.last()), (Ok(()), Some(&true)));
        assert!(server.join().unwrap() < 64 << 20);
    }

    #[test]
    fn a_download_that_progresses_may_take_longer_than_the_timeout() {
        let file = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/zstd.strivec")).unwrap();
        let timeout = Duration::from_millis(400);
        let pieces: Vec<Vec<u8>> = file.chunks(file.len().div_ceil(8)).map(<[u8]>::to_vec).collect();
        let (url, server) = answer(WHOLE, pieces.into_iter(), timeout / 4);
        let start = std::time::Instant::now();
        download_within(timeout, &url, &mut |_| true).unwrap();
        assert!(start.elapsed() > timeout);
        server.join().unwrap();
        // One that stops does not.
        let (url, _server) = answer(WHOLE, std::iter::once(file[..100].to_vec()), Duration::from_secs(5));
        let error = download_within(timeout, &url, &mut |_| true).unwrap_err();
        assert!(error.to_string().contains("the download stopped"), "{error}");
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
        assert_eq!([name_of("https://a/b.strivec"), name_of("/a/b/"), name_of("b")], ["b.strivec", "b", "b"]);
    }

    #[test]
    fn files_that_cannot_be_opened_are_reported() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "words").unwrap();
        let path = file.path().display().to_string();
        for (place, part, exit_code) in [(path.as_str(), path.as_str(), 3), ("/nowhere.strivec", "No such file", 2)] {
            let OpeningEvent::Failed(error) = open(place.into(), || {}).recv().unwrap() else { panic!("it opened") };
            assert!(error.text.contains(part) && error.exit_code == exit_code, "{error:?}");
            assert_eq!(check(place).unwrap_err().text, error.text);
        }
    }
}
