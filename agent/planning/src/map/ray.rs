//! Which voxels a straight line passes through.

use std::ops::ControlFlow;

use nalgebra::Vector3;

/// Visits the voxels that the segment from `start` to `end` passes through, in order, both end voxels
/// included, until `visit` breaks. Coordinates are in voxels: voxel `i` covers `[i, i + 1)`.
///
/// Steps are counted in integers (Amanatides and Woo 1987), so that the walk ends in the end's voxel whatever
/// the rounding on the way. A segment through an edge passes through one of the two voxels beside it.
pub(crate) fn traverse(
    start: Vector3<f64>,
    end: Vector3<f64>,
    mut visit: impl FnMut([i32; 3]) -> ControlFlow<()>,
) {
    let delta = end - start;
    let mut voxel = [0_i32; 3];
    let mut step = [0_i32; 3];
    let mut next = [f64::INFINITY; 3];
    let mut spacing = [f64::INFINITY; 3];
    let mut left = [0_u32; 3];
    for axis in 0..3 {
        let first = start[axis].floor();
        let last = end[axis].floor();
        voxel[axis] = first as i32;
        left[axis] = (last as i32).abs_diff(first as i32);
        if left[axis] == 0 {
            continue;
        }
        spacing[axis] = 1.0 / delta[axis].abs();
        let to_border = if delta[axis] > 0.0 { first + 1.0 - start[axis] } else { start[axis] - first };
        step[axis] = if delta[axis] > 0.0 { 1 } else { -1 };
        next[axis] = to_border * spacing[axis];
    }
    loop {
        if visit(voxel).is_break() {
            return;
        }
        let axis = if next[0] <= next[1] {
            if next[0] <= next[2] { 0 } else { 2 }
        } else if next[1] <= next[2] {
            1
        } else {
            2
        };
        if left[axis] == 0 {
            return;
        }
        voxel[axis] += step[axis];
        left[axis] -= 1;
        next[axis] = if left[axis] == 0 { f64::INFINITY } else { next[axis] + spacing[axis] };
    }
}

/// Visits the voxels along a rather level segment, in order: the fast walk for the hundreds of rays of a
/// scan. Both ends must lie in the window, whose voxels are numbered by `strides`. Steeper segments are
/// walked by [`traverse`].
///
/// Seen from above, these are the voxels that [`traverse`] visits. The layer is that in which the segment
/// crosses the middle of each column (or row) of voxels, so it is off by one where the segment changes layers
/// within it. Positions are integers, in 2^-32 of a voxel: each step is one addition and one shift instead of
/// a search for the nearest border, whose outcome a processor cannot guess.
#[inline]
pub(crate) fn sweep(
    start: Vector3<f64>,
    end: Vector3<f64>,
    strides: [usize; 3],
    mut visit: impl FnMut(usize),
) {
    const BITS: u32 = 32;
    let fixed = |voxels: f64| (voxels * (1_u64 << BITS) as f64) as i64;
    let cell = |fixed: i64| (fixed >> BITS) as usize;
    let delta = end - start;
    let (major, minor) = if delta.x.abs() >= delta.y.abs() { (0, 1) } else { (1, 0) };
    let run = delta[major].abs();
    if delta.z.abs() >= run {
        return traverse(start, end, |voxel| {
            visit((0..3).map(|axis| voxel[axis] as usize * strides[axis]).sum());
            ControlFlow::Continue(())
        });
    }
    let (first, last) = (cell(fixed(start[major])), cell(fixed(end[major])));
    let within = start[major] - first as f64;
    let forward = delta[major] > 0.0;
    let to_border = if forward { 1.0 - within } else { within };
    let (across, up) = (delta[minor] / run, delta.z / run);
    let mut column = first * strides[major];
    let mut row = cell(fixed(start[minor]));
    let mut leaves = fixed(start[minor] + across * to_border);
    let mut height = fixed(start.z + up * (to_border - 0.5).max(0.0));
    let (across, up) = (fixed(across), fixed(up));
    let mut left = first.abs_diff(last);
    loop {
        if left == 0 {
            leaves = fixed(end[minor]);
            height = fixed(end.z);
        }
        let base = column + cell(height) * strides[2];
        let next = cell(leaves);
        visit(base + row * strides[minor]);
        if next != row {
            visit(base + next * strides[minor]);
        }
        if left == 0 {
            return;
        }
        left -= 1;
        row = next;
        column = if forward { column + strides[major] } else { column - strides[major] };
        leaves += across;
        height += up;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn voxels(start: Vector3<f64>, end: Vector3<f64>) -> Vec<[i32; 3]> {
        let mut seen = Vec::new();
        traverse(start, end, |voxel| {
            seen.push(voxel);
            ControlFlow::Continue(())
        });
        seen
    }

    #[test]
    fn a_line_along_an_axis_visits_each_voxel_once() {
        let seen = voxels(Vector3::new(0.5, 0.5, 0.5), Vector3::new(3.5, 0.5, 0.5));
        assert_eq!(seen, vec![[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]);
    }

    #[test]
    fn a_point_visits_its_own_voxel() {
        assert_eq!(voxels(Vector3::new(-0.5, 2.0, 7.9), Vector3::new(-0.5, 2.0, 7.9)), vec![[-1, 2, 7]]);
    }

    proptest! {
        #[test]
        fn the_walk_equals_naive_sampling(
            a in prop::array::uniform3(-12.0..12.0_f64),
            b in prop::array::uniform3(-12.0..12.0_f64),
        ) {
            let (a, b) = (Vector3::from(a), Vector3::from(b));
            let walked: Vec<_> = voxels(a, b);
            for pair in walked.windows(2) {
                let apart: u32 = (0..3).map(|k| pair[0][k].abs_diff(pair[1][k])).sum();
                prop_assert_eq!(apart, 1, "steps cross one face at a time");
            }
            let walked: BTreeSet<_> = walked.into_iter().collect();
            let samples = 20_000;
            let mut sampled = BTreeSet::new();
            for k in 0..=samples {
                let p = a + (b - a) * (f64::from(k) / f64::from(samples));
                sampled.insert([p.x.floor() as i32, p.y.floor() as i32, p.z.floor() as i32]);
            }
            prop_assert!(sampled.is_subset(&walked), "missed {:?}", sampled.difference(&walked).collect::<Vec<_>>());
            // A voxel that sampling skipped is only clipped at a corner: its box grown a little meets the
            // line.
            for voxel in walked.difference(&sampled) {
                let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
                for k in 0..3 {
                    let (low, high) = (f64::from(voxel[k]) - 1e-6, f64::from(voxel[k]) + 1.0 + 1e-6);
                    let (t0, t1) = ((low - a[k]) / (b[k] - a[k]), (high - a[k]) / (b[k] - a[k]));
                    enter = enter.max(t0.min(t1));
                    leave = leave.min(t0.max(t1));
                }
                prop_assert!(enter <= leave, "{voxel:?} is not on the line");
            }
        }

        #[test]
        fn the_fast_walk_goes_through_the_same_columns(
            a in prop::array::uniform3(0.0..24.0_f64),
            b in prop::array::uniform3(0.0..24.0_f64),
        ) {
            let (a, b) = (Vector3::from(a), Vector3::from(b));
            let mut swept = Vec::new();
            sweep(a, b, [1, 24, 24 * 24], |offset| swept.push([offset % 24, offset / 24 % 24, offset / 576].map(|c| c as i32)));
            let columns = |walk: &[[i32; 3]]| walk.iter().map(|v| [v[0], v[1]]).collect::<BTreeSet<_>>();
            let walked = voxels(a, b);
            prop_assert_eq!(columns(&swept), columns(&walked));
            for voxel in &swept {
                let near = walked.iter().any(|v| v[0] == voxel[0] && v[1] == voxel[1] && v[2].abs_diff(voxel[2]) <= 1);
                prop_assert!(near, "{voxel:?} is off the line by more than a layer");
            }
        }
    }
}
