//! Parameters that are words.

/// Declares a parameter that is one of a few words.
macro_rules! words {
    ($(#[$doc:meta])* $Name:ident {
        $(#[$first_doc:meta])* $First:ident = $first:literal,
        $($(#[$other_doc:meta])* $Other:ident = $other:literal),* $(,)?
    }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $Name { $(#[$first_doc])* $First, $($(#[$other_doc])* $Other),* }

        impl std::fmt::Display for $Name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(match self { Self::$First => $first, $(Self::$Other => $other),* })
            }
        }

        impl tactflow_runtime::node::Param for $Name {
            const EXPECTS: &'static str = concat!("one of `", $first, "`" $(, ", `", $other, "`")*);

            fn read(
                value: &tactflow_runtime::source::Value,
                reader: &mut tactflow_runtime::node::Reader<'_>,
            ) -> Option<Self> {
                let word: String = tactflow_runtime::node::read_leaf(value, reader, Self::EXPECTS)?;
                match word.as_str() {
                    $first => Some(Self::$First),
                    $($other => Some(Self::$Other),)*
                    _ => {
                        reader.wrong_type(value, Self::EXPECTS);
                        None
                    }
                }
            }
        }
    };
}
