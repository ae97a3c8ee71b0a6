//! Parses the section `[roles]`.

use super::correct::correct_keys;
use super::sections::Sections;
use crate::node::{Param, Spanned};
use crate::source::{Code, Diagnostic, Item, Named, Value};

impl Sections<'_> {
    /// Reads the types of roles, and the arms that carry them: `pad = { type = "tactile_pad", on = "arm" }`.
    pub(super) fn roles(&mut self, value: Option<&Value>) -> (Named<Spanned<String>>, Named<Spanned<String>>) {
        let (mut kinds, mut carriers) = (Vec::new(), Vec::new());
        for (mut key, value) in self.table(value).entries {
            self.check_name(&mut key);
            let Item::Table(mut table) = value.item else {
                kinds.extend(Spanned::read(&value, &mut self.reader).map(|kind| (key, kind)));
                continue;
            };
            correct_keys(&mut table, &["type", "on"], "", &mut self.reader);
            let mut word = |name: &str| table.get(name).and_then(|value| Spanned::read(value, &mut self.reader));
            let (kind, on) = (word("type"), word("on"));
            if table.get("type").is_none() {
                let message = format!("role `{}` has no `type`", key.name);
                self.diagnostics.push(Diagnostic::new(Code::MissingKey, key.span.clone(), message));
            }
            carriers.extend(on.map(|on| (key.clone(), on)));
            kinds.extend(kind.map(|kind| (key, kind)));
        }
        (kinds.into_iter().collect(), carriers.into_iter().collect())
    }
}
