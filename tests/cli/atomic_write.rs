//! Files are written whole or not at all: by a process that is killed, on a disk that is full, beside other files.
#![cfg(all(unix, feature = "cli"))]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use strivec_cli::{Error, check_output, write_atomically};
use tempfile::TempDir;

/// Environment variables with the destination and the way of writing, for the process that saves.
const DESTINATION: &str = "STRIVEC_TEST_SAVE_TO";
const NAIVE: &str = "STRIVEC_TEST_SAVE_NAIVELY";
const WORDS: u64 = 1 << 20;

/// Version `n` of the file: about 8 MiB, of a length of its own, every word the same.
fn version(n: u64) -> Vec<u8> {
    n.to_le_bytes().repeat((WORDS + n % 1000) as usize)
}

/// The version that the file is, whole; `None` if it is a piece or a mixture.
fn version_of(bytes: &[u8]) -> Option<u64> {
    let n = u64::from_le_bytes(bytes.get(..8)?.try_into().unwrap());
    (bytes == version(n)).then_some(n)
}

/// Not a test of its own: the process that [`kill_while_saving`] starts and kills.
#[test]
fn saver() {
    let Some(path) = std::env::var_os(DESTINATION).map(PathBuf::from) else { return };
    let naive = std::env::var_os(NAIVE).is_some();
    for n in 1.. {
        if naive {
            fs::write(&path, version(n)).unwrap();
        } else {
            write_atomically(&path, &version(n), true).unwrap();
        }
    }
}

struct Saver(Child);

impl Drop for Saver {
    fn drop(&mut self) {
        // SIGKILL.
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

/// Ten times: lets another process save again and again, kills it, and reads the file. Returns the result of each time.
fn kill_while_saving(path: &Path, naive: bool) -> Vec<Option<u64>> {
    let mut random = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().subsec_nanos();
    (0..10)
        .map(|_| {
            fs::write(path, version(0)).unwrap();
            let mut command = Command::new(std::env::current_exe().unwrap());
            command
                .args(["--exact", "atomic_write::saver"])
                .env(DESTINATION, path)
                .stdout(Stdio::null())
                .stderr(Stdio::null());
            if naive {
                command.env(NAIVE, "1");
            }
            let saver = Saver(command.spawn().unwrap());
            let start = Instant::now();
            while fs::read(path).is_ok_and(|bytes| version_of(&bytes) == Some(0)) {
                assert!(start.elapsed() < Duration::from_secs(60), "the saver saves nothing");
            }
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            std::thread::sleep(Duration::from_micros(u64::from(random >> 16) % 50_000));
            drop(saver);
            version_of(&fs::read(path).unwrap())
        })
        .collect()
}

#[test]
fn a_killed_process_leaves_a_whole_file() {
    let folder = TempDir::new().unwrap();
    let found = kill_while_saving(&folder.path().join("scene.strivec"), false);
    assert!(found.iter().all(Option::is_some), "{found:?}");
}

#[test]
fn a_torn_file_is_noticed() {
    let folder = TempDir::new().unwrap();
    let found = kill_while_saving(&folder.path().join("scene.strivec"), true);
    assert!(found.iter().any(Option::is_none), "plain writing was never caught half-way: {found:?}");
}

/// Not a test of its own: the process that [`a_full_disk_leaves_the_old_file`] starts under a limit.
#[test]
fn limited_saver() {
    let Some(path) = std::env::var_os("STRIVEC_TEST_LIMITED").map(PathBuf::from) else { return };
    let error = write_atomically(&path, &[1; 1 << 20], true).unwrap_err();
    assert!(matches!(error, Error::Io(_)), "{error:?}");
    assert!(error.to_string().starts_with(&format!("{}: cannot write it: ", path.display())), "{error}");
}

#[test]
fn a_full_disk_leaves_the_old_file() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.strivec");
    fs::write(&path, "old").unwrap();
    // A limit on the size of files stands in for the end of the disk; its signal must not end the process.
    let status = Command::new("sh")
        .args(["-c", "ulimit -f 64; trap '' XFSZ; exec \"$0\" --exact atomic_write::limited_saver"])
        .arg(std::env::current_exe().unwrap())
        .env("STRIVEC_TEST_LIMITED", &path)
        .stdout(Stdio::null())
        .status()
        .unwrap();
    assert!(status.success(), "{status}");
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "nothing stays beside it");
}

#[test]
fn without_force_nothing_is_overwritten() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.strivec");
    drop(check_output(&path, false).unwrap());
    write_atomically(&path, b"one", false).unwrap();
    for refused in [check_output(&path, false).map(drop), write_atomically(&path, b"two", false)] {
        let error = refused.unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().contains("scene.strivec") && error.to_string().contains("--force"), "{error}");
    }
    assert_eq!(fs::read(&path).unwrap(), b"one");
    drop(check_output(&path, true).unwrap());
    write_atomically(&path, b"two", true).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"two");
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
}

#[test]
fn only_one_of_many_writers_wins_without_force() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.strivec");
    let wins = std::thread::scope(|scope| {
        let write = |n: u64| {
            let path = &path;
            scope.spawn(move || write_atomically(path, &version(n), false).is_ok())
        };
        let writers: Vec<_> = (1..=4).map(write).collect();
        writers.into_iter().map(|writer| usize::from(writer.join().unwrap())).sum::<usize>()
    });
    assert_eq!(wins, 1);
    assert!(version_of(&fs::read(&path).unwrap()).is_some());
}

#[test]
fn links_are_followed_and_kept() {
    let folder = TempDir::new().unwrap();
    let (target, link) = (folder.path().join("target"), folder.path().join("link"));
    fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink("target", &link).unwrap();
    assert!(write_atomically(&link, b"new", false).is_err());
    write_atomically(&link, b"new", true).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read(&target).unwrap(), b"new");
}

#[test]
fn what_is_no_regular_file_is_left_alone() {
    let folder = TempDir::new().unwrap();
    let socket = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    for path in [folder.path(), &socket] {
        let error = write_atomically(path, b"new", true).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().contains("not a regular file"), "{error}");
    }
}

#[test]
fn an_absent_folder_is_an_input_output_error_that_names_both() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("absent").join("scene.strivec");
    let error = check_output(&path, false).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    let expected = format!("{}: cannot write to the folder {}", path.display(), path.parent().unwrap().display());
    assert!(error.to_string().starts_with(&expected), "{error}");
}

#[test]
fn new_files_have_the_permissions_of_other_new_files() {
    use std::os::unix::fs::PermissionsExt;
    let folder = TempDir::new().unwrap();
    let (written, other) = (folder.path().join("written"), folder.path().join("other"));
    write_atomically(&written, b"", false).unwrap();
    fs::write(&other, "").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&written), mode(&other));
}
