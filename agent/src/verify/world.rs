//! The world around a vehicle's program, as far as it is verified: what autopilot, perception, planner, other nodes and
//! people may tell it, and when.
//!
//! Each part is an abstraction of the code or the person that tells these events: it offers all that those can tell,
//! and perhaps more, with one or two values of data that b-threads tell apart.

use skein_bp::{Event, EventSet};
use skein_dbp::NodeName;
use skein_dbp::facts::{BlockLapsed, Confirmed, DuplicateName, InStep, PeerJoined, PeerLost, Stalled};
use skein_wire::event::{
    Abort, Advance, Ahead, Airborne, Arrived, At, BatteryCritical, BatteryLevel, BatteryLow, Clear,
    CommandFailed, Cornered, Declared as _, Enter, FenceBreached, FoundAirborne, Goto, HandBack, Handover,
    InTheWay, Land, Landed, Launch, Leave, Load, MakeWay, NeighbourAt, OrderTaken, OutOfTheWay, Passage,
    PathBlocked, PilotTook, PlaceFree, PlaceTaken, Plan, Planned, PositionDoubted, PositionTrusted, Ready,
    Right, SWARM, Slept, Stuck, Takeoff, TooClose, Unload, Unplannable, Unready, What,
};

use super::part::{Part, Place};
use crate::bthreads::{HOME_LEG, OPERATOR_LEG, RIGHT_OF_WAY};
use crate::{config::AgentConfig, me::Me, precedence, safety::safety_events};

/// The place of the part `flight` in which the vehicle stands on the ground.
pub(super) const ON_THE_GROUND: &str = "on the ground";
/// The same, before the agent has heard of it.
pub(super) const UNHEARD_OF: &str = "not heard of";

/// Reports of the autopilot and the guidance that come only while the agent flies the vehicle.
type OnTheWay = (Arrived, PathBlocked, Stuck, Passage, At, Ahead, NeighbourAt, BatteryLevel);
/// Reports of watches that look in the air only.
type InTheAir =
    (BatteryLow, BatteryCritical, FenceBreached, TooClose, Clear, PositionDoubted, PositionTrusted);

fn on_the_way(me: &Me) -> EventSet {
    me.any::<OnTheWay>().or(me.any::<(PlaceTaken, PlaceFree, InTheWay, Cornered)>())
}

/// The flight as `flight.rs` conducts it with the autopilot; `disturbed`: commands may fail, and a pilot may take over.
pub(super) fn flight(me: &Me, disturbed: Disturbed) -> Part {
    let grounded = |name: &str| {
        Place::new(name)
            .hears(me.any::<Takeoff>(), "taking off")
            .rules_out(me.any::<InTheAir>())
            .rules_out(on_the_way(me))
    };
    let not_flying = |name: &str| Place::new(name).rules_out(on_the_way(me)).rules_out(me.any::<Ready>());
    let taken = |place: Place| match disturbed.pilot {
        true => place.offers(me.event(PilotTook { mode: "manual".into(), by: "pilot".into() }), "taken"),
        false => place,
    };
    let taken_or_asleep = |place: Place| match disturbed.pilot {
        true => taken(place).offers(me.event(Slept { seconds: 2.0 }), "taken"),
        false => place,
    };
    let lands = |place: Place| place.hears(me.any::<Land>(), "landing");
    let unheard_of = match disturbed.pilot {
        true => taken(grounded(UNHEARD_OF)).offers(me.event(FoundAirborne), "adopted"),
        false => grounded(UNHEARD_OF),
    };
    let taking_off =
        lands(Place::new("taking off").rules_out(on_the_way(me)).offers(me.event(Airborne), "flying"));
    let taking_off = match disturbed.refusals {
        true => taking_off.offers(me.event(CommandFailed { why: "Arm: denied".into() }), ON_THE_GROUND),
        false => taking_off,
    };
    let order = |what: What| me.any::<OrderTaken>().and(OrderTaken::what(what));
    Part::new(vec![
        unheard_of.hears(me.any::<Ready>(), ON_THE_GROUND),
        taken(grounded(ON_THE_GROUND)),
        taken_or_asleep(taking_off),
        taken_or_asleep(lands(
            Place::new("flying").rules_out(me.any::<Ready>()).offers(me.event(Landed), ON_THE_GROUND),
        )),
        taken(Place::new("landing").rules_out(me.any::<Ready>()).offers(me.event(Landed), ON_THE_GROUND)),
        not_flying("taken").offers(me.event(Landed), ON_THE_GROUND).hears(me.any::<HandBack>(), "engaging"),
        taken_or_asleep(lands(not_flying("engaging").offers(me.event(Airborne), "flying"))),
        taken(lands(not_flying("adopted")))
            .offers(me.event(Landed), ON_THE_GROUND)
            .hears(order(What::Resume).or(order(What::Return)), "engaging"),
    ])
}

/// The disturbances of a flight.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Disturbed {
    /// The autopilot refuses to take off.
    pub(super) refusals: bool,
    /// A pilot takes over, the agent sleeps, or starts in the air.
    pub(super) pilot: bool,
}

/// Paths and progress along them, as guidance reports them; `hard`: paths are not found or turn out blocked, the
/// vehicle gets stuck, and long ones are planned on while they are flown.
pub(super) fn guidance(me: &Me, legs: &[i64], hard: bool) -> Part {
    let to = |leg: i64| format!("heading for {leg}");
    let new_leg = |place: Place| {
        let goto = |leg: i64| me.any::<Goto>().and(Goto::leg(leg));
        let place = legs.iter().fold(place, |place, leg| place.hears(goto(*leg), to(*leg)));
        place.hears(me.any::<Landed>(), "nowhere")
    };
    let mut places = vec![
        new_leg(Place::new("nowhere").hears(me.any::<Plan>(), "planning for nowhere")),
        new_leg(Place::new("planning for nowhere").offers(
            me.event(Unplannable { leg: 0, why: "there is no waypoint".into(), zone: None }),
            "nowhere",
        )),
    ];
    for leg in legs {
        let [planning, following, blocked, arrived] =
            ["planning for", "following to", "blocked on the way to", "arrived at"]
                .map(|what| format!("{what} {leg}"));
        let place = |name: &str| new_leg(Place::new(name).hears(me.any::<Plan>(), planning.as_str()));
        let arrives = |place: Place| place.offers(me.event(Arrived { leg: *leg }), arrived.as_str());
        let planned = me.event(Planned { leg: *leg, length_m: 20.0 });
        let plans = Place::new(planning.as_str()).offers(planned.clone(), following.as_str());
        let no_path = me.event(Unplannable { leg: *leg, why: "no path".into(), zone: None });
        let follows = arrives(place(&following));
        places.push(arrives(place(&to(*leg))));
        places.push(place(&arrived));
        if hard {
            places.push(new_leg(plans.offers(no_path, to(*leg))));
            let follows = follows
                .offers(me.event(PathBlocked), blocked.as_str())
                .keeps_offering(me.event(Stuck))
                .keeps_offering(planned);
            let taken = format!("beside who has {leg}");
            let by = |leaves| me.event(PlaceTaken { leg: *leg, by: "uav/2".into(), leaves });
            places.push(follows.offers(by(false), taken.as_str()).offers(by(true), taken.as_str()));
            places.push(arrives(place(&taken)).offers(me.event(PlaceFree), following.as_str()));
            places.push(arrives(place(&blocked)).keeps_offering(me.event(Stuck)));
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
pub(super) fn passage(me: &Me, other: Option<&NodeName>) -> Part {
    let bthread = || RIGHT_OF_WAY.into();
    let home = other.cloned().or_else(|| NodeName::new("uav/0").ok());
    let lapsed = home.map(|home| me.event(BlockLapsed { bthread: bthread(), home }));
    let stalled = |by: &str| {
        let (event, by) = (me.event_name(Enter::NAME).into(), format!("{by}#{RIGHT_OF_WAY}").into());
        me.event(Stalled { event, by })
    };
    // Whatever this vehicle's number, one goes before it and one after.
    let mut ahead = Place::new("ahead")
        .offers(me.event(Leave), "none")
        .hears(me.any::<Landed>(), "none")
        .keeps_offering(me.event(Confirmed { bthread: bthread(), sync: 1 }));
    ahead = lapsed.into_iter().fold(ahead, Place::keeps_offering);
    ahead = ahead.keeps_offering(stalled("uav/0")).keeps_offering(stalled("uav/4294967295"));
    if let Some(other) = other {
        ahead = ahead.keeps_offering(Leave.at(other));
    }
    let way = Some("5 0 2 0; 6 0 2 0".into());
    let passage = Passage { x: 5.0, y: 0.0, z: 2.0, way, here: None };
    Part::new(vec![Place::new("none").offers(me.event(passage), "ahead"), ahead])
}

/// Another vehicle that wants to go where this one is.
pub(super) fn in_the_way(me: &Me) -> Part {
    let asks = |right| me.event(InTheWay { of: "uav/0".into(), right });
    let gone = |place: Place| place.offers(me.event(OutOfTheWay), "free").hears(me.any::<Landed>(), "free");
    Part::new(vec![
        Place::new("free")
            .offers(asks(Right::Free), "in the way")
            .offers(asks(Right::Cornered), "in the way"),
        gone(Place::new("in the way").hears(me.any::<MakeWay>(), "making way")),
        gone(Place::new("making way").offers(me.event(Cornered { by: "uav/0".into() }), "in the way")),
    ])
}

/// Preflight checks. Once the vehicle is up, or another has armed it, they fail in the same tick.
pub(super) fn checks(me: &Me) -> Part {
    let up = me.any::<(Airborne, PilotTook, FoundAirborne, Slept)>();
    let up_at_once = Place::new("failing, not yet told").rules_out(me.any::<Takeoff>());
    let unready = || me.event(Unready { why: "battery: 20 %".into() });
    Part::new(vec![
        Place::new("failing").offers(me.event(Ready), "passing").keeps_offering(unready()),
        Place::new("passing").offers(unready(), "failing").hears(up, "failing, not yet told"),
        up_at_once.offers(unready(), "failing"),
    ])
}

/// The battery. What is low may recover and be low again, as the way home gets shorter and longer.
pub(super) fn battery(me: &Me) -> Part {
    let place = Place::new("used");
    Part::of_one(
        place
            .keeps_offering(me.event(BatteryLow { why: "battery low".into() }))
            .keeps_offering(me.event(BatteryCritical)),
    )
}

/// The vehicle's place relative to its fence.
pub(super) fn fence(me: &Me) -> Part {
    Part::of_one(Place::new("near").keeps_offering(me.event(FenceBreached)))
}

/// Another vehicle that comes too close.
pub(super) fn closeness(me: &Me, other: Option<&NodeName>) -> Part {
    Part::new(vec![
        Place::new("far")
            .offers(me.event(TooClose { other: other.map_or("uav/0", NodeName::as_str).into() }), "close"),
        Place::new("close").offers(me.event(Clear), "far"),
    ])
}

/// The vehicle's place, as far as it knows.
pub(super) fn position(me: &Me) -> Part {
    let doubted = PositionDoubted { why: "the position jumped".into(), sigma_m: 8.0 };
    Part::new(vec![
        Place::new("known").offers(me.event(doubted), "doubted"),
        Place::new("doubted").offers(me.event(PositionTrusted), "known").hears(me.any::<Landed>(), "known"),
    ])
}

/// Another process under this vehicle's name.
pub(super) fn namesake(me: &Me) -> Part {
    Part::of_one(Place::new("may be").keeps_offering(me.event(DuplicateName { incarnation: 1 })))
}

/// Another node that is heard and lost. Lost, it may have had a claim to a passage.
pub(super) fn peer(me: &Me, node: &NodeName) -> Part {
    let joined = || me.event(PeerJoined { node: node.clone(), incarnation: 1 });
    let lost =
        |released: &str| me.event(PeerLost { node: node.clone(), released: released.into(), held: None });
    Part::new(vec![
        Place::new("unheard").offers(joined(), "heard"),
        Place::new("heard").offers(lost(""), "lost").offers(lost(RIGHT_OF_WAY), "lost"),
        Place::new("lost").offers(joined(), "heard"),
    ])
}

/// An operator who gives these orders. They count as given aboard: who holds the vehicle is not looked at.
pub(super) fn operator(me: &Me, config: &AgentConfig, orders: &[What]) -> Part {
    let [x, y, z] = config.fence.max;
    let offers = orders.iter().fold(Place::new("there"), |place, what| {
        let place = match what {
            What::GoTo => place
                .keeps_offering(me.event(OrderTaken::go_to(config.home, "operator").given_aboard()))
                .keeps_offering(me.event(OrderTaken::go_to([x + 10.0, y, z], "operator").given_aboard())),
            _ => place,
        };
        place.keeps_offering(me.event(OrderTaken::plain(*what, "operator").given_aboard()))
    });
    Part::of_one(offers)
}

/// Two people who want the vehicle.
pub(super) fn people(me: &Me) -> Part {
    let place = ["Anna", "Ben"].into_iter().fold(Place::new("there"), |place, by| {
        let handover = |what| me.event(Handover { what, by: by.into(), to: Some("Ben".into()) });
        let place = What::those(What::is_handover).map(handover).fold(place, Place::keeps_offering);
        let script = Load { name: Some("x".into()), script: "{}".into(), by: Some(by.into()) };
        place
            .keeps_offering(me.event(OrderTaken::plain(What::Resume, by)))
            .keeps_offering(me.event(script))
            .keeps_offering(me.event(Unload { name: "x".into(), by: Some(by.into()) }))
    });
    Part::of_one(place)
}

/// The ground station's bids for this vehicle; they change with these events.
pub(super) fn ground_bids(me: &Me, config: &AgentConfig) -> [(String, Part); 3] {
    let arrives = |what: &str| Event::new(format!("ground's bids/{what}"));
    let set = |what: &str| EventSet::from(arrives(what));
    let changes = ["launch", "hold", "hold all", "lapse"]
        .into_iter()
        .fold(Place::new("there"), |place, what| place.keeps_offering(arrives(what)));
    let silent = |place: Place| place.hears(set("lapse"), "silent");
    let launch = Part::new(vec![
        Place::new("silent").hears(set("launch"), "asking"),
        silent(Place::new("asking").offers(me.event(Takeoff), "silent")),
    ]);
    // What the home honours of it.
    let all = me.any::<(Takeoff, Goto, Advance, Enter)>().and(safety_events(me, &config.events()).not());
    let hold = Part::new(vec![
        Place::new("silent").hears(set("hold"), "holding").hears(set("hold all"), "holding all"),
        silent(Place::new("holding").rules_out(me.any::<Advance>())),
        silent(Place::new("holding all").rules_out(all)),
    ]);
    [
        ("world/ground's bids".to_owned(), Part::of_one(changes)),
        ("ground#launch".to_owned(), launch.with_priority(precedence::MISSION)),
        ("ground#hold".to_owned(), hold.with_priority(precedence::MISSION)),
    ]
}

/// The swarm's joint decisions. They are told before `in_step` when they were taken without this vehicle.
pub(super) fn together(me: &Me, coordinator: &NodeName) -> Part {
    let lost = me.any::<PeerLost>().and(PeerLost::node(coordinator));
    let decides = |place: Place| place.keeps_offering(Launch.at(SWARM)).keeps_offering(Abort.at(SWARM));
    let in_step = me.event(InStep { term: 1, decided: 0, coordinator: coordinator.clone() });
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
