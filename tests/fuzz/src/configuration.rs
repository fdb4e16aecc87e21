//! Configuration: of agents, ground stations, scenarios, vehicles and rosters.

use std::path::Path;

use skein_sim::scenario::Scenario;
use skein_world::VehicleModel;
use skein_zenoh::Roster;

use crate::target::{Allowed, Reached, Target};

/// A scenario's few lines may make a world of thousands of trees.
pub const TARGET: Target =
    Target { name: "configuration", allowed: Allowed { bytes: 64 << 20, per_byte: 3000 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    if !is_harmless(text) {
        return Reached::Refused;
    }
    // Relative paths lead nowhere.
    let folder = Path::new("/nowhere");
    let agent = skein_agent::config_file::Config::parse(text, folder, &Default::default());
    let ground = skein_ground::config_file::Config::parse(text, folder, &Default::default());
    let vehicle = VehicleModel::from_toml(text, "fuzzed.toml");
    let roster = Roster::parse(text);
    if let Ok(roster) = &roster {
        assert_eq!(Roster::parse(&roster.to_text()).as_ref(), Ok(roster));
    }
    let scenario = Scenario::from_toml(text, "/nowhere/fuzzed.toml", None, 1);
    let read = [agent.is_ok(), ground.is_ok(), vehicle.is_ok(), roster.is_ok(), scenario.is_ok()];
    match read.contains(&true) {
        false => Reached::Refused,
        true => Reached::read(roster.is_ok_and(|roster| roster.members().count() == 3)),
    }
}

/// Whether a text leads to no file without end, such as `/dev/zero`.
fn is_harmless(text: &str) -> bool {
    !text.contains("\"/dev") && !text.contains("'/dev") && !text.contains('\\')
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let texts = [
        ("agent", include_str!("../../../agent/agent.toml")),
        ("ground", include_str!("../../../ground/ground.toml")),
        ("forest", include_str!("../../../sim-bridge/scenarios/forest.toml")),
        ("survey", include_str!("../../../sim-bridge/scenarios/survey.toml")),
        ("valley", include_str!("../../../sim-bridge/scenarios/valley.toml")),
        ("window", include_str!("../../../sim-bridge/scenarios/window.toml")),
        ("yard", include_str!("../../../sim-bridge/scenarios/yard.toml")),
        ("vehicle", include_str!("../../../sim-bridge/world/vehicles/x500.toml")),
        ("roster", "relays = [\"ground/main\"]\n[members]\n\"ground/main\" = 1\n\"uav/1\" = 2\n"),
    ];
    texts.map(|(name, text)| (name, text.as_bytes().to_vec())).into()
}
