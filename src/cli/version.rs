//! The text of `--version`: version, commit and features of this build.

use std::sync::LazyLock;

/// Features of the build, in the order of `Cargo.toml`.
const FEATURES: [(&str, bool); 2] = [("gpu", cfg!(feature = "gpu")), ("player", cfg!(feature = "player"))];

static VERSION: LazyLock<String> = LazyLock::new(|| {
    let features: Vec<&str> = FEATURES.into_iter().filter(|(_, on)| *on).map(|(name, _)| name).collect();
    text(env!("STRIVEC_BUILD"), &features)
});

/// Version, commit and features of this build, such as `0.1.0 (1a2b3c4d5; features: gpu)`. Debug builds and builds
/// outside a repository name no commit.
pub fn version() -> &'static str {
    &VERSION
}

fn text(commit: &str, features: &[&str]) -> String {
    let separator = if commit.is_empty() { "" } else { "; " };
    let features = if features.is_empty() { "none".into() } else { features.join(", ") };
    format!("{} ({commit}{separator}features: {features})", env!("CARGO_PKG_VERSION"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_name_commit_and_features() {
        let number = env!("CARGO_PKG_VERSION");
        assert_eq!(text("1a2b3c4d5", &["gpu", "player"]), format!("{number} (1a2b3c4d5; features: gpu, player)"));
        assert_eq!(text("", &[]), format!("{number} (features: none)"));
        assert!(version().starts_with(number));
    }
}
