//! Berth: whether the place where a way ends is to be had, or another vehicle stays there.

use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::separation::FilterConfig;

use super::course::Course;
use crate::{config::Envelope, neighbours::Neighbour, report::Report};

/// A vehicle that stands for so long stays, if it has nowhere to go.
const STAYS_AFTER: Duration = Duration::from_secs(2);
/// A vehicle that stands for so long stays, though it has somewhere to go.
const HELD_AFTER: Duration = Duration::from_secs(10);
/// From so much further away than both would keep, the place is seen to, m.
const LOOKS_M: f64 = 1.0;

/// Watches the place where the vehicle is to land.
#[derive(Debug, Default)]
pub struct Berth {
    /// The vehicle that stands there, and since when.
    standing: Option<(NodeName, Duration)>,
    /// Whether the one that has the place was said to be on its way elsewhere.
    leaves: bool,
}

impl Berth {
    /// The flight is over, or leads elsewhere.
    pub fn forget(&mut self) {
        self.standing = None;
    }

    /// Looks who has the place, once in each navigation cycle; says when that has changed.
    pub fn look(
        &mut self,
        now: Duration,
        course: &mut Course,
        position: &Vector3<f64>,
        envelope: &Envelope,
        neighbours: &[Neighbour],
    ) -> Option<Report> {
        let waypoint = course.waypoint.filter(|waypoint| waypoint.lands && !course.has_arrived)?;
        let Some(other) = standing_at(&waypoint.target, position, envelope, neighbours) else {
            self.standing = None;
            return course.taken_by.take().map(|_| Report::PlaceFree);
        };
        let since = match &self.standing {
            Some((node, since)) if *node == other.node => *since,
            _ => now,
        };
        self.standing = Some((other.node.clone(), since));
        let leads_away = |goal: Vector3<f64>| (goal - other.position()).xy().norm() > other.kept_m(envelope);
        let is_on_its_way = other.track.cooperative && other.armed && other.goal.is_some_and(leads_away);
        let stays = now.saturating_sub(since) >= if is_on_its_way { HELD_AFTER } else { STAYS_AFTER };
        let is_known = course.taken_by.as_ref() == Some(&other.node) && self.leaves == is_on_its_way;
        if !stays || is_known {
            return None;
        }
        self.leaves = is_on_its_way;
        course.taken_by = Some(other.node.clone());
        Some(Report::PlaceTaken { leg: waypoint.leg, by: other.node.clone(), leaves: is_on_its_way })
    }
}

/// The vehicles that stand so near to `place` that a vehicle at `position`, which is not far from it, may not come
/// there; not one that is further from it than that vehicle itself.
fn standing_at<'a>(
    place: &Vector3<f64>,
    position: &Vector3<f64>,
    envelope: &Envelope,
    neighbours: &'a [Neighbour],
) -> Option<&'a Neighbour> {
    let stretch = FilterConfig::default().vertical_stretch;
    let away_m = |from: &Vector3<f64>, to: &Vector3<f64>| {
        let offset = to - from;
        Vector3::new(offset.x, offset.y, offset.z / stretch).norm()
    };
    let own_m = (place - position).xy().norm();
    let is_there = |other: &&Neighbour| {
        let (kept_m, off_m) = (other.kept_m(envelope), away_m(place, &other.position()));
        other.stands() && off_m < kept_m && off_m < own_m && own_m < 2.0 * kept_m + LOOKS_M
    };
    neighbours.iter().find(is_there)
}

#[cfg(test)]
mod tests {
    use skein_planning::separation::Neighbour as Track;
    use skein_wire::event::Right;

    use super::*;
    use crate::instruction::Waypoint;

    const GOAL: Vector3<f64> = Vector3::new(10.0, 0.0, 3.0);
    const NEAR: Vector3<f64> = Vector3::new(7.5, 0.0, 3.0);

    fn course() -> Course {
        Course::to(Waypoint { leg: 0, target: GOAL, lands: true, is_home: false, beyond_s: None })
    }

    fn other(position: Vector3<f64>, goal: Option<Vector3<f64>>) -> Neighbour {
        let track = Track {
            id: 0,
            position,
            velocity: Vector3::zeros(),
            sigma_m: 0.1,
            age_s: 0.1,
            radius_m: 0.25,
            cooperative: true,
        };
        Neighbour {
            node: NodeName::new("uav/4").unwrap(),
            armed: true,
            goal,
            track,
            way: None,
            right: Right::Free,
            to_go_s: None,
        }
    }

    /// When a vehicle at `position` is told that its goal is taken while `other` is there, s; `None` within
    /// 20 s.
    fn told_s(position: Vector3<f64>, other: &Neighbour) -> Option<f64> {
        let (mut berth, mut course) = (Berth::default(), course());
        let envelope = Envelope::default();
        (0..200).map(|tick| f64::from(tick) * 0.1).find(|at_s| {
            let now = Duration::from_secs_f64(*at_s);
            let report = berth.look(now, &mut course, &position, &envelope, std::slice::from_ref(other));
            assert!(
                report.is_none()
                    || matches!(&report, Some(Report::PlaceTaken { leg: 0, by, .. }) if *by == other.node)
            );
            report.is_some()
        })
    }

    #[test]
    fn a_goal_where_another_stays_is_taken_once_that_has_stood_there_for_two_seconds() {
        let beside = GOAL + Vector3::y() * 1.3;
        assert_eq!(told_s(NEAR, &other(beside, None)), Some(2.0));
        assert_eq!(told_s(NEAR, &other(beside, Some(beside))), Some(2.0));
        assert_eq!(told_s(NEAR, &other(GOAL + Vector3::y() * 1.5, None)), None, "that is far enough");
        assert_eq!(told_s(Vector3::zeros(), &other(beside, None)), None, "from afar nobody knows yet");
        assert_eq!(told_s(GOAL + Vector3::x(), &other(beside, None)), None, "who is nearer has it");
        assert_eq!(
            told_s(NEAR, &other(GOAL - Vector3::z() * 2.9, None)),
            None,
            "over who has landed it may fly"
        );
    }

    #[test]
    fn who_has_somewhere_to_go_is_waited_for_later_and_who_flies_not_at_all() {
        let on_its_way = other(GOAL, Some(Vector3::new(-20.0, 0.0, 3.0)));
        assert_eq!(told_s(NEAR, &on_its_way), Some(10.0));
        let track = Track { velocity: Vector3::x(), ..on_its_way.track };
        assert_eq!(told_s(NEAR, &Neighbour { track, ..on_its_way.clone() }), None);
        let track = Track { cooperative: false, age_s: 9.0, ..track };
        assert_eq!(told_s(NEAR, &Neighbour { track, ..on_its_way }), Some(2.0), "who is lost there stays");
    }

    #[test]
    fn a_goal_is_free_again_once_nobody_stands_there() {
        let (mut berth, mut course, envelope) = (Berth::default(), course(), Envelope::default());
        let there = [other(GOAL, None)];
        let mut look = |seconds, others: &[Neighbour]| {
            berth.look(Duration::from_secs(seconds), &mut course, &NEAR, &envelope, others)
        };
        assert_eq!(look(0, &there), None);
        assert!(matches!(look(3, &there), Some(Report::PlaceTaken { .. })));
        assert_eq!(look(4, &there), None, "it is told once");
        let leaves = [other(GOAL, Some(Vector3::new(-20.0, 0.0, 3.0)))];
        assert!(matches!(look(14, &leaves), Some(Report::PlaceTaken { leaves: true, .. })), "it is to go on");
        assert_eq!([look(15, &[]), look(16, &[])], [Some(Report::PlaceFree), None]);
    }
}
