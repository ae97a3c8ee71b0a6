//! The parameters of limiters that read a limit: those of the built-in parts.

/// A parameter that reads a limit in a built-in part.
#[derive(Debug, PartialEq, Eq)]
struct LimitReader {
    /// Type of the node.
    kind: String,
    param: String,
    limit: String,
}

/// Which parameter of which type of node enforces a limit, as the built-in parts wire them.
#[derive(Debug, Default)]
pub(crate) struct LimitReaders(Vec<LimitReader>);

impl LimitReaders {
    /// Reads the built-in parts among some files.
    pub(super) fn new(files: &[(&str, &[u8])]) -> Self {
        let files = files.iter().filter(|(name, _)| name.ends_with(".toml"));
        let parts = files.filter_map(|(_, bytes)| str::from_utf8(bytes).ok()?.parse::<toml::Table>().ok());
        let nodes = parts.filter_map(|mut part| table(part.remove("nodes")?)).flatten();
        Self(nodes.filter_map(|(_, node)| table(node)).flat_map(of_node).collect())
    }

    /// Returns the type of node, and its parameter, that read a limit.
    pub(crate) fn find(&self, limit: &str) -> Option<(&str, &str)> {
        self.0.iter().find(|reader| reader.limit == limit).map(|reader| (&*reader.kind, &*reader.param))
    }

    /// Returns the limit that a parameter of a type of node reads.
    pub(crate) fn limit_of(&self, kind: &str, param: &str) -> Option<&str> {
        self.0.iter().find(|reader| reader.kind == kind && reader.param == param).map(|reader| &*reader.limit)
    }

    /// Returns the limits that a type of node reads.
    pub(crate) fn limits_of(&self, kind: &str) -> impl Iterator<Item = &str> {
        self.0.iter().filter(move |reader| reader.kind == kind).map(|reader| &*reader.limit)
    }
}

fn table(value: toml::Value) -> Option<toml::Table> {
    value.try_into().ok()
}

/// Returns the parameters of a node that read a limit.
fn of_node(node: toml::Table) -> Vec<LimitReader> {
    let kind = node.get("type").and_then(toml::Value::as_str).unwrap_or_default().to_owned();
    let limit = |value: &toml::Value| Some(value.get("from")?.as_str()?.strip_prefix("limits.")?.to_owned());
    let params = node.into_iter().filter_map(|(param, value)| Some((param, limit(&value)?)));
    params.map(|(param, limit)| LimitReader { kind: kind.clone(), param, limit }).collect()
}
