//! Sets of event numbers as bits, 64 to a word.

/// The places of the ones in a word, lowest first.
#[inline]
pub(super) fn ones(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = word.trailing_zeros() as usize;
        (word != 0).then(|| {
            word &= word - 1;
            lowest
        })
    })
}

/// Whether an event is in a set of bits.
#[inline]
pub(super) fn has(bits: &[u64], event: u32) -> bool {
    bits.get(event as usize / 64).is_some_and(|word| word >> (event % 64) & 1 != 0)
}

/// Makes `bits` the union of sets.
#[inline]
pub(super) fn union<'a>(bits: &mut Vec<u64>, width: usize, sets: impl Iterator<Item = &'a [u64]>) {
    bits.clear();
    bits.resize(width, 0);
    for set in sets {
        bits.iter_mut().zip(set).for_each(|(bits, set)| *bits |= set);
    }
}
