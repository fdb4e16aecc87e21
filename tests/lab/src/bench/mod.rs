//! Benchmarks on this computer. No test depends on the figures.

mod bp;
mod fleet;
pub mod hold;
mod link;
mod load;
mod mesh;
mod nav;
pub mod plan;
mod slam;
mod zone;

use crate::task::Entry;

pub const TASKS: &[Entry] = &[
    Entry::of::<bp::Bp>(),
    Entry::of::<plan::Plan>(),
    Entry::of::<nav::Nav>(),
    Entry::of::<mesh::Meshes>(),
    Entry::of::<slam::Slams>(),
    Entry::of::<fleet::Sizes>(),
    Entry::of::<fleet::OneSize>(),
    Entry::of::<link::Extent>(),
    Entry::of::<link::peer::Part>(),
    Entry::of::<hold::Holds>(),
    Entry::of::<zone::Zones>(),
];
