//! Why a file is refused: what is wrong with it, and where.

use std::ops::Range;

/// What is wrong with a text, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextError {
    /// Byte range in the text.
    pub span: Range<usize>,
    /// What is wrong.
    pub message: String,
}

/// Why a file is refused.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// No format recognises it.
    Stranger,
    /// A text does not follow its format.
    Damaged {
        /// The text, decoded. A parser leaves it empty; [`FileFormat::read`](super::FileFormat::read) adds it.
        text: String,
        /// What is wrong, and where.
        flaws: Vec<TextError>,
    },
    /// A file that is not text does not follow its format.
    Broken {
        /// What is wrong.
        message: String,
        /// What to do instead, if that is known.
        help: Option<String>,
    },
    /// Neither the file nor a hint gives a property.
    Silent {
        /// What is missing.
        message: String,
        /// What to write in the bench.
        help: String,
    },
    /// A hint contradicts the file.
    Contradicted {
        /// Name of the hint.
        hint: &'static str,
        /// The value of the file.
        message: String,
    },
}

impl Refusal {
    /// Returns a refusal of a file that is not text.
    pub fn broken(message: impl Into<String>) -> Self {
        Self::Broken { message: message.into(), help: None }
    }
}

impl From<Vec<TextError>> for Refusal {
    fn from(flaws: Vec<TextError>) -> Self {
        Self::Damaged { text: String::new(), flaws }
    }
}

impl From<TextError> for Refusal {
    fn from(flaw: TextError) -> Self {
        vec![flaw].into()
    }
}
