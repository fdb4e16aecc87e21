//! Values by index, in pages that are made when they are first written to.

/// Bits of an index within its page.
const BITS: u32 = 10;
const SIZE: usize = 1 << BITS;

/// A value for each index below a bound that takes memory only near those that were written to: a search of a map of
/// many millions of cells looks at few of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pages<T> {
    pages: Vec<Box<[T]>>,
}

impl<T: Copy + Default> Pages<T> {
    /// Makes room for indices below `count`.
    pub fn reserve(&mut self, count: usize) {
        let pages = count.div_ceil(SIZE);
        if self.pages.len() < pages {
            self.pages.resize_with(pages, Box::default);
        }
    }

    /// Forgets all values, and frees their memory.
    pub fn clear(&mut self) {
        self.pages.fill_with(Box::default);
    }

    /// The value of an index: the default one if nothing was written near.
    #[inline]
    pub fn get(&self, index: usize) -> T {
        self.pages.get(index >> BITS).and_then(|page| page.get(index % SIZE)).copied().unwrap_or_default()
    }

    /// The value of an index below the bound, to be written to.
    #[inline]
    pub fn slot(&mut self, index: usize) -> &mut T {
        let page = &mut self.pages[index >> BITS];
        if page.is_empty() {
            *page = vec![T::default(); SIZE].into_boxed_slice();
        }
        &mut page[index % SIZE]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_made_where_they_are_written_to() {
        let mut pages = Pages::<u32>::default();
        pages.reserve(1_000_000_000);
        *pages.slot(999_999_999) = 7;
        *pages.slot(3) += 1;
        assert_eq!([0, 3, 500_000_000, 999_999_999].map(|index| pages.get(index)), [0, 1, 0, 7]);
        assert_eq!(pages.pages.iter().filter(|page| !page.is_empty()).count(), 2);
        pages.clear();
        assert_eq!(pages.get(3), 0);
    }
}
