//! The corpora, replayed: seeds, and what fuzzing has found.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // A test fails by panicking.

use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use skein_fuzz::{Allowed, Reached, TARGETS, Target};

fn corpus(target: &Target) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name)
}

/// The files of a folder, in order; none if there is no folder.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let entries = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> =
        entries.filter(|path| path.is_file()).map(|path| (path.clone(), fs::read(path).unwrap())).collect();
    files.sort();
    files
}

#[test]
fn every_corpus_is_read_within_its_bounds() {
    for target in TARGETS {
        for (path, input) in files(&corpus(target)) {
            let (reached, spent) = target.check(&input);
            println!("{}: {} bytes, {reached:?}, {spent} allocated", path.display(), input.len());
        }
    }
}

#[test]
fn every_seed_is_read_and_stands_in_the_corpus() {
    let mut wrong = Vec::new();
    for target in TARGETS {
        for (name, seed) in (target.seeds)() {
            let path = corpus(target).join(name);
            let (reached, _) = target.check(&seed);
            if std::env::var_os("SKEIN_WRITE_GENERATED").is_some() {
                fs::create_dir_all(corpus(target)).unwrap();
                fs::write(&path, seed).unwrap();
            }
            if reached != Reached::Read || !path.is_file() {
                wrong.push(format!("{}: {reached:?}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "refused, or missing (SKEIN_WRITE_GENERATED=1 writes them): {wrong:#?}");
}

/// Mutations of each file of the corpora, blind but many; `SKEIN_FUZZ_ROUNDS` asks for more of them.
#[test]
fn mutated_inputs_are_read_within_their_bounds() {
    let rounds = std::env::var("SKEIN_FUZZ_ROUNDS").map_or(20, |rounds| rounds.parse().unwrap());
    for target in TARGETS {
        let inputs: Vec<Vec<u8>> = files(&corpus(target)).into_iter().map(|(_, input)| input).collect();
        let mut random = ChaCha8Rng::seed_from_u64(rounds);
        for _ in 0..rounds {
            for input in &inputs {
                let other = &inputs[random.random_range(0..inputs.len())];
                let mutated = mutate(input.clone(), other, &mut random);
                if catch_unwind(|| target.check(&mutated)).is_err() {
                    let path = std::env::temp_dir().join(format!("skein-fuzz-{}", target.name));
                    fs::write(&path, &mutated).unwrap();
                    panic!("{}: what it was given stands in {}", target.name, path.display());
                }
            }
        }
    }
}

const WORDS: [&[u8]; 12] = [
    b"1e308",
    b"-1",
    b"0",
    b"nan",
    b"inf",
    b"18446744073709551615",
    b"[",
    b"{",
    b"\"",
    b"\n",
    b"\xff\xff\xff\xff",
    b"\0",
];

fn mutate(mut input: Vec<u8>, other: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    for _ in 0..random.random_range(1..6) {
        let from = random.random_range(0..=input.len());
        let to = (from + random.random_range(0..16)).min(input.len());
        let at = random.random_range(0..=other.len());
        let piece = &other[at..(at + random.random_range(0..64)).min(other.len())];
        let new = match random.random_range(0..5) {
            0 => vec![random.random()],
            1 => Vec::new(),
            2 => WORDS[random.random_range(0..WORDS.len())].to_vec(),
            3 => piece.to_vec(),
            _ => input[from..to].repeat(random.random_range(1..4)),
        };
        input.splice(from..to, new);
    }
    input
}

fn reached(is_read: bool) -> Reached {
    if is_read { Reached::Read } else { Reached::Refused }
}

#[test]
fn a_reader_that_panics_or_allocates_more_than_in_proportion_is_noticed() {
    let target = |read| Target {
        name: "planted",
        allowed: Allowed { bytes: 1000, per_byte: 10 },
        read,
        seeds: Vec::new,
    };
    let notices =
        |read: fn(&[u8]) -> Reached, input: &[u8]| catch_unwind(|| target(read).check(input)).is_err();
    let by_index = |input: &[u8]| reached(input[usize::from(input[0])] == 0);
    let by_length = |input: &[u8]| reached(Vec::<u8>::with_capacity(usize::from(input[0]) << 8).is_empty());
    let by_square = |input: &[u8]| reached(input.iter().map(|_| input.to_vec().len()).sum::<usize>() > 0);
    for (read, passes, fails) in [
        (by_index as fn(&[u8]) -> Reached, vec![1, 2], vec![2, 1]),
        (by_length, vec![1, 2], vec![200, 1]),
        (by_square, vec![0; 20], vec![0; 200]),
    ] {
        assert!(!notices(read, &passes));
        assert!(notices(read, &fails));
    }
}
