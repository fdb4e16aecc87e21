//! Arrival together: vehicles tell one another how long they still have to fly at cruise speed, and those that have
//! less fly slower. Nobody leads, and nothing is agreed before: who is held up is waited for as long as it is heard.

use nalgebra::Vector3;

use crate::{config::Envelope, neighbours::Neighbour};

/// Who is so much ahead of the last one does not slow down for it, s: its word is that old by now.
const TOLERANCE_S: f64 = 0.25;
/// Slower than this, a vehicle cannot be told from one that is stuck, m/s.
const SLOWEST_M_S: f64 = 0.3;

/// The time in which a vehicle of this envelope flies along a way (ENU, m) at cruise speed, s.
pub fn to_go_s(way: impl IntoIterator<Item = Vector3<f64>>, envelope: &Envelope) -> f64 {
    let mut way = way.into_iter();
    let Some(mut from) = way.next() else { return 0.0 };
    let mut sum_s = 0.0;
    for to in way {
        let leg = to - from;
        sum_s += (leg.xy().norm() / envelope.cruise_m_s).max(leg.z.abs() / envelope.climb_m_s);
        from = to;
    }
    sum_s
}

/// The speed at which a vehicle of this envelope that has so long to go, s, arrives with these others, m/s; those that
/// are not heard any more do not count.
pub fn speed_m_s<'a>(
    own_s: f64,
    others: impl IntoIterator<Item = &'a Neighbour>,
    envelope: &Envelope,
) -> f64 {
    let is_heard = |other: &&Neighbour| other.armed && other.track.cooperative;
    let times_s = others.into_iter().filter(is_heard).filter_map(|other| time_left_s(other, envelope));
    let last_s = times_s.fold(0.0, f64::max) - TOLERANCE_S;
    let share = if last_s > own_s { own_s / last_s } else { 1.0 };
    (share * envelope.cruise_m_s).max(SLOWEST_M_S)
}

/// The time that another one has to go by now, s: on its way since its last word, as far as it moves at all.
fn time_left_s(other: &Neighbour, envelope: &Envelope) -> Option<f64> {
    let share = (other.track.velocity.norm() / envelope.cruise_m_s).min(1.0);
    Some(other.to_go_s? - share * other.track.age_s)
}

#[cfg(test)]
mod tests {
    use skein_dbp::NodeName;
    use skein_planning::separation;
    use skein_wire::event::Right;

    use super::*;

    const ENVELOPE: Envelope = Envelope { cruise_m_s: 4.0, climb_m_s: 1.0, ..Envelope::DEFAULT };

    fn other(to_go_s: Option<f64>, speed_m_s: f64, age_s: f64) -> Neighbour {
        Neighbour {
            node: NodeName::new("uav/2").unwrap(),
            armed: true,
            goal: None,
            way: None,
            right: Right::Free,
            to_go_s,
            track: separation::Neighbour {
                id: 0,
                position: Vector3::zeros(),
                velocity: Vector3::new(speed_m_s, 0.0, 0.0),
                sigma_m: 0.0,
                age_s,
                radius_m: 0.25,
                cooperative: age_s <= 1.0,
            },
        }
    }

    #[test]
    fn a_way_takes_as_long_as_each_leg_does_level_or_up() {
        let way = [[0.0, 0.0, 2.0], [8.0, 0.0, 2.0], [8.0, 4.0, 7.0]].map(Vector3::from);
        assert_eq!(to_go_s(way, &ENVELOPE), 2.0 + 5.0);
        assert_eq!(to_go_s([], &ENVELOPE), 0.0);
    }

    #[test]
    fn who_has_less_to_go_flies_so_much_slower_and_the_last_at_cruise() {
        let speed = |own_s, others: &[Neighbour]| speed_m_s(own_s, others, &ENVELOPE);
        let held = other(Some(20.25), 0.0, 0.5);
        assert_eq!(speed(10.0, std::slice::from_ref(&held)), 2.0);
        assert_eq!(speed(10.0, &[held.clone(), other(Some(5.0), 4.0, 0.0)]), 2.0);
        assert_eq!(speed(25.0, &[held]), 4.0);
        assert_eq!(speed(10.0, &[other(Some(20.25), 2.0, 0.5)]), 4.0 * 10.0 / 19.75, "it has moved on since");
        assert_eq!(speed(10.0, &[other(Some(10.2), 0.0, 0.0)]), 4.0, "they are together already");
        assert_eq!(
            speed(0.1, &[other(Some(500.0), 0.0, 0.0)]),
            SLOWEST_M_S,
            "nobody stands still for others"
        );
    }

    #[test]
    fn who_is_lost_or_does_not_go_there_is_not_waited_for() {
        assert_eq!(speed_m_s(10.0, &[other(Some(40.0), 0.0, 1.1), other(None, 0.0, 0.0)], &ENVELOPE), 4.0);
        let landed = Neighbour { armed: false, ..other(Some(40.0), 0.0, 0.0) };
        assert_eq!(speed_m_s(10.0, &[landed], &ENVELOPE), 4.0);
    }
}
