//! A recording, read for what it can explain.

use std::path::{Path, PathBuf};
use std::time::Duration;

use foxglove::messages::{FrameTransform, FrameTransforms, SceneUpdate};
use mcap::McapError;
use nalgebra::Vector3;
use prost::Message as _;
use skein_dbp::{Board, Happened, NodeName};
use skein_wire::proto::{self, TraceEvent};
use skein_wire::{DecodeError, Solid, State};

use super::Evidence;
use super::messages::Messages;
use crate::recorder::drawing;

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    #[error("{}: {cause}", path.display())]
    Open { path: PathBuf, cause: std::io::Error },
    #[error("{} is no recording that can be read: {cause}; expected an MCAP file such as mission.mcap", path.display())]
    Unreadable { path: PathBuf, cause: McapError },
    #[error("{}: a message on {topic} at {at_s:.3} s cannot be read: {cause}", path.display())]
    Message { path: PathBuf, topic: String, at_s: f64, cause: DecodeError },
}

/// A recording of boards, events and states of vehicles. Times are the run's, from 0.
pub struct Recorded {
    notes: Vec<(Duration, Note)>,
    span: (Duration, Duration),
    complete: bool,
}

/// One message of a recording.
pub(crate) enum Note {
    State(Box<State>),
    Board(Board),
    Event(Happened),
    /// Where vehicles were, ENU, metres.
    Places(Vec<(NodeName, Vector3<f64>)>),
    /// The obstacles of the world.
    Solids(Vec<Solid>),
    /// The way ahead of a vehicle, ENU, metres.
    Path(NodeName, Vec<Vector3<f64>>),
}

impl Recorded {
    /// Reads a recording. One that was cut short counts as far as it goes.
    pub fn open(path: &Path) -> Result<Self, RecordedError> {
        let file =
            std::fs::read(path).map_err(|cause| RecordedError::Open { path: path.to_owned(), cause })?;
        Self::read(&file, path)
    }

    /// Reads the content of a recording, which errors call by `path`.
    pub fn read(file: &[u8], path: &Path) -> Result<Self, RecordedError> {
        let unreadable = |cause| RecordedError::Unreadable { path: path.to_owned(), cause };
        let mut messages = Messages::of(file);
        let mut recorded = Self {
            notes: Vec::new(),
            span: (Duration::MAX, Duration::ZERO),
            complete: ends_as_it_should(file),
        };
        while let Some(message) = messages.next() {
            let (header, data) = match message {
                Ok(message) => message,
                // What follows was not written any more.
                Err(_) if recorded.is_begun() => {
                    recorded.complete = false;
                    break;
                }
                Err(cause) => return Err(unreadable(cause)),
            };
            let at = Duration::from_nanos(header.log_time);
            recorded.span = (recorded.span.0.min(at), recorded.span.1.max(at));
            let note = note(messages.schema(&header), messages.topic(&header), &data).map_err(|cause| {
                RecordedError::Message {
                    path: path.to_owned(),
                    topic: messages.topic(&header).unwrap_or_default().to_owned(),
                    at_s: at.as_secs_f64(),
                    cause,
                }
            })?;
            recorded.notes.extend(note.map(|note| (at, note)));
        }
        Ok(recorded)
    }

    fn is_begun(&self) -> bool {
        self.span.0 <= self.span.1
    }

    /// The times of its first and last message; none if it holds none.
    pub fn span(&self) -> Option<(Duration, Duration)> {
        self.is_begun().then_some(self.span)
    }

    /// Whether it was brought to its end, and not cut short.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Whether it tells what b-threads bid; recordings of earlier versions do not.
    pub fn has_boards(&self) -> bool {
        self.notes.iter().any(|(_, note)| matches!(note, Note::Board(_)))
    }

    /// Its content, in order, each with its time.
    pub(crate) fn notes(&self) -> &[(Duration, Note)] {
        &self.notes
    }

    pub fn evidence_at(&self, at: Duration) -> Evidence {
        let mut evidence = Evidence::default();
        for (_, note) in &self.notes {
            if let Note::State(state) = note {
                evidence.note_vehicle(&state.node);
            }
        }
        for (when, note) in self.notes.iter().take_while(|(when, _)| *when <= at) {
            match note {
                Note::State(state) => evidence.note_state(*when, state),
                Note::Board(board) => evidence.note_board(*when, board.clone()),
                Note::Event(happened) => evidence.note_event(happened.clone()),
                Note::Places(_) | Note::Solids(_) | Note::Path(..) => {}
            }
        }
        evidence
    }
}

/// Whether the mark that a file begins with is also at its end.
fn ends_as_it_should(file: &[u8]) -> bool {
    file.get(mcap::MAGIC.len()..).is_some_and(|rest| rest.ends_with(mcap::MAGIC))
}

fn note(schema: Option<&str>, topic: Option<&str>, data: &[u8]) -> Result<Option<Note>, DecodeError> {
    Ok(match schema {
        Some("skein.State") => Some(Note::State(Box::new(proto::State::decode(data)?.try_into()?))),
        Some("skein.Board") => Some(Note::Board(proto::Board::decode(data)?.try_into()?)),
        Some("skein.TraceEvent") => Some(Note::Event(TraceEvent::decode(data)?.try_into()?)),
        Some("foxglove.FrameTransforms") => Some(Note::Places(places(&FrameTransforms::decode(data)?))),
        Some("foxglove.SceneUpdate") => drawn(topic.unwrap_or_default(), SceneUpdate::decode(data)?),
        _ => None,
    })
}

fn places(transforms: &FrameTransforms) -> Vec<(NodeName, Vector3<f64>)> {
    let place = |transform: &FrameTransform| {
        let place = drawing::plain(transform.translation.as_ref()?);
        Some((NodeName::new(&transform.child_frame_id).ok()?, place)).filter(|(_, place)| is_finite(place))
    };
    transforms.transforms.iter().filter_map(place).collect()
}

/// An obstacle of the world, or the way of a vehicle.
fn drawn(topic: &str, update: SceneUpdate) -> Option<Note> {
    let entity = update.entities.first()?;
    if topic == "/scene" {
        return (entity.id == drawing::OBSTACLES).then(|| Note::Solids(drawing::solids(entity)));
    }
    let vehicle = topic.strip_prefix('/')?.strip_suffix("/path")?;
    let points = entity.lines.iter().flat_map(|line| &line.points);
    let points = points.map(|point| Vector3::new(point.x, point.y, point.z)).filter(is_finite);
    Some(Note::Path(NodeName::new(vehicle).ok()?, points.collect()))
}

fn is_finite(place: &Vector3<f64>) -> bool {
    place.iter().all(|metres| metres.is_finite())
}
