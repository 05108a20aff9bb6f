//! Disjoint sets, as a forest: each member names another of its set, the representative itself.

/// The representative of the set that `member` belongs to; halves the way there.
pub fn root(parents: &mut [usize], mut member: usize) -> usize {
    while parents[member] != member {
        parents[member] = parents[parents[member]];
        member = parents[member];
    }
    member
}
