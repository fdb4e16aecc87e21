//! The give of a vehicle's legs. The world stops a body on the ground within one step; an accelerometer would feel a
//! blow that no real one does, and that estimators take for a fault.

use nalgebra::Vector3;

/// Most that the accelerometer feels in one step, m/s².
const MOST_M_S2: f64 = 60.0;

/// The rest of a blow, still to be felt.
#[derive(Debug, Clone, Default)]
pub(super) struct Legs(Vector3<f64>);

impl Legs {
    /// The specific force to feel in this step, where the body's is `force` (body, m/s²): the same over some steps,
    /// and never more than legs let through in one.
    pub(super) fn soften(&mut self, force: &Vector3<f64>) -> Vector3<f64> {
        let due = force + self.0;
        let felt = due.map(|part| part.clamp(-MOST_M_S2, MOST_M_S2));
        self.0 = due - felt;
        felt
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blow_is_felt_whole_but_over_several_steps() {
        let (mut legs, mut felt) = (Legs::default(), Vector3::zeros());
        for step in 0..10 {
            let force = Vector3::new(0.0, 0.0, if step == 3 { 200.0 } else { 10.0 });
            let now = legs.soften(&force);
            assert!(now.z <= MOST_M_S2);
            felt += now;
        }
        assert_eq!(felt, Vector3::new(0.0, 0.0, 290.0));
    }
}
