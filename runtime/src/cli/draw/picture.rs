//! What a picture shows: boxes in groups, and arrows between them.

/// A picture without places.
pub(super) struct Picture {
    pub(super) title: String,
    pub(super) groups: Vec<PictureGroup>,
    pub(super) boxes: Vec<PictureBox>,
    pub(super) arrows: Vec<Arrow>,
}

/// A frame around boxes: a part.
pub(super) struct PictureGroup {
    pub(super) name: String,
    /// The group around it.
    pub(super) parent: Option<usize>,
}

/// A box with lines of text.
pub(super) struct PictureBox {
    pub(super) lines: Vec<String>,
    pub(super) look: Look,
    pub(super) group: Option<usize>,
}

/// What a box stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Look {
    /// A node or a mode.
    Inner,
    /// Where values come from or go to, outside of the graph; where a run begins or ends.
    Outer,
}

/// An arrow from one box to another, with lines of text.
pub(super) struct Arrow {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) lines: Vec<String>,
    pub(super) is_dashed: bool,
}

impl Picture {
    pub(super) const fn new(title: String) -> Self {
        Self { title, groups: Vec::new(), boxes: Vec::new(), arrows: Vec::new() }
    }

    /// Adds a box and returns its number.
    pub(super) fn add(&mut self, lines: Vec<String>, look: Look, group: Option<usize>) -> usize {
        self.boxes.push(PictureBox { lines, look, group });
        self.boxes.len() - 1
    }

    /// Adds a line of text to the arrow between two boxes, which is new if there is none.
    pub(super) fn connect(&mut self, from: usize, to: usize, line: String) {
        match self.arrows.iter_mut().find(|arrow| (arrow.from, arrow.to) == (from, to)) {
            Some(arrow) if arrow.lines.contains(&line) => {}
            Some(arrow) => arrow.lines.push(line),
            None => self.arrows.push(Arrow { from, to, lines: vec![line], is_dashed: false }),
        }
    }

    /// Returns the number of the group with that dotted name, and makes it and the groups around it if they are new.
    pub(super) fn group(&mut self, name: &str) -> Option<usize> {
        let mut parent = None;
        for part in name.split('.').filter(|part| !part.is_empty()) {
            let known = self.groups.iter().position(|group| group.name == part && group.parent == parent);
            parent = known.or_else(|| {
                self.groups.push(PictureGroup { name: part.to_owned(), parent });
                Some(self.groups.len() - 1)
            });
        }
        parent
    }
}
