//! The network in memory does what it is told, and no more.

use std::time::Duration;

use skein_dbp::{BidRecord, Presence};
use skein_wire::{Fleet, Key, Link, MemoryLink, Network, NetworkConfig, NodeName, State};

const MS: Duration = Duration::from_millis(1);

fn setup(config: NetworkConfig, seed: u64) -> (Network, MemoryLink, MemoryLink, Key) {
    let (a, b) = (NodeName::new("uav/1").unwrap(), NodeName::new("uav/2").unwrap());
    let network = Network::new(config, seed);
    let links = (network.join(&a), network.join(&b));
    let key = Key::to_all::<State>(&Fleet::new("test").unwrap(), a);
    (network, links.0, links.1, key)
}

fn drain(link: &mut MemoryLink) -> Vec<u32> {
    std::iter::from_fn(|| link.poll())
        .map(|(_, payload)| u32::from_le_bytes(payload.try_into().unwrap()))
        .collect()
}

fn send_thousand(config: NetworkConfig, seed: u64) -> Vec<u32> {
    let (network, mut a, mut b, key) = setup(config, seed);
    for n in 0..1000_u32 {
        network.advance(MS * n);
        a.put(&key, n.to_le_bytes().to_vec());
    }
    network.advance(Duration::from_secs(60));
    assert!(drain(&mut a).is_empty(), "a link heard its own messages");
    drain(&mut b)
}

#[test]
fn a_good_network_brings_all_in_order() {
    assert_eq!(
        send_thousand(NetworkConfig { latency: (MS, 50 * MS), ..Default::default() }, 1),
        (0..1000).collect::<Vec<_>>()
    );
}

#[test]
fn faults_come_at_their_rates_and_from_the_seed() {
    let lossy = NetworkConfig { loss: 0.3, ..Default::default() };
    assert!((600..800).contains(&send_thousand(lossy, 1).len()));
    let repeating = NetworkConfig { duplicate: 0.2, ..Default::default() };
    assert!((1100..1300).contains(&send_thousand(repeating, 1).len()));
    let shuffled = NetworkConfig { latency: (MS, 50 * MS), reorder: 0.5, ..Default::default() };
    let arrived = send_thousand(shuffled, 1);
    assert!(!arrived.is_sorted());
    assert_eq!(arrived, send_thousand(shuffled, 1));
    assert_ne!(arrived, send_thousand(shuffled, 2));
}

#[test]
fn nodes_with_a_place_hear_one_another_within_range_only() {
    let config = NetworkConfig { range_m: Some(15.0), ..Default::default() };
    let (network, mut a, mut b, key) = setup(config, 1);
    let mut is_heard = |place: Option<[f64; 3]>, at_ms| {
        for (node, place) in [("uav/1", Some([0.0; 3])), ("uav/2", place)] {
            place.into_iter().for_each(|place| network.place(&NodeName::new(node).unwrap(), place));
        }
        a.put(&key, 1_u32.to_le_bytes().to_vec());
        network.advance(MS * at_ms);
        !drain(&mut b).is_empty()
    };
    assert!(is_heard(None, 10), "one without a place");
    assert!(!is_heard(Some([9.0, 12.0, 1.0]), 20));
    assert!(is_heard(Some([9.0, 12.0, 0.0]), 30));
}

#[test]
fn messages_reach_whom_they_are_for() {
    let fleet = Fleet::new("test").unwrap();
    let names = ["uav/1", "uav/2", "ground/main"].map(|name| NodeName::new(name).unwrap());
    let network = Network::new(NetworkConfig::default(), 1);
    let mut links = names.each_ref().map(|name| network.join(name));
    let bid = Key::to_one::<BidRecord>(&fleet, names[0].clone(), names[2].clone());
    links[0].put(&bid, vec![]);
    links[0].put(&Key::to_all::<Presence>(&fleet, names[0].clone()), vec![]);
    network.advance(MS);
    assert_eq!(links.each_mut().map(|link| std::iter::from_fn(|| link.poll()).count()), [0, 1, 2]);
}

#[test]
fn a_partition_parts_and_a_crash_loses_what_was_on_its_way() {
    let (network, mut a, mut b, key) = setup(NetworkConfig::default(), 1);
    network.partition(&[&[NodeName::new("uav/1").unwrap()]]);
    a.put(&key, vec![0; 4]);
    network.heal();
    a.put(&key, 7_u32.to_le_bytes().to_vec());
    network.advance(MS);
    assert_eq!(drain(&mut b), [7]);
    assert_eq!(network.stats().lost, 1);

    a.put(&key, vec![0; 4]);
    network.leave(&NodeName::new("uav/2").unwrap());
    let mut again = network.join(&NodeName::new("uav/2").unwrap());
    network.advance(MS * 2);
    assert!(drain(&mut again).is_empty() && drain(&mut b).is_empty());
    b.put(&key, vec![]);
    network.advance(MS * 3);
    assert!(drain(&mut a).is_empty(), "a node that has left still speaks");
}
