//! The configuration of the authors' program: lines `name = value`, as ConfigArgParse reads them.

use std::collections::HashMap;

use glam::DVec3;

use strivec_format::model::{Coverage, Reduction};
use strivec_import::{Fault, Input};

/// Bytes of a configuration.
const MAX_BYTES: u64 = 1 << 20;

/// The settings that a checkpoint does not hold, with the program's own defaults.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// `local_range`: the half edges of the tensors of each scale, rounded to 32 bits as the program does.
    pub half_edges: Vec<DVec3>,
    /// `max_tensoRF`: the neighbors of a sample, by scale.
    pub top_k: Vec<u32>,
    /// `unit_lvl`: the scale whose cells give the step.
    pub step_scale: usize,
    /// `filterall`.
    pub coverage: Coverage,
    /// `den_lvl_norm`.
    pub density_reduction: Reduction,
    /// `rad_lvl_norm`.
    pub appearance_reduction: Reduction,
    /// `radiance_add`: features of the scales are added. Otherwise they follow one another.
    pub adds_features: bool,
    /// `vm_sep_mat`: the tensors' matrices are 0: one for all; 1: one for each axis; 2: one for each tensor.
    pub matrix_sharing: u32,
    /// `vox_range`: the edges of the voxels of each scale, from which centers follow, if a voxel's center is a tensor's.
    pub voxels: Option<Vec<[f32; 3]>>,
}

impl Config {
    /// Reads the configuration `input`.
    ///
    /// # Errors
    ///
    /// If it is no text of lines `name = value`, a used value is invalid, or a scene cannot express it.
    ///
    /// # Examples
    ///
    /// ```
    /// use strivec_import::Input;
    /// use strivec_checkpoints::authors::Config;
    ///
    /// let text = b"local_range = [0.3, 0.3, 0.3, 0.15, 0.15, 0.15] # two scales\nmax_tensoRF = [4, 4]\nfilterall=1\n";
    /// let config = Config::read(&mut Input::from_bytes(text))?;
    /// assert_eq!(config.top_k, [4, 4]);
    /// # Ok::<(), strivec_import::Fault>(())
    /// ```
    pub fn read(input: &mut Input<'_>) -> Result<Self, Fault> {
        let entries = ConfigEntries::read(input)?;
        entries.check_expressible()?;
        let top_k = if entries.has("rot_max_tensoRF") { "rot_max_tensoRF" } else { "max_tensoRF" };
        let reduction = |mean| if mean { Reduction::Mean } else { Reduction::Sum };
        let centered = entries.numbers("vox_center", &[1.0])?.iter().all(|&v| v > 0.0);
        let has_voxels = entries.has("vox_range") && centered && !entries.has("fps_num");
        let voxels = if has_voxels { Some(entries.triples("vox_range")?) } else { None };
        Ok(Self {
            half_edges: entries.triples("local_range")?.into_iter().map(|edge| edge.map(f64::from).into()).collect(),
            top_k: entries.counts(top_k, 4)?,
            step_scale: entries.count("unit_lvl", 0)? as usize,
            coverage: if entries.count("filterall", 0)? > 0 { Coverage::All } else { Coverage::Any },
            density_reduction: reduction(entries.count("den_lvl_norm", 0)? > 0),
            appearance_reduction: reduction(entries.count("rad_lvl_norm", 0)? > 0),
            adds_features: entries.count("radiance_add", 0)? > 0,
            matrix_sharing: entries.count("vm_sep_mat", 0)?,
            voxels,
        })
    }

    /// The neighbors of a sample in `scale`.
    pub(super) fn top_k(&self, scale: usize) -> Result<u32, Fault> {
        let missing =
            || Fault::malformed("max_tensoRF of the configuration", "a number for each scale", self.top_k.len());
        self.top_k.get(scale).copied().ok_or_else(missing)
    }
}

/// Names and values with their lines. Of a name that occurs more than once, the last value counts.
struct ConfigEntries(HashMap<String, (usize, String)>);

impl ConfigEntries {
    fn read(input: &mut Input<'_>) -> Result<Self, Fault> {
        Fault::unless_within("bytes of a configuration", MAX_BYTES, input.left())?;
        let mut bytes = vec![0; input.left() as usize];
        input.fill(&mut bytes, "the configuration")?;
        let text = std::str::from_utf8(&bytes)
            .map_err(|e| Fault::malformed(format!("byte {}", e.valid_up_to()), "UTF-8 text", "another byte"))?;
        let mut entries = HashMap::new();
        for (n, line) in text.lines().enumerate() {
            let line = without_comment(line).trim();
            if line.is_empty() || line.starts_with(['[', '-']) {
                continue;
            }
            let is_separator = |c: char| c == '=' || c == ':' || c.is_whitespace();
            let (name, value) = line.split_once(is_separator).unwrap_or((line, ""));
            let value = value.trim_start_matches(is_separator).trim();
            entries.insert(name.to_owned(), (n + 1, value.to_owned()));
        }
        Ok(Self(entries))
    }

    /// Refuses settings that a scene cannot express, and names a remedy.
    fn check_expressible(&self) -> Result<(), Fault> {
        /// A setting, the condition on its value, and a remedy.
        type Rule = (&'static str, fn(&str) -> bool, &'static str);
        const IS_KNOWN: fn(&str) -> bool = |value| matches!(value, "StrivecCP_hier" | "Strivec_DBase");
        const IS_OFF: fn(&str) -> bool = |value| value.parse::<f64>().is_ok_and(|value| value <= 0.0);
        const RULES: [Rule; 7] = [
            ("model_name", IS_KNOWN, "train with model_name = StrivecCP_hier or Strivec_DBase"),
            ("intrp_mthd", |value| value == "linear", "train with intrp_mthd = linear"),
            ("tensoRF_shape", |value| value == "cube", "train with tensoRF_shape = cube"),
            ("rot_init", |_| false, "train without rotated tensors"),
            ("rotgrad", IS_OFF, "train without rotated tensors"),
            ("ub360", IS_OFF, "train the scene anew, as an unbounded one of this format"),
            ("vm_dim_factor", |value| value.parse() == Ok(1.0), "train with vm_dim_factor = 1"),
        ];
        for (name, is_met, instead) in RULES {
            if let Some(value) = self.value(name).filter(|value| !is_met(value)) {
                let value = value.chars().take(40).collect::<String>();
                return Err(Fault::unsupported(format!("the setting {name} = {value:?}"), instead));
            }
        }
        Ok(())
    }

    fn has(&self, name: &str) -> bool {
        self.value(name).is_some_and(|value| !matches!(value, "" | "None" | "[]"))
    }

    fn value(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(|(_, value)| unquoted(value)).filter(|&value| value != "None")
    }

    /// The numbers of the list `name`, or of a single number.
    fn numbers(&self, name: &str, default: &[f64]) -> Result<Vec<f64>, Fault> {
        let Some((line, value)) = self.0.get(name) else { return Ok(default.to_vec()) };
        let inner = value.strip_prefix('[').and_then(|value| value.strip_suffix(']')).unwrap_or(value);
        let number = |text: &str| unquoted(text.trim()).parse::<f64>().ok().filter(|number| number.is_finite());
        let texts = inner.split(',').flat_map(str::split_whitespace);
        let numbers: Option<Vec<f64>> = texts.map(number).collect();
        numbers.filter(|numbers| !numbers.is_empty()).ok_or_else(|| {
            let found = value.chars().take(40).collect::<String>();
            Fault::malformed(format!("line {line}, {name}"), "finite numbers", format!("{found:?}"))
        })
    }

    /// Whole numbers from 0 on.
    fn counts(&self, name: &str, default: u32) -> Result<Vec<u32>, Fault> {
        let numbers = self.numbers(name, &[default.into()])?;
        numbers.into_iter().map(|n| crate::state::whole(&format!("{name} of the configuration"), n)).collect()
    }

    fn count(&self, name: &str, default: u32) -> Result<u32, Fault> {
        match self.counts(name, default)?[..] {
            [count] => Ok(count),
            ref counts => Err(Fault::malformed(format!("{name} of the configuration"), "one number", counts.len())),
        }
    }

    /// Positive numbers, three for each scale.
    fn triples(&self, name: &str) -> Result<Vec<[f32; 3]>, Fault> {
        let numbers = self.numbers(name, &[0.1; 3])?;
        let (triples, rest) = numbers.as_chunks::<3>();
        if !rest.is_empty() || numbers.iter().any(|&n| !(n as f32).is_finite() || n as f32 <= 0.0) {
            let expected = "three positive numbers for each scale";
            return Err(Fault::malformed(format!("{name} of the configuration"), expected, format!("{numbers:?}")));
        }
        Ok(triples.iter().map(|triple| triple.map(|n| n as f32)).collect())
    }
}

/// `line` without what follows a `#` or `;` at its beginning or after a space.
fn without_comment(line: &str) -> &str {
    let starts = line.match_indices(['#', ';']).map(|(at, _)| at);
    let is_comment = |&at: &usize| line[..at].chars().next_back().is_none_or(char::is_whitespace);
    starts.into_iter().find(is_comment).map_or(line, |at| &line[..at])
}

fn unquoted(text: &str) -> &str {
    let quotes = ['"', '\''];
    quotes.into_iter().find_map(|q| text.strip_prefix(q)?.strip_suffix(q)).unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(text: &str) -> Result<Config, Fault> {
        Config::read(&mut Input::from_bytes(text.as_bytes()))
    }

    #[test]
    fn lines_of_the_authors_configurations_are_read() {
        let text = "\n# two scales\nlocal_range = [0.3, 0.3, 0.3, 0.15, 0.15, 0.15]\nmax_tensoRF = [4, 2]\nunit_lvl=1 # which lvl\n\
            filterall=1 \ngpu_ids=\"0\"\nradiance_add = 1\nden_lvl_norm: 1\nvox_range=[0.4,0.4,0.4]\nuse_geo =-1";
        let found = config(text).unwrap();
        let half_edges = [0.3_f32, 0.15].map(|edge| DVec3::splat(edge.into()));
        assert_eq!(found.half_edges, half_edges, "{found:?}");
        assert_eq!((&found.top_k[..], found.step_scale, found.coverage), (&[4, 2][..], 1, Coverage::All));
        assert_eq!((found.density_reduction, found.appearance_reduction), (Reduction::Mean, Reduction::Sum));
        assert!(found.adds_features);
        assert_eq!(found.voxels, Some(vec![[0.4; 3]]));
        assert_eq!(config("vox_range=[1,1,1]\nvox_center=[0]").unwrap().voxels, None);
    }

    #[test]
    fn what_a_scene_cannot_express_is_refused_with_a_remedy() {
        for (text, error) in [
            ("intrp_mthd = avg", "the setting intrp_mthd = \"avg\" is not supported: train with intrp_mthd = linear"),
            (
                "rot_init = [0, 0, 1]",
                "the setting rot_init = \"[0, 0, 1]\" is not supported: train without rotated tensors",
            ),
            (
                "model_name = Other",
                "the setting model_name = \"Other\" is not supported: train with model_name = StrivecCP_hier or Strivec_DBase",
            ),
            (
                "local_range = [1, 2]",
                "local_range of the configuration: expected three positive numbers for each scale, found [1.0, 2.0]",
            ),
            ("\nmax_tensoRF = [a]", "line 2, max_tensoRF: expected finite numbers, found \"[a]\""),
            ("unit_lvl = 0.5", "unit_lvl of the configuration: expected a whole number from 0 on, found 0.5"),
        ] {
            assert_eq!(config(text).unwrap_err().to_string(), error);
        }
        let error = config("ub360 = 1").unwrap_err().to_string();
        assert!(error.contains("train the scene anew"), "{error}");
    }
}
