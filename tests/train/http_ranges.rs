//! A file on a web server: only the needed ranges are fetched.

use crate::scenes;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

use strivec_format::container::{EncodeOptions, Error, Fetch, Limits, Metadata, Part, Reader, encode_scene_file};
use strivec_format::geometry::Aabb;
use strivec_format::model::Scene;

/// A server of one file that answers one range a request, as static file servers do.
struct Server {
    http: Arc<tiny_http::Server>,
    thread: Option<JoinHandle<()>>,
    /// Bytes of bodies, and requests.
    sent: Arc<[AtomicU64; 2]>,
}

impl Server {
    fn of(file: Vec<u8>) -> Self {
        let http = Arc::new(tiny_http::Server::http("127.0.0.1:0").unwrap());
        let sent = Arc::new([const { AtomicU64::new(0) }; 2]);
        let (of_thread, counted) = (Arc::clone(&http), Arc::clone(&sent));
        let thread = std::thread::spawn(move || {
            for request in of_thread.incoming_requests() {
                let wanted = (request.headers().iter())
                    .find(|header| header.field.equiv("Range"))
                    .and_then(|header| range(header.value.as_str(), file.len()));
                let (status, body) = match wanted {
                    Some(range) => (206, &file[range]),
                    None => (416, &[][..]),
                };
                counted[0].fetch_add(body.len() as u64, Ordering::Relaxed);
                counted[1].fetch_add(1, Ordering::Relaxed);
                let response = tiny_http::Response::from_data(body).with_status_code(status);
                request.respond(response).unwrap();
            }
        });
        Self { http, thread: Some(thread), sent }
    }

    fn url(&self) -> String {
        format!("http://{}/scene.strivec", self.http.server_addr())
    }

    fn sent(&self) -> [u64; 2] {
        [0, 1].map(|i| self.sent[i].load(Ordering::Relaxed))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.http.unblock();
        self.thread.take().map(JoinHandle::join);
    }
}

/// `bytes=first-last` of a file of `length` bytes.
fn range(header: &str, length: usize) -> Option<Range<usize>> {
    let (first, last) = header.strip_prefix("bytes=")?.split_once('-')?;
    let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
    (first < length && first <= last).then(|| first..length.min(last + 1))
}

/// Requests ranges of the file at `url`.
fn ask(url: String) -> Fetch<impl Fn(Range<u64>) -> Result<Vec<u8>, String>> {
    Fetch(move |wanted: Range<u64>| {
        let range = format!("bytes={}-{}", wanted.start, wanted.end - 1);
        let mut response = ureq::get(&url).header("Range", range).call().map_err(|e| e.to_string())?;
        if response.status() != 206 {
            return Err(format!("expected partial content (206), found {}", response.status()));
        }
        response.body_mut().read_to_vec().map_err(|e| e.to_string())
    })
}

/// Three scales of growing size in chunks.
fn scene() -> Scene {
    let mut config = scenes::config();
    config.optimizer.factor_deviation = 0.5;
    scenes::scene(&config)
}

fn file(scene: &Scene) -> Vec<u8> {
    let options = EncodeOptions { chunk_tensors: 8, ..EncodeOptions::default() };
    encode_scene_file(scene, &Metadata::default(), &options).unwrap()
}

#[test]
fn the_first_scale_takes_its_own_bytes_and_little_more() {
    let file = file(&scene());
    let server = Server::of(file.clone());
    let reader = Reader::open(ask(server.url()), Limits::default()).unwrap();
    let mut last = 0;
    for scales in 1..=scene().scales.len() {
        let part = Part { scales: Some(scales), ..Part::default() };
        let [before, _] = server.sent();
        let scene = reader.read(&part).unwrap().scene;
        let [after, requests] = server.sent();
        assert_eq!(scene.scales.len(), scales);
        assert_eq!(scene, Reader::open(file.as_slice(), Limits::default()).unwrap().read(&part).unwrap().scene);
        println!("{scales} scales: {} of {} bytes, {requests} requests so far", after - before, file.len());
        assert!(after - before > last, "more scales take more bytes");
        last = after - before;
        if scales == 1 {
            assert!(after < file.len() as u64 / 2, "{after} of {} bytes for the first scale", file.len());
        }
    }
}

#[test]
fn a_crop_takes_the_chunks_that_reach_into_it() {
    let whole = scene();
    let file = file(&whole);
    let server = Server::of(file.clone());
    let reader = Reader::open(ask(server.url()), Limits::default()).unwrap();
    let quarter = Aabb { min: whole.bounds.min, max: whole.bounds.min.lerp(whole.bounds.max, 0.25) };
    let part = Part { within: Some(quarter), ..Part::default() };
    let scene = reader.read(&part).unwrap().scene;
    let [bytes, _] = server.sent();
    println!("a crop: {bytes} of {} bytes", file.len());
    assert!(bytes < file.len() as u64 * 3 / 4);
    let tensors = |scene: &Scene| scene.scales.iter().map(|s| s.cloud.len()).sum::<usize>();
    assert!(tensors(&scene) < tensors(&whole));
}

#[test]
fn a_server_that_fails_is_reported_with_the_range() {
    let file = file(&scene());
    let server = Server::of(file[..file.len() / 2].to_vec());
    let reader = Reader::open(ask(server.url()), Limits::default()).unwrap();
    let error = reader.read(&Part::WHOLE).unwrap_err();
    assert!(matches!(error, Error::Source { .. } | Error::Truncated { .. }), "{error}");
}
