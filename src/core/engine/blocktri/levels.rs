//! Breadth-first level structure of a sparse symmetric pattern.

use super::BlockTriError;

/// Ordering that makes a symmetric sparse pattern block tridiagonal: connected components, each cut into breadth-first levels.
///
/// A dof is coupled only with dofs of its own level, the one before and the one after, and never across components. The start is a
/// pseudo-peripheral node (George & Liu, ACM Trans. Math. Softw. 5, 1979, 284-295); since a level that starts from a single dof
/// splits the first body of a chain, structures rooted at whole last levels are tried too, and the cheapest to factor is kept.
/// Deterministic; cost linear in the number of dofs and pairs (times log of the largest degree).
#[derive(Debug, Clone, PartialEq)]
pub struct Levels {
    pub(super) order: Vec<usize>,
    pub(super) position: Vec<usize>,
    pub(super) start: Vec<usize>,
    pub(super) linked: Vec<bool>,
}

impl Levels {
    /// Orders `n` dofs coupled as in `pairs` (either triangle or both, repetitions and the diagonal allowed).
    ///
    /// # Errors
    /// [`BlockTriError::NoSuchDof`] for a pair outside 0..n.
    pub fn new(n: usize, pairs: &[(usize, usize)]) -> Result<Self, BlockTriError> {
        let graph = Graph::new(n, pairs)?;
        let mut search = Search { graph: &graph, stamp: vec![0; n], round: 0 };
        let (mut order, mut start, mut linked) = (Vec::with_capacity(n), vec![0], Vec::new());
        let mut placed = vec![false; n];
        for seed in 0..n {
            if placed[seed] {
                continue;
            }
            let rooted = search.best_structure(seed);
            for (i, range) in rooted.ranges().enumerate() {
                let first = order.len();
                order.extend_from_slice(&rooted.nodes[range]);
                order[first..].sort_unstable();
                order[first..].iter().for_each(|&v| placed[v] = true);
                start.push(order.len());
                linked.push(i + 2 < rooted.start.len());
            }
        }
        let mut position = vec![0; n];
        order.iter().enumerate().for_each(|(p, &v)| position[v] = p);
        Ok(Self { order, position, start, linked })
    }

    /// Number of dofs.
    pub fn n(&self) -> usize {
        self.order.len()
    }

    /// Number of levels (diagonal blocks) over all components.
    pub fn count(&self) -> usize {
        self.linked.len()
    }

    /// Size of level `level`.
    pub fn size(&self, level: usize) -> usize {
        self.start[level + 1] - self.start[level]
    }

    /// Dofs of level `level`, in increasing order.
    pub fn dofs(&self, level: usize) -> &[usize] {
        &self.order[self.start[level]..self.start[level + 1]]
    }

    /// Whether level `level` is coupled with the next one (false at the end of a component).
    pub fn linked(&self, level: usize) -> bool {
        self.linked[level]
    }

    /// First position after the level that follows `level`, or the end of `level` itself where the component ends.
    pub(super) fn reach(&self, level: usize) -> usize {
        if self.linked[level] { self.start[level + 2] } else { self.start[level + 1] }
    }
}

/// Compressed adjacency, neighbours sorted and without repetition.
struct Graph {
    start: Vec<usize>,
    neighbours: Vec<usize>,
}

impl Graph {
    fn new(n: usize, pairs: &[(usize, usize)]) -> Result<Self, BlockTriError> {
        let mut fill = vec![0usize; n + 1];
        for &(i, j) in pairs {
            if let Some(dof) = [i, j].into_iter().find(|&d| d >= n) {
                return Err(BlockTriError::NoSuchDof { dof, n });
            }
            if i != j {
                fill[i + 1] += 1;
                fill[j + 1] += 1;
            }
        }
        (0..n).for_each(|i| fill[i + 1] += fill[i]);
        let mut raw = vec![0; fill[n]];
        let mut next = fill.clone();
        for &(i, j) in pairs.iter().filter(|(i, j)| i != j) {
            raw[next[i]] = j;
            raw[next[j]] = i;
            next[i] += 1;
            next[j] += 1;
        }
        let (mut start, mut neighbours) = (vec![0], Vec::with_capacity(raw.len()));
        for i in 0..n {
            let list = &mut raw[fill[i]..fill[i + 1]];
            list.sort_unstable();
            let first = neighbours.len();
            for &v in list.iter() {
                if neighbours.len() == first || neighbours.last() != Some(&v) {
                    neighbours.push(v);
                }
            }
            start.push(neighbours.len());
        }
        Ok(Self { start, neighbours })
    }

    fn of(&self, v: usize) -> &[usize] {
        &self.neighbours[self.start[v]..self.start[v + 1]]
    }
}

/// Level structure of one component: nodes level by level.
struct Rooted {
    nodes: Vec<usize>,
    start: Vec<usize>,
}

impl Rooted {
    fn ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.start.windows(2).map(|w| w[0]..w[1])
    }

    fn depth(&self) -> usize {
        self.start.len() - 1
    }

    fn last(&self) -> &[usize] {
        &self.nodes[self.start[self.depth() - 1]..]
    }

    /// Multiplications of a block factorisation without pivoting, up to a factor.
    fn cost(&self) -> f64 {
        let size: Vec<f64> = self.ranges().map(|r| r.len() as f64).collect();
        let own: f64 = size.iter().map(|a| a * a * a / 3.0).sum();
        own + size.windows(2).map(|w| w[0] * w[1] * (w[0] + w[1])).sum::<f64>()
    }

    /// Lowest dof first: reverses the levels where the last one holds it.
    fn upright(self) -> Self {
        let lowest = |r: &[usize]| r.iter().copied().min();
        if lowest(&self.nodes[..self.start[1]]) <= lowest(self.last()) {
            return self;
        }
        let (mut nodes, mut start) = (Vec::with_capacity(self.nodes.len()), vec![0]);
        for range in self.ranges().collect::<Vec<_>>().into_iter().rev() {
            nodes.extend_from_slice(&self.nodes[range]);
            start.push(nodes.len());
        }
        Self { nodes, start }
    }
}

struct Search<'a> {
    graph: &'a Graph,
    stamp: Vec<usize>,
    round: usize,
}

impl Search<'_> {
    fn from(&mut self, root: &[usize]) -> Rooted {
        self.round += 1;
        let (mut nodes, mut start) = (root.to_vec(), vec![0]);
        root.iter().for_each(|&v| self.stamp[v] = self.round);
        let mut begin = 0;
        while begin < nodes.len() {
            let end = nodes.len();
            start.push(end);
            for at in begin..end {
                for &w in self.graph.of(nodes[at]) {
                    if self.stamp[w] != self.round {
                        self.stamp[w] = self.round;
                        nodes.push(w);
                    }
                }
            }
            begin = end;
        }
        Rooted { nodes, start }
    }

    fn best_structure(&mut self, seed: usize) -> Rooted {
        // The number of rounds is bounded so that the cost stays linear; two or three settle a chain.
        const ROUNDS: usize = 6;
        let mut best = self.from(&[seed]);
        for _ in 0..ROUNDS {
            let graph = self.graph;
            let Some(end) = best.last().iter().copied().min_by_key(|&v| (graph.of(v).len(), v)) else { break };
            let far = self.from(&[end]);
            if far.depth() <= best.depth() {
                break;
            }
            best = far;
        }
        let mut candidate = self.from(best.last());
        for _ in 0..2 {
            let next = self.from(candidate.last());
            if candidate.cost() < best.cost() {
                best = candidate;
            }
            candidate = next;
        }
        if candidate.cost() < best.cost() { candidate.upright() } else { best.upright() }
    }
}
