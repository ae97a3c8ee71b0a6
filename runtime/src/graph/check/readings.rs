//! Conditions of modes on values that nodes compute from others: followed back to what is measured.

use crate::graph::net::Net;
use crate::graph::plan::{Condition, PortRef, Test, WatchedPort};
use crate::graph::syntax::PortState;
use crate::node::Reading;

/// What each node says about its first input, with the parameters of the graph.
pub(crate) struct Readings(Vec<Reading>);

impl Readings {
    pub(crate) const fn new(of_nodes: Vec<Reading>) -> Self {
        Self(of_nodes)
    }

    /// Returns a condition on a measured value that holds when `condition` does: one on a smoothed value is one on the
    /// value before, and one on the flag of a comparison is one on the number.
    pub(super) fn origin(&self, net: &Net<'_>, condition: &Condition) -> Condition {
        let Condition::Port(WatchedPort { source, feature: None }, test) = condition else { return condition.clone() };
        let (mut port, mut test) = (*source, *test);
        // A delay can close a loop, which leads to no measurement.
        for _ in 0..=net.wires.len() {
            let Some((before, same)) = self.before(net, port, test) else {
                return Condition::Port(WatchedPort { source: port, feature: None }, test);
            };
            (port, test) = (before, same);
        }
        condition.clone()
    }

    /// Returns a condition, and those on the ports before it that hold in the same tick whenever it does: one on a flag is
    /// one on its opposite, and one on the flag of a comparison is one on the number.
    pub(super) fn implied<'a>(
        &'a self,
        net: &'a Net<'_>,
        condition: &Condition,
    ) -> impl Iterator<Item = Condition> + 'a {
        let before = |condition: &Condition| {
            let Condition::Port(WatchedPort { source, feature: None }, test) = condition else { return None };
            // A node that smooths its input follows it later.
            let exact = source.producer.node().is_some_and(|node| self.0[node] != Reading::Same);
            let (source, test) = self.before(net, *source, *test).filter(|_| exact)?;
            Some(Condition::Port(WatchedPort { source, feature: None }, test))
        };
        std::iter::successors(Some(condition.clone()), before).take(net.wires.len() + 1)
    }

    /// Returns the port that the node of another one reads, and the same test of it.
    fn before(&self, net: &Net<'_>, port: PortRef, test: Test) -> Option<(PortRef, Test)> {
        let node = port.producer.node().filter(|_| port.port == 0)?;
        // What it says holds with the parameters of the graph.
        if (0..net.flat.modes.len()).any(|mode| net.setting(mode, node).is_some()) {
            return None;
        }
        let source = net.wires[node].iter().find(|wire| wire.input == 0)?.source;
        let test = match self.0[node] {
            Reading::Same if matches!(test, Test::Between { .. } | Test::Is(PortState::True | PortState::False)) => {
                test
            }
            Reading::Opposite => opposite(test)?,
            Reading::Between { min, max, hysteresis } => bounds(test, [min, max], hysteresis)?,
            _ => return None,
        };
        Some((source, test))
    }
}

/// Returns the test of a flag that holds when another one is its opposite.
const fn opposite(test: Test) -> Option<Test> {
    match test {
        Test::Is(PortState::True) => Some(Test::Is(PortState::False)),
        Test::Is(PortState::False) => Some(Test::Is(PortState::True)),
        _ => None,
    }
}

/// Returns the test of the number behind a flag; `None` if the flag is cleared on both sides.
fn bounds(test: Test, [min, max]: [f64; 2], hysteresis: f64) -> Option<Test> {
    let between = |min: f64, max: f64| Test::Between { min, max, hysteresis };
    match test {
        Test::Is(PortState::True) => Some(between(min, max)),
        Test::Is(PortState::False) if max.is_infinite() => Some(between(f64::NEG_INFINITY, min - hysteresis)),
        Test::Is(PortState::False) if min.is_infinite() => Some(between(max + hysteresis, f64::INFINITY)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_that_is_not_set_is_set_by_its_opposite() {
        let of = |state| match opposite(Test::Is(state)) {
            Some(Test::Is(state)) => Some(state),
            _ => None,
        };
        assert_eq!(of(PortState::True), Some(PortState::False));
        assert_eq!(of(PortState::False), Some(PortState::True));
        assert_eq!(of(PortState::Absent), None);
    }

    #[test]
    fn a_flag_is_cleared_beyond_its_hysteresis() {
        let of = |state, range| match bounds(Test::Is(state), range, 0.5) {
            Some(Test::Between { min, max, .. }) => Some([min, max]),
            _ => None,
        };
        let (none, all) = (f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(of(PortState::True, [2.0, all]), Some([2.0, all]));
        assert_eq!(of(PortState::False, [2.0, all]), Some([none, 1.5]));
        assert_eq!(of(PortState::False, [none, 2.0]), Some([2.5, all]));
        assert_eq!(of(PortState::False, [1.0, 2.0]), None);
        assert_eq!(of(PortState::Present, [2.0, all]), None);
    }
}
