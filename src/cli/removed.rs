//! Hints for options, values and commands that were removed: what to use instead.

use clap::Error;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Commands that train, whose rarely used options are settings.
const TRAINING: &[&str] = &["strivec train", "strivec plan", "strivec shrink", "strivec bench train"];
/// The advice for options that shape a prior.
const SHAPING: &str = "`strivec prior FILES -o prior.npz` has this option; give prior.npz to --prior";

/// A removed option, value of an option, or command.
struct Removed {
    /// The commands that had it; empty: all.
    commands: &'static [&'static str],
    name: &'static str,
    instead: &'static str,
}

const fn everywhere(name: &'static str, instead: &'static str) -> Removed {
    Removed { commands: &[], name, instead }
}

const fn of_training(name: &'static str, instead: &'static str) -> Removed {
    Removed { commands: TRAINING, name, instead }
}

/// Everything that was removed, and what replaces it.
const REMOVED: [Removed; 48] = [
    everywhere("--components", "strivec shrink makes a scene of fewer parameters that looks better"),
    everywhere("--density-cache", "--step-scale, --min-weight and --min-transmittance save more time and cost less"),
    everywhere("--scales", "strivec-pack crop --scales writes a file of the coarsest scales"),
    everywhere("--top-k", "--step-scale, --min-weight and --min-transmittance save more time and cost less"),
    everywhere("grow", "train with more parameters and `strivec shrink`, or give `train --max-params`"),
    everywhere("growth", "`strivec bench train` and `strivec bench render` print the time of each stage"),
    everywhere("paper", "tools/measure/paper.py makes the paper's tables and figures"),
    everywhere("peak", "`strivec bench against PROGRAM` compares two builds by turns"),
    everywhere("placement", "`strivec bench files` and `strivec bench render` remain"),
    everywhere("query", "`cargo bench --bench kernels` measures the density at points"),
    everywhere("tensorf-cp", "use `--config docs/configs/tensorf-cp.toml`"),
    everywhere("tensorf-vm", "use `--config docs/configs/tensorf-vm.toml`"),
    everywhere("vm-cloud-6", "use `--config docs/configs/vm-cloud-6.toml`"),
    everywhere("vm-cloud-12", "use `--config docs/configs/vm-cloud-12.toml`"),
    everywhere("--lpips", "write pictures with `--sheets DIR`, then run tools/lpips/measure.py on them"),
    everywhere("--lpips-weights", "write pictures with `--sheets DIR`, then run tools/lpips/measure.py on them"),
    everywhere("cpu-f64", "cpu shows the same picture; reference computes it in 64 bits"),
    of_training("--batch", "use `--set sampling.batch_rays=N`"),
    of_training("--background", "use `--set photographs.background=[0,0,0]`"),
    of_training("--sky", "use `--set photographs.sky_degree=DEGREE`"),
    of_training("--near", "use `--set space.near_far=[NEAR,FAR]`"),
    of_training("--far", "use `--set space.near_far=[NEAR,FAR]`"),
    of_training("--unbounded", "use `--set model.contraction.shell=0.4`, or `--preset 360`"),
    of_training("--inner-box", "use `--set space.inner_box=[[X,Y,Z],[X,Y,Z]]`"),
    of_training("--exposure", "use `--set photographs.exposure=on`"),
    of_training("--refine-poses", "use `--set poses.refine=true`"),
    of_training("--refine-focal-length", "use `--set poses.refine_focal_length=true`"),
    of_training("--prune", "use `--set schedule.prune=true`"),
    of_training("--full", "use `--set lean.max_loss=0`"),
    of_training("--voxel", SHAPING),
    of_training("--thickness", SHAPING),
    of_training("--vertices", SHAPING),
    of_training("--outliers", SHAPING),
    of_training("--min-points", SHAPING),
    of_training("--min-confidence", SHAPING),
    of_training("--min-opacity", SHAPING),
    of_training("--keep-noise", SHAPING),
    of_training("--min-track", SHAPING),
    of_training("--max-error", SHAPING),
    of_training("--min-alpha", SHAPING),
    of_training("--threshold", SHAPING),
    of_training("--bounds", SHAPING),
    of_training("--scale", SHAPING),
    of_training("--up", SHAPING),
    of_training("--transform", SHAPING),
    of_training("--crop", SHAPING),
    of_training("--close", SHAPING),
    of_training("--dilate", SHAPING),
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
        let usage = match error.get(ContextKind::Usage) {
            Some(ContextValue::StyledStr(usage)) => usage.to_string(),
            _ => String::new(),
        };
        let is_of = |commands: &[&str]| commands.is_empty() || commands.iter().any(|command| usage.contains(command));
        let hint = match error.get(named) {
            Some(ContextValue::String(name)) => REMOVED.iter().find(|r| r.name == name && is_of(r.commands)),
            _ => None,
        };
        if let Some(Removed { name, instead, .. }) = hint {
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

    fn message_of(words: &[&str]) -> String {
        parsed(crate::command().try_get_matches_from([&["strivec"], words].concat())).unwrap_err().to_string()
    }

    #[test]
    fn removed_names_are_refused_with_a_hint() {
        for Removed { commands, name, instead } in REMOVED {
            let command = commands.first().map_or("render", |command| command.trim_start_matches("strivec "));
            let words = if name.starts_with("--") { [command, name, "9"] } else { [command, "--backend", name] };
            let message = message_of(&words);
            assert!(message.contains(&format!("{name} was removed; {instead}")), "{message}");
        }
        for words in [["render", "--other", "9"], ["render", "--close", "9"]] {
            assert!(!message_of(&words).contains("was removed"), "{}", message_of(&words));
        }
        assert!(message_of(&["bench", "train", "--batch", "9"]).contains("sampling.batch_rays"));
    }
}
