//! Control and mission apart, each at its own pace: on a vehicle each has a thread of its own, so that
//! nothing that the mission waits for (b-threads, the network, a disk, a script's trial) keeps set-points
//! waiting.
//!
//! They share nothing. Control tells [`News`], the mission gives [`Orders`], and a driver carries both to and
//! fro. Of what one has not taken yet, the newest of each kind counts: so both are bounded, and neither a
//! `hold` nor a `land` nor the word that somebody has taken the vehicle over is ever lost. Control knows when
//! the mission has decided last, and does not fly on without it: see [`decisions`].

mod control_side;
pub mod decisions;
mod mission_side;
mod newest;
mod news;
mod orders;

pub use self::{
    control_side::ControlSide,
    mission_side::MissionSide,
    newest::Newest,
    news::{Body, News},
    orders::{Orders, Words},
};
