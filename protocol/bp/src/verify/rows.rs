//! Rows of numbers or pairs of them, one after the other.

/// Rows in one list. While all are equally long, their ends need not be looked up.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows<T = u32> {
    /// The rows that are closed, and behind them the words of the next one.
    pub(super) words: Vec<T>,
    count: usize,
    /// The length of every row, unless they differ.
    length: usize,
    /// The end of each row; empty while all are equally long.
    ends: Vec<usize>,
}

impl<T> Rows<T> {
    pub(super) fn len(&self) -> usize {
        self.count
    }

    pub(super) fn get(&self, at: usize) -> &[T] {
        let (start, end) = if self.ends.is_empty() && at < self.count {
            (at * self.length, (at + 1) * self.length)
        } else {
            let end = |at: usize| self.ends.get(at).copied().unwrap_or(0);
            (at.checked_sub(1).map_or(0, end), end(at))
        };
        self.words.get(start..end).unwrap_or_default()
    }

    /// Makes a row of the words that were added since the last one.
    pub(super) fn close(&mut self) {
        let end = self.words.len();
        if self.ends.is_empty() {
            let length = end - self.count * self.length;
            if self.count == 0 {
                self.length = length;
            } else if length != self.length {
                self.ends.extend((1..=self.count).map(|at| at * self.length));
                self.ends.push(end);
            }
        } else {
            self.ends.push(end);
        }
        self.count += 1;
    }

    pub(super) fn clear(&mut self) {
        self.words.clear();
        self.ends.clear();
        (self.count, self.length) = (0, 0);
    }
}

/// Multiplies pairs of words and folds the two halves of each product into one another.
pub(super) fn hash(row: &[u32]) -> u32 {
    let mut hash = row.len() as u64;
    let mut pairs = row.chunks_exact(2);
    for pair in &mut pairs {
        let &[low, high] = pair else { continue };
        hash = fold(hash ^ (u64::from(high) << 32 | u64::from(low)));
    }
    if let [last] = pairs.remainder() {
        hash = fold(hash ^ u64::from(*last));
    }
    (fold(hash) >> 32) as u32
}

fn fold(bits: u64) -> u64 {
    let product = u128::from(bits ^ 0x9e37_79b9_7f4a_7c15) * 0xd6e8_feb8_6659_fd93;
    (product as u64) ^ (product >> 64) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_equal_and_of_different_lengths_are_kept_apart() {
        let given: [&[u32]; 5] = [&[1, 2], &[3, 4], &[], &[5], &[6, 7]];
        for take in 0..=given.len() {
            let mut rows = Rows::<u32>::default();
            for row in given.iter().take(take) {
                rows.words.extend_from_slice(row);
                rows.close();
            }
            assert_eq!(rows.len(), take);
            for (at, row) in given.iter().enumerate() {
                assert_eq!(rows.get(at), if at < take { *row } else { &[] }, "row {at} of {take}");
            }
        }
    }
}
