//! The way of messages from the station's loop to the browsers: nobody waits for anybody.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use skein_dbp::{Happened, NodeName};
use tokio::sync::{broadcast, watch};

use crate::giver::Giver;

/// Events that a browser gets when it connects.
const EVENTS_KEPT: usize = 300;
/// A browser may lag behind by so many events before it misses some.
const EVENTS_UNREAD: usize = 256;

/// A message for browsers, as text.
pub(super) type Text = Arc<str>;

/// The newest message of each kind that replaces the one before.
pub(super) type Pictures = BTreeMap<&'static str, Text>;

/// Explanations by vehicle.
pub(super) type Reasons = Arc<BTreeMap<NodeName, Text>>;

/// The number of browsers that ask about a vehicle.
type Questions = Arc<Mutex<BTreeMap<NodeName, usize>>>;

/// When the station's loop has shown something last.
type Spoke = Arc<Mutex<Option<Instant>>>;

/// The station's end.
pub(super) struct Broadcast {
    pictures: watch::Sender<Pictures>,
    events: broadcast::Sender<Text>,
    reasons: watch::Sender<Reasons>,
    history: Arc<Mutex<VecDeque<Happened>>>,
    questions: Questions,
    spoke: Spoke,
}

/// A browser's end.
pub(super) struct Subscription {
    pub(super) pictures: watch::Receiver<Pictures>,
    pub(super) events: broadcast::Receiver<Text>,
    pub(super) reasons: watch::Receiver<Reasons>,
    history: Arc<Mutex<VecDeque<Happened>>>,
    questions: Questions,
    spoke: Spoke,
}

/// A browser's question about a vehicle, for as long as it is asked.
pub(super) struct Question {
    pub(super) vehicle: NodeName,
    questions: Questions,
}

/// Those who are there to give orders, each with the number of their browsers.
#[derive(Clone, Debug, Default)]
pub(super) struct Present(Arc<Mutex<BTreeMap<Giver, usize>>>);

/// Somebody's presence, until it is dropped.
pub(super) struct Attendance {
    name: Giver,
    present: Present,
}

impl Present {
    pub(super) fn enter(&self, name: Giver) -> Attendance {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner).entry(name.clone()).or_default() += 1;
        Attendance { name, present: self.clone() }
    }

    pub(super) fn names(&self) -> BTreeSet<Giver> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).keys().cloned().collect()
    }
}

impl Drop for Attendance {
    fn drop(&mut self) {
        let mut present = self.present.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(browsers) = present.get_mut(&self.name) {
            *browsers -= 1;
            if *browsers == 0 {
                present.remove(&self.name);
            }
        }
    }
}

impl Broadcast {
    pub(super) fn new() -> (Self, Subscription) {
        let (pictures, pictures_read) = watch::channel(Pictures::new());
        let (events, events_read) = broadcast::channel(EVENTS_UNREAD);
        let (reasons, reasons_read) = watch::channel(Reasons::default());
        let (history, questions) = (Arc::new(Mutex::new(VecDeque::new())), Questions::default());
        let spoke = Spoke::default();
        let subscription = Subscription {
            pictures: pictures_read,
            events: events_read,
            reasons: reasons_read,
            history: history.clone(),
            questions: questions.clone(),
            spoke: spoke.clone(),
        };
        (Self { pictures, events, reasons, history, questions, spoke }, subscription)
    }

    /// Shows this in the place of the last of its kind.
    pub(super) fn show(&self, kind: &'static str, picture: Text) {
        *self.spoke.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        self.pictures.send_modify(|pictures| drop(pictures.insert(kind, picture)));
    }

    /// The same, if it is another than that.
    pub(super) fn show_new(&self, kind: &'static str, picture: Text) {
        let is_new = self.pictures.borrow().get(kind).is_none_or(|shown| *shown != picture);
        if is_new {
            self.show(kind, picture);
        }
    }

    /// Tells what has happened, now and to browsers that come later.
    pub(super) fn tell(&self, happened: &[&Happened], text: Text) {
        let mut history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        history.extend(happened.iter().copied().cloned());
        let excess = history.len().saturating_sub(EVENTS_KEPT);
        history.drain(..excess);
        drop(history);
        // Nobody watches: that is no error.
        let _ = self.events.send(text);
    }

    /// What was told is void: browsers that come later are not told of it.
    pub(super) fn forget(&self) {
        self.history.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// The vehicles that somebody asks about.
    pub(super) fn asked(&self) -> Vec<NodeName> {
        self.questions.lock().unwrap_or_else(PoisonError::into_inner).keys().cloned().collect()
    }

    /// Answers the questions about some vehicles.
    pub(super) fn explain(&self, reasons: BTreeMap<NodeName, Text>) {
        self.reasons.send_replace(Arc::new(reasons));
    }
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
    /// The newest pictures are news to a new browser.
    fn clone(&self) -> Self {
        let mut clone = Self {
            pictures: self.pictures.clone(),
            events: self.events.resubscribe(),
            reasons: self.reasons.clone(),
            history: self.history.clone(),
            questions: self.questions.clone(),
            spoke: self.spoke.clone(),
        };
        clone.pictures.mark_changed();
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

    /// The time since the station's loop has shown something; none if it never has.
    pub(super) fn age(&self) -> Option<Duration> {
        self.spoke.lock().unwrap_or_else(PoisonError::into_inner).map(|spoke| spoke.elapsed())
    }

    /// The latest events.
    pub(super) fn history(&self) -> Vec<Happened> {
        self.history.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }
}
