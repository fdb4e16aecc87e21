//! Small networks that show the rules of b-programs across nodes at work: those by which the fleet flies, and beside
//! some of them how it is not to be written.

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use skein_bp::catalogue::{Declared as _, Events as _};
use skein_bp::script::{Op, Script, ScriptError};
use skein_bp::{BThread, Bid, Context, Event, EventSet, Program, ProgramConfig};

use crate::config::NodeConfig;
use crate::facts;
use crate::name::{NodeName, NodeNameError};
use crate::verify::{Faults, Member, NetworkVerifier, NetworkView};

/// A network and what must hold in it.
#[derive(Clone)]
pub struct Network {
    pub name: &'static str,
    /// The story, in one line.
    pub about: &'static str,
    /// Whether its requirement holds. Those that are not sound show that the verifier finds it.
    pub is_sound: bool,
    /// The faults unless told otherwise, with which its states can be counted in reasonable time.
    pub faults: Faults,
    pub members: Vec<Member>,
    /// The invariant, besides that no b-thread's assertion fails.
    pub requirement: Option<(&'static str, Arc<Requirement>)>,
}

pub type Requirement = dyn Fn(&NetworkView<'_>) -> Result<(), String> + Send + Sync;

/// Why one of these networks could not be made: a mistake in this file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NetworkError {
    #[error(transparent)]
    Name(#[from] NodeNameError),
    #[error(transparent)]
    Script(#[from] ScriptError),
}

impl Network {
    pub fn verifier(&self, faults: Faults) -> NetworkVerifier {
        let verifier = NetworkVerifier::new(self.members.clone(), faults);
        match self.requirement.clone() {
            Some((name, holds)) => verifier.invariant(name, move |view| holds(view)),
            None => verifier,
        }
    }
}

pub fn all() -> Result<Vec<Network>, NetworkError> {
    Ok(vec![
        alternating_gate()?,
        held_launch()?,
        hold()?,
        kept_hold()?,
        guarded_resource(2)?,
        guarded_resource(3)?,
        naive_resource(2)?,
        patient_resource()?,
        impatient_resource()?,
        corridor()?,
        courteous_corridor()?,
        asked_once()?,
        asked_again()?,
    ])
}

/// Those that are sound, as they are to be written.
pub fn sound() -> Result<Vec<Network>, NetworkError> {
    Ok(all()?.into_iter().filter(|network| network.is_sound).collect())
}

/// Nothing goes wrong; records come late, and newer ones may overtake them.
const CALM: Faults = Faults {
    delay: true,
    lapses: 0,
    restarts: 0,
    repeats: 0,
    partitions: 0,
    late_facts: false,
    most_under_way: 16,
};
/// One of each thing that can go wrong.
const ONE_OF_EACH: Faults = Faults { lapses: 1, restarts: 1, repeats: 1, partitions: 1, ..CALM };

/// Two nodes pass a gate by turns: `uav/1`, where the gate is, never lets one pass twice in a row.
pub fn alternating_gate() -> Result<Network, NetworkError> {
    let (one, other) = ("uav/1/pass/1", "uav/1/pass/2");
    let passes = |event: &str| Op::Sync(Bid::new().request(event));
    let turn = |now: &str, later: &str| Op::Sync(Bid::new().wait_for(now).block(later));
    let twice = |event: &str| {
        let body = vec![Op::AssertFail(format!("{event} twice in a row"))];
        [
            Op::Sync(Bid::new().wait_for(event)),
            Op::Sync(Bid::new().wait_for("uav/1/pass/*")),
            Op::On([(event.to_owned(), body)].into()),
        ]
    };
    let here = [
        ("passes", vec![passes(one), passes(one)]),
        ("gate", vec![Op::forever([turn(one, other), turn(other, one)])]),
        ("one twice", vec![Op::forever(twice(one))]),
        ("other twice", vec![Op::forever(twice(other))]),
    ];
    let members =
        vec![scripts("uav/1", &here)?, scripts("uav/2", &[("passes", vec![passes(other), passes(other)])])?];
    Ok(Network {
        name: "alternating gate",
        about: "two nodes pass a gate by turns, which its home keeps",
        is_sound: true,
        faults: ONE_OF_EACH,
        members,
        requirement: None,
    })
}

/// A shared place that at most one of `count` vehicles may be in: each blocks the others, awaits confirmation, then
/// enters, and leaves at once when its block lapses. Entering is `guarded` after a restart.
pub fn guarded_resource(count: usize) -> Result<Network, NetworkError> {
    let members = (1..=count).map(|number| {
        let (name, mut program) = vehicle(number)?;
        let others = EventSet::from("uav/*/enter").and(EventSet::named(name.event_name("enter")).not());
        // It stays where it is until the block lapses.
        let claim = Bid::new().block(others).wait_for(facts::block_lapsed(&name, "claim"));
        program.add("claim", Script::new(&[Op::forever([Op::Sync(claim)])])?);
        program.add("entrance", Entrance { node: name.clone(), place: Place::Outside, careful: true });
        let guarded = EventSet::named(name.event_name("enter"));
        Ok(Member {
            config: NodeConfig { guarded, ..NodeConfig::new(name, 1, Vec::new()) },
            program,
            may_restart: true,
        })
    });
    Ok(Network {
        name: if count == 2 { "right of way" } else { "right of way of three" },
        about: "each blocks the others, awaits confirmation, then enters; it leaves when its block lapses",
        is_sound: true,
        faults: if count == 2 { ONE_OF_EACH } else { CALM },
        members: members.collect::<Result<_, NetworkError>>()?,
        requirement: Some(("at most one is inside", Arc::new(at_most_one_inside))),
    })
}

/// The same place, where each blocks the others and enters without waiting to hear that the block holds. It is not
/// safe.
pub fn naive_resource(count: usize) -> Result<Network, NetworkError> {
    let members = (1..=count).map(|number| {
        let (name, mut program) = vehicle(number)?;
        let others = EventSet::from("uav/*/enter").and(EventSet::named(name.event_name("enter")).not());
        program.add("claim", Script::new(&[Op::Sync(Bid::new().block(others))])?);
        program.add("entrance", Entrance { node: name.clone(), place: Place::Before, careful: false });
        Ok(Member { config: NodeConfig::new(name, 1, Vec::new()), program, may_restart: true })
    });
    Ok(Network {
        name: "naive right of way",
        about: "each blocks the others and enters without awaiting confirmation",
        is_sound: false,
        faults: CALM,
        members: members.collect::<Result<_, NetworkError>>()?,
        requirement: Some(("at most one is inside", Arc::new(at_most_one_inside))),
    })
}

/// The same place, where each waits only so long for its block to be confirmed: then it withdraws the block, and tries
/// again later.
pub fn patient_resource() -> Result<Network, NetworkError> {
    let about =
        "each blocks the others and awaits confirmation only so long: then it gives way and tries again";
    claimed("patient right of way", about, true)
}

/// The same place, where each enters once it has waited long enough, confirmed or not. It is not safe.
pub fn impatient_resource() -> Result<Network, NetworkError> {
    let about = "each blocks the others and awaits confirmation only so long: then it enters all the same";
    claimed("impatient right of way", about, false)
}

fn claimed(name: &'static str, about: &'static str, gives_way: bool) -> Result<Network, NetworkError> {
    let members = (1..=2).map(|number| {
        let (node, mut program) = vehicle(number)?;
        program.add("claim", Claim { node: node.clone(), stage: Stage::Claiming, until: None, gives_way });
        Ok(Member { config: NodeConfig::new(node, 1, Vec::new()), program, may_restart: false })
    });
    Ok(Network {
        name,
        about,
        is_sound: gives_way,
        // Who states its block again and again may have any number of older records on their way.
        faults: Faults { delay: false, lapses: 1, ..CALM },
        members: members.collect::<Result<_, NetworkError>>()?,
        requirement: Some(("at most one is inside", Arc::new(at_most_one_inside))),
    })
}

/// Two vehicles meet in a corridor and say on which side they pass. They do pass, since the first keeps to its side.
pub fn corridor() -> Result<Network, NetworkError> {
    let heard = || Op::Sync(Bid::new().wait_for("uav/2/right").hot());
    // It looks up every second; that it may do so for ever, with the answer on its way, is no fault.
    let looks = Op::Until { set: EventSet::None, within: Some(Duration::from_secs(1)), body: vec![heard()] };
    let awaits = Op::Until { set: "uav/2/right".into(), within: None, body: vec![Op::forever([looks])] };
    let keeps = vec![Op::Sync(Bid::new().request("uav/1/left")), awaits];
    let dodges = vec![
        Op::Sync(Bid::new().request("uav/2/left")),
        Op::Sync(Bid::new().wait_for("uav/1/left").hot()),
        Op::Sync(Bid::new().request("uav/2/right")),
    ];
    let about = "two vehicles meet in a corridor; the second dodges, and so they pass";
    meeting("corridor", about, true, [keeps, dodges])
}

/// The same meeting, where each dodges when it hears that the other is on the same side. They may dodge for ever.
pub fn courteous_corridor() -> Result<Network, NetworkError> {
    let dodges = |one: &str, other: &str| {
        let takes = |side: &str, free: &str| {
            [
                Op::Sync(Bid::new().request(format!("{one}/{side}"))),
                Op::Sync(
                    Bid::new().wait_for(format!("{other}/left")).wait_for(format!("{other}/right")).hot(),
                ),
                Op::On([(format!("{other}/{free}"), vec![Op::Stop])].into()),
            ]
        };
        vec![Op::forever(
            takes("left", "right").into_iter().chain(takes("right", "left")).collect::<Vec<_>>(),
        )]
    };
    let about = "two vehicles meet in a corridor; each dodges when the other is on its side";
    meeting("courteous corridor", about, false, [dodges("uav/1", "uav/2"), dodges("uav/2", "uav/1")])
}

fn meeting(
    name: &'static str,
    about: &'static str,
    is_sound: bool,
    passing: [Vec<Op>; 2],
) -> Result<Network, NetworkError> {
    let members = ["uav/1", "uav/2"].into_iter().zip(passing);
    let members =
        members.map(|(node, body)| Ok(Member { may_restart: false, ..scripts(node, &[("passing", body)])? }));
    Ok(Network {
        name,
        about,
        is_sound,
        // Who restarts there does not know what was said before.
        faults: Faults { lapses: 1, partitions: 1, ..CALM },
        members: members.collect::<Result<_, NetworkError>>()?,
        requirement: None,
    })
}

/// The ground asks `uav/1` to take off and holds it back until it says go: no take-off while the hold stands.
pub fn held_launch() -> Result<Network, NetworkError> {
    let ground = NodeName::new("ground/main")?;
    let until_go = Bid::new().block("uav/1/takeoff").wait_for("ground/main/go");
    let scripts_here = [
        ("launch", vec![Op::Sync(Bid::new().request("uav/1/takeoff"))]),
        ("hold", vec![Op::Sync(until_go)]),
        (
            "go",
            vec![
                Op::Sync(Bid::new().wait_for(facts::confirmed(&ground, "hold"))),
                Op::Sync(Bid::new().request("ground/main/go")),
            ],
        ),
    ];
    let flight = [("airborne", vec![Op::Sync(Bid::new().wait_for("uav/1/takeoff")), Op::Sync(Bid::new())])];
    let holds = |view: &NetworkView<'_>| {
        let held = view.program("ground/main").is_some_and(|ground| ground.bid("hold").is_some());
        let past_first = |uav: &Program| uav.bids().any(|(name, _, sync)| name == "airborne" && sync > 1);
        let flies = view.program("uav/1").is_some_and(past_first);
        if held && flies { Err("it has taken off".to_owned()) } else { Ok(()) }
    };
    Ok(Network {
        name: "held launch",
        about: "the ground asks for take-off and holds it back until it says go",
        is_sound: true,
        faults: ONE_OF_EACH,
        members: vec![scripts("ground/main", &scripts_here)?, scripts("uav/1", &flight)?],
        requirement: Some(("nobody takes off while held", Arc::new(holds))),
    })
}

/// The ground holds `uav/1`, whose leave to move is blocked for as long as the ground counts on it: the holder hears
/// that its block lapses before the home lets go.
pub fn hold() -> Result<Network, NetworkError> {
    holding("hold", "the ground holds a vehicle until its lease lapses, of which it hears first", false)
}

/// The same hold, stated to outlive its holder: once confirmed it stays through lapses, partitions and restarts of the
/// vehicle.
pub fn kept_hold() -> Result<Network, NetworkError> {
    holding(
        "kept hold",
        "a hold that is stated to outlive its holder stays through lapses and restarts",
        true,
    )
}

fn holding(name: &'static str, about: &'static str, outlives: bool) -> Result<Network, NetworkError> {
    const ADVANCE: &str = "uav/1/advance";
    let ground = NodeName::new("ground/main")?;
    let lapsed = facts::block_lapsed(&ground, "hold");
    // It stays where it is while the block is to hold, since every synchronisation point is a new block.
    let block = Bid::new().block(ADVANCE).wait_for(EventSet::named(ground.event_name("enough")));
    let block = if outlives { block.hold_when_lost() } else { block };
    let trust = [
        Op::Sync(Bid::new().wait_for(facts::confirmed(&ground, "hold"))),
        Op::Sync(Bid::new().wait_for(lapsed)),
    ];
    let here = [("hold", vec![Op::Sync(block)]), ("trust", vec![Op::forever(trust)])];
    let mut vehicle = scripts("uav/1", &[("moves", vec![Op::Sync(Bid::new().request(ADVANCE))])])?;
    vehicle.config.durable = outlives;
    let holds = |view: &NetworkView<'_>| {
        let trusts = |ground: &Program| {
            ground.bids().any(|(name, bid, _)| {
                name == "trust" && bid.waits().may_hold_named("ground/main/block_lapsed")
            })
        };
        let is_trusted = view.program("ground/main").is_some_and(trusts);
        let is_held = |uav: &Program| uav.blockers(&ADVANCE.into()).next().is_some();
        if is_trusted && !view.program("uav/1").is_some_and(is_held) {
            return Err("the ground counts on its hold, and nothing blocks `advance`".to_owned());
        }
        Ok(())
    };
    Ok(Network {
        name,
        about,
        is_sound: true,
        // Another hold ends with its home's life, before its holder can hear of it.
        faults: Faults { restarts: outlives.into(), ..ONE_OF_EACH },
        members: vec![scripts("ground/main", &here)?, vehicle],
        requirement: Some(("a hold that is counted on holds", Arc::new(holds))),
    })
}

/// The ground asks `uav/1` once to drop its load, and asks no more when it cannot know; a log hears every drop.
pub fn asked_once() -> Result<Network, NetworkError> {
    let about = "the ground asks once for a drop, and asks no more when it cannot know";
    drops("asked once", about, true, vec![Op::Sync(Bid::new().request("uav/1/drop"))])
}

/// The same request, asked again when it is unknown whether it was served. It is not safe.
pub fn asked_again() -> Result<Network, NetworkError> {
    let unknown = facts::Unknown::any_at(NodeName::new("ground/main")?);
    let ask = Op::Sync(Bid::new().request("uav/1/drop").wait_for(unknown));
    let again = Op::On([("ground/main/unknown".to_owned(), vec![ask.clone()])].into());
    let about = "the ground asks again when it is unknown whether it was served";
    drops("asked again", about, false, vec![ask, again])
}

fn drops(
    name: &'static str,
    about: &'static str,
    is_sound: bool,
    asking: Vec<Op>,
) -> Result<Network, NetworkError> {
    let heard = || Op::Sync(Bid::new().wait_for("uav/1/drop"));
    let log = [("at most one", vec![heard(), heard(), Op::AssertFail("dropped twice".to_owned())])];
    let members = vec![
        scripts("ground/main", &[("asking", asking)])?,
        scripts("ground/log", &log)?,
        scripts("uav/1", &[])?,
    ];
    let faults = Faults { restarts: 1, ..CALM };
    Ok(Network { name, about, is_sound, faults, members, requirement: None })
}

fn vehicle(number: usize) -> Result<(NodeName, Program), NetworkError> {
    Ok((NodeName::new(&format!("uav/{number}"))?, Program::new(ProgramConfig::default())))
}

fn scripts(node: &str, bthreads: &[(&str, Vec<Op>)]) -> Result<Member, NetworkError> {
    let mut program = Program::new(ProgramConfig::default());
    for (name, body) in bthreads {
        program.add(*name, Script::new(body)?);
    }
    let config = NodeConfig::new(NodeName::new(node)?, 1, Vec::new());
    // A node that begins again asks again, so what must not be repeated is asked by one that does not.
    Ok(Member { config, program, may_restart: node.starts_with("uav/") })
}

/// Takes one vehicle in and out again.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Entrance {
    node: NodeName,
    place: Place,
    /// Whether it awaits confirmation, and leaves when that is void.
    careful: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Place {
    /// Waits until its claim is confirmed.
    Outside,
    Before,
    Inside,
}

impl BThread for Entrance {
    fn bid(&self) -> Option<Bid> {
        let lapse = match self.careful {
            true => facts::block_lapsed(&self.node, "claim"),
            false => EventSet::None,
        };
        Some(match self.place {
            Place::Outside => Bid::new().wait_for(facts::confirmed(&self.node, "claim")),
            Place::Before => Bid::new().request(self.node.event_name("enter")).wait_for(lapse),
            // For how long it stays inside is up to others, so it may be for ever.
            Place::Inside => Bid::new().wait_for(lapse),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.place = match (self.place, event.kind()) {
            (_, facts::BlockLapsed::NAME) => Place::Outside,
            (Place::Outside, _) => Place::Before,
            (Place::Before | Place::Inside, _) => Place::Inside,
        };
    }
}

/// Blocks the others' entry, and takes one vehicle in and out again.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Claim {
    node: NodeName,
    stage: Stage,
    /// When its patience is at an end.
    until: Option<Duration>,
    /// Whether it gives way then, or enters.
    gives_way: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Stage {
    /// Waits until its block is confirmed.
    Claiming,
    Entering,
    Inside,
    /// Has withdrawn its block for a while.
    Yielding,
}

/// The time it waits for confirmation, and before it tries again.
const PATIENCE: Duration = Duration::from_secs(2);

impl BThread for Claim {
    fn bid(&self) -> Option<Bid> {
        let enter = self.node.event_name("enter");
        let block = Bid::new().block(EventSet::from("uav/*/enter").and(EventSet::named(&*enter).not()));
        let bid = match self.stage {
            Stage::Yielding => Bid::new(),
            Stage::Claiming => block.wait_for(facts::confirmed(&self.node, "claim")),
            Stage::Entering => block.request(enter).wait_for(facts::block_lapsed(&self.node, "claim")),
            Stage::Inside => block.wait_for(facts::block_lapsed(&self.node, "claim")),
        };
        Some(self.until.into_iter().fold(bid, Bid::deadline))
    }

    fn start(&mut self, cx: &mut Context) {
        self.until = Some(cx.now() + PATIENCE);
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.stage = match (self.stage, event.kind()) {
            (Stage::Yielding, _) => Stage::Claiming,
            (Stage::Claiming, facts::Confirmed::NAME) => Stage::Entering,
            (Stage::Claiming, _) if !self.gives_way => Stage::Entering,
            (Stage::Entering, kind) if kind != facts::BlockLapsed::NAME => Stage::Inside,
            _ => Stage::Yielding,
        };
        let waits = matches!(self.stage, Stage::Yielding | Stage::Claiming);
        self.until = waits.then(|| cx.now() + PATIENCE);
    }
}

fn at_most_one_inside(view: &NetworkView<'_>) -> Result<(), String> {
    let inside = view.programs().filter(|(_, program)| {
        program.state_of::<Entrance>("entrance").is_some_and(|entrance| entrance.place == Place::Inside)
            || program.state_of::<Claim>("claim").is_some_and(|claim| claim.stage == Stage::Inside)
    });
    let names: Vec<&str> = inside.map(|(name, _)| name).collect();
    if names.len() > 1 { Err(format!("{} are inside", names.join(" and "))) } else { Ok(()) }
}

impl std::fmt::Debug for Network {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Network")
            .field("name", &self.name)
            .field("faults", &self.faults)
            .field("members", &self.members)
            .finish_non_exhaustive()
    }
}
