//! The messages to browsers: `scene`, `fleet` and `orders` as they are now, `events` as they happen, `why` a vehicle
//! does what it does, to whoever asks about it, and answers to requests.
//!
//! The console's own types are made of these: see `tests.rs`.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;
use serde::Serialize;
use skein_bp::script::ScriptFile;
use skein_bp::{Event, Value};
use skein_dbp::facts::Stalled;
use skein_dbp::{Happened, NodeName, Peer};
use skein_wire::event::{Advance, Declared as _, Homeward, What};
use skein_wire::{Check, Form, MissionState, Scene, SenderStats, Solid, State, Zone};

use super::plan_view::PlanView;
use super::request::Granted;
use super::session::{Role, Session};
use super::subscription::{Broadcast, Subscription, Text};
use crate::core::GroundCore;
use crate::explain::Explanation;
use crate::giver::Giver;
use crate::launch_offer::{Candidate, LaunchOffer, OFFER_LASTS};
use crate::order_log::{Answer, OrderRecord};
use crate::replay::{Moment, Replay};
use crate::zone_log::ZoneRecord;

/// The swarm is shown this often.
const FLEET_PERIOD: Duration = Duration::from_millis(100);
/// Vehicles that somebody asks about are explained this often.
const WHY_PERIOD: Duration = Duration::from_millis(400);

/// Tells browsers what is so.
pub(super) struct Feed {
    browsers: Broadcast,
    fleet_due: Duration,
    reasons_due: Duration,
    orders_shown: Option<u64>,
    zones_shown: Option<u64>,
    /// Of a recording, how often time had jumped.
    jumps_shown: Option<u64>,
    /// The file in which the mission is recorded; empty if it is not.
    pub(super) recording: String,
}

/// A message for browsers.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[cfg_attr(test, ts(rename = "ServerMessage"))]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Message<'a> {
    Scene {
        fleet: &'a str,
        station: &'a str,
        software: &'static str,
        /// The file in which the mission is recorded; empty if it is not.
        recording: &'a str,
        bounds: Option<Bounds>,
        obstacles: Vec<Obstacle>,
    },
    Fleet {
        time_s: f64,
        outcome: Option<OutcomeView>,
        vehicles: Vec<VehicleView<'a>>,
    },
    Orders {
        orders: Vec<OrderView<'a>>,
    },
    Events {
        events: Vec<EventView<'a>>,
        /// Whether all that was told before is void.
        anew: bool,
    },
    /// The state of a recording that is played, which is shown in the place of a live swarm.
    Replay {
        at_s: f64,
        from_s: f64,
        to_s: f64,
        playing: bool,
        speed: f64,
        /// Whether it was brought to its end, and not cut short.
        complete: bool,
    },
    /// The zones that are drawn on the map.
    Zones {
        zones: Vec<ZoneView<'a>>,
    },
    Why {
        headline: String,
        #[serde(flatten)]
        explanation: Explanation,
    },
    /// The name by which the station knows this browser, and its rights.
    You {
        tag: Option<String>,
        name: Option<&'a str>,
        role: Role,
        /// Whether a certificate says so; otherwise whoever sits there does.
        certified: bool,
    },
    /// The vehicles that a launch would launch: return the token in time, and it is ordered.
    Offer {
        tag: Option<String>,
        token: &'a str,
        what: &'static str,
        lasts_s: f64,
        vehicles: Vec<CandidateView<'a>>,
    },
    /// An order is given, under this number.
    Ordered {
        tag: Option<String>,
        id: u64,
    },
    /// A plan, as far as it was asked for.
    Plan {
        tag: Option<String>,
        #[serde(flatten)]
        plan: PlanView<'a>,
    },
    /// The zone of this name is drawn, or being removed.
    Mapped {
        tag: Option<String>,
        name: &'a str,
    },
    /// A recording goes on as wished.
    Replayed {
        tag: Option<String>,
    },
    /// A script as its file says it.
    Script {
        tag: Option<String>,
        #[cfg_attr(test, ts(type = "unknown"))]
        script: Box<ScriptFile>,
    },
    /// A request is refused.
    Error {
        tag: Option<String>,
        message: String,
    },
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct Obstacle {
    #[serde(flatten)]
    form: FormView,
    position: [f64; 3],
    orientation: [f64; 4],
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "form", rename_all = "snake_case")]
pub(super) enum FormView {
    Box { size: [f64; 3] },
    Cylinder { radius: f64, height: f64 },
    Sphere { radius: f64 },
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct OutcomeView {
    succeeded: bool,
    failed: BTreeMap<String, String>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct VehicleView<'a> {
    name: &'a str,
    heard: bool,
    link: LinkView,
    notes: Vec<String>,
    /// Its checks before take-off.
    checks: Vec<CheckView<'a>>,
    /// All fields of a [`StateView`], or none.
    #[cfg_attr(test, ts(skip))]
    #[serde(flatten)]
    state: Option<StateView<'a>>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct LinkView {
    alive: bool,
    age_ms: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct CheckView<'a> {
    name: &'a str,
    /// `passes`, `fails` or `waits`.
    state: &'static str,
    value: &'a str,
    advice: &'a str,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct StateView<'a> {
    position: [f64; 3],
    velocity: [f64; 3],
    yaw_rad: f64,
    radius_m: f64,
    mode: &'a str,
    armed: bool,
    battery: f64,
    task: &'a str,
    waiting_for: &'a str,
    mission: MissionView,
    path: Vec<[f64; 3]>,
    scripts: &'a [String],
    /// The names of the zones that it has regard for.
    zones: &'a [String],
    /// The person or program whose orders it takes; empty while nobody holds it.
    holder: &'a str,
    /// The person or program that asks the holder for it; empty if nobody does.
    asked_by: &'a str,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct CandidateView<'a> {
    name: &'a str,
    task: &'a str,
    /// The checks before take-off that do not pass.
    doubts: &'a [String],
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub(super) enum MissionView {
    UnderWay,
    Complete,
    Failed,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct OrderView<'a> {
    id: u64,
    by: &'a str,
    what: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    script: Option<&'a str>,
    time_s: f64,
    answers: BTreeMap<&'a str, AnswerView<'a>>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct ZoneView<'a> {
    #[cfg_attr(test, ts(type = "ZoneTable"))]
    zone: &'a Zone,
    by: &'a str,
    time_s: f64,
    /// Whether it is being removed; then a vehicle acknowledges that it has let it go.
    going: bool,
    answers: BTreeMap<&'a str, AnswerView<'a>>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "state", rename_all = "snake_case")]
pub(super) enum AnswerView<'a> {
    Pending,
    Missing,
    Acknowledged { after_ms: f64 },
    Refused { why: &'a str },
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct EventView<'a> {
    time_s: f64,
    home: &'a str,
    seq: u64,
    name: &'a str,
    #[cfg_attr(test, ts(type = "Record<string, unknown>"))]
    data: BTreeMap<&'a str, &'a Value>,
    requested_by: &'a [Arc<str>],
    blocked_by: Vec<&'a str>,
}

impl Feed {
    pub(super) fn new() -> (Self, Subscription) {
        let (browsers, subscription) = Broadcast::new();
        let feed = Self {
            browsers,
            fleet_due: Duration::ZERO,
            reasons_due: Duration::ZERO,
            orders_shown: None,
            zones_shown: None,
            jumps_shown: None,
            recording: String::new(),
        };
        (feed, subscription)
    }

    pub(super) fn show_scene(&mut self, station: &GroundCore, scene: Option<&Scene>) {
        let obstacles = scene.iter().flat_map(|scene| &scene.solids).map(obstacle);
        let message = Message::Scene {
            fleet: station.node().fleet().as_str(),
            station: station.name().as_str(),
            software: env!("CARGO_PKG_VERSION"),
            recording: &self.recording,
            bounds: scene.map(|scene| Bounds { min: scene.min.into(), max: scene.max.into() }),
            obstacles: obstacles.collect(),
        };
        self.browsers.show("scene", message.text());
    }

    pub(super) fn publish(&mut self, now: Duration, station: &GroundCore, happened: &[Happened]) {
        self.publish_events(station.name(), happened);
        if self.orders_shown != Some(station.orders_revision()) {
            self.orders_shown = Some(station.orders_revision());
            let orders = station.orders().map(order_view).collect();
            self.browsers.show("orders", Message::Orders { orders }.text());
        }
        if self.zones_shown != Some(station.zones_revision()) {
            self.zones_shown = Some(station.zones_revision());
            let zones = station.zones().map(zone_view).collect();
            self.browsers.show("zones", Message::Zones { zones }.text());
        }
        if now >= self.fleet_due {
            self.fleet_due = now + FLEET_PERIOD;
            self.browsers.show("fleet", fleet(now, station).text());
        }
        if now >= self.reasons_due {
            self.reasons_due = now + WHY_PERIOD;
            self.publish_reasons(station);
        }
    }

    fn publish_reasons(&self, station: &GroundCore) {
        let asked = self.browsers.asked();
        if asked.is_empty() {
            return;
        }
        let why = |vehicle: NodeName| {
            let explanation = station.explain(&vehicle)?;
            Some((vehicle, Message::Why { headline: explanation.headline(), explanation }.text()))
        };
        self.browsers.explain(asked.into_iter().filter_map(why).collect());
    }

    fn publish_events(&mut self, station: &NodeName, happened: &[Happened]) {
        let tells = |happened: &&Happened| {
            // Leaves to move are ten a second for each vehicle; what keeps one back shows as `stalled`.
            let repeated = matches!(happened.event.kind(), Advance::NAME | Homeward::NAME);
            // Whoever holds a vehicle goes on holding it.
            let kept = happened.event.text("what") == Some(What::Keep.word());
            !(repeated || kept || happened.home == *station && is_about_leave(happened))
        };
        let told: Vec<&Happened> = happened.iter().filter(tells).collect();
        if !told.is_empty() {
            self.browsers.tell(&told, Message::events(told.iter().copied()).text());
        }
    }

    /// Shows where a recording is now.
    pub(super) fn show_replay(&mut self, replay: &mut Replay) {
        let has_jumped =
            self.jumps_shown.replace(replay.jumps()).is_some_and(|jumps| jumps != replay.jumps());
        let happened = replay.take_happened();
        if has_jumped {
            self.browsers.forget();
            self.browsers.tell(&[], Message::Events { events: Vec::new(), anew: true }.text());
        }
        let vehicles = || replay.moment().states.keys();
        let station = happened.iter().map(|happened| &happened.home).find(|home| home.kind() == "ground");
        if let Some(station) = station.or(vehicles().next()).cloned() {
            self.publish_events(&station, &happened);
        }
        let Moment { states, zones, .. } = replay.moment();
        let vehicles = states.iter().map(|(name, (_, state))| recorded_view(replay, name, state)).collect();
        let at_s = replay.at().as_secs_f64();
        self.browsers.show("fleet", Message::Fleet { time_s: at_s, outcome: None, vehicles }.text());
        let zones = zones.values().map(|(at, by, zone)| recorded_zone(states, *at, by, zone)).collect();
        self.browsers.show_new("zones", Message::Zones { zones }.text());
        self.browsers.show_new("scene", self.scene_of(replay).text());
        let (from, to) = replay.span();
        let message = Message::Replay {
            at_s,
            from_s: from.as_secs_f64(),
            to_s: to.as_secs_f64(),
            playing: replay.is_playing(),
            speed: replay.speed(),
            complete: replay.is_complete(),
        };
        self.browsers.show_new("replay", message.text());
        self.explain_recorded(replay);
    }

    fn scene_of(&self, replay: &Replay) -> Message<'_> {
        Message::Scene {
            fleet: "a recording",
            station: "",
            software: env!("CARGO_PKG_VERSION"),
            recording: &self.recording,
            bounds: None,
            obstacles: replay.moment().solids.iter().map(obstacle).collect(),
        }
    }

    fn explain_recorded(&self, replay: &Replay) {
        let why = |vehicle: NodeName| {
            let explanation = replay.explain(&vehicle)?;
            Some((vehicle, Message::Why { headline: explanation.headline(), explanation }.text()))
        };
        let asked = self.browsers.asked();
        if !asked.is_empty() {
            self.browsers.explain(asked.into_iter().filter_map(why).collect());
        }
    }
}

fn recorded_view<'a>(replay: &Replay, name: &'a NodeName, state: &'a State) -> VehicleView<'a> {
    VehicleView {
        name: name.as_str(),
        heard: true,
        link: LinkView { alive: replay.is_heard(name), age_ms: None },
        notes: Vec::new(),
        checks: Vec::new(),
        state: Some(state_view(state)),
    }
}

/// A zone of a recording: each vehicle has said itself whether it has regard for it.
fn recorded_zone<'a>(
    states: &'a BTreeMap<NodeName, (Duration, State)>,
    at: Duration,
    by: &'a str,
    zone: &'a Zone,
) -> ZoneView<'a> {
    let answer = |state: &State| match state.zones.iter().any(|name| name == zone.name()) {
        true => AnswerView::Acknowledged { after_ms: 0.0 },
        false => AnswerView::Pending,
    };
    let answers = states.iter().map(|(vehicle, (_, state))| (vehicle.as_str(), answer(state))).collect();
    ZoneView { zone, by, time_s: at.as_secs_f64(), going: false, answers }
}

fn obstacle(solid: &Solid) -> Obstacle {
    Obstacle {
        form: match solid.form {
            Form::Box(size) => FormView::Box { size: size.into() },
            Form::Cylinder { radius, height } => FormView::Cylinder { radius, height },
            Form::Sphere { radius } => FormView::Sphere { radius },
        },
        position: solid.pose.translation.vector.into(),
        orientation: solid.pose.rotation.coords.into(),
    }
}

impl<'a> Message<'a> {
    pub(super) fn events(happened: impl Iterator<Item = &'a Happened>) -> Self {
        Self::Events { events: happened.map(event_view).collect(), anew: false }
    }

    pub(super) fn you(session: &'a Session, tag: Option<String>) -> Self {
        let name = session.name().map(Giver::as_str);
        Self::You { tag, name, role: session.role(), certified: session.is_certified() }
    }

    pub(super) fn granted(tag: Option<String>, granted: &'a Granted) -> Self {
        match granted {
            Granted::Ordered(id) => Self::Ordered { tag, id: *id },
            Granted::Offered(offer) => Self::offer(tag, offer),
            Granted::Mapped(name) => Self::Mapped { tag, name },
            Granted::Replayed => Self::Replayed { tag },
            // A plan is made of it before anybody is told.
            Granted::Surveyed(_) => Self::Error { tag, message: "the plan is not made yet".to_owned() },
        }
    }

    fn offer(tag: Option<String>, offer: &'a LaunchOffer) -> Self {
        let view = |Candidate { vehicle, task, doubts }: &'a Candidate| CandidateView {
            name: vehicle.as_str(),
            task,
            doubts,
        };
        Self::Offer {
            tag,
            token: &offer.token,
            what: offer.what.word(),
            lasts_s: OFFER_LASTS.as_secs_f64(),
            vehicles: offer.candidates.iter().map(view).collect(),
        }
    }

    /// No message holds a map with keys that are no texts, so that writing it cannot fail.
    pub(super) fn text(&self) -> Text {
        serde_json::to_string(self).unwrap_or_default().into()
    }
}

/// Tells facts of the station about a leave to move, which came too late to matter.
fn is_about_leave(happened: &Happened) -> bool {
    happened.event.text("event").is_some_and(|event| event.ends_with(Advance::NAME))
}

fn fleet(now: Duration, station: &GroundCore) -> Message<'_> {
    let peers: BTreeMap<&NodeName, &Peer> = station.node().node().peers().collect();
    let skewed: BTreeMap<&NodeName, u32> = station.node().skewed().collect();
    let senders: BTreeMap<Option<&NodeName>, SenderStats> = station.node().senders().collect();
    let view = |(name, state)| {
        let peer = peers.get(name);
        let note = |version: &u32| {
            format!(
                "speaks version {version} of the messages, this station {}: update one",
                skein_wire::VERSION
            )
        };
        let passed_over = senders.get(&Some(name)).and_then(passed_over);
        let checks = station.readiness(name).map_or(&[][..], |said| &said.checks);
        VehicleView {
            checks: checks.iter().map(check_view).collect(),
            ..vehicle_view(
                now,
                name,
                state,
                peer.copied(),
                skewed.get(name).map(note).into_iter().chain(passed_over),
            )
        }
    };
    let outcome = station.finished().map(|outcome| OutcomeView {
        succeeded: outcome.succeeded(),
        failed: outcome.failed.into_iter().collect(),
    });
    Message::Fleet { time_s: now.as_secs_f64(), outcome, vehicles: station.roster().map(view).collect() }
}

fn vehicle_view<'a>(
    now: Duration,
    name: &'a NodeName,
    state: Option<&'a State>,
    peer: Option<&Peer>,
    notes: impl Iterator<Item = String>,
) -> VehicleView<'a> {
    let age_ms = peer.and_then(|peer| peer.age(now)).map(|age| age.as_secs_f64() * 1000.0);
    VehicleView {
        name: name.as_str(),
        heard: state.is_some(),
        link: LinkView { alive: peer.is_some_and(|peer| peer.alive), age_ms },
        notes: notes.collect(),
        checks: Vec::new(),
        state: state.map(state_view),
    }
}

/// The messages of a vehicle that this station has passed over, in words.
fn passed_over(stats: &SenderStats) -> Option<String> {
    let counts = [
        (stats.dropped, "more than may wait"),
        (stats.oversized, "too long"),
        (stats.undecodable, "not understood, or beyond a bound"),
        (stats.forged, "under another's key"),
        (stats.implausible, "of a radius or speed that nobody has"),
        (stats.caused.facts_withheld, "facts too many"),
        (stats.caused.lives_refused, "lives too many"),
    ];
    let told: Vec<String> = counts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    (!told.is_empty()).then(|| format!("passed over of what it sends: {}", told.join(", ")))
}

fn check_view(check: &Check) -> CheckView<'_> {
    CheckView { name: &check.name, state: check.state.word(), value: &check.value, advice: &check.advice }
}

fn state_view(state: &State) -> StateView<'_> {
    let array = |vector: &Vector3<f64>| (*vector).into();
    StateView {
        position: array(&state.position),
        velocity: array(&state.velocity),
        yaw_rad: state.yaw_rad,
        radius_m: state.radius_m,
        mode: &state.mode,
        armed: state.armed,
        battery: state.battery,
        task: &state.task,
        waiting_for: &state.waiting_for,
        mission: match state.mission {
            MissionState::UnderWay => MissionView::UnderWay,
            MissionState::Complete => MissionView::Complete,
            MissionState::Failed => MissionView::Failed,
        },
        path: state.path.iter().map(array).collect(),
        scripts: &state.scripts,
        zones: &state.zones,
        holder: &state.holder,
        asked_by: &state.asked_by,
    }
}

fn answer_views(answers: &BTreeMap<NodeName, Answer>) -> BTreeMap<&str, AnswerView<'_>> {
    let view = |answer| match answer {
        &Answer::Pending => AnswerView::Pending,
        &Answer::Missing => AnswerView::Missing,
        &Answer::Acknowledged(after) => AnswerView::Acknowledged { after_ms: after.as_secs_f64() * 1000.0 },
        Answer::Refused(why) => AnswerView::Refused { why },
    };
    answers.iter().map(|(vehicle, said)| (vehicle.as_str(), view(said))).collect()
}

fn zone_view(record: &ZoneRecord) -> ZoneView<'_> {
    ZoneView {
        zone: &record.zone,
        by: record.by.as_str(),
        time_s: record.at.as_secs_f64(),
        going: record.is_going,
        answers: answer_views(&record.answers),
    }
}

fn order_view(record: &OrderRecord) -> OrderView<'_> {
    OrderView {
        id: record.id,
        by: record.by.as_str(),
        what: record.order.what().word(),
        script: record.order.script(),
        time_s: record.at.as_secs_f64(),
        answers: answer_views(&record.answers),
    }
}

/// The one that blocks what is stalled; in other events `by` is somebody else.
fn stalled_by(event: &Event) -> Option<&str> {
    event.text("by").filter(|_| event.kind() == Stalled::NAME)
}

fn event_view(happened: &Happened) -> EventView<'_> {
    EventView {
        time_s: happened.at.as_secs_f64(),
        home: happened.home.as_str(),
        seq: happened.seq,
        name: happened.event.name(),
        data: happened.event.data().collect(),
        requested_by: &happened.requested_by,
        blocked_by: stalled_by(&happened.event).into_iter().collect(),
    }
}
