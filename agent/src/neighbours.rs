//! A vehicle's knowledge of the others: their last word, which stays, as a ghost that the safety filter lets grow,
//! when they fall silent.
//!
//! How old a word is, the time on the network included, is known from echoes: each vehicle tells the others in turn
//! what it has last heard of them. From the round trip follows where the other's clock stands (NTP, RFC 5905), and
//! from that the age of everything it says, whichever way each message took.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use nalgebra::Vector3;
use skein_bp::Bound;
use skein_dbp::NodeName;
use skein_planning::{Path, separation};
use skein_wire::event::Right;
use skein_wire::{Echo, State};

use crate::config::Envelope;
use crate::positioning::excess_m;

/// A neighbour silent for longer than this is not relied on to keep its distance: with three of ten messages lost,
/// that is one in 170 000.
const SILENT_AFTER: Duration = Duration::from_millis(1000);
/// Clocks drift apart by no more than this, seconds in a second: a round trip that took this much longer by now tells
/// as much.
const DRIFT: f64 = 1e-3;
/// Older words are not told back.
const ECHO_FOR: Duration = Duration::from_millis(500);

/// Neighbours are heard this often at least, while they are, s.
const PERIOD_S: f64 = 0.5;
/// One that is silent may fly anywhere, from its last word until this vehicle is up, s.
const CLIMB_S: f64 = 4.0;
/// Beyond this it may be anywhere in the arena, s.
const MOST_UNSEEN_S: f64 = 4.0;
/// After so long a silence, s, its failsafe has landed it, or its mission is over.
const SURELY_DOWN_S: f64 = 45.0;
/// One that falls silent farther away than this share of a short radio's range has flown out of it.
const EDGE_OF_RANGE: f64 = 0.75;

/// The last state heard of each other vehicle.
#[derive(Debug)]
pub struct Neighbours {
    me: NodeName,
    incarnation: u64,
    last: BTreeMap<NodeName, Heard>,
    /// So many are remembered.
    most: usize,
    /// The range of a short radio, m.
    radio_range_m: Option<f64>,
    /// Where this vehicle is, as far as it knows, world ENU, m.
    place: Option<Vector3<f64>>,
    /// Whom the newest echo was for.
    echoed: Option<NodeName>,
    /// Everybody as of the last look around.
    around: Vec<Neighbour>,
}

#[derive(Debug)]
struct Heard {
    state: State,
    way: Option<Arc<Path>>,
    /// When it arrived, on this vehicle's clock.
    at: Duration,
    /// The distance over which it was heard, m, if this vehicle knew where it was.
    apart_m: Option<f64>,
    clock: Option<Clock>,
}

/// Where another vehicle's clock stands.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Clock {
    /// This vehicle's clock less the other's, seconds.
    behind_s: f64,
    /// The round trip that told, seconds: half of it is the most by which `behind_s` is wrong.
    round_trip_s: f64,
    /// When it told, on this vehicle's clock.
    at: Duration,
}

/// One neighbour, as of now.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbour {
    pub node: NodeName,
    /// Whether its motors are armed: from before take-off until after landing.
    pub armed: bool,
    /// The end of its path, as far as it told it; none if it has none. World ENU, m.
    pub goal: Option<Vector3<f64>>,
    /// Its last word with age and uncertainty, as the separation takes it.
    pub track: separation::Neighbour,
    /// The way that it means to fly, if it has one.
    pub way: Option<Arc<Path>>,
    /// Its right to go first where there is room for one.
    pub right: Right,
    /// Time that it still had to fly at its cruise speed to arrive together with others, s, by its last word.
    pub to_go_s: Option<f64>,
}

/// A vehicle slower than this stands, m/s.
pub const STANDING_M_S: f64 = 0.5;

impl Neighbour {
    /// Where it should be now, metres ENU.
    pub fn position(&self) -> Vector3<f64> {
        self.track.predicted()
    }

    /// Where it stays, or means to: the end of its path, as far as it told it, else where it is. Metres ENU.
    pub fn end(&self) -> Vector3<f64> {
        self.goal.unwrap_or_else(|| self.position())
    }

    /// Whether it was in the air when it was last heard, and is not heard any more.
    pub fn has_fallen_silent(&self) -> bool {
        self.armed && !self.track.cooperative
    }

    /// Whether it stands, as far as is known, or has fallen silent.
    pub fn stands(&self) -> bool {
        !self.track.cooperative || self.track.velocity.norm() < STANDING_M_S
    }

    /// The distance that a vehicle of this envelope keeps from it where both stand, centre to centre, m: more
    /// from one that flies and has fallen silent.
    pub fn kept_m(&self, envelope: &Envelope) -> f64 {
        let track = match self.has_fallen_silent() {
            true => self.track,
            false => separation::Neighbour { sigma_m: 0.0, age_s: 0.0, ..self.track },
        };
        separation::distance_kept_m(0.0, &track, &envelope.filter())
    }

    /// Whether it may fly where a vehicle of this envelope would climb from `place`, now or before that is up, as far
    /// as can be known: one that is silent may have come closer meanwhile.
    pub fn may_be_over(&self, place: &Vector3<f64>, envelope: &Envelope) -> bool {
        let unseen_s = match self.track.age_s {
            age_s if !(PERIOD_S..=SURELY_DOWN_S).contains(&age_s) => 0.0,
            age_s => age_s.min(MOST_UNSEEN_S) + CLIMB_S,
        };
        let (offset, velocity) = (self.position().xy() - place.xy(), self.track.velocity.xy());
        let speed_m_s = velocity.norm();
        // Straight on, it is nearest when it is abeam.
        let abeam_s = (-offset.dot(&velocity) / speed_m_s.powi(2).max(1e-6)).clamp(0.0, CLIMB_S);
        let passes = if speed_m_s < STANDING_M_S { offset } else { offset + velocity * abeam_s };
        let off_m = excess_m(self.track.sigma_m);
        self.armed && passes.norm() <= envelope.separation_m + off_m + unseen_s * envelope.cruise_m_s
    }
}

impl Neighbours {
    /// Nobody has been heard of yet by `me` in this incarnation. In a fleet of so many `members` no more are
    /// remembered, nor, where nobody is known to be one, than [`Bound::Strangers`].
    pub fn new(me: NodeName, incarnation: u64, members: usize) -> Self {
        let most = members.max(Bound::Strangers.most());
        Self {
            me,
            incarnation,
            last: BTreeMap::new(),
            most,
            radio_range_m: None,
            place: None,
            echoed: None,
            around: Vec::new(),
        }
    }

    /// The same with a radio that reaches so far, m, if it does not reach everywhere.
    #[must_use]
    pub fn within_radio_range(self, radio_range_m: Option<f64>) -> Self {
        Self { radio_range_m, ..self }
    }

    /// Takes in where this vehicle is, world ENU, m.
    pub fn listen_at(&mut self, place: Option<Vector3<f64>>) {
        self.place = place;
    }

    /// Takes in a state message that arrived at `now`; one older than the last is dropped.
    pub fn hear(&mut self, now: Duration, state: State) {
        let last = self.last.get(&state.node);
        let newest = last
            .is_none_or(|last| (state.incarnation, state.time) > (last.state.incarnation, last.state.time));
        let known =
            last.filter(|last| last.state.incarnation == state.incarnation).and_then(|last| last.clock);
        if newest && self.makes_room(now, &state.node) {
            let clock = better(now, known, self.clock_of(now, &state));
            let way = Some(&state.path).filter(|points| points.len() > 1).cloned().and_then(Path::new);
            let apart_m = self.place.map(|place| (place - state.position).norm());
            self.last
                .insert(state.node.clone(), Heard { way: way.map(Arc::new), state, at: now, apart_m, clock });
        }
    }

    /// Whether there is room for `node`: first come, first kept, but for one that is silent and surely down by now.
    fn makes_room(&mut self, now: Duration, node: &NodeName) -> bool {
        if self.last.len() < self.most || self.last.contains_key(node) {
            return true;
        }
        let is_down = |heard: &Heard| now.saturating_sub(heard.at).as_secs_f64() > SURELY_DOWN_S;
        let down = self.last.iter().find(|(_, heard)| is_down(heard)).map(|(node, _)| node.clone());
        down.is_some_and(|down| self.last.remove(&down).is_some())
    }

    /// The sender's clock, from the echo in a state that arrives at `now`.
    fn clock_of(&self, now: Duration, state: &State) -> Option<Clock> {
        let echo = state.echo.as_ref()?;
        let is_mine = echo.node == self.me && echo.incarnation == self.incarnation;
        let round_trip_s = now.checked_sub(echo.time)?.checked_sub(echo.held)?.as_secs_f64();
        let sent_s = now.as_secs_f64() - 0.5 * round_trip_s;
        is_mine.then_some(Clock { behind_s: sent_s - state.time.as_secs_f64(), round_trip_s, at: now })
    }

    /// An echo for one of the others, each in turn.
    pub fn echo(&mut self, now: Duration) -> Option<Echo> {
        let is_fresh = |heard: &&Heard| now.saturating_sub(heard.at) <= ECHO_FOR;
        let after = |heard: &&Heard| self.echoed.as_ref().is_none_or(|echoed| heard.state.node > *echoed);
        let heard =
            self.last.values().filter(is_fresh).find(after).or_else(|| self.last.values().find(is_fresh))?;
        let (State { node, incarnation, time, .. }, held) = (&heard.state, now.saturating_sub(heard.at));
        let echo = Echo { node: node.clone(), incarnation: *incarnation, time: *time, held };
        self.echoed = Some(node.clone());
        Some(echo)
    }

    /// Takes stock of everybody as of `now`, for [`around`](Self::around).
    pub fn look_around(&mut self, now: Duration) {
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.extend(self.at(now));
        self.around = around;
    }

    /// Takes nobody into account until the next look around.
    pub fn look_away(&mut self) {
        self.around.clear();
    }

    /// Number of other vehicles that are remembered.
    pub fn remembered(&self) -> usize {
        self.last.len()
    }

    /// Everybody as of the last look around, in the order of their names.
    pub fn around(&self) -> &[Neighbour] {
        &self.around
    }

    /// Every neighbour as of `now`, in the order of their names, but those that have flown out of range.
    pub fn at(&self, now: Duration) -> impl Iterator<Item = Neighbour> + '_ {
        let is_in_range = move |(_, heard): &(u32, &Heard)| {
            let is_at_edge = |range_m| heard.apart_m.is_some_and(|apart_m| apart_m > EDGE_OF_RANGE * range_m);
            !heard.is_silent(now) || !self.radio_range_m.is_some_and(is_at_edge)
        };
        (0_u32..).zip(self.last.values()).filter(is_in_range).map(move |(id, heard)| {
            let state = &heard.state;
            Neighbour {
                node: state.node.clone(),
                armed: state.armed,
                goal: state.path.last().copied(),
                way: heard.way.clone(),
                right: state.right,
                to_go_s: state.to_go_s,
                track: separation::Neighbour {
                    id,
                    position: state.position,
                    velocity: state.velocity,
                    sigma_m: state.position_sigma_m,
                    age_s: heard.age_s(now),
                    radius_m: state.radius_m,
                    cooperative: !heard.is_silent(now),
                },
            }
        })
    }

    /// The nearest neighbour's name and distance in metres.
    pub fn nearest(&self, now: Duration, position: Vector3<f64>) -> Option<(NodeName, f64)> {
        self.at(now)
            .map(|neighbour| ((neighbour.position() - position).norm(), neighbour.node))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(distance, node)| (node, distance))
    }
}

impl Heard {
    fn is_silent(&self, now: Duration) -> bool {
        now.saturating_sub(self.at) > SILENT_AFTER
    }

    /// Since it was said; since it arrived, while the time on the network is not known.
    fn age_s(&self, now: Duration) -> f64 {
        let since_arrival_s = now.saturating_sub(self.at).as_secs_f64();
        self.clock.map_or(since_arrival_s, |clock| {
            let said_s = self.state.time.as_secs_f64() + clock.behind_s;
            (now.as_secs_f64() - said_s).max(since_arrival_s)
        })
    }
}

/// Of two tellings the one that may be less wrong by now.
fn better(now: Duration, known: Option<Clock>, heard: Option<Clock>) -> Option<Clock> {
    let wrong_s =
        |clock: &Clock| 0.5 * clock.round_trip_s + DRIFT * now.saturating_sub(clock.at).as_secs_f64();
    known.into_iter().chain(heard).min_by(|a, b| wrong_s(a).total_cmp(&wrong_s(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    fn name(number: u32) -> NodeName {
        NodeName::new(&format!("uav/{number}")).unwrap()
    }

    fn age_s(neighbours: &Neighbours, now: Duration) -> f64 {
        neighbours.at(now).next().unwrap().track.age_s
    }

    /// Two vehicles whose clocks are 70 s apart tell one another where they are; a message takes `there` one way and
    /// `back` the other.
    fn converse(there: Duration, back: Duration) -> (Neighbours, Duration) {
        let apart = ms(70_000);
        let (mut one, mut other) = (Neighbours::new(name(1), 1, 4), Neighbours::new(name(2), 1, 4));
        for start in [ms(1000), ms(2000), ms(3000)] {
            let said = State { incarnation: 1, time: start, echo: one.echo(start), ..State::new(name(1)) };
            other.hear(start + there + apart, said);
            let answers = start + there + ms(40);
            let echo = other.echo(answers + apart);
            let said = State { incarnation: 1, time: answers + apart, echo, ..State::new(name(2)) };
            one.hear(answers + back, said);
        }
        (one, ms(3040) + there + back)
    }

    #[test]
    fn a_word_is_as_old_as_it_was_long_on_the_way_whatever_the_clocks_say() {
        let (one, now) = converse(ms(300), ms(300));
        assert!((age_s(&one, now) - 0.3).abs() < 1e-6, "{}", age_s(&one, now));
        assert!((age_s(&one, now + ms(100)) - 0.4).abs() < 1e-6);
        let (one, now) = converse(ms(100), ms(300));
        assert!((age_s(&one, now) - 0.2).abs() < 1e-6, "half of the round trip, and half of it is the error");
    }

    #[test]
    fn a_late_word_is_known_to_be_late() {
        let (mut one, now) = converse(ms(10), ms(10));
        let time = now + ms(70_000);
        one.hear(now + ms(450), State { incarnation: 1, time, ..State::new(name(2)) });
        assert!((age_s(&one, now + ms(450)) - 0.45).abs() < 1e-6);
    }

    #[test]
    fn without_an_echo_or_after_a_restart_age_counts_from_arrival() {
        let (mut one, now) = converse(ms(300), ms(300));
        one.hear(now, State { incarnation: 2, time: ms(5), ..State::new(name(2)) });
        assert_eq!(age_s(&one, now + ms(60)), 0.06);
    }

    #[test]
    fn echoes_for_others_or_for_a_former_life_tell_nothing() {
        let mut one = Neighbours::new(name(1), 2, 4);
        for echo in [
            Echo { node: name(3), incarnation: 2, time: ms(500), held: ms(0) },
            Echo { node: name(1), incarnation: 1, time: ms(500), held: ms(0) },
            Echo { node: name(1), incarnation: 2, time: ms(9000), held: ms(0) },
        ] {
            let time = ms(1000) + echo.time;
            one.hear(ms(1000), State { time, echo: Some(echo), ..State::new(name(2)) });
            assert_eq!(age_s(&one, ms(1000)), 0.0);
        }
    }

    #[test]
    fn everybody_gets_an_echo_in_turn() {
        let mut one = Neighbours::new(name(1), 1, 4);
        for number in [2, 3, 4] {
            one.hear(ms(100), State { time: ms(50), ..State::new(name(number)) });
        }
        let told: Vec<_> = (0..4).filter_map(|_| one.echo(ms(120))).map(|echo| echo.node).collect();
        assert_eq!(told, [name(2), name(3), name(4), name(2)]);
        assert_eq!(one.echo(ms(2000)), None, "what was heard long ago is not told back");
    }

    #[test]
    fn ever_new_vehicles_displace_nobody_who_was_heard() {
        let mut one = Neighbours::new(name(1), 1, 2);
        let hear = |one: &mut Neighbours, at, number| {
            one.hear(at, State { time: at, ..State::new(name(number)) });
        };
        hear(&mut one, ms(1), 2);
        (1000..31_000).for_each(|number| hear(&mut one, ms(2), number));
        assert_eq!(one.at(ms(3)).count(), Bound::Strangers.stated());
        assert!(one.at(ms(3)).any(|neighbour| neighbour.node == name(2)));
        hear(&mut one, ms(60_000), 3);
        assert!(one.at(ms(60_000)).any(|neighbour| neighbour.node == name(3)), "who is down makes room");
        let mut large = Neighbours::new(name(1), 1, 200);
        (2..200).for_each(|number| hear(&mut large, ms(1), number));
        assert_eq!(large.at(ms(3)).count(), 198, "members are all heard");
    }

    #[test]
    fn one_that_flies_this_way_may_be_over_a_vehicle_before_it_is_up() {
        let mut one = Neighbours::new(name(1), 1, 4);
        let mut may_be_over = |place: [f64; 2], east_m_s: f64| {
            let [x, y] = place;
            let (position, velocity) = (Vector3::new(x, y, 1.5), Vector3::new(east_m_s, 0.0, 0.0));
            let now = one.last.values().map(|heard| heard.at).max().unwrap_or_default() + ms(100);
            one.hear(now, State { time: now, position, velocity, armed: true, ..State::new(name(2)) });
            one.at(now).next().unwrap().may_be_over(&Vector3::zeros(), &Envelope::default())
        };
        assert!(may_be_over([-4.0, 0.0], 1.5));
        assert!(!may_be_over([-4.0, 0.0], 0.2), "it stands");
        assert!(
            !may_be_over([-4.0, 0.0], -1.5)
                && !may_be_over([-9.0, 0.0], 1.5)
                && !may_be_over([-4.0, 3.0], 1.5)
        );
        assert!(may_be_over([1.0, 0.5], 1.5), "it is");
    }

    #[test]
    fn one_that_is_silent_is_not_relied_on() {
        let mut one = Neighbours::new(name(1), 1, 4);
        one.hear(ms(0), State { time: ms(0), ..State::new(name(2)) });
        let relied_on = |now| one.at(now).next().unwrap().track.cooperative;
        assert!(relied_on(ms(1000)) && !relied_on(ms(1001)));
    }

    #[test]
    fn with_a_short_radio_who_falls_silent_at_its_edge_has_flown_out_of_range() {
        for (range_m, at_m, remains) in
            [(None, 14.0, true), (Some(15.0), 14.0, false), (Some(15.0), 5.0, true)]
        {
            let mut one = Neighbours::new(name(1), 1, 4).within_radio_range(range_m);
            one.listen_at(Some(Vector3::zeros()));
            let position = Vector3::new(at_m, 0.0, 0.0);
            one.hear(ms(0), State { time: ms(0), position, armed: true, ..State::new(name(2)) });
            assert_eq!(one.at(ms(900)).count(), 1);
            assert_eq!(one.at(ms(1001)).count() == 1, remains, "{range_m:?} {at_m}");
        }
    }
}
