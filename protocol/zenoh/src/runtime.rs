//! The threads that Zenoh works on.

/// As it comes, Zenoh accepts, reads, routes and sends on threads of their own, so that a message wakes one thread
/// which finds it and another which reads it. Here two threads do all of that, and a message wakes one.
const SHARED: &str = "ZENOH_RUNTIME='(acc: (handover: rx), net: (handover: rx), tx: (handover: rx))'";

/// Lets all of Zenoh's work in this process be done by the same two threads, unless the environment says otherwise
/// (`ZENOH_RUNTIME`): messages come and go faster.
///
/// For the first line of `main`: Zenoh looks at the environment when the first session opens, and no other thread may
/// run while it is changed.
pub fn share_threads() {
    // It is one line, which can be read.
    let _ = dotenvy::from_read(SHARED.as_bytes());
}
