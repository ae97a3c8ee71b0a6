//! Files that the catalogue brings along: `builtin:NAME` stands for a path wherever a file is read.
//!
//! They are what ships under `graphs/`, so that an example on any page runs in any folder.

use std::borrow::Cow;
use std::fs;

use tactflow_runtime::diagnostic::{Code, closest};
use tactflow_runtime::node::{At, FilePath, Mistake, Mistakes};

/// Every file, by its name behind `builtin:`.
pub const FILES: &[(&str, &[u8])] = &[
    ("finger_press.csv", include_bytes!("../../graphs/recordings/pressuRe/iscan_test.csv")),
    ("lwr4p.urdf", include_bytes!("../../graphs/robots/lwr4p.urdf")),
];

/// The bytes of a file, on disk or built in.
///
/// # Errors
/// When it cannot be read, or when no file of that name is built in.
pub fn read(file: &FilePath) -> Result<Cow<'static, [u8]>, Mistakes> {
    let Some(name) = file.builtin() else {
        return fs::read(&file.path).map(Cow::Owned).map_err(|error| Mistake::unreadable(file, &error).into());
    };
    let found = FILES.iter().find(|(other, _)| *other == name).map(|(_, bytes)| Cow::Borrowed(*bytes));
    found.ok_or_else(|| {
        let message = format!("no file `{name}` is built in");
        let help = closest(name, FILES.iter().map(|(name, _)| *name), "built-in files");
        Mistake::new(Code::Unreadable, At::Span(file.span.clone()), message).help(help).into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_not_built_in_is_a_mistake_with_a_way_out() {
        let file = |path: &str| FilePath { path: path.into(), span: 0..1 };
        assert!(read(&file("builtin:lwr4p.urdf")).unwrap().starts_with(b"<?xml"));
        let mistake = &read(&file("builtin:lwr4.urdf")).unwrap_err()[0];
        assert_eq!(mistake.message, "no file `lwr4.urdf` is built in");
        assert_eq!(mistake.help.as_deref(), Some("did you mean `lwr4p.urdf`?"));
    }
}
