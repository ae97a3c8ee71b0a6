//! `tekscan_movie`: a recording in Tekscan's ASCII format as a pad.
//!
//! The file is read whole when the device is opened, so a mistake in it shows before anything runs. Frames come at the
//! times of their header lines; those between two exchanges are skipped but for the newest, and none is served twice.

mod header;
mod parse;

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Filled, Opened, Samples, Stepped};
use tactflow_runtime::diagnostic::Code;
use tactflow_runtime::node::{At, FilePath, Mistake, Mistakes};
use tactflow_runtime::params;
use tactflow_runtime::signal::Image;

pub use parse::{Flaw, Frame, Movie, parse};

params! {
    /// The recording.
    file: FilePath,
}

/// A movie that is being shown.
#[derive(Debug)]
pub struct TekscanMovie {
    movie: Movie,
    next: usize,
}

impl Device for TekscanMovie {
    type Params = Params;

    const NAME: &'static str = "tekscan_movie";
    const SUMMARY: &'static str = "a recording in Tekscan's ASCII format as a pad";

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let file = params.file;
        let bytes = file.bytes()?;
        let movie = read(&bytes).map_err(|refusal| refusal.into_mistakes(&file))?;
        let filled = Filled {
            role: "tactile_pad".into(),
            outputs: vec![movie.shape.clone().into()],
            commands: vec![],
            facts: facts(&movie),
        };
        let description = Description { fills: vec![filled], period: movie.period };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(Self { movie, next: 0 })) })
    }
}

impl Stepped for TekscanMovie {
    fn next(&self) -> Option<i64> {
        self.movie.frames.get(self.next).map(|frame| frame.time)
    }

    fn end(&self) -> Option<i64> {
        self.movie.frames.last().map(|frame| frame.time)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        let left = &self.movie.frames[self.next..];
        let due = left.partition_point(|frame| frame.time <= now);
        if due > 0 {
            self.next += due;
            let newest = self.next - 1;
            let Frame { number, time } = self.movie.frames[newest];
            let tactels = self.movie.shape.tactels();
            let cells = &self.movie.cells[newest * tactels..][..tactels];
            samples.write::<Image>(0, time, number).cells_mut().copy_from_slice(cells);
        }
        Ok(())
    }
}

fn facts(movie: &Movie) -> Vec<(std::borrow::Cow<'static, str>, toml::Value)> {
    let cols = movie.shape.cols;
    let place = |index: &usize| toml::Value::from(vec![(index / cols) as i64, (index % cols) as i64]);
    let dead: Vec<toml::Value> = movie.dead.iter().map(place).collect();
    let mut facts = vec![("dead".into(), dead.into()), ("frames".into(), (movie.frames.len() as i64).into())];
    if let Some(threshold) = movie.threshold {
        facts.push(("threshold".into(), threshold.into()));
    }
    facts
}

/// Why a file is no movie.
#[derive(Debug)]
enum Refusal {
    /// It is something else altogether.
    Stranger,
    /// It is one, but damaged.
    Damaged { text: String, flaws: Vec<Flaw> },
}

impl Refusal {
    fn into_mistakes(self, file: &FilePath) -> Mistakes {
        match self {
            Self::Stranger => {
                let message = format!("`{}` is not a Tekscan ASCII movie", file.path.display());
                let mistake = Mistake::new(Code::BadData, At::Span(file.span.clone()), message);
                mistake.help("its first line is `DATA_TYPE MOVIE`; export the recording as ASCII").into()
            }
            Self::Damaged { text, flaws } => {
                flaws.into_iter().map(|flaw| Mistake::data(file, &text, flaw.span, flaw.message)).collect()
            }
        }
    }
}

fn read(bytes: &[u8]) -> Result<Movie, Refusal> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if !bytes.starts_with(b"DATA_TYPE ") {
        return Err(Refusal::Stranger);
    }
    match str::from_utf8(bytes) {
        Ok(text) => parse(text).map_err(|flaws| Refusal::Damaged { text: text.into(), flaws }),
        Err(error) => {
            let text = String::from_utf8_lossy(bytes).into_owned();
            let at = error.valid_up_to();
            let span = at..at + char::REPLACEMENT_CHARACTER.len_utf8();
            let flaws = vec![Flaw { span, message: "this is not UTF-8 text".into() }];
            Err(Refusal::Damaged { text, flaws })
        }
    }
}

#[cfg(test)]
mod tests;
