//! Hints for options, values and commands that were removed: what to use instead.

use clap::Error;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};

/// What each removed option, value of an option or command is replaced by.
const REMOVED: [(&str, &str); 5] = [
    ("--components", "strivec shrink makes a scene of fewer parameters that looks better"),
    ("--density-cache", "--step-scale, --min-weight and --min-transmittance save more time and cost less"),
    ("--scales", "strivec-pack crop --scales writes a file of the coarsest scales"),
    ("--top-k", "--step-scale, --min-weight and --min-transmittance save more time and cost less"),
    ("cpu-f64", "cpu shows the same picture; reference computes it in 64 bits"),
];

/// `parsed`; an error that names something removed shows the hint instead of similar names.
pub(super) fn parsed<C>(parsed: Result<C, Error>) -> Result<C, Error> {
    parsed.map_err(|mut error| {
        let (named, similar) = match error.kind() {
            ErrorKind::UnknownArgument => (ContextKind::InvalidArg, ContextKind::SuggestedArg),
            ErrorKind::InvalidValue => (ContextKind::InvalidValue, ContextKind::SuggestedValue),
            ErrorKind::InvalidSubcommand => (ContextKind::InvalidSubcommand, ContextKind::SuggestedSubcommand),
            _ => return error,
        };
        let hint = match error.get(named) {
            Some(ContextValue::String(name)) => REMOVED.iter().find(|(removed, _)| removed == name),
            _ => None,
        };
        if let Some((name, instead)) = hint {
            let hint = StyledStr::from(format!("{name} was removed; {instead}"));
            error.remove(similar);
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![hint]));
        }
        error
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removed_names_are_refused_with_a_hint() {
        let backend = || clap::Arg::new("backend").long("backend").value_parser(["cpu", "gpu"]);
        let command = || clap::Command::new("strivec").subcommand(clap::Command::new("render").arg(backend()));
        for (name, instead) in REMOVED {
            let words = if name.starts_with("--") { [name, "9"] } else { ["--backend", name] };
            let words = ["strivec", "render"].into_iter().chain(words);
            let error = parsed(command().try_get_matches_from(words)).unwrap_err();
            let message = error.to_string();
            assert!(message.contains(&format!("{name} was removed; {instead}")), "{message}");
        }
        let other = parsed(command().try_get_matches_from(["strivec", "render", "--other"])).unwrap_err();
        assert!(!other.to_string().contains("was removed"), "{other}");
    }
}
