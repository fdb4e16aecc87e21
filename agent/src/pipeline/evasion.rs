//! Evasion: out of a place where no velocity keeps all distances. The vehicle brakes, and if that does not help, one
//! of two climbs and the other sinks, by rank.

use std::time::Duration;

use skein_planning::separation::{Cause, Outcome};

/// The vehicle brakes for so long before it leaves its height.
const BRAKES_FOR: Duration = Duration::from_millis(500);
/// It goes on for so long after all distances can be kept again, so that it does not come back at once.
const LASTS: Duration = Duration::from_millis(1500);

/// Up or down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    Up,
    Down,
}

impl Way {
    pub fn sign(self) -> f64 {
        match self {
            Self::Up => 1.0,
            Self::Down => -1.0,
        }
    }
}

/// Where there is room to leave the height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    pub up: bool,
    pub down: bool,
}

/// Watches what the safety filter says, and decides when to leave the height and which way.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evasion {
    /// Since when no velocity has kept all distances.
    hemmed_in_since: Option<Duration>,
    /// The way, and when it ends.
    way: Option<(Way, Duration)>,
}

impl Evasion {
    /// The way to leave the height at `now`, after the filter said `outcome`; `None` to stay.
    ///
    /// `rank` is the number of neighbours whose names come before this vehicle's: of two, the one whose name comes
    /// first climbs. Both judge alike without a word. `room` is asked only when it matters. Who has no room that way
    /// takes the other; with none either way it stays and brakes.
    pub fn decide(
        &mut self,
        now: Duration,
        outcome: &Outcome,
        rank: u32,
        room: impl Fn() -> Room,
    ) -> Option<Way> {
        let neighbour = match outcome {
            Outcome::Infeasible { by: Cause::Neighbour(id), .. } => Some(*id),
            _ => None,
        };
        let Some(neighbour) = neighbour else {
            self.hemmed_in_since = None;
            self.way = self.way.filter(|(way, until)| now < *until && room().allows(*way));
            return self.way.map(|(way, _)| way);
        };
        let since = *self.hemmed_in_since.get_or_insert(now);
        if self.way.is_none() && now.saturating_sub(since) < BRAKES_FOR {
            return None;
        }
        let by_rank = if neighbour < rank { [Way::Down, Way::Up] } else { [Way::Up, Way::Down] };
        // Once begun, a way is kept to its end.
        let begun = self.way.map(|(way, _)| way);
        let room = room();
        let way = begun.into_iter().chain(by_rank).find(|way| room.allows(*way));
        self.way = way.map(|way| (way, now + LASTS));
        way
    }
}

impl Room {
    fn allows(self, way: Way) -> bool {
        match way {
            Way::Up => self.up,
            Way::Down => self.down,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: fn() -> Room = || Room { up: true, down: true };

    fn hemmed_in_by(id: u32) -> Outcome {
        Outcome::Infeasible { by: Cause::Neighbour(id), excess_m_s: 0.1 }
    }

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// The decision after braking did not help.
    fn after_braking(by: &Outcome, rank: u32, room: fn() -> Room) -> Option<Way> {
        let mut evasion = Evasion::default();
        assert_eq!(evasion.decide(ms(0), by, rank, room), None, "it brakes first");
        assert_eq!(evasion.decide(ms(480), by, rank, room), None);
        evasion.decide(ms(500), by, rank, room)
    }

    #[test]
    fn of_two_one_climbs_and_the_other_sinks() {
        // Of uav/1 and uav/2, each is neighbour 0 of the other; one name comes before that of uav/2.
        assert_eq!(after_braking(&hemmed_in_by(0), 0, BOTH), Some(Way::Up));
        assert_eq!(after_braking(&hemmed_in_by(0), 1, BOTH), Some(Way::Down));
    }

    #[test]
    fn where_there_is_no_room_the_vehicle_does_not_go() {
        assert_eq!(after_braking(&hemmed_in_by(0), 0, || Room { up: false, down: true }), Some(Way::Down));
        assert_eq!(after_braking(&hemmed_in_by(0), 1, || Room { up: true, down: false }), Some(Way::Up));
        assert_eq!(after_braking(&hemmed_in_by(0), 0, || Room { up: false, down: false }), None);
    }

    #[test]
    fn a_wall_is_no_reason_to_climb() {
        let wall = Outcome::Infeasible { by: Cause::Obstacle(3), excess_m_s: 0.1 };
        assert_eq!(after_braking(&wall, 0, BOTH), None);
        assert_eq!(after_braking(&Outcome::Clear, 0, BOTH), None);
    }

    #[test]
    fn a_way_is_kept_to_its_end_and_then_left() {
        let mut evasion = Evasion::default();
        evasion.decide(ms(0), &hemmed_in_by(4), 2, BOTH);
        assert_eq!(evasion.decide(ms(500), &hemmed_in_by(4), 2, BOTH), Some(Way::Up));
        assert_eq!(
            evasion.decide(ms(520), &hemmed_in_by(1), 2, BOTH),
            Some(Way::Up),
            "though now it would sink"
        );
        assert_eq!(evasion.decide(ms(1900), &Outcome::Clear, 2, BOTH), Some(Way::Up));
        assert_eq!(evasion.decide(ms(2100), &Outcome::Clear, 2, BOTH), None);
    }
}
