//! Tables of a file that are changed in place. Their comments stay.

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

/// Returns a list of tables as it stands in a file, without the section around it.
pub(crate) fn headed(section: &[&str], key: &str, tables: ArrayOfTables) -> String {
    let inner = (key, Item::ArrayOfTables(tables));
    let outer = section.iter().rev().fold(inner, |(key, item), name| {
        let mut table = Table::new();
        table.set_implicit(true);
        table.insert(key, item);
        (name, Item::Table(table))
    });
    let mut text = DocumentMut::new();
    text.insert(outer.0, outer.1);
    text.to_string().trim().to_owned()
}

/// Changes a table into another one. What is equal stays as it is written, and so do the comments around the rest.
pub(super) fn update(old: &mut Table, new: &Table) {
    old.retain(|key, _| new.contains_key(key));
    for (key, new) in new {
        let above = comments(old, key);
        match (old.get_mut(key), new) {
            (Some(known), new) if plain(known) == plain(new) => {}
            (Some(Item::Table(known)), Item::Table(new)) => update(known, new),
            (Some(Item::Value(known)), Item::Value(new)) => {
                let decor = known.decor().clone();
                *known = new.clone();
                *known.decor_mut() = decor;
            }
            (_, new) => {
                let mut new = new.clone();
                if let (Some(above), Item::Table(new)) = (above, &mut new) {
                    new.decor_mut().set_prefix(format!("\n{above}"));
                }
                old.insert(key, new);
            }
        }
    }
}

/// Returns what an item says, however it is written.
fn plain(item: &Item) -> Option<toml::Value> {
    let text = match item {
        Item::Value(value) => format!("it = {}", value.clone().decorated("", "")),
        Item::Table(table) => table.to_string(),
        _ => return None,
    };
    let found: toml::Table = toml::from_str(&text).ok()?;
    Some(if item.is_table() { toml::Value::Table(found) } else { found["it"].clone() })
}

/// Returns the comments above a key, and those within and behind its value, as lines above what takes its place.
pub(super) fn comments(table: &dyn TableLike, key: &str) -> Option<String> {
    let above = table.key(key)?.leaf_decor().prefix().and_then(|raw| raw.as_str()).unwrap_or_default();
    let value = table.get(key)?.as_value()?;
    let within = decors(value);
    let lines = within.iter().flat_map(|raw| raw.lines()).map(str::trim).filter(|line| line.starts_with('#'));
    Some(lines.fold(above.to_owned(), |text, line| text + line + "\n"))
}

/// Returns what stands around and within a value.
fn decors(value: &Value) -> Vec<String> {
    let text = |raw: Option<&str>| raw.unwrap_or_default().to_owned();
    let [before, behind] =
        [value.decor().prefix(), value.decor().suffix()].map(|raw| text(raw.and_then(|raw| raw.as_str())));
    let mut found = vec![before];
    match value {
        Value::Array(list) => {
            found.extend(list.iter().flat_map(decors));
            found.push(text(list.trailing().as_str()));
        }
        Value::InlineTable(table) => found.extend(table.iter().flat_map(|(_, value)| decors(value))),
        _ => {}
    }
    found.push(behind);
    found
}
