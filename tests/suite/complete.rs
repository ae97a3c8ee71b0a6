//! Everything in the catalogue is documented to its end, and its example runs as it is shown.

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::cli::example;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::node::ParamSpec;
use tactflow_tests::catalogue;

/// What a node or a device says of itself.
struct Said {
    name: String,
    summary: String,
    doc: String,
    ports: Vec<(String, String)>,
    params: Vec<ParamSpec>,
}

fn everything(catalogue: &Catalogue) -> Vec<Said> {
    let nodes = catalogue.nodes().iter().map(|node| node.spec()).map(|spec| Said {
        name: spec.name.into_owned(),
        summary: spec.summary.into_owned(),
        doc: spec.doc.into_owned(),
        ports: spec
            .inputs
            .iter()
            .chain(&spec.outputs)
            .map(|port| (port.name.to_string(), port.doc.to_string()))
            .collect(),
        params: spec.params,
    });
    let devices = catalogue.devices().iter().map(|device| Said {
        name: device.name().into_owned(),
        summary: device.summary().into_owned(),
        doc: device.doc().into_owned(),
        ports: Vec::new(),
        params: device.params(),
    });
    nodes.chain(devices).collect()
}

/// What is missing, a line each.
fn missing(catalogue: &Catalogue, said: &Said) -> Vec<String> {
    let mut missing = Vec::new();
    let mut note = |is_missing: bool, what: String| missing.extend(is_missing.then_some(what));
    let is_summary = !said.summary.is_empty() && !said.summary.ends_with('.') && !said.summary.contains('\n');
    note(!is_summary, "a summary of one line without a full stop".into());
    note(said.doc.trim().is_empty(), "a DOC".into());
    for (port, doc) in &said.ports {
        note(doc.trim().is_empty(), format!("a doc of port `{port}`"));
    }
    params(&said.params, "", &mut note);
    match example(catalogue, &said.name) {
        Err(why) => note(true, format!("an example: {why}")),
        // The simulator is the reader's: `lockstep.rs` runs it with one.
        Ok(text) if text.contains("type = \"lockstep\"") => {}
        Ok(text) => match runs_anywhere(catalogue, &text, None) {
            Err(why) => note(true, format!("an example that runs:\n{why}\n{text}")),
            Ok(()) => defaults(catalogue, said, &text, &mut note),
        },
    }
    missing
}

fn params(specs: &[ParamSpec], path: &str, note: &mut impl FnMut(bool, String)) {
    for spec in specs {
        let name = format!("{path}{}", spec.name);
        note(spec.doc.trim().is_empty(), format!("a doc of parameter `{name}`"));
        let is_number = spec.takes.contains("a number") || spec.takes.contains("a rate");
        note(is_number && spec.fields.is_empty() && spec.unit.is_none(), format!("a unit of parameter `{name}`"));
        params(&spec.fields, &format!("{name}."), note);
    }
}

/// A default can be pasted where the parameter stands: it reads as the reference shows it.
fn defaults(catalogue: &Catalogue, said: &Said, text: &str, note: &mut impl FnMut(bool, String)) {
    let root: toml::Table = text.parse().expect("it has loaded");
    for section in ["nodes", "devices"] {
        let blocks = root.get(section).and_then(toml::Value::as_table).into_iter().flatten();
        for (block, _) in blocks.filter(|(_, block)| block["type"].as_str() == Some(&said.name)) {
            for param in &said.params {
                // One that is given in the example may be there because the default would not do.
                let is_given = root[section][block].get(param.name).is_some();
                let Some(default) = param.default.as_ref().filter(|_| !is_given) else { continue };
                let set = format!("{section}.{block}.{}={default}", param.name);
                note(runs_anywhere(catalogue, text, Some(&set)).is_err(), format!("a default that reads: {set}"));
            }
        }
    }
}

/// An example loads in a folder where nothing else is: what it needs is built in.
fn runs_anywhere(catalogue: &Catalogue, text: &str, set: Option<&str>) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    let request = Request { text: Some(text.to_owned()), ..Request::file(folder.path().join("try.toml")) };
    let request = set.map_or(request.clone(), |set| request.set(set));
    let plan = compile(catalogue, &request).map_err(|report| report.render(false))?;
    plan.warnings().map_or(Ok(()), |warnings| Err(warnings.render(false)))
}

#[test]
fn everything_is_documented_and_every_example_runs() {
    let catalogue = catalogue();
    let shipped = tactflow_nodes::catalogue();
    let is_shipped = |said: &Said| everything(&shipped).iter().any(|other| other.name == said.name);
    let mut wrong = Vec::new();
    for said in everything(&catalogue).iter().filter(|said| is_shipped(said) || !said.doc.is_empty()) {
        let missing = missing(&catalogue, said);
        if !missing.is_empty() {
            wrong.push(format!("`{}` lacks {}", said.name, missing.join("\n    and ")));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
