//! Replies: the bytes that follow a question, and nothing else.
//!
//! A reply without a mark or a checksum can hold the text that a board prints when it starts. So such a reply is only
//! believed if it is the third in a row, with no byte too many before the next question.

use super::rule::{Rule, Verdict};
use super::{Counts, IsSound};

/// Number of replies in a row after which one without a checksum is believed.
const ROW: u32 = 3;

/// Judges replies.
#[derive(Clone)]
pub(crate) struct Replies {
    rule: Rule,
    buffer: Vec<u8>,
    /// The last reply.
    reply: Vec<u8>,
    pub(super) is_asked: bool,
    /// Number of good replies in a row.
    row: u32,
    pub(super) counts: Counts,
}

impl Replies {
    pub(crate) fn new(rule: Rule) -> Self {
        let buffer = Vec::with_capacity(rule.longest());
        Self { rule, reply: buffer.clone(), buffer, is_asked: false, row: 0, counts: Counts::default() }
    }

    /// States that the next bytes are a reply. Those that are there are none.
    pub(super) fn ask(&mut self) {
        if !self.buffer.is_empty() {
            self.counts.rejected += u64::from(self.is_asked);
            self.counts.skipped += self.buffer.len() as u64;
            self.break_off();
        }
        self.is_asked = true;
    }

    pub(super) fn push(&mut self, bytes: &[u8]) {
        // One byte more than a reply shows that it is none.
        let free = self.rule.longest() + 1 - self.buffer.len().min(self.rule.longest() + 1);
        let taken = bytes.len().min(free);
        self.counts.skipped += (bytes.len() - taken) as u64;
        self.buffer.extend_from_slice(&bytes[..taken]);
    }

    pub(super) fn forget(&mut self) {
        self.counts.skipped += self.buffer.len() as u64;
        self.break_off();
        self.is_asked = false;
    }

    pub(super) fn next(&mut self, is_sound: IsSound<'_>) -> Option<&[u8]> {
        if !self.is_asked {
            // Nobody has asked for these bytes.
            if !self.buffer.is_empty() {
                self.counts.skipped += self.buffer.len() as u64;
                self.break_off();
            }
            return None;
        }
        match self.rule.judge(&self.buffer, is_sound) {
            Verdict::Wait => return None,
            Verdict::Good(length) if length == self.buffer.len() => {}
            _ => {
                self.counts.rejected += 1;
                self.counts.skipped += self.buffer.len() as u64;
                self.break_off();
                self.is_asked = false;
                return None;
            }
        }
        self.is_asked = false;
        self.row = self.row.saturating_add(1);
        if self.row < ROW && self.rule.check.is_none() {
            self.buffer.clear();
            return None;
        }
        std::mem::swap(&mut self.reply, &mut self.buffer);
        self.buffer.clear();
        Some(&self.reply)
    }

    fn break_off(&mut self) {
        self.counts.resyncs += u64::from(self.row >= ROW);
        self.buffer.clear();
        self.row = 0;
    }
}
