//! Targets dealt out to vehicles, as many as there are of each.

use nalgebra::Vector3;

use crate::assignment::assign;

/// The targets that each vehicle visits, by number and in order: every target is visited by one. Vehicles without one
/// are left over where there are fewer targets than vehicles.
///
/// It deals in rounds: each vehicle gets one more, from where it then is, so that `cost` of all in the round is least
/// together ([`assign`]). `None` without vehicles, or if a cost is not finite.
pub fn deal(
    vehicles: &[Vector3<f64>],
    targets: &[Vector3<f64>],
    mut cost: impl FnMut(usize, &Vector3<f64>, &Vector3<f64>) -> f64,
) -> Option<Vec<Vec<usize>>> {
    let mut dealt = vec![Vec::new(); vehicles.len()];
    let mut at = vehicles.to_vec();
    let mut left: Vec<usize> = (0..targets.len()).collect();
    while !left.is_empty() {
        let costs: Vec<Vec<f64>> = (0..at.len())
            .map(|who| left.iter().map(|target| cost(who, &at[who], &targets[*target])).collect())
            .collect();
        let pairs = pairs(&costs)?;
        for (who, nth) in &pairs {
            dealt[*who].push(left[*nth]);
            at[*who] = targets[left[*nth]];
        }
        let taken: Vec<usize> = pairs.iter().map(|(_, nth)| left[*nth]).collect();
        left.retain(|target| !taken.contains(target));
    }
    Some(dealt)
}

/// Rows and columns paired so that as many as can be are, at the least cost together.
fn pairs(costs: &[Vec<f64>]) -> Option<Vec<(usize, usize)>> {
    let (rows, columns) = (costs.len(), costs.first()?.len());
    if rows <= columns {
        return Some(assign(costs)?.into_iter().enumerate().collect());
    }
    let turned: Vec<Vec<f64>> =
        (0..columns).map(|column| costs.iter().map(|row| row[column]).collect()).collect();
    Some(assign(&turned)?.into_iter().enumerate().map(|(column, row)| (row, column)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line<const N: usize>(east_m: [f64; N]) -> Vec<Vector3<f64>> {
        east_m.map(|x| Vector3::new(x, 0.0, 0.0)).to_vec()
    }

    fn dealt(vehicles: &[Vector3<f64>], targets: &[Vector3<f64>]) -> Option<Vec<Vec<usize>>> {
        deal(vehicles, targets, |_, from, to| (to - from).norm())
    }

    #[test]
    fn each_target_is_visited_by_one_however_many_there_are() {
        assert_eq!(dealt(&line([0.0, 10.0]), &line([11.0, 1.0])), Some(vec![vec![1], vec![0]]));
        assert_eq!(
            dealt(&line([0.0, 10.0]), &line([1.0, 9.0, 2.0, 8.0, 8.5])),
            Some(vec![vec![0, 2], vec![1, 4, 3]]),
            "the nearest first, then those beside it"
        );
        assert_eq!(dealt(&line([0.0, 10.0, 20.0]), &line([19.0])), Some(vec![vec![], vec![], vec![0]]));
        assert_eq!(dealt(&[], &line([1.0])), None);
        assert_eq!(deal(&line([0.0]), &line([1.0]), |_, _, _| f64::NAN), None);
    }
}
