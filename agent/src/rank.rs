//! The order of two vehicles where there is room for one.

use skein_wire::event::Right;

/// Whether the vehicle `one` goes before `other`: who has more right, or of two with the same the lower number.
pub fn goes_before((one, its_right): (&str, Right), (other, others_right): (&str, Right)) -> bool {
    let number = |node: &str| node.rsplit('/').next().and_then(|number| number.parse::<u32>().ok());
    let order = |node, right| (std::cmp::Reverse(right), number(node), node);
    order(one, its_right) < order(other, others_right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_right_counts_first_and_then_the_number() {
        let [free, inside, cornered] = [Right::Free, Right::Inside, Right::Cornered];
        assert!(goes_before(("uav/2", free), ("uav/10", free)));
        assert!(!goes_before(("uav/10", free), ("uav/2", free)));
        assert!(goes_before(("uav/10", inside), ("uav/2", free)));
        assert!(goes_before(("uav/10", cornered), ("uav/2", inside)));
        assert!(!goes_before(("uav/2", free), ("uav/2", free)));
    }
}
