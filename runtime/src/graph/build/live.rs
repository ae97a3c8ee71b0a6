//! Resolves the section `[live]`: which parameters may change while the graph runs, and how their nodes are built again.

use super::nodes::Builder;
use crate::graph::plan::{LiveParam, LivePlan, PlannedNode, Producer, Recipe};
use crate::graph::syntax::{LIVE, LiveEntry};
use crate::node::{NodeSpec, ParamSpec};
use crate::source::{Code, Diagnostic, Item, Value, quoted, suggest_name, suggestion};

/// Checks the entries of `[live]`, and returns the parameters that may change. Entries with a mistake are left out.
pub(crate) fn plan_live(builder: &mut Builder<'_>, nodes: &[PlannedNode]) -> LivePlan {
    let mut plan = LivePlan::default();
    let net = builder.net;
    if net.flat.live.is_empty() {
        return plan;
    }
    for entry in &net.flat.live {
        match resolve(builder, nodes, entry, &mut plan) {
            Ok(param) => plan.params.extend(param),
            Err(mistake) => builder.diagnostics.push(*mistake),
        }
    }
    plan.sources = builder.sources.clone();
    plan
}

/// Returns the parameter of an entry, or `None` if its node could not be built.
fn resolve(
    builder: &Builder<'_>,
    nodes: &[PlannedNode],
    entry: &LiveEntry,
    plan: &mut LivePlan,
) -> Result<Option<LiveParam>, Box<Diagnostic>> {
    let (net, name, place) = (builder.net, &entry.name.value, &entry.name.span);
    let mistake = |code: Code, message: String| Diagnostic::new(code, place.clone(), message);
    let Some((index, path)) = net.flat.param(name) else {
        let names = net.flat.nodes.iter().map(|node| node.name.as_str());
        let node = name.split('.').next().unwrap_or(name);
        let message = format!("`{name}` names no parameter of a node");
        let help = match suggest_name(node, names.clone()) {
            Some(near) => format!("a node with a similar name is `{near}`"),
            None => suggestion(node, names, "nodes"),
        };
        return Err(mistake(Code::UnknownKey, message).help(help).into());
    };
    let Some(spec) = net.spec(index) else { return Ok(None) };
    let node = &net.flat.nodes[index].name;
    if plan.params.iter().any(|param| param.name == *name) {
        let message = format!("`{name}` is listed twice in [{LIVE}]");
        return Err(mistake(Code::DuplicateName, message).help("remove one of the two").into());
    }
    let param = declared(spec, node, &path).map_err(|(code, message, help)| mistake(code, message).help(help))?;
    let Some(step) = nodes.iter().position(|planned| planned.index == index) else { return Ok(None) };
    let Some(recipe) = recipe(builder, index, step) else { return Ok(None) };
    let base = &recipe.configurations[0].0;
    let Some(value) = base.at(&path) else {
        let message = format!("the graph writes no value of `{name}`, from which a change could start");
        let help = format!("write `{} = …` in the block of `{node}`", path.join("."));
        return Err(mistake(Code::MissingKey, message).help(help).into());
    };
    let Some(number) = number(value) else {
        let help = format!("name one number in it, such as `{name}.NAME`");
        return Err(mistake(Code::BadValue, format!("`{name}` is not one number")).help(help).into());
    };
    let mut modes = recipe.configurations.iter().skip(1).filter_map(|(params, _)| params.at(&path));
    if let Some(other) = modes.find(|other| other.span != value.span) {
        let message = format!("a mode sets `{name}`, so it cannot change while the graph runs");
        let mistake = mistake(Code::NotLive, message).note(other.span.clone(), "the mode sets it here");
        return Err(mistake.help(format!("remove it from the mode, or from [{LIVE}]")).into());
    }
    let path: Vec<String> = path.into_iter().map(str::to_owned).collect();
    check_range(builder, entry, (&recipe, &path), (value, number))?;
    let known = plan.recipes.iter().position(|known| known.place == step);
    let at = known.unwrap_or(plan.recipes.len());
    plan.recipes.extend(known.is_none().then_some(recipe));
    let range = &entry.range;
    let (min, max, rate) = (range.min.value, range.max.value, range.rate);
    Ok(Some(LiveParam {
        name: name.clone(),
        unit: param.unit.clone(),
        min,
        max,
        rate,
        value: number,
        recipe: at,
        path,
    }))
}

/// Returns the declaration of a parameter that may change, or why it may not: the code, the message and a way out.
fn declared<'s>(spec: &'s NodeSpec, node: &str, path: &[&str]) -> Result<&'s ParamSpec, (Code, String, String)> {
    let (first, kind) = (path[0], &spec.name);
    let tunable = quoted(spec.params.iter().filter(|param| param.is_tunable).map(|param| param.name));
    let way_out = match tunable.as_str() {
        "" => format!("no parameter of `{kind}` can: remove the entry"),
        tunable => format!("of `{kind}`, these can: {tunable}"),
    };
    let found = spec.params.iter().find(|param| param.name == first);
    let refused = |why: &str| {
        Err((
            Code::NotLive,
            format!("`{first}` of `{node}` cannot change while the graph runs: {why}"),
            way_out.clone(),
        ))
    };
    match found {
        None => Err((Code::UnknownKey, format!("`{kind}` has no parameter `{first}`"), way_out)),
        Some(param) if param.is_tunable => Ok(innermost(param, path)),
        Some(param) if param.is_live => refused("the type of the node leaves it to the modes"),
        Some(_) => refused("it is fixed at load"),
    }
}

/// Returns the declaration of the innermost field on a path, whose unit is that of the number.
fn innermost<'s>(param: &'s ParamSpec, path: &[&str]) -> &'s ParamSpec {
    let inner = path.last().and_then(|last| param.fields.iter().find(|field| field.name == *last));
    inner.unwrap_or(param)
}

/// Returns how a node is built again; `None` if it or one of its variants has a mistake.
fn recipe(builder: &Builder<'_>, index: usize, place: usize) -> Option<Recipe> {
    let net = builder.net;
    let (kind, spec) = net.nodes[index]?;
    let (filled, wanted) = (builder.filled.get(&index)?, builder.wanted.get(&index)?);
    if filled.len() != wanted.len() {
        return None;
    }
    let configurations = filled.iter().cloned().zip(wanted.iter().cloned()).collect();
    let (given, ..) = builder.built.get(&index)?.clone();
    let period = builder.opened.shortest_period(net.roles_of(Producer::Node(index))).unwrap_or(builder.period);
    Some(Recipe { place, kind: net.catalogue.nodes()[kind].clone(), spec: spec.clone(), given, period, configurations })
}

/// Checks that the value in the file is in the range, and that the node accepts both ends of the range.
fn check_range(
    builder: &Builder<'_>,
    entry: &LiveEntry,
    (recipe, path): (&Recipe, &[String]),
    (value, number): (&Value, f64),
) -> Result<(), Box<Diagnostic>> {
    let (name, range) = (&entry.name.value, &entry.range);
    let (min, max) = (&range.min, &range.max);
    if number < min.value || number > max.value {
        let message = format!("the value {number} of `{name}` is outside of its range {} to {}", min.value, max.value);
        let mistake = Diagnostic::new(Code::BadValue, entry.name.span.clone(), message);
        let mistake = mistake.note(value.span.clone(), "its value is here");
        return Err(mistake.help(format!("change the value, or the range in [{LIVE}]")).into());
    }
    for (word, end) in [("min", min), ("max", max)] {
        if let Err(why) = recipe.build(&[(path, end.value)], &builder.sources) {
            let message = format!("`{name}` cannot be its `{word}`: {why}");
            return Err(Diagnostic::new(Code::BadValue, end.span.clone(), message).into());
        }
    }
    Ok(())
}

/// Returns a value as a number, if it is one.
fn number(value: &Value) -> Option<f64> {
    match value.item {
        Item::Float(number) => Some(number),
        Item::Integer(number) => Some(number as f64),
        _ => None,
    }
}
