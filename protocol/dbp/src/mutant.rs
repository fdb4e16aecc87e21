//! Faults on purpose, one for each promise: what a fault campaign must find if it is worth anything.

/// A promise, and the fault that breaks it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mutant {
    /// An occurrence is given out as soon as it arrives, whatever is missing before it.
    G1,
    /// A bid that the newest record no longer holds stays in the home's table.
    G2,
    /// A home lets go of what it keeps after 0.8 of the lease.
    G3,
    /// A home forgets which requests it has served.
    G4,
    /// A home keeps what a lost node has bid.
    G5,
    /// A remote block counts for safety events too.
    G6,
    /// A home serves requests whoever sends them.
    G7,
    /// A coordinator decides without the members that it has not heard.
    G8,
    /// A local event is selected before what has occurred elsewhere is told.
    G9,
}

impl Mutant {
    /// All of them, by the names of their promises.
    pub const ALL: [(&'static str, Self); 9] = [
        ("G1", Self::G1),
        ("G2", Self::G2),
        ("G3", Self::G3),
        ("G4", Self::G4),
        ("G5", Self::G5),
        ("G6", Self::G6),
        ("G7", Self::G7),
        ("G8", Self::G8),
        ("G9", Self::G9),
    ];
}
