//! Replay: a recorded mission played again, and what it came to.

use std::collections::BTreeMap;
use std::time::Duration;

use nalgebra::Vector3;
use serde::Serialize;
use skein_dbp::{Happened, NodeName};
use skein_wire::event::{Declared as _, Drawn, Erased, MissionOver};
use skein_wire::{Solid, State, Zone};

use crate::explain::{Evidence, Explanation, Note, Recorded, explain};

/// A vehicle whose last word is older than this is shown as silent.
const SILENT_AFTER: Duration = Duration::from_millis(1500);
/// The slowest and the fastest that a recording is played.
const SPEEDS: [f64; 2] = [0.1, 20.0];
/// So many of the nearest moments are told.
const NEAREST_TOLD: usize = 3;
/// Events of this long before a place that was sought are shown with it.
const EVENTS_BEFORE: Duration = Duration::from_secs(60);

/// A recording that is played, without a clock.
pub struct Replay {
    recorded: Recorded,
    span: (Duration, Duration),
    at: Duration,
    /// The number of notes that are played.
    played: usize,
    is_playing: bool,
    speed: f64,
    /// Grows whenever time has jumped.
    jumps: u64,
    moment: Moment,
}

/// The state at a moment.
#[derive(Default)]
pub struct Moment {
    pub states: BTreeMap<NodeName, (Duration, State)>,
    pub solids: Vec<Solid>,
    pub zones: BTreeMap<String, (Duration, String, Zone)>,
    /// What has happened since it was taken last.
    happened: Vec<Happened>,
    evidence: Evidence,
}

impl Replay {
    /// A recording at its beginning, not playing; none if it holds nothing.
    pub fn new(recorded: Recorded) -> Option<Self> {
        let span = recorded.span()?;
        let (at, moment) = (span.0, Moment::default());
        let mut replay =
            Self { recorded, span, at, played: 0, is_playing: false, speed: 1.0, jumps: 0, moment };
        replay.play_notes();
        Some(replay)
    }

    /// The time of its first and of its last message.
    pub fn span(&self) -> (Duration, Duration) {
        self.span
    }

    pub fn at(&self) -> Duration {
        self.at
    }

    pub fn is_playing(&self) -> bool {
        self.is_playing
    }

    /// How many seconds of it pass in one.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Grows whenever time has jumped: whatever was told before is void.
    pub fn jumps(&self) -> u64 {
        self.jumps
    }

    /// Whether it was brought to its end, and not cut short.
    pub fn is_complete(&self) -> bool {
        self.recorded.is_complete()
    }

    pub fn moment(&self) -> &Moment {
        &self.moment
    }

    /// Plays it, or stops; from its end it begins anew.
    pub fn play(&mut self, is_playing: bool) {
        if is_playing && self.at == self.span.1 {
            self.seek(self.span.0);
        }
        self.is_playing = is_playing;
    }

    /// Plays it so many times as fast, within what it can be.
    pub fn set_speed(&mut self, speed: f64) {
        let [slowest, fastest] = SPEEDS;
        self.speed = if speed.is_finite() { speed.clamp(slowest, fastest) } else { 1.0 };
    }

    /// Goes to a time, within the recording.
    pub fn seek(&mut self, at: Duration) {
        self.at = at.clamp(self.span.0, self.span.1);
        (self.played, self.moment) = (0, Moment::default());
        self.jumps += 1;
        self.play_notes();
        let since = self.at.saturating_sub(EVENTS_BEFORE);
        self.moment.happened.retain(|happened| happened.at >= since);
    }

    /// So much time has passed for whoever looks on.
    pub fn go_on(&mut self, passed: Duration) {
        if self.is_playing {
            self.at = (self.at + passed.mul_f64(self.speed)).min(self.span.1);
            self.is_playing = self.at < self.span.1;
            self.play_notes();
        }
    }

    fn play_notes(&mut self) {
        let notes = &self.recorded.notes()[self.played..];
        for (when, note) in notes.iter().take_while(|(when, _)| *when <= self.at) {
            self.moment.take_in(*when, note);
            self.played += 1;
        }
    }

    /// Takes what has happened since the last call, or since time has jumped.
    pub fn take_happened(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.moment.happened)
    }

    /// Why a vehicle did what it did.
    pub fn explain(&self, vehicle: &NodeName) -> Option<Explanation> {
        explain(&self.moment.evidence, self.at, vehicle)
    }

    /// Whether a vehicle had been heard lately.
    pub fn is_heard(&self, vehicle: &NodeName) -> bool {
        let state = self.moment.states.get(vehicle);
        state.is_some_and(|(heard, _)| self.at.saturating_sub(*heard) < SILENT_AFTER)
    }
}

impl Moment {
    fn take_in(&mut self, when: Duration, note: &Note) {
        match note {
            Note::State(state) => {
                self.evidence.note_state(when, state);
                let path = self.states.remove(&state.node).map(|(_, before)| before.path).unwrap_or_default();
                self.states.insert(state.node.clone(), (when, State { path, ..(**state).clone() }));
            }
            Note::Places(places) => {
                for (vehicle, place) in places {
                    if let Some((_, state)) = self.states.get_mut(vehicle) {
                        state.position = *place;
                    }
                }
            }
            Note::Path(vehicle, points) => {
                if let Some((_, state)) = self.states.get_mut(vehicle) {
                    state.path.clone_from(points);
                }
            }
            Note::Solids(solids) => self.solids.clone_from(solids),
            Note::Board(board) => self.evidence.note_board(when, board.clone()),
            Note::Event(happened) => {
                self.note_zone(happened);
                self.evidence.note_event(happened.clone());
                self.happened.push(happened.clone());
            }
        }
    }

    fn note_zone(&mut self, happened: &Happened) {
        if let Some(Drawn { name, zone, by }) = Drawn::read(&happened.event)
            && let Ok(zone) = zone.parse()
        {
            self.zones.insert(name.to_string(), (happened.at, by.to_string(), zone));
        } else if let Some(Erased { name, .. }) = Erased::read(&happened.event) {
            self.zones.remove(&*name);
        }
    }
}

/// The outcome of a recorded mission.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Digest {
    /// Whether the recording was brought to its end.
    pub complete: bool,
    pub from_s: f64,
    pub to_s: f64,
    pub vehicles: Vec<String>,
    /// The number of events that happened.
    pub events: usize,
    /// Whether every vehicle did what it was sent for; none if the mission was not over.
    pub succeeded: Option<bool>,
    /// The moments at which two vehicles in the air were nearest, the nearest pair first; of each pair one.
    pub nearest: Vec<Near>,
}

/// The moment at which two vehicles were nearest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Near {
    pub at_s: f64,
    pub one: String,
    pub other: String,
    /// Centre to centre.
    pub distance_m: f64,
}

impl Digest {
    /// That of a recording; none if it holds nothing.
    pub fn of(recorded: &Recorded) -> Option<Self> {
        let (from, to) = recorded.span()?;
        let (mut flying, mut places) = (BTreeMap::new(), BTreeMap::new());
        let mut nearest: BTreeMap<(NodeName, NodeName), (f64, Duration)> = BTreeMap::new();
        let (mut events, mut succeeded) = (0, None);
        for (when, note) in recorded.notes() {
            match note {
                Note::State(state) => drop(flying.insert(state.node.clone(), state.armed)),
                Note::Event(happened) => {
                    events += 1;
                    succeeded = MissionOver::read(&happened.event).map(|over| over.succeeded).or(succeeded);
                }
                Note::Places(moved) => {
                    places.extend(moved.iter().cloned());
                    let is_flying = |vehicle: &NodeName| flying.get(vehicle) == Some(&true);
                    let moved = moved.iter().map(|(vehicle, _)| vehicle).filter(|vehicle| is_flying(vehicle));
                    moved.for_each(|vehicle| note_nearest(*when, vehicle, &places, is_flying, &mut nearest));
                }
                Note::Board(_) | Note::Solids(_) | Note::Path(..) => {}
            }
        }
        let mut nearest: Vec<Near> = nearest.into_iter().map(near).collect();
        nearest.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        nearest.truncate(NEAREST_TOLD);
        Some(Self {
            complete: recorded.is_complete(),
            from_s: from.as_secs_f64(),
            to_s: to.as_secs_f64(),
            vehicles: flying.into_keys().map(|vehicle| vehicle.to_string()).collect(),
            events,
            succeeded,
            nearest,
        })
    }

    /// The nearest moments, a line each.
    pub fn nearest_in_words(&self) -> Vec<String> {
        let line = |Near { at_s, one, other, distance_m }: &Near| {
            format!("{one} and {other} were {distance_m:.2} m apart at {at_s:.1} s")
        };
        self.nearest.iter().map(line).collect()
    }
}

/// Looks how near a vehicle is to each that comes after it by name.
fn note_nearest(
    when: Duration,
    vehicle: &NodeName,
    places: &BTreeMap<NodeName, Vector3<f64>>,
    is_flying: impl Fn(&NodeName) -> bool,
    nearest: &mut BTreeMap<(NodeName, NodeName), (f64, Duration)>,
) {
    let Some(place) = places.get(vehicle) else { return };
    for (other, there) in places.iter().filter(|(other, _)| *other > vehicle && is_flying(other)) {
        let apart_m = (place - there).norm();
        let pair = (vehicle.clone(), other.clone());
        let least = nearest.entry(pair).or_insert((f64::INFINITY, when));
        if apart_m < least.0 {
            *least = (apart_m, when);
        }
    }
}

fn near(((one, other), (distance_m, at)): ((NodeName, NodeName), (f64, Duration))) -> Near {
    Near { at_s: at.as_secs_f64(), one: one.to_string(), other: other.to_string(), distance_m }
}
