//! What browsers are told: `scene`, `fleet`, `orders` as they are now, `events` as they happen, and `why` a vehicle does what
//! it does, to whoever asks about it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use nalgebra::Vector3;
use serde::Serialize;
use skein_dbp::{Happened, NodeName, Peer};
use skein_wire::event::{Advance, Declared as _, Homeward};
use skein_wire::proto::{TraceEvent, value::Kind};
use skein_wire::{Form, MissionState, Scene, State};
use tokio::sync::{broadcast, watch};

use crate::explain::Explanation;
use crate::{Answer, GroundCore, OrderRecord};

/// The swarm is shown this often.
const FLEET_PERIOD: Duration = Duration::from_millis(100);
/// Vehicles that somebody asks about are explained this often.
const WHY_PERIOD: Duration = Duration::from_millis(400);
/// Events that a browser gets when it connects.
const EVENTS_KEPT: usize = 300;
/// How far a browser may lag behind the events before it misses some.
const EVENTS_UNREAD: usize = 256;

/// A message for browsers, as text.
pub(super) type Text = Arc<str>;

/// Explanations by vehicle.
pub(super) type Reasons = Arc<BTreeMap<NodeName, Text>>;

/// Which vehicles browsers ask about, and how many of them each.
type Questions = Arc<Mutex<BTreeMap<NodeName, usize>>>;

/// The station's end.
pub(super) struct Feed {
    scene: watch::Sender<Option<Text>>,
    fleet: watch::Sender<Option<Text>>,
    orders: watch::Sender<Option<Text>>,
    events: broadcast::Sender<Text>,
    reasons: watch::Sender<Reasons>,
    history: Arc<Mutex<VecDeque<EventView>>>,
    questions: Questions,
    fleet_due: Duration,
    reasons_due: Duration,
    orders_shown: Option<u64>,
}

/// The browsers' end, one for each.
pub(super) struct Subscription {
    pub(super) scene: watch::Receiver<Option<Text>>,
    pub(super) fleet: watch::Receiver<Option<Text>>,
    pub(super) orders: watch::Receiver<Option<Text>>,
    pub(super) events: broadcast::Receiver<Text>,
    pub(super) reasons: watch::Receiver<Reasons>,
    history: Arc<Mutex<VecDeque<EventView>>>,
    questions: Questions,
}

/// A browser's question about a vehicle, for as long as it is asked.
pub(super) struct Question {
    pub(super) vehicle: NodeName,
    questions: Questions,
}

impl Drop for Question {
    fn drop(&mut self) {
        let mut questions = self.questions.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(asking) = questions.get_mut(&self.vehicle) {
            *asking -= 1;
            if *asking == 0 {
                questions.remove(&self.vehicle);
            }
        }
    }
}

impl Clone for Subscription {
    /// What has been so is news to a new browser.
    fn clone(&self) -> Self {
        let mut clone = Self {
            scene: self.scene.clone(),
            fleet: self.fleet.clone(),
            orders: self.orders.clone(),
            events: self.events.resubscribe(),
            reasons: self.reasons.clone(),
            history: self.history.clone(),
            questions: self.questions.clone(),
        };
        clone.scene.mark_changed();
        clone.fleet.mark_changed();
        clone.orders.mark_changed();
        clone
    }
}

impl Subscription {
    /// Asks why a vehicle does what it does, until the question is dropped.
    pub(super) fn ask_about(&self, vehicle: NodeName) -> Question {
        let mut questions = self.questions.lock().unwrap_or_else(PoisonError::into_inner);
        *questions.entry(vehicle.clone()).or_default() += 1;
        Question { vehicle, questions: self.questions.clone() }
    }

    /// The latest events, as one message.
    pub(super) fn history(&self) -> Text {
        let history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        text(&Message::Events { events: history.iter().cloned().collect() })
    }
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Message<'a> {
    Scene {
        fleet: &'a str,
        station: &'a str,
        software: &'static str,
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
        events: Vec<EventView>,
    },
    Why {
        headline: String,
        #[serde(flatten)]
        explanation: Explanation,
    },
}

#[derive(Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Serialize)]
struct Obstacle {
    #[serde(flatten)]
    form: FormView,
    position: [f64; 3],
    orientation: [f64; 4],
}

#[derive(Serialize)]
#[serde(tag = "form", rename_all = "snake_case")]
enum FormView {
    Box { size: [f64; 3] },
    Cylinder { radius: f64, height: f64 },
    Sphere { radius: f64 },
}

#[derive(Serialize)]
struct OutcomeView {
    succeeded: bool,
    failed: BTreeMap<String, String>,
}

#[derive(Serialize)]
struct VehicleView<'a> {
    name: &'a str,
    heard: bool,
    link: LinkView,
    notes: Vec<String>,
    #[serde(flatten)]
    state: Option<StateView<'a>>,
}

#[derive(Serialize)]
struct LinkView {
    alive: bool,
    age_ms: Option<f64>,
}

#[derive(Serialize)]
struct StateView<'a> {
    position: [f64; 3],
    velocity: [f64; 3],
    yaw_rad: f64,
    radius_m: f64,
    mode: &'a str,
    armed: bool,
    battery: f64,
    task: &'a str,
    waiting_for: &'a str,
    mission: &'static str,
    path: Vec<[f64; 3]>,
    scripts: &'a [String],
}

#[derive(Serialize)]
struct OrderView<'a> {
    id: u64,
    what: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    script: Option<&'a str>,
    time_s: f64,
    answers: BTreeMap<&'a str, AnswerView<'a>>,
}

#[derive(Serialize)]
#[serde(tag = "state", rename_all = "snake_case")]
enum AnswerView<'a> {
    Pending,
    Missing,
    Acknowledged { after_ms: f64 },
    Refused { why: &'a str },
}

#[derive(Clone, Serialize)]
struct EventView {
    time_s: f64,
    home: String,
    seq: u64,
    name: String,
    data: BTreeMap<String, Datum>,
    requested_by: Vec<String>,
    blocked_by: Vec<String>,
    lease_age_ms: Option<f64>,
}

#[derive(Clone, Serialize)]
#[serde(untagged)]
enum Datum {
    Flag(bool),
    Integer(i64),
    Real(f64),
    Text(String),
}

impl Feed {
    pub(super) fn new() -> (Self, Subscription) {
        let (scene, scene_read) = watch::channel(None);
        let (fleet, fleet_read) = watch::channel(None);
        let (orders, orders_read) = watch::channel(None);
        let (events, events_read) = broadcast::channel(EVENTS_UNREAD);
        let (reasons, reasons_read) = watch::channel(Reasons::default());
        let (history, questions) = (Arc::new(Mutex::new(VecDeque::new())), Questions::default());
        let subscription = Subscription {
            scene: scene_read,
            fleet: fleet_read,
            orders: orders_read,
            events: events_read,
            reasons: reasons_read,
            history: history.clone(),
            questions: questions.clone(),
        };
        let feed = Self {
            scene,
            fleet,
            orders,
            events,
            reasons,
            history,
            questions,
            fleet_due: Duration::ZERO,
            reasons_due: Duration::ZERO,
            orders_shown: None,
        };
        (feed, subscription)
    }

    pub(super) fn show_scene(&mut self, station: &GroundCore, scene: Option<&Scene>) {
        let solids = scene.iter().flat_map(|scene| &scene.solids);
        let obstacles = solids.map(|solid| Obstacle {
            form: match solid.form {
                Form::Box(size) => FormView::Box { size: size.into() },
                Form::Cylinder { radius, height } => FormView::Cylinder { radius, height },
                Form::Sphere { radius } => FormView::Sphere { radius },
            },
            position: solid.pose.translation.vector.into(),
            orientation: solid.pose.rotation.coords.into(),
        });
        let message = Message::Scene {
            fleet: station.node().fleet().as_str(),
            station: station.name().as_str(),
            software: env!("CARGO_PKG_VERSION"),
            bounds: scene.map(|scene| Bounds { min: scene.min.into(), max: scene.max.into() }),
            obstacles: obstacles.collect(),
        };
        self.scene.send_replace(Some(text(&message)));
    }

    pub(super) fn publish(&mut self, now: Duration, station: &GroundCore, happened: &[Happened]) {
        self.publish_events(station.name(), happened);
        if self.orders_shown != Some(station.orders_revision()) {
            self.orders_shown = Some(station.orders_revision());
            let orders = station.orders().map(order_view).collect();
            self.orders.send_replace(Some(text(&Message::Orders { orders })));
        }
        if now >= self.fleet_due {
            self.fleet_due = now + FLEET_PERIOD;
            self.fleet.send_replace(Some(text(&fleet(now, station))));
        }
        if now >= self.reasons_due {
            self.reasons_due = now + WHY_PERIOD;
            self.publish_reasons(station);
        }
    }

    fn publish_reasons(&self, station: &GroundCore) {
        let asked: Vec<NodeName> =
            self.questions.lock().unwrap_or_else(PoisonError::into_inner).keys().cloned().collect();
        if asked.is_empty() {
            return;
        }
        let why = |vehicle: NodeName| {
            let explanation = station.explain(&vehicle)?;
            Some((vehicle, text(&Message::Why { headline: explanation.headline(), explanation })))
        };
        self.reasons.send_replace(Arc::new(asked.into_iter().filter_map(why).collect()));
    }

    fn publish_events(&mut self, station: &NodeName, happened: &[Happened]) {
        let tells = |happened: &&Happened| {
            // Leaves to move are ten a second for each vehicle; what keeps one back shows as `stalled`.
            let repeated = matches!(happened.event.kind(), Advance::NAME | Homeward::NAME);
            !(repeated || happened.home == *station && is_about_leave(happened))
        };
        let views: Vec<EventView> =
            happened.iter().filter(tells).map(|happened| event_view(station, happened)).collect();
        if views.is_empty() {
            return;
        }
        let mut history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        history.extend(views.iter().cloned());
        let excess = history.len().saturating_sub(EVENTS_KEPT);
        history.drain(..excess);
        drop(history);
        // Nobody watches: that is no error.
        let _ = self.events.send(text(&Message::Events { events: views }));
    }
}

/// Whether a fact of the station is about a leave to move that came too late to matter.
fn is_about_leave(happened: &Happened) -> bool {
    happened.event.text("event").is_some_and(|event| event.ends_with(Advance::NAME))
}

fn fleet(now: Duration, station: &GroundCore) -> Message<'_> {
    let peers: BTreeMap<&NodeName, &Peer> = station.node().node().peers().collect();
    let skewed: BTreeMap<&NodeName, u32> = station.node().skewed().collect();
    let view = |(name, state)| {
        let peer = peers.get(name);
        let note = |version: &u32| {
            format!(
                "speaks version {version} of the messages, this station {}: update one",
                skein_wire::VERSION
            )
        };
        vehicle_view(now, name, state, peer.copied(), skewed.get(name).map(note))
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
    note: Option<String>,
) -> VehicleView<'a> {
    let age_ms = peer.and_then(|peer| peer.age(now)).map(|age| age.as_secs_f64() * 1000.0);
    VehicleView {
        name: name.as_str(),
        heard: state.is_some(),
        link: LinkView { alive: peer.is_some_and(|peer| peer.alive), age_ms },
        notes: note.into_iter().collect(),
        state: state.map(state_view),
    }
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
            MissionState::UnderWay => "under_way",
            MissionState::Complete => "complete",
            MissionState::Failed => "failed",
        },
        path: state.path.iter().map(array).collect(),
        scripts: &state.scripts,
    }
}

fn order_view(record: &OrderRecord) -> OrderView<'_> {
    let answer = |answer| match answer {
        &Answer::Pending => AnswerView::Pending,
        &Answer::Missing => AnswerView::Missing,
        &Answer::Acknowledged(after) => AnswerView::Acknowledged { after_ms: after.as_secs_f64() * 1000.0 },
        Answer::Refused(why) => AnswerView::Refused { why },
    };
    OrderView {
        id: record.id,
        what: record.order.what().word(),
        script: record.order.script(),
        time_s: record.at.as_secs_f64(),
        answers: record.answers.iter().map(|(vehicle, said)| (vehicle.as_str(), answer(said))).collect(),
    }
}

fn event_view(station: &NodeName, happened: &Happened) -> EventView {
    let event = TraceEvent::new(station, happened);
    let datum = |value: skein_wire::proto::Value| match value.kind? {
        Kind::Flag(flag) => Some(Datum::Flag(flag)),
        Kind::Integer(integer) => Some(Datum::Integer(integer)),
        Kind::Real(real) => Some(Datum::Real(real)),
        Kind::Text(text) => Some(Datum::Text(text)),
    };
    EventView {
        time_s: happened.at.as_secs_f64(),
        home: event.home,
        seq: event.seq,
        name: event.event,
        data: event.data.into_iter().filter_map(|(key, value)| Some((key, datum(value)?))).collect(),
        requested_by: event.requested_by,
        blocked_by: event.blocked_by,
        lease_age_ms: event.lease_age_ms,
    }
}

/// No message holds a map with keys that are no texts, so that writing it cannot fail.
fn text(message: &Message<'_>) -> Text {
    serde_json::to_string(message).unwrap_or_default().into()
}
