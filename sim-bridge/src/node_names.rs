//! Names of the nodes of a scenario.

use std::sync::LazyLock;

use skein_dbp::NodeName;

/// The ground station's node name.
pub static GROUND: LazyLock<NodeName> = LazyLock::new(|| node_name("ground", "main"));

/// The node name of vehicle `index`: `uav/{index + 1}`.
#[must_use]
pub fn vehicle_name(index: usize) -> NodeName {
    node_name("uav", &(index + 1).to_string())
}

/// A name made of two words that are known to be plain.
#[allow(clippy::expect_used)]
pub fn node_name(kind: &str, id: &str) -> NodeName {
    NodeName::new(&format!("{kind}/{id}")).expect("both chunks are plain words")
}
