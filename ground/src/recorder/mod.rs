//! The recorder: a mission as an MCAP file that Foxglove shows without plug-ins.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms` | `world` to each `uav/N` |
//! | `/scene` | `foxglove.SceneUpdate` | obstacles and vehicle hulls, once |
//! | `/uav/N/pose` | `foxglove.PoseInFrame` | where the vehicle is |
//! | `/uav/N/path` | `foxglove.SceneUpdate` | the path it plans to fly |
//! | `/uav/N/scan` | `foxglove.LaserScan` | what its lidar sees |
//! | `/log` | `foxglove.Log` | messages for people |
//! | `/skein/trace` | `skein.TraceEvent` | every event selected, in Skein's own schema |
//! | `/uav/N/state` | `skein.State` | what the vehicle tells of itself |
//! | `/uav/N/board`, `/ground/main/board` | `skein.Board` | what each b-thread requests, waits for and blocks there, and who blocks that |
//!
//! Times are the run's, from 0, so that equal runs make equal files. Each second of it is a chunk of its own: a process
//! that is killed leaves all but its last second.

pub(crate) mod drawing;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Duration;

use foxglove::Encode;
use foxglove::messages::{
    FrameTransform, FrameTransforms, LaserScan, Log, PoseInFrame, SceneEntity, SceneUpdate, Timestamp,
};
use mcap::records::MessageHeader;
use mcap::{Compression, McapError, WriteOptions, Writer};
use nalgebra::{Isometry3, Vector3};
use prost::Message;
use skein_dbp::{Board, Happened, NodeName};
use skein_wire::event::{AutopilotSays, Declared as _, Severity};
use skein_wire::proto::{self, TraceEvent};
use skein_wire::{Scan, Solid, State};
use thiserror::Error;

pub use foxglove::messages::log::Level;

/// Simulated time that a chunk holds.
const CHUNK: Duration = Duration::from_secs(1);
/// Poses of a vehicle are at least this far apart; those between are left out.
const POSE_PERIOD: Duration = Duration::from_millis(40);
/// Scans of a vehicle are at least this far apart; those between are left out.
const SCAN_PERIOD: Duration = Duration::from_millis(200);
/// States of a vehicle are at least this far apart; those between are left out.
const STATE_PERIOD: Duration = Duration::from_millis(400);
/// The fixed frame: ENU, metres.
const WORLD: &str = "world";

/// Why a recording cannot be made or continued.
#[derive(Debug, Error)]
pub enum RecorderError {
    #[error("cannot record to `{}`: {cause}; give a folder that can be written to", path.display())]
    Create { path: PathBuf, cause: std::io::Error },
    #[error("recording to `{}` failed: {cause}", path.display())]
    Write { path: PathBuf, cause: McapError },
}

/// Keeps a recording that is there already beside the one to come: `mission.mcap` as `mission-1.mcap`, or with the first
/// number that is free.
///
/// # Errors
/// [`RecorderError::Create`]: it cannot be renamed.
pub fn keep_former(path: &Path) -> Result<(), RecorderError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let numbered = |number: u32| path.with_file_name(format!("{stem}-{number}.mcap"));
    match (1..).map(numbered).find(|kept| !kept.exists()).filter(|_| path.exists()) {
        Some(kept) => {
            std::fs::rename(path, &kept).map_err(|cause| RecorderError::Create { path: kept.clone(), cause })
        }
        None => Ok(()),
    }
}

/// Writes one mission to a file.
///
/// Times are the run's and should not go back; a message that is late gets the time of the newest before it. What
/// cannot be written is [`RecorderError::Write`].
///
/// ```
/// use std::time::Duration;
/// use nalgebra::Isometry3;
/// use skein_ground::recorder::{Level, Recorder};
///
/// let folder = std::env::temp_dir().join("skein-recorder-example");
/// let mut recorder = Recorder::create(&folder.join("mission.mcap"))?;
/// recorder.log(Duration::ZERO, Level::Info, "ground/main", "mission starts")?;
/// recorder.poses(Duration::from_millis(20), &[("uav/1", Isometry3::translation(0.0, 0.0, 3.0))])?;
/// recorder.finish()?;
/// # std::fs::remove_dir_all(folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Recorder {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<String, Channel>,
    /// Log time of the newest message.
    newest: Duration,
    /// When the open chunk is to be closed.
    chunk_ends: Duration,
    poses_due: Duration,
    scans_due: BTreeMap<String, Duration>,
    /// Which state of each vehicle was written last, and when the next may be.
    states: BTreeMap<NodeName, (Made, Duration)>,
    /// Which board of each node was written last.
    boards: BTreeMap<NodeName, Made>,
    /// Kept between messages to save allocations.
    buffer: Vec<u8>,
}

/// In which life of its node something was made, and when.
type Made = (u64, Duration);

#[derive(Clone, Copy)]
struct Channel {
    id: u16,
    sequence: u32,
}

impl Recorder {
    /// Makes the file, and the folders above it, if they are missing; a file that is there is replaced.
    pub fn create(path: &Path) -> Result<Self, RecorderError> {
        let failed = |cause| RecorderError::Create { path: path.to_owned(), cause };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        let file = File::create(path).map_err(failed)?;
        let library = concat!("skein-ground ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().compression(Some(Compression::Lz4)).library(library);
        let writer = options
            .create(BufWriter::new(file))
            .map_err(|cause| RecorderError::Write { path: path.to_owned(), cause })?;
        Ok(Self {
            path: path.to_owned(),
            writer,
            channels: BTreeMap::new(),
            newest: Duration::ZERO,
            chunk_ends: CHUNK,
            poses_due: Duration::ZERO,
            scans_due: BTreeMap::new(),
            states: BTreeMap::new(),
            boards: BTreeMap::new(),
            buffer: Vec::new(),
        })
    }

    /// The obstacles of the world, for `/scene`.
    pub fn scene(&mut self, now: Duration, solids: &[Solid]) -> Result<(), RecorderError> {
        let entities = vec![drawing::obstacles(timestamp(now), solids)];
        self.write("/scene", now, &SceneUpdate { entities, ..SceneUpdate::default() })
    }

    /// The vehicles as spheres that move with their frames, each with its name, for `/scene`.
    pub fn vehicles(&mut self, now: Duration, hulls: &[(&str, f64)]) -> Result<(), RecorderError> {
        let hull = |(index, (vehicle, radius_m)): (usize, &(&str, f64))| {
            drawing::hull(timestamp(now), vehicle, *radius_m, index)
        };
        let entities: Vec<SceneEntity> = hulls.iter().enumerate().map(hull).collect();
        self.write("/scene", now, &SceneUpdate { entities, ..SceneUpdate::default() })
    }

    /// The poses of the vehicles (body FLU to world ENU, metres), for `/tf` and `/uav/N/pose`: all in one call.
    pub fn poses(&mut self, now: Duration, poses: &[(&str, Isometry3<f64>)]) -> Result<(), RecorderError> {
        if now < self.poses_due {
            return Ok(());
        }
        self.poses_due = now + POSE_PERIOD;
        let transform = |(vehicle, pose): &(&str, Isometry3<f64>)| FrameTransform {
            timestamp: Some(timestamp(now)),
            parent_frame_id: WORLD.to_owned(),
            child_frame_id: (*vehicle).to_owned(),
            translation: Some(drawing::vector(&pose.translation.vector)),
            rotation: Some(drawing::quaternion(&pose.rotation)),
        };
        self.write("/tf", now, &FrameTransforms { transforms: poses.iter().map(transform).collect() })?;
        for (vehicle, pose) in poses {
            let message = PoseInFrame {
                timestamp: Some(timestamp(now)),
                frame_id: WORLD.to_owned(),
                pose: Some(drawing::pose(pose)),
            };
            self.write(&format!("/{vehicle}/pose"), now, &message)?;
        }
        Ok(())
    }

    /// The path a vehicle plans to fly (world ENU, metres), for `/uav/N/path`; it replaces the one before.
    pub fn path(
        &mut self,
        now: Duration,
        vehicle: &str,
        points: &[Vector3<f64>],
    ) -> Result<(), RecorderError> {
        let entities = vec![drawing::path(timestamp(now), vehicle, points)];
        self.write(&format!("/{vehicle}/path"), now, &SceneUpdate { entities, ..SceneUpdate::default() })
    }

    /// One turn of a vehicle's lidar, for `/uav/N/scan`.
    pub fn scan(&mut self, now: Duration, vehicle: &str, scan: &Scan) -> Result<(), RecorderError> {
        if self.scans_due.get(vehicle).is_some_and(|due| now < *due) {
            return Ok(());
        }
        self.scans_due.insert(vehicle.to_owned(), now + SCAN_PERIOD);
        let last_ray = scan.ranges_m.len().saturating_sub(1) as f64;
        let message = LaserScan {
            timestamp: Some(timestamp(now)),
            frame_id: vehicle.to_owned(),
            pose: Some(drawing::pose(&Isometry3::identity())),
            start_angle: scan.angle_min,
            end_angle: scan.angle_min + scan.angle_step * last_ray,
            ranges: scan.ranges_m.iter().copied().map(short).collect(),
            intensities: Vec::new(),
        };
        self.write(&format!("/{vehicle}/scan"), now, &message)
    }

    /// A message for people, for `/log`; `name` is the node or part that speaks.
    pub fn log(
        &mut self,
        now: Duration,
        level: Level,
        name: &str,
        message: &str,
    ) -> Result<(), RecorderError> {
        let message = Log {
            timestamp: Some(timestamp(now)),
            level: level.into(),
            message: message.to_owned(),
            name: name.to_owned(),
            ..Log::default()
        };
        self.write("/log", now, &message)
    }

    /// An event, as a message for people.
    pub fn event(&mut self, now: Duration, happened: &Happened) -> Result<(), RecorderError> {
        let level = AutopilotSays::read(&happened.event).map_or(Level::Info, |said| level(said.severity));
        self.log(now, level, happened.home.as_str(), &format!("{:#}", happened.event))
    }

    /// An event that `node` selected or heard of, for `/skein/trace`, at the event's own time.
    pub fn trace(&mut self, node: &NodeName, happened: &Happened) -> Result<(), RecorderError> {
        let event = TraceEvent::new(node, happened);
        self.write_own("/skein/trace", "skein.TraceEvent", happened.at, &event)
    }

    /// The state of a vehicle, for `/uav/N/state`, unless it has been written already; its path has a topic of its
    /// own.
    pub fn state(&mut self, now: Duration, state: &State) -> Result<(), RecorderError> {
        let made = (state.incarnation, state.time);
        if self.states.get(&state.node).is_some_and(|(last, due)| now < *due || *last == made) {
            return Ok(());
        }
        self.states.insert(state.node.clone(), (made, now + STATE_PERIOD));
        let message = proto::State { path: Vec::new(), ..state.into() };
        self.write_own(&format!("/{}/state", state.node), "skein.State", now, &message)
    }

    /// The board of a node, for `/uav/N/board`, unless it has been written already.
    pub fn board(&mut self, now: Duration, board: &Board) -> Result<(), RecorderError> {
        let made = (board.incarnation, board.at);
        if self.boards.insert(board.node.clone(), made) == Some(made) {
            return Ok(());
        }
        let message = proto::Board::from(board);
        self.write_own(&format!("/{}/board", board.node), "skein.Board", now, &message)
    }

    /// Completes the file; a recording that is dropped before is completed too, but cannot tell of errors.
    pub fn finish(mut self) -> Result<(), RecorderError> {
        match self.writer.finish() {
            Ok(_) => Ok(()),
            Err(cause) => Err(self.failed(cause)),
        }
    }

    /// A message in one of Skein's own schemas.
    fn write_own(
        &mut self,
        topic: &str,
        schema: &str,
        now: Duration,
        message: &impl Message,
    ) -> Result<(), RecorderError> {
        let channel = self.channel(topic, || (schema, skein_wire::FILE_DESCRIPTOR_SET))?;
        self.put(channel, now, |buffer| message.encode_raw(buffer))
    }

    fn write<M: Encode + Message>(
        &mut self,
        topic: &str,
        now: Duration,
        message: &M,
    ) -> Result<(), RecorderError> {
        let schema = M::get_schema();
        let schema = || schema.as_ref().map_or(("", &[][..]), |s| (s.name.as_str(), s.data.as_ref()));
        let channel = self.channel(topic, schema)?;
        self.put(channel, now, |buffer| message.encode_raw(buffer))
    }

    /// The channel of a topic, opened on first use.
    fn channel<'s>(
        &mut self,
        topic: &str,
        schema: impl FnOnce() -> (&'s str, &'s [u8]),
    ) -> Result<MessageHeader, RecorderError> {
        if !self.channels.contains_key(topic) {
            let (name, data) = schema();
            let id = self.open_channel(topic, name, data).map_err(|cause| self.failed(cause))?;
            self.channels.insert(topic.to_owned(), Channel { id, sequence: 0 });
        }
        let channel = self.channels.entry(topic.to_owned()).or_insert(Channel { id: 0, sequence: 0 });
        channel.sequence = channel.sequence.wrapping_add(1);
        Ok(MessageHeader { channel_id: channel.id, sequence: channel.sequence, log_time: 0, publish_time: 0 })
    }

    fn open_channel(&mut self, topic: &str, schema: &str, data: &[u8]) -> Result<u16, McapError> {
        let schema = self.writer.add_schema(schema, "protobuf", data)?;
        self.writer.add_channel(schema, topic, "protobuf", &BTreeMap::new())
    }

    fn put(
        &mut self,
        header: MessageHeader,
        now: Duration,
        encode: impl FnOnce(&mut Vec<u8>),
    ) -> Result<(), RecorderError> {
        self.newest = self.newest.max(now);
        self.buffer.clear();
        encode(&mut self.buffer);
        let header = MessageHeader { log_time: nanos(self.newest), publish_time: nanos(now), ..header };
        let written = self.writer.write_to_known_channel(&header, &self.buffer);
        written.and_then(|()| self.close_chunk_if_due()).map_err(|cause| self.failed(cause))
    }

    fn close_chunk_if_due(&mut self) -> Result<(), McapError> {
        if self.newest < self.chunk_ends {
            return Ok(());
        }
        self.chunk_ends = self.newest + CHUNK;
        self.writer.flush()
    }

    fn failed(&self, cause: McapError) -> RecorderError {
        RecorderError::Write { path: self.path.clone(), cause }
    }
}

fn nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

fn timestamp(time: Duration) -> Timestamp {
    Timestamp::new(u32::try_from(time.as_secs()).unwrap_or(u32::MAX), time.subsec_nanos())
}

/// A range to the next of 1/512 m, which the noise is well above: its zero bits make scans a third as large on disk.
fn short(range_m: f32) -> f64 {
    (f64::from(range_m) * 512.0).round() / 512.0
}
/// The level of a line of an autopilot.
fn level(severity: Severity) -> Level {
    match severity {
        Severity::Emergency | Severity::Alert => Level::Fatal,
        Severity::Critical | Severity::Error => Level::Error,
        Severity::Warning => Level::Warning,
        Severity::Notice | Severity::Info => Level::Info,
    }
}
