//! The threads that Zenoh works on.

/// What Zenoh takes in by its own thread it accepts, routes and sends by others, each of which must be woken; together they
/// are two threads, and a message wakes one of them.
const TOGETHER: &str = "ZENOH_RUNTIME='(acc: (handover: rx), net: (handover: rx), tx: (handover: rx))'";

/// Lets all of Zenoh's work in this process be done by the same two threads, unless the environment says otherwise
/// (`ZENOH_RUNTIME`): messages come and go faster.
///
/// For the first line of `main`: Zenoh looks at the environment when the first session opens, and no other thread may run
/// while it is changed.
pub fn work_together() {
    // It is one line, which can be read.
    let _ = dotenvy::from_read(TOGETHER.as_bytes());
}
