//! Between the protocol's records and their protobuf forms.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use skein_bp::{Event, EventSet, Pattern, Real, Value};
use skein_dbp::{
    BidAck, BidRecord, Board, BoardLease, BoardRequest, BoardRow, JointWord, NodeName, Occurrence, OnLoss,
    Presence, Refusal, RefusalReason, RemoteBid, Repair, ServedRequest,
};

use crate::proto::{self, event_set, value::Kind};
use crate::{DecodeError, Echo, Form, MissionState, Scan, Scene, Solid, State};

type Result<T> = std::result::Result<T, DecodeError>;

fn node(field: &'static str, name: &str) -> Result<NodeName> {
    NodeName::new(name).map_err(|source| DecodeError::Name { field, source })
}

fn text(name: &NodeName) -> String {
    name.as_str().into()
}

fn ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn required<T>(field: &'static str, value: Option<T>) -> Result<T> {
    value.ok_or(DecodeError::Missing { field })
}

/// Numbers of epochs, occurrences and synchronisation points start at 1 and stay below 2^63.
fn number(field: &'static str, given: u64, least: u64) -> Result<u64> {
    if given >= least && i64::try_from(given).is_ok() {
        Ok(given)
    } else {
        let expected = if least == 0 { "a number below 2^63" } else { "a number from 1 to 2^63 - 1" };
        Err(DecodeError::Range { field, given: given.to_string(), expected })
    }
}

fn finite(field: &'static str, given: f64) -> Result<f64> {
    if given.is_finite() {
        Ok(given)
    } else {
        Err(DecodeError::Range { field, given: given.to_string(), expected: "a finite number" })
    }
}

fn not_negative(field: &'static str, given: f64) -> Result<f64> {
    if given.is_finite() && given >= 0.0 {
        Ok(given)
    } else {
        Err(DecodeError::Range { field, given: given.to_string(), expected: "a finite number of at least 0" })
    }
}

fn vector(field: &'static str, v: &proto::Vec3) -> Result<Vector3<f64>> {
    Ok(Vector3::new(finite(field, v.x)?, finite(field, v.y)?, finite(field, v.z)?))
}

fn at_most(field: &'static str, given: usize, most: usize, expected: &'static str) -> Result<()> {
    if given <= most { Ok(()) } else { Err(DecodeError::Range { field, given: given.to_string(), expected }) }
}

impl From<&Value> for proto::Value {
    fn from(value: &Value) -> Self {
        let kind = match value {
            Value::Bool(flag) => Kind::Flag(*flag),
            Value::Int(integer) => Kind::Integer(*integer),
            Value::Real(real) => Kind::Real(real.get()),
            Value::Text(text) => Kind::Text(text.as_ref().into()),
        };
        Self { kind: Some(kind) }
    }
}

impl TryFrom<proto::Value> for Value {
    type Error = DecodeError;

    fn try_from(value: proto::Value) -> Result<Self> {
        Ok(match required("Value.kind", value.kind)? {
            Kind::Flag(flag) => flag.into(),
            Kind::Integer(integer) => integer.into(),
            Kind::Real(real) => real.into(),
            Kind::Text(text) => text.into(),
        })
    }
}

impl From<&Event> for proto::Event {
    fn from(event: &Event) -> Self {
        Self {
            name: event.name().into(),
            data: event.data().map(|(key, value)| (key.into(), value.into())).collect(),
        }
    }
}

impl TryFrom<proto::Event> for Event {
    type Error = DecodeError;

    fn try_from(event: proto::Event) -> Result<Self> {
        if event.name.is_empty() {
            return Err(DecodeError::Missing { field: "Event.name" });
        }
        event.data.into_iter().try_fold(Event::new(event.name), |event, (key, value)| {
            Ok(event.with(key, Value::try_from(value)?))
        })
    }
}

fn vec3(x: f64, y: f64, z: f64) -> proto::Vec3 {
    proto::Vec3 { x, y, z }
}

impl From<&EventSet> for proto::EventSet {
    fn from(set: &EventSet) -> Self {
        use event_set::{Form, List};
        let list = |sets: &[EventSet]| List { sets: sets.iter().map(Into::into).collect() };
        let corner = |corner: &[Real; 3]| Some(vec3(corner[0].get(), corner[1].get(), corner[2].get()));
        let form = match set {
            EventSet::None => Form::None(event_set::Unit {}),
            EventSet::All => Form::All(event_set::Unit {}),
            EventSet::Exactly(event) => Form::Exactly(event.into()),
            EventSet::Named(pattern) if pattern.is_literal() => Form::Name(pattern.as_str().into()),
            EventSet::Named(pattern) => Form::Named(pattern.as_str().into()),
            EventSet::Prefix(prefix) => Form::Prefix(prefix.as_ref().into()),
            EventSet::FieldRange { key, min, max } => {
                Form::Range(event_set::Range { key: key.as_ref().into(), min: min.get(), max: max.get() })
            }
            EventSet::FieldIs(fields) => Form::Fields(event_set::Fields {
                fields: fields.iter().map(|(key, value)| (key.as_ref().into(), value.into())).collect(),
            }),
            EventSet::Region { min, max } => {
                Form::Region(event_set::Region { min: corner(min), max: corner(max) })
            }
            EventSet::Not(set) => Form::Not(Box::new(set.as_ref().into())),
            EventSet::And(sets) => Form::And(list(sets)),
            EventSet::Or(sets) => Form::Or(list(sets)),
        };
        Self { form: Some(form) }
    }
}

impl TryFrom<proto::EventSet> for EventSet {
    type Error = DecodeError;

    /// Ends for any input: the decoder has bounded the tree's depth.
    fn try_from(set: proto::EventSet) -> Result<Self> {
        use event_set::Form;
        let list =
            |list: event_set::List| list.sets.into_iter().map(EventSet::try_from).collect::<Result<Vec<_>>>();
        let corner = |corner: proto::Vec3| [corner.x, corner.y, corner.z].map(Real::from);
        Ok(match required("EventSet.form", set.form)? {
            Form::None(_) => Self::None,
            Form::All(_) => Self::All,
            Form::Exactly(event) => Self::Exactly(event.try_into()?),
            Form::Named(pattern) => Self::Named(Pattern::new(pattern)),
            Form::Name(name) => Self::Named(Pattern::literal(name)),
            Form::Prefix(prefix) => Self::Prefix(prefix.into()),
            Form::Range(range) => {
                Self::FieldRange { key: range.key.into(), min: range.min.into(), max: range.max.into() }
            }
            Form::Fields(fields) => Self::FieldIs(
                fields
                    .fields
                    .into_iter()
                    .map(|(key, value)| Ok((Arc::from(key), Value::try_from(value)?)))
                    .collect::<Result<BTreeMap<_, _>>>()?,
            ),
            Form::Region(region) => Self::Region {
                min: corner(required("EventSet.region.min", region.min)?),
                max: corner(required("EventSet.region.max", region.max)?),
            },
            Form::Not(set) => Self::Not(Box::new((*set).try_into()?)),
            Form::And(sets) => Self::And(list(sets)?),
            Form::Or(sets) => Self::Or(list(sets)?),
        })
    }
}

impl From<&RemoteBid> for proto::RemoteBid {
    fn from(bid: &RemoteBid) -> Self {
        let on_loss = match bid.on_loss {
            OnLoss::Release => proto::OnLoss::Release,
            OnLoss::Hold => proto::OnLoss::Hold,
        };
        Self {
            bthread: bid.bthread.clone(),
            sync: bid.sync,
            requests: bid.requests.iter().map(Into::into).collect(),
            block: (!bid.block.is_none()).then(|| (&bid.block).into()),
            block_since: Some(bid.block_since),
            priority: bid.priority,
            on_loss: on_loss.into(),
        }
    }
}

impl TryFrom<proto::RemoteBid> for RemoteBid {
    type Error = DecodeError;

    fn try_from(bid: proto::RemoteBid) -> Result<Self> {
        let on_loss = match proto::OnLoss::try_from(bid.on_loss) {
            Ok(proto::OnLoss::Release) => OnLoss::Release,
            Ok(proto::OnLoss::Hold) => OnLoss::Hold,
            Err(_) => {
                let given = bid.on_loss.to_string();
                return Err(DecodeError::Range {
                    field: "RemoteBid.on_loss",
                    given,
                    expected: "0 (release) or 1 (hold)",
                });
            }
        };
        Ok(Self {
            bthread: bid.bthread,
            sync: number("RemoteBid.sync", bid.sync, 1)?,
            requests: bid.requests.into_iter().map(Event::try_from).collect::<Result<_>>()?,
            block: bid.block.map_or(Ok(EventSet::None), EventSet::try_from)?,
            block_since: bid.block_since.map_or(bid.sync, |since| since.min(bid.sync)),
            priority: bid.priority,
            on_loss,
        })
    }
}

impl From<&BidRecord> for proto::BidRecord {
    fn from(record: &BidRecord) -> Self {
        Self {
            node: text(&record.node),
            incarnation: record.incarnation,
            home: text(&record.home),
            home_incarnation: record.home_incarnation,
            epoch: record.epoch,
            sent_at_ns: ns(record.sent_at),
            applied: record.applied,
            lease_ms: record.lease_ms,
            bids: record.bids.iter().map(Into::into).collect(),
            term: record.term,
            decided: record.decided,
        }
    }
}

impl TryFrom<proto::BidRecord> for BidRecord {
    type Error = DecodeError;

    fn try_from(record: proto::BidRecord) -> Result<Self> {
        Ok(Self {
            node: node("BidRecord.node", &record.node)?,
            incarnation: record.incarnation,
            home: node("BidRecord.home", &record.home)?,
            home_incarnation: record.home_incarnation,
            epoch: number("BidRecord.epoch", record.epoch, 1)?,
            sent_at: Duration::from_nanos(record.sent_at_ns),
            applied: number("BidRecord.applied", record.applied, 0)?,
            lease_ms: record.lease_ms,
            term: number("BidRecord.term", record.term, 0)?,
            decided: number("BidRecord.decided", record.decided, 0)?,
            bids: record.bids.into_iter().map(RemoteBid::try_from).collect::<Result<_>>()?,
        })
    }
}

impl From<&BidAck> for proto::BidAck {
    fn from(ack: &BidAck) -> Self {
        Self {
            home: text(&ack.home),
            home_incarnation: ack.home_incarnation,
            node: text(&ack.node),
            incarnation: ack.incarnation,
            epoch: ack.epoch,
            sent_at_ns: ns(ack.sent_at),
            latest_seq: ack.latest_seq,
            refused: ack.refused.iter().map(Into::into).collect(),
        }
    }
}

impl TryFrom<proto::BidAck> for BidAck {
    type Error = DecodeError;

    fn try_from(ack: proto::BidAck) -> Result<Self> {
        Ok(Self {
            home: node("BidAck.home", &ack.home)?,
            home_incarnation: ack.home_incarnation,
            node: node("BidAck.node", &ack.node)?,
            incarnation: ack.incarnation,
            epoch: number("BidAck.epoch", ack.epoch, 1)?,
            sent_at: Duration::from_nanos(ack.sent_at_ns),
            latest_seq: number("BidAck.latest_seq", ack.latest_seq, 0)?,
            refused: ack.refused.into_iter().map(Refusal::try_from).collect::<Result<_>>()?,
        })
    }
}

impl From<&Refusal> for proto::Refusal {
    fn from(refusal: &Refusal) -> Self {
        let reason = match refusal.reason {
            RefusalReason::Unspecified => proto::RefusalReason::Unspecified,
            RefusalReason::Safety => proto::RefusalReason::Safety,
            RefusalReason::NotHome => proto::RefusalReason::NotHome,
            RefusalReason::HoldUnsupported => proto::RefusalReason::HoldUnsupported,
            RefusalReason::LeaseTooLong => proto::RefusalReason::LeaseTooLong,
            RefusalReason::Reserved => proto::RefusalReason::Reserved,
            RefusalReason::Quota => proto::RefusalReason::Quota,
            RefusalReason::MayNotRequest => proto::RefusalReason::MayNotRequest,
            RefusalReason::MayNotBlock => proto::RefusalReason::MayNotBlock,
            RefusalReason::Lifted => proto::RefusalReason::Lifted,
        };
        Self { bthread: refusal.bthread.clone(), sync: refusal.sync, reason: reason.into() }
    }
}

impl TryFrom<proto::Refusal> for Refusal {
    type Error = DecodeError;

    fn try_from(refusal: proto::Refusal) -> Result<Self> {
        // A reason of a later version is still a refusal.
        let reason = match proto::RefusalReason::try_from(refusal.reason).unwrap_or_default() {
            proto::RefusalReason::Unspecified => RefusalReason::Unspecified,
            proto::RefusalReason::Safety => RefusalReason::Safety,
            proto::RefusalReason::NotHome => RefusalReason::NotHome,
            proto::RefusalReason::HoldUnsupported => RefusalReason::HoldUnsupported,
            proto::RefusalReason::LeaseTooLong => RefusalReason::LeaseTooLong,
            proto::RefusalReason::Reserved => RefusalReason::Reserved,
            proto::RefusalReason::Quota => RefusalReason::Quota,
            proto::RefusalReason::MayNotRequest => RefusalReason::MayNotRequest,
            proto::RefusalReason::MayNotBlock => RefusalReason::MayNotBlock,
            proto::RefusalReason::Lifted => RefusalReason::Lifted,
        };
        Ok(Self { bthread: refusal.bthread, sync: number("Refusal.sync", refusal.sync, 1)?, reason })
    }
}

impl From<&Occurrence> for proto::Occurrence {
    fn from(occurrence: &Occurrence) -> Self {
        let served = |request: &ServedRequest| proto::ServedRequest {
            node: text(&request.node),
            incarnation: request.incarnation,
            bthread: request.bthread.clone(),
            sync: request.sync,
        };
        Self {
            home: text(&occurrence.home),
            incarnation: occurrence.incarnation,
            seq: occurrence.seq,
            event: Some((&occurrence.event).into()),
            requests_served: occurrence.requests_served.iter().map(served).collect(),
            requested_by: occurrence.requested_by.iter().map(|name| name.as_ref().into()).collect(),
            choice: occurrence.choice.as_deref().unwrap_or_default().into(),
            at_ns: ns(occurrence.at),
            term: occurrence.term,
        }
    }
}

impl TryFrom<proto::Occurrence> for Occurrence {
    type Error = DecodeError;

    fn try_from(occurrence: proto::Occurrence) -> Result<Self> {
        let served = |request: proto::ServedRequest| -> Result<ServedRequest> {
            Ok(ServedRequest {
                node: node("ServedRequest.node", &request.node)?,
                incarnation: request.incarnation,
                bthread: request.bthread,
                sync: number("ServedRequest.sync", request.sync, 1)?,
            })
        };
        Ok(Self {
            home: node("Occurrence.home", &occurrence.home)?,
            incarnation: occurrence.incarnation,
            seq: number("Occurrence.seq", occurrence.seq, 1)?,
            term: number("Occurrence.term", occurrence.term, 0)?,
            event: required("Occurrence.event", occurrence.event)?.try_into()?,
            requests_served: occurrence.requests_served.into_iter().map(served).collect::<Result<_>>()?,
            requested_by: occurrence.requested_by.into_iter().map(Arc::from).collect(),
            choice: (!occurrence.choice.is_empty()).then(|| occurrence.choice.into()),
            at: Duration::from_nanos(occurrence.at_ns),
        })
    }
}

impl From<&Repair> for proto::Repair {
    fn from(repair: &Repair) -> Self {
        Self {
            home: text(&repair.home),
            incarnation: repair.incarnation,
            from_seq: repair.from_seq,
            to_seq: repair.to_seq,
            requester: text(&repair.requester),
            term: repair.term,
        }
    }
}

impl TryFrom<proto::Repair> for Repair {
    type Error = DecodeError;

    fn try_from(repair: proto::Repair) -> Result<Self> {
        Ok(Self {
            home: node("Repair.home", &repair.home)?,
            incarnation: repair.incarnation,
            from_seq: number("Repair.from_seq", repair.from_seq, 1)?,
            to_seq: number("Repair.to_seq", repair.to_seq, 1)?,
            term: number("Repair.term", repair.term, 0)?,
            requester: node("Repair.requester", &repair.requester)?,
        })
    }
}

impl From<&Presence> for proto::Presence {
    fn from(presence: &Presence) -> Self {
        Self {
            node: text(&presence.node),
            incarnation: presence.incarnation,
            up_ns: ns(presence.up),
            latest_seq: presence.latest_seq,
            oldest_seq: presence.oldest_seq,
            lease_ms: presence.lease_ms,
            joint: presence.joint.map(|word| proto::JointWord {
                term: word.term,
                decided: word.decided,
                heard_ns: word.heard.map(ns),
                asks: word.asks,
            }),
        }
    }
}

impl TryFrom<proto::Presence> for Presence {
    type Error = DecodeError;

    fn try_from(presence: proto::Presence) -> Result<Self> {
        Ok(Self {
            node: node("Presence.node", &presence.node)?,
            incarnation: presence.incarnation,
            up: Duration::from_nanos(presence.up_ns),
            latest_seq: number("Presence.latest_seq", presence.latest_seq, 0)?,
            oldest_seq: number("Presence.oldest_seq", presence.oldest_seq, 1)?,
            lease_ms: presence.lease_ms,
            joint: presence.joint.map(JointWord::try_from).transpose()?,
        })
    }
}

impl TryFrom<proto::JointWord> for JointWord {
    type Error = DecodeError;

    fn try_from(word: proto::JointWord) -> Result<Self> {
        Ok(Self {
            term: number("JointWord.term", word.term, 1)?,
            decided: number("JointWord.decided", word.decided, 0)?,
            heard: word.heard_ns.map(Duration::from_nanos),
            asks: word.asks,
        })
    }
}

impl From<&State> for proto::State {
    fn from(state: &State) -> Self {
        let vector = |v: &Vector3<f64>| vec3(v.x, v.y, v.z);
        Self {
            node: text(&state.node),
            incarnation: state.incarnation,
            time_ns: ns(state.time),
            position: Some(vector(&state.position)),
            velocity: Some(vector(&state.velocity)),
            yaw_rad: state.yaw_rad,
            position_sigma_m: state.position_sigma_m,
            radius_m: state.radius_m,
            mode: state.mode.clone(),
            armed: state.armed,
            battery: state.battery,
            task: state.task.clone(),
            waiting_for: state.waiting_for.clone(),
            path: state.path.iter().take(State::MAX_PATH).map(vector).collect(),
            mission: match state.mission {
                MissionState::UnderWay => proto::Mission::UnderWay,
                MissionState::Complete => proto::Mission::Complete,
                MissionState::Failed => proto::Mission::Failed,
            }
            .into(),
            scripts: state.scripts.iter().take(State::MAX_SCRIPTS).cloned().collect(),
            echo: state.echo.as_ref().map(|echo| proto::Echo {
                node: text(&echo.node),
                incarnation: echo.incarnation,
                time_ns: ns(echo.time),
                held_ns: ns(echo.held),
            }),
        }
    }
}

impl TryFrom<proto::State> for State {
    type Error = DecodeError;

    fn try_from(state: proto::State) -> Result<Self> {
        at_most("State.path", state.path.len(), Self::MAX_PATH, "at most 32 points")?;
        at_most("State.scripts", state.scripts.len(), Self::MAX_SCRIPTS, "at most 8 names")?;
        if !(0.0..=1.0).contains(&state.battery) {
            let given = state.battery.to_string();
            return Err(DecodeError::Range {
                field: "State.battery",
                given,
                expected: "a share from 0 to 1",
            });
        }
        Ok(Self {
            node: node("State.node", &state.node)?,
            incarnation: state.incarnation,
            time: Duration::from_nanos(state.time_ns),
            position: vector("State.position", &required("State.position", state.position)?)?,
            velocity: vector("State.velocity", &required("State.velocity", state.velocity)?)?,
            yaw_rad: finite("State.yaw_rad", state.yaw_rad)?,
            position_sigma_m: not_negative("State.position_sigma_m", state.position_sigma_m)?,
            radius_m: not_negative("State.radius_m", state.radius_m)?,
            mode: state.mode,
            armed: state.armed,
            battery: state.battery,
            task: state.task,
            waiting_for: state.waiting_for,
            path: state.path.iter().map(|point| vector("State.path", point)).collect::<Result<_>>()?,
            // In a word of a later version, it is not over as far as this one can tell.
            mission: match proto::Mission::try_from(state.mission).unwrap_or_default() {
                proto::Mission::UnderWay => MissionState::UnderWay,
                proto::Mission::Complete => MissionState::Complete,
                proto::Mission::Failed => MissionState::Failed,
            },
            scripts: state.scripts,
            echo: state.echo.map(Echo::try_from).transpose()?,
        })
    }
}

impl TryFrom<proto::Echo> for Echo {
    type Error = DecodeError;

    fn try_from(echo: proto::Echo) -> Result<Self> {
        Ok(Self {
            node: node("Echo.node", &echo.node)?,
            incarnation: echo.incarnation,
            time: Duration::from_nanos(echo.time_ns),
            held: Duration::from_nanos(echo.held_ns),
        })
    }
}

impl From<&Scan> for proto::Scan {
    fn from(scan: &Scan) -> Self {
        Self {
            measured_unix_ns: ns(scan.measured_at_unix),
            angle_min: scan.angle_min,
            angle_step: scan.angle_step,
            max_range_m: scan.max_range_m,
            ranges_m: scan.ranges_m.clone(),
            up_m: scan.up_m,
            down_m: scan.down_m,
        }
    }
}

impl TryFrom<proto::Scan> for Scan {
    type Error = DecodeError;

    fn try_from(scan: proto::Scan) -> Result<Self> {
        at_most("Scan.ranges_m", scan.ranges_m.len(), Self::MAX_RAYS, "at most 4096 rays")?;
        let range = |field, given: Option<f32>| match given {
            Some(given) => not_negative(field, f64::from(given)).map(|_| Some(given)),
            None => Ok(None),
        };
        Ok(Self {
            measured_at_unix: Duration::from_nanos(scan.measured_unix_ns),
            angle_min: finite("Scan.angle_min", scan.angle_min)?,
            angle_step: finite("Scan.angle_step", scan.angle_step)?,
            max_range_m: not_negative("Scan.max_range_m", scan.max_range_m)?,
            ranges_m: scan.ranges_m,
            up_m: range("Scan.up_m", scan.up_m)?,
            down_m: range("Scan.down_m", scan.down_m)?,
        })
    }
}

impl From<&Scene> for proto::Scene {
    fn from(scene: &Scene) -> Self {
        Self {
            min: Some(vec3(scene.min.x, scene.min.y, scene.min.z)),
            max: Some(vec3(scene.max.x, scene.max.y, scene.max.z)),
            solids: scene.solids.iter().take(Scene::MAX_SOLIDS).map(Into::into).collect(),
        }
    }
}

impl TryFrom<proto::Scene> for Scene {
    type Error = DecodeError;

    fn try_from(scene: proto::Scene) -> Result<Self> {
        at_most("Scene.solids", scene.solids.len(), Self::MAX_SOLIDS, "at most 4096 bodies")?;
        Ok(Self {
            min: vector("Scene.min", &required("Scene.min", scene.min)?)?,
            max: vector("Scene.max", &required("Scene.max", scene.max)?)?,
            solids: scene.solids.into_iter().map(Solid::try_from).collect::<Result<_>>()?,
        })
    }
}

impl From<&Solid> for proto::Solid {
    fn from(solid: &Solid) -> Self {
        let (position, turn) = (&solid.pose.translation.vector, &solid.pose.rotation);
        Self {
            position: Some(vec3(position.x, position.y, position.z)),
            orientation: Some(proto::Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w }),
            form: Some(match solid.form {
                Form::Box(size) => proto::solid::Form::Box(vec3(size.x, size.y, size.z)),
                Form::Cylinder { radius, height } => {
                    proto::solid::Form::Cylinder(proto::solid::Cylinder { radius, height })
                }
                Form::Sphere { radius } => proto::solid::Form::Sphere(radius),
            }),
        }
    }
}

impl TryFrom<proto::Solid> for Solid {
    type Error = DecodeError;

    fn try_from(solid: proto::Solid) -> Result<Self> {
        let form = match required("Solid.form", solid.form)? {
            proto::solid::Form::Box(size) => Form::Box(vector("Solid.box", &size)?),
            proto::solid::Form::Cylinder(cylinder) => Form::Cylinder {
                radius: not_negative("Solid.cylinder.radius", cylinder.radius)?,
                height: not_negative("Solid.cylinder.height", cylinder.height)?,
            },
            proto::solid::Form::Sphere(radius) => {
                Form::Sphere { radius: not_negative("Solid.sphere", radius)? }
            }
        };
        let position = vector("Solid.position", &required("Solid.position", solid.position)?)?;
        let turn = required("Solid.orientation", solid.orientation)?;
        let turn = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
        let turn = UnitQuaternion::try_new(turn, 1e-6).ok_or(DecodeError::Range {
            field: "Solid.orientation",
            given: "no rotation".into(),
            expected: "a unit quaternion",
        })?;
        Ok(Self { form, pose: Isometry3::from_parts(Translation3::from(position), turn) })
    }
}

impl From<&Board> for proto::Board {
    fn from(board: &Board) -> Self {
        Self {
            node: text(&board.node),
            incarnation: board.incarnation,
            time_ns: ns(board.at),
            rows: board.rows.iter().map(Into::into).collect(),
            left_out: board.left_out,
        }
    }
}

impl TryFrom<proto::Board> for Board {
    type Error = DecodeError;

    /// What exceeds the quotas is cut here too: a board decides nothing, and part of it is better than none.
    fn try_from(board: proto::Board) -> Result<Self> {
        let rows =
            board.rows.into_iter().take(Self::MAX_ROWS).map(BoardRow::try_from).collect::<Result<_>>()?;
        let cut = Self::new(
            node("Board.node", &board.node)?,
            board.incarnation,
            Duration::from_nanos(board.time_ns),
            rows,
        );
        Ok(Self { left_out: board.left_out, ..cut })
    }
}

impl From<&BoardRow> for proto::BoardRow {
    fn from(row: &BoardRow) -> Self {
        let some = |set: &EventSet| (!set.is_none()).then(|| set.into());
        let request = |request: &BoardRequest| proto::BoardRequest {
            event: Some((&request.event).into()),
            blocked_by: request.blocked_by.clone(),
        };
        Self {
            bthread: row.bthread.clone(),
            requests: row.requests.iter().map(request).collect(),
            waits: some(&row.waits),
            blocks: some(&row.blocks),
            interrupts: some(&row.interrupts),
            priority: row.priority,
            deadline_ns: row.deadline.map(ns),
            lease_age_ns: row.lease.map(|lease| ns(lease.age)),
            lease_ns: row.lease.map(|lease| ns(lease.length)),
            cut: row.cut,
        }
    }
}

impl TryFrom<proto::BoardRow> for BoardRow {
    type Error = DecodeError;

    fn try_from(row: proto::BoardRow) -> Result<Self> {
        let set = |set: Option<proto::EventSet>| set.map_or(Ok(EventSet::None), EventSet::try_from);
        let request = |request: proto::BoardRequest| -> Result<BoardRequest> {
            let event = required("BoardRequest.event", request.event)?.try_into()?;
            Ok(BoardRequest { event, blocked_by: request.blocked_by })
        };
        let lease = row.lease_age_ns.zip(row.lease_ns);
        Ok(Self {
            bthread: row.bthread,
            requests: row.requests.into_iter().map(request).collect::<Result<_>>()?,
            waits: set(row.waits)?,
            blocks: set(row.blocks)?,
            interrupts: set(row.interrupts)?,
            priority: row.priority,
            deadline: row.deadline_ns.map(Duration::from_nanos),
            lease: lease.map(|(age, length)| BoardLease {
                age: Duration::from_nanos(age),
                length: Duration::from_nanos(length),
            }),
            cut: row.cut,
        })
    }
}
