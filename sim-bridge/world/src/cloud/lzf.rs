//! LZF, in which packed point clouds are written: runs of plain bytes, and copies of what came before.

/// The `length` bytes that `packed` stands for; `None` where it does not.
pub(super) fn unpack(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut plain: Vec<u8> = Vec::new();
    let mut rest = packed.iter().copied();
    while let Some(control) = rest.next() {
        let control = usize::from(control);
        if control < 32 {
            for _ in 0..=control {
                plain.push(rest.next()?);
            }
        } else {
            let more = if control >> 5 == 7 { usize::from(rest.next()?) } else { 0 };
            let back = ((control & 31) << 8) + usize::from(rest.next()?) + 1;
            let from = plain.len().checked_sub(back)?;
            for offset in 0..(control >> 5) + more + 2 {
                plain.push(*plain.get(from + offset)?);
            }
        }
        if plain.len() > length {
            return None;
        }
    }
    (plain.len() == length).then_some(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_may_reach_into_themselves() {
        // Two plain bytes, then 7 from 2 back; then 1 plain, then 3 + 9 from 1 back.
        let packed = [1, b'a', b'b', 5 << 5, 1, 0, b'c', 7 << 5, 3, 0];
        assert_eq!(unpack(&packed, 22).as_deref(), Some(b"ababababaccccccccccccc".as_slice()));
        assert_eq!(unpack(&packed, 21), None);
        assert_eq!(unpack(&[32, 9], 3), None);
        assert_eq!(unpack(&[4, 1], 5), None);
    }
}
