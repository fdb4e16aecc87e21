//! Arrival together: vehicles tell one another how long they still have to fly at cruise speed, and those that have
//! less fly slower. Nobody leads, and nothing is agreed before: who is held up is waited for as long as it is heard.
//!
//! Nobody goes on to the end before all are about as near to it: those who wait hover there, at the gate. Whoever is
//! held up before it still has the way from the gate to the end in common with the others, and that takes as long as
//! setting out and stopping take.

use nalgebra::Vector3;

use crate::{config::Envelope, neighbours::Neighbour};

/// Who is so much ahead of the last one does not slow down for it, s: its word is that old by now.
const TOLERANCE_S: f64 = 0.25;
/// Slower than this, a vehicle cannot be told from one that is stuck, m/s: it hovers instead.
const SLOWEST_M_S: f64 = 0.3;
/// The way from the gate to the end is at least so long, s at cruise.
const SHORTEST_S: f64 = 2.0;

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
/// are not heard any more do not count. 0 is to hover until the others are nearer.
pub(crate) fn speed_m_s<'a>(
    own_s: f64,
    others: impl IntoIterator<Item = &'a Neighbour>,
    envelope: &Envelope,
) -> f64 {
    let is_heard = |other: &&Neighbour| other.armed && other.track.cooperative;
    let times_s = others.into_iter().filter(is_heard).filter_map(|other| time_left_s(other, envelope));
    pace_m_s(own_s, times_s.fold(0.0, f64::max), envelope)
}

/// The same beside one that has so long to go, s: the last of the others.
pub fn pace_m_s(own_s: f64, last_s: f64, envelope: &Envelope) -> f64 {
    let last_s = last_s - TOLERANCE_S;
    if last_s <= own_s {
        return envelope.cruise_m_s;
    }
    // While anybody is before the gate, that is where all are to be at one time.
    let gate_s = if last_s > gate_s(envelope) { gate_s(envelope) } else { 0.0 };
    let speed_m_s = envelope.cruise_m_s * (own_s - gate_s) / (last_s - gate_s);
    if speed_m_s < SLOWEST_M_S { 0.0 } else { speed_m_s }
}

/// The time from the gate to the end at cruise, s: enough to come to a stop and to set out again.
fn gate_s(envelope: &Envelope) -> f64 {
    SHORTEST_S + 2.0 * envelope.cruise_m_s / envelope.brake_m_s2
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
    fn who_has_less_to_go_to_the_gate_flies_so_much_slower_and_the_last_at_cruise() {
        // The gate is 5.2 s before the end.
        let speed = |own_s, others: &[Neighbour]| speed_m_s(own_s, others, &ENVELOPE);
        let held = other(Some(25.45), 0.0, 0.5);
        assert!((speed(15.2, std::slice::from_ref(&held)) - 2.0).abs() < 1e-9);
        assert!((speed(15.2, &[held.clone(), other(Some(5.0), 4.0, 0.0)]) - 2.0).abs() < 1e-9);
        assert_eq!(speed(30.0, &[held]), 4.0);
        let moved_on = speed(15.2, &[other(Some(25.45), 2.0, 0.5)]);
        assert!((moved_on - 4.0 * 10.0 / 19.75).abs() < 1e-9, "it has moved on since: {moved_on}");
        assert_eq!(speed(10.0, &[other(Some(10.2), 0.0, 0.0)]), 4.0, "they are together already");
    }

    #[test]
    fn nobody_goes_on_from_the_gate_before_the_last_is_there_and_then_all_go_together() {
        let speed = |own_s, last_s| speed_m_s(own_s, &[other(Some(last_s), 0.0, 0.0)], &ENVELOPE);
        assert_eq!([speed(5.3, 25.45), speed(4.0, 25.45), speed(4.0, 5.5)], [0.0, 0.0, 0.0]);
        assert_eq!(speed(4.0, 5.25), 4.0 * 4.0 / 5.0);
        assert_eq!(speed(0.1, 4.25), 0.0, "who is nearly there waits there");
    }

    #[test]
    fn who_is_lost_or_does_not_go_there_is_not_waited_for() {
        assert_eq!(speed_m_s(10.0, &[other(Some(40.0), 0.0, 1.1), other(None, 0.0, 0.0)], &ENVELOPE), 4.0);
        let landed = Neighbour { armed: false, ..other(Some(40.0), 0.0, 0.0) };
        assert_eq!(speed_m_s(10.0, &[landed], &ENVELOPE), 4.0);
    }
}
