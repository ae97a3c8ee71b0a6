//! Misspelt keys of sections and blocks: each is reported once, and what it holds is read as it was meant.

use super::reserved::{INPUTS, is_name};
use crate::node::{At, Mistake, Reader};
use crate::source::{Code, Item, Key, Meant, Table, Value, suggest_name};

/// Sections with a block for each name.
const REPEATED: [&str; 4] = ["nodes", "parts", "modes", "devices"];

/// Reports each key of a table that is not `known`, and gives it the name that it misspells. `place` ends the message,
/// for example ` in a mode`.
pub(super) fn correct_keys(table: &mut Table, known: &[&str], place: &str, reader: &mut Reader<'_>) {
    for (key, meant) in table.correct(known) {
        report(&key, meant, known, place, reader);
    }
}

/// Corrects the names of the sections of a file. A name that resembles none is recognized by what the section holds.
pub(super) fn correct_sections(root: &mut Table, known: &[&str], reader: &mut Reader<'_>) {
    separate_names(root, known, reader);
    move_blocks(root, known, reader);
    for (key, meant) in root.correct(known) {
        let guess = || root.get(&key.name).and_then(|value| guess_section(value, root, known));
        let guessed = if meant == Meant::Unknown { guess() } else { None };
        report(&key, guessed.map_or(meant, Meant::Free), known, "", reader);
        if let Some((name, (_, value))) = guessed.and_then(|name| Some((name, root.remove(&key.name)?))) {
            root.merge(Table { entries: vec![(Key { name: name.to_owned(), span: key.span }, value)] });
        }
    }
}

/// Separates the name of a section from that of a block where the dot between them is missing: `[nodespid]`.
fn separate_names(root: &mut Table, known: &[&str], reader: &mut Reader<'_>) {
    let parts = |key: &Key, value: &Value| {
        let section = REPEATED.into_iter().find(|section| known.contains(section) && key.name.starts_with(section))?;
        let name = key.name[section.len()..].trim_start_matches(['_', '-', ':', '/']);
        let block = (Key { name: name.to_owned(), span: key.span.clone() }, value.clone());
        let value = Value { span: value.span.clone(), item: Item::Table(Table { entries: vec![block] }) };
        (is_name(name) && could_be(section, &value)).then_some((section, name.to_owned(), value))
    };
    let unknown = root.entries.iter().filter(|(key, _)| !known.contains(&&*key.name));
    let found: Vec<_> = unknown.filter_map(|(key, value)| Some((key.clone(), parts(key, value)?))).collect();
    for (key, (section, name, value)) in found {
        root.remove(&key.name);
        let message = format!("unknown key `{}`", key.name);
        let mistake = Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message);
        reader.mistakes.push(mistake.instead(&key.name, &format!("{section}.{name}")));
        root.merge(Table { entries: vec![(Key { name: section.to_owned(), span: key.span }, value)] });
    }
}

/// Moves blocks to the section that they are for from one that has none: `[limits.servo]` with the exits of a mode.
fn move_blocks(root: &mut Table, known: &[&str], reader: &mut Reader<'_>) {
    let mut moved = Vec::new();
    let flat = root.entries.iter_mut().filter(|(key, _)| ["graph", "roles", "limits", "bind"].contains(&&*key.name));
    for (key, value) in flat {
        let Item::Table(table) = &mut value.item else { continue };
        let is_roles = key.name == "roles";
        table.entries.retain(|(name, block)| {
            if is_roles && block.as_table().is_some_and(is_role) {
                return true;
            }
            let entries = vec![(name.clone(), block.clone())];
            let alone = Value { span: block.span.clone(), item: Item::Table(Table { entries }) };
            let is_meant = |section: &&str| known.contains(section) && could_be(section, &alone);
            let Some(section) = REPEATED.into_iter().find(is_meant) else { return true };
            let message = format!("`{}` is a block of [{section}], but it is in [{}]", name.name, key.name);
            let mistake = Mistake::new(Code::UnknownKey, At::Span(name.span.clone()), message);
            reader.mistakes.push(mistake.help(format!("write `[{section}.{}]`", name.name)));
            moved.push((Key { name: section.to_owned(), span: name.span.clone() }, alone));
            false
        });
    }
    moved.into_iter().for_each(|entry| root.merge(Table { entries: vec![entry] }));
}

/// Returns whether a table declares a role, and no node.
fn is_role(table: &Table) -> bool {
    table.entries.iter().all(|(key, _)| ["type", "on"].contains(&&*key.name))
}

fn report(key: &Key, meant: Meant<'_>, known: &[&str], place: &str, reader: &mut Reader<'_>) {
    let message = format!("unknown key `{}`{place}", key.name);
    let mistake = Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message);
    reader.mistakes.push(mistake.meant(&key.name, meant, known, "keys"));
}

/// Returns the only section that holds such values and that the file lacks or may have in several places.
fn guess_section<'n>(value: &Value, root: &Table, known: &[&'n str]) -> Option<&'n str> {
    let holds = |section: &&&str| {
        let is_repeated = REPEATED.contains(section);
        // The blocks of nodes and devices look alike.
        let is_device = **section == "devices" && known.contains(&"nodes");
        (is_repeated || root.get(section).is_none()) && !is_device && could_be(section, value)
    };
    let mut found = known.iter().filter(holds);
    found.next().filter(|_| found.next().is_none()).copied()
}

/// Returns whether a value could be the content of a section.
fn could_be(section: &str, value: &Value) -> bool {
    let Some(table) = value.as_table().filter(|table| !table.entries.is_empty()) else { return false };
    let each = |test: &dyn Fn(&Value) -> bool| table.entries.iter().all(|(_, value)| test(value));
    let has = |names: &'static [&'static str]| {
        move |value: &Value| value.as_table().is_some_and(|table| names.iter().any(|name| table.get(name).is_some()))
    };
    let is_word = |value: &Value| value.as_str().is_some_and(|text| !text.contains(['.', ' ']));
    match section {
        "graph" => has(&["clock", "rate_hz", "bench", "start"])(value),
        "nodes" | "devices" => each(&has(&["type"])),
        "parts" => each(&has(&["file"])),
        "modes" => each(&has(&["go", "on_lost", "done", "fail", "set"])),
        "roles" => each(&|value| is_word(value) || value.as_table().is_some_and(is_role)),
        "bind" => each(&|value| is_word(value) || is_port(value)) && !each(&is_port),
        "commands" => {
            each(&|value| value.as_table().is_some_and(|table| table.entries.iter().all(|(_, v)| is_port(v))))
        }
        "exports" => each(&is_port),
        "inputs" => each(&|value| value.as_str().is_some_and(|text| text.contains(' '))),
        "limits" => each(&|value| matches!(value.item, Item::Integer(_) | Item::Float(_) | Item::Array(_))),
        _ => false,
    }
}

/// Corrects the keys `type` and `in` of a block. Its other keys depend on its type, so what they hold must fit.
///
/// `names` are those that a wire in this file can read.
pub(super) fn correct_block(table: &mut Table, names: &[String], reader: &mut Reader<'_>) {
    if table.get("type").is_none() {
        let is_word = |value: &Value| value.as_str().is_some_and(|text| !text.contains(['.', '/', ' ']));
        let words = || table.entries.iter().filter(|(_, value)| is_word(value)).map(|(key, _)| key.name.as_str());
        let is_close = |name: &&str| suggest_name(name, std::iter::once("type")).is_some();
        if let Some(name) = words().find(is_close).or_else(|| words().next()).map(str::to_owned) {
            rename(table, &name, "type", reader);
        }
    }
    correct_wires(table, names, reader);
    for (key, value) in &mut table.entries {
        match &mut value.item {
            // A wire has any name, so only what stands in it is corrected.
            Item::Table(wires) if key.name == "in" => {
                wires.entries.iter_mut().for_each(|(_, wire)| correct_facts(wire, reader));
            }
            _ => correct_facts(value, reader),
        }
    }
}

/// Corrects the key `in` of a block: it holds only ports of the given nodes, roles and parts.
pub(super) fn correct_wires(table: &mut Table, names: &[String], reader: &mut Reader<'_>) {
    let is_known = |value: &Value| {
        let name = value.as_str().and_then(|text| text.split('.').next()).unwrap_or_default();
        is_port(value) && (name == INPUTS || names.iter().any(|known| known == name))
    };
    let is_wires = |(key, value): &&(Key, Value)| {
        let is_close = suggest_name(&key.name, std::iter::once("in")).is_some();
        let mut wires = value.as_section().into_iter().flat_map(|table| &table.entries);
        let fits: &dyn Fn(&Value) -> bool = if is_close { &is_port } else { &is_known };
        key.name != "in"
            && value.as_section().is_some_and(|table| !table.entries.is_empty())
            && wires.all(|(_, wire)| fits(wire))
    };
    let wrong: Vec<String> = table.entries.iter().filter(is_wires).map(|(key, _)| key.name.clone()).collect();
    wrong.iter().for_each(|name| rename(table, name, "in", reader));
}

/// Separates `in` from the name of an input of a part where the dot between them is missing: `inimage`.
pub(super) fn separate_wires(table: &mut Table, reader: &mut Reader<'_>) {
    let input = |(key, value): &(Key, Value)| {
        let name = key.name.strip_prefix("in")?.trim_start_matches(['_', '-', ':', '/']);
        (is_name(name) && is_port(value)).then(|| (key.clone(), name.to_owned()))
    };
    let found: Vec<(Key, String)> = table.entries.iter().filter_map(input).collect();
    for (key, name) in found {
        let Some((_, value)) = table.remove(&key.name) else { continue };
        let mistake = Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), format!("unknown key `{}`", key.name));
        reader.mistakes.push(mistake.instead(&key.name, &format!("in.{name}")));
        let wire = Table { entries: vec![(Key { name, span: key.span.clone() }, value)] };
        let wires = Value { span: key.span.clone(), item: Item::Table(wire) };
        table.merge(Table { entries: vec![(Key { name: "in".to_owned(), span: key.span }, wires)] });
    }
}

/// Corrects the key `file` of a part: the only one that holds the name of a file.
pub(super) fn correct_part_file(table: &mut Table, reader: &mut Reader<'_>) {
    let is_file = |(_, value): &&(Key, Value)| value.as_str().is_some_and(|text| text.ends_with(".toml"));
    let found = table.entries.iter().find(is_file).map(|(key, _)| key.name.clone());
    if let Some(name) = found.filter(|_| table.get("file").is_none()) {
        rename(table, &name, "file", reader);
    }
}

/// Corrects the key `what` of a device, which names the file of its robot or of its sensor.
pub(super) fn correct_model(table: &mut Table, what: &'static str, reader: &mut Reader<'_>) {
    let is_file = |value: &Value| value.as_str().is_some_and(|text| text.ends_with(".toml"));
    let is_close = |name: &str| suggest_name(name, std::iter::once(what)).is_some();
    let found = table.entries.iter().find(|(key, value)| key.name != what && is_file(value) && is_close(&key.name));
    if let Some(name) = found.map(|(key, _)| key.name.clone()).filter(|_| table.get(what).is_none()) {
        rename(table, &name, what, reader);
    }
}

/// Reports the key `from` of a table and gives it the name `to`.
fn rename(table: &mut Table, from: &str, to: &'static str, reader: &mut Reader<'_>) {
    let Some((key, value)) = table.remove(from) else { return };
    report(&key, Meant::Free(to), &[], "", reader);
    table.merge(Table { entries: vec![(Key { name: to.to_owned(), span: key.span }, value)] });
}

/// Corrects the key `from` of the facts in a value.
pub(super) fn correct_facts(value: &mut Value, reader: &mut Reader<'_>) {
    match &mut value.item {
        Item::Array(items) => items.iter_mut().for_each(|item| correct_facts(item, reader)),
        Item::Table(table) => {
            if let [(key, inner)] | [(key, inner), _] = table.entries.as_mut_slice()
                && key.name != "from"
                && is_port(inner)
                && suggest_name(&key.name, std::iter::once("from")).is_some()
            {
                report(key, Meant::Free("from"), &[], "", reader);
                "from".clone_into(&mut key.name);
            }
            table.entries.iter_mut().for_each(|(_, value)| correct_facts(value, reader));
        }
        _ => {}
    }
}

/// Returns whether a value has the form `name.name`, or is a wire with an age limit.
fn is_port(value: &Value) -> bool {
    let is_name = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    match &value.item {
        Item::String(text) => text.split_once('.').is_some_and(|(node, port)| is_name(node) && is_name(port)),
        Item::Table(table) => table.get("max_age_ms").is_some(),
        _ => false,
    }
}
