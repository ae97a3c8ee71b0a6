//! What a motion may do after a contact, from the flags of the contact and the time.

/// How long a contact must last to count as one [ns].
const MIN_CONTACT_NS: i64 = 40_000_000;
/// A contact that lasts shorter than this is a first touch, after which a gap is a bounce and no loss [ns].
const FIRST_TOUCH_NS: i64 = 500_000_000;
/// A contact that comes back within this time goes on: it is no first touch [ns].
const SAME_CONTACT_NS: i64 = 100_000_000;
/// Time after a loss in which a touch begins the rest anew [ns].
const MAX_REST_NS: i64 = 3_000_000_000;

/// What a motion may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Nothing has touched the pad yet: everything.
    Free,
    /// Something touches the pad: everything.
    Touched,
    /// The contact is missing, perhaps for a frame only: everything but a motion into the object.
    Barred,
    /// The contact is lost, and the arm still leans toward where it was: only the way out.
    Retreat,
    /// The contact is lost: only the way out.
    Rest,
    /// The contact is to be found again: a slow motion.
    Search,
}

/// Times after a loss [ns].
#[derive(Debug, Clone, Copy)]
pub struct Times {
    /// How long a contact is missing before it is lost.
    pub debounce: i64,
    /// How long the arm waits before it searches, from the first frame without the contact or a later one with a touch.
    pub wait: i64,
}

/// The course of contacts up to now. Times are those of ticks [ns].
#[derive(Debug, Clone, Copy, Default)]
pub struct Course {
    /// When the flag was set that has been set since.
    set_since: Option<i64>,
    /// When the last contact began that has lasted. A gap of up to 100 ms does not end it.
    touched_since: Option<i64>,
    /// When that contact was first missing, if it has not come back.
    missing_since: Option<i64>,
    /// Since when nothing has touched the pad, not even for a frame, if that contact is missing. After
    /// `MAX_REST_NS`, a touch no longer changes it.
    untouched_since: Option<i64>,
    /// Whether the arm has begun to search for that contact.
    searches: bool,
}

impl Course {
    /// Notes whether something touches the pad in the tick at time `now`. Returns what a motion may do; `is_leaning` is
    /// whether the arm still has to give way after a loss.
    pub fn next(&mut self, now: i64, touches: bool, is_leaning: bool, times: &Times) -> Phase {
        self.set_since = touches.then(|| self.set_since.unwrap_or(now));
        let lasts = self.set_since.is_some_and(|since| now - since >= MIN_CONTACT_NS);
        let flickers = touches && self.missing_since.is_some_and(|since| now - since <= times.debounce);
        if lasts && (self.touched_since.is_none() || self.missing_since.is_some()) {
            let is_same = self.missing_since.zip(self.set_since).is_some_and(|(end, set)| set - end <= SAME_CONTACT_NS);
            let touched_since = self.touched_since.filter(|_| is_same).or(Some(now));
            *self = Self { touched_since, set_since: self.set_since, ..Self::default() };
        } else if flickers {
            (self.missing_since, self.untouched_since) = (None, None);
        }
        let Some(touched) = self.touched_since else { return Phase::Free };
        if !touches {
            self.missing_since.get_or_insert(now);
            self.untouched_since.get_or_insert(now);
        }
        let Some(missing) = self.missing_since else { return Phase::Touched };
        // A touch that flickers must not let the arm rest for ever.
        if touches && now - missing <= MAX_REST_NS {
            self.untouched_since = Some(now);
        }
        let (gap, is_bounce) = (now - missing, missing - touched < FIRST_TOUCH_NS);
        let rested = now - self.untouched_since.unwrap_or(missing);
        let phase = if !touches && gap < times.debounce {
            Phase::Barred
        } else if is_bounce {
            Phase::Search
        } else if touches {
            // It has not lasted yet.
            if self.searches { Phase::Search } else { Phase::Barred }
        } else if is_leaning {
            Phase::Retreat
        } else if rested < times.wait {
            Phase::Rest
        } else {
            Phase::Search
        };
        self.searches = phase == Phase::Search;
        phase
    }
}
