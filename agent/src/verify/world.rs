//! The world around a vehicle's program, as far as it is verified: what autopilot, perception, planner, other nodes and
//! people may tell it, and when.
//!
//! Each part is an abstraction of the code or the person that tells these events: it offers all that those can tell, and
//! perhaps more, with one or two values of data that b-threads tell apart.

use skein_bp::{Event, EventSet};
use skein_dbp::facts::{BLOCK_LAPSED, CONFIRMED, DUPLICATE_NAME, IN_STEP, PEER_JOINED, PEER_LOST, STALLED};
use skein_wire::vocabulary::{
    self, ABORT, ADVANCE, AHEAD, AIRBORNE, ARRIVED, AT, BATTERY, BATTERY_CRITICAL, BATTERY_LOW, CLEAR,
    COMMAND_FAILED, ENTER, FENCE_BREACHED, FOUND_AIRBORNE, GOTO, HAND_BACK, LAND, LANDED, LAUNCH, LEAVE,
    NEIGHBOUR, ORDER, PASSAGE, PATH_BLOCKED, PILOT, PLAN, PLANNED, READY, SLEPT, STUCK, SWARM, TAKEOFF,
    TOO_CLOSE, UNPLANNABLE, UNREADY,
};

use super::part::{Part, Place};
use crate::bthreads::{HOME_LEG, OPERATOR_LEG, RIGHT_OF_WAY};
use crate::{config::AgentConfig, me::Me, precedence, safety_events::safety_events};

/// The place of the part `flight` in which the vehicle stands on the ground.
pub(super) const ON_THE_GROUND: &str = "on the ground";
/// The same, before the agent has heard of it.
pub(super) const UNHEARD_OF: &str = "not heard of";

/// What the vehicle's autopilot and guidance report only while the agent flies it.
const ON_THE_WAY: [&str; 8] = [ARRIVED, PATH_BLOCKED, STUCK, PASSAGE, AT, AHEAD, NEIGHBOUR, BATTERY];
/// What is watched in the air only.
const IN_THE_AIR: [&str; 5] = [BATTERY_LOW, BATTERY_CRITICAL, FENCE_BREACHED, TOO_CLOSE, CLEAR];

/// The flight as `flight.rs` conducts it with the autopilot; `disturbed`: commands may fail, and a pilot may take over.
pub(super) fn flight(me: &Me, disturbed: Disturbed) -> Part {
    let told = |verb: &str| me.event(verb);
    let grounded = |name: &str| {
        Place::new(name)
            .hears(me.any(TAKEOFF), "taking off")
            .rules_out(me.any_of(&IN_THE_AIR))
            .rules_out(me.any_of(&ON_THE_WAY))
    };
    let not_flying = |name: &str| Place::new(name).rules_out(me.any_of(&ON_THE_WAY)).rules_out(me.any(READY));
    let taken = |place: Place| match disturbed.pilot {
        true => place.offers(told(PILOT).with("mode", "posctl"), "taken"),
        false => place,
    };
    let taken_or_asleep = |place: Place| match disturbed.pilot {
        true => taken(place).offers(told(SLEPT).with("seconds", 2.0), "taken"),
        false => place,
    };
    let lands = |place: Place| place.hears(me.any(LAND), "landing");
    let unheard_of = match disturbed.pilot {
        true => taken(grounded(UNHEARD_OF)).offers(told(FOUND_AIRBORNE), "adopted"),
        false => grounded(UNHEARD_OF),
    };
    let taking_off =
        lands(Place::new("taking off").rules_out(me.any_of(&ON_THE_WAY)).offers(told(AIRBORNE), "flying"));
    let taking_off = match disturbed.refusals {
        true => taking_off.offers(me.because(COMMAND_FAILED, "Arm: denied"), ON_THE_GROUND),
        false => taking_off,
    };
    let order = |what: &str| me.any(ORDER).and(EventSet::field_is("what", what));
    Part::new(vec![
        unheard_of.hears(me.any(READY), ON_THE_GROUND),
        taken(grounded(ON_THE_GROUND)),
        taken_or_asleep(taking_off),
        taken_or_asleep(lands(
            Place::new("flying").rules_out(me.any(READY)).offers(told(LANDED), ON_THE_GROUND),
        )),
        taken(Place::new("landing").rules_out(me.any(READY)).offers(told(LANDED), ON_THE_GROUND)),
        not_flying("taken").offers(told(LANDED), ON_THE_GROUND).hears(me.any(HAND_BACK), "engaging"),
        taken_or_asleep(lands(not_flying("engaging").offers(told(AIRBORNE), "flying"))),
        taken(lands(not_flying("adopted")))
            .offers(told(LANDED), ON_THE_GROUND)
            .hears(order("resume").or(order("return")), "engaging"),
    ])
}

/// What goes wrong with a flight.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Disturbed {
    /// The autopilot refuses to take off.
    pub(super) refusals: bool,
    /// A pilot takes over, the agent sleeps, or starts in the air.
    pub(super) pilot: bool,
}

/// Paths and progress along them, as guidance reports them; `hard`: paths are not found or turn out blocked, and the vehicle
/// gets stuck.
pub(super) fn guidance(me: &Me, legs: &[i64], hard: bool) -> Part {
    let to = |leg: i64| format!("heading for {leg}");
    let new_leg = |place: Place| {
        let goto = |leg: i64| me.any(GOTO).and(EventSet::field_is("leg", leg));
        let place = legs.iter().fold(place, |place, leg| place.hears(goto(*leg), to(*leg)));
        place.hears(me.any(LANDED), "nowhere")
    };
    let mut places = vec![
        new_leg(Place::new("nowhere").hears(me.any(PLAN), "planning for nowhere")),
        new_leg(
            Place::new("planning for nowhere")
                .offers(me.because(UNPLANNABLE, "there is no waypoint").with("leg", 0), "nowhere"),
        ),
    ];
    for leg in legs {
        let [planning, following, blocked, arrived] =
            ["planning for", "following to", "blocked on the way to", "arrived at"]
                .map(|what| format!("{what} {leg}"));
        let place = |name: &str| new_leg(Place::new(name).hears(me.any(PLAN), planning.as_str()));
        let arrives = |place: Place| place.offers(me.event(ARRIVED).with("leg", *leg), arrived.as_str());
        let plans = Place::new(planning.as_str())
            .offers(me.event(PLANNED).with("leg", *leg).with("length_m", 20.0), following.as_str());
        let no_path = me.because(UNPLANNABLE, "no path").with("leg", *leg);
        let follows = arrives(place(&following));
        places.push(arrives(place(&to(*leg))));
        places.push(place(&arrived));
        if hard {
            places.push(new_leg(plans.offers(no_path, to(*leg))));
            places.push(
                follows.offers(me.event(PATH_BLOCKED), blocked.as_str()).keeps_offering(me.event(STUCK)),
            );
            places.push(arrives(place(&blocked)).keeps_offering(me.event(STUCK)));
        } else {
            places.push(new_leg(plans));
            places.push(follows);
        }
    }
    Part::new(places)
}

/// The legs that a mission of so many waypoints has, with the way home and an operator's point.
pub(super) fn legs(waypoints: usize) -> Vec<i64> {
    (0..).take(waypoints).chain([HOME_LEG, OPERATOR_LEG]).collect()
}

/// A narrow passage on the way, and what becomes of the claim to it.
pub(super) fn passage(me: &Me, other: Option<&str>) -> Part {
    let at = |event: Event| event.with("x", 5.0).with("y", 0.0).with("z", 2.0);
    let of_claim = |fact: &str| me.event(fact).with("bthread", RIGHT_OF_WAY);
    let stalled = |by: &str| {
        let enter = me.event(ENTER);
        me.event(STALLED).with("event", enter.name()).with("by", format!("{by}#{RIGHT_OF_WAY}"))
    };
    // Whatever this vehicle's number, one goes before it and one after.
    let mut ahead = Place::new("ahead")
        .offers(me.event(LEAVE), "none")
        .hears(me.any(LANDED), "none")
        .keeps_offering(of_claim(CONFIRMED))
        .keeps_offering(of_claim(BLOCK_LAPSED).with("home", other.unwrap_or("uav/0")))
        .keeps_offering(stalled("uav/0"))
        .keeps_offering(stalled("uav/4294967295"));
    if let Some(other) = other {
        ahead = ahead.keeps_offering(vocabulary::event(other, LEAVE));
    }
    Part::new(vec![Place::new("none").offers(at(me.event(PASSAGE)), "ahead"), ahead])
}

/// Preflight checks. Once the vehicle is up, or another has armed it, they fail in the same tick.
pub(super) fn checks(me: &Me) -> Part {
    let up = me.any_of(&[AIRBORNE, PILOT, FOUND_AIRBORNE, SLEPT]);
    let up_at_once = Place::new("failing, not yet told").rules_out(me.any(TAKEOFF));
    Part::new(vec![
        Place::new("failing").offers(me.event(READY), "passing"),
        Place::new("passing").offers(me.event(UNREADY), "failing").hears(up, "failing, not yet told"),
        up_at_once.offers(me.event(UNREADY), "failing"),
    ])
}

/// The battery. What is low may recover and be low again, as the way home gets shorter and longer.
pub(super) fn battery(me: &Me) -> Part {
    let place = Place::new("used");
    Part::of_one(place.keeps_offering(me.event(BATTERY_LOW)).keeps_offering(me.event(BATTERY_CRITICAL)))
}

/// The vehicle's place relative to its fence.
pub(super) fn fence(me: &Me) -> Part {
    Part::of_one(Place::new("near").keeps_offering(me.event(FENCE_BREACHED)))
}

/// Another vehicle that comes too close.
pub(super) fn closeness(me: &Me, other: Option<&str>) -> Part {
    Part::new(vec![
        Place::new("far").offers(me.event(TOO_CLOSE).with("other", other.unwrap_or("uav/0")), "close"),
        Place::new("close").offers(me.event(CLEAR), "far"),
    ])
}

/// Another process under this vehicle's name.
pub(super) fn namesake(me: &Me) -> Part {
    Part::of_one(Place::new("may be").keeps_offering(me.event(DUPLICATE_NAME)))
}

/// Another node that is heard and lost. Lost, it may have had a claim to a passage.
pub(super) fn peer(me: &Me, node: &str) -> Part {
    let fact = |fact: &str| me.event(fact).with("node", node);
    let claiming = fact(PEER_LOST).with("released", RIGHT_OF_WAY);
    Part::new(vec![
        Place::new("unheard").offers(fact(PEER_JOINED), "heard"),
        Place::new("heard").offers(fact(PEER_LOST), "lost").offers(claiming, "lost"),
        Place::new("lost").offers(fact(PEER_JOINED), "heard"),
    ])
}

/// An operator who gives these orders.
pub(super) fn operator(me: &Me, config: &AgentConfig, orders: &[&str]) -> Part {
    let at = |what: &str, [x, y, z]: [f64; 3]| {
        me.event(ORDER).with("what", what).with("x", x).with("y", y).with("z", z)
    };
    let [x, y, z] = config.fence.max;
    let offers = orders.iter().fold(Place::new("there"), |place, what| match *what {
        "goto" => place
            .keeps_offering(at("goto", config.home))
            .keeps_offering(at("goto", [x + 10.0, y, z]))
            .keeps_offering(vocabulary::order(me.name(), "goto")),
        what => place.keeps_offering(vocabulary::order(me.name(), what)),
    });
    Part::of_one(offers)
}

/// What the ground station's bids for this vehicle are; they change with these events.
pub(super) fn ground_bids(me: &Me) -> [(String, Part); 3] {
    let arrives = |what: &str| Event::new(format!("ground's bids/{what}"));
    let set = |what: &str| EventSet::from(arrives(what));
    let changes = ["launch", "hold", "hold all", "lapse"]
        .into_iter()
        .fold(Place::new("there"), |place, what| place.keeps_offering(arrives(what)));
    let silent = |place: Place| place.hears(set("lapse"), "silent");
    let launch = Part::new(vec![
        Place::new("silent").hears(set("launch"), "asking"),
        silent(Place::new("asking").offers(me.event(TAKEOFF), "silent")),
    ]);
    // What the home honours of it.
    let all = me.any_of(&[TAKEOFF, GOTO, ADVANCE, ENTER]).and(safety_events(me).not());
    let hold = Part::new(vec![
        Place::new("silent").hears(set("hold"), "holding").hears(set("hold all"), "holding all"),
        silent(Place::new("holding").rules_out(me.any(ADVANCE))),
        silent(Place::new("holding all").rules_out(all)),
    ]);
    [
        ("world/ground's bids".to_owned(), Part::of_one(changes)),
        ("ground#launch".to_owned(), launch.with_priority(precedence::MISSION)),
        ("ground#hold".to_owned(), hold.with_priority(precedence::MISSION)),
    ]
}

/// The swarm's joint decisions. They are told before `in_step` when they were taken without this vehicle.
pub(super) fn together(me: &Me, coordinator: &str) -> Part {
    let decision = |verb: &str| vocabulary::event(SWARM, verb);
    let lost = me.any(PEER_LOST).and(EventSet::field_is("node", coordinator));
    let decides = |place: Place| place.keeps_offering(decision(LAUNCH)).keeps_offering(decision(ABORT));
    let in_step = me.event(IN_STEP).with("coordinator", coordinator);
    Part::new(vec![
        decides(Place::new("out of step")).offers(in_step, "in step"),
        decides(Place::new("in step")).hears(lost, "out of step"),
    ])
}

/// What is told to scripts, in the air only: these events.
pub(super) fn script_facts(told: impl IntoIterator<Item = Event>) -> Part {
    let place = told.into_iter().fold(Place::new("told"), Place::keeps_offering);
    Part::of_one(place)
}
