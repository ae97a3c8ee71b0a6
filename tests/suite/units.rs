//! Numbers with units in graph files: they have the bits of the plain numbers, in every parameter of the catalogue.

use std::collections::BTreeSet;
use std::path::Path;

use tactflow_runtime::graph::{Compiled, Outline, Request, Setting, compile};
use tactflow_runtime::node::{At, KnownUnits, Mistake, NodeSpec, ParamSpec, Reader};
use tactflow_runtime::signal::{
    FeaturesShape, ImageShape, Kind, RegionsShape, ScalarShape, Shape, Unit, VectorImageShape,
};
use tactflow_runtime::source::{Code, Item, SourceMap, Value, parse_table};
use tactflow_tests::catalogue;

use crate::tool::say;

/// Returns the texts of a value of a parameter: with its unit, and as a plain number. `None` if it takes no numbers.
fn texts(takes: &str, bounds: &ParamSpec, entry: (usize, usize)) -> Option<[String; 2]> {
    let list = |open: &str, close: &str, count: usize, rest: &str| {
        let entries: Option<Vec<_>> = (0..count).map(|i| texts(rest, bounds, (i, count))).collect();
        let entries = entries?;
        Some([0, 1].map(|i| {
            let texts: Vec<&str> = entries.iter().map(|entry| entry[i].as_str()).collect();
            format!("{open}{}{close}", texts.join(", "))
        }))
    };
    if let Some(rest) = takes.strip_prefix("a list, each ") {
        return list("[", "]", 2, rest);
    }
    if let Some((count, rest)) = takes.strip_prefix("a list of ").and_then(|rest| rest.split_once(", each ")) {
        return list("[", "]", count.parse().ok()?, rest);
    }
    if let Some(rest) = takes.strip_prefix("a table, for each name ") {
        return texts(rest, bounds, (0, 1)).map(|texts| texts.map(|text| format!("{{ x = {text} }}")));
    }
    let is_number = takes.starts_with("a number") || takes.starts_with("a whole number");
    let units = bounds.unit.as_deref().filter(|_| is_number)?.replace('²', "2").replace('³', "3");
    let units: Vec<&str> = units.split(", ").collect();
    let unit = units[entry.0 * units.len() / entry.1];
    let unit = if unit.starts_with('$') { "N".to_owned() } else { unit.replace(['U', 'E', 'V', '_'], "N") };
    let number = bounds.bounds.map_or(3.0, |bounds| if bounds.max < 3.0 { bounds.max } else { bounds.min.max(3.0) });
    Some([format!("\"{number} {unit}\""), number.to_string()])
}

/// Returns the table that sets one parameter, and what is nested in it, each with its path.
fn tables(specs: &[ParamSpec], open: &str, close: &str, tables: &mut Vec<(String, [String; 2])>) {
    for spec in specs {
        let more = format!("{open}{} = ", spec.name);
        if let Some(texts) = texts(&spec.takes, spec, (0, 1)) {
            tables.push((spec.name.to_owned(), texts.map(|text| format!("{more}{text}{close}"))));
        }
        let (inner, outer) = match spec.takes.as_str() {
            takes if takes.starts_with("a list") => ("[{ ", " }]"),
            takes if takes.starts_with("a table, for each name") => ("{ x = { ", " } }"),
            _ => ("{ ", " }"),
        };
        self::tables(&spec.fields, &format!("{more}{inner}"), &format!("{outer}{close}"), tables);
    }
}

/// The shapes of wires called `x`, all in newtons.
fn wires(spec: &NodeSpec) -> Vec<Vec<(String, Shape)>> {
    let wire = |kind: Kind, declared: Option<&str>| {
        let unit = if declared == Some("_/s") { Unit::NEWTON.per_second() } else { Unit::NEWTON };
        let shape: Shape = match kind {
            Kind::Features => FeaturesShape::new([("x", unit)]).into(),
            Kind::Regions => RegionsShape { unit, ..RegionsShape::default() }.into(),
            Kind::Image => ImageShape { unit, ..ImageShape::default() }.into(),
            Kind::VectorImage => VectorImageShape(ImageShape { unit, ..ImageShape::default() }).into(),
            _ => ScalarShape::of(unit).into(),
        };
        vec![("x".to_owned(), shape)]
    };
    spec.inputs.iter().map(|input| wire(input.kind, input.args.first().map(|unit| &**unit))).collect()
}

/// Reads a table of parameters, and returns the numbers that were read from texts with a unit.
fn numbers(text: &str, read: &dyn Fn(&Value, &mut Reader<'_>), units: KnownUnits<'_>) -> Result<Vec<Item>, String> {
    let mut sources = SourceMap::default();
    let table = parse_table(sources.add_file(Path::new("x.toml"), text)).unwrap_or_else(|_| panic!("{text}"));
    let mut reader = Reader::new(&sources).with_units(units);
    read(&table, &mut reader);
    let is_of_the_number = |mistake: &&Mistake| mistake.code != Code::MissingKey && matches!(mistake.at, At::Span(_));
    match reader.mistakes.iter().find(is_of_the_number) {
        Some(mistake) => Err(mistake.message.clone()),
        None => Ok(reader.measured.into_iter().map(|(_, item)| item).collect()),
    }
}

#[test]
fn every_parameter_of_the_catalogue_accepts_its_own_unit() {
    let catalogue = catalogue();
    let (mut refused, mut accepted) = (BTreeSet::new(), 0);
    let params = parse_table(SourceMap::default().add_file(Path::new("p.toml"), "unit = \"N\"")).unwrap();
    let mut check =
        |owner: &str, specs: &[ParamSpec], units: KnownUnits<'_>, read: &dyn Fn(&Value, &mut Reader<'_>)| {
            let mut found = Vec::new();
            tables(specs, "", "", &mut found);
            for (name, [measured, _]) in found {
                match numbers(&measured, read, units) {
                    Ok(numbers) if numbers.is_empty() => panic!("{owner}: {measured} is not read"),
                    Ok(_) => accepted += 1,
                    Err(message) => drop(refused.insert(format!("{owner}.{name}: {message}"))),
                }
            }
        };
    for node in catalogue.nodes() {
        let spec = node.spec();
        let wires = wires(&spec);
        let units = KnownUnits::of_params(&params, &spec.params).with_wires(&spec.inputs, &wires, false);
        check(&spec.name, &spec.params, units, &|table, reader| drop(node.configure(table, reader)));
    }
    for device in catalogue.devices() {
        let specs = device.params();
        let units = KnownUnits::of_params(&params, &specs);
        check(&device.name(), &specs, units, &|table, reader| drop(device.open(table, reader)));
    }
    // The units of a `process` are those that its program states.
    let refused: Vec<&str> =
        refused.iter().map(String::as_str).filter(|refused| !refused.starts_with("process.")).collect();
    let damping = "ik_sink.damping: the unit of this number [1, m] is not known here, so it cannot be converted";
    assert_eq!(refused, [damping], "its unit depends on the motion");
    assert!(accepted > 150, "only {accepted} parameters");
}

fn loaded(sets: &[&str]) -> Compiled {
    let request = sets.iter().fold(tactflow_tests::on_the_mock_bench("hybrid.toml"), |request, set| request.set(*set));
    compile(&catalogue(), &request).unwrap()
}

/// The values of all settings, with whole numbers as numbers.
fn values(outline: &Outline) -> Vec<(String, String)> {
    let blocks = outline.nodes.iter().chain(&outline.devices).map(|block| (block.name.as_str(), &block.settings));
    let modes = outline.modes.iter().map(|mode| (mode.name.as_str(), &mode.settings));
    let sections = [("graph", &outline.settings), ("policy", &outline.policy)];
    let text = |setting: &Setting| setting.value.read::<toml::Value>().map_or_else(String::new, |value| bits(&value));
    let all = blocks.chain(modes).chain(sections);
    all.flat_map(|(name, all)| all.iter().map(move |one| (format!("{name}.{}", one.path), text(one)))).collect()
}

fn bits(value: &toml::Value) -> String {
    match value {
        toml::Value::Integer(number) => format!("{:x}", (*number as f64).to_bits()),
        toml::Value::Float(number) => format!("{:x}", number.to_bits()),
        toml::Value::Array(items) => items.iter().map(bits).collect::<Vec<_>>().join(","),
        other => other.to_string(),
    }
}

/// Each value plain and with another unit, wherever a file may have a number.
const SAME: [[&str; 2]; 24] = [
    ["graph.reset_after_ms=0.03e3", "graph.reset_after_ms=0.03 s"],
    ["graph.max_gap_ms=40", "graph.max_gap_ms=40ms"],
    ["policy.max_age_ms=60000", "policy.max_age_ms=1 min"],
    ["policy.roles.pad.max_age_ms=300", "policy.roles.pad.max_age_ms=0.3 s"],
    ["limits.force_n=14.5", "limits.force_n=14500 mN"],
    ["limits.linear_m_per_s=0.04", "limits.linear_m_per_s=40 mm/s"],
    ["limits.linear_m_per_s2=1.9", "limits.linear_m_per_s2=1.9 m/s²"],
    ["limits.lead_rad=0.06981317007977318", "limits.lead_rad=4 deg"],
    ["limits.workspace_min_m=[-0.75, -0.4, 0.1]", "limits.workspace_min_m=['-75 cm', -0.4, '100 mm']"],
    ["devices.pad.rate_hz=200", "devices.pad.rate_hz=0.2 kHz"],
    ["devices.pad.pitch=0.0045", "devices.pad.pitch=4.5 mm"],
    ["devices.pad.threshold=0.014", "devices.pad.threshold=14 mN"],
    ["nodes.pid.gains.x.kp=1.7", "nodes.pid.gains.x.kp=1.7 1/s"],
    ["nodes.pid.gains.x.bound=0.03", "nodes.pid.gains.x.bound=30 mm/s"],
    ["nodes.pid.gains.x.within=0.002", "nodes.pid.gains.x.within=0.2 cm"],
    ["nodes.error.setpoint.x=0.001", "nodes.error.setpoint.x=1 mm"],
    ["nodes.error.setpoint.pressure=0.09", "nodes.error.setpoint.pressure=90 mN/tactel"],
    [
        "nodes.jacobian.columns.x=[-0.9, 0, 0, 0, -20, 0]",
        "nodes.jacobian.columns.x=['-0.9 m/m', 0, 0, 0, '-20 rad/m', 0]",
    ],
    ["nodes.reach.twist=[0, 0, 0, 0, 0, 0.017453292519943295]", "nodes.reach.twist=[0, '0 mm/s', 0, 0, 0, '1 deg/s']"],
    ["parts.touch.set.label.min_area=5", "parts.touch.set.label.min_area=5 tactel"],
    [
        "modes.approach.set.reach.twist=[0, 0, 0.012, 0, 0, 0]",
        "modes.approach.set.reach.twist=[0, 0, '12 mm/s', 0, 0, 0]",
    ],
    ["modes.approach.fail.after_ms=9000", "modes.approach.fail.after_ms=9 s"],
    ["modes.approach.fail.after_travel_mm=55", "modes.approach.fail.after_travel_mm=5.5 cm"],
    [
        "modes.approach.go={ to = 'servo', when = 'touch.pressure', above = 0.05, hysteresis = 0.01, for_ms = 30 }",
        "modes.approach.go={ to = 'servo', when = 'touch.pressure', above = '50 mN/tactel', hysteresis = '10mN/tactel', for_ms = '0.03 s' }",
    ],
];

#[test]
fn a_number_with_a_unit_has_the_bits_of_the_plain_number() {
    let [plain, measured] = [0, 1].map(|i| loaded(&SAME.map(|pair| pair[i])));
    let [plain_values, measured_values] = [&plain, &measured].map(|plan| values(plan.outline()));
    assert_eq!(plain_values, measured_values);
    let unset = values(loaded(&[]).outline());
    for [plain, _] in SAME {
        let changed = values(loaded(&[plain]).outline());
        assert!(changed != unset, "{plain} changes nothing");
    }
    let text = |plan: &Compiled| plan.outline().modes.iter().map(|mode| format!("{mode:?}")).collect::<String>();
    assert!(text(&measured).contains("50 mN/tactel") && !text(&plain).contains("mN"));
}

#[test]
fn show_prints_the_number_and_what_is_written() {
    let sets = SAME.map(|[_, measured]| format!("--set={measured}"));
    let args = ["show", "graphs/hybrid.toml", "--bench=graphs/benches/mock.toml"];
    let args: Vec<&str> = args.into_iter().chain(sets.iter().map(String::as_str)).collect();
    let shown = say(&args);
    assert_eq!((shown.code, shown.err.as_str()), (0, ""));
    let lines = [
        "min_m = [-0.75, -0.4, 0.1] # command line, written [\"-75 cm\", -0.4, \"100 mm\"]",
        "reset_after_ms = 30 # command line, written \"0.03 s\"",
        "setpoint.x = 0.001 # command line, written \"1 mm\"",
        "gains.x.kp = 1.7 # command line, written \"1.7 1/s\"",
        "set.reach.twist = [0, 0, 0.012, 0, 0, 0] # command line, written [0, 0, \"12 mm/s\", 0, 0, 0]",
        "fail = { after_ms = 9000, after_travel_mm = 55,",
        "go = { to = \"servo\", when = \"touch.pressure\", for_ms = 30, above = 0.05, hysteresis = 0.01 }",
    ];
    let spaced: Vec<String> =
        shown.out.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    for line in lines {
        assert!(spaced.iter().any(|shown| shown.starts_with(line)), "{line}\n{}", shown.out);
    }
}

#[test]
fn each_instance_of_a_part_reads_a_number_in_its_own_unit() {
    let part = "[inputs]\nimage = \"an image\"\n[exports]\nmask = \"touched.mask\"\n[nodes.touched]\ntype = \"binarize\"\n\
                in.image = \"inputs.image\"\nthreshold = { from = \"pad.threshold\" }\n";
    let folder = tempfile::tempdir().unwrap();
    let (part_file, graph) = (folder.path().join("part.toml"), folder.path().join("graph.toml"));
    let own = part.replace("{ from = \"pad.threshold\" }", "\"20 mN\"");
    std::fs::write(&part_file, own).unwrap();
    let text = "[graph]\nclock = \"pad\"\n[roles]\npad = \"tactile_pad\"\n[bind]\npad = \"pad\"\n[devices.pad]\n\
                type = \"mock_pad\"\n[parts.one]\nfile = \"part.toml\"\nin.image = \"pad.image\"\n[parts.two]\n\
                file = \"part.toml\"\nin.image = \"pad.image\"\n[nodes.either]\ntype = \"label\"\nin.mask = \"one.mask\"\n\
                in.image = \"pad.image\"\n";
    std::fs::write(&graph, text).unwrap();
    let plan = compile(&catalogue(), &Request::file(&graph)).unwrap();
    for node in plan.outline().nodes.iter().filter(|node| node.name.ends_with("touched")) {
        let threshold = node.settings.iter().find(|setting| setting.path == "threshold").unwrap();
        assert_eq!(threshold.value.item, Item::Float(0.02), "{}", node.name);
    }
    let raw = compile(&catalogue(), &Request::file(&graph).set("devices.pad.unit=raw")).err().unwrap();
    assert!(format!("{raw:?}").contains("expected a raw reading [raw], found `20 mN`, a force"), "{raw:?}");
}

/// Returns the text that a help suggests in place of the marked one.
fn suggestion(help: &str) -> Option<&str> {
    let (_, rest) = help.split_once('`')?;
    let (text, _) = rest.split_once('`')?;
    (help.starts_with("write") || help.starts_with("did you mean")).then_some(text)
}

#[test]
fn every_suggested_number_works() {
    let files = ["units", "units_of_devices", "units_of_sections", "units_of_wires"];
    let mut count = 0;
    for file in files {
        let path = Path::new("errors").join(format!("{file}.toml"));
        let text = std::fs::read_to_string(&path).unwrap();
        let report =
            |text: String| compile(&catalogue(), &Request { text: Some(text), ..Request::file(&path) }).err().unwrap();
        let before = report(text.clone());
        for diagnostic in &before.diagnostics {
            let Some(suggested) = diagnostic.help.as_deref().and_then(suggestion) else { continue };
            let place = before.sources.file_at(diagnostic.span.start).local(&diagnostic.span);
            let mended = format!("{}{suggested}{}", &text[..place.start], &text[place.end..]);
            let after = report(mended);
            let is_left = after.diagnostics.iter().any(|other| other.span.start == diagnostic.span.start);
            assert!(!is_left, "{file}: `{suggested}` does not mend: {}", diagnostic.message);
            count += 1;
        }
    }
    assert!(count > 30, "only {count} suggestions");
}

#[test]
fn a_limit_that_several_nodes_read_has_one_mistake() {
    for (key, value) in [("linear_m_per_s2", "15 mm"), ("angular_rad_per_s2", "3 deg/s"), ("force_n", "15 mm")] {
        let request = tactflow_tests::on_the_mock_bench("hybrid.toml").set(format!("limits.{key}={value}"));
        let report = compile(&catalogue(), &request).err().unwrap();
        let places: Vec<String> =
            report.diagnostics.iter().map(|one| format!("{}: {}", one.code, one.message)).collect();
        assert_eq!(places.len(), 1, "{key}: {places:?}");
        assert_eq!(report.sources.file_at(report.diagnostics[0].span.start).name, SourceMap::COMMAND_LINE);
    }
}

#[test]
fn the_bounds_of_a_scenario_may_have_units() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scenario.toml");
    let verified = |checks: &str| {
        let tests = tactflow_tests::workspace().join("tests/scenarios");
        let [graph, bench] = ["tasks/slide.toml", "benches/slide.toml"].map(|name| tests.join(name));
        let head = format!("[scenario]\ngraph = {graph:?}\nbench = {bench:?}\nseeds = 1\n");
        std::fs::write(&file, head + checks).unwrap();
        let verified = say(&["verify", file.to_str().unwrap(), "--format=json"]);
        (verified.code, verified.out, verified.err)
    };
    let check = |for_s: &str, above: &str, below: &str, mean: &str| {
        verified(&format!(
            "for_s = {for_s}\n[check.force]\nof = \"truth.force\"\nnever_above = {above}\nnever_below = {below}\n\
             std_below = 3.0\npaper = {{ std = {mean} }}\n"
        ))
    };
    let plain = check("4.0", "3.0", "0.0", "0.125");
    assert_eq!(plain, check("\"4000 ms\"", "\"3000 mN\"", "\"0 kN\"", "\"125 mN\""));
    assert_eq!(plain.0, 0, "{plain:?}");
    assert_ne!(plain, check("4.0", "\"2999 mN\"", "0.0", "0.125"));
}
