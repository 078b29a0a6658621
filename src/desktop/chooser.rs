//! A list of folders and scenes to choose from, in the window.

use std::path::{Path, PathBuf};

use egui::{RichText, Ui};

use strivec_format::escape::{escaped, escaped_path};

/// The contents of a folder, to choose from.
pub(super) struct Chooser {
    folder: PathBuf,
    folders: Vec<String>,
    files: Vec<String>,
    /// Error of listing the folder.
    error: Option<String>,
    /// True if the chosen scene is compared with the first.
    pub(super) is_compared: bool,
}

impl Chooser {
    /// Lists the current folder.
    pub(super) fn new(is_compared: bool) -> Self {
        let folder = std::env::current_dir().unwrap_or_else(|_| PathBuf::from("/"));
        let mut chooser =
            Self { folder: PathBuf::new(), folders: Vec::new(), files: Vec::new(), error: None, is_compared };
        chooser.list(folder);
        chooser
    }

    /// Lists the folders, scenes and camera paths in `folder`.
    fn list(&mut self, folder: PathBuf) {
        (self.folders, self.files, self.error) = (Vec::new(), Vec::new(), None);
        match std::fs::read_dir(&folder) {
            Ok(entries) => {
                for entry in entries.flatten() {
                    let name = entry.file_name().to_string_lossy().into_owned();
                    if name.starts_with('.') {
                        continue;
                    }
                    if entry.path().is_dir() {
                        self.folders.push(name);
                    } else if is_openable(&entry.path()) {
                        self.files.push(name);
                    }
                }
            }
            Err(error) => self.error = Some(error.to_string()),
        }
        self.folders.sort();
        self.files.sort();
        self.folder = folder;
    }

    /// Lays the list out. Returns the chosen path.
    pub(super) fn lay_out(&mut self, ui: &mut Ui) -> Option<PathBuf> {
        let (mut wanted, mut chosen) = (None, None);
        ui.label(RichText::new(escaped_path(&self.folder)).weak());
        if let Some(error) = &self.error {
            ui.label(error);
        }
        egui::ScrollArea::vertical().max_height(320.0).auto_shrink([false, true]).show(ui, |ui| {
            if let Some(parent) = self.folder.parent()
                && ui.link("../").clicked()
            {
                wanted = Some(parent.to_owned());
            }
            for name in &self.folders {
                if ui.link(escaped(name) + "/").clicked() {
                    wanted = Some(self.folder.join(name));
                }
            }
            for name in &self.files {
                if ui.link(RichText::new(escaped(name)).strong()).clicked() {
                    chosen = Some(self.folder.join(name));
                }
            }
        });
        if self.files.is_empty() {
            ui.label(RichText::new("No .strivec files in this folder").weak());
        }
        if ui.button("Open this folder").on_hover_text("All scenes of the folder, or a dataset's photographs").clicked()
        {
            chosen = Some(self.folder.clone());
        }
        if let Some(folder) = wanted {
            self.list(folder);
        }
        chosen
    }
}

/// True if the player opens such a file: a scene or a camera path.
fn is_openable(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "strivec" || extension == "json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_scenes_are_listed() {
        let folder = tempfile::TempDir::new().unwrap();
        for name in ["b.strivec", "a.strivec", "c.png", ".hidden.strivec"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        std::fs::create_dir(folder.path().join("inner")).unwrap();
        let mut chooser = Chooser::new(false);
        chooser.list(folder.path().to_owned());
        assert_eq!(
            (chooser.files.join(" "), chooser.folders.join(" ")),
            ("a.strivec b.strivec".into(), "inner".into())
        );
        chooser.list(folder.path().join("nowhere"));
        assert!(chooser.files.is_empty() && chooser.error.is_some());
    }
}
