//! The protobuf forms, generated from `proto/skein.proto`.
//!
//! The protocol itself is in plain records, see [`Payload`](crate::Payload); these types serve those who read or write
//! the bytes, such as a recorder, which keeps [`TraceEvent`]s.

#![allow(clippy::all, clippy::pedantic)]

include!(concat!(env!("OUT_DIR"), "/skein.rs"));
