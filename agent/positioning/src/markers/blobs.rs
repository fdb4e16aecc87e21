//! Dark pixels that hang together, and the outlines of those groups.

use super::threshold::Mask;

/// The eight neighbours of a pixel, clockwise from the right.
const AROUND: [(i32, i32); 8] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// Dark pixels that touch, if only at corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Blob {
    /// The leftmost pixel of its topmost row.
    pub(super) start: (i32, i32),
    /// Its extent, the bounds included.
    pub(super) left: i32,
    pub(super) right: i32,
    pub(super) bottom: i32,
}

impl Blob {
    /// Its width and height, pixels.
    pub(super) fn extent(&self) -> (i32, i32) {
        (self.right - self.left + 1, self.bottom - self.start.1 + 1)
    }

    fn join(&mut self, other: &Self) {
        self.left = self.left.min(other.left);
        self.right = self.right.max(other.right);
        self.bottom = self.bottom.max(other.bottom);
    }

    /// The pixels of its outer border, clockwise from the start; `None` if there are more than `most`.
    pub(super) fn outline(&self, mask: &Mask, most: usize) -> Option<Vec<(i32, i32)>> {
        let mut outline = Vec::with_capacity(most.min(1024));
        // Up and to the left of the start nothing is dark.
        let Some(first) = step(mask, self.start, 5) else { return Some(vec![self.start]) };
        let (mut at, mut direction) = (self.start, first);
        loop {
            outline.push(at);
            let (dx, dy) = AROUND[direction];
            at = (at.0 + dx, at.1 + dy);
            direction = step(mask, at, direction + if direction % 2 == 0 { 6 } else { 5 })?;
            if at == self.start && direction == first {
                return Some(outline);
            }
            if outline.len() >= most {
                return None;
            }
        }
    }
}

/// The direction of the first dark neighbour clockwise from one.
fn step(mask: &Mask, at: (i32, i32), from: usize) -> Option<usize> {
    (from..from + 8).map(|direction| direction % 8).find(|direction| {
        let (dx, dy) = AROUND[*direction];
        mask.is_dark(at.0 + dx, at.1 + dy)
    })
}

/// Dark pixels of one row, from the first to before the end.
struct Run {
    first: i32,
    end: i32,
    group: usize,
}

/// Groups of runs; each knows one with a lower number that it belongs to, or itself.
#[derive(Default)]
struct Groups {
    parents: Vec<usize>,
    blobs: Vec<Blob>,
}

impl Groups {
    fn root(&mut self, mut group: usize) -> usize {
        while self.parents[group] != group {
            self.parents[group] = self.parents[self.parents[group]];
            group = self.parents[group];
        }
        group
    }

    fn add(&mut self, blob: Blob) -> usize {
        self.parents.push(self.blobs.len());
        self.blobs.push(blob);
        self.blobs.len() - 1
    }

    /// The lower number stays, whose start is the first from the top and the left.
    fn join(&mut self, one: usize, other: usize) -> usize {
        let (one, other) = (self.root(one), self.root(other));
        let (low, high) = (one.min(other), one.max(other));
        if low != high {
            self.parents[high] = low;
            let joined = self.blobs[high];
            self.blobs[low].join(&joined);
        }
        low
    }
}

/// All groups of dark pixels, from the top.
pub(super) fn blobs(mask: &Mask) -> Vec<Blob> {
    let mut groups = Groups::default();
    let (mut above, mut row): (Vec<Run>, Vec<Run>) = (Vec::new(), Vec::new());
    for (y, dark) in (0..).zip(mask.dark.chunks_exact(mask.width)) {
        row.clear();
        let mut touching = 0;
        runs(dark, |first, end| {
            let mut group = groups.add(Blob { start: (first, y), left: first, right: end - 1, bottom: y });
            while above.get(touching).is_some_and(|run: &Run| run.end < first) {
                touching += 1;
            }
            for run in above[touching..].iter().take_while(|run| run.first <= end) {
                group = groups.join(group, run.group);
            }
            row.push(Run { first, end, group });
        });
        std::mem::swap(&mut above, &mut row);
    }
    let Groups { parents, blobs } = groups;
    blobs
        .into_iter()
        .enumerate()
        .filter(|(group, _)| parents[*group] == *group)
        .map(|(_, blob)| blob)
        .collect()
}

/// Calls with the first pixel and the end of every run of dark ones in a row.
fn runs(dark: &[u8], mut found: impl FnMut(i32, i32)) {
    let mut x = 0;
    while let Some(ahead) = dark[x..].iter().position(|pixel| *pixel == 1) {
        let first = x + ahead;
        x = dark[first..].iter().position(|pixel| *pixel == 0).map_or(dark.len(), |length| first + length);
        found(first as i32, x as i32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Mask {
        let dark = rows.iter().flat_map(|row| row.bytes().map(|byte| u8::from(byte == b'#'))).collect();
        Mask { width: rows[0].len(), height: rows.len(), dark }
    }

    #[test]
    fn groups_that_meet_lower_down_are_one() {
        let mask = mask(&["#...#..", ".#.#..#", "..#...#", ".......", "###....", "#.#....", "###...."]);
        let found = blobs(&mask);
        let expected = [((0, 0), 0, 4, 2), ((6, 1), 6, 6, 2), ((0, 4), 0, 2, 6)];
        assert_eq!(found, expected.map(|(start, left, right, bottom)| Blob { start, left, right, bottom }));
        assert_eq!(found[0].extent(), (5, 3));
    }

    #[test]
    fn an_outline_goes_clockwise_round_the_outer_border() {
        let ring = mask(&[".....", ".###.", ".#.#.", ".###."]);
        let outline = blobs(&ring)[0].outline(&ring, 100).unwrap();
        assert_eq!(outline, [(1, 1), (2, 1), (3, 1), (3, 2), (3, 3), (2, 3), (1, 3), (1, 2)]);
        assert_eq!(blobs(&ring)[0].outline(&ring, 5), None);
    }

    #[test]
    fn an_outline_goes_out_and_back_along_a_spur() {
        let spur = mask(&["#....", ".#...", "..##."]);
        let outline = blobs(&spur)[0].outline(&spur, 100).unwrap();
        assert_eq!(outline, [(0, 0), (1, 1), (2, 2), (3, 2), (2, 2), (1, 1)]);
        let point = mask(&["...", ".#.", "..."]);
        assert_eq!(blobs(&point)[0].outline(&point, 100).unwrap(), [(1, 1)]);
    }
}
