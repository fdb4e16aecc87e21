//! One hash over everything that happened: equal hashes mean equal runs.

use skein_world::RigidState;

/// Hashes every selected event and every pose, in the order of the run.
#[derive(Debug, Default)]
pub struct TraceHash(blake3::Hasher);

impl TraceHash {
    /// Takes in one selected event of `node`.
    pub fn event(&mut self, node: &str, seq: u64, event: &skein_bp::Event) {
        self.0.update(node.as_bytes());
        self.0.update(&seq.to_le_bytes());
        self.0.update(event.to_string().as_bytes());
        self.0.update(b"\n");
    }

    /// Takes in one vehicle's true motion, bit for bit.
    pub fn pose(&mut self, motion: &RigidState) {
        let attitude = motion.attitude.coords;
        for number in motion.position.iter().chain(motion.velocity.iter()).chain(attitude.iter()) {
            self.0.update(&number.to_bits().to_le_bytes());
        }
    }

    /// The hash so far, in hexadecimal.
    #[must_use]
    pub fn hex(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}
