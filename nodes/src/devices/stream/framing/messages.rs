//! Messages that hold one frame each: datagrams, and messages of a WebSocket.

use super::rule::Rule;
use super::{Counts, IsSound};

/// Judges messages.
#[derive(Clone)]
pub(crate) struct Messages {
    /// `None` for text, whose content decides.
    rule: Option<Rule>,
    message: Vec<u8>,
    is_new: bool,
    pub(super) counts: Counts,
}

impl Messages {
    pub(crate) fn new(rule: Option<Rule>) -> Self {
        Self { rule, message: Vec::new(), is_new: false, counts: Counts::default() }
    }

    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.message.clear();
        self.message.extend_from_slice(bytes);
        self.is_new = true;
    }

    pub(super) fn forget(&mut self) {
        self.is_new = false;
    }

    pub(super) fn next(&mut self, is_sound: IsSound<'_>) -> Option<&[u8]> {
        if !std::mem::take(&mut self.is_new) {
            return None;
        }
        let is_frame = match &self.rule {
            Some(rule) => rule.is_whole(&self.message, is_sound),
            None => is_sound(&self.message),
        };
        if is_frame {
            return Some(&self.message);
        }
        self.counts.rejected += 1;
        self.counts.skipped += self.message.len() as u64;
        None
    }
}
