//! `strivec-pack schema`: the JSON schema of `--json`.

use std::collections::BTreeMap;

use schemars::generate::SchemaSettings;
use serde_json::{Value, json};

use super::{conform, convert::Written, diff::Difference, info, package, verify};
use crate::{Context, Error};

/// Prints the schema, with and without `--json`.
pub(super) fn run(session: &Context) -> Result<(), Error> {
    let text = serde_json::to_string_pretty(&schema()).map_err(|e| Error::Runtime(e.to_string()))?;
    session.console.print(&text)
}

/// One definition per command: a command's output matches `#/$defs/NAME`.
fn schema() -> Value {
    let mut generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let written = generator.subschema_for::<Vec<Written>>();
    let commands = BTreeMap::from([
        ("pack", generator.subschema_for::<Vec<package::Row>>()),
        ("info", generator.subschema_for::<Vec<info::Row>>()),
        ("verify", generator.subschema_for::<Vec<verify::Row>>()),
        ("conform", generator.subschema_for::<Vec<conform::Row>>()),
        ("diff", generator.subschema_for::<Difference>()),
        ("convert", written.clone()),
        ("prune", written.clone()),
        ("crop", written.clone()),
        ("transform", written.clone()),
        ("assemble", written),
        ("extract", generator.subschema_for::<Vec<String>>()),
        ("notes", generator.subschema_for::<BTreeMap<String, String>>()),
    ]);
    let mut definitions = generator.take_definitions(true);
    definitions.extend(commands.into_iter().map(|(name, schema)| (name.to_owned(), schema.to_value())));
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Results of strivec-pack with --json",
        "description": "What COMMAND prints is an instance of #/$defs/COMMAND.",
        "$defs": definitions,
    })
}
