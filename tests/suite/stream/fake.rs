//! A pad in another process, which knows only the data sheets: `tests/peers/pad.py`.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use tactflow_nodes::devices::stream::Stream;
use tactflow_runtime::harness::LinkRig;
use tactflow_runtime::signal::Image;
use tactflow_tests::workspace;
use tempfile::TempDir;

/// Time within which anything happens on a busy machine.
pub(super) const SOON: Duration = Duration::from_secs(20);

/// A pad on the other end of a link; it ends with the test.
pub(crate) struct Fake {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    /// What a driver opens.
    pub(crate) link: String,
    _folder: TempDir,
}

impl Fake {
    pub(crate) fn start(pad: &str, link: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new("python3");
        command.arg(workspace().join("tests/peers/pad.py")).args([pad, link, "--path"]).arg(folder.path().join("port"));
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python3 is there");
        let input = child.stdin.take();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let mut link = String::new();
        output.read_line(&mut link).unwrap();
        Self { child, input, output, link: link.trim().to_owned(), _folder: folder }
    }

    /// Has the pad do something, and returns its answer.
    pub(crate) fn answer(&mut self, what: &str) -> String {
        let input = self.input.as_mut().expect("it has not ended");
        writeln!(input, "{what}").unwrap();
        let mut answer = String::new();
        self.output.read_line(&mut answer).unwrap();
        answer.trim().to_owned()
    }

    pub(crate) fn does(&mut self, what: &str) {
        assert_eq!(self.answer(what), "ok", "{what}");
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        drop(self.input.take());
        // One that has ended by itself cannot be killed, and need not.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The keys of a description that ships.
pub(super) fn shipped(name: &str) -> String {
    let text = std::fs::read_to_string(workspace().join(format!("graphs/pads/{name}.toml"))).unwrap();
    text.replace("[sensor]\n", "").replace("[sensor.", "[")
}

/// A driver of a pad with these keys, before the description's.
pub(super) fn driver(fake: &Fake, description: &str, keys: &str) -> LinkRig {
    let text = format!("link = '{}'\n{keys}\n{description}", fake.link);
    LinkRig::start::<Stream>(&text).unwrap_or_else(|mistakes| panic!("{mistakes:#?}\n{text}"))
}

/// Whether an image is one that the pad has sent: the value of tactel k in frame n is (7 n + 3 k) mod 251, but for a
/// mark in two of them.
pub(super) fn is_true(image: &Image) -> bool {
    let cells = image.cells();
    let fits = |first: usize| {
        let wrong: Vec<usize> = (0..cells.len()).filter(|k| cells[*k] != ((first + 3 * k) % 251) as f32).collect();
        match wrong[..] {
            [] => true,
            [a] => [170.0, 85.0].contains(&cells[a]),
            [a, b] => [cells[a], cells[b]] == [170.0, 85.0],
            _ => false,
        }
    };
    fits(cells[0] as usize)
}

/// Waits for that many images. Each must be true.
pub(super) fn expect_images(rig: &mut LinkRig, count: usize, what: &str) {
    for i in 0..count {
        let image = rig.next::<Image>("image", SOON).cloned();
        let image = image.unwrap_or_else(|| panic!("{what}: image {i} is missing: {:?}", rig.lost("image")));
        assert!(is_true(&image), "{what}: image {i} is wrong: {:?}", image.cells());
    }
}

/// Waits for images until the pad has counted something so often. Each image must be true.
pub(super) fn expect_count(rig: &mut LinkRig, what: &str, times: u64) {
    let end = std::time::Instant::now() + SOON;
    while rig.count(what) < times {
        assert!(std::time::Instant::now() < end, "{} {what}", rig.count(what));
        if let Some(image) = rig.next::<Image>("image", Duration::from_millis(50)) {
            assert!(is_true(image), "{what}: {:?}", image.cells());
        }
    }
}
