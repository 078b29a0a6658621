//! The text of `--version`: version, commit and features of this build.

use std::sync::LazyLock;

/// Features of the build, in the order of `Cargo.toml`.
const FEATURES: [(&str, bool); 3] =
    [("cli", cfg!(feature = "cli")), ("gpu", cfg!(feature = "gpu")), ("player", cfg!(feature = "player"))];

static VERSION: LazyLock<String> = LazyLock::new(|| text(env!("STRIVEC_BUILD")));

/// Version, commit and features of this build, such as `0.1.0 (1a2b3c4d5; features: cli, gpu)`. Debug builds and builds
/// outside a repository name no commit.
pub fn version() -> &'static str {
    &VERSION
}

fn text(commit: &str) -> String {
    let features: Vec<&str> = FEATURES.into_iter().filter(|(_, on)| *on).map(|(name, _)| name).collect();
    let separator = if commit.is_empty() { "" } else { "; " };
    format!("{} ({commit}{separator}features: {})", env!("CARGO_PKG_VERSION"), features.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_name_commit_and_features() {
        let number = env!("CARGO_PKG_VERSION");
        assert!(text("1a2b3c4d5").starts_with(&format!("{number} (1a2b3c4d5; features: cli")));
        assert!(text("").starts_with(&format!("{number} (features: cli")));
        assert!(version().starts_with(number));
    }
}
