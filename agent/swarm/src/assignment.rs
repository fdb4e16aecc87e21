//! Optimal assignment of vehicles to targets.

/// Assigns to each row a column of its own so that the sum of their costs is least (Kuhn 1955, Munkres 1957; with
/// potentials, as Jonker and Volgenant 1987). The result has the column of each row. `None` if there are more rows than
/// columns, rows of different lengths, or a cost that is not finite. `O(rows^2 columns)`.
///
/// ```
/// use skein_swarm::assignment::assign;
///
/// let costs = [vec![4.0, 1.0, 3.0], vec![2.0, 0.0, 5.0], vec![3.0, 2.0, 2.0]];
/// assert_eq!(assign(&costs), Some(vec![1, 0, 2]));
/// ```
pub fn assign(costs: &[Vec<f64>]) -> Option<Vec<usize>> {
    let (rows, columns) = (costs.len(), costs.first().map_or(0, Vec::len));
    let is_sound = |row: &Vec<f64>| row.len() == columns && row.iter().all(|cost| cost.is_finite());
    if rows > columns || !costs.iter().all(is_sound) {
        return None;
    }
    let mut matching = Matching {
        row_prices: vec![0.0; rows],
        column_prices: vec![0.0; columns],
        taken_by: vec![None; columns],
    };
    for row in 0..rows {
        matching.add(row, costs);
    }
    let mut columns_of = vec![0; rows];
    for (column, row) in matching.taken_by.iter().enumerate() {
        if let Some(row) = row {
            columns_of[*row] = column;
        }
    }
    Some(columns_of)
}

/// The best assignment of the rows so far. No cost is less than its row's price and its column's together, and those of
/// the pairs are equal to them.
struct Matching {
    row_prices: Vec<f64>,
    column_prices: Vec<f64>,
    taken_by: Vec<Option<usize>>,
}

impl Matching {
    /// Adds a row along the shortest chain of rows that make room for one another.
    fn add(&mut self, row: usize, costs: &[Vec<f64>]) {
        let columns = self.taken_by.len();
        let mut slack = vec![f64::INFINITY; columns];
        let mut reached_from: Vec<Option<usize>> = vec![None; columns];
        let mut is_settled = vec![false; columns];
        let (mut at, mut through) = (row, None);
        let free = loop {
            let mut nearest = None;
            for column in (0..columns).filter(|column| !is_settled[*column]) {
                let reduced = costs[at][column] - self.row_prices[at] - self.column_prices[column];
                if reduced < slack[column] {
                    slack[column] = reduced;
                    reached_from[column] = through;
                }
                if nearest.is_none_or(|nearest: usize| slack[column] < slack[nearest]) {
                    nearest = Some(column);
                }
            }
            // There are at least as many columns as rows, so one is left.
            let Some(nearest) = nearest else { return };
            let rise = slack[nearest];
            self.row_prices[row] += rise;
            for column in 0..columns {
                if is_settled[column] {
                    self.column_prices[column] -= rise;
                    if let Some(holder) = self.taken_by[column] {
                        self.row_prices[holder] += rise;
                    }
                } else {
                    slack[column] -= rise;
                }
            }
            is_settled[nearest] = true;
            through = Some(nearest);
            match self.taken_by[nearest] {
                Some(holder) => at = holder,
                None => break nearest,
            }
        };
        let mut column = free;
        while let Some(before) = reached_from[column] {
            self.taken_by[column] = self.taken_by[before];
            column = before;
        }
        self.taken_by[column] = Some(row);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn total(costs: &[Vec<f64>], columns: &[usize]) -> f64 {
        costs.iter().zip(columns).map(|(row, column)| row[*column]).sum()
    }

    /// The least total of all assignments, by trying them.
    fn least(costs: &[Vec<f64>], taken: &mut Vec<usize>) -> f64 {
        let Some(row) = costs.get(taken.len()) else { return total(costs, taken) };
        let mut best = f64::INFINITY;
        for column in 0..row.len() {
            if !taken.contains(&column) {
                taken.push(column);
                best = best.min(least(costs, taken));
                taken.pop();
            }
        }
        best
    }

    proptest! {
        #[test]
        fn no_other_assignment_is_cheaper(
            costs in (1..5_usize, 0..3_usize).prop_flat_map(|(rows, more)| {
                prop::collection::vec(prop::collection::vec(-9.0..9.0_f64, rows + more), rows)
            })
        ) {
            let columns = assign(&costs).unwrap();
            prop_assert!((0..columns.len()).all(|k| !columns[..k].contains(&columns[k])));
            prop_assert!((total(&costs, &columns) - least(&costs, &mut vec![])).abs() < 1e-9);
        }
    }

    #[test]
    fn what_cannot_be_assigned_is_refused() {
        assert_eq!(assign(&[]), Some(vec![]));
        assert_eq!(assign(&[vec![1.0], vec![2.0]]), None, "two rows, one column");
        assert_eq!(assign(&[vec![1.0, 2.0], vec![2.0]]), None, "rows of different lengths");
        assert_eq!(assign(&[vec![f64::NAN]]), None);
    }
}
