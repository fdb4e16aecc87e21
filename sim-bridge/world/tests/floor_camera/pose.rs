//! The pose that markers in rendered images tell, against the camera's own.

use std::time::Duration;

use skein_positioning::markers::Solver;

use super::{body, camera, floor, found, mounting, noisy, picture};

#[test]
fn with_eight_markers_the_pose_is_within_5_mm_at_a_metre_and_a_half() {
    let solver = Solver::new(camera(), mounting());
    for n in 0..12_u32 {
        let turn = f64::from(n);
        let at = body([1.3 + 0.05 * turn, 1.9 - 0.04 * turn, 1.5], 0.1 * turn.sin(), 0.1 * turn.cos(), turn);
        let sighting = solver.solve(&floor(), &found(&picture(&at, &noisy(), n.into()))).unwrap();
        assert!(sighting.used.len() >= 8 && !sighting.is_ambiguous, "{sighting:?}");
        let off = sighting.best.body_to_world.translation.vector - at.translation.vector;
        assert!(off.norm() < 0.005, "image {n}: {off}");
    }
}

#[test]
fn errors_of_rendered_images_are_within_three_sigma() {
    let solver = Solver::new(camera(), mounting());
    let (mut inside, mut total) = (0, 0);
    for n in 0..40_u32 {
        let turn = f64::from(n);
        let height = 0.6 + 0.04 * turn;
        let at = body([1.3 + 0.013 * turn, 1.7, height], 0.1 * turn.sin(), 0.1 * (1.3 * turn).cos(), turn);
        let seen = found(&picture(&at, &noisy(), n.into()));
        // All markers, and one of them alone.
        for seen in [seen.as_slice(), &seen[..1]] {
            let Some(sighting) = solver.solve(&floor(), seen) else { continue };
            let fix = sighting.fix(Duration::ZERO, Some(&at.rotation));
            let shift = fix.position - at.translation.vector;
            let turned = (at.rotation.inverse() * fix.body_to_world).scaled_axis();
            let off = [shift.x, shift.y, shift.z, turned.x, turned.y, turned.z];
            let is_inside = |axis: &usize| off[*axis].abs() <= 3.0 * fix.covariance[(*axis, *axis)].sqrt();
            inside += (0..6).filter(is_inside).count();
            total += 6;
        }
    }
    assert!(total >= 460, "{total}");
    assert!(inside * 100 >= total * 99, "{inside} of {total}");
}
