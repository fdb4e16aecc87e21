//! The protobuf forms, generated from `proto/skein.proto`.
//!
//! Programs use the plain records of [`Payload`](crate::Payload). These types serve those who read or write the bytes,
//! such as a recorder, which keeps [`TraceEvent`]s.

#![allow(clippy::all, clippy::pedantic)]

/// The version of the messages that this build writes, and the greatest that it reads.
pub const VERSION: u32 = 1;

/// Longest payload that is read, in bytes.
pub const MAX_PAYLOAD: usize = 1 << 20;

include!(concat!(env!("OUT_DIR"), "/skein.rs"));
