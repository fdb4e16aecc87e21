//! The program that cargo-fuzz runs: one target, named by `SKEIN_FUZZ`. See docs/security-fuzzing.md.

#![no_main]
#![allow(unsafe_code)] // The fuzzer calls a C function of a name that it knows.

use std::sync::LazyLock;

use skein_fuzz::{TARGETS, Target};

static TARGET: LazyLock<&Target> = LazyLock::new(|| {
    let given = std::env::var("SKEIN_FUZZ").unwrap_or_default();
    TARGETS.iter().find(|target| target.name == given).unwrap_or_else(|| {
        let known: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        eprintln!("SKEIN_FUZZ is `{given}`: expected one of {}", known.join(", "));
        std::process::exit(2)
    })
});

libfuzzer_sys::fuzz_target!(|input: &[u8]| TARGET.run(input));
