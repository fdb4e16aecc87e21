//! The lidar's scans as they come over Zenoh, on this program's clock.

use std::time::{Duration, SystemTime};

use anyhow::Context as _;
use skein_wire::{Fleet, Key, Link as _, NodeName, Payload, Scan};
use skein_zenoh::{NetworkSettings, ZenohConfig, ZenohLink, ZenohSession};

use super::log::Log;

/// A scan from further in the future comes from a clock that is wrong.
const CLOCK_TOLERANCE: Duration = Duration::from_millis(50);
/// Of more scans that wait, only the newest are read: a lidar turns ten or twenty times a second.
const MOST_WAITING: usize = 4;

/// Where the scans come in; what is no scan, or from the future, is counted and told now and then.
pub struct LidarScans {
    link: ZenohLink,
    strange: u64,
    log: Log,
}

impl LidarScans {
    /// Listens to what `sensor` puts for `vehicle`, on a way of its own if there is one.
    pub fn open(
        fleet: &Fleet,
        vehicle: &NodeName,
        (sensor, network): (NodeName, Option<NetworkSettings>),
        session: &ZenohSession,
        log: Log,
    ) -> anyhow::Result<Self> {
        let key = Key::to_one::<Scan>(fleet, sensor.clone(), vehicle.clone());
        let own = network.map(|network| ZenohConfig::new(fleet.clone(), network).of(vehicle, [sensor]));
        let own = own.map(ZenohSession::open);
        let session = own.transpose()?.unwrap_or_else(|| session.clone());
        let link = session.listen(vec![key.to_string()]).context("`lidar`")?;
        Ok(Self { link, strange: 0, log })
    }

    /// Takes the next scan that has come, if there is one; `now` is this program's clock.
    pub fn poll(&mut self, now: Duration) -> Option<Scan> {
        while self.link.waiting() > MOST_WAITING && self.link.poll().is_some() {
            self.complain("scans were not read because more came than a lidar sends");
        }
        while let Some((_, payload)) = self.link.poll() {
            let Ok(Payload::Scan(scan)) = Payload::decode(&payload) else {
                self.complain("messages under the lidar's key are no scans");
                continue;
            };
            let unix = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
            let age = match unix.checked_sub(scan.stamp) {
                Some(age) => age,
                None if scan.stamp - unix <= CLOCK_TOLERANCE => Duration::ZERO,
                None => {
                    self.complain(
                        "scans come from the future: keep the lidar's computer's clock with this one's",
                    );
                    continue;
                }
            };
            if let Some(stamp) = now.checked_sub(age) {
                return Some(Scan { stamp, ..scan });
            }
        }
        None
    }

    fn complain(&mut self, what: &str) {
        self.strange += 1;
        if self.strange.is_power_of_two() {
            self.log.warn(format!("{} {what}", self.strange));
        }
    }
}
