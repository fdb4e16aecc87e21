//! `EKF_STATUS_REPORT`, which ArduPilot sends in place of `ESTIMATOR_STATUS` and the common dialect lacks: read as
//! an `ESTIMATOR_STATUS` that tells no accuracy.

use mavlink::dialects::common::{ESTIMATOR_STATUS_DATA, EstimatorStatusFlags};

/// Its message id.
pub(crate) const ID: u32 = 193;
/// Seed of its checksum.
pub(crate) const EXTRA_CRC: u8 = 71;
/// Bytes of five ratios and the flags.
const LEN: usize = 22;

/// Reads the payload; a MAVLink 2 frame leaves out the zeros at its end.
pub(crate) fn parse(payload: &[u8]) -> ESTIMATOR_STATUS_DATA {
    let mut bytes = [0; LEN];
    for (byte, sent) in bytes.iter_mut().zip(payload) {
        *byte = *sent;
    }
    let ratio = |index: usize| {
        let at = |byte: usize| bytes.get(4 * index + byte).copied().unwrap_or_default();
        f32::from_le_bytes([at(0), at(1), at(2), at(3)])
    };
    let [.., low, high] = bytes;
    ESTIMATOR_STATUS_DATA {
        vel_ratio: ratio(0),
        pos_horiz_ratio: ratio(1),
        pos_vert_ratio: ratio(2),
        mag_ratio: ratio(3),
        hagl_ratio: ratio(4),
        pos_horiz_accuracy: f32::NAN,
        pos_vert_accuracy: f32::NAN,
        // The flags that both know have the same bits.
        flags: EstimatorStatusFlags::from_bits_truncate(u16::from_le_bytes([low, high])),
        ..Default::default()
    }
}
