//! Sorts nodes topologically, rank by rank, and finds the cycles that prevent it.

/// A wire between two nodes, which determines which one steps first.
#[derive(Debug)]
pub(super) struct Edge {
    pub(super) first: usize,
    pub(super) then: usize,
    /// Index of the consumer, and index of the wire among its wires.
    pub(super) wire: (usize, usize),
    pub(super) is_delayed: bool,
    /// Whether the wire is ignored because it closes a cycle that was reported.
    pub(super) is_cut: bool,
}

/// Sorts nodes topologically. The time is proportional to the number of edges and to the length of the reported cycles.
pub(super) struct Sorter {
    pub(super) edges: Vec<Edge>,
    /// For each node, its edges to later nodes.
    outgoing: Vec<Vec<usize>>,
    /// For each node, its edges from earlier nodes.
    incoming: Vec<Vec<usize>>,
    /// For each node, how many of the incoming edges come from a node without a place.
    waits_for: Vec<usize>,
    /// For each node, how many of the incoming edges the search for cycles has passed.
    passed: Vec<usize>,
    /// The nodes of the next rank.
    free: Vec<usize>,
    is_placed: Vec<bool>,
    /// The nodes that have their places.
    pub(super) order: Vec<usize>,
    /// The first node in file order that may have no place.
    first_open: usize,
    /// The edges of the walk that looks for a cycle, backwards from `first_open`.
    walk: Vec<usize>,
    is_on_walk: Vec<bool>,
}

impl Sorter {
    pub(super) fn new(edges: Vec<Edge>, nodes: usize) -> Self {
        let (mut outgoing, mut incoming) = (vec![Vec::new(); nodes], vec![Vec::new(); nodes]);
        for (i, edge) in edges.iter().enumerate() {
            outgoing[edge.first].push(i);
            incoming[edge.then].push(i);
        }
        let waits_for: Vec<usize> = incoming.iter().map(Vec::len).collect();
        Self {
            free: (0..nodes).filter(|node| waits_for[*node] == 0).collect(),
            edges,
            outgoing,
            incoming,
            waits_for,
            passed: vec![0; nodes],
            is_placed: vec![false; nodes],
            order: Vec::with_capacity(nodes),
            first_open: 0,
            walk: Vec::new(),
            is_on_walk: vec![false; nodes],
        }
    }

    /// Places rank after rank, until every other node waits for one without a place.
    pub(super) fn place_free(&mut self) {
        while !self.free.is_empty() {
            let mut rank = std::mem::take(&mut self.free);
            rank.sort_unstable();
            for node in &rank {
                self.is_placed[*node] = true;
                for edge in std::mem::take(&mut self.outgoing[*node]) {
                    if !self.edges[edge].is_cut {
                        self.stop_waiting(self.edges[edge].then);
                    }
                }
            }
            self.order.extend(rank);
        }
    }

    fn stop_waiting(&mut self, node: usize) {
        self.waits_for[node] -= 1;
        if self.waits_for[node] == 0 {
            self.free.push(node);
        }
    }

    pub(super) fn cut(&mut self, edge: usize) {
        self.edges[edge].is_cut = true;
        self.stop_waiting(self.edges[edge].then);
    }

    /// Returns a cycle among nodes that all wait for another one, or `None` if every node has a place.
    ///
    /// The walk goes backwards from the first node without a place until a node repeats. The next walk continues where
    /// this one has left the cycle.
    pub(super) fn find_cycle(&mut self) -> Option<Vec<usize>> {
        while *self.is_placed.get(self.first_open)? {
            self.first_open += 1;
        }
        // Nodes get their places from the end of the walk on.
        while let Some(last) = self.walk.pop_if(|last| self.is_placed[self.edges[*last].first]) {
            self.is_on_walk[self.edges[last].then] = false;
        }
        let mut node = self.walk.last().map_or(self.first_open, |last| self.edges[*last].first);
        while !self.is_on_walk[node] {
            let edge = self.next_incoming(node);
            self.is_on_walk[node] = true;
            self.walk.push(edge);
            node = self.edges[edge].first;
        }
        let from = self.walk.iter().rposition(|edge| self.edges[*edge].then == node).expect("the walk passes the node");
        let mut cycle = self.walk.split_off(from);
        cycle.iter().for_each(|edge| self.is_on_walk[self.edges[*edge].then] = false);
        cycle.reverse();
        Some(cycle)
    }

    /// Returns the first edge through which a node still waits.
    fn next_incoming(&mut self, node: usize) -> usize {
        loop {
            let edge = self.incoming[node][self.passed[node]];
            if !self.edges[edge].is_cut && !self.is_placed[self.edges[edge].first] {
                return edge;
            }
            self.passed[node] += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A step order, and the wires of the cycles that were found on the way.
    type Sorted = (Vec<usize>, Vec<Vec<usize>>);

    fn edges(pairs: &[(usize, usize)]) -> Vec<Edge> {
        let edge = |(i, (first, then)): (usize, &(usize, usize))| Edge {
            first: *first,
            then: *then,
            wire: (*then, i),
            is_delayed: false,
            is_cut: false,
        };
        pairs.iter().enumerate().map(edge).collect()
    }

    fn sort(pairs: &[(usize, usize)], nodes: usize) -> Sorted {
        let (mut sorter, mut cycles) = (Sorter::new(edges(pairs), nodes), Vec::new());
        loop {
            sorter.place_free();
            let Some(cycle) = sorter.find_cycle() else { return (sorter.order, cycles) };
            sorter.cut(*cycle.last().unwrap());
            cycles.push(cycle);
        }
    }

    /// The definition: it searches all edges again for each rank and each step of a walk.
    fn sort_by_definition(pairs: &[(usize, usize)], nodes: usize) -> Sorted {
        let mut edges: Vec<(usize, (usize, usize))> = pairs.iter().copied().enumerate().collect();
        let (mut rest, mut order, mut cycles): (Vec<usize>, _, _) = ((0..nodes).collect(), Vec::new(), Vec::new());
        while !rest.is_empty() {
            let is_free = |node: &usize| edges.iter().all(|(_, (_, then))| then != node);
            let (free, bound): (Vec<usize>, Vec<usize>) = rest.iter().partition(|node| is_free(node));
            if free.is_empty() {
                let cycle = cycle_by_definition(rest[0], &edges);
                edges.retain(|(i, _)| i != cycle.last().unwrap());
                cycles.push(cycle);
            } else {
                edges.retain(|(_, (first, _))| !free.contains(first));
                order.extend(free);
                rest = bound;
            }
        }
        (order, cycles)
    }

    fn cycle_by_definition(start: usize, edges: &[(usize, (usize, usize))]) -> Vec<usize> {
        let (mut walk, mut node): (Vec<(usize, usize)>, usize) = (Vec::new(), start);
        loop {
            let (i, (first, then)) = *edges.iter().find(|(_, (_, then))| *then == node).unwrap();
            walk.push((i, then));
            node = first;
            if let Some(from) = walk.iter().position(|(_, then)| *then == node) {
                return walk[from..].iter().rev().map(|(i, _)| *i).collect();
            }
        }
    }

    proptest! {
        #[test]
        fn the_order_and_the_cycles_are_those_of_the_definition(
            nodes in 1..14_usize,
            pairs in prop::collection::vec((0..14_usize, 0..14_usize), 0..30),
        ) {
            let pairs: Vec<(usize, usize)> = pairs.iter().map(|(a, b)| (a % nodes, b % nodes)).collect();
            prop_assert_eq!(sort(&pairs, nodes), sort_by_definition(&pairs, nodes));
        }
    }

    #[test]
    fn a_rank_is_in_file_order() {
        // 3 -> 0 and 1 -> 2, then 0 -> 4.
        assert_eq!(sort(&[(3, 0), (1, 2), (0, 4)], 5), (vec![1, 3, 0, 2, 4], vec![]));
    }
}
